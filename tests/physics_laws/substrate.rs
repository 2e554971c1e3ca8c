//! Snowpacks on a substrate, and cascades, which treat lower layers as a substrate.
use splitsnow::engine::Engine;
use splitsnow::measurement::{Measured, Spectrum};
use splitsnow::optics::Carbon;
use splitsnow::transport::Snow;
use splitsnow::transport::{Bounce, Entry, Illumination, Snowpack, Substrate};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::assert_close;
use super::case::{Case, assert_same, dirty, on_substrate, spectral_substrate, two_layers};
use crate::snow::{NORMAL, TRANSPARENT, beam, dry, ends, snow, walker};

/// No light is lost between a perfect reflector and snow without absorption.
#[test]
fn a_perfect_substrate_reflects_all_light() {
    let bounce = Bounce {
        reflected: 1.0,
        transmitted: 0.0,
    };
    let transparent = walker(&dry(), Entry::Uniform, 1.31, TRANSPARENT).over(bounce);
    let counts = ends(&transparent, 0.01, beam(40.0), 20_000, 300);
    assert_eq!(counts.reflected + counts.lost, 20_000);
    assert!(counts.lost < 20, "{counts:?}");
    // ice absorbs 6e-4 per m at 400 nm, and the path of light in it is about 3 cm
    for engine in [Engine::Spectral, Engine::Reference] {
        let mut case =
            Case::new(on_substrate(dry(), Substrate::Grey(1.0)), 0.01).with_engine(engine);
        case.nm = vec![400.0];
        let spectrum = case.run(50_000, 4);
        let (r, t) = (
            spectrum.reflectance[0].value,
            spectrum.transmittance[0].value,
        );
        let tolerance = if engine == Engine::Spectral {
            1e-4
        } else {
            6e-4
        };
        println!("{}: R = {r:.6}", engine.name());
        assert!(
            (1.0 - tolerance - spectrum.lost[0]..=1.0 + 1e-12).contains(&r),
            "{r}"
        );
        assert_eq!(t, 0.0);
    }
}

#[test]
fn spectral_agrees_with_reference_over_a_substrate() {
    let layered = Snowpack {
        substrate: spectral_substrate(),
        ..two_layers(dirty(), dry(), 0.004)
    };
    let homogeneous = on_substrate(dirty(), spectral_substrate());
    for (label, snowpack) in [("layers", layered), ("one layer", homogeneous)] {
        for case in [
            Case::new(snowpack.clone(), 0.008),
            Case::new(snowpack, 0.008).cascade(),
        ] {
            let a = case.run(60_000, 9);
            let b = case.with_engine(Engine::Reference).run(40_000, 10);
            assert_same(&format!("{label}, {}", case.model.joining.name()), &a, &b);
        }
    }
}

/// Grazing light from above and from the substrate finds grains that fit, even if grains met
/// near their tops are rare.
#[test]
fn projected_entry_works_with_diffuse_light() {
    let mut case = Case::new(on_substrate(dry(), Substrate::Grey(0.9)), 0.005);
    case.light = Illumination::Diffuse;
    case.model.entry = Entry::Projected;
    let (a, b) = (
        case.run(300_000, 17),
        case.with_engine(Engine::Reference).run(60_000, 18),
    );
    assert_same("projected, diffuse", &a, &b);
}

/// A cascade treats the lower layer as a Lambertian substrate of the same reflectance.
#[test]
fn a_cascade_equals_a_layer_on_a_substrate() {
    let below_m = 0.01;
    let lower = Case {
        light: NORMAL,
        nm: vec![850.0],
        ..Case::new(dirty(), below_m)
    };
    let lower = lower.run(100_000, 11).reflectance[0];
    let mut cascade = Case::new(two_layers(dry(), dirty(), below_m), 0.005 + below_m).cascade();
    cascade.nm = vec![850.0];
    let single_layer = Case {
        nm: vec![850.0],
        ..Case::new(on_substrate(dry(), Substrate::Grey(lower.value)), 0.005)
    };
    let (a, b) = (cascade.run(60_000, 12), single_layer.run(60_000, 13));
    let (a, b) = (a.reflectance[0], b.reflectance[0]);
    // dR / d rho is at most 1
    let se = a.se.hypot(b.se).hypot(lower.se);
    assert_close("cascade and substrate", a.value, se, b.value);
}

