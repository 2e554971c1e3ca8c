//! The bar on standard error: jobs, curves, rays per second, time left.
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use crate::grid::Jobs;

/// Between redraws, so that the rates move while long jobs run.
const TICK: Duration = Duration::from_millis(250);

pub(super) struct Progress(ProgressBar);

impl Progress {
    /// A bar over the `missing` jobs; nothing if not `shown` or not a terminal.
    pub(super) fn new(shown: bool, missing: &[u64], jobs: &Jobs, rays: &Arc<AtomicU64>) -> Self {
        if !shown || missing.is_empty() {
            return Self(ProgressBar::hidden());
        }
        let length = missing.len() as u64;
        let bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::stderr());
        let per_job = jobs.curves_per_job();
        let curves = move |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            let _ = write!(out, "{}", state.pos() * per_job);
        };
        let rays = Arc::clone(rays);
        let rate = move |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            let seconds = state.elapsed().as_secs_f64().max(1e-3);
            let _ = write!(out, "{:.2e}", rays.load(Ordering::Relaxed) as f64 / seconds);
        };
        let template = "{wide_bar} {pos}/{len} jobs, {curves} curves, {rate} rays/s, {eta} left";
        // A template that does not parse would only cost the looks.
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.with_key("curves", curves).with_key("rate", rate));
        }
        bar.enable_steady_tick(TICK);
        Self(bar)
    }

    pub(super) fn job_done(&self) {
        self.0.inc(1);
    }

    pub(super) fn end(&self) {
        self.0.finish_and_clear();
    }
}
