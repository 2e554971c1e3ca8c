//! Corners of the parameter box and beyond, and both sides of every limit that an engine
//! enforces. `examples/stability` computes the complete map (docs/stability.md).
//!
//! Differences from `spectral` are compared with five joint standard errors (`judge::Z`) plus
//! the stated error of the engine. Seeds are fixed.
#![allow(missing_docs, dead_code, clippy::unwrap_used)]
#[path = "../examples/stability/cases.rs"]
mod cases;
#[path = "../examples/stability/judge.rs"]
mod judge;
#[path = "../examples/stability/numerics.rs"]
mod numerics;

use std::sync::atomic::{AtomicBool, AtomicU64};

use cases::{Case, absorbing, ordinary};
use judge::{Verdict, judge};
use splitsnow::engine::{
    Cache, Control, Engine, EngineError, MaxError, Request, Resolution, envelope,
};
use splitsnow::measurement::Spectrum;

/// Enough grain events for the numbers of rays used here.
const COARSE: Resolution = Resolution {
    table: 1 << 14,
    grains: 1 << 17,
    streams: 8,
};

/// Runs a case with the engine's limits enforced, as for a user.
fn run_checked(
    case: &Case,
    engine: Engine,
    rays: u64,
    resolution: Resolution,
) -> Result<Vec<Spectrum>, EngineError> {
    let request = Request {
        snowpack: &case.snowpack,
        thicknesses_m: &case.thicknesses_m,
        illuminations: &[case.light],
        wavelengths_nm: &case.wavelengths_nm,
        model: &case.model,
        rays,
        resolution,
        max_error: MaxError::default(),
        seed: 2,
        cell: 0,
    };
    let control = Control {
        parallel: true,
        cancel: &AtomicBool::new(false),
        rays_done: &AtomicU64::new(0),
        cache: &Cache::default(),
    };
    engine.run(&request, &control)
}

fn spectral(case: &Case, rays: u64) -> Vec<Spectrum> {
    case.run(Engine::Spectral, rays, COARSE, &Cache::default(), 1)
        .unwrap()
}

fn assert_all_hold(checks: Vec<numerics::Check>) {
    for check in checks {
        assert!(check.holds, "{}: {}", check.what, check.found);
    }
}

#[test]
fn the_slab_solver_handles_all_thicknesses_and_albedos() {
    assert_all_hold(numerics::solver());
}

#[test]
fn degenerate_matrices_are_decomposed() {
    assert_all_hold(numerics::decomposition());
}

#[test]
fn colours_near_black_are_accurate() {
    assert_all_hold(numerics::colours());
}

/// Every engine in every inexpensive corner: the result is correct, or rejected where the
/// map says so.
#[test]
#[ignore = "long: every corner, some 100 CPU-s"]
fn corners_of_the_box() {
    corners(16_000);
}

/// The same with a sixteenth of the walks.
#[test]
fn corners_of_the_box_roughly() {
    corners(1_000);
}

fn corners(walks: u64) {
    let expensive = [
        "depth 100 to 1000",
        "50-3000 um",
        "sphericity 0.05",
        "sphericity 0.3",
        "89.9 degrees",
    ];
    for mut case in cases::all() {
        if expensive.contains(&case.name.as_str()) {
            continue;
        }
        case.wavelengths_nm
            .retain(|nm| ![700.0, 1300.0].contains(nm));
        let reference = run_checked(&case, Engine::Spectral, walks, COARSE);
        let refused =
            ["89.99 degrees", "spheres in slabs of 0.99 grains"].contains(&case.name.as_str());
        assert_eq!(reference.is_err(), refused, "{}: {reference:?}", case.name);
        let reference = reference.unwrap_or_default();
        for engine in [Engine::Reference, Engine::Tabulated, Engine::Hybrid] {
            let rays = if engine == Engine::Reference {
                walks / 8
            } else {
                walks / 2
            };
            let result = run_checked(&case, engine, rays, COARSE);
            let judgement = judge(&case, engine, result, &reference);
            let expected = if refused {
                Verdict::Refused
            } else {
                Verdict::Holds
            };
            assert_eq!(
                judgement.verdict,
                expected,
                "{}, {}: {}",
                case.name,
                engine.name(),
                judgement.why
            );
        }
    }
}

