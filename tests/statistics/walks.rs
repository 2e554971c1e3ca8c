//! Draws inside a walk, seen from outside.
use splitsnow::grain::mean_free_distance_m;
use splitsnow::math::Vec3;
use splitsnow::optics::Index;
use splitsnow::transport::{
    Absorption, Coefficients, End, Entry, Illumination, Model, Path, Snow, Walk, Walker,
};

use super::{assert_distributed, assert_uniform, cell};
use crate::snow::{AIR, Each, NORMAL, TRANSPARENT, spheres, stream, walker};

/// So thin that the boundary rule, which acts within a grain of the planes,
/// touches 1 ray in 10^5.
const DENSITY: f64 = 0.01;

/// Lets rays fly to their first grain, which absorbs them: of index 1, so that
/// all enter it. Calls `each` with the paths.
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

/// Flights are exponential with the mean free distance, and a share S of them
/// lies in water.
#[test]
fn flights_and_media() {
    let drowned = Snow {
        water_saturation: 1.0, // outside the model's range, but shows every flight
        ..spheres(100.0, DENSITY)
    };
    let d = mean_free_distance_m(&drowned.grains[0].grain, DENSITY, -1.0);
    let mut flights = [0u64; 100];
    first_grains(&drowned, Entry::Uniform, 60, |path| {
        flights[cell((-path.water_m / d).exp(), 100)] += 1;
    });
    assert_uniform("flight lengths", &flights);
    let wet = Snow {
        water_saturation: 0.3,
        ..drowned
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

/// The chord of a sphere of index 1 is its diameter times the cosine of
/// incidence c: c is uniform for entry uniform over the surface, c^2 for entry
/// uniform over the projected area.
#[test]
fn entry_points() {
    let snow = spheres(100.0, DENSITY);
    for (entry, power) in [(Entry::Uniform, 1), (Entry::Projected, 2)] {
        let mut counts = [0u64; 100];
        first_grains(&snow, entry, 62, |path| {
            counts[cell((path.ice_m / 100e-6).powi(power), 100)] += 1;
        });
        assert_uniform(&format!("entry {entry:?}"), &counts);
    }
}

/// Diffuse light carries the weight of its cosine: cos^2 is uniform.
#[test]
fn diffuse_light() {
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
