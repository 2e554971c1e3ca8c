//! Checkpoints: the finished units of a request are saved while the rest is computed,
//! so that a process that is killed loses only seconds of a long job.
//!
//! A unit is a partial result that depends on the request alone: the sums over the
//! batches of walks so far, the walks of one task, the results at one wavelength. Sums
//! are saved bit for bit and added in the same order, so a resumed run gives the same
//! results as an uninterrupted one.
//!
//! Units also carry work between processes that share one request: each computes the walks
//! of its share of the index nodes ([`Units::of_share`]), and one of them takes all units and
//! computes the rest.
use std::collections::HashMap;
use std::fmt::Debug;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::EngineError;

/// Shortest time between two saves. Each save takes some milliseconds.
const SAVE_INTERVAL: Duration = Duration::from_secs(1);
/// The time between two saves is also at least the elapsed time divided by this
/// number. This limits the disk space of units that are saved repeatedly, such as sums
/// so far.
const ELAPSED_PER_INTERVAL: u32 = 20;

/// Storage for the saved units of one request.
pub trait UnitStore: Debug + Send + Sync {
    /// Adds `units` to those stored before. Returns false if that fails; the request
    /// then ends as if it were cancelled.
    fn append(&self, units: &[u8]) -> bool;
}

/// The finished units of one request. The default does not save any.
#[derive(Debug, Default)]
pub struct Units {
    interval: Duration,
    store: Option<Box<dyn UnitStore>>,
    share: Option<Share>,
    state: Mutex<State>,
}

/// The index nodes that one of several processes walks: those whose number is `index` modulo
/// `count`.
#[derive(Debug, Clone, Copy)]
struct Share {
    index: usize,
    count: usize,
}

#[derive(Debug)]
struct State {
    /// Units of an earlier run, by name.
    earlier: HashMap<String, Vec<u8>>,
    /// Units finished in this run and not saved yet, by name.
    unsaved: HashMap<String, Vec<u8>>,
    started: Option<Instant>,
    last_save: Option<Instant>,
}

/// The time; `None` in WebAssembly, which has no clock. Units are then saved on request only.
fn now() -> Option<Instant> {
    (!cfg!(target_family = "wasm")).then(Instant::now)
}

impl Default for State {
    fn default() -> Self {
        let now = now();
        Self {
            earlier: HashMap::new(),
            unsaved: HashMap::new(),
            started: now,
            last_save: now,
        }
    }
}

impl Units {
    /// Units to be saved in `store`. `earlier` are the byte strings that an earlier run
    /// passed to [`UnitStore::append`], oldest first.
    #[must_use]
    pub fn new(store: Box<dyn UnitStore>, earlier: &[Vec<u8>]) -> Self {
        let units = earlier.iter().flat_map(|bytes| {
            let units = postcard::from_bytes::<HashMap<String, Vec<u8>>>(bytes);
            units.unwrap_or_default()
        });
        let state = State {
            earlier: units.collect(),
            ..State::default()
        };
        Self {
            interval: SAVE_INTERVAL,
            store: Some(store),
            share: None,
            state: Mutex::new(state),
        }
    }

    /// Sets the shortest time between two saves.
    #[must_use]
    pub fn with_save_interval(self, interval: Duration) -> Self {
        Self { interval, ..self }
    }

    /// Restricts a run of `hybrid` to the walks of the index nodes whose number is `index`
    /// modulo `count`, which must not be 0. The spectra of such a run are NaN: another run
    /// that takes the units of all shares computes them.
    #[must_use]
    pub fn of_share(self, index: usize, count: usize) -> Self {
        let share = Some(Share { index, count });
        Self { share, ..self }
    }

    /// Whether this run walks index node number `node`.
    pub(super) fn include(&self, node: usize) -> bool {
        let is_in = |share: Share| node % share.count.max(1) == share.index;
        self.share.is_none_or(is_in)
    }

    /// Whether this run walks a share of the index nodes only.
    pub(super) fn is_share(&self) -> bool {
        self.share.is_some()
    }

