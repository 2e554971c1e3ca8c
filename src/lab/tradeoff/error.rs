//! Errors of the measurements.
use std::io;
use std::path::PathBuf;

use thiserror::Error;

use crate::colour::ColourError;
use crate::compress::CompressError;
use crate::config::ConfigError;
use crate::engine::EngineError;
use crate::grid::GridError;
use crate::store::StoreError;

/// The reason why a run failed.
#[derive(Debug, Error)]
pub enum TradeoffError {
    /// The caller cancelled the run.
    #[error("cancelled")]
    Cancelled,
    /// A sample file or grid file is invalid.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Two samples have the same name.
    #[error(
        "two sample files are named {name}; samples are identified by their file names; rename one"
    )]
    SameName {
        /// The common name.
        name: String,
    },
    /// An engine failed in a run that is required.
    #[error("{sample}, {setting}: {source}")]
    Engine {
        /// Name of the sample.
        sample: String,
        /// Name of the setting.
        setting: String,
        /// Error of the engine.
        source: EngineError,
    },
    /// A truth could not be stored.
    #[error("cannot write {}: {source}; check the path, its permissions and its disk, or choose another", path.display())]
    Io {
        /// Path of the file or folder.
        path: PathBuf,
        /// Error of the file system.
        source: io::Error,
    },
    /// The threads could not be started.
    #[error("cannot start the threads: {0}; give a smaller --threads")]
    Threads(String),
    /// A colorimeter cannot be set up.
    #[error(transparent)]
    Colour(#[from] ColourError),
    /// The grid of the curves to compress is invalid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The database of the curves to compress cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The database of the curves to compress is not finished.
    #[error("{missing} jobs of {} are not done; finish it with `splitsnow build`", path.display())]
    Unfinished {
        /// Number of jobs that are not done.
        missing: usize,
        /// Path of the database.
        path: PathBuf,
    },
    /// The curves could not be compressed.
    #[error(transparent)]
    Compress(#[from] CompressError),
}
