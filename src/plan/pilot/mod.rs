//! Pilot jobs: estimates the time and the standard errors of a build within a CPU budget.
//!
//! **Time.** A ray meets about 2 H / d grains in a slab of thickness H with the mean free
//! distance d. The *size* of a job is a number that is nearly proportional to its time: its
//! number of walks times 1 + 2 H / d for engines that trace walks through the whole slab, and
//! its number of walks for `hybrid`, which traces walks next to the boundaries only. Jobs of
//! the same engine are drawn with probabilities proportional to their sizes, evenly spread
//! over the axes. The mean of time / size over the drawn jobs, times the sum of all sizes,
//! estimates the total time (Hansen and Hurwitz 1943). The estimate is unbiased whatever the
//! true relation, and its noise is small because time and size are nearly proportional.
//!
//! **Budget.** A job is run repeatedly with increasing numbers of rays, at a few of its
//! wavelengths, until its share of the budget is spent; its time is then extrapolated
//! ([`probe`]). If no run was possible, the time is estimated from the size and the typical_seconds
//! time of a grain event. As many pilot jobs run in parallel as jobs of the build, so that
//! the mutual slowdown of threads is part of the measurement.
mod probe;

use std::collections::BTreeSet;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

use cpu_time::ProcessTime;

use super::{LongestJob, PlanError};
use crate::budget;
use crate::engine::{Cache, Engine, Request};
use crate::grid::{Grid, Job, Jobs};
use crate::parameter::Parameter;
use probe::{Probe, Prober};

/// Largest number of jobs whose sizes are summed; larger grids are sampled.
const MAX_SIZED_JOBS: u64 = 4096;
/// Largest number of jobs drawn for each engine.
const MAX_DRAWN_JOBS: usize = 24;
/// Share of the budget for determining sizes.
const SIZING_SHARE: f64 = 0.2;
/// Share of the budget for one job.
const JOB_SHARE: f64 = 0.1;
/// Smallest CPU time for each thread, s.
const THREAD_SECONDS: f64 = 0.5;

/// A job, the engine that runs it, its number of rays per curve and its size.
#[derive(Debug, Clone)]
struct SizedJob {
    job: Job,
    engine: Engine,
    rays: u64,
    size: f64,
}

/// The jobs that one engine runs.
struct Stratum {
    engine: Engine,
    /// Cumulative sum of sizes and number of each job, in the order of job numbers.
    sums: Vec<(f64, u64)>,
    /// The largest job.
    largest: SizedJob,
}

/// Results of the pilot jobs.
#[derive(Debug)]
pub(super) struct Pilot {
    /// Number of jobs run, and number of jobs run with all their rays.
    pub(super) jobs: [usize; 2],
    /// Smallest and largest number of rays of the jobs run.
    pub(super) rays: [u64; 2],
    /// Number of wavelengths of a pilot job.
    pub(super) wavelengths: usize,
    /// Engines and tables without a run that ended.
    pub(super) not_measured: Vec<&'static str>,
    /// CPU time of the pilot jobs and of the sizing, s.
    pub(super) spent: f64,
    /// The job that takes longest.
    pub(super) longest: LongestJob,
    /// CPU time per size for each engine, s.
    per_size: Vec<(Engine, f64)>,
    /// CPU time of all jobs of the grid without tables, s.
    core: f64,
    /// CPU time of the tables of one grain shape, and of all grain shapes, s.
    tables: [f64; 2],
    /// Wall clock time of a thread per CPU time, at least 1: above 1 if other processes use
    /// the processor.
    slowdown: f64,
    /// Standard errors expected in the database, of both quantities, in ascending order, each
    /// with its statistical weight.
    standard_errors: Vec<(f64, f64)>,
}

/// Time on one thread, s.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Time {
    /// CPU time.
    pub(super) core: f64,
    /// Wall clock time: longer than the CPU time if other processes use the processor.
    pub(super) wall: f64,
}

