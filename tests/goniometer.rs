//! The goniophotometer: sensors, sums, symmetries, limits, reciprocity, errors,
//! the fast way against counting. The published trends are in tests/studies.rs.
//!
//! Where runs are compared over many sensors, standard errors come from 32 parts
//! (31 degrees of freedom): a squared difference in units of its variance then has
//! mean 31/29 and, for the difference of two such runs, about the variance of F.
#![allow(clippy::unwrap_used)]

use std::f64::consts::{PI, TAU};
use std::sync::atomic::{AtomicBool, AtomicU64};

use crate::snow::{NORMAL, beam, dry, snow, z_limit};
use proptest::prelude::*;
use splitsnow::engine::exits::{Exits, goniometer, radial_profile};
use splitsnow::engine::{Cache, Control, Engine, EngineError, MaxError, Request, Resolution};
use splitsnow::math::Vec3;
use splitsnow::measurement::{Measured, Radii, Sensors};
use splitsnow::optics::Carbon;
use splitsnow::transport::{
    Component, Entry, Illumination, Joining, Layer, Model, Snow, Snowpack, Substrate,
};

/// Chance that any one test fails though all is right.
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

    /// Of a handful of walks nothing is told but that they are the same.
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

/// Asserts that `z` are standardised differences with errors from 32 parts each.
fn assert_alike(z: &[f64], what: &str) {
    let n = z.len() as f64;
    let sum: f64 = z.iter().map(|z| z * z).sum();
    // variance of t^2 with 31 degrees of freedom: 2.47
    let limit = 31.0 / 29.0 * n + z_limit(ALPHA, 1) * (2.5 * n).sqrt();
    assert!(sum < limit + 6.0, "{what}: {sum} over {n}");
    // t with 31 degrees of freedom, far out: half as far again as normal
    let most = z.iter().fold(0.0_f64, |most, z| most.max(z.abs()));
    assert!(most < 1.5 * z_limit(ALPHA, z.len()), "{what}: {most}");
}

/// One of every pair of mirror images.
fn halves(sensors: &Sensors) -> impl Iterator<Item = usize> {
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
        // the sensor of any direction is one of those there are, on both sides
        let r = (1.0 - u * u).sqrt();
        let up = Vec3::new(r * turn.cos(), r * turn.sin(), u);
        let sensor = sensors.index(up);
        prop_assert!(sensor < count);
        prop_assert_eq!(sensors.index(Vec3::new(up.x, up.y, -up.z)), sensor);
        prop_assert_eq!(sensors.index(Vec3::new(up.x, -up.y, up.z)), sensors.mirrored(sensor));
    }
}

/// Directions uniform on the sphere fall on all sensors alike: they are of equal
/// solid angle as met, not only as said.
#[test]
fn sensors_are_met_alike() {
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
    let each = f64::from(points) / sensors.len() as f64;
    // a lattice errs by a share of the points along a cell's edge
    assert!(
        counts.iter().all(|c| (c / each - 1.0).abs() < 0.03),
        "{counts:?}"
    );
}

