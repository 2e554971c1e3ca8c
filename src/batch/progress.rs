//! Progress reports of a run.
use std::fmt::Debug;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

/// The state at the start of a run.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct RunInfo {
    /// Number of jobs that are done already.
    pub done: u64,
    /// Number of all jobs of the database or of the shard.
    pub jobs: u64,
    /// Number of curves per job.
    pub curves_per_job: u64,
    /// Number of rays walked in this run so far; updated while it runs.
    pub rays: Arc<AtomicU64>,
}

/// Receives progress reports of a run, for example to draw a progress bar.
pub trait Progress: Debug + Sync {
    /// Called before the first job; not called if no jobs are missing.
    fn begin(&self, run: RunInfo);
    /// Called when a job is done and stored, by the thread that ran it.
    fn job_done(&self);
    /// Called after the last job, also after a failure or cancellation.
    fn end(&self);
    /// Called when all jobs are done, before their curves are compressed.
    fn compressing(&self) {}
}
