//! Outcome tables for engines, made once per shape of grain and pair of
//! refractive indices and kept for the next job that needs them.
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use crate::engine::{Control, EngineError, Request};
use crate::grain::{GrainType, SizeRange, Surface};
use crate::optics::Index;
use crate::rng::{Key, Stream};
use crate::table::{Kernel, Table, draw};
use crate::transport::Entry;

/// Outcomes drawn with one stream.
const BATCH: usize = 1 << 14;
/// Independent parts whose scatter gives standard errors.
pub(super) const PARTS: usize = 8;
/// Tables kept: a few snows at all the index nodes of a spectrum, 4 MB each at most.
const KEPT: usize = 64;
/// Outcomes drawn for every one in the table, at least.
const OVERSAMPLING: usize = 8;

/// What tables are made from.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Recipe {
    grain: GrainType,
    entry: Entry,
    surface: Surface,
    seed: u64,
    resolution: super::Resolution,
}

/// Grain events of one shape of grain between one pair of indices.
#[derive(Debug)]
pub(super) struct Outcomes {
    /// To draw from.
    pub(super) table: Table,
    /// Averages over independent parts of all outcomes drawn.
    pub(super) parts: Vec<Kernel>,
    /// Average over all of them.
    pub(super) kernel: Kernel,
}

/// Outcome tables made so far, for the jobs to come. Holds nothing that
/// changes a result.
#[derive(Debug, Default)]
pub struct Cache(Mutex<Vec<(Recipe, Arc<Outcomes>)>>);

/// The outcomes of the grains of `request` in air and in water, at the
/// indices `(ice, water)`; those in air stand for both in dry snow.
pub(super) fn outcomes(
    request: &Request,
    control: &Control,
    (ice, water): (Index, Index),
) -> Result<[Arc<Outcomes>; 2], EngineError> {
    let wet = request.snow.water_saturation > 0.0;
    let [air, water] = Surface::in_air_and_water(ice, water, wet);
    let one = |surface| {
        let recipe = Recipe {
            grain: GrainType {
                size: SizeRange::UNIT,
                ..request.snow.grain
            },
            entry: request.model.entry,
            surface,
            seed: request.seed,
            resolution: request.resolution,
        };
        control.cache.get(recipe, control)
    };
    let air = one(air)?;
    let water = if wet { one(water)? } else { Arc::clone(&air) };
    Ok([air, water])
}

impl Cache {
    fn get(&self, recipe: Recipe, control: &Control) -> Result<Arc<Outcomes>, EngineError> {
        let find = || {
            let kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            kept.iter()
                .find(|(r, _)| *r == recipe)
                .map(|(_, o)| Arc::clone(o))
        };
        if let Some(outcomes) = find() {
            return Ok(outcomes);
        }
        let outcomes = Arc::new(recipe.make(control)?);
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.len() >= KEPT {
            kept.remove(0);
        }
        kept.push((recipe, Arc::clone(&outcomes)));
        Ok(outcomes)
    }
}

impl Recipe {
    fn make(&self, control: &Control) -> Result<Outcomes, EngineError> {
        let size = self.resolution.table as usize;
        let wanted = (self.resolution.grains as usize).max(OVERSAMPLING * size);
        let batches = wanted.div_ceil(BATCH).next_multiple_of(PARTS);
        let kept = (OVERSAMPLING * size).div_ceil(BATCH);
        // the same streams whatever the surface: what differs between indices is optics
        let stream = |batch: usize| {
            Stream::new(Key {
                seed: self.seed,
                cell: 0,
                purpose: [2, 0, 0],
                batch: batch as u64,
            })
        };
        let one = |batch: usize| {
            if control.cancel.load(std::sync::atomic::Ordering::Relaxed) {
                return Err(EngineError::Cancelled);
            }
            let outcomes = draw(&self.grain, self.entry, self.surface, BATCH, stream(batch));
            let kernel = Kernel::new(&outcomes, 2 * self.resolution.streams + 1);
            Ok((kernel, if batch < kept { outcomes } else { Vec::new() }))
        };
        let made: Vec<_> = if control.parallel {
            (0..batches)
                .into_par_iter()
                .map(one)
                .collect::<Result<_, _>>()?
        } else {
            (0..batches).map(one).collect::<Result<_, _>>()?
        };
        let mut list = Vec::with_capacity(kept * BATCH);
        let mut kernel = Kernel::new(&[], 2 * self.resolution.streams + 1);
        let mut parts = vec![kernel.clone(); PARTS];
        for (batch, (part, outcomes)) in made.into_iter().enumerate() {
            parts[batch * PARTS / batches].merge(&part);
            kernel.merge(&part);
            list.extend(outcomes);
        }
        let table = Table::new(list, size, &mut stream(batches));
        Ok(Outcomes {
            table,
            parts,
            kernel,
        })
    }
}
