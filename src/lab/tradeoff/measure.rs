//! Runs engines and measures their CPU time.
//!
//! The time is the CPU time of the thread of a run as the system counts it
//! (`CLOCK_THREAD_CPUTIME_ID` on Linux, by the crate `cpu-time`). It does not include other
//! processes and simultaneous runs. Each run therefore uses one thread, and several runs go in
//! parallel.
//!
//! Tables of grain events depend only on the shape of the grains and are shared by all snow of
//! these grains. They are made before a run and timed separately.
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::sync::{Mutex, PoisonError};

use cpu_time::{ProcessTime, ThreadTime};
use rayon::prelude::*;

use super::{NamedSample, Setting, TradeoffError};
use crate::engine::{Cache, Control, EngineError, MaxError, Request, Resolution};
use crate::measurement::Spectrum;

/// The result of one run: spectra per thickness, and the CPU seconds of the run.
pub(super) struct TimedRun {
    pub(super) spectra: Vec<Spectrum>,
    pub(super) cpu_seconds: f64,
    /// CPU seconds of making the tables beforehand; 0 for engines without tables.
    pub(super) table_seconds: f64,
}

/// The tables of one sample and seed, with the CPU seconds of making them for each resolution.
#[derive(Default)]
pub(super) struct Tables {
    cache: Cache,
    seconds: Mutex<Vec<(Resolution, f64)>>,
}

/// A thread pool with a budget of CPU time.
pub(super) struct Bench<'a> {
    pool: rayon::ThreadPool,
    cancel: &'a AtomicBool,
    begin: ProcessTime,
    budget: f64,
    /// CPU seconds that do not count against the budget.
    excused: f64,
}

impl<'a> Bench<'a> {
    /// A bench with `threads` threads (0: one per core) and `budget` CPU seconds from now on.
    pub(super) fn new(
        threads: usize,
        budget: f64,
        cancel: &'a AtomicBool,
    ) -> Result<Self, TradeoffError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|error| TradeoffError::Threads(error.to_string()))?;
        Ok(Self {
            pool,
            cancel,
            begin: ProcessTime::now(),
            budget,
            excused: 0.0,
        })
    }

    /// The budget, CPU seconds.
    pub(super) fn budget(&self) -> f64 {
        self.budget
    }

    /// CPU seconds that remain until `share` of the budget is spent; at least 0.
    pub(super) fn left_of(&self, share: f64) -> f64 {
        (share * self.budget - self.spent()).max(0.0)
    }

    /// CPU seconds spent so far that count against the budget.
    pub(super) fn spent(&self) -> f64 {
        self.begin.elapsed().as_secs_f64() - self.excused
    }

    /// Removes `seconds` from the time that counts against the budget.
    pub(super) fn excuse(&mut self, seconds: f64) {
        self.excused += seconds;
    }

    /// The results of `f` for all items, in order, computed on all threads.
    pub(super) fn map<I: Sync, T: Send>(
        &self,
        items: &[I],
        f: impl Fn(&I) -> Result<T, TradeoffError> + Sync + Send,
    ) -> Result<Vec<T>, TradeoffError> {
        self.pool
            .install(|| items.par_iter().with_max_len(1).map(f).collect())
    }

    /// Runs the engine of `setting` on one thread. `tables` belong to the same sample,
    /// wavelengths and seed.
    pub(super) fn run(
        &self,
        setting: &Setting,
        request: &Request,
        tables: &Tables,
    ) -> Result<TimedRun, EngineError> {
        let control = Control {
            parallel: false,
            cancel: self.cancel,
            rays_done: &AtomicU64::new(0),
            cache: &tables.cache,
        };
        let timed = |request: &Request| -> Result<_, EngineError> {
            let begin = ThreadTime::now();
            let spectra = setting.engine.run(request, &control)?;
            Ok((spectra, begin.elapsed().as_secs_f64()))
        };
        let mut table_seconds = 0.0;
        if setting.engine.uses_tables() {
            let mut made = tables
                .seconds
                .lock()
                .unwrap_or_else(PoisonError::into_inner);
            let known = made
                .iter()
                .find(|(resolution, _)| *resolution == setting.resolution);
            table_seconds = match known {
                Some((_, seconds)) => *seconds,
                None => {
                    // A run with a single ray leaves the tables in the cache.
                    let mut few = request.clone();
                    few.rays = 1;
                    let (_, seconds) = timed(&few)?;
                    made.push((setting.resolution, seconds));
                    seconds
                }
            };
        }
        let (spectra, cpu_seconds) = timed(request)?;
        Ok(TimedRun {
            spectra,
            cpu_seconds,
            table_seconds,
        })
    }
}

/// The request to the engine of `setting`.
pub(super) fn request<'a>(
    setting: &Setting,
    sample: &'a NamedSample,
    thicknesses_m: &'a [f64],
    wavelengths_nm: &'a [f64],
    seed: u64,
) -> Request<'a> {
    Request {
        snowpack: &sample.file.snowpack,
        thicknesses_m,
        illuminations: std::slice::from_ref(&sample.file.illumination),
        resolution: setting.resolution,
        wavelengths_nm,
        model: &sample.file.model,
        rays: setting.rays,
        max_error: MaxError::default(),
        seed,
        cell: 0,
    }
}

/// Converts an error of an engine.
pub(super) fn failed(
    sample: &NamedSample,
    setting: &Setting,
    source: EngineError,
) -> TradeoffError {
    match source {
        EngineError::Cancelled => TradeoffError::Cancelled,
        source => TradeoffError::Engine {
            sample: sample.name.clone(),
            setting: setting.to_string(),
            source,
        },
    }
}