/// Typical CPU time per size, s (docs/performance.md): of a grain event or, in `hybrid`, of
/// a walk next to a boundary.
fn typical_seconds(engine: Engine) -> f64 {
    match engine {
        Engine::Tabulated => 1e-8,
        Engine::Hybrid | Engine::Auto => 7e-7,
        Engine::Reference | Engine::Spectral => 9e-8,
    }
}

/// Thickness, m, above which walks hardly take longer: light is reflected or absorbed before.
const DEEP_M: f64 = 1.0;

impl SizedJob {
    fn new(grid: &Grid, wavelengths_nm: &[f64], job: Job) -> Result<Self, PlanError> {
        let request = Request {
            wavelengths_nm,
            ..job.request(grid)
        };
        let (engine, rays) = grid.run.engine.resolve_rays(&request);
        engine.check(&request)?;
        let walks = engine.walks(&Request {
            rays,
            ..request.clone()
        })? as f64;
        let distances = match engine {
            Engine::Hybrid => 0.0,
            _ => {
                let distance_m = job.snowpack.surface.mean_free_distance_m();
                let thickness_m = job.thicknesses_m.last().copied().unwrap_or_default();
                2.0 * thickness_m.min(DEEP_M) / distance_m
            }
        };
        Ok(Self {
            size: walks * (1.0 + distances),
            job,
            engine,
            rays,
        })
    }
}

impl Pilot {
    /// Runs some jobs of `grid` on `threads` threads for about `seconds` of CPU time.
    pub(super) fn run(
        grid: &Grid,
        jobs: &Jobs,
        threads: usize,
        seconds: f64,
    ) -> Result<Self, PlanError> {
        let begin = ProcessTime::now();
        let spent = || begin.elapsed().as_secs_f64();
        let wavelengths_nm = probe::few(&grid.wavelengths_nm);
        let sized = |job| SizedJob::new(grid, &wavelengths_nm, job);
        let strata = strata(grid, jobs, &sized, || spent() > SIZING_SHARE * seconds)?;
        // no single run may exceed the remaining budget
        let remaining = (seconds - spent()).max(0.0);
        let measurements =
            budget::with_cpu_limit(Some(remaining), &AtomicBool::new(false), |cancel| {
                let prober = Prober {
                    grid,
                    cancel,
                    cache: Cache::tables_only(),
                };
                measure(&prober, jobs, &strata, &sized, threads, seconds, &spent)
            })?;
        let mut pilot = Self::of(grid, &strata, measurements);
        pilot.spent = spent();
        Ok(pilot)
    }

