//! Outcome tables for engines, made once per shape of grain and pair of
//! refractive indices.
use std::sync::Arc;
use std::sync::atomic::Ordering;

use serde::{Deserialize, Serialize};

use crate::engine::cache::Bytes;
use crate::engine::{Control, EngineError, Request, Resolution, batches};
use crate::grain::{GrainType, SizeRange, Surface};
use crate::optics::Index;
use crate::rng::{Key, Stream};
use crate::table::{Kernel, Table, TableLayer, TableSnowpack, draw};
use crate::transport::{Entry, Layer, Snow};

/// Outcomes drawn with one stream.
const BATCH: usize = 1 << 14;
/// Independent parts whose scatter gives standard errors.
pub(super) const PARTS: usize = 8;
/// Outcomes that one in the table is chosen from, if so many are drawn.
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
    /// What they are on average.
    pub(super) averages: Arc<Averages>,
}

/// What grain events do on average.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Averages {
    /// Per part.
    pub(super) kernels: Vec<Kernel>,
}

impl Bytes for Averages {
    fn bytes(&self) -> usize {
        self.kernels.iter().map(Kernel::bytes).sum()
    }
}

impl Bytes for Outcomes {
    fn bytes(&self) -> usize {
        let tables = self.tables.iter().map(Table::bytes);
        self.averages.bytes() + tables.sum::<usize>()
    }
}

/// Outcomes of the grains of each type in each layer of a snowpack, from the surface
/// down, in air and in water; those in air stand for both in dry snow.
pub(super) type SnowpackOutcomes = Vec<Vec<[Arc<Outcomes>; 2]>>;

/// Those of the snowpack of `request` at the indices `(ice, water)`.
pub(super) fn outcomes(
    request: &Request,
    control: &Control,
    (ice, water): (Index, Index),
) -> Result<SnowpackOutcomes, EngineError> {
    let [air, water] = Surface::in_air_and_water(ice, water, request.snowpack.is_wet());
    let one = |grain: &GrainType, surface| {
        let recipe = Recipe {
            grain: GrainType {
                size: SizeRange::UNIT,
                ..*grain
            },
            entry: request.model.entry,
            surface,
            seed: request.seed,
            resolution: request.resolution,
        };
        control.cache.tables.get(&recipe, || recipe.make(control))
    };
    let of = |snow: &Snow| {
        let kinds = snow.grains.iter().map(|component| {
            let in_air = one(&component.grain, air)?;
            let in_water = match snow.water_saturation {
                0.0 => Arc::clone(&in_air),
                _ => one(&component.grain, water)?,
            };
            Ok([in_air, in_water])
        });
        kinds.collect()
    };
    request.snowpack.snows().map(of).collect()
}

/// A stretch of the `snow`-th layer of a snowpack, counted from the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stretch {
    pub(super) snow: usize,
    pub(super) thickness_m: f64,
}

/// Snow in these `stretches`, from the surface down, with the tables of `part`.
pub(super) fn snowpack<'a>(
    request: &Request,
    outcomes: &'a SnowpackOutcomes,
    part: usize,
    stretches: &[Stretch],
) -> TableSnowpack<'a> {
    let exponents = request.snowpack.exponents();
    let snows: Vec<&Snow> = request.snowpack.snows().collect();
    let stratum = |(i, stretch): (usize, &Stretch)| {
        let tables: Vec<_> = outcomes[stretch.snow]
            .iter()
            .map(|media| media.each_ref().map(|outcomes| &outcomes.tables[part]))
            .collect();
        let below = stretches[i + 1..].iter().map(|stretch| stretch.thickness_m);
        TableLayer::new(
            snows[stretch.snow],
            below.sum(),
            request.model,
            &exponents,
            &tables,
        )
    };
    let strata = stretches.iter().enumerate().map(stratum).collect();
    TableSnowpack::new(strata, exponents.len())
}

/// The layers of the snowpack of `request` at this thickness, from the surface down.
pub(super) fn stretches(request: &Request, thickness_m: f64) -> Vec<Stretch> {
    let layers = request.snowpack.layers(thickness_m).into_iter().enumerate();
    let stretch = |(snow, layer): (usize, Layer)| Stretch {
        snow,
        thickness_m: layer.thickness_m,
    };
    layers.map(stretch).collect()
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
        let batch = |part: usize, first: usize| {
            if control.cancel.load(Ordering::Relaxed) {
                return Err(EngineError::Cancelled);
            }
            // the same streams whatever the surface: what differs between indices is optics
            let rng = self.stream(part, first / BATCH);
            let count = BATCH.min(outcomes - first);
            let mut drawn = draw(&self.grain, self.entry, self.surface, count, rng);
            let kernel = Kernel::new(&drawn, 2 * streams + 1);
            drawn.truncate(candidates.saturating_sub(first));
            drawn.shrink_to_fit();
            Ok((kernel, drawn))
        };
        // a part at a time, whose outcomes become a table: all would take 110 MB
        let part = |part: usize| {
            let firsts = (0..outcomes).step_by(BATCH).collect();
            let drawn = batches::map(control, firsts, |first| batch(part, first))?;
            let mut list = Vec::with_capacity(candidates);
            let mut sums = Vec::with_capacity(drawn.len());
            for (kernel, drawn) in drawn {
                sums.push(kernel);
                list.extend(drawn);
            }
            let mut rng = self.stream(part, outcomes);
            Ok((Table::new(&list, size, &mut rng), sums))
        };
        let mut tables = Vec::with_capacity(PARTS);
        let mut kernels = vec![Kernel::new(&[], 2 * streams + 1); PARTS];
        let parts = batches::map(control, (0..PARTS).collect(), part)?;
        for ((table, sums), part) in parts.into_iter().zip(&mut kernels) {
            for sums in &sums {
                part.merge(sums);
            }
            tables.push(table);
        }
        Ok(Outcomes {
            tables,
            averages: Arc::new(Averages { kernels }),
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
