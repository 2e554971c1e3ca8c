//! Results of Varsa (PhD thesis, University of Waterloo, 2025) for a single dry or wet layer.
//!
//! A trend must be significant. Differences are compared with a multiple of their standard
//! errors, chosen so that all comparisons together fail by chance with probability [`ALPHA`]
//! (Bonferroni correction for [`COMPARISONS`]). If a change is too small to be significant,
//! only a significant change in the opposite direction fails. Seeds are fixed.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use crate::snow::{NORMAL, beam, dry, snow, spectra, z_limit};
use splitsnow::grain::mean_free_distance_m;
use splitsnow::measurement::{Measured, Spectrum};
use splitsnow::transport::Snow;

/// Probability that any comparison fails although the trend is real.
const ALPHA: f64 = 1e-6;
/// Upper bound of the number of comparisons.
const COMPARISONS: usize = 300;

/// The representative sample with grains of `size_um` +- 50.
fn sized(size_um: f64, density_kg_m3: f64) -> Snow {
    let size = (size_um - 50.0, size_um + 50.0);
    snow(size, 0.3, density_kg_m3, 0.0)
}

/// The spectrum at normal incidence.
fn spectrum(snow: &Snow, thickness_m: f64, wavelengths_nm: &[f64], rays: u64) -> Spectrum {
    spectra(snow, &[thickness_m], NORMAL, wavelengths_nm, rays).remove(0)
}

fn show(name: &str, values: &[Measured]) {
    print!("{name}:");
    values
        .iter()
        .for_each(|m| print!(" {:.4}({:.0})", m.value, m.se * 1e4));
    println!();
}

/// Whether `more` significantly exceeds `less` (if `significant`), or is at least not
/// significantly below it.
fn exceeds(more: Measured, less: Measured, significant: bool) -> bool {
    let limit = z_limit(ALPHA, COMPARISONS) * more.se.hypot(less.se);
    more.value - less.value > if significant { limit } else { -limit }
}

/// Asserts that no curve is significantly below the previous one, and that the last is
/// significantly above the first at the wavelengths selected by `significant`.
fn assert_increasing(
    name: &str,
    curves: &[Vec<Measured>],
    wavelengths_nm: &[f64],
    significant: impl Fn(f64) -> bool,
) {
    curves.iter().for_each(|curve| show(name, curve));
    for (l, nm) in wavelengths_nm.iter().enumerate() {
        for pair in curves.windows(2) {
            let (less, more) = (pair[0][l], pair[1][l]);
            assert!(
                exceeds(more, less, false),
                "{name} at {nm} nm: {less:?} {more:?}"
            );
        }
        let (least, most) = (curves[0][l], curves[curves.len() - 1][l]);
        assert!(
            !significant(*nm) || exceeds(most, least, true),
            "{name} at {nm} nm: {least:?} {most:?}"
        );
    }
}

/// The wavelength of the largest difference between the first and the last curve.
fn wavelength_of_largest_difference(curves: &[Vec<Measured>], wavelengths_nm: &[f64]) -> f64 {
    let gap = |l: usize| (curves[curves.len() - 1][l].value - curves[0][l].value).abs();
    let indices = 0..wavelengths_nm.len();
    wavelengths_nm[indices.max_by(|a, b| gap(*a).total_cmp(&gap(*b))).unwrap()]
}

/// Appendix B: "roughly 4.3e-4 m". With its misprints corrected the formula gives 4.37e-4 m.
#[test]
fn mean_free_distance_matches_appendix_b() {
    let d = mean_free_distance_m(&dry().grains[0].grain, 450.0, -1.0);
    println!("mean free distance: {d:e} m");
    assert!((d - 4.37e-4).abs() < 0.005e-4);
}

/// Section 7.1: 25 cm of the representative sample at 62.3 degrees. The tolerance of 0.03
/// covers the differences between interpretations of the model.
#[test]
fn reflectance_at_three_wavelengths_matches_the_thesis() {
    let sample = snow((300.0, 750.0), 0.3, 275.0, 0.05);
    let wavelengths_nm = [842.25, 1037.76, 1237.93];
    let ours = &spectra(&sample, &[0.25], beam(62.3), &wavelengths_nm, 40_000)[0].reflectance;
    show("R at 842.25, 1037.76, 1237.93 nm", ours);
    for (m, published) in ours.iter().zip([0.878, 0.692, 0.495]) {
        assert!(m.se < 0.003);
        assert!((m.value - published).abs() < 0.03, "{m:?} {published}");
    }
}

const BROAD_NM: [f64; 8] = [450.0, 600.0, 800.0, 900.0, 1030.0, 1250.0, 1600.0, 2200.0];

