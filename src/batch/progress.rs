//! The bar on standard error: jobs, curves, rays per second, time left.
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use crate::grid::Jobs;

/// Between redraws, so that the rates move while long jobs run.
const TICK: Duration = Duration::from_millis(250);

pub(super) struct Progress(ProgressBar);

impl Progress {
    /// A bar over `total` jobs, of which `missing` are to be run; nothing if not
    /// `shown` or not a terminal.
    pub(super) fn new(
        shown: bool,
        missing: u64,
        total: u64,
        jobs: &Jobs,
        rays: &Arc<AtomicU64>,
    ) -> Self {
        if !shown || missing == 0 {
            return Self(ProgressBar::hidden());
        }
        let before = total - missing;
        let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr())
            .with_position(before);
        bar.reset_eta();
        let per_job = jobs.curves_per_job();
        let curves = move |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            let _ = write!(out, "{}", state.pos() * per_job);
        };
        let rays = Arc::clone(rays);
        let rate = move |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            let seconds = state.elapsed().as_secs_f64().max(1e-3);
            let _ = write!(out, "{:.2e}", rays.load(Ordering::Relaxed) as f64 / seconds);
        };
        let left = move |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            // Nothing is known before the first job has ended.
            let _ = if state.pos() == before {
                write!(out, "?")
            } else {
                write!(out, "{:#}", HumanDuration(state.eta()))
            };
        };
        let template = "{wide_bar} {pos}/{len} jobs, {curves} curves, {rate} rays/s, {left} left";
        // A template that does not parse would only cost the looks.
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(
                style
                    .with_key("curves", curves)
                    .with_key("rate", rate)
                    .with_key("left", left),
            );
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
