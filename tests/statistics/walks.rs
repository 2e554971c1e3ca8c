//! Random draws in a walk, inferred from its results.
use std::f64::consts::PI;

use splitsnow::grain::{
    GrainType, Shape, SizeLaw, SizeRange, Spheroid, TruncatedNormal, mean_free_distance_m,
    overpacking,
};
use splitsnow::math::Vec3;
use splitsnow::optics::{Index, ice_density_kg_m3};
use splitsnow::transport::{
    Absorption, Coefficients, End, Entry, Illumination, Model, Path, Snow, Walk, Walker,
};

use super::grains::draw;
use super::{assert_distributed, assert_uniform, cell};
use crate::quoted::assert_says;
use crate::snow::{AIR, Each, NORMAL, TRANSPARENT, spheres, stream, walker};

/// So low that the boundary rule, which acts within a grain of the planes, affects 1 ray in 10^5.
const DENSITY: f64 = 0.01;

/// Lets rays fly to their first grain, which absorbs them. Grains have index 1, so that all rays
/// enter. Calls `each` with the paths.
fn first_grains(snow: &Snow, entry: Entry, number: u64, mut each: impl FnMut(&Path)) {
    let absorption = Absorption {
        coefficients: Coefficients {
            ice_per_m: 1e12,
            water_per_m: 1e-12,
            ..Coefficients::default()
        },
        deferred: 0.0,
    };
    let d = mean_free_distance_m(&snow.grains[0].grain, DENSITY, snow.temperature_c);
    let mut sink = Each(|end, path: &Path, _: Vec3| {
        if end == End::Absorbed {
            each(path);
        }
    });
    Walker::new(
        &snow.clone().into(),
        &Model {
            entry,
            ..Model::default()
        },
        (AIR, AIR),
        absorption,
    )
    .walk(&[50.0 * d], NORMAL, 500_000, stream(number), &mut sink)
    .unwrap();
}

/// Flights are exponential with the mean free distance, and a fraction S of them is in water.
#[test]
fn flights_are_exponential_and_media_follow_the_saturation() {
    let saturated = Snow {
        water_saturation: 1.0, // outside the range of the model, but shows every flight
        ..spheres(100.0, DENSITY)
    };
    let d = mean_free_distance_m(&saturated.grains[0].grain, DENSITY, -1.0);
    let mut flights = [0u64; 100];
    first_grains(&saturated, Entry::Uniform, 60, |path| {
        flights[cell((-path.water_m / d).exp(), 100)] += 1;
    });
    assert_uniform("flight lengths", &flights);
    let wet = Snow {
        water_saturation: 0.3,
        ..saturated
    };
    let (mut media, mut flights) = ([0u64; 2], [0u64; 100]);
    first_grains(&wet, Entry::Uniform, 61, |path| {
        media[usize::from(path.water_m > 0.0)] += 1;
        if path.water_m > 0.0 {
            flights[cell((-path.water_m / d).exp(), 100)] += 1;
        }
    });
    assert_distributed("media", &media, &[0.7, 0.3]);
    assert_uniform("flight lengths in water", &flights);
}

/// The chord of a sphere of index 1 is its diameter times the cosine of incidence c. For entry
/// uniform over the surface, c is uniform; for entry uniform over the projected area, c^2 is.
#[test]
fn entry_points_follow_their_distributions() {
    let snow = spheres(100.0, DENSITY);
    for (entry, power) in [(Entry::Uniform, 1), (Entry::Projected, 2)] {
        let mut counts = [0u64; 100];
        first_grains(&snow, entry, 62, |path| {
            counts[cell((path.ice_m / 100e-6).powi(power), 100)] += 1;
        });
        assert_uniform(&format!("entry {entry:?}"), &counts);
    }
}

