//! Speed against accuracy: every engine at a ladder of settings on some samples,
//! its CPU time and its distance from a converged truth.
//!
//! Errors are root mean squares over runs with seeds of their own, one measure
//! at a time, against a truth of many more rays whose standard error is told
//! beside them: it adds to every error in quadrature, so what is below it cannot
//! be seen. Values follow from samples, settings and seeds alone; CPU times, and
//! with them how far up its ladder an engine gets within the budget, do not.
mod band;
mod baseline;
mod components;
mod error;
mod errors;
mod ladder;
mod measure;
mod pareto;
mod point;
mod recommend;
mod sample;
mod scaling;
mod sweep;
mod truth;

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

pub use band::Band;
pub use baseline::BASELINE_RAYS;
pub use components::{Coding, Components, Source};
pub use error::TradeoffError;
pub use errors::Metrics;
pub use ladder::{Setting, ladder};
pub use pareto::front;
pub use point::{Point, points};
pub use recommend::{Bound, Candidate, Measure, Recommendation, recommend};
pub use sample::Sample;
pub use scaling::{Cost, Growth};
pub use sweep::{Kind, Refusal, Row};

use crate::engine::Engine;
use measure::Bench;
use truth::Truths;

/// What to chart.
#[derive(Debug)]
pub struct Options {
    /// The snow; at least one, of different names.
    pub samples: Vec<Sample>,
    /// The engines.
    pub engines: Vec<Engine>,
    /// Runs of each setting, with seeds 1, 2, ...; at least 1.
    pub seeds: u64,
    /// CPU seconds to spend, more or less: the first setting of every ladder is
    /// always run, and what would not fit is left out. A truth of given rays
    /// does not count.
    pub budget: f64,
    /// Threads; 0 is one per core.
    pub threads: usize,
    /// The engine of the truth.
    pub truth_engine: Engine,
    /// Rays of the truth; `None` for what two fifths of the budget allow.
    pub truth_rays: Option<u64>,
    /// Where truths are kept.
    pub truth_folder: PathBuf,
    /// The curves whose compression is charted.
    pub source: Source,
}

/// All that was measured.
#[derive(Debug)]
pub struct Results {
    /// Names of the samples.
    pub samples: Vec<String>,
    /// Errors and costs: by setting, sample, band, quantity.
    pub rows: Vec<Row>,
    /// Settings that an engine refused for a sample.
    pub refusals: Vec<Refusal>,
    /// Rays of the least converged truth.
    pub truth_rays: u64,
    /// What the cost of a run grows with.
    pub costs: Vec<Cost>,
    /// Errors of compression.
    pub components: Vec<Components>,
}

/// Measures everything; `say` is told what is being done.
///
/// # Errors
/// See [`TradeoffError`]; setting `cancel` makes it stop soon.
pub fn run(
    options: &Options,
    cancel: &AtomicBool,
    say: &dyn Fn(&str),
) -> Result<Results, TradeoffError> {
    let mut bench = Bench::new(options.threads, options.budget, cancel)?;
    // First, so that what cannot be written or read is told at once.
    let folder = options.truth_folder.clone();
    fs::create_dir_all(&folder).map_err(|source| TradeoffError::Io {
        path: folder.clone(),
        source,
    })?;
    let components = components::measure(&bench, &options.source, say)?;
    say("what a ray costs");
    let truths = Truths {
        bench: &bench,
        engine: options.truth_engine,
        rays: options.truth_rays,
        folder,
    };
    let before = bench.spent();
    let truths = truths.all(&options.samples, say)?;
    if options.truth_rays.is_some() {
        bench.excuse(bench.spent() - before);
    }
    let mut sweep = sweep::Sweep::new(&bench, &options.samples, &truths, options.seeds)?;
    for (i, &engine) in options.engines.iter().enumerate() {
        sweep.climb(engine, options.engines.len() - i, say)?;
    }
    let (mut rows, refusals) = sweep.finish();
    say("cost of the baseline");
    let baseline = baseline::rows(&bench, &rows, &options.samples, &truths)?;
    rows.extend(baseline);
    let costs = match options.samples.first() {
        Some(sample) => scaling::costs(&bench, sample, &options.engines, say)?,
        None => Vec::new(),
    };
    Ok(Results {
        samples: options.samples.iter().map(|s| s.name.clone()).collect(),
        rows,
        refusals,
        truth_rays: truths.iter().flatten().map(|t| t.rays).min().unwrap_or(0),
        costs,
        components,
    })
}