/// The error of a cascade. It neglects where and in which direction light returns from the lower
/// layer, and that grains extend across the plane. Except for the grains at the plane, the
/// error vanishes if the lower layer reflects nothing or everything.
#[test]
fn cascades_deviate_little() {
    check_cascades(1_000, 0.02, &[0.0], &[0.002]);
}

#[test]
#[ignore = "long: eight times the walks and more snows, some 50 CPU-s"]
fn cascades_deviate_little_closely() {
    check_cascades(8_000, 0.2, &[0.0, 60.0], &[0.002, 0.005, 0.01]);
}

fn check_cascades(rays: u64, deep_m: f64, angles_deg: &[f64], surfaces_m: &[f64]) {
    let black = Snow {
        black_carbon: Some(Carbon::black(1e9)),
        ..dry()
    };
    let fine = |density| snow((60.0, 140.0), 0.5, density, 0.0);
    let basal = snow((900.0, 1000.0), 0.1, 375.0, 0.0);
    let deviation = |label: &str, snowpack: Snowpack, thickness_m, deg| {
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
        println!("cascade - continuous, {label}, {deg} degrees: {differences:.4?}");
        // the significant part, because the largest of a few differences is mostly noise
        differences
            .iter()
            .map(|d| d.value.abs() - 3.0 * d.se)
            .fold(0.0, f64::max)
    };
    assert!(deviation("on black", two_layers(dry(), black, 0.02), 0.03, 0.0) < 0.005);
    let on_deep_snow = deviation(
        "visible, on much fine snow",
        two_layers(fine(300.0), fine(300.0), deep_m),
        0.01 + deep_m,
        0.0,
    );
    let mut largest = on_deep_snow;
    for &deg in angles_deg {
        for &surface_m in surfaces_m {
            let snowpack = two_layers(fine(225.0), basal.clone(), 0.1);
            let label = format!("{} mm on basal", surface_m * 1e3);
            largest = largest.max(deviation(&label, snowpack, 0.1 + surface_m, deg));
        }
    }
    println!("largest deviation of cascades: {largest:.4}");
    assert!(largest < 0.02);
}

/// Chi-square of the scatter over seeds in units of the standard errors. Over a substrate the
/// errors of `spectral` treat R and T of the bare snowpack as independent, although they are
/// anticorrelated, so these errors may be too large.
#[test]
fn standard_errors_match_the_scatter_over_seeds() {
    const SEEDS: u64 = 24;
    let chi = ChiSquared::new((SEEDS - 1) as f64).unwrap();
    let (low, high) = (chi.inverse_cdf(1e-6), chi.inverse_cdf(1.0 - 1e-6));
    let substrate = Case {
        nm: vec![850.0],
        ..Case::new(on_substrate(dry(), Substrate::Grey(0.5)), 0.005)
    };
    let cascade = Case {
        nm: vec![850.0],
        ..Case::new(two_layers(dry(), dirty(), 0.003), 0.008).cascade()
    };
    for (label, case) in [("substrate", substrate), ("cascade", cascade)] {
        for engine in [Engine::Reference, Engine::Spectral] {
            let spectra: Vec<Spectrum> = (0..SEEDS)
                .map(|seed| case.with_engine(engine).run(4096, 100 + seed))
                .collect();
            for (quantity, value_of) in [
                ("R", (|s| s.reflectance[0]) as fn(&Spectrum) -> Measured),
                ("T", |s| s.transmittance[0]),
            ] {
                let values: Vec<Measured> = spectra.iter().map(value_of).collect();
                let mean = values.iter().map(|m| m.value).sum::<f64>() / SEEDS as f64;
                let sum: f64 = values
                    .iter()
                    .map(|m| ((m.value - mean) / m.se).powi(2))
                    .sum();
                let name = engine.name();
                println!("{label}, {name}, {quantity}: chi2 = {sum:.1} in [{low:.1}, {high:.1}]");
                assert!(sum < high, "{label}, {name}, {quantity}: {sum}");
                // the stated error is at most twice the scatter
                let least = if engine == Engine::Spectral {
                    low / 4.0
                } else {
                    low
                };
                assert!(sum > least, "{label}, {name}, {quantity}: {sum}");
            }
        }
    }
}
