//! Errors of planning.
use thiserror::Error;

use crate::engine::EngineError;
use crate::grid::GridError;
use crate::optics::OpticsError;
use crate::threads::ThreadsError;

/// Why a build could not be planned.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The grid is invalid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// An engine failed in a pilot job.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A data table cannot be read.
    #[error(transparent)]
    Optics(#[from] OpticsError),
    /// An environment variable has an invalid number of threads.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
    /// A thread that ran pilot jobs panicked.
    #[error(
        "a pilot job panicked; this is a bug in splitsnow, please report it with the grid file"
    )]
    Panicked,
}
