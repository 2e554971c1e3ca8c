//! A database with optional axes, from the grid file to the answers of `query`.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64};

use crate::common::{Folder, assert_same, dir_bytes};
use splitsnow::config;
use splitsnow::engine::{Cache, Control};
use splitsnow::error_budget::{ERROR_BUDGET, ErrorBudget, Patch, PatchSimulation};

use splitsnow::lookup::{Database, Lookup};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Parameter, Point};
use splitsnow::store::{Store, Variable};

/// 2 x 2 values of the optional axes, each with 3 x 2 curves.
const GRID: &str = "version = 1
[axes]
facetness = [0.3]
grain_size_um = [300]
density_kg_m3 = [250]
thickness_cm = [2, 5, 10]
incidence_angle_deg = [0, 60]
black_carbon_ng_g = [0, 100]
water_saturation = [0, 0.05]
[wavelengths]
values_nm = [450, 550, 650]
[run]
engine = \"hybrid\"
rays = 20000
";
const SNOW: &str =
    "--facetness 0.3 --grain-size-um 300 --density-kg-m3 250 --incidence-angle-deg 0";

/// The second column of a table.
fn csv_values(text: &str) -> [f64; 3] {
    let lines = text.lines().skip(1);
    let values: Vec<f64> = lines
        .map(|line| line.split_once(',').unwrap().1.parse().unwrap())
        .collect();
    values.try_into().unwrap()
}

/// An independent simulation at normal incidence: transmittances and standard errors.
fn simulate(thickness_cm: f64, optional: Point) -> Vec<[f64; 2]> {
    let grid = config::grid::parse("g.toml", GRID).unwrap().grid;
    let patch = Patch {
        snow: optional
            .with(Parameter::Facetness, 0.3)
            .with(Parameter::GrainSize, 300.0)
            .with(Parameter::Density, 250.0),
        thickness_cm: vec![thickness_cm],
        angle_deg: vec![0.0],
    };
    let (cancel, rays_done) = (AtomicBool::new(false), AtomicU64::new(0));
    let control = Control {
        parallel: false,
        cancel: &cancel,
        rays_done: &rays_done,
        cache: &Cache::default(),
    };
    let simulation = PatchSimulation {
        grid: &grid,
        rays: 30_000,
        seed: 77,
    };
    let spectra = simulation.run(&[patch], &control).unwrap();
    let transmittance = spectra[0][0].of(Quantity::Transmittance).iter();
    transmittance.map(|m| [m.value, m.se]).collect()
}

#[test]
fn databases_with_optional_axes_are_built_and_queried() {
    let folder = Folder::new(GRID);
    let plan = folder.succeeds("plan g.toml");
    assert!(
        plan.contains("black_carbon_ng_g    2 values, 0 to 100"),
        "{plan}"
    );
    assert!(plan.contains("4 of 6 curves each: 24 curves"), "{plan}");
    folder.succeeds("build g.toml");
    let whole = dir_bytes(&folder.out("g"));

    let metadata = fs::read(
        folder
            .out("g")
            .join("database.zarr/transmittance/zarr.json"),
    );
    let metadata: serde_json::Value = serde_json::from_slice(&metadata.unwrap()).unwrap();
    assert_eq!(
        metadata["shape"],
        serde_json::json!([2, 2, 1, 1, 1, 3, 2, 3])
    );
    assert_eq!(metadata["dimension_names"][0], "black_carbon_ng_g");
    assert_eq!(metadata["dimension_names"][2], "facetness");

    // lost files are restored, to the byte
    for chunk in ["transmittance/c.0.0.0.0.0.0.0.0", "black_carbon_ng_g/c.0"] {
        fs::remove_file(folder.out("g").join("database.zarr").join(chunk)).unwrap();
    }
    folder.succeeds("build g.toml");
    assert_same(&whole, &dir_bytes(&folder.out("g")));

    // rows are in storage order
    let store = Store::open(&folder.out("g")).unwrap();
    let curves = store.read(Variable::TRANSMITTANCE).unwrap();
    let grid = config::grid::parse("g.toml", store.config()).unwrap().grid;
    assert_eq!(grid.axes, *store.axes());
    let stored = curves.row(3 * 6 + 2).to_vec();
    let sooty_and_wet = [
        (Parameter::BlackCarbon, 100.0),
        (Parameter::WaterSaturation, 0.05),
    ];
    let simulated = simulate(5.0, sooty_and_wet.into());
    for (stored, [value, se]) in stored.iter().zip(&simulated) {
        assert!((f64::from(*stored) - value).abs() < 8.0 * se + 2e-3);
    }

    // queries at a node and between nodes
    let query =
        |options: &str| csv_values(&folder.succeeds(&format!("query out/g {SNOW} {options}")));
    let on_node = query("--thickness-cm 5 --black-carbon-ng-g 100 --water-saturation 0.05");
    for (found, stored) in on_node.iter().zip(&stored) {
        assert!((found - f64::from(*stored)).abs() < 5e-3, "{on_node:?}");
    }
    let off_node = query("--thickness-cm 4 --black-carbon-ng-g 40 --water-saturation 0.02");
    let between = [
        (Parameter::BlackCarbon, 40.0),
        (Parameter::WaterSaturation, 0.02),
    ];
    let clean = query("--thickness-cm 4 --black-carbon-ng-g 0 --water-saturation 0.02");
    for ((found, [value, se]), clean) in off_node
        .iter()
        .zip(simulate(4.0, between.into()))
        .zip(clean)
    {
        assert!(
            (found - value).abs() < 8.0 * se + 0.04 * value,
            "{found} {value} {se}"
        );
        // carbon lowers the transmittance by 7.9 %, more than the tolerance of 4 % above;
        // otherwise the test could not detect its effect
        assert!(*found < 0.95 * clean, "{found} {clean}");
    }
    let database = Database::open(folder.out("g").join("snow.safetensors")).unwrap();
    let at_optional = database.at(between.into()).unwrap();
    let lookup = Lookup::new(&at_optional, Quantity::Transmittance).unwrap();
    let mut spectrum = [0.0; 3];
    let point = Point::from_core([0.3, 300.0, 250.0, 4.0, 0.0]);
    lookup.spectrum(point, &mut spectrum).unwrap();
    let same = spectrum
        .iter()
        .zip(&off_node)
        .all(|(a, b)| (f64::from(*a) - b).abs() < 1e-6);
    assert!(same, "{spectrum:?} {off_node:?}");

    let refused =
        |options: &str| folder.fails(&format!("query out/g {SNOW} --thickness-cm 5 {options}"));
    let missing = refused("--water-saturation 0.02");
    assert!(
        missing.contains("axis black_carbon_ng_g: give a value of black_carbon_ng_g from 0 to 100"),
        "{missing}"
    );
    let outside = refused("--black-carbon-ng-g 101 --water-saturation 0");
    assert!(outside.contains("covers 0 to 100"), "{outside}");
    let none = refused("--black-carbon-ng-g 1 --water-saturation 0 --temperature-c -3");
    assert!(none.contains("no axis temperature_c"), "{none}");
    let published = refused("--black-carbon-ng-g 0 --water-saturation 0 --method varsa2025");
    assert!(published.contains("axis black_carbon_ng_g"), "{published}");

    assert_verified(&folder);
}