    /// Evaluates the measurements.
    fn of(grid: &Grid, strata: &[Stratum], measurements: Measurements) -> Self {
        let Measurements {
            tables,
            probes,
            mut not_measured,
        } = measurements;
        let (mut core, mut per_size) = (0.0, Vec::new());
        let mut longest: Option<LongestJob> = None;
        let mut errors = Vec::new();
        for (stratum, probes) in strata.iter().zip(&probes) {
            let total = stratum.sums.last().map_or(0.0, |(sum, _)| *sum);
            let seconds_per_size =
                |(sized, probe): &(SizedJob, Probe)| Some(probe.core? / sized.size);
            // the first job is the largest, which was not drawn: it counts only if no drawn
            // job ended
            let drawn: Vec<f64> = probes.iter().skip(1).filter_map(seconds_per_size).collect();
            let ratio = match (drawn.len(), probes.first().and_then(seconds_per_size)) {
                (0, Some(largest)) => largest,
                (0, None) => {
                    not_measured.push(stratum.engine.name());
                    typical_seconds(stratum.engine)
                }
                (n, _) => drawn.iter().sum::<f64>() / n as f64,
            };
            per_size.push((stratum.engine, ratio));
            core += ratio * total;
            let candidates = probes.iter().map(|(sized, probe)| {
                let core = probe.core.unwrap_or(ratio * sized.size);
                (core, sized, probe.rays)
            });
            let unmeasured = (ratio * stratum.largest.size, &stratum.largest, 0);
            let unmeasured = probes.is_empty().then_some(unmeasured);
            for (core, sized, rays) in candidates.chain(unmeasured) {
                let tables = if sized.engine.uses_tables() {
                    tables
                } else {
                    0.0
                };
                if longest
                    .as_ref()
                    .is_none_or(|longest| longest.core_seconds < core + tables)
                {
                    longest = Some(LongestJob {
                        parameters: sized.job.to_string(),
                        engine: sized.engine,
                        rays: sized.rays,
                        rays_run: rays,
                        core_seconds: core + tables,
                    });
                }
            }
            for (sized, probe) in probes.iter().filter(|(_, probe)| probe.core.is_some()) {
                let weight = total / (sized.size * probe.standard_errors.len() as f64);
                errors.extend(probe.standard_errors.iter().map(|se| (*se, weight)));
            }
        }
        errors.sort_by(|a, b| a.0.total_cmp(&b.0));
        let ended = || {
            probes
                .iter()
                .flatten()
                .filter(|(_, probe)| probe.core.is_some())
        };
        let rays = || ended().map(|(_, probe)| probe.rays);
        let [cpu, wall] = [0, 1].map(|i| ended().map(|(_, probe)| probe.spent[i]).sum::<f64>());
        let spheroids = grid.axes.values(Parameter::Sphericity).len().max(1);
        let shapes = grid.axes.values(Parameter::Facetness).len() * spheroids;
        // a job may have been drawn several times, but counts once
        let count = |condition: &dyn Fn(&Probe, &SizedJob) -> bool| {
            let counted = ended().filter(|(sized, probe)| condition(probe, sized));
            let cells = counted.map(|(sized, _)| sized.job.cell);
            cells.collect::<BTreeSet<u64>>().len()
        };
        Self {
            jobs: [
                count(&|_, _| true),
                count(&|probe, sized| probe.rays == sized.rays),
            ],
            rays: [
                rays().min().unwrap_or_default(),
                rays().max().unwrap_or_default(),
            ],
            wavelengths: probe::few(&grid.wavelengths_nm).len(),
            not_measured,
            spent: 0.0,
            longest: longest.unwrap_or(LongestJob {
                parameters: String::new(),
                engine: grid.run.engine,
                rays: 0,
                rays_run: 0,
                core_seconds: 0.0,
            }),
            per_size,
            core,
            tables: [tables, tables * shapes as f64],
            slowdown: if cpu > 0.0 {
                (wall / cpu).max(1.0)
            } else {
                1.0
            },
            standard_errors: errors,
        }
    }

    /// The time for `core` seconds of CPU time.
    fn with_slowdown(&self, core: f64) -> Time {
        Time {
            core,
            wall: core * self.slowdown,
        }
    }

    /// Time of all jobs.
    pub(super) fn time(&self) -> Time {
        self.with_slowdown(self.core + self.tables[1])
    }

    /// Time of the jobs with these `numbers`.
    pub(super) fn time_of(
        &self,
        grid: &Grid,
        jobs: &Jobs,
        numbers: &[u64],
    ) -> Result<Time, PlanError> {
        if numbers.is_empty() {
            return Ok(Time::default());
        }
        // long lists are sampled
        let step = numbers.len().div_ceil(MAX_SIZED_JOBS as usize) | 1;
        let wavelengths_nm = probe::few(&grid.wavelengths_nm);
        let mut sum = 0.0;
        for number in numbers.iter().step_by(step) {
            let job = grid.job(jobs, *number)?;
            if !job.exists() {
                continue;
            }
            let sized = SizedJob::new(grid, &wavelengths_nm, job)?;
            let measured = self
                .per_size
                .iter()
                .find(|(engine, _)| *engine == sized.engine);
            let ratio = measured.map_or(typical_seconds(sized.engine), |(_, ratio)| *ratio);
            sum += sized.size * ratio;
        }
        let sampled = numbers.len().div_ceil(step) as f64;
        Ok(self.with_slowdown(sum * numbers.len() as f64 / sampled + self.tables[1]))
    }

