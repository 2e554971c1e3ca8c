//! The goniophotometer: sensors, sums over sensors, symmetries, limiting cases,
//! reciprocity, standard errors, and agreement of the engines. tests/studies.rs checks the
//! published trends.
//!
//! The standard errors come from 32 parts (31 degrees of freedom). A difference divided by
//! its standard error therefore follows Student's t distribution, whose square has mean
//! 31/29. For the difference of two such runs this is approximate.
#![allow(clippy::unwrap_used)]

use std::f64::consts::{PI, TAU};
use std::sync::atomic::{AtomicBool, AtomicU64};

use crate::snow::{NORMAL, beam, dry, snow, z_limit};
use proptest::prelude::*;
use splitsnow::engine::exits::{self, Exits, goniometer, radial_profile};
use splitsnow::engine::{Cache, Control, Engine, EngineError, MaxError, Request, Resolution};
use splitsnow::math::Vec3;
use splitsnow::measurement::{Measured, Radii, Sensors, Views};
use splitsnow::optics::Carbon;
use splitsnow::transport::{
    Component, Entry, Illumination, Joining, Layer, Model, Snow, Snowpack, Substrate,
};

/// Probability that a test fails although the code is correct.
const ALPHA: f64 = 1e-4;

struct Setup {
    snowpack: Snowpack,
    thickness_m: f64,
    light: Illumination,
    wavelengths_nm: Vec<f64>,
    model: Model,
    rays: u64,
    seed: u64,
}

impl Setup {
    fn new(snow: Snow, thickness_m: f64, light: Illumination, nm: &[f64], rays: u64) -> Self {
        Self {
            snowpack: snow.into(),
            thickness_m,
            light,
            wavelengths_nm: nm.to_vec(),
            model: Model::default(),
            rays,
            seed: 2025,
        }
    }

    /// Small tables for runs of few walks, which are only tested for equality.
    fn resolution(&self) -> Resolution {
        let of_rays = Resolution::for_rays(self.rays);
        match self.rays {
            0..=100 => Resolution {
                table: 1 << 10,
                grains: 1 << 13,
                ..of_rays
            },
            _ => of_rays,
        }
    }

    /// Calls `run` with the request and the control of this setup.
    fn with<T>(&self, run: impl FnOnce(&Request, &Control) -> T) -> T {
        let request = Request {
            snowpack: &self.snowpack,
            thicknesses_m: &[self.thickness_m],
            illuminations: &[self.light],
            wavelengths_nm: &self.wavelengths_nm,
            model: &self.model,
            rays: self.rays,
            max_error: MaxError::default(),
            resolution: self.resolution(),
            seed: self.seed,
            cell: 0,
        };
        let (cancel, rays_done) = (AtomicBool::new(false), AtomicU64::new(0));
        let cache = Cache::default();
        run(
            &request,
            &Control {
                parallel: true,
                cancel: &cancel,
                rays_done: &rays_done,
                cache: &cache,
            },
        )
    }

    fn measure(&self, engine: Engine, sensors: &Sensors) -> Vec<Exits> {
        self.with(|request, control| goniometer(engine, request, sensors, control).unwrap())
    }
}

fn z(a: Measured, b: Measured) -> f64 {
    (a.value - b.value) / (a.se * a.se + b.se * b.se).sqrt()
}

/// Asserts that z-scores with standard errors from 32 parts are consistent with equality.
fn assert_consistent(z: &[f64], name: &str) {
    let n = z.len() as f64;
    let sum: f64 = z.iter().map(|z| z * z).sum();
    // t^2 has variance 2.47 for 31 degrees of freedom
    let limit = 31.0 / 29.0 * n + z_limit(ALPHA, 1) * (2.5 * n).sqrt();
    assert!(
        sum < limit + 6.0,
        "{name}: sum of squares {sum}, {n} values"
    );
    // the tails of t with 31 degrees of freedom reach about 1.5 times as far as normal ones
    let largest = z.iter().fold(0.0_f64, |largest, z| largest.max(z.abs()));
    assert!(
        largest < 1.5 * z_limit(ALPHA, z.len()),
        "{name}: largest |z| {largest}"
    );
}

/// One sensor of each pair that is symmetric about the plane of incidence.
fn half_of_sensors(sensors: &Sensors) -> impl Iterator<Item = usize> {
    (0..sensors.len()).filter(|s| sensors.mirrored(*s) >= *s)
}

