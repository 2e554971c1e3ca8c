//! The thread pool of look-ups and simulations.
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rayon::ThreadPool;

/// The pool, with the number of threads from [`splitsnow::threads`]. A forked process, such
/// as a worker of `multiprocessing`, does not inherit threads and creates its own pool.
///
/// The caller holds the GIL, so the process cannot fork while the lock is held.
pub(crate) fn pool(_py: Python) -> PyResult<Arc<ThreadPool>> {
    static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);
    let mut current = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if let Some((owner, pool)) = &*current
        && *owner == process
    {
        return Ok(pool.clone());
    }
    let threads = splitsnow::threads::threads(None);
    let threads = threads.map_err(|e| PyValueError::new_err(e.to_string()))?;
    let new = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let new = new.map_err(|e| PyRuntimeError::new_err(format!("cannot start threads: {e}")))?;
    let new = Arc::new(new);
    // Leak the pool of the parent: dropping it would wait for threads that do not exist.
    std::mem::forget(current.replace((process, new.clone())));
    Ok(new)
}
