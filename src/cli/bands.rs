//! `--bands`: averages of spectra over the bands of a sensor.
use std::fmt::Write;

use serde_json::{Value, json};

use crate::engine::Engine;
use crate::export::{ExportError, ExportTable};
use crate::lookup::Database;
use crate::measurement::{Measured, Spectrum};
use crate::optics::MODEL_RANGE_NM;
use crate::retrieve::MeasuredBands;
use crate::sensor::{BandAverages, Sensor, SensorError, SolarSpectrum, SpectralResponse};

/// Step of the wavelengths that `simulate --bands` chooses, nm.
const STEP_NM: f64 = 5.0;

#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Bands of sensors")]
pub(super) struct Args {
    /// Average over the bands of a sensor: sentinel2a, sentinel3_olci, modis, viirs, landsat8,
    /// emit, prisma, or a table of responses; broadband for the albedo of all sunlight and of
    /// its visible and near-infrared parts; par for photosynthetically active radiation, as
    /// photons. SENSOR:BAND,BAND chooses bands
    #[arg(long, value_name = "SENSOR|FILE")]
    bands: Option<String>,
    /// Solar spectrum that weights the wavelengths within a band: astm_global, astm_direct or
    /// astm_space (ASTM G173-03), subarctic_winter, equal_energy, or a table of power
    #[arg(
        long,
        value_name = "NAME|FILE",
        default_value = "astm_global",
        requires = "bands"
    )]
    sun: String,
}

/// A sensor and the solar spectrum under which it averages.
pub(super) struct SensorBands {
    sensor: Sensor,
    sun: SolarSpectrum,
}

impl Args {
    /// Whether `--bands` is given.
    pub(super) fn is_given(&self) -> bool {
        self.bands.is_some()
    }

    /// Reads the sensor and the solar spectrum, if `--bands` is given.
    pub(super) fn open(&self) -> Result<Option<SensorBands>, SensorError> {
        let Some(bands) = &self.bands else {
            return Ok(None);
        };
        Ok(Some(SensorBands {
            sensor: Sensor::find(bands)?,
            sun: SolarSpectrum::find(&self.sun)?,
        }))
    }
}

/// Name, mean wavelength and limits of a band as CSV, and their names.
const BAND_COLUMNS: &str = "band,centre_nm,from_nm,to_nm";

fn band_cells(band: &SpectralResponse) -> String {
    let name = match band.name() {
        name if name.contains([',', '"']) => format!("\"{}\"", name.replace('"', "\"\"")),
        name => name.to_owned(),
    };
    let (from, to) = band.range_nm();
    format!(
        "{name},{:.2},{},{}",
        band.centre_nm(),
        rounded(from),
        rounded(to)
    )
}

/// Range of the sensor `broadband`, nm.
const BROADBAND_NM: (f64, f64) = (350.0, 2500.0);

/// Limits of Gaussians have no exact decimals.
fn rounded(nm: f64) -> f64 {
    (nm * 1e4).round() / 1e4
}

impl SensorBands {
    /// The wavelengths at which samples are simulated for the bands, nm.
    pub(super) fn wavelengths_nm(&self) -> Vec<f64> {
        self.sensor.wavelengths_nm(STEP_NM, MODEL_RANGE_NM)
    }

    pub(super) fn averages(&self, wavelengths_nm: &[f64]) -> Result<BandAverages, SensorError> {
        BandAverages::new(&self.sensor, &self.sun, wavelengths_nm)
    }

    /// The bands as measured values, for spectra of `database`.
    pub(super) fn measured(&self, database: &Database) -> Result<MeasuredBands, SensorError> {
        MeasuredBands::new(&self.sensor, &self.sun, database)
    }

    /// The averages of a table of spectra.
    pub(super) fn table(&self, table: ExportTable) -> Result<ExportTable, ExportError> {
        table.over_bands(&self.sensor, &self.sun)
    }

