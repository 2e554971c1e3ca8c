//! A database of light toward views, from the grid file to the answers of `query`.
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64};

use splitsnow::config;
use splitsnow::engine::{Cache, Control, Engine, exits};
use splitsnow::lookup::{Database, VIEWS, VIEWS_DIFFUSE};
use splitsnow::measurement::{Measured, Quantity, Spectrum, ViewFactors, Views};
use splitsnow::parameter::{Parameter, Point};
use splitsnow::store::{Store, Variable};

use crate::common::{Folder, assert_same, dir_bytes};

/// A small grid with views, diffuse light and curves that do not exist.
const GRID: &str = include_str!("data/views.toml");
const SNOW: &str = "--facetness 0.3 --grain-size-um 300 --density-kg-m3 300 --thickness-cm 20";

/// The second column of a table.
fn second_column(text: &str) -> Vec<f64> {
    let lines = text
        .lines()
        .skip_while(|line| line.starts_with('#'))
        .skip(1);
    let values = lines.map(|line| line.split_once(',').unwrap().1.parse().unwrap());
    values.collect()
}

/// The rows of a variable at all views, for curve number `curve`.
fn rows(store: &Store, variable: Variable, curve: usize) -> Vec<Vec<f32>> {
    let values = store.read(variable).unwrap();
    let hemispherical = Variable {
        is_view: false,
        ..variable
    };
    let curves = store.read(hemispherical).unwrap().nrows();
    let rows = (curve..values.nrows()).step_by(curves);
    rows.map(|row| values.row(row).to_vec()).collect()
}