/// Reflectance decreases with grain size, most at 700-1300 nm.
#[test]
fn reflectance_decreases_with_grain_size() {
    let curves = [500.0, 300.0, 200.0, 100.0]
        .map(|size| spectrum(&sized(size, 275.0), 0.12, &BROAD_NM, 10_000).reflectance);
    assert_increasing("R, 500 to 100 um", &curves, &BROAD_NM, |nm| nm > 700.0);
    assert!((700.0..=1300.0).contains(&wavelength_of_largest_difference(&curves, &BROAD_NM)));
}

/// Reflectance increases with facetness, most at 700-1300 nm. Above 0.5 it changes by less
/// than 0.01.
#[test]
fn reflectance_increases_with_facetness() {
    let reflectance = |facetness| {
        let sample = snow((300.0, 750.0), facetness, 275.0, 0.0);
        spectrum(&sample, 0.12, &BROAD_NM, 20_000).reflectance
    };
    let curves = [0.1, 0.3, 0.5].map(reflectance);
    assert_increasing("R, F 0.1 to 0.5", &curves, &BROAD_NM, |nm| nm > 700.0);
    assert!((700.0..=1300.0).contains(&wavelength_of_largest_difference(&curves, &BROAD_NM)));
    let most_faceted = reflectance(0.9);
    show("R, F 0.9", &most_faceted);
    for (a, b) in curves[2].iter().zip(&most_faceted) {
        let limit = 0.01 + z_limit(ALPHA, COMPARISONS) * a.se.hypot(b.se);
        assert!((a.value - b.value).abs() < limit, "{a:?} {b:?}");
    }
}

/// Density hardly changes the reflectance of 12 cm: the RMSE between 300 and 450 kg/m3 is
/// below 0.007. Noise can only increase the measured RMSE.
#[test]
fn density_hardly_changes_reflectance() {
    let wavelengths_nm: Vec<f64> = (0..15).map(|i| 400.0 + 150.0 * f64::from(i)).collect();
    let [light, dense] = [300.0, 450.0].map(|density| {
        let sample = snow((300.0, 750.0), 0.3, density, 0.0);
        spectrum(&sample, 0.12, &wavelengths_nm, 40_000).reflectance
    });
    show("R at 300 kg/m3", &light);
    show("R at 450 kg/m3", &dense);
    let n = wavelengths_nm.len() as f64;
    let pairs = || light.iter().zip(&dense);
    let rmse = (pairs()
        .map(|(a, b)| (a.value - b.value).powi(2))
        .sum::<f64>()
        / n)
        .sqrt();
    let noise = (pairs()
        .map(|(a, b)| a.se.powi(2) + b.se.powi(2))
        .sum::<f64>()
        / n)
        .sqrt();
    let relative = pairs()
        .map(|(a, b)| (b.value / a.value - 1.0).abs())
        .sum::<f64>()
        / n;
    println!(
        "300 and 450 kg/m3: RMSE {rmse:.4} (noise {noise:.4}), mean {:.1} %",
        100.0 * relative
    );
    assert!(rmse < 0.007);
}

/// In the model, temperature only changes the density of ice, by 0.6 %. Between -40 and 0 C,
/// R and T change by less than 0.005.
#[test]
fn temperature_hardly_changes_reflectance_and_transmittance() {
    let wavelengths_nm = [450.0, 700.0, 1030.0, 1600.0];
    let [cold, warm] = [-40.0, 0.0].map(|temperature_c| {
        let sample = Snow {
            temperature_c,
            ..dry()
        };
        spectrum(&sample, 0.03, &wavelengths_nm, 40_000)
    });
    for (a, b) in [
        (&cold.reflectance, &warm.reflectance),
        (&cold.transmittance, &warm.transmittance),
    ] {
        show("-40 C", a);
        show("  0 C", b);
        for (a, b) in a.iter().zip(b) {
            let limit = 0.005 + z_limit(ALPHA, COMPARISONS) * a.se.hypot(b.se);
            assert!((a.value - b.value).abs() < limit, "{a:?} {b:?}");
        }
    }
}

const VISIBLE_NM: [f64; 4] = [400.0, 500.0, 600.0, 700.0];

