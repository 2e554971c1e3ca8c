//! Runs engines and takes their time.
//!
//! Time is CPU time of the thread that does the run, as the system counts it
//! (`CLOCK_THREAD_CPUTIME_ID` on Linux, by the crate `cpu-time`): other
//! processes and other runs at the same time do not count in it. So every run
//! keeps to one thread, and several runs go side by side.
//!
//! Tables of grain events, which depend on the shape of the grains alone and
//! serve all the snow made of them, are made beforehand and timed apart.
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::sync::{Mutex, PoisonError};

use cpu_time::{ProcessTime, ThreadTime};
use rayon::prelude::*;

use super::{Sample, Setting, TradeoffError};
use crate::engine::{Cache, Control, EngineError, MaxError, Request, Resolution};
use crate::measurement::Spectrum;

/// One run: spectra per thickness, and the CPU seconds they took.
pub(super) struct Timed {
    pub(super) spectra: Vec<Spectrum>,
    pub(super) cpu_seconds: f64,
    /// CPU seconds that the tables took before; 0 for engines without.
    pub(super) table_seconds: f64,
}

/// Tables of one sample and seed, and the CPU seconds they took by resolution.
#[derive(Default)]
pub(super) struct Tables {
    cache: Cache,
    made: Mutex<Vec<(Resolution, f64)>>,
}

/// Threads, what may be spent on them, and a way to stop.
pub(super) struct Bench<'a> {
    pool: rayon::ThreadPool,
    cancel: &'a AtomicBool,
    begin: ProcessTime,
    budget: f64,
    /// CPU seconds that do not count.
    excused: f64,
}

impl<'a> Bench<'a> {
    /// `threads` threads (0: one per core) and `budget` CPU seconds from now on.
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

    /// CPU seconds that may be spent in all.
    pub(super) fn budget(&self) -> f64 {
        self.budget
    }

    /// CPU seconds until `share` of the budget is spent; not below 0.
    pub(super) fn left_of(&self, share: f64) -> f64 {
        (share * self.budget - self.spent()).max(0.0)
    }

    /// CPU seconds spent so far.
    pub(super) fn spent(&self) -> f64 {
        self.begin.elapsed().as_secs_f64() - self.excused
    }

    /// Takes `seconds` that were spent as if they had not been.
    pub(super) fn excuse(&mut self, seconds: f64) {
        self.excused += seconds;
    }

    /// `f` of every item, in order, on all threads.
    pub(super) fn map<I: Sync, T: Send>(
        &self,
        items: &[I],
        f: impl Fn(&I) -> Result<T, TradeoffError> + Sync + Send,
    ) -> Result<Vec<T>, TradeoffError> {
        self.pool
            .install(|| items.par_iter().with_max_len(1).map(f).collect())
    }

    /// Runs the engine of `setting` on one thread, with `tables` that were made
    /// for the same sample, wavelengths and seed.
    pub(super) fn run(
        &self,
        setting: &Setting,
        request: &Request,
        tables: &Tables,
    ) -> Result<Timed, EngineError> {
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
            let mut made = tables.made.lock().unwrap_or_else(PoisonError::into_inner);
            let known = made.iter().find(|(of, _)| *of == setting.resolution);
            table_seconds = match known {
                Some((_, seconds)) => *seconds,
                None => {
                    // as few walks as there can be leave the tables in the cache
                    let mut few = request.clone();
                    few.rays = 1;
                    let (_, seconds) = timed(&few)?;
                    made.push((setting.resolution, seconds));
                    seconds
                }
            };
        }
        let (spectra, cpu_seconds) = timed(request)?;
        Ok(Timed {
            spectra,
            cpu_seconds,
            table_seconds,
        })
    }
}

/// What to ask the engine of `setting` for.
pub(super) fn request<'a>(
    setting: &Setting,
    sample: &'a Sample,
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

/// An engine's error, as one of this program.
pub(super) fn failed(sample: &Sample, setting: &Setting, source: EngineError) -> TradeoffError {
    match source {
        EngineError::Cancelled => TradeoffError::Cancelled,
        source => TradeoffError::Engine {
            sample: sample.name.clone(),
            setting: setting.to_string(),
            source,
        },
    }
}

/// The mean of `values`; NaN of none.
pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