/// The representative snow as the base of a snowpack with all that snow may hold.
fn everything(joining: Joining) -> Setup {
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

/// BRDF and BTDF of snowpacks of everything by all three engines: they agree with one
/// another on every sensor, and their sums with the spectrophotometer.
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
#[ignore = "long: six times the walks, some 35 CPU-s"]
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
            ..everything(joining)
        };
        let spectral = setup.measure(Engine::Spectral, &sensors);
        let fast = setup.measure(Engine::Tabulated, &sensors);
        let reference = setup.measure(Engine::Reference, &sensors);
        let whole = setup.with(|request, control| Engine::Spectral.run(request, control));
        let whole = whole.unwrap().remove(0);
        for (engine, all) in [("fast", &fast), ("reference", &reference)] {
            let mut zs = [Vec::new(), Vec::new()];
            for (a, b) in all.iter().zip(&spectral) {
                zs[0].extend(halves(&sensors).map(|s| z(a.reflected[s], b.reflected[s])));
                zs[1].extend(halves(&sensors).map(|s| z(a.transmitted[s], b.transmitted[s])));
            }
            // wavelengths share walks: those of one are independent
            for (side, zs) in ["BRDF", "BTDF"].iter().zip(&zs) {
                for alone in zs.chunks(zs.len() / nm.len()) {
                    assert_alike(alone, &format!("{engine} {side} {joining:?}"));
                }
            }
        }
        for all in [&spectral, &fast, &reference] {
            for (l, exits) in all.iter().enumerate() {
                let sum = |side: &[Measured]| -> f64 {
                    let terms = side.iter().enumerate();
                    terms.map(|(s, f)| f.value * sensors.projected_sr(s)).sum()
                };
                let (r, t) = (exits.reflectance, exits.transmittance);
                assert!((sum(&exits.reflected) / r.value - 1.0).abs() < 1e-9);
                assert!((sum(&exits.transmitted) / t.value - 1.0).abs() < 1e-9);
                for (ours, theirs) in [(r, whole.reflectance[l]), (t, whole.transmittance[l])] {
                    assert!(
                        z(ours, theirs).abs() < 1.5 * z_limit(ALPHA, 36),
                        "{ours:?} {theirs:?}"
                    );
                }
            }
        }
    }
}

/// Hardly any snow on a substrate of 0.5: a Lambertian reflector of BRDF 0.5 / pi
/// under a slab that only a few rays meet.
#[test]
fn bare_substrate_is_lambertian() {
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
        let halved: Vec<f64> = halves(&sensors).map(|s| zs[s]).collect();
        assert_alike(&halved, engine.name());
        // the beam goes straight through to the one sensor behind it
        let behind = sensors.index(direction([40_f64.to_radians(), 0.0]));
        let share = exits.transmitted[behind].value * sensors.projected_sr(behind);
        assert!((share - 0.5).abs() < 1e-3 && (exits.transmittance.value - 0.5).abs() < 4e-3);
    }
}

/// Mirror images are equal by construction. Walks know no such rule: counted over
/// half circles on their own, left and right agree; and all azimuths do at (all
/// but) normal incidence, where nothing is made symmetric.
#[test]
fn azimuths_are_alike_where_they_must_be() {
    let sensors = Sensors::new(60);
    for engine in [Engine::Spectral, Engine::Tabulated] {
        let nearly = Illumination::Collimated {
            polar_angle_rad: 1e-9,
        };
        let run = |light| {
            let setup = Setup::new(dry(), 0.01, light, &[700.0], 20_000);
            setup.measure(engine, &sensors).remove(0)
        };
        let (exits, axial) = (run(nearly), run(NORMAL));
        let zs: Vec<f64> = halves(&sensors)
            .filter(|s| sensors.mirrored(*s) > *s)
            .map(|s| {
                // mean of the ring at the same angle, from the same walks
                z(
                    exits.reflected[s],
                    Measured {
                        se: 0.0,
                        ..axial.reflected[s]
                    },
                )
            })
            .collect();
        assert_alike(&zs, engine.name());
    }
}

/// Uniform entry in dilute snow: BRDF from a to b is that from b to a.
#[test]
fn exchange_of_light_and_sensor_in_dilute_snow() {
    let sensors = Sensors::new(150);
    let at = |deg: f64| sensors.index(direction([deg.to_radians(), 0.0]));
    let (a, b) = (at(30.0), at(65.0));
    let light = |sensor| Illumination::Collimated {
        polar_angle_rad: sensors.centre_rad(sensor)[0],
    };
    let f = |from, to| {
        let dilute = snow((100.0, 200.0), 0.3, 10.0, 0.0);
        let mut setup = Setup::new(dilute, 0.3, light(from), &[1000.0], 20_000);
        setup.model.entry = Entry::Uniform;
        setup.measure(Engine::Tabulated, &sensors)[0].reflected[to]
    };
    let (there, back) = (f(a, b), f(b, a));
    // the finite sensors and the grains' size leave some percent
    let apart = (there.value / back.value - 1.0).abs();
    let noise = z_limit(ALPHA, 1) * (there.se + back.se) / there.value;
    assert!(apart < 0.03 + noise, "{there:?} {back:?}");
}