#[test]
fn a_database_with_views_is_built_checked_and_queried() {
    let folder = Folder::new(GRID);
    let plan = folder.succeeds("plan g.toml");
    assert!(
        plan.contains("view_deg             3 values, 0 to 60"),
        "{plan}"
    );
    assert!(plan.contains("views           6 for each curve"), "{plan}");
    let report = folder.succeeds("build g.toml --threads 1");
    assert!(
        report.contains("anisotropy factors toward views"),
        "{report}"
    );

    // the bytes depend neither on threads, nor on shards, nor on lost files
    let whole = dir_bytes(&folder.out("g"));
    folder.succeeds("build g.toml --shard 1/2 --out out/g2");
    folder.succeeds("build g.toml --threads 2 --out out/g2");
    let lost = folder.out("g2").join("database.zarr/brf/c.0.0.0.0.0.0.0.0");
    fs::remove_file(lost).unwrap();
    fs::remove_file(folder.out("g2").join(VIEWS)).unwrap();
    folder.succeeds("build g.toml --out out/g2");
    let without_locks = |path: &Path| {
        let mut files = dir_bytes(path);
        files.retain(|name, _| !name.contains("lock"));
        files
    };
    let mut expected = whole.clone();
    expected.retain(|name, _| !name.contains("lock"));
    assert_same(&expected, &without_locks(&folder.out("g2")));

    // dimensions, curves that do not exist, and diffuse light
    let store = Store::open(&folder.out("g")).unwrap();
    let metadata = fs::read(folder.out("g").join("database.zarr/hdrf/zarr.json")).unwrap();
    let metadata: serde_json::Value = serde_json::from_slice(&metadata).unwrap();
    assert_eq!(metadata["shape"], serde_json::json!([3, 1, 2, 1, 2, 3]));
    assert_eq!(metadata["dimension_names"][0], "view_deg");
    assert_eq!(metadata["dimension_names"][4], "thickness_cm");
    let brf = Variable::REFLECTANCE.toward_views();
    assert_eq!(store.read(brf).unwrap().dim(), (6 * 8, 3));
    // curves: size, thickness, angle
    let absent = rows(&store, brf, 4);
    assert!(absent.iter().flatten().all(|value| value.is_nan()));
    let views = rows(&store, brf, 3);
    assert!(views.iter().flatten().all(|value| value.is_finite()));
    assert_eq!(views[0], views[1], "azimuths of the normal");
    let normal = rows(&store, brf, 2);
    for [forward, back] in normal.as_chunks::<2>().0 {
        for (forward, back) in forward.iter().zip(back) {
            assert!((forward - back).abs() < 1e-5, "light from the normal");
        }
    }

    // look-ups on nodes are the factors of the compact files, times R of the other file
    let query = |rest: &str| second_column(&folder.succeeds(&format!("query out/g {SNOW} {rest}")));
    let node = |name: &str, incidence: f64, view: f64, azimuth: f64| {
        let point = Point::from_core([0.3, 300.0, 300.0, 20.0, incidence])
            .with(Parameter::View, view)
            .with(Parameter::RelativeAzimuth, azimuth);
        let file = Database::open(folder.out("g").join(name)).unwrap();
        let factors = file.spectrum(point, Quantity::Reflectance).unwrap();
        // look-ups take a factor below 0 as 0
        factors
            .into_iter()
            .map(|factor| factor.max(0.0))
            .collect::<Vec<_>>()
    };
    let light = "--incidence-angle-deg 60";
    let view = "--view-deg 60 --relative-azimuth-deg 180";
    let factor = query(&format!(
        "{light} {view} --quantity anisotropy_factor --explain"
    ));
    for (found, expected) in factor.iter().zip(node(VIEWS, 60.0, 60.0, 180.0)) {
        assert!(
            (found - f64::from(expected)).abs() < 1e-5,
            "{found} {expected}"
        );
    }
    let reflectance = query(&format!("{light} --quantity reflectance"));
    let brf = query(&format!("{light} {view} --quantity brf"));
    for ((brf, factor), reflectance) in brf.iter().zip(factor).zip(reflectance) {
        assert!((brf - factor * reflectance).abs() < 1e-6);
    }
    let factor = query("--diffuse --view-deg 30 --quantity anisotropy_factor");
    for (found, expected) in factor.iter().zip(node(VIEWS_DIFFUSE, 0.0, 30.0, 0.0)) {
        assert!(
            (found - f64::from(expected)).abs() < 1e-5,
            "{found} {expected}"
        );
    }
    let hdrf = query("--diffuse --view-deg 30 --quantity hdrf");
    let reflectance = query("--diffuse --quantity reflectance");
    for ((hdrf, factor), reflectance) in hdrf.iter().zip(factor).zip(reflectance) {
        assert!((hdrf - factor * reflectance).abs() < 1e-6);
    }
    for (options, message) in [
        (
            "--incidence-angle-deg 60 --quantity brf",
            "give --view-deg too",
        ),
        (
            "--incidence-angle-deg 60 --view-deg 30 --quantity btf",
            "give --relative-azimuth-deg too",
        ),
        ("--diffuse --view-deg 30 --quantity brf", "ask for hdrf"),
        (
            "--diffuse --view-deg 30 --relative-azimuth-deg 0 --quantity hdrf",
            "does not depend on the azimuth",
        ),
        (
            "--incidence-angle-deg 60 --view-deg 61 --relative-azimuth-deg 0 --quantity brf",
            "view_deg = 61 is outside",
        ),
        (
            "--incidence-angle-deg 60 --view-deg 30 --quantity reflectance",
            "does not depend on a view",
        ),
    ] {
        let error = folder.fails(&format!("query out/g {SNOW} {options}"));
        assert!(error.contains(message), "{error}");
    }

    // a changed coefficient is found
    let verify = "verify out/g --points 0 --samples 1";
    let report = folder.succeeds(verify);
    assert!(
        report.contains("PASS  fresh simulations toward views"),
        "{report}"
    );
    let path = folder.out("g").join(VIEWS_DIFFUSE);
    let mut bytes = fs::read(&path).unwrap();
    let file = Database::from_bytes(&bytes).unwrap();
    let first = file.coefficients(Quantity::Reflectance)[[0, 0]].to_le_bytes();
    let position = bytes
        .windows(4)
        .rposition(|window| window == first)
        .unwrap();
    bytes[position..position + 4].copy_from_slice(&(2.0 * f32::from_le_bytes(first)).to_le_bytes());
    fs::write(&path, bytes).unwrap();
    let report = String::from_utf8(folder.run(verify).stdout).unwrap();
    assert!(
        report.contains("views_diffuse.safetensors: the factor of"),
        "{report}"
    );
}

