//! What engines keep for the requests to come.
use std::sync::{Arc, Mutex, PoisonError};

use super::doubling::{Occasion, Walks};
use super::tables::{Outcomes, Recipe};

/// Tables kept: a few shapes of grain at all the index nodes of a spectrum, 4 MB each at most.
const TABLES: usize = 64;
/// Walks kept: some snows at all index nodes, some 4 MB each.
const WALKS: usize = 16;

/// Tables of grain events and walks made so far. Holds nothing that changes a
/// result.
#[derive(Debug)]
pub struct Cache {
    pub(super) tables: Kept<Recipe, Outcomes>,
    pub(super) walks: Kept<Occasion, Walks>,
}

impl Default for Cache {
    fn default() -> Self {
        Self {
            tables: Kept::new(TABLES),
            walks: Kept::new(WALKS),
        }
    }
}

/// The latest `most` values made.
#[derive(Debug)]
pub(super) struct Kept<K, V> {
    most: usize,
    values: Mutex<Vec<(K, Arc<V>)>>,
}

impl<K: PartialEq + Clone, V> Kept<K, V> {
    fn new(most: usize) -> Self {
        let values = Mutex::default();
        Self { most, values }
    }

    /// The value for `key`, by `make` if it is not there. Two threads that miss
    /// it at once both make it.
    pub(super) fn get<E>(&self, key: &K, make: impl FnOnce() -> Result<V, E>) -> Result<Arc<V>, E> {
        let values = || self.values.lock().unwrap_or_else(PoisonError::into_inner);
        let there = values()
            .iter()
            .find(|(k, _)| k == key)
            .map(|(_, v)| Arc::clone(v));
        if let Some(value) = there {
            return Ok(value);
        }
        let value = Arc::new(make()?);
        let mut values = values();
        if values.len() >= self.most {
            values.remove(0);
        }
        values.push((key.clone(), Arc::clone(&value)));
        Ok(value)
    }
}
