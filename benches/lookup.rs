//! Time of a look-up: a spectrum of 31 wavelengths between the nodes, on one core with
//! warm caches. SPLITSNOW_FILE is the compact file; the default is
//! out/quick/snow.safetensors, which is built from configs/quick.toml.
#![allow(clippy::unwrap_used, missing_docs)]
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use rayon::prelude::*;
use splitsnow::lookup::{Database, Lookup, Varsa2025};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Parameter, Point};

fn lookups(c: &mut Criterion) {
    let file = std::env::var("SPLITSNOW_FILE").unwrap_or("out/quick/snow.safetensors".into());
    let database = Database::open(Path::new(&file)).unwrap();
    let quantity = Quantity::Transmittance;
    let lookup = Lookup::new(&database, quantity).unwrap();
    let mut spectrum = vec![0.0; lookup.wavelengths()];
    let ends = database
        .axes()
        .core()
        .map(|axis| [axis[0], axis[axis.len() - 1]]);
    // points of a lattice, scattered like those of a renderer
    let mut u = [0.5; 5];
    let points: Vec<Point> = (0..4096)
        .map(|_| {
            let steps = [0.8567, 0.7339, 0.6287, 0.5386, 0.4614];
            u.iter_mut()
                .zip(steps)
                .for_each(|(u, step)| *u = (*u + step) % 1.0);
            let value = |axis: usize| ends[axis][0] + u[axis] * (ends[axis][1] - ends[axis][0]);
            Point::from_core(std::array::from_fn(value))
        })
        .collect();
    let mut next = (0..).map(|i: usize| points[i % points.len()]);
    let mut group = c.benchmark_group("lookup");
    group.bench_function("anywhere", |b| {
        b.iter(|| {
            lookup
                .spectrum(next.next().unwrap(), &mut spectrum)
                .unwrap()
        })
    });
    let p = points[0];
    let snow = lookup.material(p).unwrap();
    let in_snow = |point: Point| {
        p.with(Parameter::Thickness, point[Parameter::Thickness])
            .with(Parameter::Incidence, point[Parameter::Incidence])
    };
    group.bench_function("of one snow", |b| {
        b.iter(|| {
            snow.spectrum(in_snow(next.next().unwrap()), &mut spectrum)
                .unwrap()
        })
    });
    group.bench_function("a million, all cores", |b| {
        b.iter(|| {
            let chunks = (0..1_000_000_usize).into_par_iter().with_min_len(4096);
            chunks.for_each_init(
                || vec![0.0; lookup.wavelengths()],
                |spectrum, i| lookup.spectrum(points[i % points.len()], spectrum).unwrap(),
            );
        })
    });
    let published = Varsa2025::new(&database, quantity).unwrap();
    let node = database.point(0).unwrap();
    let on_node = |point: Point| {
        node.with(Parameter::Thickness, point[Parameter::Thickness])
            .with(Parameter::Incidence, point[Parameter::Incidence])
    };
    group.bench_function("varsa2025", |b| {
        b.iter(|| published.spectrum(on_node(next.next().unwrap())).unwrap())
    });
    group.bench_function("preparing", |b| {
        b.iter(|| Lookup::new(&database, quantity).unwrap())
    });
    group.finish();
}

criterion_group!(benches, lookups);
criterion_main!(benches);
