//! A half-space: the limit of a slab of growing thickness, in every engine.
use std::sync::atomic::{AtomicBool, AtomicU64};

use splitsnow::engine::{Cache, Control, Engine, MaxError, Request, Resolution};
use splitsnow::grain::{GrainType, Shape, SizeRange, TruncatedNormal};
use splitsnow::measurement::Spectrum;
use splitsnow::transport::{Illumination, Layer, Model, Snow, Snowpack, Substrate};
use splitsnow::units::HALF_SPACE_M;

fn snow(size_um: [f64; 2], facetness: f64, sphericity: f64, density_kg_m3: f64) -> Snow {
    let constant = |value| TruncatedNormal::new(value, value, value, 0.0).unwrap();
    let grain = GrainType {
        size: SizeRange::new(size_um[0] * 1e-6, size_um[1] * 1e-6).unwrap(),
        facetness: constant(facetness),
        shape: Shape::Spheroid,
        proportion: constant(sphericity),
    };
    Snow::dry(grain, density_kg_m3, -1.0)
}

fn run(
    engine: Engine,
    snowpack: &Snowpack,
    thicknesses_m: &[f64],
    nm: &[f64],
    rays: u64,
) -> Vec<Spectrum> {
    let request = Request {
        snowpack,
        thicknesses_m,
        illuminations: &[Illumination::Collimated {
            polar_angle_rad: 0.5,
        }],
        wavelengths_nm: nm,
        model: &Model::default(),
        rays,
        max_error: MaxError::default(),
        resolution: Resolution {
            table: 1 << 14,
            grains: 1 << 17,
            ..Resolution::default()
        },
        seed: 3,
        cell: 0,
    };
    let control = Control {
        parallel: false,
        cancel: &AtomicBool::new(false),
        rays_done: &AtomicU64::new(0),
        cache: &Cache::default(),
    };
    engine.run(&request, &control).unwrap()
}

/// [`HALF_SPACE_M`] is thick enough. A slab of a quarter of this thickness has the same
/// reflectance, and the half-space transmits no light. This holds even for the most
/// transparent snow that a config file allows: large smooth spheres at the lowest density,
/// at the wavelengths where ice absorbs least.
#[test]
fn a_half_space_is_thick_enough() {
    let nm = [350.0, 400.0, 700.0, 1030.0, 2000.0];
    for snow in [
        snow([6000.0, 6000.0], 0.0, 1.0, 50.0),
        snow([150.0, 350.0], 0.3, 0.8, 300.0),
    ] {
        let thicknesses = [0.25 * HALF_SPACE_M, HALF_SPACE_M];
        let found = run(Engine::Hybrid, &snow.into(), &thicknesses, &nm, 1024);
        for (l, nm) in nm.iter().enumerate() {
            let [quarter, half_space] = [0, 1].map(|h| found[h].reflectance[l].value);
            assert!(
                (quarter - half_space).abs() < 1e-12,
                "{nm} nm: {quarter} {half_space}"
            );
            assert!(
                half_space > 0.0 && half_space < 1.0,
                "{nm} nm: {half_space}"
            );
            let transmittance = found[1].transmittance[l];
            assert!(
                transmittance.value < 1e-50 && transmittance.se < 1e-50,
                "{nm} nm: {transmittance:?}"
            );
        }
    }
}

/// Walks in a half-space agree with the solver. The z-test allows for the solver's own error
/// of 1.5e-3 (docs/stability.md). The half-space is alone, and then the base of a snowpack
/// on a substrate that no light reaches.
#[test]
fn walks_agree_with_the_solver() {
    let base = snow([150.0, 350.0], 0.3, 0.8, 300.0);
    let snowpack = Snowpack {
        surface: snow([100.0, 150.0], 0.5, 0.7, 200.0),
        below: vec![Layer {
            snow: base.clone(),
            thickness_m: HALF_SPACE_M,
        }],
        substrate: Substrate::Grey(0.5),
    };
    let nm = [800.0, 1030.0, 1300.0];
    for (snowpack, thickness_m) in [(base.into(), HALF_SPACE_M), (snowpack, HALF_SPACE_M + 0.01)] {
        let simulate = |engine, rays| run(engine, &snowpack, &[thickness_m], &nm, rays).remove(0);
        let solved = simulate(Engine::Hybrid, 4096);
        for engine in [Engine::Reference, Engine::Spectral, Engine::Tabulated] {
            let walked = simulate(engine, 3000);
            for (l, nm) in nm.iter().enumerate() {
                let (a, b) = (solved.reflectance[l], walked.reflectance[l]);
                let error = (a.se * a.se + b.se * b.se + 1.5e-3 * 1.5e-3_f64).sqrt();
                let z = (a.value - b.value) / error;
                println!(
                    "{} {nm} nm: {:.4} {:.4} z {z:.1}",
                    engine.name(),
                    a.value,
                    b.value
                );
                assert!(z.abs() < 4.5, "{} {nm} nm: {a:?} {b:?}", engine.name());
                assert_eq!(walked.transmittance[l].value, 0.0);
                assert_eq!(walked.lost[l], 0.0);
            }
        }
    }
}
