//! What a database will cost and how exact it will be, within a budget.
//!
//! **Time.** A ray meets about 2 H / d grains in a slab of thickness H with the
//! mean free distance d, so the time of a job by an engine that walks all the way is
//! nearly proportional to its walks times 1 + 2 H / d; by `hybrid`, which walks next
//! to the planes only, to its walks: its *size* here. Jobs of the same engine are drawn
//! with probabilities in that proportion, evenly spread over the axes; the mean of time
//! over size of those drawn, times the sum of all sizes, estimates the time of all
//! (Hansen and Hurwitz 1943): without bias whatever the true law, and with little
//! noise as it is near.
//!
//! **Budget.** A job is run with more and more of its rays, at a few of its
//! wavelengths, as long as its share of the budget lasts, and its time is
//! extrapolated ([`probe`]). What no run was possible for is taken from the sizes
//! and the typical time of a grain event. As many jobs run side by side as later, so
//! that what threads cost one another is measured with the rest.
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

/// Jobs whose sizes are summed, at most, of a large grid.
const SIZES: u64 = 4096;
/// Jobs run for each engine, at most.
const MOST: usize = 24;
/// Share of the budget for the sizes, and for one job.
const SIZING: f64 = 0.2;
const ONE: f64 = 0.1;
/// Least CPU seconds for each thread.
const PER_THREAD: f64 = 0.5;

/// A job, the engine that does it and its rays per curve.
#[derive(Debug, Clone)]
struct Case {
    job: Job,
    engine: Engine,
    rays: u64,
    size: f64,
}

/// The jobs that one engine does.
struct Stratum {
    engine: Engine,
    /// Sums of sizes and numbers of the jobs, in order.
    sums: Vec<(f64, u64)>,
    /// The largest job.
    largest: Case,
}

/// What the jobs run have taught.
#[derive(Debug)]
pub(super) struct Pilot {
    /// Jobs run for the time, and how many of them with all rays.
    pub(super) jobs: [usize; 2],
    /// The fewest and the most rays of those.
    pub(super) rays: [u64; 2],
    /// Wavelengths they were run at.
    pub(super) wavelengths: usize,
    /// Engines, and tables, without a run that ended.
    pub(super) guessed: Vec<&'static str>,
    /// CPU seconds that all this took.
    pub(super) spent: f64,
    /// The job that takes longest.
    pub(super) longest: LongestJob,
    /// CPU seconds per size, by engine.
    per_size: Vec<(Engine, f64)>,
    /// CPU seconds of all jobs of the grid without tables.
    core: f64,
    /// CPU seconds of the tables of one shape of grain, and of all shapes.
    tables: [f64; 2],
    /// Wall clock time of a thread per CPU time: more than 1 if others use the processor.
    slowdown: f64,
    /// Standard errors expected in the database, of both quantities, sorted, each with
    /// what share of the database it stands for.
    standard_errors: Vec<(f64, f64)>,
}

/// Time on one thread, s.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Time {
    /// What the processor worked.
    pub(super) core: f64,
    /// What the clock showed: more, if others use the processor too.
    pub(super) wall: f64,
}

/// Typical CPU seconds per size (docs/performance.md): of a grain event, and in
/// `hybrid` of a walk next to a plane.
fn typical(engine: Engine) -> f64 {
    match engine {
        Engine::Tabulated => 1e-8,
        Engine::Hybrid | Engine::Auto => 7e-7,
        Engine::Reference | Engine::Spectral => 9e-8,
    }
}

/// Depth, m, beyond which walks take hardly longer: light comes back or is absorbed.
const DEEP_M: f64 = 1.0;

impl Case {
    fn new(grid: &Grid, wavelengths_nm: &[f64], job: Job) -> Result<Self, PlanError> {
        let request = Request {
            wavelengths_nm,
            ..job.request(grid)
        };
        let (engine, rays) = grid.run.engine.resolve_rays(&request);
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
        let case = |job| Case::new(grid, &wavelengths_nm, job);
        let strata = strata(grid, jobs, &case, || spent() > SIZING * seconds)?;
        // no single run may exceed what is left
        let left = (seconds - spent()).max(0.0);
        let measured = budget::within(Some(left), &AtomicBool::new(false), |cancel| {
            let prober = Prober {
                grid,
                cancel,
                cache: Cache::of_cells(),
            };
            measure(&prober, jobs, &strata, &case, threads, seconds, &spent)
        })?;
        let mut pilot = Self::of(grid, &strata, measured);
        pilot.spent = spent();
        Ok(pilot)
    }

