//! What a database will cost and how exact it will be, from a few of its jobs.
//!
//! **Time.** A ray meets about H / d grains in a slab of thickness H with the
//! mean free distance d, so a job's time is nearly proportional to H / d, its
//! *size* here. Jobs are drawn with probabilities in that proportion, evenly
//! spread over the axes; the mean of time over size of those drawn, times the
//! sum of all sizes, estimates the time of all (Hansen and Hurwitz 1943):
//! without bias whatever the true law, and with little noise as it is near.
//!
//! Each is run with all its rays, or one whole batch if it has several: the few
//! long walks at the end of a batch, which leave lanes idle, are much of the
//! cost, so that fewer rays tell little; from one batch on, time is
//! proportional to rays. As many jobs run side by side as later, so that what
//! threads cost one another is measured with the rest.
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::Instant;

use anyhow::bail;

use super::common::Spinner;
use crate::engine::{BATCH, Control, Engine};
use crate::grain::mean_free_distance_m;
use crate::grid::{Grid, Job, Jobs};

/// No job is started after this time, s,
const SECONDS: f64 = 3.0;
/// but at least this many are run,
const LEAST: usize = 4;
/// and at most this many.
const MOST: usize = 48;
/// Wavelengths per job with an engine that walks each of them by itself.
const WAVELENGTHS: usize = 5;
/// Jobs whose sizes are summed, at most, of a very large grid.
const SIZES: u64 = 100_000;

/// What the jobs run have taught.
#[derive(Debug)]
pub(super) struct Pilot {
    /// Jobs run.
    pub(super) jobs: usize,
    /// Rays of each.
    pub(super) rays: u64,
    /// Time on one thread per unit of size, s.
    seconds_per_size: f64,
    /// Sum of the sizes of all jobs.
    size: f64,
    /// Standard errors expected in the database, of both quantities, sorted.
    standard_errors: Vec<f64>,
}

/// One job run.
struct Sample {
    seconds_per_size: f64,
    standard_errors: Vec<f64>,
}

impl Pilot {
    /// Runs some jobs of `grid` on `threads` threads.
    pub(super) fn run(grid: &Grid, jobs: &Jobs, threads: usize) -> anyhow::Result<Self> {
        let _spinner = Spinner::new("timing a few jobs");
        let begin = Instant::now();
        let (drawn, size) = draw(grid, jobs)?;
        let (thinned, of_each) = thinned(grid);
        let next = AtomicUsize::new(0);
        let work = || -> anyhow::Result<Vec<Sample>> {
            let mut samples = Vec::new();
            loop {
                let position = next.fetch_add(1, Ordering::Relaxed);
                let late = begin.elapsed().as_secs_f64() > SECONDS;
                match drawn.get(position) {
                    Some(job) if !late || position < LEAST => {
                        samples.push(sample(&thinned, of_each, job)?);
                    }
                    _ => return Ok(samples),
                }
            }
        };
        let samples = std::thread::scope(|scope| -> anyhow::Result<Vec<Sample>> {
            let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
            let mut samples = Vec::new();
            for worker in workers {
                let ended = worker.join();
                samples.extend(ended.unwrap_or_else(|_| bail!("a pilot job failed"))?);
            }
            Ok(samples)
        })?;
        let sum: f64 = samples.iter().map(|sample| sample.seconds_per_size).sum();
        let mut standard_errors: Vec<f64> = samples
            .iter()
            .flat_map(|sample| &sample.standard_errors)
            .copied()
            .collect();
        standard_errors.sort_by(f64::total_cmp);
        Ok(Self {
            jobs: samples.len(),
            rays: grid.run.rays.min(BATCH),
            seconds_per_size: sum / samples.len() as f64,
            size,
            standard_errors,
        })
    }

    /// Time of all jobs on one thread, s.
    pub(super) fn seconds(&self) -> f64 {
        self.seconds_per_size * self.size
    }

    /// Time of one job on one thread, s.
    pub(super) fn seconds_of(&self, job: &Job) -> f64 {
        self.seconds_per_size * size(job)
    }

    /// Median standard error expected over curves and wavelengths.
    pub(super) fn median_standard_error(&self) -> f64 {
        let middle = self.standard_errors.get(self.standard_errors.len() / 2);
        middle.copied().unwrap_or_default()
    }

    /// The largest.
    pub(super) fn max_standard_error(&self) -> f64 {
        self.standard_errors.last().copied().unwrap_or_default()
    }
}

/// Mean free distances across the thickest slab; never 0.
fn size(job: &Job) -> f64 {
    let snow = &job.snow;
    let distance_m = mean_free_distance_m(&snow.grain, snow.density_kg_m3, snow.temperature_c);
    let thickness_m = job.thicknesses_m.last().copied().unwrap_or_default();
    1.0 + thickness_m / distance_m
}

