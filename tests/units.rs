//! Jobs that are longer than what they are given: what is finished of them is kept,
//! and they go on from there, to the bit.
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

/// Keeps some savings of a life and ends it: what is saved later is lost, as is
/// what is at work.
#[derive(Debug, Clone)]
struct Life {
    kept: Arc<Mutex<Vec<Vec<u8>>>>,
    savings: usize,
    cancel: &'static AtomicBool,
}

impl UnitStore for Life {
    fn append(&self, units: &[u8]) -> bool {
        let mut kept = self.kept.lock().unwrap();
        if !self.cancel.load(Ordering::Relaxed) {
            kept.push(units.to_vec());
            let over = kept.len().is_multiple_of(self.savings);
            self.cancel.store(over, Ordering::Relaxed);
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
    // beyond where each holds, too
    let result = engine.run_unchecked(request, &control);
    (result, rays_done.into_inner())
}

#[test]
fn a_job_ends_however_short_its_lives_are() {
    for engine in [
        Engine::Reference,
        Engine::Spectral,
        Engine::Tabulated,
        Engine::Hybrid,
    ] {
        let mut grid = grid(engine);
        grid.run.rays = 10_000;
        grid.fixed.substrate = Substrate::Grey(0.3);
        // one thin slab, one with an inside
        grid.axes.set(Parameter::GrainSize, vec![400.0]);
        grid.axes.set(Parameter::Thickness, vec![0.5, 2.0]);
        // its units are many: one index node will do
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
        let (mut lives, mut walked_in_all) = (0, 0);
        let result = loop {
            let cancel: &'static AtomicBool = Box::leak(Box::default());
            let life = Life {
                kept: Arc::clone(&kept),
                // the units of hybrid are many
                savings: if engine == Engine::Hybrid { 8 } else { 1 },
                cancel,
            };
            let before = kept.lock().unwrap().clone();
            let units = Units::new(Box::new(life), &before).with_save_interval(Duration::ZERO);
            // nothing else survives
            let cache = Cache::default().with(units);
            let (result, walked) = run(engine, &request, &cache, cancel);
            lives += 1;
            walked_in_all += walked;
            assert!(lives < 10_000);
            match result {
                Err(EngineError::Cancelled) => {}
                result => break result,
            }
        };
        assert_eq!(result, expected, "{engine:?}");
        assert!(lives > 4, "{engine:?}: {lives} lives");
        assert_eq!(walked_in_all, walked, "{engine:?}: walked twice");
    }
}
