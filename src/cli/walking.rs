//! Threads and a progress bar for the commands that simulate without storing.
use std::io::{self, IsTerminal};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};

use super::common::ThreadArgs;
use crate::engine::{Cache, Control};

/// A run shorter than this shows no progress bar.
const PATIENCE: Duration = Duration::from_secs(1);
/// Time between two redraws.
const TICK: Duration = Duration::from_millis(250);

/// Runs `work`, which traces `walks` walks, on the requested number of threads. Shows a
/// progress bar on standard error if that is a terminal and `walks` is known. `cancel` stops
/// the work.
///
/// # Errors
/// If the threads cannot be started.
pub(super) fn run<T: Send>(
    threads: ThreadArgs,
    walks: Option<u64>,
    cancel: &AtomicBool,
    work: impl FnOnce(&Control<'_>) -> T + Send,
) -> anyhow::Result<T> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.count()?)
        .build()
        .context("cannot start the threads; give a smaller --threads")?;
    let (rays_done, cache) = (AtomicU64::new(0), Cache::default());
    let control = Control {
        parallel: true,
        cancel,
        rays_done: &rays_done,
        cache: &cache,
    };
    Ok(std::thread::scope(|scope| {
        let (work_sender, work_ended) = mpsc::channel::<()>();
        if let Some(walks) = walks.filter(|_| io::stderr().is_terminal()) {
            let rays_done = &rays_done;
            scope.spawn(move || show(work_ended, rays_done, walks));
        }
        let result = pool.install(|| work(&control));
        drop(work_sender);
        result
    }))
}

/// Shows a progress bar until the sender of `ended` is dropped.
fn show(ended: Receiver<()>, rays_done: &AtomicU64, walks: u64) {
    let start = Instant::now();
    let still_running = |time| ended.recv_timeout(time) == Err(RecvTimeoutError::Timeout);
    if !still_running(PATIENCE) {
        return;
    }
    let bar = ProgressBar::new(walks).with_elapsed(start.elapsed());
    let template = "{wide_bar} {percent}%, {per_sec} rays, {eta} left";
    // If the template does not parse, the bar keeps its default style.
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    loop {
        bar.set_position(rays_done.load(Ordering::Relaxed));
        if !still_running(TICK) {
            break;
        }
    }
    bar.finish_and_clear();
}
