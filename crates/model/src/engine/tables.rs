//! Tables of grain events for the engines, built once per grain shape and pair of
//! refractive indices.
use std::sync::Arc;
use std::sync::atomic::Ordering;

use serde::{Deserialize, Serialize};

use crate::engine::cache::HeapSize;
use crate::engine::table_store::{self, TablePart};
use crate::engine::{Control, EngineError, Request, Resolution, batches};
use crate::grain::{Facets, GrainType, SizeRange, Surface};
use crate::optics::Index;
use crate::rng::{Key, Stream};
use crate::table::{Kernel, PackedTable, TableLayer, TableSnowpack, draw};
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
/// air and in water: `[layer][type][medium]`. In dry snow both media are air.
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
        kinds.collect()
    };
    request.snowpack.snows().map(layer_outcomes).collect()
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
    let exponents = request.snowpack.exponents();
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
            &exponents,
            &tables,
        )
    };
    let layers = sections.iter().enumerate().map(table_layer).collect();
    TableSnowpack::new(layers, exponents.len())
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
mod tests {
    use std::collections::{BTreeMap, BTreeSet};
    use std::sync::atomic::{AtomicBool, AtomicU64};
    use std::sync::{Mutex, MutexGuard};

    use sha2::{Digest, Sha256};

    use super::*;
    use crate::engine::{Cache, TableCounts, TableStore};
    use crate::grain::{Shape, TruncatedNormal};

    /// Parts and claims.
    type Held = (BTreeMap<String, Vec<u8>>, BTreeSet<String>);

    /// A store in memory.
    #[derive(Debug, Clone, Default)]
    struct Memory(Arc<Mutex<Held>>);

    impl Memory {
        fn held(&self) -> MutexGuard<'_, Held> {
            self.0.lock().unwrap()
        }

