//! Caches of tables and walks, which later requests can use again.
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use serde::Serialize;

use super::EngineError;
use super::hybrid::{CacheKey, Walks};
use super::table_store::TableStore;
use super::tables::{Outcomes, TableKey};
use super::units::Units;

/// Budget for tables, bytes. The tables of one grain shape at the index nodes of a
/// wide wet spectrum, 20 in air and in water, take 340 MB.
const TABLES: usize = 512 << 20;
/// Budget for walks, bytes. The walks of one snow take some MB at each of these nodes.
const WALKS: usize = 256 << 20;

/// The most recently used tables of grain events and walks, within a budget of bytes,
/// and the units of the request that an earlier run finished. The cache never changes
/// a result.
#[derive(Debug)]
pub struct Cache {
    pub(super) tables: Arc<TableCache>,
    pub(super) walks: Arc<LruCache<CacheKey, Walks>>,
    pub(super) units: Units,
}

impl Default for Cache {
    fn default() -> Self {
        Self {
            tables: Arc::default(),
            walks: Arc::new(LruCache::new(WALKS)),
            units: Units::default(),
        }
    }
}

impl Cache {
    /// A cache for requests that all have different cells. Their walks are never
    /// used twice, so the cache keeps tables only.
    #[must_use]
    pub fn tables_only() -> Self {
        Self {
            walks: Arc::new(LruCache::new(0)),
            ..Self::default()
        }
    }

    /// A cache of tables of at most `bytes` bytes, without walks.
    #[must_use]
    pub fn of_tables(bytes: usize) -> Self {
        let tables = TableCache {
            kept: LruCache::new(bytes),
            ..TableCache::default()
        };
        Self {
            tables: Arc::new(tables),
            ..Self::tables_only()
        }
    }

    /// This cache with tables that are also kept in `store`, which other processes use too. Its
    /// memory for tables is the default one, and is empty: call this before the cache is used.
    #[must_use]
    pub fn with_table_store(self, store: Box<dyn TableStore>) -> Self {
        let tables = TableCache {
            store: Some(store),
            ..TableCache::default()
        };
        Self {
            tables: Arc::new(tables),
            ..self
        }
    }

    /// The number of parts of tables made so far.
    #[must_use]
    pub fn table_counts(&self) -> TableCounts {
        TableCounts {
            drawn: self.tables.drawn.load(Ordering::Relaxed),
            read: self.tables.read.load(Ordering::Relaxed),
        }
    }

    /// A cache that shares the tables and walks of this one and has the `units` of
    /// one request.
    #[must_use]
    pub fn with(&self, units: Units) -> Self {
        Self {
            tables: Arc::clone(&self.tables),
            walks: Arc::clone(&self.walks),
            units,
        }
    }

    /// Saves the finished units of the request, before the run is stopped.
    ///
    /// # Errors
    /// [`EngineError::Cancelled`] if the units cannot be saved.
    pub fn save_units(&self) -> Result<(), EngineError> {
        self.units.save()
    }
}

/// How many parts of tables of grain events were made, and how. A table has eight parts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct TableCounts {
    /// Number of parts that were drawn.
    pub drawn: u64,
    /// Number of parts that were read from a [`TableStore`].
    pub read: u64,
}

/// The tables kept in memory, and where else they are.
#[derive(Debug)]
pub(super) struct TableCache {
    pub(super) kept: LruCache<TableKey, Outcomes>,
    store: Option<Box<dyn TableStore>>,
    drawn: AtomicU64,
    read: AtomicU64,
}

impl Default for TableCache {
    fn default() -> Self {
        Self {
            kept: LruCache::new(TABLES),
            store: None,
            drawn: AtomicU64::new(0),
            read: AtomicU64::new(0),
        }
    }
}

impl TableCache {
    pub(super) fn store(&self) -> Option<&dyn TableStore> {
        self.store.as_deref()
    }

