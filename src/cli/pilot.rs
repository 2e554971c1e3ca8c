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
use crate::engine::{BATCH, Cache, Control, Engine};
use crate::grid::{ExtraAxis, Grid, Job, Jobs};

/// Wavelengths per job with an engine that walks each of them by itself.
const WAVELENGTHS: usize = 5;
/// Jobs whose sizes are summed, at most, of a very large grid.
const SIZES: u64 = 100_000;
/// How errors are measured: on jobs evenly spread over the axes.
const ERRORS: Budget = Budget {
    rays: 64,
    least: 4,
    most: 24,
    seconds: 1.5,
};
/// How time is measured.
const TIME: Budget = Budget {
    rays: BATCH,
    least: 4,
    most: 48,
    seconds: 3.0,
};

/// How much a measurement may cost.
struct Budget {
    /// Rays per job, at most.
    rays: u64,
    /// Jobs run, however long they take.
    least: usize,
    /// Jobs run at most.
    most: usize,
    /// After this time no more than the least are started.
    seconds: f64,
}

/// What the jobs run have taught.
#[derive(Debug)]
pub(super) struct Pilot {
    /// Jobs run for the time.
    pub(super) jobs: usize,
    /// Rays of each.
    pub(super) rays: u64,
    per_size: Time,
    /// Sum of the sizes of all jobs.
    size: f64,
    /// For the tables of all shapes of grain.
    tables: Time,
    /// Standard errors expected in the database, of both quantities, sorted.
    standard_errors: Vec<f64>,
}

/// Time on one thread, s.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Time {
    /// What the processor worked.
    pub(super) core: f64,
    /// What the clock showed: more, if others use the processor too.
    pub(super) wall: f64,
}

impl Time {
    fn plus(self, other: Self) -> Self {
        Self {
            core: self.core + other.core,
            wall: self.wall + other.wall,
        }
    }

    fn times(self, factor: f64) -> Self {
        Self {
            core: self.core * factor,
            wall: self.wall * factor,
        }
    }
}

/// One job run.
struct Sample {
    /// As for all rays.
    time: Time,
    /// What the tables took, which other jobs may share.
    tables: Time,
    size: f64,
    /// As for all rays.
    standard_errors: Vec<f64>,
}

impl Pilot {
    /// Runs some jobs of `grid` on `threads` threads.
    pub(super) fn run(grid: &Grid, jobs: &Jobs, threads: usize) -> anyhow::Result<Self> {
        let _spinner = Spinner::new("timing a few jobs");
        let evenly = draw(grid, jobs, ERRORS.most, |_| 1.0)?;
        let errors = samples(grid, &evenly.jobs, &ERRORS, threads)?;
        let errors = errors.into_iter().flat_map(|sample| sample.standard_errors);
        let mut standard_errors: Vec<f64> = errors.collect();
        standard_errors.sort_by(f64::total_cmp);
        let by_size = draw(grid, jobs, TIME.most, size)?;
        let timed = samples(grid, &by_size.jobs, &TIME, threads)?;
        let mean = |of: fn(Time) -> f64| {
            let ratios = timed.iter().map(|sample| of(sample.time) / sample.size);
            ratios.sum::<f64>() / timed.len() as f64
        };
        Ok(Self {
            jobs: timed.len(),
            rays: grid.run.rays.min(TIME.rays),
            per_size: Time {
                core: mean(|time| time.core),
                wall: mean(|time| time.wall),
            },
            size: by_size.total,
            tables: {
                let mean = |of: fn(Time) -> f64| {
                    let all = timed.iter().map(|sample| of(sample.tables));
                    all.sum::<f64>() / timed.len() as f64
                };
                let spheroids = grid.axes.extra.get(&ExtraAxis::Sphericity);
                let shapes = grid.axes.facetness.len() * spheroids.map_or(1, Vec::len);
                let shapes = shapes as f64;
                let once = Time {
                    core: mean(|time| time.core),
                    wall: mean(|time| time.wall),
                };
                once.times(shapes)
            },
            standard_errors,
        })
    }

    /// Time of all jobs.
    pub(super) fn time(&self) -> Time {
        self.per_size.times(self.size).plus(self.tables)
    }

