//! The threads that look-ups and simulations run on.
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rayon::ThreadPool;

/// As many threads as [`splitsnow::threads`] says. A forked process, such as a worker of `multiprocessing`, has
/// none of its parent's threads, and so makes its own.
///
/// The GIL is held, so no fork happens while the lock is.
pub(crate) fn pool(_py: Python) -> PyResult<Arc<ThreadPool>> {
    static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);
    let mut made = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if let Some((owner, pool)) = &*made
        && *owner == process
    {
        return Ok(pool.clone());
    }
    let threads = splitsnow::threads::threads(None);
    let threads = threads.map_err(|e| PyValueError::new_err(e.to_string()))?;
    let new = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let new = new.map_err(|e| PyRuntimeError::new_err(format!("cannot start threads: {e}")))?;
    let new = Arc::new(new);
    // The parent's is not dropped: nobody would answer.
    std::mem::forget(made.replace((process, new.clone())));
    Ok(new)
}
