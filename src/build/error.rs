//! Errors of builds and compressions.
use std::io;
use std::path::PathBuf;

use thiserror::Error;

use crate::batch::BatchError;
use crate::colour::ColourError;
use crate::compress::{CompactError, CompressError};
use crate::lookup::LookupError;
use crate::measurement::Quantity;
use crate::optics::OpticsError;
use crate::store::StoreError;
use crate::threads::ThreadsError;

/// Why a build or a compression failed. Finished jobs are stored and will not be run again.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BuildError {
    /// The build was cancelled.
    #[error("interrupted: {done} of {jobs} jobs are done and safe; build again to continue")]
    Interrupted {
        /// Number of jobs done, in this run and before.
        done: u64,
        /// Number of jobs of the database or of the shard.
        jobs: u64,
    },
    /// The database to be deleted is one whose spectra should be reused.
    #[error(
        "--fresh would delete {}, whose spectra --from should reuse; choose another output directory with --out", .path.display()
    )]
    FreshDeletesSource {
        /// The database.
        path: PathBuf,
    },
    /// The database is not finished.
    #[error(
        "{missing} of {jobs} jobs of {} are not done; finish it with `splitsnow build`", .path.display()
    )]
    Unfinished {
        /// Number of jobs that are not done.
        missing: usize,
        /// Number of all jobs.
        jobs: u64,
        /// The database.
        path: PathBuf,
    },
    /// A job failed, or a database whose spectra should be reused cannot be used.
    #[error(transparent)]
    Batch(BatchError),
    /// The database cannot be created, read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A data table cannot be read.
    #[error(transparent)]
    Optics(#[from] OpticsError),
    /// An environment variable has an invalid number of threads.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
    /// Colours cannot be computed at these wavelengths.
    #[error(transparent)]
    Colour(#[from] ColourError),
    /// The curves cannot be compressed as requested.
    #[error("{}: {source}", quantity.name())]
    Compress {
        /// The quantity of the curves.
        quantity: Quantity,
        /// The error of the compression.
        source: CompressError,
    },
    /// The compact file cannot be written.
    #[error(transparent)]
    Compact(#[from] CompactError),
    /// The compact file cannot be read back.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// The size of the compact file cannot be determined.
    #[error("cannot read {}: {source}; check its permissions and run the same command again", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
}

impl From<BatchError> for BuildError {
    fn from(error: BatchError) -> Self {
        match error {
            BatchError::Interrupted { done, total } => Self::Interrupted { done, jobs: total },
            BatchError::Store(error) => Self::Store(error),
            error => Self::Batch(error),
        }
    }
}
