//! Tables of grain events for the engines, built once per grain shape and pair of
//! refractive indices.
use std::sync::Arc;
use std::sync::atomic::Ordering;

use serde::{Deserialize, Serialize};

use crate::engine::cache::HeapSize;
use crate::engine::table_store::{self, TablePart};
use crate::engine::{Control, EngineError, Request, Resolution, batches};
use crate::grain::{Facets, GrainType, SizeRange, Surface};
use crate::optics::{Index, Particles};
use crate::rng::{Key, Stream};
use crate::table::{Kernel, Outcome, PackedTable, TableLayer, TableSnowpack, draw};
use crate::transport::{Entry, Layer, Snow};

/// Outcomes drawn with one random stream.
const BATCH: usize = 1 << 14;
/// Number of independent parts, whose scatter gives the standard errors.
pub(super) const PARTS: usize = 8;
/// Number of drawn outcomes from which each table entry is chosen, if that many are
/// drawn.
const OVERSAMPLING: usize = 8;

/// All inputs that determine the tables of one grain shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TableKey {
    grain: GrainType,
    entry: Entry,
    facets: Facets,
    surface: Surface,
    seed: u64,
    resolution: Resolution,
}

/// Grain events of one grain shape at one pair of indices, in independent parts. The
/// scatter between the parts gives the error of every result computed from them. The
/// table of one part fits into a processor's cache.
#[derive(Debug)]
pub(super) struct Outcomes {
    /// Tables from which walks draw outcomes, per part.
    pub(super) tables: Vec<PackedTable>,
    /// Averages over all outcomes.
    pub(super) averages: Arc<Averages>,
}

/// One part of [`Outcomes`].
struct Part {
    table: PackedTable,
    kernel: Kernel,
}

impl TablePart for Part {
    /// The length of the kernel in bytes (8 bytes), the kernel, the table.
    fn to_bytes(&self) -> Vec<u8> {
        // without a kernel it will not be read, but drawn again
        let kernel = postcard::to_allocvec(&self.kernel).unwrap_or_default();
        let length = (kernel.len() as u64).to_le_bytes();
        [&length[..], &kernel, &self.table.to_bytes()].concat()
    }

    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (length, bytes) = bytes.split_first_chunk()?;
        let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
        let (kernel, table) = bytes.split_at_checked(length)?;
        Some(Self {
            table: PackedTable::from_bytes(table)?,
            kernel: postcard::from_bytes(kernel).ok()?,
        })
    }
}

/// Averages over grain events.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Averages {
    /// Mean scattering kernel, per part.
    pub(super) kernels: Vec<Kernel>,
}

impl HeapSize for Averages {
    fn bytes(&self) -> usize {
        self.kernels.iter().map(Kernel::bytes).sum()
    }
}

impl HeapSize for Outcomes {
    fn bytes(&self) -> usize {
        let tables = self.tables.iter().map(PackedTable::bytes);
        self.averages.bytes() + tables.sum::<usize>()
    }
}

/// Outcomes of each grain type in each layer of a snowpack, from the surface down, in
/// air and in water: `[layer][type][medium]`. In dry snow both media are air. Particles that
/// scatter follow as one more type.
pub(super) type SnowpackOutcomes = Vec<Vec<[Arc<Outcomes>; 2]>>;

/// Outcomes for the snowpack of `request` at the indices `(ice, water)`.
pub(super) fn outcomes(
    request: &Request,
    control: &Control,
    (ice, water): (Index, Index),
) -> Result<SnowpackOutcomes, EngineError> {
    let [air, water] = Surface::in_air_and_water(ice, water, request.snowpack.is_wet());
    let outcomes_of = |grain: &GrainType, surface| {
        let key = TableKey {
            grain: GrainType {
                size: SizeRange::UNIT,
                ..*grain
            },
            entry: request.model.entry,
            facets: request.model.facets,
            surface,
            seed: request.seed,
            resolution: request.resolution,
        };
        control.cache.tables.kept.get(&key, || key.build(control))
    };
    let layer_outcomes = |snow: &Snow| {
        let kinds = snow.grains.iter().map(|component| {
            let in_air = outcomes_of(&component.grain, air)?;
            let in_water = match snow.water_saturation {
                0.0 => Arc::clone(&in_air),
                _ => outcomes_of(&component.grain, water)?,
            };
            Ok([in_air, in_water])
        });
        // the wavelength does not matter to particles, nor what is around them
        let particles = snow.particles().map(|particles| {
            let outcomes = Arc::new(of_particles(particles, request.resolution));
            Ok([Arc::clone(&outcomes), outcomes])
        });
        kinds.chain(particles).collect()
    };
    request.snowpack.snows().map(layer_outcomes).collect()
}