/// `verify` accepts the database, and refuses it after a chunk is replaced.
fn assert_verified(folder: &Folder) {
    let report = folder.succeeds("verify out/g --samples 4 --points 16 --point-rays 16384");
    assert!(report.ends_with("PASS\n"), "{report}");
    assert!(
        report.contains("off the nodes in black_carbon_ng_g"),
        "{report}"
    );
    assert!(
        report.contains("off the nodes in water_saturation"),
        "{report}"
    );
    let path = folder.out("g").join("snow.safetensors");
    let file = Database::open(&path).unwrap();
    let error_budget: ErrorBudget = serde_json::from_str(&file.metadata()[ERROR_BUDGET]).unwrap();
    let worst = &error_budget.quantities["transmittance"].worst[0].at;
    assert!(worst.contains("degrees, black carbon "), "{worst}");

    // a chunk of other values of the optional axes is detected: job 1 in the place of job 2
    let path = folder
        .out("g")
        .join("database.zarr/transmittance/c.0.0.0.0.0.0.0.0");
    let mut bytes = fs::read(&path).unwrap();
    let chunk = 3 * 2 * 3 * 4 + 4;
    bytes.copy_within(chunk..2 * chunk, 2 * chunk);
    fs::write(path, bytes).unwrap();
    let report = folder.run("verify out/g --samples 4 --points 0");
    assert!(!report.status.success());
    let report = String::from_utf8(report.stdout).unwrap();
    assert!(
        report.contains("job 2 is missing or damaged")
            && report.contains("black carbon 100 ng g-1, water saturation 0"),
        "{report}"
    );
}

/// The canonical config of a grid describes the same grid. Without optional axes it does not
/// mention them.
#[test]
fn the_canonical_config_describes_the_same_grid() {
    let grid = |text: &str| config::grid::parse(Path::new("g.toml").to_str().unwrap(), text);
    let all_axes = GRID.replace(
        "water_saturation = [0, 0.05]",
        "water_saturation = [0, 0.05]\ntemperature_c = [-10, -1]\nsphericity = [0.7, 0.9]\nsubstrate_reflectance = [0, 0.5]",
    ) + "[fixed]\nblack_carbon = { sedimentation = 0.5 }\n";
    for text in [GRID, &all_axes] {
        let read = grid(text).unwrap().grid;
        let again = grid(&read.to_config()).unwrap().grid;
        assert_eq!(read.describe(), again.describe());
        assert_eq!(read.axes, again.axes);
    }
    let read = grid(&all_axes).unwrap().grid;
    assert_eq!(read.axes.optional().count(), 32);
    let jobs = read.jobs().unwrap();
    let job = read.job(&jobs, jobs.count() - 1).unwrap();
    let surface = &job.snowpack.surface;
    let carbon = surface.black_carbon.unwrap();
    assert_eq!(
        (carbon.concentration_ng_g, carbon.sedimentation),
        (100.0, 0.5)
    );
    assert_eq!(
        (surface.temperature_c, surface.water_saturation),
        (-1.0, 0.05)
    );
    assert_eq!(surface.grains[0].grain.proportion.mean(), 0.9);
    let core_axes = grid(&GRID.replace(
        "black_carbon_ng_g = [0, 100]\nwater_saturation = [0, 0.05]\n",
        "",
    ));
    let core_axes = core_axes.unwrap().grid;
    assert!(
        !core_axes.to_config().contains("carbon") && !core_axes.to_config().contains("sphericity_")
    );
}