    /// From what was measured.
    fn of(grid: &Grid, strata: &[Stratum], measured: Measured) -> Self {
        let Measured {
            tables,
            probes,
            mut guessed,
        } = measured;
        let (mut core, mut per_size) = (0.0, Vec::new());
        let mut longest: Option<LongestJob> = None;
        let mut errors = Vec::new();
        for (stratum, probes) in strata.iter().zip(&probes) {
            let total = stratum.sums.last().map_or(0.0, |(sum, _)| *sum);
            let whole = |(case, probe): &(Case, Probe)| Some(probe.core? / case.size);
            // the largest was not drawn: it tells of the others if they do not
            let drawn: Vec<f64> = probes.iter().skip(1).filter_map(whole).collect();
            let ratio = match (drawn.len(), probes.first().and_then(whole)) {
                (0, Some(largest)) => largest,
                (0, None) => {
                    guessed.push(stratum.engine.name());
                    typical(stratum.engine)
                }
                (n, _) => drawn.iter().sum::<f64>() / n as f64,
            };
            per_size.push((stratum.engine, ratio));
            core += ratio * total;
            let candidates = probes.iter().map(|(case, probe)| {
                let core = probe.core.unwrap_or(ratio * case.size);
                (core, case, probe.rays)
            });
            let unrun = (ratio * stratum.largest.size, &stratum.largest, 0);
            let none = probes.is_empty().then_some(unrun);
            for (core, case, rays) in candidates.chain(none) {
                let tables = if case.engine.uses_tables() {
                    tables
                } else {
                    0.0
                };
                if longest
                    .as_ref()
                    .is_none_or(|longest| longest.core_seconds < core + tables)
                {
                    longest = Some(LongestJob {
                        parameters: case.job.to_string(),
                        engine: case.engine,
                        rays: case.rays,
                        rays_run: rays,
                        core_seconds: core + tables,
                    });
                }
            }
            for (case, probe) in probes.iter().filter(|(_, probe)| probe.core.is_some()) {
                let share = total / (case.size * probe.standard_errors.len() as f64);
                errors.extend(probe.standard_errors.iter().map(|se| (*se, share)));
            }
        }
        errors.sort_by(|a, b| a.0.total_cmp(&b.0));
        let run = || {
            probes
                .iter()
                .flatten()
                .filter(|(_, probe)| probe.core.is_some())
        };
        let rays = || run().map(|(_, probe)| probe.rays);
        let [cpu, wall] = [0, 1].map(|i| run().map(|(_, probe)| probe.spent[i]).sum::<f64>());
        let spheroids = grid.axes.values(Parameter::Sphericity).len().max(1);
        let shapes = grid.axes.values(Parameter::Facetness).len() * spheroids;
        // one may have been drawn more than once
        let count = |all: &dyn Fn(&Probe, &Case) -> bool| {
            let cells = run().filter(|(case, probe)| all(probe, case));
            let cells = cells.map(|(case, _)| case.job.cell);
            cells.collect::<BTreeSet<u64>>().len()
        };
        Self {
            jobs: [
                count(&|_, _| true),
                count(&|probe, case| probe.rays == case.rays),
            ],
            rays: [
                rays().min().unwrap_or_default(),
                rays().max().unwrap_or_default(),
            ],
            wavelengths: probe::few(&grid.wavelengths_nm).len(),
            guessed,
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

    fn timed(&self, core: f64) -> Time {
        Time {
            core,
            wall: core * self.slowdown,
        }
    }

    /// Time of all jobs.
    pub(super) fn time(&self) -> Time {
        self.timed(self.core + self.tables[1])
    }

    /// Time of the jobs listed.
    pub(super) fn time_of(
        &self,
        grid: &Grid,
        jobs: &Jobs,
        listed: &[u64],
    ) -> Result<Time, PlanError> {
        if listed.is_empty() {
            return Ok(Time::default());
        }
        // of very many, some stand for all
        let step = listed.len().div_ceil(SIZES as usize) | 1;
        let wavelengths_nm = probe::few(&grid.wavelengths_nm);
        let mut sum = 0.0;
        for number in listed.iter().step_by(step) {
            let job = grid.job(jobs, *number)?;
            if !job.exists() {
                continue;
            }
            let case = Case::new(grid, &wavelengths_nm, job)?;
            let known = self
                .per_size
                .iter()
                .find(|(engine, _)| *engine == case.engine);
            sum += case.size * known.map_or(typical(case.engine), |(_, ratio)| *ratio);
        }
        let counted = listed.len().div_ceil(step) as f64;
        Ok(self.timed(sum * listed.len() as f64 / counted + self.tables[1]))
    }

    /// Median standard error expected over curves and wavelengths.
    pub(super) fn median_standard_error(&self) -> Option<f64> {
        let half = 0.5
            * self
                .standard_errors
                .iter()
                .map(|(_, share)| share)
                .sum::<f64>();
        let mut sum = 0.0;
        let median = self.standard_errors.iter().find(|(_, share)| {
            sum += share;
            sum >= half
        });
        median.map(|(se, _)| *se)
    }

    /// The largest.
    pub(super) fn max_standard_error(&self) -> Option<f64> {
        self.standard_errors.last().map(|(se, _)| *se)
    }
}

/// The jobs of each engine, the costliest engine first. Of a large grid, and from when
/// it is `late`, those that stand for the others.
fn strata(
    grid: &Grid,
    jobs: &Jobs,
    case: &dyn Fn(Job) -> Result<Case, PlanError>,
    late: impl Fn() -> bool,
) -> Result<Vec<Stratum>, PlanError> {
    // an odd step meets all values of an axis of even length
    let step = jobs.count().div_ceil(SIZES) | 1;
    let numbers: Vec<u64> = (0..jobs.count()).step_by(step as usize).collect();
    // in an order that is spread evenly wherever it ends
    let golden = (0.618 * numbers.len() as f64) as usize;
    let stride = (golden.max(1)..).find(|stride| coprime(*stride, numbers.len()));
    let stride = stride.unwrap_or(1);
    let (mut cases, mut seen) = (Vec::new(), 0_u64);
    for i in 0..numbers.len() {
        if !cases.is_empty() && late() {
            break;
        }
        let number = numbers[(i * stride) % numbers.len()];
        let job = grid.job(jobs, number)?;
        seen += 1;
        // one without a curve that exists takes no time
        if job.exists() {
            cases.push((number, case(job)?));
        }
    }
    cases.sort_by_key(|(number, _)| *number);
    let each = jobs.count() as f64 / seen as f64;
    let mut strata: Vec<Stratum> = Vec::new();
    for (number, case) in cases {
        let size = each * case.size;
        match strata
            .iter_mut()
            .find(|stratum| stratum.engine == case.engine)
        {
            Some(stratum) => {
                let sum = stratum.sums.last().map_or(0.0, |(sum, _)| *sum);
                stratum.sums.push((sum + size, number));
                if case.size > stratum.largest.size {
                    stratum.largest = case;
                }
            }
            None => strata.push(Stratum {
                engine: case.engine,
                sums: vec![(size, number)],
                largest: case,
            }),
        }
    }
    // sizes are largest in a corner of the axes
    for number in corners(jobs) {
        let job = grid.job(jobs, number)?;
        if !job.exists() {
            continue;
        }
        let case = case(job)?;
        let same = strata
            .iter_mut()
            .find(|stratum| stratum.engine == case.engine);
        if let Some(stratum) = same.filter(|stratum| stratum.largest.size < case.size) {
            stratum.largest = case;
        }
    }
    let guess =
        |stratum: &Stratum| typical(stratum.engine) * stratum.sums.last().map_or(0.0, |s| s.0);
    strata.sort_by(|a, b| guess(b).total_cmp(&guess(a)));
    Ok(strata)
}

fn coprime(mut a: usize, mut b: usize) -> bool {
    while b > 0 {
        (a, b) = (b, a % b);
    }
    a == 1
}

/// Jobs at the first and last value of every axis that all databases have, with the first
/// values of all others and with the last.
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
            let place = optional.chain(core).fold(0, |place, (n, last)| {
                place * n + if last { n - 1 } else { 0 }
            });
            corners.insert(place);
        }
    }
    corners
}

