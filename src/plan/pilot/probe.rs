//! The time of one job, from running it with as many of its rays as a budget allows.
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::time::Instant;

use cpu_time::ThreadTime;

use super::{Case, PlanError};
use crate::engine::{BATCH, Cache, Control, Engine, EngineError, Request, Resolution};
use crate::grid::Grid;

/// Rays of the first run and how many times more each next one takes.
const WALKED: [u64; 2] = [16, 4];
/// The same of `hybrid`, which walks a part of a part of these from every stream, eight
/// side by side, and solves much whatever the rays.
const SOLVED: [u64; 2] = [256, 16];
/// Grain events averaged for a table here: the time to make it is nearly proportional.
const GRAINS: u32 = 1 << 18;
/// Typical CPU seconds of a table (docs/performance.md).
const TABLE: f64 = 0.3;
/// Wavelengths of a run.
const WAVELENGTHS: usize = 5;

/// One run of a job.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Run {
    /// Rays of each curve.
    pub(super) rays: f64,
    /// CPU seconds.
    pub(super) core: f64,
}

/// Standard errors, and CPU and wall clock seconds.
type Ended = (Vec<f64>, [f64; 2]);

/// What the runs of one job have taught.
#[derive(Debug, Clone, Default)]
pub(super) struct Probe {
    /// CPU seconds of the whole job without its tables; `None` if no run ended.
    pub(super) core: Option<f64>,
    /// Rays of the longest run.
    pub(super) rays: u64,
    /// CPU and wall clock seconds of all runs.
    pub(super) spent: [f64; 2],
    /// Standard errors as for all rays.
    pub(super) standard_errors: Vec<f64>,
}

/// Parts of a job that its runs leave out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Left {
    /// Rays of the whole job.
    pub(super) rays: f64,
    /// Walks per ray of the whole job, over those of a run.
    pub(super) nodes: f64,
    /// Wavelengths of the whole job, over those of a run.
    pub(super) wavelengths: f64,
}

/// Who measures.
pub(super) struct Prober<'a> {
    pub(super) grid: &'a Grid,
    pub(super) cancel: &'a AtomicBool,
    pub(super) cache: Cache,
}

/// Some `most` of `all`, evenly spread.
fn thinned(all: &[f64], most: usize) -> Vec<f64> {
    if all.len() <= most {
        return all.to_vec();
    }
    let middle = |i: usize| (2 * i + 1) * all.len() / (2 * most);
    (0..most)
        .filter_map(|i| all.get(middle(i)).copied())
        .collect()
}

/// The wavelengths of a run of a grid with `all` of these.
pub(super) fn few(all: &[f64]) -> Vec<f64> {
    thinned(all, WAVELENGTHS)
}

/// CPU seconds of a whole job from those of its runs, each of more rays than the one
/// before.
///
/// The slope between the last two is what a ray more costs: what every run costs, and
/// the few long walks at its end that leave lanes idle, is in both of them. That of
/// `batches`, which each have such an end, is extrapolated to one batch and counted.
pub(super) fn whole(runs: &[Run], left: &Left, batches: bool) -> Option<f64> {
    let last = runs.last()?;
    let slope = match runs {
        [.., before, _] => (last.core - before.core) / (last.rays - before.rays),
        _ => last.core / last.rays,
    };
    // of noise in runs too short to be measured, the mean is the better guess
    let slope = if slope > 0.0 {
        slope
    } else {
        last.core / last.rays
    };
    if batches {
        let batch = left.rays.min(BATCH as f64).max(last.rays);
        let core = last.core + slope * (batch - last.rays);
        return Some(core * left.rays / batch * left.nodes);
    }
    let fixed = (last.core - slope * last.rays).max(0.0);
    Some(fixed * left.wavelengths + slope * left.rays * left.nodes)
}

