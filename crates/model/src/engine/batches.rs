//! Splits the rays of one estimate into batches, each with its own random stream,
//! and merges their scores in order, so that floating-point sums do not depend on
//! the number of threads.
use std::sync::atomic::Ordering;

use rayon::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::engine::{Control, EngineError, Request, engine_error};
use crate::rng::{Key, Stream};
use crate::transport::{Sink, Walk};

/// Rays of one batch: enough to keep the eight SIMD lanes busy although rays
/// differ in length. Changing it changes every random number.
pub const BATCH: u64 = 4096;
/// Batches computed at once on several threads: bounds the memory of very long runs.
const IN_FLIGHT: u64 = 16;

/// A sink whose scores can be added up and saved.
pub(super) trait MergeableSink: Sink + Clone + Send + Sync {
    /// The state that scoring changes.
    type Sums: Serialize + DeserializeOwned;
    /// Adds the scores of another batch.
    fn merge(&mut self, other: &Self);
    /// The sums so far.
    fn sums(&self) -> Self::Sums;
    /// A copy of this sink with these `sums`; `None` if their shape does not match.
    fn with(&self, sums: Self::Sums) -> Option<Self>;
}

/// Name of the unit ([`crate::engine::Units`]) of these walks.
fn unit(request: &Request, illumination: usize, [engine, i, j]: [u32; 3]) -> String {
    let cell = request.cell;
    format!("batches {cell:x} {engine} {illumination} {i} {j}")
}

/// The scores of [`run`], if an earlier run of the same request finished them.
pub(super) fn finished<S: MergeableSink>(
    request: &Request,
    control: &Control,
    illumination: usize,
    purpose: [u32; 3],
    empty: &S,
) -> Option<S> {
    let name = unit(request, illumination, purpose) + " all";
    let sums = control.cache.units.take(&name);
    sums.and_then(|sums| empty.with(sums))
}

/// Walks `request.rays` rays under illumination number `illumination` in slabs of
/// all `thicknesses_m`. `walker` gives the walker of each batch by its number.
/// Returns the scores, starting from `empty`.
pub(super) fn run<S: MergeableSink, W: Walk>(
    request: &Request,
    control: &Control,
    walker: impl Fn(u64) -> W + Sync + Send,
    thicknesses_m: &[f64],
    illumination: usize,
    [engine, i, j]: [u32; 3],
    empty: &S,
) -> Result<S, EngineError> {
    let units = &control.cache.units;
    let purpose = [engine, i, j];
    if let Some(scores) = finished(request, control, illumination, purpose, empty) {
        return Ok(scores);
    }
    let batches = request.rays.div_ceil(BATCH);
    let walk_batch = |batch: u64| {
        // not all walkers check during the walk
        if control.cancel.load(Ordering::Relaxed) {
            return Err(EngineError::Cancelled);
        }
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
    let name = unit(request, illumination, purpose);
    let saved = units.take(&name).and_then(|(next, sums)| {
        let scores = empty.with(sums)?;
        (next <= batches).then_some((next, scores))
    });
    let (mut next, mut total) = saved.unwrap_or_else(|| (0, empty.clone()));
    let in_flight = if control.parallel { IN_FLIGHT } else { 1 };
    while next < batches {
        let group = next..batches.min(next + in_flight);
        let scores = match map(control, group.clone().collect(), walk_batch) {
            Err(EngineError::Cancelled) if next > 0 => {
                units.add(&name, &(next, total.sums()))?;
                return Err(EngineError::Cancelled);
            }
            scores => scores?,
        };
        scores.iter().for_each(|batch| total.merge(batch));
        next = group.end;
        units.add_if_due(&name, || (next, total.sums()))?;
    }
    units.add(&(name + " all"), &total.sums())?;
    Ok(total)
}

/// Applies `f` to every item and returns the results in order; uses all threads
/// if `control.parallel` is set.
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
