//! Averages of spectra over the bands of a sensor.
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use splitsnow::sensor::{BandAverages, Sensor, SensorError, SolarSpectrum};

/// Name, mean wavelength, first and last wavelength (nm) of a band, and its weights.
type PyBand = (String, f64, f64, f64, Vec<f64>);

/// The bands of a sensor, with the weights of wavelengths (nm, strictly increasing).
#[pyfunction]
pub(crate) fn bands(sensor: &str, wavelengths_nm: Vec<f64>, sun: &str) -> PyResult<Vec<PyBand>> {
    let found = || -> Result<Vec<PyBand>, SensorError> {
        let sensor = Sensor::find(sensor)?;
        let averages = BandAverages::new(&sensor, &SolarSpectrum::find(sun)?, &wavelengths_nm)?;
        let both = sensor.bands().iter().zip(averages.weights());
        let band = both.map(|(band, weights)| {
            let (from, to) = band.range_nm();
            let name = band.name().to_owned();
            (name, band.centre_nm(), from, to, weights.clone())
        });
        Ok(band.collect())
    };
    found().map_err(|error| PyValueError::new_err(error.to_string()))
}
