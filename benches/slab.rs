//! Time of the slab solver: the set-up of a medium, each further thickness, and the
//! coupling of a slab with other operators.
//! Run with `cargo bench --bench slab`; results are in docs/performance.md.
#![allow(missing_docs, clippy::unwrap_used)]
use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use splitsnow::slab::{Light, Matrix, Medium, Streams};

fn slab(c: &mut Criterion) {
    for n in [8, 12, 16] {
        let streams = Streams::new(n).unwrap();
        let chi: Vec<f64> = (0..=2 * n as i32)
            .map(|l| 0.999 * 0.85_f64.powi(l))
            .collect();
        let medium = Medium::new(&streams, &chi).unwrap();
        let slab = medium.operators(3.0).unwrap();
        let mut group = c.benchmark_group(format!("slab_{n}_streams"));
        group.bench_function("medium", |b| {
            b.iter(|| Medium::new(&streams, black_box(&chi)).unwrap());
        });
        group.bench_function("operators", |b| {
            b.iter(|| medium.operators(black_box(3.0)).unwrap());
        });
        group.bench_function("beam", |b| {
            b.iter(|| {
                let light = Light::Collimated { cosine: 0.7 };
                medium.fluxes(black_box(3.0), light).unwrap()
            });
        });
        group.bench_function("coupling", |b| {
            b.iter(|| {
                let reflection = black_box(&slab.reflection);
                let between = &Matrix::identity(n) - &(reflection * reflection);
                between.solve(slab.transmission.clone()).unwrap()
            });
        });
        group.finish();
    }
}

criterion_group!(benches, slab);
criterion_main!(benches);
