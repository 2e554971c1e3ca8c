//! Why there is no plan.
use thiserror::Error;

use crate::engine::EngineError;
use crate::grid::GridError;
use crate::optics::OpticsError;
use crate::threads::ThreadsError;

/// Why there is no plan.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The grid is impossible.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// An engine could not run a job.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A data table cannot be read.
    #[error(transparent)]
    Optics(#[from] OpticsError),
    /// The environment says no number of threads.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
    /// A thread that measured has panicked.
    #[error("a pilot job failed")]
    Panicked,
}
