//! A grid with absent curves, from the grid file to the answers of `query`.
//!
//! A curve is absent if the largest grains of its node do not fit into the slab.
use std::fs;

use splitsnow::config;
use splitsnow::grid::absent_curves;
use splitsnow::lookup::Database;
use splitsnow::measurement::Quantity;
use splitsnow::store::{Store, Variable};

use crate::common::Folder;

/// A grid as used for satellite data assimilation, with fewer nodes. Grains of 2793 um do
/// not fit into a slab of 2 cm.
const GRID: &str = "version = 1
[axes]
facetness = [0.3]
grain_size_um = [140, 559, 1396, 2793]
density_kg_m3 = [100, 200, 300, 400]
thickness_cm = [2, 5, 10, 100]
incidence_angle_deg = [0, 30, 60, 75]
[spread]
grain_size_half_width_um = 10
[wavelengths]
values_nm = [400, 500, 600, 700, 1000, 1600, 2200]
[run]
engine = \"hybrid\"
rays = 2000
[compression]
max_delta_e = 5
";
const SNOW: &str = "--facetness 0.3 --density-kg-m3 250 --incidence-angle-deg 20";

#[test]
fn absent_curves_of_the_satellite_grid_are_counted() {
    let text = include_str!("data/crtm323_converted.toml");
    let text = format!("{text}[run]\nengine = \"hybrid\"\nrays = 10000\n");
    let file = config::grid::parse("crtm323.toml", &text).unwrap();
    let absent = file.grid.absent().unwrap();
    assert_eq!(absent, [0, 0, 0, 0, 0, 1]);
    // five densities times ten incidence angles
    assert_eq!(absent_curves(&file.grid.axes, &absent), 50);
    let warned = file
        .warnings
        .iter()
        .any(|w| w.contains("50 of 2400 curves do not exist"));
    assert!(warned, "{:?}", file.warnings);
    // a thickness too thin for all sizes is an error, and so is a size too large for all
    // thicknesses
    let refused = |from: &str, to: &str| {
        let text = text.replace(from, to);
        config::grid::parse("crtm323.toml", &text)
            .unwrap_err()
            .to_string()
    };
    let error = refused("[2, 5,", "[0.05, 2, 5,");
    assert!(
        error.contains("`axes.thickness_cm[0]` = 0.05 is out of range"),
        "{error}"
    );
    let error = refused("[2, 5, 10, 20, 30, 40, 50, 100]", "[1, 2]");
    assert!(
        error.contains("`axes.thickness_cm[1]` = 2 is out of range"),
        "{error}"
    );
}

/// The default half width of the sizes would make grains smaller than 0.
#[test]
fn the_default_spread_is_narrowed_for_small_sizes() {
    let text = include_str!("data/crtm323_naive.toml");
    let file = config::grid::parse("crtm323.toml", text).unwrap();
    assert_eq!(file.grid.spread.grain_size_half_width_um, 20.0);
    let warned = file.warnings.iter().any(|w| {
        w.contains("spread.grain_size_half_width_um is lowered from its default 50 to 20")
    });
    assert!(warned, "{:?}", file.warnings);
    assert_eq!(file.grid.absent().unwrap(), [0, 0, 0, 0, 0, 0, 1]);
    // a spread given in the file is not changed
    let with_spread = format!("{text}[spread]\ngrain_size_half_width_um = 50\n");
    let error = config::grid::parse("crtm323.toml", &with_spread).unwrap_err();
    assert!(
        error.to_string().contains("makes grains of -20 to 80 um"),
        "{error}"
    );
    // the default spread is kept if it fits
    let larger_sizes = text.replace("[30, 50, 100,", "[60, 100,");
    let file = config::grid::parse("crtm323.toml", &larger_sizes).unwrap();
    assert_eq!(file.grid.spread.grain_size_half_width_um, 50.0);
}