    /// Removes and returns the unit `name` of an earlier run.
    pub(super) fn take<T: DeserializeOwned>(&self, name: &str) -> Option<T> {
        let bytes = self.state().earlier.remove(name)?;
        postcard::from_bytes(&bytes).ok()
    }

    /// Adds a finished unit, and saves all unsaved units if a save is due.
    pub(super) fn add<T: Serialize>(&self, name: &str, unit: &T) -> Result<(), EngineError> {
        self.enter(name, unit, |state| self.is_due(state))
    }

    /// Adds a unit that is not complete yet, and saves it, if a save is due.
    pub(super) fn add_if_due<T: Serialize>(
        &self,
        name: &str,
        unit: impl FnOnce() -> T,
    ) -> Result<(), EngineError> {
        if self.store.is_some() && self.is_due(&self.state()) {
            self.enter(name, &unit(), |_| true)?;
        }
        Ok(())
    }

    /// Saves all unsaved units.
    pub(super) fn save(&self) -> Result<(), EngineError> {
        self.write(&mut self.state())
    }

    fn enter<T: Serialize>(
        &self,
        name: &str,
        unit: &T,
        saves_now: impl Fn(&State) -> bool,
    ) -> Result<(), EngineError> {
        // a unit that cannot be serialised will be computed again
        if self.store.is_some()
            && let Ok(bytes) = postcard::to_allocvec(unit)
        {
            let mut state = self.state();
            state.unsaved.insert(name.to_owned(), bytes);
            if saves_now(&state) {
                return self.write(&mut state);
            }
        }
        Ok(())
    }

    fn write(&self, state: &mut State) -> Result<(), EngineError> {
        let Some(store) = self.store.as_ref().filter(|_| !state.unsaved.is_empty()) else {
            return Ok(());
        };
        let bytes = postcard::to_allocvec(&state.unsaved).unwrap_or_default();
        state.unsaved.clear();
        let is_saved = store.append(&bytes);
        state.last_save = now();
        is_saved.then_some(()).ok_or(EngineError::Cancelled)
    }

    fn is_due(&self, state: &State) -> bool {
        let (Some(last_save), Some(started)) = (state.last_save, state.started) else {
            return false;
        };
        last_save.elapsed() >= self.interval.max(started.elapsed() / ELAPSED_PER_INTERVAL)
    }

    fn state(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::sync::Arc;

    use super::*;

    #[derive(Debug, Clone, Default)]
    struct Memory(Arc<Mutex<Vec<Vec<u8>>>>);

    impl UnitStore for Memory {
        fn append(&self, units: &[u8]) -> bool {
            self.0.lock().unwrap().push(units.to_vec());
            true
        }
    }

    #[test]
    fn the_latest_unit_of_a_name_is_given_once() {
        let memory = Memory::default();
        let open = || Units::new(Box::new(memory.clone()), &memory.0.lock().unwrap().clone());
        let units = open();
        for value in [0.1_f64, f64::from_bits(0x3fb9_9999_9999_999b)] {
            units.add("sum", &(3_u64, vec![value])).unwrap();
            units.save().unwrap();
        }
        units.add("other", &7_u8).unwrap();
        assert_eq!(memory.0.lock().unwrap().len(), 2, "no save is due yet");
        let units = open();
        let (count, sum) = units.take::<(u64, Vec<f64>)>("sum").unwrap();
        assert_eq!((count, sum[0].to_bits()), (3, 0x3fb9_9999_9999_999b));
        assert!(units.take::<(u64, Vec<f64>)>("sum").is_none());
        assert!(units.take::<u8>("other").is_none(), "it was not saved");
    }

    #[test]
    fn nothing_is_saved_without_a_store() {
        let units = Units::default();
        units.add("a", &1_u8).unwrap();
        units.add_if_due("b", || -> u8 { unreachable!() }).unwrap();
        units.save().unwrap();
        assert!(units.take::<u8>("a").is_none());
    }
}
