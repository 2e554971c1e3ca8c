//! Work limited by a budget of CPU time.
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use cpu_time::ProcessTime;
use rayon::prelude::*;

/// Interval at which the CPU time is checked.
const TICK: Duration = Duration::from_millis(5);

/// Runs `work` with a stop flag. The flag is set when `cancel` is set, or when the process
/// has used `seconds` of CPU time since the call, summed over all threads (`None`: no limit).
pub fn with_cpu_limit<T>(
    seconds: Option<f64>,
    cancel: &AtomicBool,
    work: impl FnOnce(&AtomicBool) -> T,
) -> T {
    let exhausted = seconds.is_some_and(|budget| budget <= 0.0);
    let (stop, ended) = (AtomicBool::new(exhausted), AtomicBool::new(false));
    let begin = ProcessTime::now();
    thread::scope(|scope| {
        let watcher = scope.spawn(|| {
            // `EndWatcher` sets `ended` even if the work panics: the scope waits for this
            // thread
            while !ended.load(Ordering::Relaxed) {
                let late = seconds.is_some_and(|budget| begin.elapsed().as_secs_f64() > budget);
                if late || cancel.load(Ordering::Relaxed) {
                    stop.store(true, Ordering::Relaxed);
                }
                thread::park_timeout(TICK);
            }
        });
        let _end = EndWatcher {
            ended: &ended,
            watcher: watcher.thread(),
        };
        work(&stop)
    })
}

/// Ends the watcher thread when dropped.
struct EndWatcher<'a> {
    ended: &'a AtomicBool,
    watcher: &'a thread::Thread,
}

impl Drop for EndWatcher<'_> {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        self.watcher.unpark();
    }
}

/// Calls `f` with 0, 1, ..., `count` - 1, started in this order on all threads of the rayon
/// pool. No further calls are started once `stop` is set or a call fails. The result of a
/// call that was not started is `None`.
///
/// # Errors
/// An error that `f` returned.
pub fn par_map_in_order<T: Send, E: Send>(
    count: usize,
    stop: &AtomicBool,
    f: impl Fn(usize) -> Result<Option<T>, E> + Sync,
) -> Result<Vec<Option<T>>, E> {
    let next = AtomicUsize::new(0);
    let results: Mutex<Vec<Option<T>>> = Mutex::new((0..count).map(|_| None).collect());
    let threads = rayon::current_num_threads();
    (0..threads)
        .into_par_iter()
        .with_max_len(1)
        .try_for_each(|_| {
            loop {
                let number = next.fetch_add(1, Ordering::Relaxed);
                if number >= count || stop.load(Ordering::Relaxed) {
                    return Ok(());
                }
                let result = f(number).inspect_err(|_| next.store(count, Ordering::Relaxed))?;
                results.lock().unwrap_or_else(PoisonError::into_inner)[number] = result;
            }
        })?;
    Ok(results.into_inner().unwrap_or_else(PoisonError::into_inner))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_ends_with_its_budget_or_when_it_is_cancelled() {
        let spin = |stop: &AtomicBool| while !stop.load(Ordering::Relaxed) {};
        let cancel = AtomicBool::new(false);
        let begin = ProcessTime::now();
        with_cpu_limit(Some(0.1), &cancel, spin);
        // other tests of this process work too: only the lower bound is sure
        assert!(begin.elapsed().as_secs_f64() > 0.1);
        cancel.store(true, Ordering::Relaxed);
        with_cpu_limit(None, &cancel, spin);
    }

    #[test]
    fn work_that_panics_ends() {
        let never = AtomicBool::new(false);
        let work = || with_cpu_limit(None, &never, |_| panic!("as meant"));
        let ended = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
        assert!(ended.is_err());
    }

    #[test]
    fn what_was_done_is_kept() {
        let stop = AtomicBool::new(false);
        let some = par_map_in_order(100, &stop, |number| {
            if number == 20 {
                stop.store(true, Ordering::Relaxed);
            }
            Ok::<_, ()>((number != 3).then_some(number))
        });
        let some = some.unwrap_or_default();
        let done: Vec<usize> = some.iter().flatten().copied().collect();
        assert_eq!(
            (some.len(), some[2], some[3], some[99]),
            (100, Some(2), None, None)
        );
        assert!(done.contains(&20) && done.len() >= 20, "{done:?}");
        let failed = par_map_in_order(5, &AtomicBool::new(false), |n| {
            if n == 1 { Err(n) } else { Ok(Some(n)) }
        });
        assert_eq!(failed, Err(1));
    }
}