fn direction([polar, azimuth]: [f64; 2]) -> Vec3 {
    let sin = polar.sin();
    Vec3::new(sin * azimuth.cos(), sin * azimuth.sin(), -polar.cos())
}

proptest! {
    #[test]
    fn sensors_tile_the_hemisphere(count in 1_usize..20_000, u in -1.0_f64..1.0, turn in 0.0..TAU) {
        let sensors = Sensors::new(count);
        prop_assert_eq!(sensors.len(), count);
        prop_assert!((sensors.solid_angle_sr() * count as f64 - TAU).abs() < 1e-9);
        let projected: f64 = (0..count).map(|s| sensors.projected_sr(s)).sum();
        prop_assert!((projected - PI).abs() < 1e-9);
        for sensor in (0..count).step_by(1 + count / 50) {
            let centre = sensors.centre_rad(sensor);
            prop_assert_eq!(sensors.index(direction(centre)), sensor);
            let image = sensors.centre_rad(sensors.mirrored(sensor));
            prop_assert!((direction(image).y + direction(centre).y).abs() < 1e-9);
        }
        // every direction of both hemispheres has a sensor
        let r = (1.0 - u * u).sqrt();
        let up = Vec3::new(r * turn.cos(), r * turn.sin(), u);
        let sensor = sensors.index(up);
        prop_assert!(sensor < count);
        prop_assert_eq!(sensors.index(Vec3::new(up.x, up.y, -up.z)), sensor);
        prop_assert_eq!(sensors.index(Vec3::new(up.x, -up.y, up.z)), sensors.mirrored(sensor));
    }
}

/// Uniformly distributed directions hit all sensors equally often. The sensors thus have the
/// equal solid angles that they claim to have.
#[test]
fn sensors_have_equal_solid_angles() {
    let (sensors, points) = (Sensors::new(777), 2_000_000);
    let mut counts = vec![0.0; sensors.len()];
    for i in 0..points {
        // a Fibonacci lattice
        let z = (f64::from(i) + 0.5) / f64::from(points);
        let (r, turn) = (
            (1.0 - z * z).sqrt(),
            f64::from(i) * 0.618_033_988_749_894_9 * TAU,
        );
        counts[sensors.index(Vec3::new(r * turn.cos(), r * turn.sin(), z))] += 1.0;
    }
    let expected = f64::from(points) / sensors.len() as f64;
    // the error of a lattice comes from the points near the edges of a sensor
    assert!(
        counts.iter().all(|c| (c / expected - 1.0).abs() < 0.03),
        "{counts:?}"
    );
}

/// Two layers with all features: water, black carbon, a mixture of grains, a substrate.
fn full_snowpack(joining: Joining) -> Setup {
    let mut base = snow((200.0, 500.0), 0.3, 300.0, 0.1);
    base.black_carbon = Some(Carbon {
        sedimentation: 0.5,
        ..Carbon::black(200.0)
    });
    let mut top = snow((100.0, 200.0), 0.6, 200.0, 0.0);
    let coarse = snow((400.0, 600.0), 0.2, 200.0, 0.0).grains[0].grain;
    top.grains = [(0.6, top.grains[0].grain), (0.4, coarse)]
        .map(|(fraction, grain)| Component { fraction, grain })
        .to_vec();
    let layer = |snow, thickness_m| Layer { snow, thickness_m };
    let layers = [layer(top, 0.004), layer(base, 0.006)];
    let (snowpack, thickness_m) = Snowpack::of(&layers, Substrate::Grey(0.6)).unwrap();
    Setup {
        snowpack,
        thickness_m,
        light: beam(50.0),
        wavelengths_nm: vec![500.0, 900.0, 1300.0],
        model: Model {
            joining,
            ..Model::default()
        },
        rays: 20_000,
        seed: 11,
    }
}

/// The three engines agree in BRDF and BTDF at every sensor. The sums over the sensors agree
/// with the reflectance and transmittance of the spectrophotometer.
#[test]
fn engines_agree_and_sum_to_reflectance_and_transmittance() {
    engines_agree_and_sum(
        12,
        4_000,
        &[
            (Joining::Continuous, &[500.0, 900.0]),
            (Joining::Cascade, &[900.0]),
        ],
    );
}

