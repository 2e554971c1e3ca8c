//! The solver compared with closed forms.
use splitsnow::slab::{Light, Medium, Streams};

use super::{PAGE, collimated, largest_difference};
use crate::quoted::assert_says;

#[test]
fn a_medium_without_scattering_only_absorbs() {
    let streams = Streams::new(8).unwrap();
    let black = Medium::new(&streams, &[0.0, 0.0]).unwrap();
    let weakly_scattering = Medium::new(&streams, &[1e-9, 0.8e-9, 0.5e-9]).unwrap();
    for thickness in [1e-12, 0.5, 20.0] {
        let operators = black.operators(thickness).unwrap();
        for (i, mu) in streams.cosines().iter().enumerate() {
            for j in 0..8 {
                let exact = if i == j { (-thickness / mu).exp() } else { 0.0 };
                assert!(
                    (operators.transmission[(i, j)] - exact).abs()
                        <= 1e-15 * exact * (thickness / mu).max(1.0)
                );
                assert_eq!(operators.reflection[(i, j)], 0.0);
            }
        }
        let other = weakly_scattering.operators(thickness).unwrap();
        // at most the scattered light
        let scattered = 1e-9 * thickness.min(1.0) / streams.cosines()[0];
        for (a, b) in [
            (&operators.transmission, &other.transmission),
            (&operators.reflection, &other.reflection),
        ] {
            assert!(largest_difference(a, b) < scattered + 1e-14);
        }
    }
}

/// A thin layer that scatters isotropically reflects half of the light that it scatters,
/// albedo tau / mu0. The error is of the order of tau / mu of the streams.
#[test]
fn thin_slabs_match_single_scattering() {
    let streams = Streams::new(16).unwrap();
    let medium = Medium::new(&streams, &[0.6]).unwrap();
    for cosine in [1.0, 0.37] {
        let thickness = 1e-7;
        let fluxes = medium.fluxes(thickness, collimated(cosine)).unwrap();
        let half = 0.3 * thickness / cosine;
        let error = thickness / streams.cosines()[0] * 2.0;
        assert!(
            (fluxes.reflectance / half - 1.0).abs() < error,
            "{fluxes:?}"
        );
        let scattered = fluxes.transmittance - (-thickness / cosine).exp();
        assert!((scattered / half - 1.0).abs() < error, "{fluxes:?}");
    }
}

/// Albedo of an isotropically scattering half-space, 1 - H(mu) sqrt(1 - albedo)
/// (Chandrasekhar 1960, section 33), with H from its integral equation.
#[test]
fn half_spaces_match_chandrasekhars_h_function() {
    // quadrature over mu = x^3, which removes the logarithmic singularity of H at 0
    let fine = Streams::new(64).unwrap();
    let nodes = fine.cosines().iter().zip(fine.weights());
    let nodes: Vec<(f64, f64)> = nodes.map(|(x, w)| (x.powi(3), 3.0 * x * x * w)).collect();
    let h_function = |albedo: f64, h: &[f64], mu: f64| {
        let pairs = nodes.iter().zip(h);
        let sum: f64 = pairs.map(|((m, w), h)| w * m * h / (mu + m)).sum();
        1.0 / ((1.0 - albedo).sqrt() + 0.5 * albedo * sum)
    };
    let solution = |albedo: f64| {
        let mut h = vec![1.0_f64; 64];
        for _ in 0..2000 {
            let next = nodes.iter().map(|(mu, _)| h_function(albedo, &h, *mu));
            h = h.iter().zip(next).map(|(a, b)| 0.5 * (a + b)).collect();
        }
        h
    };
    // Chandrasekhar 1960, table XI: H(1) to its five digits
    assert!((h_function(1.0, &solution(1.0), 1.0) - 2.9078).abs() < 5e-5);
    let mut worst = [0.0_f64; 2];
    for albedo in [0.3, 0.8, 0.95, 0.999] {
        let h = solution(albedo);
        for cosine in [0.1, 0.5, 1.0] {
            let exact = 1.0 - h_function(albedo, &h, cosine) * (1.0 - albedo).sqrt();
            let [few, many] = [8, 32].map(|n| {
                let streams = Streams::new(n).unwrap();
                let medium = Medium::new(&streams, &[albedo]).unwrap();
                let light = collimated(cosine);
                let fluxes = medium.fluxes(f64::INFINITY, light).unwrap();
                assert_eq!(fluxes.transmittance, 0.0);
                (fluxes.reflectance - exact).abs()
            });
            // the error decreases at least as n^-4: by 256 from 8 to 32 streams
            assert!(
                many < 1e-9 && few < 2e-6,
                "{albedo} {cosine}: {few:e} {many:e}"
            );
            assert!(256.0 * many < few, "{albedo} {cosine}: {few:e} {many:e}");
            worst = [worst[0].max(few), worst[1].max(many)];
        }
    }
    assert_says(PAGE, "Chandrasekhar's H", worst);
}

/// Isotropic conservative slabs: T of isotropic light is (4/3) / (tau + 2 q) with
/// q = 0.7104460896 from the Milne problem (e.g. Case and Zweifel 1967), up to terms that
/// decrease as exp(-tau).
#[test]
fn conservative_slabs_match_milnes_extrapolation_length() {
    let q = |n: usize, thickness: f64| {
        let streams = Streams::new(n).unwrap();
        let medium = Medium::new(&streams, &[1.0]).unwrap();
        let fluxes = medium.fluxes(thickness, Light::Diffuse).unwrap();
        0.5 * (4.0 / 3.0 / fluxes.transmittance - thickness)
    };
    let mut worst = [0.0_f64; 5];
    for thickness in [100.0, 1e4] {
        let errors = [4, 8, 16, 32, 64].map(|n| (q(n, thickness) - 0.710_446_089_6).abs());
        // at least as n^-5, down to the digits of the constant
        for pair in errors.windows(2) {
            assert!(pair[1] < 1e-10 || pair[1] < pair[0] / 32.0, "{errors:?}");
        }
        assert!(errors[4] < 1e-10, "{errors:?}");
        worst = std::array::from_fn(|i| worst[i].max(errors[i]));
    }
    assert_says(PAGE, "Milne, 8 and 16 streams", [worst[1], worst[2]]);
    println!("Milne: {worst:?}");
}

/// Deep in the medium light decays at the rate k that solves
/// (albedo / 2k) ln((1 + k) / (1 - k)) = 1. The streams integrate this logarithm by Gauss
/// quadrature, which converges geometrically unless k is close to 1.
#[test]
fn the_decay_rate_matches_the_characteristic_equation() {
    let streams = Streams::new(16).unwrap();
    for albedo in [0.8, 0.9, 0.999] {
        let (mut low, mut high) = (1e-9, 1.0 - 1e-12);
        for _ in 0..200 {
            let k: f64 = 0.5 * (low + high);
            let left = albedo * k.atanh() / k;
            if left < 1.0 { low = k } else { high = k }
        }
        let medium = Medium::new(&streams, &[albedo]).unwrap();
        let t = |thickness: f64| {
            medium
                .fluxes(thickness, Light::Diffuse)
                .unwrap()
                .transmittance
        };
        let rate = (t(600.0) / t(601.0)).ln();
        // faster modes have decayed by exp(-600 (1 - k)), below 1e-70
        assert!((rate - low).abs() < 1e-10, "{albedo}: {rate} {low}");
    }
}
