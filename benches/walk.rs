//! Time of a walk per grain event, and of one spectrum per engine.
//! Run with `cargo bench --bench walk`; results are in docs/performance.md.
#![allow(missing_docs, clippy::unwrap_used)]
use std::sync::atomic::{AtomicBool, AtomicU64};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use splitsnow::engine::{Cache, Control, Engine, MaxError, Request, Resolution};
use splitsnow::grain::{Facets, GrainType, Shape, SizeRange, Surface, TruncatedNormal};
use splitsnow::math::Vec3;
use splitsnow::optics::{IceTable, Index};
use splitsnow::rng::{Key, Stream};
use splitsnow::table::{PackedTable, TableSnowpack, TableWalker, draw};
use splitsnow::transport::{
    Absorption, Coefficients, End, Entry, Illumination, Model, Path, Sink, Snow, Walk, Walker,
};

/// Counts the walks that leave through the surface, so that no walk is optimised away.
struct Reflected(u64);

impl Sink for Reflected {
    fn end(&mut self, _: std::ops::Range<usize>, end: End, _: &Path, _: Vec3) {
        self.0 += u64::from(end == End::Reflected);
    }
}

/// The representative sample (Varsa 2025, chapter 7), dry.
fn representative() -> Snow {
    Snow::dry(
        GrainType {
            size: SizeRange::new(300e-6, 750e-6).unwrap(),
            facetness: TruncatedNormal::new(0.2, 0.4, 0.3, 0.072).unwrap(),
            shape: Shape::Spheroid,
            proportion: TruncatedNormal::new(0.6, 0.95, 0.798, 0.064).unwrap(),
        },
        275.0,
        -1.0,
    )
}

const NORMAL: Illumination = Illumination::Collimated {
    polar_angle_rad: 0.0,
};

fn ice() -> Index {
    IceTable::WarrenBrandt2008.at(550.0).unwrap()
}

fn absorption(deferred: f64) -> Absorption {
    Absorption {
        coefficients: Coefficients {
            ice_per_m: ice().absorption_per_m(550.0),
            water_per_m: 0.0,
            ..Coefficients::default()
        },
        deferred,
    }
}

fn stream() -> Stream {
    Stream::new(Key {
        seed: 1,
        cell: 0,
        purpose: [0; 3],
        batch: 0,
    })
}

/// Walks 4096 rays through 12 cm of snow and returns the number of grain events.
fn walks(walker: &impl Walk) -> u64 {
    let stream = stream();
    let mut sink = Reflected(0);
    let events = walker
        .walk(&[0.12], NORMAL, 4096, stream, &mut sink)
        .unwrap();
    assert!(sink.0 > 3000);
    events
}

/// Time per element is the time per grain event.
fn grain_event(c: &mut Criterion) {
    let mut group = c.benchmark_group("grain_event");
    group.sample_size(20);
    let (snow, ice) = (representative(), ice());
    for (engine, deferred) in [("reference", 0.0), ("spectral", 3.0)] {
        let walker = Walker::new(
            &snow.clone().into(),
            &Model::default(),
            (ice, ice),
            absorption(deferred),
        );
        group.throughput(Throughput::Elements(walks(&walker)));
        group.bench_function(engine, |b| b.iter(|| walks(&walker)));
    }
    let [air, _] = Surface::in_air_and_water(ice, ice, false);
    // one of the eight parts of a table
    let outcomes = draw(
        &snow.grains[0].grain,
        (Entry::Uniform, Facets::default()),
        air,
        1 << 17,
        stream(),
    );
    let table = PackedTable::new(&outcomes, 1 << 14, &mut stream());
    let walker = TableWalker {
        snowpack: TableSnowpack::plain(&snow, [&table; 2]),
        absorption: absorption(3.0),
    };
    group.throughput(Throughput::Elements(walks(&walker)));
    group.bench_function("tabulated", |b| b.iter(|| walks(&walker)));
    group.finish();
}

fn spectrum(c: &mut Criterion) {
    let wavelengths_nm: Vec<f64> = (40..=70).map(|l| f64::from(l) * 10.0).collect();
    let (snow, model) = (representative(), Model::default());
    let request = Request {
        snowpack: &snow.clone().into(),
        thicknesses_m: &[0.12],
        illuminations: &[NORMAL],
        resolution: Resolution::default(),
        max_error: MaxError::default(),
        wavelengths_nm: &wavelengths_nm,
        model: &model,
        rays: 4096,
        seed: 1,
        cell: 0,
    };
    let (cancel, rays_done) = (AtomicBool::new(false), AtomicU64::new(0));
    let cache = Cache::default();
    let control = Control {
        parallel: false,
        cancel: &cancel,
        rays_done: &rays_done,
        cache: &cache,
    };
    let mut group = c.benchmark_group("spectrum_4096_rays");
    group.sample_size(10);
    let mut cell = 0;
    for engine in Engine::ALL {
        // each run has a new cell: it reuses the tables but does its own walks
        group.bench_function(engine.name(), |b| {
            b.iter(|| {
                cell += 1;
                let request = Request {
                    cell,
                    ..request.clone()
                };
                engine.run(&request, &control).unwrap()
            })
        });
    }
    group.bench_function("hybrid, walks kept", |b| {
        b.iter(|| Engine::Hybrid.run(&request, &control).unwrap())
    });
    group.finish();
}

criterion_group!(benches, grain_event, spectrum);
criterion_main!(benches);
