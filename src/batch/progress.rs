//! What is told while a run goes on.
use std::fmt::Debug;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

/// Where a run begins.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Begin {
    /// Jobs that are stored already.
    pub done: u64,
    /// All jobs of the database, or of the shard.
    pub jobs: u64,
    /// Curves of a job.
    pub curves_per_job: u64,
    /// Counts the rays that are walked in this run.
    pub rays: Arc<AtomicU64>,
}

/// Is told how a run goes on, such as a bar on a screen.
pub trait Progress: Debug + Sync {
    /// Jobs will be run; not called if there are none.
    fn begin(&self, run: Begin);
    /// A job has ended and is stored; called by the thread that ran it.
    fn job_done(&self);
    /// No more jobs will be run, for whatever reason.
    fn end(&self);
    /// All jobs are done, and their curves are about to be compressed.
    fn compressing(&self) {}
}