/// Reflectance and transmittance decrease with absorption. Without absorption they sum to 1.
#[test]
fn fluxes_decrease_with_absorption_and_sum_to_one_without() {
    for saturation in [0.0, 0.5] {
        for engine in [Engine::Spectral, Engine::Tabulated, Engine::Hybrid] {
            let mut before: Option<Vec<Spectrum>> = None;
            for k in [1e-25, 1e-12, 1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 0.1] {
                let case = absorbing(k, saturation);
                let spectra = run_checked(&case, engine, 4096, COARSE).unwrap();
                assert_eq!(judge::impossible(&spectra, true), None, "{}", case.name);
                for (h, spectrum) in spectra.iter().enumerate() {
                    let (r, t) = (spectrum.reflectance[0], spectrum.transmittance[0]);
                    if k < 1e-20 {
                        let sum = r.value + t.value + spectrum.lost[0];
                        assert!((sum - 1.0).abs() < 1e-9, "{}: {sum}", engine.name());
                    }
                    if let Some(before) = &before {
                        let label = format!("{} {} {h}", engine.name(), case.name);
                        for (now, then) in [
                            (r, before[h].reflectance[0]),
                            (t, before[h].transmittance[0]),
                        ] {
                            let increases = now.value > then.value;
                            assert!(
                                !increases || judge::excess(engine, now, then) < 0.0,
                                "{label}"
                            );
                        }
                    }
                }
                before = Some(spectra);
            }
        }
    }
}

/// A slab thinner than its thinnest grain is empty and transmits all light. A slightly
/// thicker one contains grains, and the engines agree on it.
#[test]
fn slabs_too_thin_for_a_grain_are_rejected() {
    let spheres = cases::snow(
        [500.0; 2],
        [0.3, 0.3, 0.3, 0.0],
        [1.0, 1.0, 1.0, 0.0],
        275.0,
    );
    let slab =
        |grains: f64| Case::new("thin", spheres.clone(), 0.0, &[], &[550.0]).in_grains(&[grains]);
    for engine in Engine::ALL {
        let empty = slab(0.999).run(engine, 1000, COARSE, &Cache::default(), 1);
        // walks of `hybrid` carry weights, whose sum is rounded
        let transmitted = empty.unwrap()[0].transmittance[0].value;
        assert!((transmitted - 1.0).abs() < 1e-14, "{transmitted}");
        let error = run_checked(&slab(0.999), engine, 1000, COARSE).unwrap_err();
        assert!(
            matches!(
                error,
                EngineError::Outside {
                    lowest: 1.0,
                    instead: None,
                    ..
                }
            ),
            "{error}"
        );
        let case = slab(1.1);
        let reference = spectral(&case, 40_000);
        assert!(reference[0].reflectance[0].value > 1e-3, "{reference:?}");
        let judgement = judge(
            &case,
            engine,
            run_checked(&case, engine, 20_000, COARSE),
            &reference,
        );
        assert_eq!(judgement.verdict, Verdict::Holds, "{}", judgement.why);
    }
}

