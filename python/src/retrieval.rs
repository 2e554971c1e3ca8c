//! From measured spectra to the snow.
use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use splitsnow::retrieve::{
    Cube, CubeIntervals, CubeRequest, FreeParameter, KnownValue, MeasuredBands, Named, NoiseModel,
    RetrieveError, SpectrumRow,
};
use splitsnow::sensor::{Sensor, SensorError, SolarSpectrum};

use crate::database::{Database, quantity};
use crate::pool::pool;

/// What is known of the snow: priors and values as on the command line, and values for each
/// spectrum by name.
type Knowledge<'py> = (
    Vec<String>,
    Vec<String>,
    Vec<(String, PyReadonlyArray1<'py, f64>)>,
);

/// Names of the results and number of unknowns; then, flat, the results of all spectra.
type Retrieved<'py> = (
    (Vec<&'static str>, usize),
    Vec<(&'static str, Bound<'py, PyArray1<f64>>)>,
    Vec<bool>,
);

fn wrong(error: impl ToString) -> PyErr {
    PyValueError::new_err(error.to_string())
}

fn parsed<T: std::str::FromStr<Err = String>>(texts: &[String]) -> PyResult<Vec<T>> {
    let parse = |text: &String| text.parse().map_err(wrong);
    texts.iter().map(parse).collect()
}

/// Finds the snow of each row of `spectra`, which has a value for each of `indices`, the
/// wavelengths of the file, or of the bands by increasing mean wavelength. `bands` are the names
/// or paths of a sensor and of a solar spectrum.
#[pyfunction]
#[pyo3(signature = (database, quantity_name, indices, bands, spectra, sigma, knowledge, noise, grid, jacobian))]
#[allow(clippy::too_many_arguments)]
pub(crate) fn retrieve<'py>(
    py: Python<'py>,
    database: &Database,
    quantity_name: &str,
    indices: Vec<usize>,
    bands: Option<(String, String)>,
    spectra: PyReadonlyArray2<'py, f64>,
    sigma: Option<PyReadonlyArray2<'py, f64>>,
    knowledge: Knowledge<'py>,
    noise: [f64; 4],
    grid: bool,
    jacobian: bool,
) -> PyResult<Retrieved<'py>> {
    let (free, fix, varying) = knowledge;
    let (free, fix) = (parsed::<FreeParameter>(&free)?, parsed::<KnownValue>(&fix)?);
    let varying: PyResult<Vec<(Named, Vec<f64>)>> = varying
        .iter()
        .map(|(name, values)| Ok((name.parse().map_err(wrong)?, values.as_slice()?.to_vec())))
        .collect();
    let measured = |(sensor, sun): &(String, String)| -> Result<MeasuredBands, SensorError> {
        let sun = SolarSpectrum::find(sun)?;
        MeasuredBands::new(&Sensor::find(sensor)?, &sun, database.file())
    };
    let bands = bands.as_ref().map(measured).transpose().map_err(wrong)?;
    let [value, level, correlated, length_nm] = noise;
    let request = CubeRequest {
        database: database.file(),
        quantity: quantity(quantity_name)?,
        indices,
        bands: bands.as_ref(),
        free: &free,
        fix: &fix,
        varying: varying?,
        noise: NoiseModel {
            value,
            level,
            correlated,
            length_nm,
        },
    };
    let intervals = match grid {
        true => CubeIntervals::Grid,
        false => CubeIntervals::Laplace,
    };
    let spectra = spectra.as_slice()?;
    let sigma = sigma.as_ref().map(|sigma| sigma.as_slice()).transpose()?;
    let pool = pool(py)?;
    let solve = || -> Result<_, RetrieveError> {
        let cube = Cube::new(request)?;
        let rows = pool.install(|| cube.solve(spectra, sigma, intervals, jacobian))?;
        Ok(((cube.names(), cube.unknowns()), rows))
    };
    let (names, rows) = py.detach(solve).map_err(wrong)?;
    let flat = |part: &dyn Fn(&SpectrumRow) -> Vec<f64>| {
        let values: Vec<f64> = rows.iter().flat_map(part).collect();
        PyArray1::from_vec(py, values)
    };
    let arrays = vec![
        ("best", flat(&|row| row.best.clone())),
        ("p68", flat(&|row| row.p68.concat())),
        ("p95", flat(&|row| row.p95.concat())),
        ("covariance", flat(&|row| row.covariance.clone())),
        ("chi_square", flat(&|row| vec![row.chi_square])),
        ("fitted", flat(&|row| row.fitted.clone())),
        ("jacobian", flat(&|row| row.jacobian.clone())),
    ];
    Ok((
        names,
        arrays,
        rows.iter().map(|row| row.converged).collect(),
    ))
}