#[test]
#[ignore = "long: six times as many walks, about 35 CPU-s"]
fn engines_agree_and_sum_to_reflectance_and_transmittance_closely() {
    let nm = [500.0, 900.0, 1300.0];
    engines_agree_and_sum(
        40,
        20_000,
        &[(Joining::Continuous, &nm), (Joining::Cascade, &nm)],
    );
}

fn engines_agree_and_sum(sensors: usize, rays: u64, cases: &[(Joining, &[f64])]) {
    let sensors = Sensors::new(sensors);
    for &(joining, nm) in cases {
        let setup = Setup {
            rays,
            wavelengths_nm: nm.to_vec(),
            ..full_snowpack(joining)
        };
        let spectral = setup.measure(Engine::Spectral, &sensors);
        let tabulated = setup.measure(Engine::Tabulated, &sensors);
        let reference = setup.measure(Engine::Reference, &sensors);
        let total = setup.with(|request, control| Engine::Spectral.run(request, control));
        let total = total.unwrap().remove(0);
        for (engine, spectra) in [("tabulated", &tabulated), ("reference", &reference)] {
            let mut zs = [Vec::new(), Vec::new()];
            for (a, b) in spectra.iter().zip(&spectral) {
                zs[0].extend(half_of_sensors(&sensors).map(|s| z(a.reflected[s], b.reflected[s])));
                zs[1].extend(
                    half_of_sensors(&sensors).map(|s| z(a.transmitted[s], b.transmitted[s])),
                );
            }
            // wavelengths share walks, so only the sensors of one wavelength are independent
            for (side, zs) in ["BRDF", "BTDF"].iter().zip(&zs) {
                for one_wavelength in zs.chunks(zs.len() / nm.len()) {
                    assert_consistent(one_wavelength, &format!("{engine} {side} {joining:?}"));
                }
            }
        }
        for spectra in [&spectral, &tabulated, &reference] {
            for (l, exits) in spectra.iter().enumerate() {
                let sum = |side: &[Measured]| -> f64 {
                    let terms = side.iter().enumerate();
                    terms.map(|(s, f)| f.value * sensors.projected_sr(s)).sum()
                };
                let (r, t) = (exits.reflectance, exits.transmittance);
                assert!((sum(&exits.reflected) / r.value - 1.0).abs() < 1e-9);
                assert!((sum(&exits.transmitted) / t.value - 1.0).abs() < 1e-9);
                for (found, expected) in [(r, total.reflectance[l]), (t, total.transmittance[l])] {
                    assert!(
                        z(found, expected).abs() < 1.5 * z_limit(ALPHA, 36),
                        "{found:?} {expected:?}"
                    );
                }
            }
        }
    }
}

/// Extremely thin snow over a Lambertian substrate of reflectance 0.5. The BRDF is 0.5 / pi,
/// because almost no ray hits a grain.
#[test]
fn an_almost_bare_substrate_is_lambertian() {
    let sensors = Sensors::new(30);
    let grain = snow((100.0, 110.0), 0.3, 1e-4, 0.0);
    let mut setup = Setup::new(grain, 0.002, beam(40.0), &[600.0], 200_000);
    setup.snowpack.substrate = Substrate::Grey(0.5);
    for engine in [Engine::Spectral, Engine::Tabulated] {
        let exits = setup.measure(engine, &sensors).remove(0);
        let lambert = Measured {
            value: 0.5 / PI,
            se: 0.0,
        };
        let zs: Vec<f64> = exits.reflected.iter().map(|f| z(*f, lambert)).collect();
        let independent: Vec<f64> = half_of_sensors(&sensors).map(|s| zs[s]).collect();
        assert_consistent(&independent, engine.name());
        // the beam is transmitted unscattered to a single sensor
        let straight = sensors.index(direction([40_f64.to_radians(), 0.0]));
        let fraction = exits.transmitted[straight].value * sensors.projected_sr(straight);
        assert!((fraction - 0.5).abs() < 1e-3 && (exits.transmittance.value - 0.5).abs() < 4e-3);
    }
}