/// Transmittance decreases with thickness. Its mean over the visible about halves (0.4-0.6)
/// when the thickness doubles. At 700 nm, where ice absorbs, it decreases to 0.29 from 5 to
/// 10 cm.
#[test]
fn transmittance_decreases_with_thickness() {
    let thicknesses_m = [0.0125, 0.025, 0.05, 0.1];
    let slabs = spectra(&dry(), &thicknesses_m, NORMAL, &VISIBLE_NM, 40_000);
    slabs
        .iter()
        .for_each(|slab| show("T, 12.5 to 100 mm", &slab.transmittance));
    let visible = |slab: &Spectrum| slab.transmittance.iter().map(|m| m.value).sum::<f64>();
    for pair in slabs.windows(2) {
        for (thin, thick) in pair[0].transmittance.iter().zip(&pair[1].transmittance) {
            assert!(exceeds(*thin, *thick, true));
        }
        let ratio = visible(&pair[1]) / visible(&pair[0]);
        println!("ratio {ratio:.3}");
        assert!((0.4..0.6).contains(&ratio), "{ratio}");
    }
}

/// Transmittance increases with grain size.
#[test]
fn transmittance_increases_with_grain_size() {
    let curves = [100.0, 200.0, 300.0, 500.0]
        .map(|size| spectrum(&sized(size, 275.0), 0.02, &VISIBLE_NM, 15_000).transmittance);
    assert_increasing("T, 100 to 500 um", &curves, &VISIBLE_NM, |_| true);
}

/// Transmittance decreases with density at constant grain size, but increases if the grains
/// grow with the density.
#[test]
fn transmittance_depends_on_density_and_grain_size() {
    let curves = [400.0, 300.0, 200.0].map(|density| {
        let sample = snow((300.0, 750.0), 0.3, density, 0.0);
        spectrum(&sample, 0.02, &VISIBLE_NM, 30_000).transmittance
    });
    assert_increasing("T, 400 to 200 kg/m3", &curves, &VISIBLE_NM, |_| true);
    let curves = [sized(100.0, 200.0), sized(500.0, 400.0)]
        .map(|sample| spectrum(&sample, 0.02, &VISIBLE_NM, 15_000).transmittance);
    assert_increasing(
        "T, (100 um, 200) to (500 um, 400)",
        &curves,
        &VISIBLE_NM,
        |_| true,
    );
}

/// Water between the grains reduces the contrast of the refractive index, which increases
/// the visible transmittance of 2 cm. In the absorption bands at 980 and 1200 nm water
/// decreases it. The thesis reports a decrease over 800-1450 nm; with the absorption of
/// Segelstein, used here, the reduced contrast dominates between the bands.
#[test]
fn water_increases_transmittance_outside_its_absorption_bands() {
    let wavelengths_nm = [
        400.0, 500.0, 600.0, 800.0, 900.0, 980.0, 1030.0, 1100.0, 1200.0,
    ];
    let in_band = |nm: f64| nm == 980.0 || nm == 1200.0;
    let mut curves = [0.0, 0.15, 0.3].map(|wet| {
        let sample = snow((300.0, 750.0), 0.3, 275.0, wet);
        spectrum(&sample, 0.02, &wavelengths_nm, 30_000).transmittance
    });
    let pick = |curves: &[Vec<Measured>; 3], inside: bool| {
        let indices = || wavelengths_nm.into_iter().enumerate();
        let selected = || indices().filter(move |(_, nm)| in_band(*nm) == inside);
        let values = |curve: &Vec<Measured>| selected().map(|(l, _)| curve[l]).collect();
        let nm: Vec<f64> = selected().map(|(_, nm)| nm).collect();
        (curves.each_ref().map(values), nm)
    };
    let (outside, nm) = pick(&curves, false);
    assert_increasing("T outside the bands, S 0 to 0.3", &outside, &nm, |_| true);
    curves.reverse();
    let (inside, nm) = pick(&curves, true);
    assert_increasing("T in the bands, S 0.3 to 0", &inside, &nm, |_| true);
}

/// Blue light penetrates deepest: at 10 cm the transmittance is largest at 400-500 nm and
/// decreases from there to the infrared.
#[test]
fn blue_light_penetrates_deepest() {
    let wavelengths_nm = [
        400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 700.0, 800.0, 900.0,
    ];
    for (size, density, rays) in [(500.0, 400.0, 20_000), (100.0, 100.0, 25_000)] {
        let t = spectrum(&sized(size, density), 0.1, &wavelengths_nm, rays).transmittance;
        show("T at 10 cm", &t);
        let deepest = (0..t.len())
            .max_by(|a, b| t[*a].value.total_cmp(&t[*b].value))
            .unwrap();
        assert!(wavelengths_nm[deepest] <= 500.0);
        for (shorter, longer) in [(1, 6), (6, 7), (7, 8)] {
            assert!(
                exceeds(t[shorter], t[longer], true),
                "{} nm",
                wavelengths_nm[longer]
            );
        }
    }
}
