//! `splitsnow plan`: what a build will take.
use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::common::{self, GridArgs};
use super::pilot::Pilot;
use crate::config::grid::GridFile;
use crate::grid::{Grid, Jobs, absent_curves, why_absent};
use crate::lookup::format::WAVELENGTH;
use crate::store::{Store, StoreError, estimated_bytes};

/// Time to store one job, s: six files flushed to the disk (1 to 7 ms measured
/// on virtual disks).
const STORE_SECONDS: f64 = 0.003;
/// Time to compress one value of one quantity, s, and what each wavelength adds
/// to that, in the decomposition.
const COMPRESS_SECONDS: (f64, f64) = (1.5e-7, 2e-10);
/// Components for which the size of the compact file is given.
const COMPONENTS: u64 = 3;
/// Typical bytes of the header of a compact file.
const HEADER: u64 = 10_000;

/// Say what a build will take, without running it
///
/// Prints the axes, the number of jobs and curves, the job that takes longest, and
/// estimates of time, bytes and standard errors. To find these, a few of the jobs are
/// run with as many of their rays as the budget of --seconds allows; the rest is
/// extrapolated. Nothing is written. If the output directory holds part of the
/// database, the time is that of the jobs left.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "\
Examples:
  splitsnow plan configs/quick.toml
  splitsnow plan configs/thesis.toml --threads 16 --json")]
pub(super) struct Args {
    #[command(flatten)]
    grid: GridArgs,
    /// CPU seconds to measure with, in all threads together
    #[arg(long, value_name = "X", default_value = "5", value_parser = common::positive)]
    seconds: f64,
    /// Print the plan as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Plan {
    name: String,
    out: PathBuf,
    engine: &'static str,
    seed: u64,
    rays: u64,
    axes: Vec<Axis>,
    jobs: u64,
    jobs_left: u64,
    curves: u64,
    /// Those of them that do not exist, and why.
    absent_curves: u64,
    #[serde(skip)]
    why_absent: String,
    threads: usize,
    /// Of the jobs left, and of the compression.
    core_seconds: f64,
    wall_seconds: f64,
    database_bytes: u64,
    /// With [`COMPONENTS`] components for each quantity.
    compact_bytes: u64,
    /// Absent where nothing could be run.
    median_standard_error: Option<f64>,
    max_standard_error: Option<f64>,
    longest_job: LongestJob,
    pilot: Measured,
    next: String,
}

/// The job that takes longest on one thread.
#[derive(Debug, Serialize)]
struct LongestJob {
    parameters: String,
    engine: &'static str,
    rays: u64,
    /// Rays it was run with; 0 if its time is from those of others and its size.
    rays_run: u64,
    core_seconds: f64,
}

/// What the estimates rest on.
#[derive(Debug, Serialize)]
struct Measured {
    budget_seconds: f64,
    spent_seconds: f64,
    /// Jobs run, and how many of them with all rays.
    jobs: usize,
    jobs_whole: usize,
    /// Fewest and most rays of these.
    rays: [u64; 2],
    /// Wavelengths they were run at.
    wavelengths: usize,
    /// What no run ended of within the budget: from sizes and typical times.
    not_measured: Vec<&'static str>,
}

#[derive(Debug, Serialize)]
struct Axis {
    name: &'static str,
    values: Vec<f64>,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let file = args.grid.open()?;
    let plan = plan(args, &file)?;
    if args.json {
        return common::print_json(&plan);
    }
    common::print(&plan.to_string())
}

fn plan(args: &Args, file: &GridFile) -> anyhow::Result<Plan> {
    let grid = &file.grid;
    let jobs = grid.jobs()?;
    let out = args.grid.dir(file);
    let left = left(&out, grid)?;
    let absent = grid.absent()?;
    let threads = args.grid.threads()?;
    let pilot = Pilot::run(grid, &jobs, threads, args.seconds)?;
    let (jobs_left, walking) = match &left {
        None => (jobs.count(), pilot.time()),
        Some(left) => (left.len() as u64, pilot.time_of(grid, &jobs, left)?),
    };
    let storing = jobs_left as f64 * STORE_SECONDS;
    let (value, wavelength) = COMPRESS_SECONDS;
    let values = 2.0 * (jobs.curves() * jobs.wavelengths()) as f64;
    let compressing = values * (value + wavelength * jobs.wavelengths() as f64);
    let axes = grid.axes.iter().map(|(axis, values)| (axis.name(), values));
    let axes = axes.chain([(WAVELENGTH, grid.wavelengths_nm.as_slice())]);
    Ok(Plan {
        name: file.name.clone(),
        out,
        engine: grid.run.engine.name(),
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
        longest_job: LongestJob {
            parameters: pilot.longest.job.clone(),
            engine: pilot.longest.engine.name(),
            rays: pilot.longest.rays[0],
            rays_run: pilot.longest.rays[1],
            core_seconds: pilot.longest.core,
        },
        pilot: Measured {
            budget_seconds: args.seconds,
            spent_seconds: pilot.spent,
            jobs: pilot.jobs[0],
            jobs_whole: pilot.jobs[1],
            rays: pilot.rays,
            wavelengths: pilot.wavelengths,
            not_measured: pilot.guessed.clone(),
        },
        next: args.grid.command("build"),
    })
}