/// The jobs of a stratum to run, the largest first and then as drawn.
fn drawn(grid: &Grid, jobs: &Jobs, stratum: &Stratum) -> Result<Vec<Job>, PlanError> {
    let sum = stratum.sums.last().map_or(0.0, |(sum, _)| *sum);
    // multiples of the golden ratio fill the unit interval evenly at any count
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let mut all = vec![stratum.largest.job.clone()];
    let others = if stratum.sums.len() > 1 {
        MOST.min(stratum.sums.len())
    } else {
        0
    };
    for i in 0..others {
        let at = (0.5 + i as f64 * golden).fract() * sum;
        let position = stratum.sums.partition_point(|(below, _)| *below <= at);
        let number = stratum.sums.get(position).map_or(0, |(_, number)| *number);
        all.push(grid.job(jobs, number)?);
    }
    Ok(all)
}

/// CPU seconds of the tables of one shape, and what was run of each stratum, the largest
/// job first.
struct Measured {
    tables: f64,
    probes: Vec<Vec<(Case, Probe)>>,
    /// What could not be run.
    guessed: Vec<&'static str>,
}

/// Runs jobs of all strata in turn until the budget is spent.
fn measure(
    prober: &Prober,
    jobs: &Jobs,
    strata: &[Stratum],
    case: &(dyn Fn(Job) -> Result<Case, PlanError> + Sync),
    threads: usize,
    seconds: f64,
    spent: &(dyn Fn() -> f64 + Sync),
) -> Result<Measured, PlanError> {
    let (mut tables, mut guessed) = (0.0, Vec::new());
    if let Some(first) = strata.iter().find(|stratum| stratum.engine.uses_tables()) {
        let (seconds, measured) = prober.tables(&first.largest)?;
        tables = seconds;
        guessed.extend((!measured).then_some("tables of grain events"));
    }
    let lists: Vec<Vec<Job>> = strata
        .iter()
        .map(|stratum| drawn(prober.grid, jobs, stratum))
        .collect::<Result<_, _>>()?;
    // in turn: the largest of each, then the first drawn of each, and so on
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
    let found = Mutex::new(Vec::new());
    let work = || -> Result<(), PlanError> {
        loop {
            let turn = next.fetch_add(1, Ordering::Relaxed);
            let Some((stratum, job)) = turns.get(turn) else {
                return Ok(());
            };
            if turn > 0 && spent() > (1.0 - 0.5 * ONE) * seconds {
                return Ok(());
            }
            let case = case((*job).clone())?;
            let probe = prober.probe(&case, ONE * seconds)?;
            let mut found = found.lock().unwrap_or_else(PoisonError::into_inner);
            found.push((turn, *stratum, case, probe));
        }
    };
    let workers = threads.clamp(1, (seconds / PER_THREAD).ceil().max(1.0) as usize);
    thread::scope(|scope| {
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        for worker in workers {
            let ended = worker.join();
            ended.unwrap_or(Err(PlanError::Panicked))?;
        }
        Ok::<_, PlanError>(())
    })?;
    let mut found = found.into_inner().unwrap_or_else(PoisonError::into_inner);
    found.sort_by_key(|(turn, ..)| *turn);
    let mut probes: Vec<Vec<(Case, Probe)>> = strata.iter().map(|_| Vec::new()).collect();
    for (_, stratum, case, probe) in found {
        probes[stratum].push((case, probe));
    }
    Ok(Measured {
        tables,
        probes,
        guessed,
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::engine::MaxError;
    use crate::grid::tests::small;

    fn case(grid: &Grid) -> impl Fn(Job) -> Result<Case, PlanError> {
        |job| Case::new(grid, &grid.wavelengths_nm, job)
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
    /// about what the sizes say: 4e9 walks of some hundred grain events.
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
        let ratio = pilot.longest.core_seconds / (typical(last.engine) * last.size);
        assert!((0.02..50.0).contains(&ratio), "{ratio}");
        assert!(pilot.time().core >= pilot.longest.core_seconds);
        assert!(pilot.max_standard_error().unwrap() < 1e-4);
    }

    /// With nothing to measure by, sizes and typical times answer.
    #[test]
    fn without_a_run_there_is_an_answer() {
        let grid = small(Engine::Spectral);
        let pilot = Pilot::run(&grid, &grid.jobs().unwrap(), 1, 1e-9).unwrap();
        assert_eq!(
            (pilot.jobs, &pilot.guessed[..]),
            ([0, 0], &["spectral"][..])
        );
        assert!(pilot.time().core > 0.0 && pilot.longest.core_seconds > 0.0);
        assert_eq!(pilot.median_standard_error(), None);
    }
}
