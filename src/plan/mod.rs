//! What a build will take, without running it.
//!
//! ```no_run
//! use splitsnow::{config, plan};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let file = config::grid::read("configs/quick.toml".as_ref())?;
//! let plan = splitsnow::plan(&file.grid, &plan::Options::default())?;
//! println!("{} jobs, {:.0} core-seconds", plan.jobs, plan.core_seconds);
//! # Ok(())
//! # }
//! ```
mod error;
mod pilot;

use std::path::{Path, PathBuf};

use serde::{Serialize, Serializer};

pub use error::PlanError;

use crate::build::data_hashes;
use crate::engine::Engine;
use crate::grid::{Grid, Jobs, absent_curves, why_absent};
use crate::lookup::format::WAVELENGTH;
use crate::store::{Store, StoreError, estimated_bytes};
use crate::threads::threads;
use pilot::Pilot;

/// Time to store one job, s: six files flushed to the disk (1 to 7 ms measured
/// on virtual disks).
const STORE_SECONDS: f64 = 0.003;
/// Time to compress one value of one quantity, s, and what each wavelength adds
/// to that, in the decomposition.
const COMPRESS_SECONDS: (f64, f64) = (1.5e-7, 2e-10);
/// Components for which the size of the compact file is given.
pub const COMPONENTS: u64 = 3;
/// Typical bytes of the header of a compact file.
const HEADER: u64 = 10_000;

/// How to plan.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Options {
    /// Threads of the build; 0 is what [`threads`] says.
    pub threads: usize,
    /// CPU seconds to measure with, in all threads together.
    pub seconds: f64,
    /// Where the database is or will be: of one begun there, the time is that of the jobs
    /// left.
    pub dir: Option<PathBuf>,
}

impl Default for Options {
    /// Five CPU seconds; no database begun.
    fn default() -> Self {
        Self {
            threads: 0,
            seconds: 5.0,
            dir: None,
        }
    }
}

/// What a build will take.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct Plan {
    /// The engine.
    #[serde(serialize_with = "engine_name")]
    pub engine: Engine,
    /// Seed of the database.
    pub seed: u64,
    /// Walks per curve.
    pub rays: u64,
    /// The axes of the database, slowest first, and the wavelengths.
    pub axes: Vec<Axis>,
    /// Jobs of the database.
    pub jobs: u64,
    /// Those that are not done.
    pub jobs_left: u64,
    /// Curves of either quantity.
    pub curves: u64,
    /// Those of them that do not exist.
    pub absent_curves: u64,
    /// Why not, in words.
    #[serde(skip)]
    pub why_absent: String,
    /// Threads of the build.
    pub threads: usize,
    /// CPU seconds of the jobs left, and of the compression.
    pub core_seconds: f64,
    /// The same by the clock.
    pub wall_seconds: f64,
    /// Size of the database.
    pub database_bytes: u64,
    /// Size of the compact file with [`COMPONENTS`] components for each quantity.
    pub compact_bytes: u64,
    /// Over curves and wavelengths; `None` where nothing could be run.
    pub median_standard_error: Option<f64>,
    /// The largest.
    pub max_standard_error: Option<f64>,
    /// The job that takes longest on one thread.
    pub longest_job: LongestJob,
    /// What the estimates rest on.
    pub pilot: Measured,
    /// Why a build in [`Options::dir`] would be refused, if it would.
    #[serde(skip)]
    pub refused: Option<StoreError>,
}

/// The job that takes longest on one thread.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct LongestJob {
    /// Its parameters.
    pub parameters: String,
    /// Who does it.
    #[serde(serialize_with = "engine_name")]
    pub engine: Engine,
    /// Its rays per curve.
    pub rays: u64,
    /// Rays it was run with; 0 if its time is from those of others and its size.
    pub rays_run: u64,
    /// CPU seconds, its tables included.
    pub core_seconds: f64,
}

/// What the estimates rest on.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Measured {
    /// CPU seconds allowed.
    pub budget_seconds: f64,
    /// CPU seconds that it took.
    pub spent_seconds: f64,
    /// Jobs run, with all or some of their rays.
    pub jobs: usize,
    /// Those of them with all rays.
    pub jobs_whole: usize,
    /// Fewest and most rays of these.
    pub rays: [u64; 2],
    /// Wavelengths they were run at.
    pub wavelengths: usize,
    /// What no run ended of within the budget: from sizes and typical times.
    pub not_measured: Vec<&'static str>,
}

