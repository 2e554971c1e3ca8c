//! Outcome tables for engines, made once per shape of grain and pair of
//! refractive indices.
use std::sync::Arc;
use std::sync::atomic::Ordering;

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
/// Outcomes drawn for every one in the table, at least.
const OVERSAMPLING: usize = 8;

/// What tables are made from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Recipe {
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

/// The outcomes of the grains of `request` in air and in water, at the
/// indices `(ice, water)`; those in air stand for both in dry snow.
pub(super) fn outcomes(
    request: &Request,
    control: &Control,
    (ice, water): (Index, Index),
) -> Result<[Arc<Outcomes>; 2], EngineError> {
    let wet = request.pack.surface.water_saturation > 0.0;
    let [air, water] = Surface::in_air_and_water(ice, water, wet);
    let one = |surface| {
        let recipe = Recipe {
            grain: GrainType {
                size: SizeRange::UNIT,
                ..request.pack.surface.grains[0].grain
            },
            entry: request.model.entry,
            surface,
            seed: request.seed,
            resolution: request.resolution,
        };
        control.cache.tables.get(&recipe, || recipe.make(control))
    };
    let air = one(air)?;
    let water = if wet { one(water)? } else { Arc::clone(&air) };
    Ok([air, water])
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
