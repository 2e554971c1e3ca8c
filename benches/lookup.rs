//! Time of a look-up: a spectrum of 31 wavelengths between the nodes, on one core with
//! warm caches. SPLITSNOW_FILE is the compact file; the default is
//! out/quick/snow.safetensors, which is built from configs/quick.toml. The file of anisotropy
//! factors has its axes, 49 views and made-up factors of five components; benches/lookup.c reads
//! it from target/tmp.
#![allow(clippy::unwrap_used, missing_docs)]
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use ndarray::Array2;
use rayon::prelude::*;
use splitsnow::compress::{Bands, Choice, CompactFile, CompactVariant, compress};
use splitsnow::lookup::{
    Anisotropy, Database, DirectionalQuantity, Directions, Lookup, SubstrateKind, Varsa2025,
};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Axes, Parameter, Point};

/// The compact file to look up.
fn database() -> Database {
    let file = std::env::var("SPLITSNOW_FILE").unwrap_or("out/quick/snow.safetensors".into());
    Database::open(Path::new(&file)).unwrap()
}

/// Points of a lattice within these axes, scattered like those of a renderer.
fn scattered(axes: &Axes, parameters: &[Parameter]) -> Vec<Point> {
    let mut u = [0.5; 7];
    let steps = [0.8567, 0.7339, 0.6287, 0.5386, 0.4614, 0.3953, 0.3387];
    let mut point = || {
        u.iter_mut()
            .zip(steps)
            .for_each(|(u, step)| *u = (*u + step) % 1.0);
        let value = |(parameter, u): (&Parameter, f64)| {
            let nodes = axes.values(*parameter);
            let [first, last] = [nodes[0], nodes[nodes.len() - 1]];
            (*parameter, first + u * (last - first))
        };
        parameters.iter().zip(u).map(value).collect()
    };
    (0..4096).map(|_| point()).collect()
}

/// A file of anisotropy factors with the axes of `database`, written to target/tmp.
fn views(database: &Database) -> Database {
    let axes = database.axes().clone();
    let axes = axes
        .with(
            Parameter::View,
            vec![0.0, 15.0, 30.0, 45.0, 60.0, 70.0, 80.0],
        )
        .with(
            Parameter::RelativeAzimuth,
            (0..7).map(|i| 30.0 * f64::from(i)).collect(),
        );
    let nm = database.wavelengths_nm();
    let factor = |(row, l): (usize, usize)| {
        let point = axes.point(row as u64);
        let [light, view, azimuth] = [
            Parameter::Incidence,
            Parameter::View,
            Parameter::RelativeAzimuth,
        ]
        .map(|p| point[p].to_radians());
        let cosine = light.cos() * view.cos() + light.sin() * view.sin() * azimuth.cos();
        let sharpness = 1.0 + nm[l] / 400.0 + point[Parameter::GrainSize] / 300.0;
        0.8 + 0.5 * (sharpness * (cosine - 1.0)).exp() / (1.0 + point[Parameter::Thickness])
    };
    let curves = Array2::from_shape_fn((axes.count() as usize, nm.len()), factor);
    let [t, r] = Quantity::ALL.map(|quantity| {
        let (bands, five) = (Bands::new(nm), Choice::Components(5));
        let variant = CompactVariant::default();
        compress(curves.view(), quantity, None, &bands, five, variant).unwrap()
    });
    let file = CompactFile {
        axes: &axes,
        absent: database.absent(),
        wavelengths_nm: nm,
        substrate: SubstrateKind::Black,
        transmittance: Some(&t),
        reflectance: Some(&r),
        provenance: "{}",
        extra: &Default::default(),
    };
    let bytes = file.to_bytes().unwrap();
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("views.safetensors");
    std::fs::write(path, &bytes).unwrap();
    Database::from_bytes(&bytes).unwrap()
}

fn directions(c: &mut Criterion) {
    let database = database();
    let views = views(&database);
    let quantity = Quantity::Reflectance;
    let anisotropy = Anisotropy::new(&views, quantity).unwrap();
    let directions = Directions::new(&database, &views).unwrap();
    let mut spectrum = vec![0.0; directions.wavelengths()];
    let parameters = [&Parameter::CORE[..], &Parameter::VIEWS].concat();
    let points = scattered(views.axes(), &parameters);
    let snow: Point = Parameter::CORE[..3]
        .iter()
        .map(|p| (*p, points[0][*p]))
        .collect();
    let in_snow: Vec<Point> = points.iter().map(|point| point.and(snow)).collect();
    let mut next = (0..).map(|i: usize| points[i % points.len()]);
    let mut next_in_snow = (0..).map(|i: usize| in_snow[i % in_snow.len()]);
    let brf = DirectionalQuantity::ReflectanceFactor;
    let mut group = c.benchmark_group("toward views");
    group.bench_function("anisotropy factor, anywhere", |b| {
        b.iter(|| {
            anisotropy
                .spectrum(next.next().unwrap(), &mut spectrum)
                .unwrap()
        })
    });
    group.bench_function("BRF, anywhere", |b| {
        b.iter(|| {
            directions
                .spectrum(brf, next.next().unwrap(), &mut spectrum)
                .unwrap()
        })
    });
    let of_snow = anisotropy.material(snow).unwrap();
    group.bench_function("anisotropy factor, of one snow", |b| {
        b.iter(|| {
            of_snow
                .spectrum(next_in_snow.next().unwrap(), &mut spectrum)
                .unwrap()
        })
    });
    let of_snow = directions.material(snow).unwrap();
    group.bench_function("BRF, of one snow", |b| {
        b.iter(|| {
            of_snow
                .spectrum(brf, next_in_snow.next().unwrap(), &mut spectrum)
                .unwrap()
        })
    });
    group.bench_function("preparing one snow", |b| {
        b.iter(|| directions.material(snow).unwrap())
    });
    group.finish();
}

fn lookups(c: &mut Criterion) {
    let database = database();
    let quantity = Quantity::Transmittance;
    let lookup = Lookup::new(&database, quantity).unwrap();
    let mut spectrum = vec![0.0; lookup.wavelengths()];
    let points = scattered(database.axes(), &Parameter::CORE);
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

criterion_group!(benches, lookups, directions);
criterion_main!(benches);
