//! Planning: estimates the time, size and errors of a build without running it.
//!
//! ```no_run
//! use splitsnow::{config, plan};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let file = config::grid::read("configs/quick.toml".as_ref())?;
//! let plan = splitsnow::plan(&file.grid, &plan::PlanOptions::default())?;
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
use crate::engine::{Engine, Request, exits};
use crate::grid::{Grid, Jobs, absent_curves, why_absent};
use crate::lookup::format::WAVELENGTH;
use crate::store::{Store, StoreError, estimated_bytes, estimated_files};
use crate::threads::threads;
use pilot::{Pilot, Time};

/// Time to store one job, s: a file is flushed to the disk (.3 to 4 ms measured on virtual disks).
const STORE_SECONDS: f64 = 0.001;
/// Time to compress one value of one quantity, s, and the time that each wavelength adds
/// to it in the decomposition, s.
const COMPRESS_SECONDS: (f64, f64) = (1.5e-7, 2e-10);
/// Time of the light toward views, s: of the tables of a curve at one index node, and of a walk
/// there (docs/performance.md). Both depend on the snow and the wavelengths.
const VIEW_SECONDS: (f64, f64) = (0.25, 6.5e-5);
/// Number of components for which the size of the compact file of anisotropy factors is
/// estimated.
const VIEW_COMPONENTS: u64 = 12;
/// Number of components for which the size of the compact file is estimated.
pub const COMPONENTS: u64 = 3;
/// Typical size of the header of a compact file, bytes.
const HEADER: u64 = 10_000;

/// Options of planning.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PlanOptions {
    /// Number of threads of the build; 0 for the default of [`threads`].
    pub threads: usize,
    /// CPU time for pilot jobs, s, summed over all threads.
    pub seconds: f64,
    /// Output directory. If it has an unfinished database, the estimated time is that of the
    /// remaining jobs.
    pub dir: Option<PathBuf>,
}

impl Default for PlanOptions {
    /// Five CPU seconds, and no output directory.
    fn default() -> Self {
        Self {
            threads: 0,
            seconds: 5.0,
            dir: None,
        }
    }
}

/// Estimates for a build.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct Plan {
    /// The engine of the grid.
    #[serde(serialize_with = "engine_name")]
    pub engine: Engine,
    /// Seed of the random streams.
    pub seed: u64,
    /// Number of walks per curve.
    pub rays: u64,
    /// The axes of the database, slowest first, followed by the wavelengths.
    pub axes: Vec<Axis>,
    /// Number of jobs of the database.
    pub jobs: u64,
    /// Number of jobs that are not done.
    pub jobs_left: u64,
    /// Number of curves of each quantity, including those that do not exist.
    pub curves: u64,
    /// Number of curves that do not exist.
    pub absent_curves: u64,
    /// Message that says why some curves do not exist.
    #[serde(skip)]
    pub why_absent: String,
    /// Number of views toward which the light of each curve is computed; 0 if there are none.
    pub views: u64,
    /// CPU time of the light toward the views in the remaining jobs, s: a typical time, not
    /// measured.
    pub view_seconds: f64,
    /// Number of threads of the build.
    pub threads: usize,
    /// CPU time of the remaining jobs and of the compression, s.
    pub core_seconds: f64,
    /// Wall clock time of the remaining jobs and of the compression, s.
    pub wall_seconds: f64,
    /// Size of the database, bytes.
    pub database_bytes: u64,
    /// Number of files of the finished database, without the few of metadata and coordinates.
    pub database_files: u64,
    /// Size of the compact file with [`COMPONENTS`] components per quantity, bytes.
    pub compact_bytes: u64,
    /// Median standard error over curves and wavelengths; `None` if no pilot job ended.
    pub median_standard_error: Option<f64>,
    /// Largest standard error over curves and wavelengths; `None` if no pilot job ended.
    pub max_standard_error: Option<f64>,
    /// The job that takes longest on one thread.
    pub longest_job: LongestJob,
    /// The pilot jobs that the estimates are based on.
    pub pilot: PilotReport,
    /// Why a build in [`PlanOptions::dir`] would be refused; `None` if it would not.
    #[serde(skip)]
    pub refused: Option<StoreError>,
}

/// The job that takes longest on one thread.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct LongestJob {
    /// Parameters of the job.
    pub parameters: String,
    /// The engine that runs it.
    #[serde(serialize_with = "engine_name")]
    pub engine: Engine,
    /// Number of rays per curve.
    pub rays: u64,
    /// Number of rays of its pilot run; 0 if its time is estimated from its size and the
    /// times of other jobs.
    pub rays_run: u64,
    /// CPU time including that of its tables, s.
    pub core_seconds: f64,
}