/// The jobs that are left of a database begun in `dir`; `None` if there is none.
fn left(dir: &Path, grid: &Grid) -> anyhow::Result<Option<Vec<u64>>> {
    let inputs = common::data_hashes(grid)?;
    let begun = Store::open(dir).and_then(|store| {
        store.check_same(grid, &inputs)?;
        store.missing(None)
    });
    match begun {
        Ok(left) => Ok(Some(left)),
        Err(StoreError::Absent { .. }) => Ok(None),
        Err(refused) => {
            common::warn(&[format!("a build would be refused: {refused}")]);
            Ok(None)
        }
    }
}

fn compact_bytes(jobs: &Jobs) -> u64 {
    let axes: u64 = jobs.shape().iter().sum::<u64>() + jobs.wavelengths();
    let factors = COMPONENTS * (jobs.curves() + jobs.wavelengths());
    HEADER + size_of::<f64>() as u64 * axes + size_of::<f32>() as u64 * 2 * factors
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        writeln!(
            f,
            "{}: engine {}, seed {}, {} rays per curve",
            self.name, self.engine, self.seed, self.rays
        )?;
        for Axis { name, values } in &self.axes {
            let [first, .., last] = values.as_slice() else {
                let only = values.first().copied().unwrap_or_default();
                writeln!(f, "  {name:<14} {only}")?;
                continue;
            };
            writeln!(f, "  {name:<14} {} values, {first} to {last}", values.len())?;
        }
        let per_job = self.curves / self.jobs.max(1);
        writeln!(
            f,
            "\njobs            {} of {per_job} curve{} each: {} curves",
            self.jobs,
            if per_job == 1 { "" } else { "s" },
            self.curves
        )?;
        if self.absent_curves > 0 {
            writeln!(f, "absent          {}", self.why_absent)?;
        }
        if self.jobs_left < self.jobs {
            let out = self.out.display();
            writeln!(
                f,
                "left            {} jobs; the others are in {out}",
                self.jobs_left
            )?;
        }
        writeln!(
            f,
            "time            about {} core-seconds, {} on {} thread{}",
            whole(self.core_seconds),
            common::duration(self.wall_seconds),
            self.threads,
            if self.threads == 1 { "" } else { "s" }
        )?;
        writeln!(
            f,
            "disk            {} for the database, {} for the compact file with {COMPONENTS} components",
            common::bytes(self.database_bytes),
            common::bytes(self.compact_bytes)
        )?;
        match (self.median_standard_error, self.max_standard_error) {
            (Some(median), Some(max)) => writeln!(
                f,
                "standard error  median {median:.5}, largest about {max:.5}, of values between 0 and 1"
            )?,
            _ => writeln!(
                f,
                "standard error  unknown: no run ended; give more --seconds"
            )?,
        }
        let LongestJob {
            parameters,
            engine,
            rays,
            rays_run,
            core_seconds,
        } = &self.longest_job;
        writeln!(
            f,
            "longest job     about {} core-seconds by {engine}, {}: {parameters}",
            whole(*core_seconds),
            match rays_run {
                0 => "from its size".to_owned(),
                run if run == rays => "measured".to_owned(),
                run => format!("extrapolated from {run} of its {rays} rays"),
            }
        )?;
        let Measured {
            spent_seconds,
            jobs,
            jobs_whole,
            rays: [fewest, most],
            wavelengths,
            not_measured,
            ..
        } = &self.pilot;
        writeln!(
            f,
            "measured        {jobs} jobs with {fewest} to {most} rays, in {spent_seconds:.1} CPU-seconds, on this machine as busy as it is"
        )?;
        let mut extrapolated = Vec::new();
        if jobs_whole < jobs {
            let fewer = jobs - jobs_whole;
            extrapolated.push(format!(
                "{fewer} of these to all {} rays",
                self.longest_job.rays
            ));
        }
        let all = self.axes.last().map_or(0, |axis| axis.values.len());
        if *wavelengths < all {
            extrapolated.push(format!("from {wavelengths} wavelengths to {all}"));
        }
        let others = self.jobs.saturating_sub(*jobs as u64);
        if others > 0 {
            extrapolated.push(format!("{others} jobs from their sizes"));
        }
        if !extrapolated.is_empty() {
            writeln!(f, "extrapolated    {}", extrapolated.join(", "))?;
        }
        if !not_measured.is_empty() {
            writeln!(
                f,
                "not measured    {}: from typical times; give more --seconds",
                not_measured.join(", ")
            )?;
        }
        writeln!(f, "next            {}", self.next)
    }
}

/// Seconds with the two digits that can be known.
fn whole(seconds: f64) -> String {
    if seconds < 10.0 {
        return format!("{seconds:.1}");
    }
    let unit = 10_f64.powf(seconds.log10().floor() - 1.0);
    format!("{:.0}", (seconds / unit).round() * unit)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::engine::Engine;
    use crate::parameter::Parameter;

    #[test]
    fn two_digits_of_seconds() {
        let texts = [0.04, 9.94, 14.4, 105.0, 146_762.0].map(whole);
        assert_eq!(texts, ["0.0", "9.9", "14", "110", "150000"]);
    }

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