/// Isotropic radiance is weighted by the cosine, so cos^2 is uniform.
#[test]
fn diffuse_light_is_weighted_by_its_cosine() {
    let mut counts = [0u64; 100];
    let empty = spheres(100.0, 0.0);
    let mut sink = Each(|_, _: &Path, direction: Vec3| {
        counts[cell(direction.z * direction.z, 100)] += 1;
    });
    let ice = Index { n: 1.31, k: 0.0 };
    walker(&empty, Entry::Uniform, ice.n, TRANSPARENT)
        .walk(
            &[1.0],
            Illumination::Diffuse,
            500_000,
            stream(63),
            &mut sink,
        )
        .unwrap();
    assert_uniform("diffuse illumination", &counts);
}

/// Path in ice per metre of flight, from the flights of walks and the mean chord 4 volume /
/// surface of the grains that they draw. Under the consistent law it agrees with the density.
/// Under the published law it is larger by the effects of the spreads of size and shape (the
/// latter from independent midpoint sums).
#[test]
fn ice_met_per_metre_matches_the_size_law() {
    let law = |min, max, mean, sd| TruncatedNormal::new(min, max, mean, sd).unwrap();
    let usual = law(0.6, 0.95, 0.798, 0.064);
    let round = law(0.9, 0.97, 0.935, 0.05);
    let held = DENSITY / ice_density_kg_m3(-1.0);
    let mut error = 0.0_f64;
    for (number, (sizes_um, sphericity, shapes)) in [
        ([300.0, 750.0], usual, 1.01636),
        ([150.0, 800.0], round, 1.00089),
        ([50.0, 3000.0], usual, 1.01636),
    ]
    .into_iter()
    .enumerate()
    {
        for size_law in [SizeLaw::Consistent, SizeLaw::Varsa2025] {
            let size = SizeRange::new(sizes_um[0] * 1e-6, sizes_um[1] * 1e-6).unwrap();
            let grain = GrainType {
                size: size.with_law(size_law),
                facetness: law(0.0, 0.0, 0.0, 0.0),
                shape: Shape::Spheroid,
                proportion: sphericity,
            };
            let flights_in_water = Snow {
                water_saturation: 1.0,
                ..Snow::dry(grain, DENSITY, -1.0)
            };
            let [mut flights, mut chords] = [Mean::default(); 2];
            let number = 64 + number as u64;
            first_grains(&flights_in_water, Entry::Uniform, number, |path| {
                flights.add(path.water_m);
            });
            draw(&grain, 500_000, number, |grain| {
                // a prolate spheroid of semi-axes 1 and c, in units of the semi-axis
                let c_2 = 1.0 + Spheroid::parts(&grain.body.numbers).1;
                let e = (1.0 - c_2).sqrt();
                let volume = 4.0 / 3.0 * PI * c_2;
                let surface = 2.0 * PI * c_2 * (1.0 + e.asin() / (c_2.sqrt() * e));
                chords.add(0.5 * grain.size_m * 4.0 * volume / surface);
            });
            let ratio = chords.value() / flights.value() / held;
            let se = ratio * chords.relative_error().hypot(flights.relative_error());
            let expected = match size_law {
                SizeLaw::Consistent => {
                    error = error.max(100.0 * se);
                    1.0
                }
                SizeLaw::Varsa2025 => overpacking(&size) * shapes,
            };
            let (name, z) = (size_law.name(), (ratio - expected) / se);
            println!("{sizes_um:?} um, {name}: {ratio:.4} of the ice held, se {se:.4}, z {z:.1}");
            assert!(z.abs() < 5.0, "{ratio} {expected} {z}");
        }
    }
    assert_says("docs/methods.md", "ice met, error of the count", [error]);
}

/// Running sums for a mean and its relative error.
#[derive(Clone, Copy, Default)]
struct Mean {
    n: f64,
    sum: f64,
    squares: f64,
}

impl Mean {
    fn add(&mut self, value: f64) {
        self.n += 1.0;
        self.sum += value;
        self.squares += value * value;
    }

    fn value(&self) -> f64 {
        self.sum / self.n
    }

    fn relative_error(&self) -> f64 {
        let mean = self.value();
        (self.squares / self.n / (mean * mean) - 1.0).sqrt() / self.n.sqrt()
    }
}
