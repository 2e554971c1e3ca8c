//! Why there is no chart.
use std::io;
use std::path::PathBuf;

use thiserror::Error;

use crate::colour::ColourError;
use crate::compress::CompressError;
use crate::config::ConfigError;
use crate::engine::EngineError;
use crate::grid::GridError;
use crate::store::StoreError;

/// Why nothing was measured.
#[derive(Debug, Error)]
pub enum TradeoffError {
    /// The caller asked to stop.
    #[error("cancelled")]
    Cancelled,
    /// A sample file is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Two samples could not be told apart.
    #[error(
        "two sample files are named {name}; a sample is known by the name of its file, so rename one"
    )]
    SameName {
        /// The name.
        name: String,
    },
    /// A run that has to succeed did not.
    #[error("{sample}, {setting}: {source}")]
    Engine {
        /// Name of the sample.
        sample: String,
        /// Name of the setting.
        setting: String,
        /// What is wrong.
        source: EngineError,
    },
    /// A truth could not be kept.
    #[error("cannot write {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The threads could not be started.
    #[error("cannot start the threads: {0}; ask for fewer with --threads")]
    Threads(String),
    /// Colours could not be measured.
    #[error(transparent)]
    Colour(#[from] ColourError),
    /// The grid of the curves to compress is impossible.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The database of the curves to compress cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The database of the curves to compress is not finished.
    #[error("{missing} jobs of {} are not done; finish it with `splitsnow build`", path.display())]
    Unfinished {
        /// Jobs not done.
        missing: usize,
        /// The database.
        path: PathBuf,
    },
    /// Curves could not be compressed.
    #[error(transparent)]
    Compress(#[from] CompressError),
}