/// Outcomes of scattering by `particles`, the same in all parts: their deflections have no noise.
fn of_particles(particles: Particles, resolution: Resolution) -> Outcomes {
    let size = (resolution.table as usize).div_ceil(PARTS);
    let outcomes: Vec<Outcome> = (0..size)
        .map(|i| {
            let cos = particles.deflection((i as f64 + 0.5) / size as f64);
            Outcome {
                cos: cos as f32,
                sin: (1.0 - cos * cos).sqrt() as f32,
                ..Outcome::default()
            }
        })
        .collect();
    let kernel = Kernel::new(&outcomes, 2 * resolution.streams + 1);
    Outcomes {
        tables: vec![PackedTable::all(&outcomes); PARTS],
        averages: Arc::new(Averages {
            kernels: vec![kernel; PARTS],
        }),
    }
}

/// A vertical section of one layer of a snowpack.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Section {
    /// Number of the layer, from 0 at the surface.
    pub(super) layer: usize,
    pub(super) thickness_m: f64,
}

/// The snow of `sections`, given from the surface down, with the tables of `part`.
pub(super) fn snowpack<'a>(
    request: &Request,
    outcomes: &'a SnowpackOutcomes,
    part: usize,
    sections: &[Section],
) -> TableSnowpack<'a> {
    let tracers = request.tracers();
    let snows: Vec<&Snow> = request.snowpack.snows().collect();
    let table_layer = |(i, section): (usize, &Section)| {
        let tables: Vec<_> = outcomes[section.layer]
            .iter()
            .map(|media| media.each_ref().map(|outcomes| &outcomes.tables[part]))
            .collect();
        let below = sections[i + 1..].iter().map(|section| section.thickness_m);
        TableLayer::new(
            snows[section.layer],
            below.sum(),
            request.model,
            &tracers,
            &tables,
        )
    };
    let layers = sections.iter().enumerate().map(table_layer).collect();
    TableSnowpack::new(layers, tracers.len())
}

/// All layers of the snowpack of `request` at this thickness, from the surface down.
pub(super) fn sections(request: &Request, thickness_m: f64) -> Vec<Section> {
    let layers = request.snowpack.layers(thickness_m).into_iter().enumerate();
    let section = |(number, layer): (usize, Layer)| Section {
        layer: number,
        thickness_m: layer.thickness_m,
    };
    layers.map(section).collect()
}

impl TableKey {
    /// The table, from the store of the cache if it has one, else drawn.
    fn build(&self, control: &Control) -> Result<Outcomes, EngineError> {
        let drawn = |part: usize, control: &Control| {
            let drawn = self.draw(part, control)?;
            control.cache.tables.count_drawn();
            Ok(drawn)
        };
        let parts = match control.cache.tables.store() {
            Some(store) => table_store::parts(store, &self.names(), control, drawn)?,
            None => batches::map(control, (0..PARTS).collect(), |part| drawn(part, control))?,
        };
        let (tables, kernels) = parts
            .into_iter()
            .map(|Part { table, kernel }| (table, kernel))
            .unzip();
        Ok(Outcomes {
            tables,
            averages: Arc::new(Averages { kernels }),
        })
    }

    /// Names of the parts in a [`table_store::TableStore`]. They cover everything in the key, because
    /// the debug format writes all fields, and all digits of numbers.
    fn names(&self) -> Vec<String> {
        let inputs = format!("{PARTS} {BATCH} {OVERSAMPLING} {self:?}");
        let numbers = 0..PARTS;
        numbers
            .map(|part| table_store::name(&inputs, part))
            .collect()
    }

    /// Draws one part. Not more than one, because the outcomes of all parts would take 110 MB.
    fn draw(&self, part: usize, control: &Control) -> Result<Part, EngineError> {
        let Resolution {
            table,
            grains,
            streams,
        } = self.resolution;
        let size = (table as usize).div_ceil(PARTS);
        let outcomes = (grains as usize).div_ceil(PARTS).max(size);
        // the table entries are chosen from the first outcomes of a part
        let candidates = (OVERSAMPLING * size).min(outcomes);
        let batch = |first: usize| {
            if control.cancel.load(Ordering::Relaxed) {
                return Err(EngineError::Cancelled);
            }
            // the same random streams for all surfaces, so that results at different
            // indices differ only by the optics
            let rng = self.stream(part, first / BATCH);
            let count = BATCH.min(outcomes - first);
            let mut drawn = draw(
                &self.grain,
                (self.entry, self.facets),
                self.surface,
                count,
                rng,
            );
            let kernel = Kernel::new(&drawn, 2 * streams + 1);
            drawn.truncate(candidates.saturating_sub(first));
            drawn.shrink_to_fit();
            Ok((kernel, drawn))
        };
        let firsts = (0..outcomes).step_by(BATCH).collect();
        let drawn = batches::map(control, firsts, batch)?;
        let mut list = Vec::with_capacity(candidates);
        let mut kernel = Kernel::new(&[], 2 * streams + 1);
        for (sums, drawn) in drawn {
            kernel.merge(&sums);
            list.extend(drawn);
        }
        let mut rng = self.stream(part, outcomes);
        Ok(Part {
            table: PackedTable::new(&list, size, &mut rng),
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

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
