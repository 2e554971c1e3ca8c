//! Sizes and errors of files: databases tailored to scenes, and compact files and exports
//! of the database of configs/thesis.toml.
use std::error::Error;
use std::path::Path;

use serde_json::Value;
use splitsnow::lookup::Database;

use super::row::Quoted;

/// Scenes of docs/performance.md.
const SCENES: [&str; 7] = [
    "igloo",
    "block",
    "sculpture",
    "thesis",
    "wet",
    "layered",
    "soot",
];
/// Files of the thesis grid below `files`, made by `just quoted`.
const THESIS: [&str; 12] = [
    "plain.safetensors",
    "plain_loose.safetensors",
    "log_quantised.safetensors",
    "log_quantised_loose.safetensors",
    "linear_quantised.safetensors",
    "linear_quantised_loose.safetensors",
    "compact.nc",
    "compact.csv",
    "compact.npz",
    "database.nc",
    "database.csv",
    "database.npz",
];

/// Rows for the files in `dir`: `scenes/NAME/snow.safetensors` and `files/NAME`.
pub(crate) fn files(dir: &Path) -> Result<Vec<Quoted>, Box<dyn Error>> {
    let mut rows = vec![];
    for scene in SCENES {
        let path = dir.join("scenes").join(scene).join("snow.safetensors");
        let database = Database::open(&path)?;
        let error_budget: Value = serde_json::from_str(&database.metadata()["error_budget"])?;
        let chains = error_budget["quantities"]
            .as_object()
            .ok_or("no error budget")?;
        let largest = |part: &str, measure: &str, i: usize| {
            let errors = chains.values().filter_map(|c| c[part][measure][i].as_f64());
            errors.fold(0.0, f64::max)
        };
        let name = format!("tailor {scene}");
        let mut add = |value: f64, setting: &str| {
            rows.push(Quoted::new(&name, value, 0.0, setting));
        };
        add(largest("total", "delta_e", 2), "largest Delta-E certified");
        add(path.metadata()?.len() as f64, "bytes");
        add(database.wavelengths_nm().len() as f64, "wavelengths");
        add(database.curves() as f64, "nodes");
        if scene == "thesis" {
            for (measure, i, setting) in [
                ("delta_e", 0, "Delta-E, mean"),
                ("delta_e", 2, "Delta-E, largest"),
                ("rmse", 0, "RMSE, mean"),
                ("rmse", 2, "RMSE, largest"),
            ] {
                let name = "lines between wavelengths";
                rows.push(Quoted::new(
                    name,
                    largest("wavelengths", measure, i),
                    0.0,
                    setting,
                ));
            }
        }
    }
    for name in THESIS {
        let bytes = dir.join("files").join(name).metadata()?.len() as f64;
        let (scale, unit) = if name.ends_with("safetensors") {
            (1e3, "kB")
        } else {
            (1e6, "MB")
        };
        rows.push(Quoted::new(
            &format!("file {name}"),
            bytes / scale,
            0.0,
            unit,
        ));
    }
    Ok(rows)
}