        fn cache(&self) -> Cache {
            Cache::tables_only().with_table_store(Box::new(self.clone()))
        }
    }

    impl TableStore for Memory {
        fn read(&self, name: &str) -> Option<Vec<u8>> {
            self.held().0.get(name).cloned()
        }

        fn write(&self, name: &str, bytes: &[u8]) {
            self.held().0.insert(name.into(), bytes.into());
        }

        fn claim(&self, name: &str) -> bool {
            self.held().1.insert(name.into())
        }

        fn release(&self, name: &str) {
            assert!(self.held().1.remove(name));
        }
    }

    fn key(seed: u64, shape: Shape) -> TableKey {
        let index = |n: f64, k: f64| Index { n, k };
        let [surface, _] = Surface::in_air_and_water(index(1.31, 1e-9), index(1.0, 0.0), false);
        TableKey {
            grain: GrainType {
                size: SizeRange::UNIT,
                facetness: TruncatedNormal::new(0.0, 0.6, 0.3, 0.1).unwrap(),
                shape,
                proportion: TruncatedNormal::new(0.4, 0.9, 0.7, 0.1).unwrap(),
            },
            entry: Entry::Uniform,
            facets: Facets::Varsa2025,
            surface,
            seed,
            resolution: Resolution {
                table: 1 << 9,
                grains: 1 << 12,
                streams: 2,
            },
        }
    }

    /// The bytes of the parts of a table, made with this cache.
    fn parts(key: &TableKey, cache: &Cache, parallel: bool) -> Vec<Vec<u8>> {
        let control = Control {
            parallel,
            cancel: &AtomicBool::new(false),
            rays_done: &AtomicU64::new(0),
            cache,
        };
        let Outcomes { tables, averages } = key.build(&control).unwrap();
        let kernels = averages.kernels.iter().cloned();
        let parts = tables.into_iter().zip(kernels);
        parts
            .map(|(table, kernel)| Part { table, kernel }.to_bytes())
            .collect()
    }

    fn counts(drawn: u64, read: u64) -> TableCounts {
        TableCounts { drawn, read }
    }

    #[test]
    fn what_is_read_is_what_was_drawn() {
        for shape in Shape::ALL {
            let key = key(1, shape);
            let drawn = parts(&key, &Cache::default(), false);
            let memory = Memory::default();
            let cache = memory.cache();
            assert_eq!(parts(&key, &cache, true), drawn);
            assert_eq!(cache.table_counts(), counts(8, 0));
            // in another process
            let cache = memory.cache();
            assert_eq!(parts(&key, &cache, false), drawn);
            assert_eq!(cache.table_counts(), counts(0, 8));
            assert!(memory.held().1.is_empty());
        }
    }

    #[test]
    fn wrong_parts_are_not_believed() {
        let key = key(1, Shape::Spheroid);
        let memory = Memory::default();
        let drawn = parts(&key, &memory.cache(), false);
        let stored = memory.held().0.clone();
        let names = key.names();
        let (other_key, other) = (self::key(2, Shape::Spheroid), Memory::default());
        parts(&other_key, &other.cache(), false);
        let foreign = other.held().0[&other_key.names()[0]].clone();
        let whole = stored[&names[0]].clone();
        let flipped = |at: usize| {
            let mut bytes = whole.clone();
            bytes[at] ^= 1;
            bytes
        };
        let wrong = [
            flipped(0),
            flipped(40),
            flipped(whole.len() - 1),
            whole[..whole.len() - 1].to_vec(),
            whole[..20].to_vec(),
            Vec::new(),
            b"a file that something else wrote here".to_vec(),
            // another part, and the same part of another table
            stored[&names[1]].clone(),
            foreign,
        ];
        for wrong in wrong {
            memory.held().0.insert(names[0].clone(), wrong);
            let cache = memory.cache();
            assert_eq!(parts(&key, &cache, false), drawn);
            assert_eq!(cache.table_counts(), counts(1, 7));
            assert_eq!(memory.held().0, stored, "it is replaced");
        }
    }

    /// Each part is drawn once, however many need it at the same moment.
    #[test]
    fn the_work_is_shared_out() {
        let key = key(1, Shape::Oblate);
        let drawn = parts(&key, &Cache::default(), false);
        let memory = Memory::default();
        let caches: Vec<Cache> = (0..6).map(|_| memory.cache()).collect();
        std::thread::scope(|scope| {
            for cache in &caches {
                scope.spawn(|| assert_eq!(parts(&key, cache, false), drawn));
            }
        });
        let all = caches.iter().map(Cache::table_counts);
        let sum = |all: u64, one: u64| all + one;
        assert_eq!(all.clone().map(|counts| counts.drawn).fold(0, sum), 8);
        assert_eq!(all.map(|counts| counts.read).fold(0, sum), 5 * 8);
    }

    /// A run that waits for a part can be cancelled.
    #[test]
    fn nobody_waits_against_their_will() {
        let key = key(1, Shape::Spheroid);
        let memory = Memory::default();
        assert!(memory.claim(&key.names()[3]));
        let (cache, cancel) = (memory.cache(), AtomicBool::new(false));
        let control = Control {
            parallel: false,
            cancel: &cancel,
            rays_done: &AtomicU64::new(0),
            cache: &cache,
        };
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| key.build(&control));
            while cache.table_counts().drawn < 7 {
                std::thread::yield_now();
            }
            cancel.store(true, Ordering::Relaxed);
            assert!(matches!(
                waiting.join().unwrap(),
                Err(EngineError::Cancelled)
            ));
        });
    }

    /// If this fails, tables differ from those that the same version wrote before: raise the
    /// version in `table_store.rs`, then renew the digest.
    #[test]
    fn tables_have_not_changed() {
        let mut digest = Sha256::new();
        for shape in Shape::ALL {
            let parts = parts(&key(1, shape), &Cache::default(), false);
            parts.iter().for_each(|part| digest.update(part));
        }
        let digest = table_store::hex(&digest.finalize());
        assert_eq!(
            digest,
            "2a4ab51756af06270d1323adba9f90114811fde77a2e807374b0e6e8871045d9"
        );
    }

    /// Everything that determines a table is in its name.
    #[test]
    fn names_tell_tables_apart() {
        let first = key(1, Shape::Spheroid);
        let [_, wet] =
            Surface::in_air_and_water(Index { n: 1.31, k: 1e-9 }, Index { n: 1.33, k: 1e-9 }, true);
        let mut finer = first;
        finer.resolution.grains *= 2;
        let mut rounder = first;
        rounder.grain.proportion = TruncatedNormal::new(0.4, 0.9, 0.7, 0.1 + 1e-16).unwrap();
        let others = [
            key(2, Shape::Spheroid),
            key(1, Shape::Oblate),
            finer,
            rounder,
            TableKey {
                surface: wet,
                ..first
            },
            TableKey {
                entry: Entry::Projected,
                ..first
            },
            TableKey {
                facets: Facets::VGroove,
                ..first
            },
        ];
        let names: BTreeSet<String> = others
            .iter()
            .chain([&first])
            .flat_map(TableKey::names)
            .collect();
        assert_eq!(names.len(), 8 * 8);
        assert!(names.iter().all(|name| name.len() == 64));
    }
}
