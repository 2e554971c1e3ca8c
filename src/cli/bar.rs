//! The progress bar of a build on standard error: jobs, curves, rays per second and time
//! left, followed by a spinner while the build compresses.
use std::io::{IsTerminal, stderr};
use std::sync::atomic::Ordering;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use super::common::{self, Spinner};
use crate::batch::{Progress, RunInfo};

/// Time between redraws, short enough to keep the rates current during long jobs.
const TICK: Duration = Duration::from_millis(250);
/// Time between lines in a log, where no bar is shown.
const LOG_PAUSE: Duration = Duration::from_secs(60);

/// The progress bar, shown from the start of a run if standard error is a terminal, and the
/// spinner shown during compression.
#[derive(Debug)]
pub(super) struct Bar {
    bar: ProgressBar,
    spinner: Mutex<Option<Spinner>>,
    announces: bool,
    /// When the last line was written to a log.
    logged: Mutex<Instant>,
}

impl Bar {
    /// With `announces`, the number of jobs is printed when the first of them starts, because
    /// the bar is shown on a terminal only.
    pub(super) fn new(announces: bool) -> Self {
        Self {
            bar: ProgressBar::hidden(),
            spinner: Mutex::default(),
            announces,
            logged: Mutex::new(Instant::now()),
        }
    }
}

/// The first line of the summary of a build.
pub(super) fn counts(jobs: u64, run: u64) -> String {
    format!("{jobs} jobs, {run} of them run now\n")
}

impl Progress for Bar {
    fn begin(&self, run: RunInfo) {
        let RunInfo {
            done,
            jobs,
            curves_per_job,
            rays,
        } = run;
        if self.announces {
            // What prevents this also prevents the summary, which reports it.
            let _ = common::print(&counts(jobs, jobs - done));
        }
        let bar = &self.bar;
        bar.set_length(jobs);
        bar.set_position(done);
        bar.reset_elapsed();
        bar.reset_eta();
        let curves = move |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            let _ = write!(out, "{}", state.pos() * curves_per_job);
        };
        let rate = move |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            let seconds = state.elapsed().as_secs_f64().max(1e-3);
            let _ = write!(out, "{:.2e}", rays.load(Ordering::Relaxed) as f64 / seconds);
        };
        let time_left = move |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            // No estimate exists before the first job has ended.
            let _ = if state.pos() == done {
                write!(out, "?")
            } else {
                write!(out, "{:#}", HumanDuration(state.eta()))
            };
        };
        let template = "{wide_bar} {pos}/{len} jobs, {curves} curves, {rate} rays/s, {left} left";
        // If the template does not parse, the bar keeps its default style.
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(
                style
                    .with_key("curves", curves)
                    .with_key("rate", rate)
                    .with_key("left", time_left),
            );
        }
        bar.set_draw_target(ProgressDrawTarget::stderr());
        bar.enable_steady_tick(TICK);
    }

    fn job_done(&self) {
        self.bar.inc(1);
        let mut logged = self.logged.lock().unwrap_or_else(PoisonError::into_inner);
        if !stderr().is_terminal() && logged.elapsed() >= LOG_PAUSE {
            *logged = Instant::now();
            let (done, jobs) = (self.bar.position(), self.bar.length().unwrap_or_default());
            let left = common::duration(self.bar.eta().as_secs_f64());
            common::note(&format!(
                "{done} of {jobs} jobs are done, about {left} left"
            ));
        }
    }

    fn end(&self) {
        self.bar.finish_and_clear();
    }

    fn compressing(&self) {
        let mut spinner = self.spinner.lock().unwrap_or_else(PoisonError::into_inner);
        *spinner = Some(Spinner::new("compressing"));
    }
}
