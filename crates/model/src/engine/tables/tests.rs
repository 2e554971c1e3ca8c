//! Tables are the same to the bit, whoever draws them and wherever they were.
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
