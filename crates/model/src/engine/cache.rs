//! What engines keep for the requests to come.
use std::sync::{Arc, Mutex, PoisonError};

use super::EngineError;
use super::hybrid::{CacheKey, Walks};
use super::tables::{Outcomes, Recipe};
use super::units::Units;

/// Bytes of tables kept: those of one shape of grain at the index nodes of a wide wet
/// spectrum, 20 in air and in water, take 340 MB.
const TABLES: usize = 512 << 20;
/// Bytes of walks kept: those of a snow at all these nodes, some MB each.
const WALKS: usize = 256 << 20;

/// Tables of grain events and walks made so far, the latest used, within a budget of
/// bytes; and what an earlier run finished of the request. Holds nothing that changes
/// a result.
#[derive(Debug)]
pub struct Cache {
    pub(super) tables: Arc<Kept<Recipe, Outcomes>>,
    pub(super) walks: Arc<Kept<CacheKey, Walks>>,
    pub(super) units: Units,
}

impl Default for Cache {
    fn default() -> Self {
        Self {
            tables: Arc::new(Kept::new(TABLES)),
            walks: Arc::new(Kept::new(WALKS)),
            units: Units::default(),
        }
    }
}

impl Cache {
    /// One for requests that all have cells of their own, so that no walks are of use
    /// twice: it keeps none of them.
    #[must_use]
    pub fn of_cells() -> Self {
        Self {
            walks: Arc::new(Kept::new(0)),
            ..Self::default()
        }
    }

    /// The same tables and walks, with the `units` of one request.
    #[must_use]
    pub fn with(&self, units: Units) -> Self {
        Self {
            tables: Arc::clone(&self.tables),
            walks: Arc::clone(&self.walks),
            units,
        }
    }

    /// Saves what is finished of the request, which is to be stopped.
    ///
    /// # Errors
    /// [`EngineError::Cancelled`]: it cannot be kept.
    pub fn save_units(&self) -> Result<(), EngineError> {
        self.units.save()
    }
}

/// What knows how much memory it takes.
pub(super) trait Bytes {
    /// Bytes on the heap.
    fn bytes(&self) -> usize;
}

/// The values used last, of so many bytes at most.
#[derive(Debug)]
pub(super) struct Kept<K, V> {
    most: usize,
    /// The latest used last.
    values: Mutex<Vec<(K, Arc<V>)>>,
}

impl<K: PartialEq + Clone, V: Bytes> Kept<K, V> {
    fn new(most: usize) -> Self {
        let values = Mutex::default();
        Self { most, values }
    }

    /// The value for `key`, by `make` if it is not there. Two threads that miss
    /// it at once both make it. What does not fit the budget by itself is not kept.
    pub(super) fn get<E>(&self, key: &K, make: impl FnOnce() -> Result<V, E>) -> Result<Arc<V>, E> {
        if let Some(value) = self.find(key) {
            return Ok(value);
        }
        let value = Arc::new(make()?);
        if let Some(other) = self.find(key) {
            return Ok(other);
        }
        let mut left = match self.most.checked_sub(value.bytes()) {
            Some(left) => left,
            None => return Ok(value),
        };
        let mut values = self.values.lock().unwrap_or_else(PoisonError::into_inner);
        // from the latest used on, those that fit beside it
        let fitting = values.iter().rev().take_while(|(_, kept)| {
            let rest = left.checked_sub(kept.bytes());
            rest.inspect(|rest| left = *rest).is_some()
        });
        let gone = values.len() - fitting.count();
        values.drain(..gone);
        values.push((key.clone(), Arc::clone(&value)));
        Ok(value)
    }

    /// The value for `key`, which becomes the latest used.
    fn find(&self, key: &K) -> Option<Arc<V>> {
        let mut values = self.values.lock().unwrap_or_else(PoisonError::into_inner);
        let place = values.iter().position(|(k, _)| k == key)?;
        values[place..].rotate_left(1);
        values.last().map(|(_, value)| Arc::clone(value))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    impl Bytes for usize {
        fn bytes(&self) -> usize {
            *self
        }
    }

    /// Asks for values of these sizes, each its own key; how many had to be made.
    fn made(kept: &Kept<usize, usize>, sizes: &[usize]) -> usize {
        let mut made = 0;
        for size in sizes {
            let make = || {
                made += 1;
                Ok::<_, ()>(*size)
            };
            assert_eq!(*kept.get(size, make).unwrap(), *size);
            let total: usize = kept.values.lock().unwrap().iter().map(|v| v.0).sum();
            assert!(total <= kept.most, "{total}");
        }
        made
    }

    #[test]
    fn bytes_decide_how_many_are_kept() {
        // as many as there are index nodes in a wide wet spectrum, again and again
        let nodes: Vec<usize> = (100..120).collect();
        let kept = Kept::new(nodes.iter().sum());
        assert_eq!(made(&kept, &nodes), 20);
        assert_eq!(made(&kept, &nodes), 0);
        // one more, and the one used longest ago goes
        assert_eq!(made(&kept, &[50]), 1);
        assert_eq!(made(&kept, &nodes[1..]), 0);
        assert_eq!(made(&kept, &[100]), 1);
    }

    #[test]
    fn the_one_used_longest_ago_goes_first() {
        let kept = Kept::new(10);
        assert_eq!(made(&kept, &[2, 3, 5, 2]), 3);
        // 3 goes, not 2, which was asked for again
        assert_eq!(made(&kept, &[1, 2, 5]), 1);
        assert_eq!(made(&kept, &[3]), 1);
        // what does not fit is made each time and drives nothing out
        assert_eq!(made(&kept, &[11, 11]), 2);
        assert_eq!(made(&kept, &[3]), 0);
        assert_eq!(made(&Kept::new(0), &[4, 4]), 2);
    }
}
