//! Why a run ended early.
use std::path::PathBuf;

use thiserror::Error;

use crate::engine::EngineError;
use crate::grid::GridError;
use crate::store::StoreError;

/// Why a run ended before all its jobs were done. What was finished is stored.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BatchError {
    /// Someone asked it to stop.
    #[error(
        "interrupted: {done} of {total} jobs are done and safe; run the same command again to go on"
    )]
    Interrupted {
        /// Jobs done, now and before.
        done: u64,
        /// Jobs of the database, or of the shard.
        total: u64,
    },
    /// An engine could not do a job.
    #[error("job {number} ({job}): {source}")]
    Job {
        /// Number of the job.
        number: u64,
        /// Its parameters.
        job: String,
        /// What is wrong.
        source: EngineError,
    },
    /// A database to take spectra over from cannot be used.
    #[error("nothing can be taken over from {}: {reason}", .path.display())]
    Source {
        /// Where it is.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The database could not be read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The grid and the store do not belong together.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The threads could not be started.
    #[error("cannot start the threads: {0}; ask for fewer with --threads")]
    Threads(String),
}
