//! Why there is no database, or no compact file of it.
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

/// Why a build or a compression ended early. Jobs that were finished are stored, and will
/// not be run again.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BuildError {
    /// The caller asked it to stop.
    #[error("interrupted: {done} of {jobs} jobs are done and safe; build again to go on")]
    Interrupted {
        /// Jobs done, now and before.
        done: u64,
        /// Jobs of the database, or of the shard.
        jobs: u64,
    },
    /// The database to be deleted is one that spectra are to be taken over from.
    #[error(
        "--fresh would delete {}, which --from is to take spectra over from; choose another output directory with --out", .path.display()
    )]
    OwnSource {
        /// The source.
        path: PathBuf,
    },
    /// A database that is still being made.
    #[error(
        "{missing} of {jobs} jobs of {} are not done; finish it with `splitsnow build`", .path.display()
    )]
    Unfinished {
        /// Jobs not done.
        missing: usize,
        /// All jobs.
        jobs: u64,
        /// The database.
        path: PathBuf,
    },
    /// A job failed, or a database to take spectra over from cannot be used.
    #[error(transparent)]
    Batch(BatchError),
    /// The database cannot be made, read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A data table cannot be read.
    #[error(transparent)]
    Optics(#[from] OpticsError),
    /// The environment says no number of threads.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
    /// The observer cannot be set up.
    #[error(transparent)]
    Colour(#[from] ColourError),
    /// The curves cannot be compressed as asked.
    #[error("{}: {source}", quantity.name())]
    Compress {
        /// Which of them.
        quantity: Quantity,
        /// Why.
        source: CompressError,
    },
    /// The compact file cannot be written.
    #[error(transparent)]
    Compact(#[from] CompactError),
    /// The compact file cannot be read back.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// The system does not say how large the compact file is.
    #[error("cannot read {}: {source}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
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