/// At normal incidence the BRDF does not depend on the azimuth. The goniometer averages over
/// the azimuth at exactly normal incidence, but not at almost normal incidence. Both results
/// agree at every sensor.
#[test]
fn the_brdf_at_normal_incidence_does_not_depend_on_the_azimuth() {
    let sensors = Sensors::new(60);
    for engine in [Engine::Spectral, Engine::Tabulated] {
        let nearly_normal = Illumination::Collimated {
            polar_angle_rad: 1e-9,
        };
        let run = |light| {
            let setup = Setup::new(dry(), 0.01, light, &[700.0], 20_000);
            setup.measure(engine, &sensors).remove(0)
        };
        let (exits, axial) = (run(nearly_normal), run(NORMAL));
        let zs: Vec<f64> = half_of_sensors(&sensors)
            .filter(|s| sensors.mirrored(*s) > *s)
            .map(|s| {
                // the mean over the ring at the same polar angle, from the same walks
                z(
                    exits.reflected[s],
                    Measured {
                        se: 0.0,
                        ..axial.reflected[s]
                    },
                )
            })
            .collect();
        assert_consistent(&zs, engine.name());
    }
}

/// Views from counted walks and from scores at events agree, on both sides.
#[test]
fn engines_agree_toward_views() {
    let angles = [
        [0.0, 0.0],
        [30.0, 90.0],
        [60.0, 0.0],
        [60.0, 180.0],
        [75.0, -45.0],
    ];
    let views = Views::new(&angles).unwrap();
    let light = Illumination::Collimated {
        polar_angle_rad: 60_f64.to_radians(),
    };
    let smooth = snow((300.0, 500.0), 0.1, 300.0, 0.0);
    let run = |engine, rays| {
        let setup = Setup::new(smooth.clone(), 0.01, light, &[600.0, 1500.0], rays);
        setup.with(|request, control| exits::views(engine, request, &views, control).unwrap())
    };
    let (counted, scored) = (
        run(Engine::Spectral, 200_000),
        run(Engine::Tabulated, 20_000),
    );
    let mut zs = Vec::new();
    for (counted, scored) in counted.iter().zip(&scored) {
        assert!(scored.normalised && !counted.normalised);
        for (a, b) in [
            (counted.anisotropy_factors(), scored.anisotropy_factors()),
            (
                counted.transmittance_factors(),
                scored.transmittance_factors(),
            ),
        ] {
            assert_eq!(a.len(), angles.len());
            zs.extend(a.iter().zip(&b).map(|(a, b)| z(*a, *b)));
        }
    }
    // ice absorbs what is scattered often; the rest goes on forward
    let infrared = scored[1].reflectance_factors();
    let (forward, back) = (infrared[2], infrared[3]);
    assert!(forward.value > 1.5 * back.value, "{infrared:?}");
    assert!(forward.se < 0.05 * forward.value, "{forward:?}");
    assert_consistent(&zs, "views");
}

/// In dilute snow with uniform entry, light and sensor can be exchanged.
#[test]
fn the_brdf_of_dilute_snow_is_reciprocal() {
    let sensors = Sensors::new(150);
    let sensor_at = |deg: f64| sensors.index(direction([deg.to_radians(), 0.0]));
    let (a, b) = (sensor_at(30.0), sensor_at(65.0));
    let light = |sensor| Illumination::Collimated {
        polar_angle_rad: sensors.centre_rad(sensor)[0],
    };
    let brdf = |from, to| {
        let dilute = snow((100.0, 200.0), 0.3, 10.0, 0.0);
        let mut setup = Setup::new(dilute, 0.3, light(from), &[1000.0], 20_000);
        setup.model.entry = Entry::Uniform;
        setup.measure(Engine::Tabulated, &sensors)[0].reflected[to]
    };
    let (forward, backward) = (brdf(a, b), brdf(b, a));
    // finite sensors and finite grains cause deviations of a few per cent
    let difference = (forward.value / backward.value - 1.0).abs();
    let noise = z_limit(ALPHA, 1) * (forward.se + backward.se) / forward.value;
    assert!(difference < 0.03 + noise, "{forward:?} {backward:?}");
}

#[test]
fn standard_errors_match_the_scatter_over_seeds() {
    compare_errors_with_scatter(&[Engine::Spectral], 20, 1_000);
}

#[test]
#[ignore = "long: four times as many walks, and tables, about 20 CPU-s"]
fn standard_errors_match_the_scatter_over_seeds_closely() {
    compare_errors_with_scatter(&[Engine::Spectral, Engine::Tabulated], 40, 4_000);
}

