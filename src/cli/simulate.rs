//! What commands that simulate without storing have in common: threads, a
//! progress bar, Ctrl-C, and output as a whole or not at all.
use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};

use crate::engine::Control;

/// No bar for what takes less.
const PATIENCE: Duration = Duration::from_secs(1);
/// Between two redraws.
const TICK: Duration = Duration::from_millis(250);
/// Exit code after Ctrl-C: 128 and the number of SIGINT.
const INTERRUPTED: i32 = 130;

/// Set by Ctrl-C.
static CANCEL: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// From now on Ctrl-C (or SIGTERM) stops the simulation; a second one ends the
/// program at once.
pub(super) fn listen() -> anyhow::Result<()> {
    let cancel = Arc::clone(&CANCEL);
    ctrlc::set_handler(move || {
        if cancel.swap(true, Ordering::Relaxed) {
            std::process::exit(INTERRUPTED);
        }
    })
    .context("cannot listen for Ctrl-C")
}

/// A line on standard error; without one there is nobody to tell.
pub(super) fn remark(text: &str) {
    let _ = writeln!(io::stderr(), "{text}");
}

/// Ends the program after Ctrl-C.
pub(super) fn interrupted() -> ! {
    remark("interrupted; nothing was written");
    std::process::exit(INTERRUPTED)
}

/// Does `work` of `walks` walks on `threads` threads (0: one per core), with a
/// progress bar on standard error if that is a terminal.
pub(super) fn run<T: Send>(
    threads: usize,
    walks: u64,
    work: impl FnOnce(&Control<'_>) -> T + Send,
) -> anyhow::Result<T> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .context("cannot start the threads; ask for fewer with --threads")?;
    let rays_done = AtomicU64::new(0);
    let control = Control {
        parallel: true,
        cancel: &CANCEL,
        rays_done: &rays_done,
    };
    Ok(std::thread::scope(|scope| {
        let (working, ended) = mpsc::channel::<()>();
        if io::stderr().is_terminal() {
            scope.spawn(|| show(ended, &rays_done, walks));
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

/// Writes `text` to standard output; a reader that has gone away wanted no more.
pub(super) fn print(text: &str) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    match written {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        written => written.context("cannot write to standard output"),
    }
}
