//! Speed and accuracy of the goniophotometer on 1000 sensors: counting of walks
//! (`spectral`) compared with scoring at every event (`tabulated`).
//!
//! cargo run --release --example goniometer > docs/goniometer.csv (a number after
//! `--` multiplies all numbers of walks)
//!
//! Columns: wavelength and incidence angle; engine, number of walks, CPU seconds of all
//! threads; the root mean square and the largest relative standard error of the BRDF over
//! the sensors within 80 degrees of the normal; the CPU seconds that a standard error of
//! 1 % in the worst sensor would take at this rate. The last columns compare with
//! `spectral` with the most walks: chi-square of the differences over sensor pairs, its
//! degrees of freedom, and z of R.
#![allow(clippy::unwrap_used, clippy::print_stdout)]
use std::sync::atomic::{AtomicBool, AtomicU64};

use cpu_time::ProcessTime;
use splitsnow::engine::exits::{Exits, goniometer};
use splitsnow::engine::{Cache, Control, Engine, MaxError, Request, Resolution};
use splitsnow::grain::{GrainType, Shape, SizeRange, TruncatedNormal};
use splitsnow::measurement::Sensors;
use splitsnow::transport::{Illumination, Model, Snow};

fn main() {
    let scale: f64 = std::env::args()
        .nth(1)
        .map_or(1.0, |text| text.parse().unwrap());
    let grain = GrainType {
        size: SizeRange::new(300e-6, 750e-6).unwrap(),
        facetness: TruncatedNormal::new(0.2, 0.4, 0.3, 0.072).unwrap(),
        shape: Shape::Spheroid,
        proportion: TruncatedNormal::new(0.6, 0.95, 0.798, 0.064).unwrap(),
    };
    let snowpack = Snow::dry(grain, 275.0, -1.0).into();
    let sensors = Sensors::new(1000);
    let (cancel, rays_done, cache) = (AtomicBool::new(false), AtomicU64::new(0), Cache::default());
    let control = Control {
        parallel: true,
        cancel: &cancel,
        rays_done: &rays_done,
        cache: &cache,
    };
    let run = |engine: Engine, nm: f64, deg: f64, rays: f64| {
        let request = Request {
            snowpack: &snowpack,
            thicknesses_m: &[0.12],
            illuminations: &[Illumination::Collimated {
                polar_angle_rad: deg.to_radians(),
            }],
            wavelengths_nm: &[nm],
            model: &Model::default(),
            rays: rays as u64,
            max_error: MaxError::default(),
            resolution: Resolution::default(),
            seed: 1,
            cell: 0,
        };
        let start = ProcessTime::now();
        let exits = goniometer(engine, &request, &sensors, &control)
            .unwrap()
            .remove(0);
        (exits, start.elapsed().as_secs_f64())
    };
    let is_steep = |s: &usize| sensors.centre_rad(*s)[0] < 80_f64.to_radians();
    let relative_errors = |exits: &Exits| -> Vec<f64> {
        let steep = (0..sensors.len()).filter(is_steep);
        steep
            .map(|s| exits.reflected[s].se / exits.reflected[s].value)
            .collect()
    };
    println!(
        "wavelength_nm,angle_deg,engine,walks,cpu_s,rms_relative_se,max_relative_se,cpu_s_for_1_percent,chi_square,degrees_of_freedom,z_reflectance"
    );
    for (nm, deg) in [(600.0, 0.0), (600.0, 60.0), (1300.0, 60.0), (1800.0, 60.0)] {
        let rays = [2e3, 2e4, 2e5].map(|rays| rays * scale);
        let mut runs: Vec<_> = rays
            .map(|rays| (Engine::Spectral, rays, run(Engine::Spectral, nm, deg, rays)))
            .into();
        let reference = runs[2].2.0.clone();
        for rays in [2e3, 1e4, 4e4].map(|rays| rays * scale) {
            runs.push((
                Engine::Tabulated,
                rays,
                run(Engine::Tabulated, nm, deg, rays),
            ));
        }
        for (engine, rays, (exits, cpu_s)) in &runs {
            let errors = relative_errors(exits);
            let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
            let largest = errors.iter().copied().fold(0.0, f64::max);
            let pairs = (0..sensors.len()).filter(|s| sensors.mirrored(*s) >= *s && is_steep(s));
            let (mut chi_square, mut count) = (0.0, 0);
            for s in pairs {
                let (a, b) = (&exits.reflected[s], &reference.reflected[s]);
                if engine == &Engine::Tabulated {
                    chi_square += (a.value - b.value).powi(2) / (a.se * a.se + b.se * b.se);
                    count += 1;
                }
            }
            let (a, b) = (&exits.reflectance, &reference.reflectance);
            let z = (a.value - b.value) / (a.se * a.se + b.se * b.se).sqrt();
            println!(
                "{nm},{deg},{},{rays},{cpu_s:.2},{rms:.4},{largest:.4},{:.1},{chi_square:.0},{count},{z:.2}",
                engine.name(),
                cpu_s * (largest / 0.01).powi(2)
            );
        }
    }
}
