//! Jobs that are interrupted again and again: finished units of work are kept, and the job
//! resumes with bitwise identical results.
#![allow(clippy::unwrap_used)]

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use crate::common::grid;
use splitsnow::engine::{
    Cache, Control, Engine, EngineError, Request, Resolution, UnitStore, Units,
};
use splitsnow::measurement::Spectrum;
use splitsnow::parameter::Parameter;
use splitsnow::transport::Substrate;

/// Keeps the units of one run of a job and cancels the run after every `savings` units.
/// Units saved later, and unfinished ones, are lost.
#[derive(Debug, Clone)]
struct InterruptedRun {
    kept: Arc<Mutex<Vec<Vec<u8>>>>,
    savings: usize,
    cancel: &'static AtomicBool,
}

impl UnitStore for InterruptedRun {
    fn append(&self, units: &[u8]) -> bool {
        let mut kept = self.kept.lock().unwrap();
        if !self.cancel.load(Ordering::Relaxed) {
            kept.push(units.to_vec());
            let interrupt = kept.len().is_multiple_of(self.savings);
            self.cancel.store(interrupt, Ordering::Relaxed);
        }
        true
    }
}

fn run(
    engine: Engine,
    request: &Request,
    cache: &Cache,
    cancel: &AtomicBool,
) -> (Result<Vec<Spectrum>, EngineError>, u64) {
    let rays_done = AtomicU64::new(0);
    let control = Control {
        parallel: false,
        cancel,
        rays_done: &rays_done,
        cache,
    };
    // without checking the limits of the engine
    let result = engine.run_unchecked(request, &control);
    (result, rays_done.into_inner())
}

#[test]
fn interrupted_jobs_finish_with_identical_results() {
    for engine in [
        Engine::Reference,
        Engine::Spectral,
        Engine::Tabulated,
        Engine::Hybrid,
    ] {
        let mut grid = grid(engine);
        grid.run.rays = 10_000;
        grid.fixed.substrate = Substrate::Grey(0.3);
        // a thin slab and one with an interior
        grid.axes.set(Parameter::GrainSize, vec![400.0]);
        grid.axes.set(Parameter::Thickness, vec![0.5, 2.0]);
        // one index node is enough for hybrid, which has many units
        let nm = [500.0, 900.0];
        let count = if engine == Engine::Hybrid { 1 } else { 2 };
        grid.wavelengths_nm = nm[..count].to_vec();
        let job = grid.job(&grid.jobs().unwrap(), 0).unwrap();
        let request = Request {
            resolution: Resolution {
                table: 1 << 8,
                grains: 1 << 10,
                ..Resolution::default()
            },
            ..job.request(&grid)
        };
        let (expected, walked) = run(engine, &request, &Cache::default(), &AtomicBool::new(false));
        assert!(expected.is_ok(), "{engine:?}: {expected:?}");
        let kept = Arc::default();
        let (mut runs, mut walked_in_all_runs) = (0, 0);
        let result = loop {
            let cancel: &'static AtomicBool = Box::leak(Box::default());
            let store = InterruptedRun {
                kept: Arc::clone(&kept),
                // hybrid has many units
                savings: if engine == Engine::Hybrid { 8 } else { 1 },
                cancel,
            };
            let before = kept.lock().unwrap().clone();
            let units = Units::new(Box::new(store), &before).with_save_interval(Duration::ZERO);
            // a new cache: only the units survive
            let cache = Cache::default().with(units);
            let (result, walked) = run(engine, &request, &cache, cancel);
            runs += 1;
            walked_in_all_runs += walked;
            assert!(runs < 10_000);
            match result {
                Err(EngineError::Cancelled) => {}
                result => break result,
            }
        };
        assert_eq!(result, expected, "{engine:?}");
        assert!(runs > 4, "{engine:?}: {runs} runs");
        assert_eq!(
            walked_in_all_runs, walked,
            "{engine:?}: some rays were walked twice"
        );
    }
}