    /// Median standard error expected over curves and wavelengths; `None` if no run ended.
    pub(super) fn median_standard_error(&self) -> Option<f64> {
        let half = 0.5
            * self
                .standard_errors
                .iter()
                .map(|(_, weight)| weight)
                .sum::<f64>();
        let mut sum = 0.0;
        let median = self.standard_errors.iter().find(|(_, weight)| {
            sum += weight;
            sum >= half
        });
        median.map(|(se, _)| *se)
    }

    /// Largest standard error expected over curves and wavelengths; `None` if no run ended.
    pub(super) fn max_standard_error(&self) -> Option<f64> {
        self.standard_errors.last().map(|(se, _)| *se)
    }
}

/// The jobs of each engine, the costliest engine first. A large grid is sampled; sampling
/// stops once `is_late` returns true.
fn strata(
    grid: &Grid,
    jobs: &Jobs,
    sized: &dyn Fn(Job) -> Result<SizedJob, PlanError>,
    is_late: impl Fn() -> bool,
) -> Result<Vec<Stratum>, PlanError> {
    // an odd step visits all values of an axis of even length
    let step = jobs.count().div_ceil(MAX_SIZED_JOBS) | 1;
    let numbers: Vec<u64> = (0..jobs.count()).step_by(step as usize).collect();
    // an order in which any first part is spread evenly over the grid
    let golden = (0.618 * numbers.len() as f64) as usize;
    let stride = (golden.max(1)..).find(|stride| coprime(*stride, numbers.len()));
    let stride = stride.unwrap_or(1);
    let (mut sized_jobs, mut seen) = (Vec::new(), 0_u64);
    for i in 0..numbers.len() {
        if !sized_jobs.is_empty() && is_late() {
            break;
        }
        let number = numbers[(i * stride) % numbers.len()];
        let job = grid.job(jobs, number)?;
        seen += 1;
        // a job without existing curves takes no time
        if job.exists() {
            sized_jobs.push((number, sized(job)?));
        }
    }
    sized_jobs.sort_by_key(|(number, _)| *number);
    let jobs_per_sample = jobs.count() as f64 / seen as f64;
    let mut strata: Vec<Stratum> = Vec::new();
    for (number, sized_job) in sized_jobs {
        let size = jobs_per_sample * sized_job.size;
        match strata
            .iter_mut()
            .find(|stratum| stratum.engine == sized_job.engine)
        {
            Some(stratum) => {
                let sum = stratum.sums.last().map_or(0.0, |(sum, _)| *sum);
                stratum.sums.push((sum + size, number));
                if sized_job.size > stratum.largest.size {
                    stratum.largest = sized_job;
                }
            }
            None => strata.push(Stratum {
                engine: sized_job.engine,
                sums: vec![(size, number)],
                largest: sized_job,
            }),
        }
    }
    // the largest size is at a corner of the grid
    for number in corners(jobs) {
        let job = grid.job(jobs, number)?;
        if !job.exists() {
            continue;
        }
        let sized_job = sized(job)?;
        let stratum = strata
            .iter_mut()
            .find(|stratum| stratum.engine == sized_job.engine);
        if let Some(stratum) = stratum.filter(|stratum| stratum.largest.size < sized_job.size) {
            stratum.largest = sized_job;
        }
    }
    let typical_total = |stratum: &Stratum| {
        typical_seconds(stratum.engine) * stratum.sums.last().map_or(0.0, |s| s.0)
    };
    strata.sort_by(|a, b| typical_total(b).total_cmp(&typical_total(a)));
    Ok(strata)
}

fn coprime(mut a: usize, mut b: usize) -> bool {
    while b > 0 {
        (a, b) = (b, a % b);
    }
    a == 1
}

/// Numbers of the jobs at the corners of the grid: all combinations of the first and last
/// value of the axes that every database has, once with the first values of all optional
/// axes and once with their last values.
fn corners(jobs: &Jobs) -> BTreeSet<u64> {
    let (optional, core) = jobs
        .blocks()
        .split_at(jobs.blocks().len() - Parameter::CORE.len());
    let mut corners = BTreeSet::new();
    for last in [false, true] {
        for corner in 0..1_u32 << core.len() {
            let optional = optional.iter().map(|n| (n, last));
            let core = core
                .iter()
                .enumerate()
                .map(|(axis, n)| (n, corner >> axis & 1 == 1));
            let number = optional.chain(core).fold(0, |number, (n, last)| {
                number * n + if last { n - 1 } else { 0 }
            });
            corners.insert(number);
        }
    }
    corners
}

