//! Estimates the time of one job by running it with as many of its rays as a budget allows.
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::time::Instant;

use cpu_time::ThreadTime;

use super::{PlanError, SizedJob};
use crate::engine::{BATCH, Cache, Control, Engine, EngineError, Request, Resolution};
use crate::grid::Grid;

/// Number of rays of the first run, and factor from each run to the next.
const RAY_STEPS: [u64; 2] = [16, 4];
/// As [`RAY_STEPS`], for `hybrid`: it walks only a fraction of a fraction of these rays per
/// stream, eight at a time, and most of its time does not depend on the rays.
const HYBRID_RAY_STEPS: [u64; 2] = [256, 16];
/// Largest number of grain events averaged for a table of a pilot job; the time to make a
/// table is nearly proportional to it.
const GRAINS: u32 = 1 << 18;
/// Typical CPU time to make a table, s (docs/performance.md).
const TABLE_SECONDS: f64 = 0.3;
/// Number of wavelengths of a run.
const WAVELENGTHS: usize = 5;

/// One run of a job.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PilotRun {
    /// Number of rays of each curve.
    pub(super) rays: f64,
    /// CPU time, s.
    pub(super) core: f64,
}

/// Result of a run: standard errors; CPU and wall clock time, s.
type RunResult = (Vec<f64>, [f64; 2]);

/// Results of the runs of one job.
#[derive(Debug, Clone, Default)]
pub(super) struct Probe {
    /// CPU time of the whole job without its tables, s; `None` if no run ended.
    pub(super) core: Option<f64>,
    /// Number of rays of the longest run.
    pub(super) rays: u64,
    /// CPU and wall clock time of all runs, s.
    pub(super) spent: [f64; 2],
    /// Standard errors, extrapolated to all rays of the job.
    pub(super) standard_errors: Vec<f64>,
}

/// The extent of a whole job, relative to its runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extent {
    /// Number of rays of the whole job.
    pub(super) rays: f64,
    /// Walks per ray of the whole job divided by those of a run.
    pub(super) nodes: f64,
    /// Number of wavelengths of the whole job divided by that of a run.
    pub(super) wavelengths: f64,
}

/// Runs and times jobs of a grid.
pub(super) struct Prober<'a> {
    pub(super) grid: &'a Grid,
    pub(super) cancel: &'a AtomicBool,
    pub(super) cache: Cache,
}

/// At most `count` of the `values`, evenly spread.
fn thinned(values: &[f64], count: usize) -> Vec<f64> {
    if values.len() <= count {
        return values.to_vec();
    }
    let middle = |i: usize| (2 * i + 1) * values.len() / (2 * count);
    (0..count)
        .filter_map(|i| values.get(middle(i)).copied())
        .collect()
}

/// The wavelengths of a run, from those of the grid.
pub(super) fn few(wavelengths_nm: &[f64]) -> Vec<f64> {
    thinned(wavelengths_nm, WAVELENGTHS)
}

/// Extrapolates the CPU time of a whole job, s, from its `runs`, which have increasing
/// numbers of rays.
///
/// The slope between the last two runs is the time of an additional ray. Both runs include
/// the fixed costs, and the few long walks at their end that leave lanes idle. If the job is
/// run in `batches`, each of which has these costs, the time of one batch is extrapolated
/// and multiplied by the number of batches.
pub(super) fn extrapolate(runs: &[PilotRun], extent: &Extent, batches: bool) -> Option<f64> {
    let last = runs.last()?;
    let slope = match runs {
        [.., previous, _] => (last.core - previous.core) / (last.rays - previous.rays),
        _ => last.core / last.rays,
    };
    // if the runs are too short for the slope to be measured, the mean is used
    let slope = if slope > 0.0 {
        slope
    } else {
        last.core / last.rays
    };
    if batches {
        let batch = extent.rays.min(BATCH as f64).max(last.rays);
        let core = last.core + slope * (batch - last.rays);
        return Some(core * extent.rays / batch * extent.nodes);
    }
    let fixed = (last.core - slope * last.rays).max(0.0);
    Some(fixed * extent.wavelengths + slope * extent.rays * extent.nodes)
}

