//! Charts and tables of the results of [`crate::lab::tradeoff`], of a comparison with a measured
//! spectrum, and of studies; patches of colour.
//!
//! A chart is drawn as SVG and as PNG. The font of the PNG is DejaVu Sans, which is part of the
//! program, so that charts look the same on every machine. The colours are
//! those of Okabe and Ito, which remain distinguishable with any kind of colour vision; every
//! series also has its own marker.
mod canvas;
mod charts;
mod csv;
mod figure;
mod panel;
mod residuals;
mod retrieval;
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
pub use retrieval::RetrievalPicture;
pub use studies::{study_table, write_study};
pub use swatches::{Swatch, SwatchRows, Swatches};
pub use text::{json, table};

/// The reason why a report failed.
#[derive(Debug, Error)]
pub enum ReportError {
    /// A chart could not be drawn.
    #[error("cannot draw {chart}: {reason}")]
    Drawing {
        /// Name of the chart.
        chart: &'static str,
        /// Error of the drawing library.
        reason: String,
    },
    /// A table could not be written as CSV.
    #[error("cannot make a table: {0}")]
    Table(#[from] ::csv::Error),
    /// The file system reported an error.
    #[error("cannot write {}: {source}; check the path, its permissions and its disk, or choose another", path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Error of the file system.
        source: io::Error,
    },
}

/// Writes all charts (SVG and PNG) and their CSV files to the folder `dir`, which is created if
/// it does not exist. Each file is written atomically. Returns the paths.
///
/// # Errors
/// [`ReportError`] if a chart cannot be drawn or a file cannot be written.
pub fn write(dir: &Path, results: &Results) -> Result<Vec<PathBuf>, ReportError> {
    let mut files: Vec<(String, Vec<u8>)> = csv::files(results)?;
    for chart in charts::all(results) {
        let failed = |reason| ReportError::Drawing {
            chart: chart.name,
            reason,
        };
        let drawing = chart.figure.drawing().map_err(failed)?;
        files.push((format!("{}.svg", chart.name), drawing.svg.into_bytes()));
        files.push((format!("{}.png", chart.name), drawing.png));
    }
    save(dir, files)
}

/// Writes files to the folder `dir`, which is created if it does not exist. Returns the paths.
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