#[test]
fn absent_curves_are_nan_and_all_others_are_computed() {
    let folder = Folder::new(GRID);
    let plan: serde_json::Value =
        serde_json::from_str(&folder.succeeds("plan g.toml --json")).unwrap();
    assert_eq!(
        (&plan["curves"], &plan["absent_curves"]),
        (&256.into(), &16.into())
    );
    let built = folder.succeeds("build g.toml");
    assert!(
        built.contains("absent          16 of 256 curves do not exist"),
        "{built}"
    );

    let store = Store::open(&folder.out("g")).unwrap();
    assert!(store.missing().unwrap().is_empty());
    assert!(store.verify().unwrap().is_whole());
    assert_eq!(store.absent(), [0, 0, 0, 1]);
    for variable in Variable::ALL {
        let values = store.read(variable).unwrap();
        for (row, curve) in values.rows().into_iter().enumerate() {
            // axes after facetness: size, density, thickness, incidence angle
            let absent = row / 64 == 3 && row / 4 % 4 == 0;
            assert!(curve.iter().all(|value| value.is_nan() == absent), "{row}");
        }
    }
    let status = fs::read(folder.out("g").join("database.zarr/curve_status/c.0.0")).unwrap();
    assert_eq!(
        status[..16],
        [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]
    );

    let file = Database::open(folder.out("g").join("snow.safetensors")).unwrap();
    assert_eq!(file.absent(), [0, 0, 0, 1]);
    let reflectance = store.read(Variable::REFLECTANCE).unwrap();
    for row in 0..file.curves() {
        let curve = file.curve(row, Quantity::Reflectance).unwrap();
        assert_eq!(file.exists(row), !reflectance[[row, 0]].is_nan());
        assert_eq!(curve[0].is_nan(), !file.exists(row));
        if file.exists(row) {
            assert!((curve[2] - reflectance[[row, 2]]).abs() < 0.05, "{row}");
        }
    }

    // queries that need an absent curve are refused and name the node; others are answered
    let query = |size: f64, cm: f64| {
        format!("query out/g {SNOW} --grain-size-um {size} --thickness-cm {cm}")
    };
    for (size, cm) in [(2793.0, 2.0), (2793.0, 4.9), (2000.0, 3.0), (1397.0, 1.0)] {
        let error = folder.fails(&query(size, cm));
        assert!(
            error.contains("grains of the node 2793 um do not fit into a slab thinner than 5 cm"),
            "{error}"
        );
    }
    for (size, cm) in [
        (2793.0, 5.0),
        (2793.0, 7.0),
        (1396.0, 2.0),
        (2000.0, 5.5),
        (2793.0, 300.0),
    ] {
        folder.succeeds(&query(size, cm));
    }
    let published =
        "--facetness 0.3 --density-kg-m3 200 --incidence-angle-deg 0 --method varsa2025";
    let error = folder.fails(&format!(
        "query out/g {published} --grain-size-um 2793 --thickness-cm 10"
    ));
    assert!(error.contains("2793"), "{error}");

    // exports have NaN for the absent curves
    folder.succeeds("export out/g --format netcdf --layout crtm --out SNICAR.nc");
    let file = netcdf3::FileReader::open(folder.0.path().join("SNICAR.nc"));
    let mut file = file.unwrap();
    let values = file.read_var_f64("Reflectance").unwrap();
    // dimensions: n_Densities, n_Depths, n_Grain_Sizes, n_Frequencies, n_Angles
    for (index, value) in values.iter().enumerate() {
        let absent = index / (4 * 7) % 4 == 3 && index / (4 * 7 * 4) % 4 == 0;
        assert_eq!(value.is_nan(), absent, "{index}");
    }
    let csv = folder.succeeds("export out/g --format csv --from database --out all.csv");
    assert!(csv.starts_with("all.csv"));
    let csv = fs::read_to_string(folder.0.path().join("all.csv")).unwrap();
    assert_eq!(
        csv.lines().filter(|line| line.contains("NaN")).count(),
        16 * 7
    );
    folder.succeeds("export out/g --format svg --grain-size-um 2793 --out patches.svg");

    // `verify` checks the files and the bounds for the curves that exist
    let report = folder.succeeds("verify out/g --points 0 --samples 0 --json");
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["passed"], true);
    // `verify` draws its nodes from those that exist
    let report = folder.succeeds("verify out/g --points 0 --samples 3 --rays 200");
    assert!(report.contains("3 nodes of different jobs"), "{report}");
    // `tradeoff` plots the compression errors of the curves that exist
    fs::write(
        folder.0.path().join("slab.toml"),
        include_str!("data/slab.toml"),
    )
    .unwrap();
    folder.succeeds("tradeoff slab.toml --engine reference --database out/g --budget 0.1 --truth-rays 64 --seeds 2 --out out");

    // absent curves are not missing jobs; quantised files have the same absent curves
    assert!(
        folder
            .succeeds("build g.toml")
            .starts_with("16 jobs, 0 of them run now")
    );
    folder.succeeds("compress out/g --basis log --precision quantised --max-delta-e 5");
    folder.fails(&query(2793.0, 2.0));
    folder.succeeds(&query(2793.0, 5.0));
}

