//! Splits the rays of one estimate into batches with streams of their own and
//! merges their scores in order, so that floating-point sums do not depend on
//! how many threads did the work.
use std::sync::atomic::Ordering;

use rayon::prelude::*;

use crate::engine::{Control, EngineError, Request, engine_error};
use crate::rng::{Key, Stream};
use crate::transport::{Sink, Walk};

/// Rays of one batch: enough for the eight lanes of a walk to stay busy
/// although rays differ in length. Changing it changes every random number.
pub const BATCH: u64 = 4096;
/// Batches in flight at once: bounds the memory of very long runs.
const IN_FLIGHT: u64 = 16;

/// A sink whose scores can be added up.
pub(super) trait Scores: Sink + Clone + Send + Sync {
    /// Adds the scores of another batch.
    fn merge(&mut self, other: &Self);
}

/// Walks `request.rays` rays, each batch with the `walker` of its number, in slabs of all `thicknesses_m` and gives their
/// scores, starting from `empty`, under the `illumination`-th of its lights.
pub(super) fn run<S: Scores, W: Walk>(
    request: &Request,
    control: &Control,
    walker: impl Fn(u64) -> W + Sync + Send,
    thicknesses_m: &[f64],
    illumination: usize,
    [engine, i, j]: [u32; 3],
    empty: &S,
) -> Result<S, EngineError> {
    let batches = request.rays.div_ceil(BATCH);
    let one = |batch: u64| {
        let key = Key {
            seed: request.seed,
            cell: request.cell,
            purpose: [engine | (illumination as u32) << 8, i, j],
            batch,
        };
        let count = BATCH.min(request.rays - batch * BATCH);
        let mut scores = empty.clone();
        walker(batch)
            .walk(
                thicknesses_m,
                request.illuminations[illumination],
                count,
                Stream::new(key),
                &mut scores,
            )
            .map_err(|error| engine_error(request, error))?;
        control.rays_done.fetch_add(count, Ordering::Relaxed);
        Ok(scores)
    };
    let mut total = empty.clone();
    for first in (0..batches).step_by(IN_FLIGHT as usize) {
        let group = first..batches.min(first + IN_FLIGHT);
        let scores = map(control, group.collect(), one)?;
        scores.iter().for_each(|part| total.merge(part));
    }
    Ok(total)
}

/// `f` of every item, in order; on all threads if `control` allows it.
pub(super) fn map<I: Send, T: Send>(
    control: &Control,
    items: Vec<I>,
    f: impl Fn(I) -> Result<T, EngineError> + Sync + Send,
) -> Result<Vec<T>, EngineError> {
    if control.parallel {
        items.into_par_iter().map(f).collect()
    } else {
        items.into_iter().map(f).collect()
    }
}
