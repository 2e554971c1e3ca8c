//! Snowpacks on a substrate, and cascades, which put layers on one.
use splitsnow::engine::Engine;
use splitsnow::measurement::{Measured, Spectrum};
use splitsnow::optics::Carbon;
use splitsnow::transport::Snow;
use splitsnow::transport::{Bounce, Entry, Illumination, Snowpack, Substrate};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::assert_close;
use super::case::{Case, assert_same, dirty, on, over, spectral_substrate};
use crate::snow::{NORMAL, TRANSPARENT, beam, dry, ends, snow, walker};

/// Nothing is lost between a perfect substrate and snow that does not absorb.
#[test]
fn perfect_substrate_sends_everything_back() {
    let bounce = Bounce {
        reflected: 1.0,
        transmitted: 0.0,
    };
    let transparent = walker(&dry(), Entry::Uniform, 1.31, TRANSPARENT).over(bounce);
    let counts = ends(&transparent, 0.01, beam(40.0), 20_000, 300);
    assert_eq!(counts.reflected + counts.lost, 20_000);
    assert!(counts.lost < 20, "{counts:?}");
    // ice absorbs 6e-4 per m at 400 nm, and light goes some 3 cm in it
    for engine in [Engine::Spectral, Engine::Reference] {
        let mut case = Case::new(over(dry(), Substrate::Grey(1.0)), 0.01).of(engine);
        case.nm = vec![400.0];
        let spectrum = case.run(50_000, 4);
        let (r, t) = (
            spectrum.reflectance[0].value,
            spectrum.transmittance[0].value,
        );
        let few = if engine == Engine::Spectral {
            1e-4
        } else {
            6e-4
        };
        println!("{}: R = {r:.6}", engine.name());
        assert!(
            (1.0 - few - spectrum.lost[0]..=1.0 + 1e-12).contains(&r),
            "{r}"
        );
        assert_eq!(t, 0.0);
    }
}

#[test]
fn spectral_over_a_substrate_is_reference_over_it() {
    let layered = Snowpack {
        substrate: spectral_substrate(),
        ..on(dirty(), dry(), 0.004)
    };
    let homogeneous = over(dirty(), spectral_substrate());
    for (what, snowpack) in [("layers", layered), ("one layer", homogeneous)] {
        for case in [
            Case::new(snowpack.clone(), 0.008),
            Case::new(snowpack, 0.008).cascade(),
        ] {
            let a = case.run(60_000, 9);
            let b = case.of(Engine::Reference).run(40_000, 10);
            assert_same(&format!("{what}, {}", case.model.joining.name()), &a, &b);
        }
    }
}

/// Grazing light from above and from the substrate finds grains that fit, also
/// where those met near their tops are rare.
#[test]
fn projected_entry_serves_diffuse_light() {
    let mut case = Case::new(over(dry(), Substrate::Grey(0.9)), 0.005);
    case.light = Illumination::Diffuse;
    case.model.entry = Entry::Projected;
    let (a, b) = (
        case.run(300_000, 17),
        case.of(Engine::Reference).run(60_000, 18),
    );
    assert_same("projected, diffuse", &a, &b);
}

/// A cascade puts a layer on a Lambertian substrate: that of its lower snowpack.
#[test]
fn a_cascade_is_a_layer_on_a_substrate() {
    let below_m = 0.01;
    let lower = Case {
        light: NORMAL,
        nm: vec![850.0],
        ..Case::new(dirty(), below_m)
    };
    let lower = lower.run(100_000, 11).reflectance[0];
    let mut cascade = Case::new(on(dry(), dirty(), below_m), 0.005 + below_m).cascade();
    cascade.nm = vec![850.0];
    let on_substrate = Case {
        nm: vec![850.0],
        ..Case::new(over(dry(), Substrate::Grey(lower.value)), 0.005)
    };
    let (a, b) = (cascade.run(60_000, 12), on_substrate.run(60_000, 13));
    let (a, b) = (a.reflectance[0], b.reflectance[0]);
    // dR / d rho is at most 1
    let se = a.se.hypot(b.se).hypot(lower.se);
    assert_close("cascade and substrate", a.value, se, b.value);
}

