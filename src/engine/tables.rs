//! Outcome tables for engines, made once per shape of grain and pair of
//! refractive indices and kept for the next job that needs them.
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};

use crate::engine::{Control, EngineError, Request, Resolution, batches};
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
    resolution: Resolution,
}

/// Grain events of one shape of grain between one pair of indices, in
/// independent parts: their scatter is the error of whatever comes from them,
/// and each part's table fits into a processor's cache.
#[derive(Debug)]
pub(super) struct Outcomes {
    /// To draw from, per part.
    pub(super) tables: Vec<Table>,
    /// Averages, per part.
    pub(super) kernels: Vec<Kernel>,
    /// Average over all parts.
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
        let Resolution {
            table,
            grains,
            streams,
        } = self.resolution;
        let size = (table as usize).div_ceil(PARTS);
        let outcomes = (grains as usize).div_ceil(PARTS).max(size);
        // what goes into a table is chosen from the first of a part
        let candidates = (OVERSAMPLING * size).min(outcomes);
        let one = |(part, first): (usize, usize)| {
            if control.cancel.load(Ordering::Relaxed) {
                return Err(EngineError::Cancelled);
            }
            // the same streams whatever the surface: what differs between indices is optics
            let rng = self.stream(part, first / BATCH);
            let count = BATCH.min(outcomes - first);
            let mut drawn = draw(&self.grain, self.entry, self.surface, count, rng);
            let kernel = Kernel::new(&drawn, 2 * streams + 1);
            drawn.truncate(candidates.saturating_sub(first));
            Ok((part, kernel, drawn))
        };
        let batches =
            (0..PARTS).flat_map(|part| (0..outcomes).step_by(BATCH).map(move |i| (part, i)));
        let mut kernel = Kernel::new(&[], 2 * streams + 1);
        let mut kernels = vec![kernel.clone(); PARTS];
        let mut lists = vec![Vec::new(); PARTS];
        for (part, sums, drawn) in batches::map(control, batches.collect(), one)? {
            kernels[part].merge(&sums);
            kernel.merge(&sums);
            lists[part].extend(drawn);
        }
        let tables = lists
            .into_iter()
            .enumerate()
            .map(|(part, list)| Table::new(list, size, &mut self.stream(part, outcomes)));
        Ok(Outcomes {
            tables: tables.collect(),
            kernels,
            kernel,
        })
    }

    fn stream(&self, part: usize, batch: usize) -> Stream {
        Stream::new(Key {
            seed: self.seed,
            cell: 0,
            purpose: [2, part as u32, 0],
            batch: batch as u64,
        })
    }
}
