//! The errors of the spectra of a compact file, as the file states them.
use serde_json::Value;

use crate::lookup::Database;
use crate::measurement::Quantity;
use crate::spectrum::Band;

/// The standard deviation of the spectra of one quantity of a compact file from the engine, and
/// where it is from.
#[derive(Debug, Clone, PartialEq)]
pub struct EmulatorError {
    /// One per wavelength.
    pub sd: Vec<f64>,
    /// What the file states.
    pub source: String,
}

impl EmulatorError {
    /// Of `quantity` in `database`. It is the mean error of its error budget, if there is one;
    /// else the mean error of the compression and the standard error of the simulation in each
    /// band, or of the compression alone; else 0.
    #[must_use]
    pub fn of(database: &Database, quantity: Quantity) -> Self {
        let nm = database.wavelengths_nm();
        let entry = |key: &str| -> Option<Value> {
            serde_json::from_str(database.metadata().get(key)?).ok()
        };
        let budget = entry("error_budget").or_else(|| entry("certificate"));
        let total = budget
            .as_ref()
            .and_then(|budget| budget["quantities"][quantity.name()]["total"]["rmse"][0].as_f64());
        if let Some(total) = total {
            return Self {
                sd: vec![total; nm.len()],
                source: format!("{total:.4}, the mean error of its error budget"),
            };
        }
        let bands = entry("band_errors").unwrap_or_default();
        let in_band = |nm: f64| -> Option<f64> {
            let name = Band::containing(nm).name();
            let mut bands = bands[quantity.name()].as_array()?.iter();
            let band = bands.find(|band| band["band"] == name)?;
            let compression = band["rmse"]["mean"].as_f64()?;
            let simulation = band["standard_error"].as_f64().unwrap_or(0.0);
            Some(libm::hypot(compression, simulation))
        };
        let advice = "between the nodes unknown: run `splitsnow verify` to measure it";
        let sd: Option<Vec<f64>> = nm.iter().map(|nm| in_band(*nm)).collect();
        if let Some(sd) = sd {
            let largest = sd.iter().copied().fold(0.0, f64::max);
            return Self {
                sd,
                source: format!("at most {largest:.4} on its nodes; {advice}"),
            };
        }
        let rows = entry("error_table").unwrap_or_default();
        let chosen = &rows[quantity.name()]["chosen"];
        let row = rows[quantity.name()]["rows"].as_array().and_then(|rows| {
            let mut rows = rows.iter();
            rows.find(|row| row["components"] == *chosen)
        });
        let compression = row.and_then(|row| row["rmse"]["mean"].as_f64());
        let sd = compression.unwrap_or(0.0);
        Self {
            sd: vec![sd; nm.len()],
            source: format!("{sd:.4} by compression; {advice}"),
        }
    }
}
