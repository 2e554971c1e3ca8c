//! Slabs of transparent ice: conservation and closed forms.
use splitsnow::math::Vec3;
use splitsnow::optics::Index;
use splitsnow::transport::{
    Absorption, Coefficients, End, Entry, Illumination, Model, Path, Walk, Walker,
};

use super::{assert_close, mean};
use crate::quoted::{assert_says, numbers};
use crate::snow::{
    AIR, Each, Ends, NORMAL, TRANSPARENT, beam, dry, ends, proportion, snow, spheres, stream,
    walker,
};

/// Without absorption every ray is reflected or transmitted.
#[test]
fn every_ray_is_reflected_or_transmitted() {
    let rays = 20_000;
    let snows = [
        dry(),
        snow((100.0, 1000.0), 0.9, 450.0, 0.0),
        snow((300.0, 750.0), 0.1, 100.0, 0.5),
        spheres(500.0, 300.0),
    ];
    let water = Index { n: 1.333, k: 0.0 };
    for (cell, snow) in snows.iter().enumerate() {
        for (entry, light) in [
            (Entry::Uniform, NORMAL),
            (Entry::Uniform, beam(89.0)),
            (Entry::Uniform, Illumination::Diffuse),
            (Entry::Projected, beam(60.0)),
        ] {
            let walker = Walker::new(
                &snow.clone().into(),
                &Model {
                    entry,
                    ..Model::default()
                },
                (Index { n: 1.31, k: 0.0 }, water),
                TRANSPARENT,
            );
            let counts = ends(&walker, 5e-3, light, rays, cell as u64);
            assert_eq!(counts.absorbed, 0);
            assert_eq!(counts.lost, 0, "no grain of these samples traps light");
            assert_eq!(counts.reflected + counts.transmitted, rays);
            assert!(counts.reflected > 0 && counts.transmitted > 0);
        }
    }
}

/// Without grains, a dry slab is empty space and a wet one is water with probability S:
/// T = (1 - S) + S exp(-alpha h / cos), R = 0 (docs/methods.md, steps 1 and 3).
#[test]
fn a_slab_without_grains_follows_beers_law() {
    let (rays, alpha, h) = (400_000, 50.0, 0.02);
    let water = Absorption {
        coefficients: Coefficients {
            water_per_m: alpha,
            ..Coefficients::default()
        },
        ..TRANSPARENT
    };
    let lights = [
        ("normal", NORMAL, (-alpha * h).exp()),
        ("60 degrees", beam(60.0), (-2.0 * alpha * h).exp()),
        (
            "diffuse",
            Illumination::Diffuse,
            mean(|mu| 2.0 * mu * (-alpha * h / mu).exp()),
        ),
    ];
    for (name, light, survival) in lights {
        for saturation in [0.0, 0.2, 0.5] {
            let walker = walker(
                &snow((300.0, 750.0), 0.3, 0.0, saturation),
                Entry::Uniform,
                1.31,
                water,
            );
            let counts = ends(&walker, h, light, rays, 10);
            assert_eq!((counts.reflected, counts.lost), (0, 0));
            assert_eq!(counts.transmitted + counts.absorbed, rays);
            if saturation == 0.0 {
                assert_eq!(counts.transmitted, rays);
                continue;
            }
            let t = proportion(counts.transmitted, rays);
            let expected = 1.0 - saturation + saturation * survival;
            assert_close(&format!("free wet slab, {name}"), t.value, t.se, expected);
        }
    }
}

/// Ice with the refractive index of the surrounding medium neither reflects nor refracts.
#[test]
fn grains_of_matching_index_are_invisible() {
    let rays = 50_000;
    let all_transmitted = Ends {
        transmitted: rays,
        ..Ends::default()
    };
    let ice = Index { n: 1.31, k: 0.0 };
    // a saturation of 1 is outside the range of the model, but puts all grains in water
    let saturated = snow((300.0, 750.0), 0.8, 275.0, 1.0);
    for light in [NORMAL, beam(45.0)] {
        for entry in [Entry::Uniform, Entry::Projected] {
            let air = walker(
                &snow((300.0, 750.0), 0.8, 275.0, 0.0),
                entry,
                1.0,
                TRANSPARENT,
            );
            assert_eq!(ends(&air, 0.01, light, rays, 20), all_transmitted);
            let water = Walker::new(
                &saturated.clone().into(),
                &Model {
                    entry,
                    ..Model::default()
                },
                (ice, ice),
                TRANSPARENT,
            );
            assert_eq!(ends(&water, 0.01, light, rays, 21), all_transmitted);
        }
    }
    // another index makes the grains visible
    let visible = Walker::new(
        &saturated.clone().into(),
        &Model::default(),
        (ice, AIR),
        TRANSPARENT,
    );
    assert!(ends(&visible, 0.01, NORMAL, rays, 22).reflected > 0);
}

/// The fraction of rays that meet no grain, at normal incidence on equal spheres of diameter
/// s. A flight leaves the slab with probability exp(-h/d). It ends on a grain that fits with
/// probability A = mean over u of exp(-s (1-u) / 2d) - exp(-(h - s (1+u) / 2) / d), where u is
/// the cosine of incidence on the sphere. All other flights are drawn again. So the fraction
/// is exp(-h/d) / (exp(-h/d) + A). This exceeds Beer's law, because grains near the planes are
/// rejected.
#[test]
fn unscattered_light_follows_the_boundary_rule() {
    let (rays, s, h) = (1_000_000, 500e-6, 2e-3);
    let snow = spheres(500.0, 200.0);
    let d = splitsnow::grain::mean_free_distance_m(&snow.grains[0].grain, 200.0, -1.0);
    for (entry, weight) in [
        (Entry::Uniform, (|_| 1.0) as fn(f64) -> f64),
        (Entry::Projected, |u| 2.0 * u),
    ] {
        let mut unscattered = 0;
        let mut count = |end, path: &Path, direction: Vec3| {
            if end == End::Transmitted && path.ice_m == 0.0 && direction.z == 1.0 {
                unscattered += 1;
            }
        };
        walker(&snow, entry, 1.31, TRANSPARENT)
            .walk(&[h], NORMAL, rays, stream(30), &mut Each(&mut count))
            .unwrap();
        let met = mean(|u| {
            let (first, last) = (0.5 * s * (1.0 - u), h - 0.5 * s * (1.0 + u));
            weight(u) * ((-first / d).exp() - (-last / d).exp())
        });
        let beer = (-h / d).exp();
        let t = proportion(unscattered, rays);
        assert_close(
            &format!("unscattered, {entry:?}"),
            t.value,
            t.se,
            beer / (beer + met),
        );
        assert!(t.value > beer + 0.03, "Beer's law alone would be {beer}");
        if entry == Entry::Uniform {
            let page = "docs/methods.md";
            let [counted] = numbers(page, "unscattered, counted");
            assert_close("unscattered, as the page counts it", t.value, t.se, counted);
            assert_says(page, "unscattered, closed form", [beer / (beer + met)]);
            assert_says(page, "unscattered, Beer", [beer]);
        }
    }
}