    pub(super) fn count_drawn(&self) {
        self.drawn.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn count_read(&self) {
        self.read.fetch_add(1, Ordering::Relaxed);
    }
}

/// A value with a known size in memory.
pub(super) trait HeapSize {
    /// Bytes on the heap.
    fn bytes(&self) -> usize;
}

/// The most recently used values, of at most `budget` bytes together.
#[derive(Debug)]
pub(super) struct LruCache<K, V> {
    budget: usize,
    /// In order of use, the most recently used last.
    values: Mutex<Vec<(K, Arc<V>)>>,
}

impl<K: PartialEq + Clone, V: HeapSize> LruCache<K, V> {
    fn new(budget: usize) -> Self {
        let values = Mutex::default();
        Self { budget, values }
    }

    /// The value for `key`. If it is not in the cache, `make` computes it; two
    /// threads that miss it at the same time both compute it. A value larger than
    /// the budget is not kept.
    pub(super) fn get<E>(&self, key: &K, make: impl FnOnce() -> Result<V, E>) -> Result<Arc<V>, E> {
        if let Some(value) = self.find(key) {
            return Ok(value);
        }
        let value = Arc::new(make()?);
        if let Some(other) = self.find(key) {
            return Ok(other);
        }
        let mut free = match self.budget.checked_sub(value.bytes()) {
            Some(free) => free,
            None => return Ok(value),
        };
        let mut values = self.values.lock().unwrap_or_else(PoisonError::into_inner);
        // the most recently used values that fit beside the new one
        let fitting = values.iter().rev().take_while(|(_, cached)| {
            let rest = free.checked_sub(cached.bytes());
            rest.inspect(|rest| free = *rest).is_some()
        });
        let evicted = values.len() - fitting.count();
        values.drain(..evicted);
        values.push((key.clone(), Arc::clone(&value)));
        Ok(value)
    }

    /// The value for `key`, which becomes the most recently used.
    fn find(&self, key: &K) -> Option<Arc<V>> {
        let mut values = self.values.lock().unwrap_or_else(PoisonError::into_inner);
        let position = values.iter().position(|(k, _)| k == key)?;
        values[position..].rotate_left(1);
        values.last().map(|(_, value)| Arc::clone(value))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    impl HeapSize for usize {
        fn bytes(&self) -> usize {
            *self
        }
    }

    /// Requests values of these sizes, each of which is its own key, and returns the
    /// number of cache misses.
    fn misses(cache: &LruCache<usize, usize>, sizes: &[usize]) -> usize {
        let mut misses = 0;
        for size in sizes {
            let make = || {
                misses += 1;
                Ok::<_, ()>(*size)
            };
            assert_eq!(*cache.get(size, make).unwrap(), *size);
            let total: usize = cache.values.lock().unwrap().iter().map(|v| v.0).sum();
            assert!(total <= cache.budget, "{total}");
        }
        misses
    }

    #[test]
    fn bytes_decide_how_many_are_kept() {
        // as many values as a wide wet spectrum has index nodes, used repeatedly
        let nodes: Vec<usize> = (100..120).collect();
        let cache = LruCache::new(nodes.iter().sum());
        assert_eq!(misses(&cache, &nodes), 20);
        assert_eq!(misses(&cache, &nodes), 0);
        // one more value evicts the least recently used
        assert_eq!(misses(&cache, &[50]), 1);
        assert_eq!(misses(&cache, &nodes[1..]), 0);
        assert_eq!(misses(&cache, &[100]), 1);
    }

    #[test]
    fn the_least_recently_used_value_is_evicted_first() {
        let cache = LruCache::new(10);
        assert_eq!(misses(&cache, &[2, 3, 5, 2]), 3);
        // 3 is evicted, not 2, which was used again
        assert_eq!(misses(&cache, &[1, 2, 5]), 1);
        assert_eq!(misses(&cache, &[3]), 1);
        // a value that does not fit is made each time and evicts nothing
        assert_eq!(misses(&cache, &[11, 11]), 2);
        assert_eq!(misses(&cache, &[3]), 0);
        assert_eq!(misses(&LruCache::new(0), &[4, 4]), 2);
    }
}