/// Report on the pilot jobs.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct PilotReport {
    /// CPU time allowed, s.
    pub budget_seconds: f64,
    /// CPU time spent, s.
    pub spent_seconds: f64,
    /// Number of jobs run, with all or some of their rays.
    pub jobs: usize,
    /// Number of jobs run with all their rays.
    pub jobs_whole: usize,
    /// Smallest and largest number of rays of a job.
    pub rays: [u64; 2],
    /// Number of wavelengths of a pilot job.
    pub wavelengths: usize,
    /// Engines and tables without a pilot run that ended within the budget: their times are
    /// estimated from sizes and typical times.
    pub not_measured: Vec<&'static str>,
}

/// An axis of the database.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Axis {
    /// Name of the axis.
    pub name: &'static str,
    /// Values of the nodes.
    pub values: Vec<f64>,
}

fn engine_name<S: Serializer>(engine: &Engine, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(engine.name())
}

/// Estimates the time, size and errors of a build of `grid`. Runs a few of its jobs with as
/// many of their rays as `options.seconds` allow, and extrapolates. Writes no files.
///
/// # Errors
/// [`PlanError`] if the grid is invalid, a data table cannot be read, or an engine refuses a
/// job.
pub fn plan(grid: &Grid, options: &PlanOptions) -> Result<Plan, PlanError> {
    let jobs = grid.jobs()?;
    let (remaining, refused) = match &options.dir {
        Some(dir) => remaining_jobs(dir, grid)?,
        None => (None, None),
    };
    let absent = grid.absent()?;
    let threads = match options.threads {
        0 => threads(None)?,
        given => given,
    };
    let pilot = Pilot::run(grid, &jobs, threads, options.seconds)?;
    let (jobs_left, walking) = match &remaining {
        None => (jobs.count(), pilot.time()),
        Some(remaining) => (
            remaining.len() as u64,
            pilot.time_of(grid, &jobs, remaining)?,
        ),
    };
    let views = grid.views.as_ref().map_or(0, |views| views.axes.count());
    let view_seconds = view_seconds(grid, &jobs)?;
    let walking = Time {
        core: walking.core + view_seconds * jobs_left as f64,
        wall: walking.wall + view_seconds * jobs_left as f64,
    };
    let storing = jobs_left as f64 * STORE_SECONDS;
    let (value, wavelength) = COMPRESS_SECONDS;
    let values = 2.0 * (jobs.curves() * jobs.wavelengths() * (1 + views)) as f64;
    let compressing = values * (value + wavelength * jobs.wavelengths() as f64);
    let view_axes = grid.views.iter().flat_map(|views| views.axes.iter());
    let axes = grid.axes.iter().chain(view_axes);
    let axes = axes.map(|(axis, values)| (axis.key(), values));
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
        views,
        view_seconds: view_seconds * jobs_left as f64,
        threads,
        core_seconds: walking.core + compressing,
        wall_seconds: (walking.wall + storing) / threads as f64 + compressing,
        database_bytes: estimated_bytes(&jobs, views, jobs.count()),
        database_files: estimated_files(&jobs, views, grid.fixed.diffuse),
        compact_bytes: compact_bytes(&jobs) + views * VIEW_COMPONENTS * 8 * jobs.curves(),
        median_standard_error: pilot.median_standard_error(),
        max_standard_error: pilot.max_standard_error(),
        pilot: PilotReport {
            budget_seconds: options.seconds,
            spent_seconds: pilot.spent,
            jobs: pilot.jobs[0],
            jobs_whole: pilot.jobs[1],
            rays: pilot.rays,
            wavelengths: pilot.wavelengths,
            not_measured: pilot.not_measured,
        },
        longest_job: LongestJob {
            core_seconds: pilot.longest.core_seconds + view_seconds,
            ..pilot.longest
        },
        refused,
    })
}

/// Typical CPU time of the light toward the views of one job, s; 0 without views.
fn view_seconds(grid: &Grid, jobs: &Jobs) -> Result<f64, PlanError> {
    let Some(views) = &grid.views else {
        return Ok(0.0);
    };
    let job = grid.job(jobs, 0)?;
    let request = Request {
        rays: 1,
        ..job.request(grid)
    };
    let curves = job.thicknesses_m.len() * job.illuminations.len();
    // one walk at each index node of each curve that exists; the first job is typical
    let nodes = exits::walks(Engine::Spectral, &request)?.unwrap_or(curves as u64);
    let (tables, walk) = VIEW_SECONDS;
    Ok(nodes as f64 * (tables + walk * views.rays as f64))
}

/// The remaining jobs of the database in `dir`, `None` if there is no database; and why a
/// build there would be refused.
fn remaining_jobs(
    dir: &Path,
    grid: &Grid,
) -> Result<(Option<Vec<u64>>, Option<StoreError>), PlanError> {
    let inputs = data_hashes(grid)?;
    let missing = Store::open(dir).and_then(|store| {
        store.check_same(grid, &inputs)?;
        store.unmarked()
    });
    Ok(match missing {
        Ok(missing) => (Some(missing), None),
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
