//! Charts and tables of what [`crate::lab::tradeoff`] measured, of a comparison with
//! a measured spectrum, and of studies; patches of colour.
//!
//! A chart is drawn once, as SVG; its PNG is that SVG rasterised with the font
//! DejaVu Sans, which is part of the program, so that it looks the same on every
//! machine, with fonts or without. Colours are Okabe and Ito's, told apart with
//! any kind of colour vision, and every series has a marker of its own as well.
mod charts;
mod csv;
mod figure;
mod panel;
mod residuals;
mod studies;
mod style;
mod swatches;
mod text;

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::atomic;
use crate::lab::tradeoff::Results;

pub use residuals::{Picture, Residuals};
pub use studies::{study_table, write_study};
pub use swatches::{Swatch, SwatchRows, Swatches};
pub use text::{json, table};

/// Why there are no charts.
#[derive(Debug, Error)]
pub enum ReportError {
    /// A chart could not be drawn.
    #[error("cannot draw {chart}: {reason}")]
    Drawing {
        /// Which.
        chart: &'static str,
        /// Why.
        reason: String,
    },
    /// A table could not be put into CSV.
    #[error("cannot make a table: {0}")]
    Table(#[from] ::csv::Error),
    /// The system refused.
    #[error("cannot write {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// Writes all charts (SVG and PNG) and their CSV files to the folder `dir`, which
/// is made if need be; each file as a whole or not at all. Gives their paths.
///
/// # Errors
/// See [`ReportError`].
pub fn write(dir: &Path, results: &Results) -> Result<Vec<PathBuf>, ReportError> {
    let mut files: Vec<(String, Vec<u8>)> = csv::files(results)?;
    for chart in charts::all(results) {
        let failed = |reason| ReportError::Drawing {
            chart: chart.name,
            reason,
        };
        let svg = chart.figure.svg().map_err(failed)?;
        let png = figure::png(&svg).map_err(failed)?;
        files.push((format!("{}.svg", chart.name), svg.into_bytes()));
        files.push((format!("{}.png", chart.name), png));
    }
    save(dir, files)
}

/// Writes files to the folder `dir`, which is made if need be. Gives their paths.
fn save(dir: &Path, files: Vec<(String, Vec<u8>)>) -> Result<Vec<PathBuf>, ReportError> {
    let io = |path: &Path| {
        let path = path.to_owned();
        |source| ReportError::Io { path, source }
    };
    std::fs::create_dir_all(dir).map_err(io(dir))?;
    let mut paths = Vec::new();
    for (name, bytes) in files {
        let path = dir.join(name);
        atomic::write(&path, &bytes).map_err(io(&path))?;
        paths.push(path);
    }
    Ok(paths)
}
