//! Work that ends when a budget of CPU time does.
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use cpu_time::ProcessTime;
use rayon::prelude::*;

/// Between two looks at the time.
const TICK: Duration = Duration::from_millis(5);

/// Does `work` with a flag that is set once `cancel` is, or the process has worked for
/// `seconds` of CPU time from now on, all threads together (`None`: without limit).
pub fn within<T>(
    seconds: Option<f64>,
    cancel: &AtomicBool,
    work: impl FnOnce(&AtomicBool) -> T,
) -> T {
    let none = seconds.is_some_and(|most| most <= 0.0);
    let (stop, ended) = (AtomicBool::new(none), AtomicBool::new(false));
    let begin = ProcessTime::now();
    thread::scope(|scope| {
        let watcher = scope.spawn(|| {
            // until the work ends, by panicking too: the scope waits for this thread
            while !ended.load(Ordering::Relaxed) {
                let late = seconds.is_some_and(|most| begin.elapsed().as_secs_f64() > most);
                if late || cancel.load(Ordering::Relaxed) {
                    stop.store(true, Ordering::Relaxed);
                }
                thread::park_timeout(TICK);
            }
        });
        let _end = End {
            ended: &ended,
            watcher: watcher.thread(),
        };
        work(&stop)
    })
}

/// Ends the watcher when dropped.
struct End<'a> {
    ended: &'a AtomicBool,
    watcher: &'a thread::Thread,
}

impl Drop for End<'_> {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        self.watcher.unpark();
    }
}

/// `f` of 0, 1, ... below `count`, begun in this order on all threads of the rayon pool,
/// until `stop` is set; `None` where it was not begun, or gave none.
///
/// # Errors
/// The first that `f` gave; no more are begun then.
pub fn in_order<T: Send, E: Send>(
    count: usize,
    stop: &AtomicBool,
    f: impl Fn(usize) -> Result<Option<T>, E> + Sync,
) -> Result<Vec<Option<T>>, E> {
    let next = AtomicUsize::new(0);
    let found: Mutex<Vec<Option<T>>> = Mutex::new((0..count).map(|_| None).collect());
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
                let one = f(number).inspect_err(|_| next.store(count, Ordering::Relaxed))?;
                found.lock().unwrap_or_else(PoisonError::into_inner)[number] = one;
            }
        })?;
    Ok(found.into_inner().unwrap_or_else(PoisonError::into_inner))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_ends_with_its_budget_or_when_it_is_cancelled() {
        let spin = |stop: &AtomicBool| while !stop.load(Ordering::Relaxed) {};
        let cancel = AtomicBool::new(false);
        let begin = ProcessTime::now();
        within(Some(0.1), &cancel, spin);
        // other tests of this process work too: only the lower bound is sure
        assert!(begin.elapsed().as_secs_f64() > 0.1);
        cancel.store(true, Ordering::Relaxed);
        within(None, &cancel, spin);
    }

    #[test]
    fn work_that_panics_ends() {
        let never = AtomicBool::new(false);
        let work = || within(None, &never, |_| panic!("as meant"));
        let ended = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
        assert!(ended.is_err());
    }

    #[test]
    fn what_was_done_is_kept() {
        let stop = AtomicBool::new(false);
        let some = in_order(100, &stop, |number| {
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
        let failed = in_order(5, &AtomicBool::new(false), |n| {
            if n == 1 { Err(n) } else { Ok(Some(n)) }
        });
        assert_eq!(failed, Err(1));
    }
}