#[test]
fn a_grown_grid_reuses_reflectance_and_gives_the_same_files() {
    let folder = Folder::new(GRID);
    let small = GRID
        .replace("[300, 1500]", "[300]")
        .replace("diffuse = true\n", "");
    folder.write("small.toml", &small.replace("[0, 30, 60]", "[0, 45]"));
    folder.write("large.toml", &small);
    folder.succeeds("build small.toml");
    let report = folder.succeeds("build large.toml --from out/small --out out/grown --json");
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["nodes_reused"], 4);
    folder.succeeds("build large.toml --out out/whole");
    assert_same(
        &dir_bytes(&folder.out("grown")),
        &dir_bytes(&folder.out("whole")),
    );
}

#[test]
fn exports_hold_factors_and_albedos() {
    let folder = Folder::new(GRID);
    folder.succeeds("build g.toml");
    folder.succeeds("export out/g --format csv --views");
    let text = fs::read_to_string(folder.out("g").join("views.csv")).unwrap();
    let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(lines.len(), 1 + 6 * 8 * 3);
    let column = |name: &str| lines[0].iter().position(|other| *other == name).unwrap();
    let number = |line: &[&str], name: &str| line[column(name)].parse::<f32>().unwrap();
    let store = Store::open(&folder.out("g")).unwrap();
    let brf = store.read(Variable::REFLECTANCE.toward_views()).unwrap();
    let hdrf = store
        .read(Variable::REFLECTANCE.toward_views().diffuse())
        .unwrap();
    let white_sky = store.read(Variable::REFLECTANCE.diffuse()).unwrap();
    for (row, line) in lines[1..].iter().enumerate() {
        let (curve, l) = (row / 3, row % 3);
        let (view, slab) = (curve / 8, curve % 8 / 2);
        let expected = [
            ("brf", brf[[curve, l]]),
            ("hdrf", hdrf[[view / 2 * 4 + slab, l]]),
            ("reflectance_diffuse", white_sky[[slab, l]]),
        ];
        for (name, expected) in expected {
            let found = number(line, name);
            assert!(
                found == expected || found.is_nan() && expected.is_nan(),
                "{line:?}"
            );
        }
        let ratio = number(line, "brf") / number(line, "reflectance");
        let difference = (number(line, "anisotropy_factor") - ratio).abs();
        assert!(
            difference <= 1e-5 * ratio.abs() || ratio.is_nan(),
            "{line:?}"
        );
    }
    let error = folder.fails("export out/g --format netcdf --views --from compact");
    assert!(error.contains("--views exports the database"), "{error}");
    let plain = GRID.replace("view_deg = [0, 30, 60]\n", "");
    let plain = plain.replace("relative_azimuth_deg = [0, 180]\n", "");
    folder.write("plain.toml", &plain.replace("view_rays = 8\n", ""));
    folder.succeeds("build plain.toml");
    let error = folder.fails("export out/plain --format netcdf --views");
    assert!(error.contains("has no views"), "{error}");
    let query = format!(
        "query out/plain {SNOW} --incidence-angle-deg 0 --view-deg 0 --relative-azimuth-deg 0 --quantity brf"
    );
    let error = folder.fails(&query);
    assert!(error.contains("no views.safetensors in"), "{error}");
}