impl Prober<'_> {
    /// Runs the job of `case` with more and more of its rays, for about `seconds` of one
    /// processor, or until it is cancelled.
    pub(super) fn probe(&self, case: &Case, seconds: f64) -> Result<Probe, PlanError> {
        let wavelengths_nm = few(&self.grid.wavelengths_nm);
        let whole_request = case.job.request(self.grid);
        let request = |rays: u64| Request {
            wavelengths_nm: &wavelengths_nm,
            rays,
            resolution: resolution(&whole_request),
            ..whole_request.clone()
        };
        let walks = |wavelengths_nm: &[f64]| {
            case.engine.walks(&Request {
                wavelengths_nm,
                ..request(case.rays)
            })
        };
        let ratio = |all: f64, some: f64| all / some.max(1.0);
        let (all, some) = (self.grid.wavelengths_nm.len(), wavelengths_nm.len());
        let left = Left {
            rays: case.rays as f64,
            nodes: ratio(
                walks(&self.grid.wavelengths_nm)? as f64,
                walks(&wavelengths_nm)? as f64,
            ),
            wavelengths: ratio(all as f64, some as f64),
        };
        let mut probe = Probe::default();
        let mut runs = Vec::new();
        let most = match case.engine {
            Engine::Hybrid => case.rays,
            _ => case.rays.min(BATCH),
        };
        if case.engine.uses_tables() {
            // a single walk leaves the tables in the cache
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
        let [first, more] = match case.engine {
            Engine::Hybrid => SOLVED,
            _ => WALKED,
        };
        let mut rays = first.min(most);
        while let Some((errors, spent)) = self.run(case.engine, &request(rays))? {
            probe.add(spent);
            runs.push(Run {
                rays: rays as f64,
                core: spent[0],
            });
            probe.rays = rays;
            let noise = (rays as f64 / case.rays as f64).sqrt();
            probe.standard_errors = errors.into_iter().map(|se| se * noise).collect();
            let next = rays.saturating_mul(more).min(most);
            let expected = match (&runs[..], case.engine) {
                // mostly what does not depend on the rays
                ([only], Engine::Hybrid) => 1.5 * only.core,
                ([only], _) => only.core * next as f64 / only.rays,
                _ => {
                    let ahead = Left {
                        rays: next as f64,
                        nodes: 1.0,
                        wavelengths: 1.0,
                    };
                    whole(&runs, &ahead, false).unwrap_or_default()
                }
            };
            if rays == most || probe.spent[0] + expected > seconds {
                break;
            }
            rays = next;
        }
        probe.core = whole(&runs, &left, case.engine != Engine::Hybrid);
        Ok(probe)
    }

    /// CPU seconds to make the tables of the grains in the job of `case`, at all nodes,
    /// and whether that was measured.
    pub(super) fn tables(&self, case: &Case) -> Result<(f64, bool), PlanError> {
        let whole_request = case.job.request(self.grid);
        let nodes = |wavelengths_nm: &[f64]| {
            Engine::Tabulated.walks(&Request {
                wavelengths_nm,
                rays: 1,
                ..whole_request.clone()
            })
        };
        // at a single node
        let one = thinned(&self.grid.wavelengths_nm, 1);
        let request = Request {
            wavelengths_nm: &one,
            thicknesses_m: &whole_request.thicknesses_m[..1],
            illuminations: &whole_request.illuminations[..1],
            rays: 1,
            resolution: resolution(&whole_request),
            ..whole_request.clone()
        };
        let nodes = nodes(&self.grid.wavelengths_nm)? as f64 / nodes(&one)?.max(1) as f64;
        let mut times = Vec::new();
        for _ in 0..2 {
            let Some((_, [core, _])) = self.run(Engine::Tabulated, &request)? else {
                let kinds: usize = whole_request
                    .snowpack
                    .snows()
                    .map(|snow| snow.grains.len())
                    .sum();
                let media = if whole_request.snowpack.is_wet() {
                    2.0
                } else {
                    1.0
                };
                return Ok((TABLE * kinds as f64 * media * nodes, false));
            };
            times.push(core);
        }
        let made = (times[0] - times[1]).max(0.0);
        let all = f64::from(whole_request.resolution.grains) / f64::from(request.resolution.grains);
        Ok((made * all * nodes, true))
    }

    /// What a run gave; `None` if it was cancelled.
    fn run(&self, engine: Engine, request: &Request) -> Result<Option<Ended>, PlanError> {
        let control = Control {
            parallel: false,
            cancel: self.cancel,
            rays_done: &AtomicU64::new(0),
            cache: &self.cache,
        };
        let (begin, worked) = (Instant::now(), ThreadTime::now());
        // held already; so few rays would be refused
        let spectra = match engine.run_unchecked(request, &control) {
            Err(EngineError::Cancelled) => return Ok(None),
            spectra => spectra?,
        };
        let spent = [
            worked.elapsed().as_secs_f64(),
            begin.elapsed().as_secs_f64(),
        ];
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
        let left = Left {
            rays: 65536.0,
            nodes: 10.0,
            wavelengths: 100.0,
        };
        // 2 ms whatever the rays, at 5 wavelengths of 500, and 3 us a ray at 2 nodes of 20
        let core = |rays: f64| 2e-3 + 3e-6 * rays;
        let run = |rays: f64| Run {
            rays,
            core: core(rays),
        };
        let expected = 2e-3 * 100.0 + 3e-6 * 65536.0 * 10.0;
        let found = whole(&[run(64.0), run(256.0)], &left, false).unwrap();
        assert!((found / expected - 1.0).abs() < 1e-9, "{found}");
        // batches each pay what a run costs
        let expected = core(4096.0) * 16.0 * 10.0;
        for runs in [[64.0, 256.0], [1024.0, 4096.0]] {
            let found = whole(&runs.map(run), &left, true).unwrap();
            assert!((found / expected - 1.0).abs() < 1e-9, "{found}");
        }
        // a job of fewer rays than a batch, run whole
        let small = Left {
            rays: 256.0,
            nodes: 1.0,
            ..left
        };
        let found = whole(&[run(64.0), run(256.0)], &small, true).unwrap();
        assert!((found / core(256.0) - 1.0).abs() < 1e-9, "{found}");
        assert_eq!(whole(&[], &left, true), None);
    }

    #[test]
    fn wavelengths_are_spread_evenly() {
        let all: Vec<f64> = (400..431).map(f64::from).collect();
        assert_eq!(thinned(&all, 5), [403.0, 409.0, 415.0, 421.0, 427.0]);
        assert_eq!(thinned(&all[..3], 5), all[..3]);
    }
}
