//! Cost of the walk per grain event and of one spectrum per engine.
//! `cargo bench --bench walk`; results are in docs/performance.md.
#![allow(missing_docs, clippy::unwrap_used)]
use std::sync::atomic::{AtomicBool, AtomicU64};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use splitsnow::engine::{Control, Engine, Request};
use splitsnow::grain::{GrainType, SizeRange, TruncatedNormal};
use splitsnow::optics::IceTable;
use splitsnow::rng::{Key, Stream};
use splitsnow::transport::{
    Absorption, Analog, Entry, Illumination, Model, PathLengths, Ray, Snow, Walker,
};

/// The representative sample (MODEL table 11), dry.
fn representative() -> Snow {
    Snow {
        grain: GrainType {
            size: SizeRange::new(300e-6, 750e-6).unwrap(),
            facetness: TruncatedNormal::new(0.2, 0.4, 0.3, 0.072).unwrap(),
            sphericity: TruncatedNormal::new(0.6, 0.95, 0.798, 0.064).unwrap(),
        },
        density_kg_m3: 275.0,
        temperature_c: -1.0,
        water_saturation: 0.0,
    }
}

const NORMAL: Illumination = Illumination::Collimated {
    polar_angle_rad: 0.0,
};

fn walks<A: Absorption>(rays: u32, absorption: impl Fn(&mut Stream) -> A) -> u64 {
    let ice = IceTable::WarrenBrandt2008.at(550.0).unwrap();
    let walker = Walker::new(&representative(), Entry::Uniform, ice, ice);
    let mut stream = Stream::new(Key {
        seed: 1,
        cell: 0,
        purpose: [0; 3],
        batch: 0,
    });
    let mut events = 0;
    for _ in 0..rays {
        let mut ray = Ray::entering(NORMAL, stream, &absorption);
        walker.walk(&mut ray, 0.12).unwrap();
        events += ray.events();
        stream = ray.into_stream();
    }
    events
}

fn grain_event(c: &mut Criterion) {
    let ice = IceTable::WarrenBrandt2008.at(550.0).unwrap();
    let analog = Analog {
        ice_per_m: ice.absorption_per_m(550.0),
        water_per_m: 0.0,
    };
    let mut group = c.benchmark_group("grain_event");
    group.throughput(Throughput::Elements(walks(500, |_| analog)));
    group.bench_function("reference", |b| b.iter(|| walks(500, |_| analog)));
    let recorded = |rng: &mut Stream| PathLengths::new(analog, rng);
    group.throughput(Throughput::Elements(walks(500, recorded)));
    group.bench_function("spectral", |b| b.iter(|| walks(500, recorded)));
    group.finish();
}

fn spectrum(c: &mut Criterion) {
    let wavelengths_nm: Vec<f64> = (40..=70).map(|l| f64::from(l) * 10.0).collect();
    let (snow, model) = (representative(), Model::default());
    let request = Request {
        snow: &snow,
        thicknesses_m: &[0.12],
        illumination: NORMAL,
        wavelengths_nm: &wavelengths_nm,
        model: &model,
        rays: 256,
        seed: 1,
        cell: 0,
    };
    let (cancel, rays_done) = (AtomicBool::new(false), AtomicU64::new(0));
    let control = Control {
        parallel: false,
        cancel: &cancel,
        rays_done: &rays_done,
    };
    let mut group = c.benchmark_group("spectrum_256_rays");
    group.sample_size(10);
    for engine in Engine::ALL {
        group.bench_function(engine.name(), |b| {
            b.iter(|| engine.run(&request, &control).unwrap())
        });
    }
    group.finish();
}

criterion_group!(benches, grain_event, spectrum);
criterion_main!(benches);
