//! What is finished of a request, kept while the rest is at work, so that what ends
//! the process costs seconds of a long job, not all of it.
//!
//! A unit is a share of a request that is a function of the request alone: batches
//! of walks so far, walks of one task, spectra at one wavelength. Sums are kept to
//! the bit and added in the same order, so results are those of one go.
use std::collections::HashMap;
use std::fmt::Debug;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::EngineError;

/// Least time between two savings. Each takes some milliseconds.
const PAUSE: Duration = Duration::from_secs(1);
/// That time, at least, as a share of the time at work: what is saved again and
/// again, such as sums so far, takes room once in so many parts.
const SHARE: u32 = 20;

/// Where units are kept.
pub trait UnitStore: Debug + Send + Sync {
    /// Keeps `units` beside those kept before; false if that fails, which ends
    /// the request as if it were cancelled.
    fn keep(&self, units: &[u8]) -> bool;
}

/// The finished units of one request. The default keeps none.
#[derive(Debug, Default)]
pub struct Units {
    pause: Duration,
    keep: Option<Box<dyn UnitStore>>,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    /// From before, by name.
    found: HashMap<String, Vec<u8>>,
    /// Finished, and not kept yet.
    new: HashMap<String, Vec<u8>>,
    begun: Instant,
    kept: Instant,
}

impl Default for State {
    fn default() -> Self {
        let now = Instant::now();
        Self {
            found: HashMap::new(),
            new: HashMap::new(),
            begun: now,
            kept: now,
        }
    }
}

impl Units {
    /// Those that `keep` was given before, the latest last.
    #[must_use]
    pub fn new(keep: Box<dyn UnitStore>, before: &[Vec<u8>]) -> Self {
        let units = before.iter().flat_map(|bytes| {
            let units = postcard::from_bytes::<HashMap<String, Vec<u8>>>(bytes);
            units.unwrap_or_default()
        });
        let state = State {
            found: units.collect(),
            ..State::default()
        };
        Self {
            pause: PAUSE,
            keep: Some(keep),
            state: Mutex::new(state),
        }
    }

    /// The same with another least time between two savings.
    #[must_use]
    pub fn saved_every(self, pause: Duration) -> Self {
        Self { pause, ..self }
    }

    /// The unit `name` of an earlier run. It is given once.
    pub(super) fn take<T: DeserializeOwned>(&self, name: &str) -> Option<T> {
        let bytes = self.state().found.remove(name)?;
        postcard::from_bytes(&bytes).ok()
    }

    /// Adds a unit that is finished, and saves those that are new if it is time.
    pub(super) fn add<T: Serialize>(&self, name: &str, unit: &T) -> Result<(), EngineError> {
        self.enter(name, unit, |state| self.is_due(state))
    }

    /// The same, if it is time: for a unit of which more is to come.
    pub(super) fn add_if_due<T: Serialize>(
        &self,
        name: &str,
        unit: impl FnOnce() -> T,
    ) -> Result<(), EngineError> {
        if self.keep.is_some() && self.is_due(&self.state()) {
            self.enter(name, &unit(), |_| true)?;
        }
        Ok(())
    }

    /// Saves what is new.
    pub(super) fn save(&self) -> Result<(), EngineError> {
        self.write(&mut self.state())
    }

    fn enter<T: Serialize>(
        &self,
        name: &str,
        unit: &T,
        now: impl Fn(&State) -> bool,
    ) -> Result<(), EngineError> {
        // what cannot be put into bytes is computed again
        if self.keep.is_some()
            && let Ok(bytes) = postcard::to_allocvec(unit)
        {
            let mut state = self.state();
            state.new.insert(name.to_owned(), bytes);
            if now(&state) {
                return self.write(&mut state);
            }
        }
        Ok(())
    }

    fn write(&self, state: &mut State) -> Result<(), EngineError> {
        let Some(keep) = self.keep.as_ref().filter(|_| !state.new.is_empty()) else {
            return Ok(());
        };
        let bytes = postcard::to_allocvec(&state.new).unwrap_or_default();
        state.new.clear();
        let kept = keep.keep(&bytes);
        state.kept = Instant::now();
        kept.then_some(()).ok_or(EngineError::Cancelled)
    }

    fn is_due(&self, state: &State) -> bool {
        state.kept.elapsed() >= self.pause.max(state.begun.elapsed() / SHARE)
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
        fn keep(&self, units: &[u8]) -> bool {
            self.0.lock().unwrap().push(units.to_vec());
            true
        }
    }

    #[test]
    fn units_come_back_once_and_the_latest_counts() {
        let memory = Memory::default();
        let open = || Units::new(Box::new(memory.clone()), &memory.0.lock().unwrap().clone());
        let units = open();
        for value in [0.1_f64, f64::from_bits(0x3fb9_9999_9999_999b)] {
            units.add("sum", &(3_u64, vec![value])).unwrap();
            units.save().unwrap();
        }
        units.add("other", &7_u8).unwrap();
        assert_eq!(memory.0.lock().unwrap().len(), 2, "it is not time yet");
        let units = open();
        let (count, sum) = units.take::<(u64, Vec<f64>)>("sum").unwrap();
        assert_eq!((count, sum[0].to_bits()), (3, 0x3fb9_9999_9999_999b));
        assert!(units.take::<(u64, Vec<f64>)>("sum").is_none());
        assert!(units.take::<u8>("other").is_none(), "it was not saved");
    }

    #[test]
    fn nothing_is_kept_where_there_is_no_place() {
        let units = Units::default();
        units.add("a", &1_u8).unwrap();
        units.add_if_due("b", || -> u8 { unreachable!() }).unwrap();
        units.save().unwrap();
        assert!(units.take::<u8>("a").is_none());
    }
}
