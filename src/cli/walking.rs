//! What commands that simulate without storing have in common: threads and
//! a progress bar.
use std::io::{self, IsTerminal};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};

use super::common::ThreadArgs;
use crate::engine::{Cache, Control};

/// No bar for what takes less.
const PATIENCE: Duration = Duration::from_secs(1);
/// Between two redraws.
const TICK: Duration = Duration::from_millis(250);

/// Does `work` of `walks` walks on as many threads as asked for, with a
/// progress bar on standard error if that is a terminal and they are known;
/// `cancel` stops it.
pub(super) fn run<T: Send>(
    threads: ThreadArgs,
    walks: Option<u64>,
    cancel: &AtomicBool,
    work: impl FnOnce(&Control<'_>) -> T + Send,
) -> anyhow::Result<T> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.count()?)
        .build()
        .context("cannot start the threads; ask for fewer with --threads")?;
    let (rays_done, cache) = (AtomicU64::new(0), Cache::default());
    let control = Control {
        parallel: true,
        cancel,
        rays_done: &rays_done,
        cache: &cache,
    };
    Ok(std::thread::scope(|scope| {
        let (working, ended) = mpsc::channel::<()>();
        if let Some(walks) = walks.filter(|_| io::stderr().is_terminal()) {
            let rays_done = &rays_done;
            scope.spawn(move || show(ended, rays_done, walks));
        }
        let result = pool.install(|| work(&control));
        drop(working);
        result
    }))
}

/// Shows a bar until the sender of `ended` is gone.
fn show(ended: Receiver<()>, rays_done: &AtomicU64, walks: u64) {
    let start = Instant::now();
    let waiting = |time| ended.recv_timeout(time) == Err(RecvTimeoutError::Timeout);
    if !waiting(PATIENCE) {
        return;
    }
    let bar = ProgressBar::new(walks).with_elapsed(start.elapsed());
    let template = "{wide_bar} {percent}%, {per_sec} rays, {eta} left";
    // A template that does not parse would only cost the looks.
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    loop {
        bar.set_position(rays_done.load(Ordering::Relaxed));
        if !waiting(TICK) {
            break;
        }
    }
    bar.finish_and_clear();
}