/// A grid may have isotropic light in addition to incidence angles. Its results are stored
/// in separate arrays and a separate compact file.
#[test]
fn isotropic_light_is_stored_and_looked_up() {
    let text = "version = 1
[axes]
facetness = [0.3]
grain_size_um = [300, 1200]
density_kg_m3 = [250]
thickness_cm = [1, 3, 9]
incidence_angle_deg = [0, 60]
diffuse = true
[wavelengths]
values_nm = [500, 600, 1030]
[run]
engine = \"hybrid\"
rays = 4000
[compression]
max_delta_e = 5
";
    let spectral = text.replace("hybrid", "spectral");
    let error = config::grid::parse("g.toml", &spectral)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("`axes.diffuse`") && error.contains("hybrid"),
        "{error}"
    );

    let folder = Folder::new(text);
    let built = folder.succeeds("build g.toml");
    assert!(built.contains("under isotropic light: "), "{built}");
    let store = Store::open(&folder.out("g")).unwrap();
    assert!(store.has_diffuse() && store.verify().unwrap().is_whole());
    let read = |variable| store.read(variable).unwrap();
    let [diffuse, se] = [
        Variable::REFLECTANCE.diffuse(),
        Variable::REFLECTANCE.diffuse().se(),
    ]
    .map(read);
    let direct = read(Variable::REFLECTANCE);
    assert_eq!((diffuse.dim(), direct.dim()), ((6, 3), (12, 3)));
    for slab in 0..6 {
        for l in 0..3 {
            let [normal, oblique] = [0, 1].map(|angle| direct[[2 * slab + angle, l]]);
            let (value, se) = (diffuse[[slab, l]], se[[slab, l]]);
            // grains of up to 1250 um do not fit into 1 cm
            if slab == 3 {
                assert!(value.is_nan() && se.is_nan() && normal.is_nan());
                continue;
            }
            // a mean over directions; half of the light is incident within 45 degrees
            assert!(normal < value && value < oblique + 5.0 * se, "{slab} {l}");
        }
    }

    // an independent simulation with other random numbers agrees
    let sample = "version = 1
[illumination]
diffuse = true
[wavelengths]
values_nm = [500, 600, 1030]
[[layer]]
thickness_cm = 3
density_kg_m3 = 250
[[layer.grain]]
size_um = { min = 250, max = 350 }
facetness = { min = 0.2, max = 0.4, mean = 0.3, sd = 0.072 }
sphericity = { min = 0.6, max = 0.95, mean = 0.798, sd = 0.064 }
";
    fs::write(folder.0.path().join("s.toml"), sample).unwrap();
    let measured = folder.succeeds("measure s.toml --engine hybrid --rays 4000 --seed 99");
    let rows = measured
        .lines()
        .filter(|line| line.starts_with(|c: char| c.is_ascii_digit()));
    assert_eq!(rows.clone().count(), 3, "{measured}");
    for (l, row) in rows.enumerate() {
        let cells: Vec<f32> = row.split(',').map(|cell| cell.parse().unwrap()).collect();
        // six combined standard errors; there are three comparisons
        let allowed = 6.0 * (cells[2].powi(2) + se[[1, l]].powi(2)).sqrt();
        let difference = (cells[1] - diffuse[[1, l]]).abs();
        assert!(
            difference < allowed,
            "{row}: {} +- {}",
            diffuse[[1, l]],
            se[[1, l]]
        );
    }

    let snow = "--facetness 0.3 --grain-size-um 300 --density-kg-m3 250 --thickness-cm 3";
    let answer = folder.succeeds(&format!(
        "query out/g --diffuse --quantity reflectance {snow}"
    ));
    assert_eq!(answer.lines().count(), 1 + 3, "{answer}");
    for (l, row) in answer.lines().skip(1).enumerate() {
        let value: f32 = row.split_once(',').unwrap().1.parse().unwrap();
        assert!((value - diffuse[[1, l]]).abs() < 0.01, "{row}");
    }
    let thin = snow.replace("300", "1200").replace("-cm 3", "-cm 2");
    folder.fails(&format!("query out/g --diffuse {thin}"));
    folder.succeeds("export out/g --format netcdf --diffuse --from database --out d.nc");
    let file = netcdf3::FileReader::open(folder.0.path().join("d.nc"));
    let mut file = file.unwrap();
    let names = file
        .data_set()
        .get_var("reflectance_diffuse")
        .unwrap()
        .dim_names();
    assert_eq!(names.len(), 5);
    assert!(!names.contains(&"angle_deg".to_owned()));
    let values = file.read_var_f32("reflectance_diffuse_se").unwrap();
    assert_eq!(values.len(), 18);
    folder.succeeds("export out/g --format npz --diffuse");
    assert!(
        folder
            .succeeds("build g.toml")
            .starts_with("2 jobs, 0 of them run now")
    );
    folder.succeeds("verify out/g --points 0 --samples 2 --threads 1");
    // `query` accepts the path of the file of isotropic light; `verify` checks the file
    let point = "--facetness 0.3 --grain-size-um 300 --density-kg-m3 250 --thickness-cm 3";
    folder.succeeds(&format!(
        "query out/g/diffuse.safetensors --diffuse {point}"
    ));
    let path = folder.out("g").join("diffuse.safetensors");
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..100]).unwrap();
    let report = folder.run("verify out/g --points 0 --samples 0");
    let text = String::from_utf8(report.stdout).unwrap();
    assert!(!report.status.success(), "{text}");
    assert!(
        text.contains("FAIL  compact file of isotropic light"),
        "{text}"
    );
    // the file of collimated light is not accepted in its place
    fs::copy(folder.out("g").join("snow.safetensors"), &path).unwrap();
    folder.fails("verify out/g --points 0 --samples 0");
}