/// Standard errors are the scatter over seeds.
#[test]
fn standard_errors_are_the_scatter_over_seeds() {
    errors_are_the_scatter(&[Engine::Spectral], 20, 1_000);
}

#[test]
#[ignore = "long: four times the walks, and tables, some 20 CPU-s"]
fn standard_errors_are_the_scatter_over_seeds_closely() {
    errors_are_the_scatter(&[Engine::Spectral, Engine::Tabulated], 40, 4_000);
}

fn errors_are_the_scatter(engines: &[Engine], sensors: usize, rays: u64) {
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
        let all: Vec<usize> = halves(&sensors).collect();
        for s in &all {
            let mean = runs.iter().map(|r| r.reflected[*s].value).sum::<f64>() / n;
            let scatter = runs
                .iter()
                .map(|r| (r.reflected[*s].value - mean).powi(2))
                .sum::<f64>();
            let said = runs.iter().map(|r| r.reflected[*s].se.powi(2)).sum::<f64>();
            ratio += scatter / (n - 1.0) / (said / n) / all.len() as f64;
        }
        // variances of 24 runs are good to sqrt(2/23), means over sensors that are
        // not quite independent to a fifth of that, with room
        assert!((ratio - 1.0).abs() < 0.3, "{}: {ratio}", engine.name());
    }
}