/// Jobs in the order to run them, and the sum of the sizes of all jobs.
fn draw(grid: &Grid, jobs: &Jobs) -> anyhow::Result<(Vec<Job>, f64)> {
    // An odd step meets all values of an axis of even length.
    let step = jobs.count().div_ceil(SIZES) | 1;
    let mut sums = Vec::new();
    let mut sum = 0.0;
    for number in (0..jobs.count()).step_by(step as usize) {
        sum += size(&grid.job(jobs, number)?);
        sums.push((sum, number));
    }
    let count = MOST.min(sums.len());
    // Multiples of the golden ratio fill the unit interval evenly at any count.
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let drawn = (0..count).map(|i| {
        let at = (0.5 + i as f64 * golden).fract() * sum;
        let position = sums.partition_point(|(below, _)| *below <= at);
        let number = sums.get(position).map_or(0, |(_, number)| *number);
        grid.job(jobs, number)
    });
    let drawn = drawn.collect::<Result<_, _>>()?;
    let all = jobs.count() as f64 / sums.len() as f64;
    Ok((drawn, sum * all))
}

/// The grid with fewer wavelengths, if each is walked by itself, and how many
/// of the full grid one of them stands for.
fn thinned(grid: &Grid) -> (Grid, f64) {
    let mut thin = grid.clone();
    let all = grid.wavelengths_nm.len();
    if grid.run.engine == Engine::Reference && all > WAVELENGTHS {
        let middle = |i: usize| (2 * i + 1) * all / (2 * WAVELENGTHS);
        let chosen = (0..WAVELENGTHS).filter_map(|i| grid.wavelengths_nm.get(middle(i)));
        thin.wavelengths_nm = chosen.copied().collect();
    }
    let of_each = all as f64 / thin.wavelengths_nm.len() as f64;
    (thin, of_each)
}

/// Runs one job with at most one batch of rays.
fn sample(grid: &Grid, of_each: f64, job: &Job) -> anyhow::Result<Sample> {
    let mut request = job.request(grid);
    let wanted = request.rays;
    request.rays = wanted.min(BATCH);
    let more = wanted as f64 / request.rays as f64;
    let control = Control {
        parallel: false,
        cancel: &AtomicBool::new(false),
        rays_done: &AtomicU64::new(0),
    };
    let begin = Instant::now();
    let spectra = grid.run.engine.run(&request, &control)?;
    let seconds = begin.elapsed().as_secs_f64() * more * of_each;
    Ok(Sample {
        seconds_per_size: seconds / size(job),
        standard_errors: spectra
            .iter()
            .flat_map(|spectrum| spectrum.transmittance.iter().chain(&spectrum.reflectance))
            .map(|measured| measured.se / more.sqrt())
            .collect(),
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::grid::tests::small;

    #[test]
    fn draws_follow_the_sizes() {
        let grid = small(Engine::Spectral);
        let jobs = grid.jobs().unwrap();
        let (drawn, sum) = draw(&grid, &jobs).unwrap();
        let sizes: Vec<f64> = (0..jobs.count())
            .map(|n| size(&grid.job(&jobs, n).unwrap()))
            .collect();
        assert_eq!(drawn.len(), 8);
        assert!((sum / sizes.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        // Grains of 50-150 um are smaller than those of 150-250 um, so there
        // are more of them in the way: drawn 5 or 6 times of 8, not 4.
        let fine = |job: &&Job| job.snow.grain.size.max_m() < 200e-6;
        let share = drawn.iter().filter(fine).count() as f64 / 8.0;
        let expected = (sizes[0] + sizes[4]) / (sizes[0] + sizes[2] + sizes[4] + sizes[6]);
        assert!(
            expected > 0.6 && (share - expected).abs() < 0.1,
            "{share} {expected}"
        );
    }

    #[test]
    fn only_the_reference_is_thinned() {
        let mut grid = small(Engine::Spectral);
        grid.wavelengths_nm = (400..431).map(f64::from).collect();
        assert_eq!(thinned(&grid).1, 1.0);
        grid.run.engine = Engine::Reference;
        let (thin, of_each) = thinned(&grid);
        assert_eq!(thin.wavelengths_nm, [403.0, 409.0, 415.0, 421.0, 427.0]);
        assert_eq!(of_each, 6.2);
    }

    #[test]
    fn errors_scale_with_rays() {
        let mut grid = small(Engine::Spectral);
        let run = |grid: &Grid| Pilot::run(grid, &grid.jobs().unwrap(), 1).unwrap();
        grid.run.rays = BATCH;
        let one = run(&grid);
        grid.run.rays = 100 * BATCH;
        let many = run(&grid);
        assert_eq!((one.rays, many.rays), (BATCH, BATCH));
        let ratio = one.max_standard_error() / many.max_standard_error();
        assert!((ratio - 10.0).abs() < 1e-9, "{ratio}");
        assert!(many.median_standard_error() < many.max_standard_error());
    }
}