fn compare_errors_with_scatter(engines: &[Engine], sensors: usize, rays: u64) {
    let (sensors, seeds) = (Sensors::new(sensors), 24);
    for &engine in engines {
        let runs: Vec<Exits> = (0..seeds)
            .map(|seed| {
                let mut setup = Setup::new(dry(), 0.005, beam(60.0), &[800.0], rays);
                setup.seed = seed;
                setup.measure(engine, &sensors).remove(0)
            })
            .collect();
        let n = seeds as f64;
        let mut ratio = 0.0;
        let chosen: Vec<usize> = half_of_sensors(&sensors).collect();
        for s in &chosen {
            let mean = runs.iter().map(|r| r.reflected[*s].value).sum::<f64>() / n;
            let scatter = runs
                .iter()
                .map(|r| (r.reflected[*s].value - mean).powi(2))
                .sum::<f64>();
            let squared_errors = runs.iter().map(|r| r.reflected[*s].se.powi(2)).sum::<f64>();
            ratio += scatter / (n - 1.0) / (squared_errors / n) / chosen.len() as f64;
        }
        // a variance of 24 runs is known to sqrt(2/23); the mean over the correlated sensors is
        // known to about a fifth of that
        assert!((ratio - 1.0).abs() < 0.3, "{}: {ratio}", engine.name());
    }
}

/// Sensors whose light is estimated at every scattering event are normalised to R and T of
/// `hybrid`, because their own sums have about five times its standard error. The normalised
/// sums have the standard errors of `hybrid` and agree with R and T of counted walks. Where
/// `hybrid` is not valid, the sums are not normalised.
#[test]
fn estimated_sensors_are_normalised_to_hybrid() {
    let (sensors, seeds) = (Sensors::new(20), 4);
    let mut setup = Setup::new(dry(), 0.01, beam(60.0), &[800.0, 1300.0], 100_000);
    let counted = setup.with(|request, control| Engine::Tabulated.run(request, control));
    let counted = counted.unwrap().remove(0);
    setup.rays = 1500;
    let mut means = [[Measured::default(); 2]; 2];
    for seed in 100..100 + seeds {
        setup.seed = seed;
        let spectra = setup.measure(Engine::Auto, &sensors);
        for (exits, means) in spectra.iter().zip(&mut means) {
            assert!(exits.normalised);
            let sides = [
                (&exits.reflected, exits.reflectance),
                (&exits.transmitted, exits.transmittance),
            ];
            for ((bins, sum), mean) in sides.into_iter().zip(means) {
                let terms = bins.iter().enumerate();
                let terms = terms.map(|(s, f)| f.value * sensors.projected_sr(s));
                assert!((terms.sum::<f64>() / sum.value - 1.0).abs() < 1e-12);
                mean.value += sum.value / seeds as f64;
                mean.se = mean.se.hypot(sum.se / seeds as f64);
            }
        }
    }
    for (l, [r, t]) in means.into_iter().enumerate() {
        for (found, expected) in [(r, counted.reflectance[l]), (t, counted.transmittance[l])] {
            // 28 degrees of freedom; where `auto` uses `hybrid`, its error is up to .002
            // (docs/stability.md), that of `tabulated` up to .0003
            let difference = (found.value - expected.value).abs();
            let noise = 1.2 * z_limit(ALPHA, 4) * found.se.hypot(expected.se);
            assert!(difference < noise + 0.0023, "{found:?} {expected:?}");
        }
    }
    // `hybrid` is not valid for this wide range of sizes
    setup.snowpack = snow((50.0, 3000.0), 0.3, 300.0, 0.0).into();
    setup.rays = 100;
    assert!(!setup.measure(Engine::Auto, &sensors)[0].normalised);
}

#[test]
fn results_do_not_depend_on_threads() {
    let sensors = Sensors::new(50);
    let mut setup = Setup::new(dry(), 0.01, beam(50.0), &[900.0], 100);
    setup.snowpack.substrate = Substrate::Grey(0.6);
    for engine in [Engine::Spectral, Engine::Tabulated, Engine::Reference] {
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build()
                .unwrap()
                .install(|| setup.measure(engine, &sensors))
        };
        assert_eq!(run(1), run(3), "{}", engine.name());
    }
}