impl Prober<'_> {
    /// Runs `sized_job` with increasing numbers of rays, for about `seconds` of CPU time or
    /// until it is cancelled.
    pub(super) fn probe(&self, sized_job: &SizedJob, seconds: f64) -> Result<Probe, PlanError> {
        let wavelengths_nm = few(&self.grid.wavelengths_nm);
        let whole_request = sized_job.job.request(self.grid);
        let request = |rays: u64| Request {
            wavelengths_nm: &wavelengths_nm,
            rays,
            resolution: resolution(&whole_request),
            ..whole_request.clone()
        };
        let walks = |wavelengths_nm: &[f64]| {
            sized_job.engine.walks(&Request {
                wavelengths_nm,
                ..request(sized_job.rays)
            })
        };
        let ratio = |whole: f64, run: f64| whole / run.max(1.0);
        let extent = Extent {
            rays: sized_job.rays as f64,
            nodes: ratio(
                walks(&self.grid.wavelengths_nm)? as f64,
                walks(&wavelengths_nm)? as f64,
            ),
            wavelengths: ratio(
                self.grid.wavelengths_nm.len() as f64,
                wavelengths_nm.len() as f64,
            ),
        };
        let mut probe = Probe::default();
        let mut runs = Vec::new();
        let max_rays = match sized_job.engine {
            Engine::Hybrid => sized_job.rays,
            _ => sized_job.rays.min(BATCH),
        };
        if sized_job.engine.uses_tables() {
            // a single walk puts the tables into the cache
            let walk = Request {
                thicknesses_m: &whole_request.thicknesses_m[..1],
                illuminations: &whole_request.illuminations[..1],
                ..request(1)
            };
            match self.run(Engine::Tabulated, &walk)? {
                None => return Ok(probe),
                Some((_, spent)) => probe.add(spent),
            }
        }
        let [first, factor] = match sized_job.engine {
            Engine::Hybrid => HYBRID_RAY_STEPS,
            _ => RAY_STEPS,
        };
        let mut rays = first.min(max_rays);
        while let Some((errors, spent)) = self.run(sized_job.engine, &request(rays))? {
            probe.add(spent);
            runs.push(PilotRun {
                rays: rays as f64,
                core: spent[0],
            });
            probe.rays = rays;
            let noise = (rays as f64 / sized_job.rays as f64).sqrt();
            probe.standard_errors = errors.into_iter().map(|se| se * noise).collect();
            let next = rays.saturating_mul(factor).min(max_rays);
            let expected = match (&runs[..], sized_job.engine) {
                // most of the time of `hybrid` does not depend on the rays
                ([only], Engine::Hybrid) => 1.5 * only.core,
                ([only], _) => only.core * next as f64 / only.rays,
                _ => {
                    let next_extent = Extent {
                        rays: next as f64,
                        nodes: 1.0,
                        wavelengths: 1.0,
                    };
                    extrapolate(&runs, &next_extent, false).unwrap_or_default()
                }
            };
            if rays == max_rays || probe.spent[0] + expected > seconds {
                break;
            }
            rays = next;
        }
        probe.core = extrapolate(&runs, &extent, sized_job.engine != Engine::Hybrid);
        Ok(probe)
    }

    /// CPU time to make the tables of the grains of `sized_job` at all index nodes, s, and
    /// whether it was measured or is a typical time.
    pub(super) fn tables(&self, sized_job: &SizedJob) -> Result<(f64, bool), PlanError> {
        let whole_request = sized_job.job.request(self.grid);
        let nodes = |wavelengths_nm: &[f64]| {
            Engine::Tabulated.walks(&Request {
                wavelengths_nm,
                rays: 1,
                ..whole_request.clone()
            })
        };
        // a single wavelength has a single index node
        let wavelength_nm = thinned(&self.grid.wavelengths_nm, 1);
        let request = Request {
            wavelengths_nm: &wavelength_nm,
            thicknesses_m: &whole_request.thicknesses_m[..1],
            illuminations: &whole_request.illuminations[..1],
            rays: 1,
            resolution: resolution(&whole_request),
            ..whole_request.clone()
        };
        let nodes = nodes(&self.grid.wavelengths_nm)? as f64 / nodes(&wavelength_nm)?.max(1) as f64;
        // the second run finds the tables in the cache
        let mut times = Vec::new();
        for _ in 0..2 {
            let Some((_, [core, _])) = self.run(Engine::Tabulated, &request)? else {
                let grain_types: usize = whole_request
                    .snowpack
                    .snows()
                    .map(|snow| snow.grains.len())
                    .sum();
                let media = if whole_request.snowpack.is_wet() {
                    2.0
                } else {
                    1.0
                };
                return Ok((TABLE_SECONDS * grain_types as f64 * media * nodes, false));
            };
            times.push(core);
        }
        let seconds = (times[0] - times[1]).max(0.0);
        let grains =
            f64::from(whole_request.resolution.grains) / f64::from(request.resolution.grains);
        Ok((seconds * grains * nodes, true))
    }

    /// Runs and times a request; `None` if it was cancelled.
    fn run(&self, engine: Engine, request: &Request) -> Result<Option<RunResult>, PlanError> {
        let control = Control {
            parallel: false,
            cancel: self.cancel,
            rays_done: &AtomicU64::new(0),
            cache: &self.cache,
        };
        let (wall, cpu) = (Instant::now(), ThreadTime::now());
        // unchecked, because the check would refuse so few rays
        let spectra = match engine.run_unchecked(request, &control) {
            Err(EngineError::Cancelled) => return Ok(None),
            spectra => spectra?,
        };
        let spent = [cpu.elapsed().as_secs_f64(), wall.elapsed().as_secs_f64()];
        let errors = spectra
            .iter()
            .flat_map(|spectrum| spectrum.transmittance.iter().chain(&spectrum.reflectance))
            .map(|measured| measured.se);
        Ok(Some((errors.collect(), spent)))
    }
}