/// What is scored at events adds up to R and T of `hybrid`, to rounding, with its
/// errors; and over seeds, within these, to what counted walks come to. Scored sums
/// themselves scatter some five times as much. Where `hybrid` does not hold they
/// are left.
#[test]
fn scored_sensors_add_up_to_reflectance() {
    let (sensors, seeds) = (Sensors::new(20), 4);
    let mut setup = Setup::new(dry(), 0.01, beam(60.0), &[800.0, 1300.0], 100_000);
    let counted = setup.with(|request, control| Engine::Tabulated.run(request, control));
    let counted = counted.unwrap().remove(0);
    setup.rays = 1500;
    let mut means = [[Measured::default(); 2]; 2];
    for seed in 100..100 + seeds {
        setup.seed = seed;
        let all = setup.measure(Engine::Auto, &sensors);
        for (exits, means) in all.iter().zip(&mut means) {
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
        for (ours, theirs) in [(r, counted.reflectance[l]), (t, counted.transmittance[l])] {
            // 28 degrees of freedom; of its own `hybrid` is off by up to .002 where
            // `auto` takes it (docs/stability.md), `tabulated` by .0003
            let apart = (ours.value - theirs.value).abs();
            let noise = 1.2 * z_limit(ALPHA, 4) * ours.se.hypot(theirs.se);
            assert!(apart < noise + 0.0023, "{ours:?} {theirs:?}");
        }
    }
    // of crowded grains `hybrid` knows no better
    setup.snowpack = snow((50.0, 3000.0), 0.3, 300.0, 0.0).into();
    setup.rays = 100;
    assert!(!setup.measure(Engine::Auto, &sensors)[0].normalised);
}

#[test]
fn threads_leave_no_trace() {
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
fn engines_without_azimuths_or_distances_say_so() {
    let setup = Setup::new(dry(), 0.01, NORMAL, &[600.0], 10);
    let unable = |result: Result<Vec<Exits>, EngineError>, other| match result {
        Err(EngineError::Unable { instead, .. }) => assert_eq!(instead, other),
        result => panic!("{result:?}"),
    };
    setup.with(|request, control| {
        let (sensors, radii) = (Sensors::new(10), Radii::new(5, 1e-3, 1.0));
        let result = goniometer(Engine::Hybrid, request, &sensors, control);
        unable(result, Engine::Tabulated);
        for engine in [Engine::Hybrid, Engine::Tabulated] {
            unable(
                radial_profile(engine, request, &radii, control),
                Engine::Spectral,
            );
        }
    });
}

/// The radial profile adds up to R and T, is the same in two engines, and light
/// that went deeper left farther out.
#[test]
fn radial_profiles_add_up_and_widen_with_depth() {
    let radii = Radii::new(8, 1e-4, 0.1);
    let setup = Setup::new(dry(), 0.01, NORMAL, &[600.0, 1300.0], 60_000);
    let run = |engine| {
        setup.with(|request, control| radial_profile(engine, request, &radii, control).unwrap())
    };
    let (spectral, reference) = (run(Engine::Auto), run(Engine::Reference));
    let whole = setup.with(|request, control| Engine::Spectral.run(request, control));
    let whole = whole.unwrap().remove(0);
    for (l, (a, b)) in spectral.iter().zip(&reference).enumerate() {
        let sum: f64 = a.reflected.iter().map(|m| m.value).sum();
        assert!((sum / a.reflectance.value - 1.0).abs() < 1e-9);
        assert!(z(a.reflectance, whole.reflectance[l]).abs() < 1.5 * z_limit(ALPHA, 4));
        assert!(z(a.transmittance, whole.transmittance[l]).abs() < 1.5 * z_limit(ALPHA, 4));
        let met = |m: &(&Measured, &Measured)| m.0.value > 1e-3 && m.1.value > 1e-3;
        let pairs = a.reflected.iter().zip(&b.reflected).filter(met);
        assert_alike(
            &pairs.map(|(a, b)| z(*a, *b)).collect::<Vec<_>>(),
            "profile",
        );
    }
    // the share beyond 5 mm, of what leaves
    let far = |side: &[Measured], all: Measured| {
        side[6..].iter().map(|m| m.value).sum::<f64>() / all.value
    };
    let [visible, infrared] = [&spectral[0], &spectral[1]];
    let beyond = far(&visible.reflected, visible.reflectance);
    assert!(beyond > 1.5 * far(&infrared.reflected, infrared.reflectance));
    assert!(far(&visible.transmitted, visible.transmittance) > beyond);
}

/// The command line prints what the library measures, whatever the threads.
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
    let all = rows(&csv, header);
    assert_eq!(all.len(), 2 * 2 * 90);
    // the plane of incidence: the same values, from horizon to horizon
    let plane = rows(
        &text(&[&sensors[..], &["--principal-plane"]].concat()),
        header,
    );
    let angle = |row: &[String], i: usize| row[i].parse::<f64>().unwrap();
    let side = &plane[..plane.len() / 4];
    for row in side {
        assert!(
            all.iter()
                .any(|other| other[..3] == row[..3] && other[4..] == row[4..]),
            "{row:?}"
        );
    }
    let signed = |row: &Vec<String>| angle(row, 2) * if row[3] == "0.0000" { 1.0 } else { -1.0 };
    assert!(side.is_sorted_by(|a, b| signed(a) < signed(b)));
    // the comments have the sums and their errors that JSON has
    let sums = |csv: &str| -> Vec<Vec<f64>> {
        let lines = csv.lines().filter_map(|line| line.strip_prefix("# sum: "));
        let row = |line: &str| line.split(',').map(|x| x.parse().unwrap()).collect();
        lines.skip(1).map(row).collect()
    };
    let in_comments = sums(&csv);
    assert!(csv.contains("# sums: those of hybrid"));
    // JSON has the same numbers and their sums
    let json = text(&[&sensors[..], &["--json"]].concat());
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let list = |v: &serde_json::Value| -> Vec<f64> { serde_json::from_value(v.clone()).unwrap() };
    let values = list(&json["reflected_per_sr"][0]);
    let terms = values.iter().zip(list(&json["projected_sr"]));
    let sum: f64 = terms.map(|(f, projected)| f * projected).sum();
    assert!((sum / json["reflectance"][0].as_f64().unwrap() - 1.0).abs() < 1e-9);
    assert_eq!(values[7], angle(&all[7], 4));
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
        let area = PI * (angle(row, 3).powi(2) - angle(row, 2).powi(2));
        assert!((angle(row, 4) * area - angle(row, 6)).abs() < 1e-9);
    }
    let refused = output(&["--goniometer", "--engine", "hybrid"]);
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(!refused.status.success() && message.contains("use the engine `tabulated`"));
}
