//! CPU time of `spectral` and `reference` for the same standard error, and the
//! bias of `spectral` from dispersion: representative sample (Varsa 2025, chapter 7,
//! dry), normal incidence, 31 wavelengths 400-700 nm.
//!
//! `cargo run --release --example efficiency [THICKNESS_CM] [RAYS] [BIAS_RAYS]`
#![allow(clippy::unwrap_used, clippy::print_stdout)]
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::time::Instant;

use splitsnow::engine::{Cache, Control, Engine, MaxError, Request, Resolution};
use splitsnow::grain::{GrainType, Shape, SizeRange, TruncatedNormal};
use splitsnow::measurement::{Measured, Spectrum};
use splitsnow::transport::{Illumination, Model, Snow};

fn main() {
    let argument = |n: usize, default: f64| {
        std::env::args()
            .nth(n)
            .map_or(default, |text| text.parse().unwrap())
    };
    let thickness_m = argument(1, 12.0) / 100.0;
    let rays = argument(2, 10_000.0) as u64;
    let bias_rays = argument(3, 0.0) as u64;
    let snow = Snow::dry(
        GrainType {
            size: SizeRange::new(300e-6, 750e-6).unwrap(),
            facetness: TruncatedNormal::new(0.2, 0.4, 0.3, 0.072).unwrap(),
            shape: Shape::Spheroid,
            proportion: TruncatedNormal::new(0.6, 0.95, 0.798, 0.064).unwrap(),
        },
        275.0,
        -1.0,
    );
    let model = Model::default();
    let visible: Vec<f64> = (40..=70).map(|l| f64::from(l) * 10.0).collect();
    let (cancel, rays_done) = (AtomicBool::new(false), AtomicU64::new(0));
    let cache = Cache::default();
    let run = |engine: Engine, wavelengths_nm: &[f64], rays, seed| -> (f64, Spectrum) {
        let request = Request {
            snowpack: &snow.clone().into(),
            thicknesses_m: &[thickness_m],
            illuminations: &[Illumination::Collimated {
                polar_angle_rad: 0.0,
            }],
            resolution: Resolution::default(),
            max_error: MaxError::default(),
            wavelengths_nm,
            model: &model,
            rays,
            seed,
            cell: 0,
        };
        let control = Control {
            parallel: false,
            cancel: &cancel,
            rays_done: &rays_done,
            cache: &cache,
        };
        let start = Instant::now();
        let spectrum = engine.run(&request, &control).unwrap().pop().unwrap();
        (start.elapsed().as_secs_f64(), spectrum)
    };
    // seconds times variance of T: the time for a variance of 1
    let cost = |engine, rays| {
        let (seconds, spectrum) = run(engine, &visible, rays, 1);
        let se = |m: &Measured| m.se * m.se;
        let variance = spectrum.transmittance.iter().map(se).sum::<f64>() / 31.0;
        let rms = variance.sqrt();
        println!(
            "{}: {rays} rays, {seconds:.2} s, rms standard error of T {rms:.2e}",
            engine.name()
        );
        seconds * variance
    };
    let ratio = cost(Engine::Reference, rays) / cost(Engine::Spectral, 10 * rays);
    println!("reference / spectral CPU time at the same standard error: {ratio:.1}");
    if bias_rays > 0 {
        // compared with walks at each wavelength's own index, away from the outer nodes
        let mixed = run(Engine::Spectral, &visible, 8 * bias_rays, 2).1;
        let middle: Vec<usize> = (4..=16).collect();
        let (mut bias, mut variance) = (0.0, 0.0);
        for &l in &middle {
            let own = run(Engine::Spectral, &visible[l..=l], bias_rays, 3 + l as u64).1;
            let (a, b) = (mixed.transmittance[l], own.transmittance[0]);
            bias += (a.value / b.value - 1.0) / middle.len() as f64;
            variance += (b.se / b.value / middle.len() as f64).powi(2);
        }
        let common = mixed.transmittance[8].se / mixed.transmittance[8].value;
        let se = (variance + common * common).sqrt();
        println!("relative bias of T from dispersion, mean over 440-560 nm: {bias:.5} +- {se:.5}");
    }
}