impl Probe {
    fn add(&mut self, spent: [f64; 2]) {
        for (sum, seconds) in self.spent.iter_mut().zip(spent) {
            *sum += seconds;
        }
    }
}

/// The resolution of tables in pilot runs of `request`.
fn resolution(request: &Request) -> Resolution {
    Resolution {
        grains: request.resolution.grains.min(GRAINS),
        ..request.resolution
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_line_goes_on() {
        let extent = Extent {
            rays: 65536.0,
            nodes: 10.0,
            wavelengths: 100.0,
        };
        // 2 ms whatever the rays, at 5 wavelengths of 500, and 3 us a ray at 2 nodes of 20
        let core = |rays: f64| 2e-3 + 3e-6 * rays;
        let run = |rays: f64| PilotRun {
            rays,
            core: core(rays),
        };
        let expected = 2e-3 * 100.0 + 3e-6 * 65536.0 * 10.0;
        let found = extrapolate(&[run(64.0), run(256.0)], &extent, false).unwrap();
        assert!((found / expected - 1.0).abs() < 1e-9, "{found}");
        // batches each pay what a run costs
        let expected = core(4096.0) * 16.0 * 10.0;
        for runs in [[64.0, 256.0], [1024.0, 4096.0]] {
            let found = extrapolate(&runs.map(run), &extent, true).unwrap();
            assert!((found / expected - 1.0).abs() < 1e-9, "{found}");
        }
        // a job of fewer rays than a batch, run completely
        let small = Extent {
            rays: 256.0,
            nodes: 1.0,
            ..extent
        };
        let found = extrapolate(&[run(64.0), run(256.0)], &small, true).unwrap();
        assert!((found / core(256.0) - 1.0).abs() < 1e-9, "{found}");
        assert_eq!(extrapolate(&[], &extent, true), None);
    }

    #[test]
    fn wavelengths_are_spread_evenly() {
        let all: Vec<f64> = (400..431).map(f64::from).collect();
        assert_eq!(thinned(&all, 5), [403.0, 409.0, 415.0, 421.0, 427.0]);
        assert_eq!(thinned(&all[..3], 5), all[..3]);
    }
}