    /// Comment lines on the sensor, the solar spectrum and the wavelengths of the spectrum.
    pub(super) fn comments(&self, wavelengths_nm: &[f64]) -> String {
        let (low, high) = BROADBAND_NM;
        let outside = self.share_outside();
        let outside = outside.map_or(String::new(), |share| {
            format!(
                "; {:.2} % of its energy is outside {low}-{high} nm",
                100.0 * share
            )
        });
        let ends = wavelengths_nm.first().zip(wavelengths_nm.last());
        let (from, to) = ends.unwrap_or((&f64::NAN, &f64::NAN));
        format!(
            "# bands: {}{}\n# sun: {}{outside}\n# wavelengths: {} from {from} to {to} nm\n",
            self.sensor.name().escape_debug(),
            self.sensor
                .about()
                .map_or(String::new(), |about| format!("; {about}")),
            self.sun.name().escape_debug(),
            wavelengths_nm.len()
        )
    }

    fn share_outside(&self) -> Option<f64> {
        let within = self.sun.share(BROADBAND_NM.0, BROADBAND_NM.1);
        within.map(|share| 1.0 - share)
    }

    /// Rows of one quantity.
    pub(super) fn csv(&self, values: &[f64]) -> String {
        let mut out = format!("{BAND_COLUMNS},value\n");
        for (band, value) in self.sensor.bands().iter().zip(values) {
            let _ = writeln!(out, "{},{value}", band_cells(band));
        }
        out
    }

    /// The columns that describe a band, and the cells of each band.
    pub(super) fn cells(&self) -> (&'static str, impl Iterator<Item = String>) {
        (BAND_COLUMNS, self.sensor.bands().iter().map(band_cells))
    }

    /// The bands as JSON: a list per column.
    pub(super) fn json(&self) -> Value {
        let of = |part: &dyn Fn(&SpectralResponse) -> Value| -> Value {
            self.sensor.bands().iter().map(part).collect()
        };
        json!({
            "sensor": self.sensor.name(),
            "sun": self.sun.name(),
            "sun_outside_share": self.share_outside(),
            "band": of(&|band| json!(band.name())),
            "centre_nm": of(&|band| json!(band.centre_nm())),
            "from_nm": of(&|band| json!(band.range_nm().0)),
            "to_nm": of(&|band| json!(band.range_nm().1)),
        })
    }

    /// The averages of a simulated spectrum.
    pub(super) fn simulated(
        self,
        averages: &BandAverages,
        spectrum: &Spectrum,
        engine: Engine,
    ) -> SimulatedBands {
        // only `reference` walks for each wavelength separately
        let independent = engine == Engine::Reference;
        let of = |column: &[Measured]| -> Vec<Measured> {
            let (values, errors): (Vec<f64>, Vec<f64>) =
                column.iter().map(|m| (m.value, m.se)).unzip();
            let errors = averages.errors(&errors, independent);
            let values = averages.values(&values).into_iter().zip(errors);
            values.map(|(value, se)| Measured { value, se }).collect()
        };
        SimulatedBands {
            reflectance: of(&spectrum.reflectance),
            transmittance: of(&spectrum.transmittance),
            bands: self,
        }
    }
}

/// Simulated values of bands.
pub(super) struct SimulatedBands {
    bands: SensorBands,
    reflectance: Vec<Measured>,
    transmittance: Vec<Measured>,
}

impl SimulatedBands {
    /// Comment lines, then a row for each band.
    pub(super) fn csv(&self, wavelengths_nm: &[f64]) -> String {
        let mut out = self.bands.comments(wavelengths_nm);
        let _ = writeln!(
            out,
            "{BAND_COLUMNS},reflectance,reflectance_se,transmittance,transmittance_se,absorptance"
        );
        let bands = self.bands.sensor.bands().iter();
        let values = self.reflectance.iter().zip(&self.transmittance);
        for (band, (r, t)) in bands.zip(values) {
            let absorptance = 1.0 - r.value - t.value;
            let _ = writeln!(
                out,
                "{},{:?},{:?},{:?},{:?},{absorptance:?}",
                band_cells(band),
                r.value,
                r.se,
                t.value,
                t.se
            );
        }
        out
    }

    /// The content of [`Self::csv`] as JSON.
    pub(super) fn json(&self) -> Value {
        let list = |column: &[Measured], part: fn(&Measured) -> f64| -> Vec<f64> {
            column.iter().map(part).collect()
        };
        let mut value = self.bands.json();
        value["reflectance"] = json!(list(&self.reflectance, |m| m.value));
        value["reflectance_se"] = json!(list(&self.reflectance, |m| m.se));
        value["transmittance"] = json!(list(&self.transmittance, |m| m.value));
        value["transmittance_se"] = json!(list(&self.transmittance, |m| m.se));
        value
    }
}
