//! Absorption in ice: Beer-Lambert, monotony and limits of strong absorption.
use splitsnow::grain::mean_free_distance_m;
use splitsnow::measurement::Measured;
use splitsnow::optics::{Index, Interface};
use splitsnow::rng::Stream;
use splitsnow::simd::F64x8;
use splitsnow::transport::{Absorption, Coefficients, Entry, Model, Snow, Walker};

use super::{ALPHA, COMPARISONS, assert_close, mean};
use crate::snow::{
    AIR, NORMAL, TRANSPARENT, beam, dry, ends, proportion, spheres, walker, z_limit,
};

/// A walker at 1000 nm with the index of ice 1.3 + i k.
fn absorbing(snow: &Snow, k: f64) -> Walker {
    let ice = Index { n: 1.3, k };
    let absorption = Absorption {
        coefficients: Coefficients {
            ice_per_m: ice.absorption_per_m(1000.0),
            ..Coefficients::default()
        },
        ..TRANSPARENT
    };
    Walker::new(
        &snow.clone().into(),
        &Model::default(),
        (ice, AIR),
        absorption,
    )
}

/// Invisible spheres (n = 1) of diameter s that absorb. The ray alternates between flights of
/// mean d and chords uniform on (0, s), so deep inside T decreases as exp(-g h), where g
/// solves the renewal equation (exp((g - alpha) s) - 1) / ((g - alpha) s) = 1 - g d.
#[test]
fn attenuation_in_ice_solves_the_renewal_equation() {
    let (rays, s, alpha) = (500_000, 500e-6, 200.0);
    let snow = spheres(500.0, 300.0);
    let d = mean_free_distance_m(&snow.grains[0].grain, 300.0, -1.0);
    let excess = |g: f64| {
        let x = (g - alpha) * s;
        x.exp_m1() / x - (1.0 - g * d)
    };
    // bisection: negative at 0, positive at alpha
    let (mut low, mut high) = (0.0, alpha * (1.0 - 1e-9));
    for _ in 0..100 {
        let g = 0.5 * (low + high);
        if excess(g) < 0.0 { low = g } else { high = g }
    }
    let absorption = Absorption {
        coefficients: Coefficients {
            ice_per_m: alpha,
            ..Coefficients::default()
        },
        ..TRANSPARENT
    };
    let walker = walker(&snow, Entry::Uniform, 1.0, absorption);
    let (near, far) = (6e-3, 18e-3);
    let [a, b] = [(near, 40), (far, 41)].map(|(h, cell)| {
        let counts = ends(&walker, h, NORMAL, rays, cell);
        assert_eq!((counts.reflected, counts.lost), (0, 0));
        let t = proportion(counts.transmitted, rays);
        Measured {
            value: t.value.ln(),
            se: t.se / t.value,
        }
    });
    let decay = (a.value - b.value) / (far - near);
    let se = a.se.hypot(b.se) / (far - near);
    assert_close("attenuation in ice, 1/m", decay, se, low);
}

/// R decreases and A increases with k, for both Fresnel formulas.
#[test]
fn stronger_absorption_lowers_reflectance() {
    let rays = 40_000;
    let z = z_limit(ALPHA, COMPARISONS);
    let mut before: Option<[Measured; 2]> = None;
    for (cell, k) in [0.0, 1e-7, 5e-7, 2e-6, 1e-5, 1e-4].into_iter().enumerate() {
        let counts = ends(
            &absorbing(&dry(), k),
            0.02,
            beam(30.0),
            rays,
            50 + cell as u64,
        );
        let now = [counts.reflected, counts.absorbed].map(|count| proportion(count, rays));
        println!(
            "k = {k:e}: R = {:.4}, A = {:.4}",
            now[0].value, now[1].value
        );
        if let Some([r, a]) = before {
            assert!(r.value - now[0].value > z * r.se.hypot(now[0].se));
            assert!(now[1].value - a.value > z * a.se.hypot(now[1].se));
        }
        before = Some(now);
    }
}

/// A slab much thicker than the penetration depth reflects as any thicker one.
#[test]
fn reflectance_of_thick_absorbing_slabs_does_not_depend_on_thickness() {
    let rays = 300_000;
    let walker = absorbing(&dry(), 3e-5);
    let [thin, thick] =
        [(0.02, 60), (0.08, 61)].map(|(h, cell)| ends(&walker, h, NORMAL, rays, cell));
    assert_eq!(thick.transmitted, 0);
    let [a, b] = [thin, thick].map(|counts| proportion(counts.reflected, rays));
    assert_close("R of 2 cm and 8 cm", a.value, a.se.hypot(b.se), b.value);
}

/// If no light leaves the ice, only the reflections at entry remain. The snow is thin and of
/// equal spheres, so the boundary rule rejects almost nothing. Rays reflected once give
/// R1 = integral over c of F(c) (2c^2 - 1) / 2c^2 from c = sqrt(1/2), because a ray that meets
/// a sphere at the cosine c leaves at 2c^2 - 1. Rays reflected more often contribute at most
/// the square of the mean F.
#[test]
fn opaque_ice_reflects_only_at_entry() {
    let rays = 2_000_000;
    let snow = spheres(100.0, 0.1);
    let d = mean_free_distance_m(&snow.grains[0].grain, 0.1, -1.0);
    let absorption = Absorption {
        coefficients: Coefficients {
            ice_per_m: 1e12,
            ..Coefficients::default()
        },
        ..TRANSPARENT
    };
    let walker = walker(&snow, Entry::Uniform, 1.31, absorption);
    let counts = ends(&walker, 60.0 * d, NORMAL, rays, 70);
    let fresnel = |c: f64| super::grain::fresnel(c, 1.31);
    let once = mean(|c| (1.0 - 0.5 / (c * c)).max(0.0) * fresnel(c));
    let more = mean(fresnel).powi(2);
    let r = proportion(counts.reflected, rays);
    let z = z_limit(ALPHA, COMPARISONS);
    println!(
        "opaque ice: R = {:.6} +- {:.6}, once {once:.6}, more < {more:.6}",
        r.value, r.se
    );
    assert!(r.value > once - z * r.se && r.value < once + more + z * r.se);
    assert_eq!(counts.transmitted, 0);
}

/// At the k from which on the complex formulas are used, both formulas give nearly the same R.
#[test]
fn both_fresnel_formulas_agree_at_their_boundary() {
    let k = Interface::DIELECTRIC_K;
    let mut rng: Stream = crate::snow::stream(80);
    let [real, complex] = [Interface::dielectric, Interface::absorbing]
        .map(|interface| interface(Index { n: 1.3, k }, AIR).splat());
    for _ in 0..10_000 {
        let c = rng.uniform().max(F64x8::splat(1e-6));
        let (a, b) = (real.incidences(c), complex.incidences(c));
        let difference = (a.reflectance - b.reflectance).abs().to_array();
        // |dR| grows as the square root of k at the critical angle, where it is largest
        assert!(
            difference.iter().all(|x| *x < 10.0 * k.sqrt()),
            "{difference:?}"
        );
    }
}