/// What the cascade neglects: that light comes out of the lower snowpack where and
/// as it went in, and that grains reach across. It vanishes over a lower snowpack
/// that sends back nothing or everything, but for grains at the plane.
#[test]
fn how_far_cascades_are_off() {
    cascades_are_off(1_000, 0.02, &[0.0], &[0.002]);
}

#[test]
#[ignore = "long: eight times the walks and more snows, some 50 CPU-s"]
fn how_far_cascades_are_off_closely() {
    cascades_are_off(8_000, 0.2, &[0.0, 60.0], &[0.002, 0.005, 0.01]);
}

fn cascades_are_off(rays: u64, much_m: f64, degs: &[f64], surfaces_m: &[f64]) {
    let black = Snow {
        black_carbon: Some(Carbon::black(1e9)),
        ..dry()
    };
    let fine = |density| snow((60.0, 140.0), 0.5, density, 0.0);
    let basal = snow((900.0, 1000.0), 0.1, 375.0, 0.0);
    let apart = |what: &str, snowpack: Snowpack, thickness_m, deg| {
        let case = Case {
            light: beam(deg),
            ..Case::new(snowpack, thickness_m)
        };
        let (a, b) = (case.run(rays, 14), case.cascade().run(rays, 15));
        let differences = a.reflectance.iter().zip(&b.reflectance);
        let differences: Vec<Measured> = differences
            .map(|(a, b)| Measured {
                value: b.value - a.value,
                se: a.se.hypot(b.se),
            })
            .collect();
        println!("cascade - continuous, {what}, {deg} degrees: {differences:.4?}");
        // what is sure, for the largest of few walks is mostly noise
        differences
            .iter()
            .map(|d| d.value.abs() - 3.0 * d.se)
            .fold(0.0, f64::max)
    };
    assert!(apart("on black", on(dry(), black, 0.02), 0.03, 0.0) < 0.005);
    let perfect = apart(
        "visible, on much fine snow",
        on(fine(300.0), fine(300.0), much_m),
        0.01 + much_m,
        0.0,
    );
    let mut most = perfect;
    for &deg in degs {
        for &surface_m in surfaces_m {
            let snowpack = on(fine(225.0), basal.clone(), 0.1);
            let what = format!("{} mm on basal", surface_m * 1e3);
            most = most.max(apart(&what, snowpack, 0.1 + surface_m, deg));
        }
    }
    println!("cascades are off by {most:.4} at most");
    assert!(most < 0.02);
}

/// Scatter over seeds in units of the standard errors: chi-square. The errors
/// of `spectral` over a substrate take R and T of the bare snowpack for independent,
/// although what one gains the other loses: they may be too large.
#[test]
fn standard_errors_are_those_of_the_scatter() {
    const SEEDS: u64 = 24;
    let chi = ChiSquared::new((SEEDS - 1) as f64).unwrap();
    let (low, high) = (chi.inverse_cdf(1e-6), chi.inverse_cdf(1.0 - 1e-6));
    let substrate = Case {
        nm: vec![850.0],
        ..Case::new(over(dry(), Substrate::Grey(0.5)), 0.005)
    };
    let cascade = Case {
        nm: vec![850.0],
        ..Case::new(on(dry(), dirty(), 0.003), 0.008).cascade()
    };
    for (what, case) in [("substrate", substrate), ("cascade", cascade)] {
        for engine in [Engine::Reference, Engine::Spectral] {
            let spectra: Vec<Spectrum> = (0..SEEDS)
                .map(|seed| case.of(engine).run(4096, 100 + seed))
                .collect();
            for (quantity, of) in [
                ("R", (|s| s.reflectance[0]) as fn(&Spectrum) -> Measured),
                ("T", |s| s.transmittance[0]),
            ] {
                let all: Vec<Measured> = spectra.iter().map(of).collect();
                let mean = all.iter().map(|m| m.value).sum::<f64>() / SEEDS as f64;
                let sum: f64 = all.iter().map(|m| ((m.value - mean) / m.se).powi(2)).sum();
                let name = engine.name();
                println!("{what}, {name}, {quantity}: chi2 = {sum:.1} in [{low:.1}, {high:.1}]");
                assert!(sum < high, "{what}, {name}, {quantity}: {sum}");
                // half the error claimed at least
                let least = if engine == Engine::Spectral {
                    low / 4.0
                } else {
                    low
                };
                assert!(sum > least, "{what}, {name}, {quantity}: {sum}");
            }
        }
    }
}