#[test]
fn unsuitable_engines_name_an_alternative() {
    let setup = Setup::new(dry(), 0.01, NORMAL, &[600.0], 10);
    let assert_unable = |result: Result<Vec<Exits>, EngineError>, alternative| match result {
        Err(EngineError::Unable { instead, .. }) => assert_eq!(instead, alternative),
        result => panic!("{result:?}"),
    };
    setup.with(|request, control| {
        let (sensors, radii) = (Sensors::new(10), Radii::new(5, 1e-3, 1.0));
        let result = goniometer(Engine::Hybrid, request, &sensors, control);
        assert_unable(result, Engine::Tabulated);
        for engine in [Engine::Hybrid, Engine::Tabulated] {
            assert_unable(
                radial_profile(engine, request, &radii, control),
                Engine::Spectral,
            );
        }
    });
}

/// Radial profiles sum to R and T and agree between two engines. Light that penetrates deeper
/// leaves farther from its entry point.
#[test]
fn radial_profiles_add_up_and_widen_with_depth() {
    let radii = Radii::new(8, 1e-4, 0.1);
    let setup = Setup::new(dry(), 0.01, NORMAL, &[600.0, 1300.0], 60_000);
    let run = |engine| {
        setup.with(|request, control| radial_profile(engine, request, &radii, control).unwrap())
    };
    let (spectral, reference) = (run(Engine::Auto), run(Engine::Reference));
    let total = setup.with(|request, control| Engine::Spectral.run(request, control));
    let total = total.unwrap().remove(0);
    for (l, (a, b)) in spectral.iter().zip(&reference).enumerate() {
        let sum: f64 = a.reflected.iter().map(|m| m.value).sum();
        assert!((sum / a.reflectance.value - 1.0).abs() < 1e-9);
        assert!(z(a.reflectance, total.reflectance[l]).abs() < 1.5 * z_limit(ALPHA, 4));
        assert!(z(a.transmittance, total.transmittance[l]).abs() < 1.5 * z_limit(ALPHA, 4));
        let well_sampled = |m: &(&Measured, &Measured)| m.0.value > 1e-3 && m.1.value > 1e-3;
        let pairs = a.reflected.iter().zip(&b.reflected).filter(well_sampled);
        assert_consistent(
            &pairs.map(|(a, b)| z(*a, *b)).collect::<Vec<_>>(),
            "profile",
        );
    }
    // the fraction of the outgoing light that leaves farther out than 5 mm
    let far = |side: &[Measured], total: Measured| {
        side[6..].iter().map(|m| m.value).sum::<f64>() / total.value
    };
    let [visible, infrared] = [&spectral[0], &spectral[1]];
    let visible_far = far(&visible.reflected, visible.reflectance);
    assert!(visible_far > 1.5 * far(&infrared.reflected, infrared.reflectance));
    assert!(far(&visible.transmitted, visible.transmittance) > visible_far);
}

