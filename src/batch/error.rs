//! Errors of the job runner.
use std::path::PathBuf;

use thiserror::Error;

use crate::engine::EngineError;
use crate::grid::GridError;
use crate::store::StoreError;

/// Why a run ended before all its jobs were done. Finished jobs are stored.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BatchError {
    /// The run was cancelled.
    #[error(
        "interrupted: {done} of {total} jobs are done and safe; run the same command again to continue"
    )]
    Interrupted {
        /// Number of jobs done, in this run and before.
        done: u64,
        /// Number of jobs of the database or of the shard.
        total: u64,
    },
    /// An engine failed in a job.
    #[error("job {number} ({job}): {source}")]
    Job {
        /// Number of the job.
        number: u64,
        /// Parameters of the job.
        job: String,
        /// The error of the engine.
        source: EngineError,
    },
    /// A database whose spectra should be reused cannot be used.
    #[error("the spectra of {} cannot be reused: {reason}; leave this --from out", .path.display())]
    Reuse {
        /// The database.
        path: PathBuf,
        /// Why it cannot be used.
        reason: String,
    },
    /// The database could not be read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The grid does not fit the store.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The threads could not be started.
    #[error("cannot start the threads: {0}; use fewer with --threads")]
    Threads(String),
}
