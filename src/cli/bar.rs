//! The progress bar of a build on standard error: jobs, curves, rays per second and time
//! left, followed by a spinner while the build compresses.
use std::io::{IsTerminal, stderr};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
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
    /// The thread that writes to a log, and what ends it when it is dropped.
    log: Mutex<Option<(Sender<()>, JoinHandle<()>)>>,
}

impl Bar {
    /// With `announces`, the number of jobs is printed when the first of them starts, because
    /// the bar is shown on a terminal only.
    pub(super) fn new(announces: bool) -> Self {
        Self {
            bar: ProgressBar::hidden(),
            spinner: Mutex::default(),
            announces,
            log: Mutex::default(),
        }
    }

    fn log(&self) -> MutexGuard<'_, Option<(Sender<()>, JoinHandle<()>)>> {
        self.log.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The time left when, since the start, the jobs done have risen from the first of `counts` to the
/// second, of the third; `None` before the first job has ended. Long jobs end rarely, so the mean
/// rate counts, not the latest.
fn time_left(elapsed: Duration, [before, now, jobs]: [u64; 3]) -> Option<Duration> {
    let run = now.checked_sub(before).filter(|run| *run > 0)?;
    Some(elapsed.mul_f64(jobs.saturating_sub(now) as f64 / run as f64))
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
        let left = move |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            // No estimate exists before the first job has ended.
            let _ = match time_left(state.elapsed(), [done, state.pos(), jobs]) {
                None => write!(out, "?"),
                Some(left) => write!(out, "{:#}", HumanDuration(left)),
            };
        };
        let template = "{wide_bar} {pos}/{len} jobs, {curves} curves, {rate} rays/s, {left} left";
        // If the template does not parse, the bar keeps its default style.
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(
                style
                    .with_key("curves", curves)
                    .with_key("rate", rate)
                    .with_key("left", left),
            );
        }
        bar.set_draw_target(ProgressDrawTarget::stderr());
        bar.enable_steady_tick(TICK);
        if !stderr().is_terminal() {
            let (end, ended) = channel();
            let (bar, begin) = (bar.clone(), Instant::now());
            let thread = thread::spawn(move || {
                while ended.recv_timeout(LOG_PAUSE) == Err(RecvTimeoutError::Timeout) {
                    let now = bar.position();
                    let left = time_left(begin.elapsed(), [done, now, jobs]);
                    let left = left.map_or_else(String::new, |left| {
                        format!(", about {} left", common::duration(left.as_secs_f64()))
                    });
                    common::note(&format!("{now} of {jobs} jobs are done{left}"));
                }
            });
            *self.log() = Some((end, thread));
        }
    }

    fn job_done(&self) {
        self.bar.inc(1);
    }

    fn end(&self) {
        self.bar.finish_and_clear();
        if let Some((end, thread)) = self.log().take() {
            drop(end);
            // A panic there cost lines of a log only.
            let _ = thread.join();
        }
    }

    fn compressing(&self) {
        let mut spinner = self.spinner.lock().unwrap_or_else(PoisonError::into_inner);
        *spinner = Some(Spinner::new("compressing"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_follows_the_mean_rate() {
        let minute = Duration::from_secs(60);
        assert_eq!(time_left(minute, [3, 3, 9]), None);
        assert_eq!(time_left(minute, [3, 5, 9]), Some(2 * minute));
        assert_eq!(time_left(minute, [3, 9, 9]), Some(Duration::ZERO));
    }
}