    /// Time of the jobs listed.
    pub(super) fn time_of(&self, grid: &Grid, jobs: &Jobs, listed: &[u64]) -> anyhow::Result<Time> {
        let mut sum = 0.0;
        for number in listed {
            sum += size(&grid.job(jobs, *number)?);
        }
        let tables = if listed.is_empty() {
            Time::default()
        } else {
            self.tables
        };
        Ok(self.per_size.times(sum).plus(tables))
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

/// Runs `drawn` in order until the budget is used up.
fn samples(
    grid: &Grid,
    drawn: &[Job],
    budget: &Budget,
    threads: usize,
) -> anyhow::Result<Vec<Sample>> {
    let begin = Instant::now();
    let (grid, of_each) = thinned(grid);
    let next = AtomicUsize::new(0);
    let work = || -> anyhow::Result<Vec<Sample>> {
        let mut samples = Vec::new();
        loop {
            let position = next.fetch_add(1, Ordering::Relaxed);
            let late = begin.elapsed().as_secs_f64() > budget.seconds;
            match drawn.get(position) {
                Some(job) if !late || position < budget.least => {
                    samples.push(sample(&grid, of_each, job, budget.rays)?);
                }
                _ => return Ok(samples),
            }
        }
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        let mut samples = Vec::new();
        for worker in workers {
            let ended = worker.join();
            samples.extend(ended.unwrap_or_else(|_| bail!("a pilot job failed"))?);
        }
        Ok(samples)
    })
}

/// What the time of a job is about proportional to: mean free distances across
/// the thickest slab (0 if there is nothing to run), or nothing but their number where one job has
/// all angles and does not walk through the inside.
fn size(job: &Job) -> f64 {
    if !job.exists() {
        return 0.0;
    }
    if job.angles_deg.len() > 1 {
        return 1.0;
    }
    let distance_m = job.pack.surface.mean_free_distance_m();
    let thickness_m = job.thicknesses_m.last().copied().unwrap_or_default();
    1.0 + thickness_m / distance_m
}

/// Jobs in the order to run them.
struct Drawn {
    jobs: Vec<Job>,
    /// Sum of the weights of all jobs of the grid.
    total: f64,
}

/// Draws at most `most` jobs with probabilities proportional to `weight`.
fn draw(grid: &Grid, jobs: &Jobs, most: usize, weight: fn(&Job) -> f64) -> anyhow::Result<Drawn> {
    // An odd step meets all values of an axis of even length.
    let step = jobs.count().div_ceil(SIZES) | 1;
    let mut sums = Vec::new();
    let mut sum = 0.0;
    for number in (0..jobs.count()).step_by(step as usize) {
        let job = grid.job(jobs, number)?;
        // what is not run is not drawn
        sum += if job.exists() { weight(&job) } else { 0.0 };
        sums.push((sum, number));
    }
    // Multiples of the golden ratio fill the unit interval evenly at any count.
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let drawn = (0..most.min(sums.len())).map(|i| {
        let at = (0.5 + i as f64 * golden).fract() * sum;
        let position = sums.partition_point(|(below, _)| *below <= at);
        let number = sums.get(position).map_or(0, |(_, number)| *number);
        grid.job(jobs, number)
    });
    Ok(Drawn {
        jobs: drawn.collect::<Result<_, _>>()?,
        total: sum * jobs.count() as f64 / sums.len() as f64,
    })
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

/// Runs one job with at most `rays` rays. One wavelength of the thinned `grid`
/// stands for `of_each`.
fn sample(grid: &Grid, of_each: f64, job: &Job, rays: u64) -> anyhow::Result<Sample> {
    let mut request = job.request(grid);
    let wanted = request.rays;
    request.rays = wanted.min(rays);
    let more = wanted as f64 / request.rays as f64;
    let control = Control {
        parallel: false,
        cancel: &AtomicBool::new(false),
        rays_done: &AtomicU64::new(0),
        cache: &Cache::default(),
    };
    let engine = grid.run.engine;
    let timed = || -> anyhow::Result<_> {
        let (begin, worked) = (Instant::now(), processor_seconds());
        let spectra = engine.run(&request, &control)?;
        let wall = begin.elapsed().as_secs_f64();
        let core = worked.and_then(|before| Some(processor_seconds()? - before));
        let core = core.unwrap_or(wall);
        Ok((spectra, Time { core, wall }))
    };
    let (mut spectra, mut time) = timed()?;
    let mut tables = Time::default();
    if engine.uses_tables() {
        let first = time;
        (spectra, time) = timed()?;
        tables = Time {
            core: (first.core - time.core).max(0.0),
            wall: (first.wall - time.wall).max(0.0),
        };
    }
    Ok(Sample {
        time: time.times(more * of_each),
        tables,
        size: size(job),
        standard_errors: spectra
            .iter()
            .flat_map(|spectrum| spectrum.transmittance.iter().chain(&spectrum.reflectance))
            .map(|measured| measured.se / more.sqrt())
            .collect(),
    })
}

/// What the processor has worked for this thread, where the system tells (Linux).
fn processor_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = text.split_whitespace().next()?.parse().ok()?;
    Some(nanoseconds * 1e-9)
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
        let Drawn { jobs: drawn, total } = draw(&grid, &jobs, 8, size).unwrap();
        let sizes: Vec<f64> = (0..jobs.count())
            .map(|n| size(&grid.job(&jobs, n).unwrap()))
            .collect();
        assert_eq!(drawn.len(), 8);
        assert!((total / sizes.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        // Grains of 50-150 um are smaller than those of 150-250 um, so there
        // are more of them in the way: drawn 5 or 6 times of 8, not 4.
        let fine = |job: &&Job| job.pack.longest_grain_m() < 200e-6;
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
        grid.axes.thickness_cm = vec![1.0];
        let run = |grid: &Grid| Pilot::run(grid, &grid.jobs().unwrap(), 1).unwrap();
        grid.run.rays = 64;
        let one = run(&grid);
        grid.run.rays = 6400;
        let many = run(&grid);
        assert_eq!((one.rays, many.rays), (64, BATCH));
        let ratio = one.max_standard_error() / many.max_standard_error();
        assert!((ratio - 10.0).abs() < 1e-9, "{ratio}");
        assert!(many.median_standard_error() < many.max_standard_error());
    }
}