/// The jobs of a stratum to run: the largest one, followed by the drawn ones.
fn drawn(grid: &Grid, jobs: &Jobs, stratum: &Stratum) -> Result<Vec<Job>, PlanError> {
    let sum = stratum.sums.last().map_or(0.0, |(sum, _)| *sum);
    // any number of multiples of the golden ratio, modulo 1, fills [0, 1) evenly
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let mut drawn = vec![stratum.largest.job.clone()];
    let draws = if stratum.sums.len() > 1 {
        MAX_DRAWN_JOBS.min(stratum.sums.len())
    } else {
        0
    };
    for i in 0..draws {
        let target = (0.5 + i as f64 * golden).fract() * sum;
        let position = stratum.sums.partition_point(|(below, _)| *below <= target);
        let number = stratum.sums.get(position).map_or(0, |(_, number)| *number);
        drawn.push(grid.job(jobs, number)?);
    }
    Ok(drawn)
}

/// Measurements of the pilot jobs.
struct Measurements {
    /// CPU time of the tables of one grain shape, s.
    tables: f64,
    /// Jobs run in each stratum and their results, the largest job first.
    probes: Vec<Vec<(SizedJob, Probe)>>,
    /// Tables that could not be measured.
    not_measured: Vec<&'static str>,
}

/// Runs jobs of all strata in turn until the budget is spent.
fn measure(
    prober: &Prober,
    jobs: &Jobs,
    strata: &[Stratum],
    sized: &(dyn Fn(Job) -> Result<SizedJob, PlanError> + Sync),
    threads: usize,
    seconds: f64,
    spent: &(dyn Fn() -> f64 + Sync),
) -> Result<Measurements, PlanError> {
    let (mut tables, mut not_measured) = (0.0, Vec::new());
    if let Some(first) = strata.iter().find(|stratum| stratum.engine.uses_tables()) {
        let (seconds, measured) = prober.tables(&first.largest)?;
        tables = seconds;
        not_measured.extend((!measured).then_some("tables of grain events"));
    }
    let lists: Vec<Vec<Job>> = strata
        .iter()
        .map(|stratum| drawn(prober.grid, jobs, stratum))
        .collect::<Result<_, _>>()?;
    // strata take turns: the largest job of each, then the first drawn job of each, and so on
    let longest = lists.iter().map(Vec::len).max().unwrap_or_default();
    let turns: Vec<(usize, &Job)> = (0..longest)
        .flat_map(|i| {
            lists
                .iter()
                .enumerate()
                .filter_map(move |(s, list)| Some((s, list.get(i)?)))
        })
        .collect();
    let next = AtomicUsize::new(0);
    let results = Mutex::new(Vec::new());
    let work = || -> Result<(), PlanError> {
        loop {
            let turn = next.fetch_add(1, Ordering::Relaxed);
            let Some((stratum, job)) = turns.get(turn) else {
                return Ok(());
            };
            if turn > 0 && spent() > (1.0 - 0.5 * JOB_SHARE) * seconds {
                return Ok(());
            }
            let sized_job = sized((*job).clone())?;
            let probe = prober.probe(&sized_job, JOB_SHARE * seconds)?;
            let mut results = results.lock().unwrap_or_else(PoisonError::into_inner);
            results.push((turn, *stratum, sized_job, probe));
        }
    };
    let workers = threads.clamp(1, (seconds / THREAD_SECONDS).ceil().max(1.0) as usize);
    thread::scope(|scope| {
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        for worker in workers {
            let ended = worker.join();
            ended.unwrap_or(Err(PlanError::Panicked))?;
        }
        Ok::<_, PlanError>(())
    })?;
    let mut results = results.into_inner().unwrap_or_else(PoisonError::into_inner);
    results.sort_by_key(|(turn, ..)| *turn);
    let mut probes: Vec<Vec<(SizedJob, Probe)>> = strata.iter().map(|_| Vec::new()).collect();
    for (_, stratum, sized_job, probe) in results {
        probes[stratum].push((sized_job, probe));
    }
    Ok(Measurements {
        tables,
        probes,
        not_measured,
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::engine::MaxError;
    use crate::grid::tests::small;

    fn case(grid: &Grid) -> impl Fn(Job) -> Result<SizedJob, PlanError> {
        |job| SizedJob::new(grid, &grid.wavelengths_nm, job)
    }

    #[test]
    fn draws_follow_the_sizes() {
        let grid = small(Engine::Spectral);
        let jobs = grid.jobs().unwrap();
        let strata = strata(&grid, &jobs, &case(&grid), || false).unwrap();
        let [stratum] = &strata[..] else {
            panic!("{} strata", strata.len());
        };
        let sizes: Vec<f64> = (0..jobs.count())
            .map(|n| case(&grid)(grid.job(&jobs, n).unwrap()).unwrap().size)
            .collect();
        let total = stratum.sums.last().unwrap().0;
        assert!((total / sizes.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let largest = sizes.iter().copied().fold(0.0, f64::max);
        assert_eq!(stratum.largest.size, largest);
        let drawn = drawn(&grid, &jobs, stratum).unwrap();
        assert_eq!(drawn.len(), 1 + 8);
        // Grains of 50-150 um are smaller than those of 150-250 um, so there
        // are more of them in the way: drawn 5 or 6 times of 8, not 4.
        let fine = |job: &&Job| job.snowpack.longest_grain_m() < 200e-6;
        let share = drawn[1..].iter().filter(fine).count() as f64 / 8.0;
        let expected = (sizes[0] + sizes[4]) / (sizes[0] + sizes[2] + sizes[4] + sizes[6]);
        assert!(
            expected > 0.6 && (share - expected).abs() < 0.1,
            "{share} {expected}"
        );
    }

    /// However much one job takes, there is an answer in about the budget, and it is
    /// about what the sizes say: 4e9 walks of some hundred grain events. Its runs are so short
    /// that on a busy machine they took 75 times as long as is typical.
    #[test]
    fn a_job_longer_than_the_budget_is_extrapolated() {
        let mut grid = small(Engine::Auto);
        grid.run.max_error = MaxError {
            delta_e: 0.05,
            rmse: 1e-5,
        };
        grid.run.rays = 1 << 40;
        let jobs = grid.jobs().unwrap();
        let pilot = Pilot::run(&grid, &jobs, 2, 0.4).unwrap();
        // half as much again for what a run takes to notice
        assert!(pilot.spent < 0.6, "{}", pilot.spent);
        assert_eq!(pilot.longest.engine, Engine::Spectral);
        let (asked, run) = (pilot.longest.rays, pilot.longest.rays_run);
        assert!(asked > 1_000_000_000 && run < 4096, "{asked} {run}");
        let last = case(&grid)(grid.job(&jobs, jobs.count() - 1).unwrap()).unwrap();
        let ratio = pilot.longest.core_seconds / (typical_seconds(last.engine) * last.size);
        assert!((0.02..500.0).contains(&ratio), "{ratio}");
        assert!(pilot.time().core >= pilot.longest.core_seconds);
        assert!(pilot.max_standard_error().unwrap() < 1e-4);
    }

    /// With nothing to measure by, sizes and typical_seconds times answer.
    #[test]
    fn without_a_run_there_is_an_answer() {
        let grid = small(Engine::Spectral);
        let pilot = Pilot::run(&grid, &grid.jobs().unwrap(), 1, 1e-9).unwrap();
        assert_eq!(
            (pilot.jobs, &pilot.not_measured[..]),
            ([0, 0], &["spectral"][..])
        );
        assert!(pilot.time().core > 0.0 && pilot.longest.core_seconds > 0.0);
        assert_eq!(pilot.median_standard_error(), None);
    }
}