/// An axis of the database.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Axis {
    /// Its name in files.
    pub name: &'static str,
    /// Its nodes.
    pub values: Vec<f64>,
}

fn engine_name<S: Serializer>(engine: &Engine, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(engine.name())
}

/// Says what a build of `grid` will take. Runs a few of its jobs with as many of their rays
/// as `options.seconds` allow, and extrapolates; nothing is written.
///
/// # Errors
/// See [`PlanError`]: the grid is impossible, or an engine refuses a job.
pub fn plan(grid: &Grid, options: &Options) -> Result<Plan, PlanError> {
    let jobs = grid.jobs()?;
    let (left, refused) = match &options.dir {
        Some(dir) => left(dir, grid)?,
        None => (None, None),
    };
    let absent = grid.absent()?;
    let threads = match options.threads {
        0 => threads(None)?,
        asked => asked,
    };
    let pilot = Pilot::run(grid, &jobs, threads, options.seconds)?;
    let (jobs_left, walking) = match &left {
        None => (jobs.count(), pilot.time()),
        Some(left) => (left.len() as u64, pilot.time_of(grid, &jobs, left)?),
    };
    let storing = jobs_left as f64 * STORE_SECONDS;
    let (value, wavelength) = COMPRESS_SECONDS;
    let values = 2.0 * (jobs.curves() * jobs.wavelengths()) as f64;
    let compressing = values * (value + wavelength * jobs.wavelengths() as f64);
    let axes = grid.axes.iter().map(|(axis, values)| (axis.key(), values));
    let axes = axes.chain([(WAVELENGTH, grid.wavelengths_nm.as_slice())]);
    Ok(Plan {
        engine: grid.run.engine,
        seed: grid.run.seed,
        rays: grid.run.rays,
        axes: axes
            .map(|(name, values)| Axis {
                name,
                values: values.to_vec(),
            })
            .collect(),
        jobs: jobs.count(),
        jobs_left,
        curves: jobs.curves(),
        absent_curves: absent_curves(&grid.axes, &absent),
        why_absent: why_absent(&grid.axes, &absent),
        threads,
        core_seconds: walking.core + compressing,
        wall_seconds: (walking.wall + storing) / threads as f64 + compressing,
        database_bytes: estimated_bytes(&jobs, jobs.count()),
        compact_bytes: compact_bytes(&jobs),
        median_standard_error: pilot.median_standard_error(),
        max_standard_error: pilot.max_standard_error(),
        pilot: Measured {
            budget_seconds: options.seconds,
            spent_seconds: pilot.spent,
            jobs: pilot.jobs[0],
            jobs_whole: pilot.jobs[1],
            rays: pilot.rays,
            wavelengths: pilot.wavelengths,
            not_measured: pilot.guessed,
        },
        longest_job: pilot.longest,
        refused,
    })
}

/// The jobs that are left of a database begun in `dir`, `None` if there is none, and why a
/// build there would be refused.
fn left(dir: &Path, grid: &Grid) -> Result<(Option<Vec<u64>>, Option<StoreError>), PlanError> {
    let inputs = data_hashes(grid)?;
    let begun = Store::open(dir).and_then(|store| {
        store.check_same(grid, &inputs)?;
        store.missing(None)
    });
    Ok(match begun {
        Ok(left) => (Some(left), None),
        Err(StoreError::Absent { .. }) => (None, None),
        Err(refused) => (None, Some(refused)),
    })
}

fn compact_bytes(jobs: &Jobs) -> u64 {
    let axes: u64 = jobs.shape().iter().sum::<u64>() + jobs.wavelengths();
    let factors = COMPONENTS * (jobs.curves() + jobs.wavelengths());
    HEADER + size_of::<f64>() as u64 * axes + size_of::<f32>() as u64 * 2 * factors
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::parameter::Parameter;

    #[test]
    fn the_compact_file_by_hand() {
        // 24 curves, 4 wavelengths: 3 (24 + 4) numbers per quantity, and 14
        // coordinates of eight bytes.
        let lengths = Parameter::CORE.into_iter().zip([2, 2, 1, 3, 2]);
        let axes = lengths.map(|(axis, n)| (axis, vec![0.5; n])).collect();
        let jobs = Jobs::new(Engine::Spectral, &axes, 4).unwrap();
        assert_eq!(compact_bytes(&jobs), HEADER + 4 * 2 * 84 + 8 * 14);
    }
}