/// The command line prints goniometer and profile results, independent of the threads.
#[test]
fn the_command_line_prints_sensors_and_profiles() {
    const SAMPLE: &str = "\
version = 1
[illumination]
incidence_angle_deg = 60
[wavelengths]
values_nm = [600, 1300]
[[layer]]
thickness_cm = 1
density_kg_m3 = 300
[[layer.grain]]
size_um = { min = 300, max = 500 }
facetness = { min = 0.2, max = 0.4, mean = 0.3, sd = 0.072 }
";
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("sample.toml"), SAMPLE).unwrap();
    let output = |args: &[&str]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_splitsnow"));
        command.args([&["measure", "sample.toml", "--rays", "300"], args].concat());
        command.current_dir(dir.path()).output().unwrap()
    };
    let text = |args: &[&str]| {
        let output = output(args);
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let rows = |csv: &str, header: &str| -> Vec<Vec<String>> {
        let mut lines = csv.lines().skip_while(|line| line.starts_with('#'));
        assert_eq!(lines.next(), Some(header));
        lines
            .map(|line| line.split(',').map(String::from).collect())
            .collect()
    };
    let header = "wavelength_nm,side,polar_deg,azimuth_deg,value_per_sr,se_per_sr";
    let sensors = ["--goniometer", "--sensors", "90"];
    let csv = text(&[&sensors[..], &["--threads", "1"]].concat());
    assert_eq!(csv, text(&[&sensors[..], &["--threads", "3"]].concat()));
    assert!(csv.contains("# engine: tabulated\n") && csv.contains("# sensors: 90\n"));
    let hemisphere = rows(&csv, header);
    assert_eq!(hemisphere.len(), 2 * 2 * 90);
    // the principal plane has the same values, from horizon to horizon
    let plane = rows(
        &text(&[&sensors[..], &["--principal-plane"]].concat()),
        header,
    );
    let number = |row: &[String], i: usize| row[i].parse::<f64>().unwrap();
    let side = &plane[..plane.len() / 4];
    for row in side {
        assert!(
            hemisphere
                .iter()
                .any(|other| other[..3] == row[..3] && other[4..] == row[4..]),
            "{row:?}"
        );
    }
    let signed_angle =
        |row: &Vec<String>| number(row, 2) * if row[3] == "0.0000" { 1.0 } else { -1.0 };
    assert!(side.is_sorted_by(|a, b| signed_angle(a) < signed_angle(b)));
    // the comments have the same sums and standard errors as the JSON output
    let sums = |csv: &str| -> Vec<Vec<f64>> {
        let lines = csv.lines().filter_map(|line| line.strip_prefix("# sum: "));
        let row = |line: &str| line.split(',').map(|x| x.parse().unwrap()).collect();
        lines.skip(1).map(row).collect()
    };
    let in_comments = sums(&csv);
    assert!(csv.contains("# sums: those of hybrid"));
    // the JSON output has the same values, and their sums
    let json = text(&[&sensors[..], &["--json"]].concat());
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let list = |v: &serde_json::Value| -> Vec<f64> { serde_json::from_value(v.clone()).unwrap() };
    let values = list(&json["reflected_per_sr"][0]);
    let terms = values.iter().zip(list(&json["projected_sr"]));
    let sum: f64 = terms.map(|(f, projected)| f * projected).sum();
    assert!((sum / json["reflectance"][0].as_f64().unwrap() - 1.0).abs() < 1e-9);
    assert_eq!(values[7], number(&hemisphere[7], 4));
    let names = [
        "wavelength_nm",
        "reflectance",
        "reflectance_se",
        "transmittance",
        "transmittance_se",
    ];
    for (l, row) in in_comments.iter().enumerate() {
        assert_eq!(*row, names.map(|name| list(&json[name])[l]));
    }
    assert_eq!(in_comments.len(), 2);
    assert_eq!(json["sums_of"], "hybrid");
    assert_eq!(sums(&text(&["--radial-profile", "5"])).len(), 2);

    let header =
        "wavelength_nm,side,radius_min_m,radius_max_m,exitance_per_m2,se_per_m2,share,share_se";
    let profile = rows(&text(&["--radial-profile", "5"]), header);
    assert_eq!(profile.len(), 2 * 2 * 6);
    assert_eq!(
        (profile[0][2].as_str(), profile[5][3].as_str()),
        ("0.0", "inf")
    );
    for row in profile.iter().filter(|row| row[3] != "inf") {
        let area = PI * (number(row, 3).powi(2) - number(row, 2).powi(2));
        assert!((number(row, 4) * area - number(row, 6)).abs() < 1e-9);
    }
    let views = ["--view-deg", "0,60", "--relative-azimuth-deg", "0,180,-90"];
    let header = "wavelength_nm,view_deg,relative_azimuth_deg,brf,brf_se,anisotropy_factor,\
        anisotropy_factor_se,btf,btf_se";
    let csv = text(&views);
    let toward = rows(&csv, header);
    assert_eq!(toward.len(), 2 * 2 * 3);
    assert_eq!(toward[5][1..3], ["60", "-90"]);
    let json = text(&[&views[..], &["--json"]].concat());
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(
        list(&json["relative_azimuth_deg"])[3..],
        [0.0, 180.0, -90.0]
    );
    for (column, name) in ["brf", "brf_se", "anisotropy_factor"]
        .into_iter()
        .enumerate()
    {
        assert_eq!(list(&json[name][1])[4], number(&toward[10], 3 + column));
    }
    // factors over reflectance
    let ratio = number(&toward[10], 3) / number(&toward[10], 5);
    assert!((ratio / list(&json["reflectance"])[1] - 1.0).abs() < 1e-12);
    let refused = output(&["--view-deg", "95"]);
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        !refused.status.success() && message.contains("outside 0 to 88"),
        "{message}"
    );
    let refused = output(&["--view-deg", "30", "--against", "sample.toml"]);
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        !refused.status.success() && message.contains("cannot be used with"),
        "{message}"
    );
    let refused = output(&["--goniometer", "--engine", "hybrid"]);
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(!refused.status.success() && message.contains("use the engine `tabulated`"));
}
