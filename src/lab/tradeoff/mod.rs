//! Speed against accuracy: the CPU time of every engine, at a ladder of settings on some
//! samples, and its error against a converged reference (the truth).
//!
//! Errors are root mean squares over runs with different seeds, for each measure. The truth has
//! many more rays; its standard error is stated as well. It adds in quadrature to every error,
//! so errors below it cannot be resolved. Values depend on samples, settings and seeds only. CPU
//! times, and with them how many settings of an engine fit into the budget, vary from run to
//! run.
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

pub use band::SpectralDomain;
pub use baseline::BASELINE_RAYS;
pub use components::{Coding, Components, CompressionSource};
pub use error::TradeoffError;
pub use errors::Metrics;
pub use ladder::{Setting, ladder};
pub use pareto::front;
pub use point::{ChartPoint, points};
pub use recommend::{Bound, Candidate, Measure, Recommendation, recommend};
pub use sample::NamedSample;
pub use scaling::{Cost, ScalingVariable};
pub use sweep::{Refusal, Row, RowKind};

use crate::engine::Engine;
use measure::Bench;
use truth::Truths;

/// The settings of a run.
#[derive(Debug)]
pub struct TradeoffOptions {
    /// The samples; at least one, with different names.
    pub samples: Vec<NamedSample>,
    /// The engines to chart.
    pub engines: Vec<Engine>,
    /// Number of runs of each setting, with seeds 1, 2, ...; at least 1.
    pub seeds: u64,
    /// CPU seconds to spend, approximately. The first setting of every ladder always runs;
    /// settings that exceed the budget are left out. The truth does not count if its rays are
    /// given.
    pub budget: f64,
    /// Number of threads; 0 for one per core.
    pub threads: usize,
    /// The engine that computes the truth.
    pub truth_engine: Engine,
    /// Rays of the truth; `None` for as many as two fifths of the budget allow.
    pub truth_rays: Option<u64>,
    /// Folder in which truths are stored.
    pub truth_folder: PathBuf,
    /// The curves whose compression is charted.
    pub source: CompressionSource,
}

/// All results of a run.
#[derive(Debug)]
pub struct Results {
    /// Names of the samples.
    pub samples: Vec<String>,
    /// Errors and costs, ordered by setting, sample, band and quantity.
    pub rows: Vec<Row>,
    /// Settings that an engine refused on a sample.
    pub refusals: Vec<Refusal>,
    /// Rays of the truth with the fewest rays.
    pub truth_rays: u64,
    /// The costs of runs against the size of the request.
    pub costs: Vec<Cost>,
    /// Errors and costs of compression.
    pub components: Vec<Components>,
}

/// Runs all measurements. `say` is called with the current activity.
///
/// # Errors
/// [`TradeoffError`] of any kind; [`TradeoffError::Cancelled`] soon after `cancel` is set.
pub fn run(
    options: &TradeoffOptions,
    cancel: &AtomicBool,
    say: &dyn Fn(&str),
) -> Result<Results, TradeoffError> {
    let mut bench = Bench::new(options.threads, options.budget, cancel)?;
    // Before all measurements, so that a folder that cannot be written is reported at once.
    let folder = options.truth_folder.clone();
    fs::create_dir_all(&folder).map_err(|source| TradeoffError::Io {
        path: folder.clone(),
        source,
    })?;
    let components = components::measure(&bench, &options.source, say)?;
    say("cost of a ray");
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