/// Grazing light: inside the limit the engines agree; just outside they reject the request;
/// far outside no grain fits under the surface.
#[test]
fn too_grazing_light_is_rejected() {
    let snow = ordinary();
    let case_at = |first_flight: f64| {
        let cosine = first_flight * snow.sizes_m()[1] / snow.mean_free_distance_m();
        Case::new(
            "grazing",
            snow.clone(),
            cosine.acos().to_degrees(),
            &[5.0],
            &[2000.0],
        )
    };
    let assert_holds = |first_flight: f64, engine: Engine| {
        let case = case_at(first_flight);
        let reference = spectral(&case, 4000);
        let judgement = judge(
            &case,
            engine,
            run_checked(&case, engine, 2000, COARSE),
            &reference,
        );
        assert_eq!(judgement.verdict, Verdict::Holds, "{}", judgement.why);
    };
    for engine in [Engine::Reference, Engine::Spectral] {
        assert_holds(1.01 * envelope::FIRST_FLIGHT, engine);
        let error = run_checked(
            &case_at(0.99 * envelope::FIRST_FLIGHT),
            engine,
            1000,
            COARSE,
        )
        .unwrap_err();
        assert!(
            matches!(error, EngineError::Outside { instead: None, .. }),
            "{error}"
        );
        // the angle that the message allows is within the limit
        let EngineError::Outside {
            most_deg: Some(most),
            lowest,
            ..
        } = error
        else {
            panic!("{error}");
        };
        let flight = snow.mean_free_distance_m() / snow.sizes_m()[1];
        let at = |degrees: f64| degrees.to_radians().cos() * flight;
        assert!(
            at(most) >= lowest && at(most + 0.01) < lowest,
            "{most} degrees"
        );
        let far_outside = case_at(0.15 * envelope::FIRST_FLIGHT);
        let error = far_outside
            .run(engine, 1000, COARSE, &Cache::default(), 1)
            .unwrap_err();
        assert!(matches!(error, EngineError::SlabTooThin { .. }), "{error}");
    }
    let fitting = envelope::MIN_FITTING_ENTRIES / (2.0 * f64::from(COARSE.table));
    for engine in [Engine::Tabulated, Engine::Hybrid] {
        assert_holds(1.01 * fitting, engine);
        let error = run_checked(&case_at(0.99 * fitting), engine, 1000, COARSE).unwrap_err();
        let instead = Some(Engine::Spectral);
        assert!(
            matches!(error, EngineError::Outside { instead: i, .. } if i == instead),
            "{error}"
        );
    }
    // the reason for the limit: a few grains represent all, and whether they do so well
    // depends on the seed
    let case = case_at(1.01 * envelope::FIRST_FLIGHT);
    let reference = spectral(&case, 40_000);
    let few = Resolution {
        table: 4096,
        ..COARSE
    };
    let wrong = |seed: &u64| {
        let result = case.run(Engine::Tabulated, 20_000, few, &Cache::default(), *seed);
        judge(&case, Engine::Tabulated, result, &reference).verdict != Verdict::Holds
    };
    let wrong = (2..10).filter(wrong).count();
    assert!(wrong >= 1, "wrong with {wrong} of 8 seeds");
}

/// With the smallest table allowed, the rms error over seeds is at most what 0.1 / sqrt(N)
/// and the number of rays make likely. With ten entries it is larger.
#[test]
fn too_small_tables_are_rejected() {
    let case = Case::new("table", ordinary(), 0.0, &[5.0], &[550.0]);
    let best = spectral(&case, 400_000)[0].reflectance[0];
    let with_table = |table| Resolution { table, ..COARSE };
    for engine in [Engine::Tabulated, Engine::Hybrid] {
        let rms = |table: u32| {
            let squares = (0..4).map(|seed| {
                let spectra = case.run(
                    engine,
                    40_000,
                    with_table(table),
                    &Cache::default(),
                    100 + seed,
                );
                (spectra.unwrap()[0].reflectance[0].value - best.value).powi(2)
            });
            (squares.sum::<f64>() / 4.0).sqrt()
        };
        // rms of four: above 2.5 standard deviations once in 10^4; 0.0023 is the error of 40,000 rays
        let inside = 0.1 / f64::from(envelope::MIN_TABLE_ENTRIES).sqrt();
        let noise = inside.hypot(0.0023).hypot(best.se);
        let (good, bad) = (rms(envelope::MIN_TABLE_ENTRIES), rms(10));
        assert!(good < 2.5 * noise, "{}: {good} {noise}", engine.name());
        assert!(bad > 2.5 * noise, "{}: {bad}", engine.name());
        assert!(run_checked(&case, engine, 1000, with_table(envelope::MIN_TABLE_ENTRIES)).is_ok());
        let error = run_checked(
            &case,
            engine,
            1000,
            with_table(envelope::MIN_TABLE_ENTRIES - 1),
        )
        .unwrap_err();
        assert!(
            matches!(
                error,
                EngineError::Outside {
                    instead: Some(Engine::Spectral),
                    ..
                }
            ),
            "{error}"
        );
    }
}