fn factors(engine: Engine, views: &Views, rays: u64, seed: u64) -> (ViewFactors, Spectrum) {
    let text = GRID
        .replace("[450, 550, 650]", "[900]")
        .replace("[300, 1500]", "[300]");
    let grid = config::grid::parse("g.toml", &text).unwrap().grid;
    let jobs = grid.jobs().unwrap();
    let job = grid.job(&jobs, 0).unwrap();
    let (cancel, rays_done) = (AtomicBool::new(false), AtomicU64::new(0));
    let control = Control {
        parallel: false,
        cancel: &cancel,
        rays_done: &rays_done,
        cache: &Cache::default(),
    };
    let mut request = job.request(&grid);
    request.seed = seed;
    request.rays = 20_000;
    let thicknesses_m = [0.02];
    request.thicknesses_m = &thicknesses_m;
    request.illuminations = &job.illuminations[1..2];
    let spectra = Engine::Hybrid.run(&request, &control).unwrap();
    let found = exits::view_factors(engine, &request, (views, rays), &spectra, &control);
    (found.unwrap().remove(0), spectra[0].clone())
}

/// The factors of directions of equal weight add up to R and T, whatever the engine, and the
/// engines agree.
#[test]
fn factors_add_up_to_reflectance_and_transmittance() {
    // midpoints of 8 x 16 cells of equal projected solid angle
    let angles = (0..8).flat_map(|ring| {
        let cosine = (1.0 - (f64::from(ring) + 0.5) / 8.0).sqrt();
        let polar = cosine.acos().to_degrees();
        (0..16).map(move |cell| [polar, 22.5 * (f64::from(cell) + 0.5)])
    });
    let views = Views::new(&angles.collect::<Vec<_>>()).unwrap();
    let engines = [(Engine::Hybrid, 1024), (Engine::Spectral, 20_000)];
    let results = engines.map(|(engine, rays)| {
        let (found, spectrum) = factors(engine, &views, rays, 3);
        for quantity in Quantity::ALL {
            let factors = found.of(quantity);
            assert_eq!(factors.len(), views.len());
            let mean = factors.iter().map(|m| m.value).sum::<f64>() / views.len() as f64;
            let total = spectrum.of(quantity)[0].value;
            // the errors of the midpoint rule and of the fit to sensors
            assert!(
                (mean / total - 1.0).abs() < 0.02,
                "{engine:?} {mean} {total}"
            );
        }
        found
    });
    let [a, b] = &results;
    for quantity in Quantity::ALL {
        let pairs = a.of(quantity).iter().zip(b.of(quantity));
        let z = |(a, b): (&Measured, &Measured)| (a.value - b.value) / a.se.hypot(b.se);
        let squares: f64 = pairs.map(|pair| z(pair).powi(2)).sum();
        // neighbouring views share sensors, and errors are known to 13 %
        let mean = squares / views.len() as f64;
        assert!((0.5..1.6).contains(&mean), "{quantity:?} {mean}");
    }
}

/// Where no light arrives, the factors are those of Lambertian light, with an error of 100 %.
#[test]
fn light_that_is_too_weak_counts_as_lambertian() {
    let grid = GRID
        .replace("[1, 20]", "[20]")
        .replace("[450, 550, 650]", "[2000]");
    let folder = Folder::new(GRID);
    folder.write("dark.toml", &grid.replace("[300, 1500]", "[300]"));
    folder.succeeds("build dark.toml");
    let store = Store::open(&folder.out("dark")).unwrap();
    let btf = Variable::TRANSMITTANCE.toward_views();
    let (values, errors) = (store.read(btf).unwrap(), store.read(btf.se()).unwrap());
    let total = store.read(Variable::TRANSMITTANCE).unwrap();
    for (row, value) in values.rows().into_iter().enumerate() {
        let expected = total[[row % 2, 0]];
        assert!((value[0] - expected).abs() <= 1e-6 * expected);
        assert_eq!(errors[[row, 0]], value[0]);
    }
    let views = Database::open(folder.out("dark").join(VIEWS)).unwrap();
    assert!(views.holds_anisotropy());
    assert_eq!(views.axes().values(Parameter::View), [0.0, 30.0, 60.0]);
}
