//! `--bands`: averages over the bands of sensors, in all commands that have the option.
#![allow(clippy::unwrap_used)]
use std::path::Path;
use std::process::{Command, Output};
use std::sync::OnceLock;

use assert_cmd::cargo::cargo_bin;
use serde_json::Value;

/// Wavelengths that the bands replace.
const SAMPLE: &str = "\
version = 1
[illumination]
incidence_angle_deg = 30
[wavelengths]
values_nm = [450]
[[layer]]
thickness_cm = 10
density_kg_m3 = 300
[[layer.grain]]
size_um = { min = 300, max = 500 }
facetness = { min = 0.2, max = 0.4, mean = 0.3, sd = 0.072 }
";
const GRID: &str = "\
version = 1
[axes]
facetness = [0.3]
grain_size_um = [150, 250, 400, 600]
density_kg_m3 = [300]
thickness_cm = [5, 50]
incidence_angle_deg = [0]
[wavelengths]
start_nm = 430
stop_nm = 910
step_nm = 20
[run]
rays = 4000
";

fn splitsnow(folder: &Path, line: &str) -> Output {
    let mut command = Command::new(cargo_bin!("splitsnow"));
    let command = command.current_dir(folder).args(line.split_whitespace());
    command.output().unwrap()
}

/// The standard output of a command, which must succeed.
fn text(folder: &Path, line: &str) -> String {
    let output = splitsnow(folder, line);
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{line}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// The message of a command, which must fail and print nothing else.
fn message(folder: &Path, line: &str) -> String {
    let output = splitsnow(folder, line);
    assert!(
        !output.status.success() && output.stdout.is_empty(),
        "{line}"
    );
    String::from_utf8(output.stderr).unwrap()
}

/// The rows of CSV, without comments, as cells; the header is first.
fn rows(csv: &str) -> Vec<Vec<&str>> {
    let lines = csv.lines().filter(|line| !line.starts_with('#'));
    lines.map(|line| line.split(',').collect()).collect()
}

fn number(cell: &str) -> f64 {
    cell.parse().unwrap()
}

/// A folder with the sample, a table of bands, and the database of the grid in `db`.
fn folder() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let made = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text);
        write("sample.toml", SAMPLE).unwrap();
        write("grid.toml", GRID).unwrap();
        write(
            "narrow.csv",
            "band,centre_nm,fwhm_nm\na,600,0.5\nb,1030,0.5\n",
        )
        .unwrap();
        write("at.toml", &SAMPLE.replace("[450]", "[600, 1030]")).unwrap();
        text(folder.path(), "build grid.toml --out db");
        folder
    });
    made.path()
}

const AT: &str = "--facetness 0.3 --grain-size-um 300 --density-kg-m3 300 --thickness-cm 20 --incidence-angle-deg 0";

#[test]
fn simulated_bands_say_what_they_are() {
    let csv = text(
        folder(),
        "simulate sample.toml --rays 3000 --bands sentinel2a",
    );
    for line in [
        "# bands: sentinel2a; Sentinel-2A MSI: ESA,",
        "# sun: astm_global; 2.16 % of its energy is outside 350-2500 nm",
        "# wavelengths: 169 from 430 to 2320 nm",
    ] {
        assert!(csv.lines().any(|l| l.starts_with(line)), "{csv}");
    }
    let rows = rows(&csv);
    assert_eq!(
        rows[0].join(","),
        "band,centre_nm,from_nm,to_nm,reflectance,reflectance_se,transmittance,transmittance_se,absorptance"
    );
    assert_eq!(rows.len(), 14);
    assert_eq!(rows[9][..4], ["B8A", "864.71", "849", "880"]);
    for row in &rows[1..] {
        let [r, r_se, t, _, a] = [4, 5, 6, 7, 8].map(|i| number(row[i]));
        assert!(
            (1.0 - r - t - a).abs() < 1e-12 && 0.0 < r_se && r_se < 0.01,
            "{row:?}"
        );
    }
    // ice is dark at 1.6 um, so snow is
    assert!(
        number(rows[2][4]) > 0.9 && number(rows[12][4]) < 0.15,
        "{csv}"
    );

    let json = text(
        folder(),
        "simulate sample.toml --rays 3000 --bands sentinel2a --json",
    );
    let json: Value = serde_json::from_str(&json).unwrap();
    let bands = &json["bands"];
    assert_eq!(bands["sun"], "astm_global");
    for (i, row) in rows[1..].iter().enumerate() {
        assert_eq!(bands["band"][i], row[0]);
        assert_eq!(bands["reflectance"][i].as_f64(), Some(number(row[4])));
        assert_eq!(bands["reflectance_se"][i].as_f64(), Some(number(row[5])));
    }
    assert_eq!(json["wavelength_nm"].as_array().unwrap().len(), 169);
}

/// Bands of 0.5 nm are the spectrum at their centres: 600 and 1030 nm are among the simulated
/// wavelengths, and the same walks give the same values.
#[test]
fn narrow_bands_are_the_spectrum() {
    for engine in ["spectral", "reference"] {
        let run = |words: &str| {
            let line = format!("simulate {words} --rays 2000 --engine {engine}");
            text(folder(), &line)
        };
        let (bands, spectrum) = (run("sample.toml --bands narrow.csv"), run("at.toml"));
        let (bands, spectrum) = (rows(&bands), rows(&spectrum));
        for (band, at) in bands[1..].iter().zip(&spectrum[1..]) {
            let difference = number(band[4]) - number(at[1]);
            let se = number(band[5]).hypot(number(at[2]));
            // five standard errors: other wavelengths have other nodes of refractive index
            assert!(difference.abs() < 5.0 * se, "{engine}: {band:?} {at:?}");
        }
    }
}

#[test]
fn the_visible_and_the_near_infrared_make_the_whole() {
    let shares = [("astm_global", 0.9784), ("subarctic_winter", 0.977)];
    for (sun, least) in shares {
        let line = format!("simulate sample.toml --rays 500 --bands broadband --sun {sun}");
        let csv = text(folder(), &line);
        let rows = rows(&csv);
        let [total, visible, infrared] = [1, 2, 3].map(|i| number(rows[i][4]));
        let share = splitsnow::sensor::SolarSpectrum::find(sun).unwrap();
        let within = share.share(350.0, 2500.0).unwrap();
        assert!(within >= least, "{within}");
        let part = share.share(350.0, 700.0).unwrap() / within;
        let sum = part * visible + (1.0 - part) * infrared;
        assert!((sum - total).abs() < 1e-9, "{sum} {total}");
        assert!(visible > 0.9 && infrared < 0.8, "{csv}");
    }
}

#[test]
fn a_query_averages_the_same_spectrum() {
    let query = format!("query db {AT} --quantity reflectance");
    let spectrum = text(folder(), &query);
    let bands = text(
        folder(),
        &format!("{query} --bands sentinel2a:B4,B3 --sun equal_energy"),
    );
    let rows_of_bands = rows(&bands);
    assert_eq!(
        rows_of_bands[0].join(","),
        "band,centre_nm,from_nm,to_nm,value"
    );
    assert_eq!([1, 2].map(|i| rows_of_bands[i][0]), ["B4", "B3"]);
    // trapezoids of 0.1 nm over the table of responses
    let table = include_str!("../crates/spectra/data/sensors/sentinel2a.csv");
    let spectrum: Vec<(f64, f64)> = rows(&spectrum)[1..]
        .iter()
        .map(|row| (number(row[0]), number(row[1])))
        .collect();
    let linear = |points: &[(f64, f64)], x: f64| {
        let above = points
            .partition_point(|(nm, _)| *nm <= x)
            .clamp(1, points.len() - 1);
        let ((a, y), (b, z)) = (points[above - 1], points[above]);
        y + (z - y) * (x - a) / (b - a)
    };
    for row in &rows_of_bands[1..] {
        let response: Vec<(f64, f64)> = rows(table)[1..]
            .iter()
            .filter(|cells| cells[0] == row[0])
            .map(|cells| (number(cells[1]), number(cells[2])))
            .collect();
        let (first, last) = (response[0].0, response[response.len() - 1].0);
        let steps = ((last - first) * 10.0).round() as usize;
        let (mut sum, mut whole) = (0.0, 0.0);
        for i in 0..=steps {
            let nm = first + (last - first) * i as f64 / steps as f64;
            let end = if i == 0 || i == steps { 0.5 } else { 1.0 };
            let weight = end * linear(&response, nm);
            sum += weight * linear(&spectrum, nm);
            whole += weight;
        }
        let value = number(row[4]);
        assert!(
            (sum / whole - value).abs() < 1e-6,
            "{row:?}: {}",
            sum / whole
        );
    }
}

#[test]
fn exported_bands_are_those_of_queries() {
    let node = AT
        .replace("300 --density", "250 --density")
        .replace("20", "50");
    let query = format!("query db {node} --quantity reflectance --bands viirs:M5,I1,M3");
    let query = text(folder(), &query);
    let line = "export db --format csv --bands viirs:M5,I1,M3 --out bands.csv";
    let printed = text(folder(), line);
    assert!(
        printed.ends_with("M3: 488.00 nm\nI1: 640.00 nm\nM5: 672.00 nm\n"),
        "{printed}"
    );
    let exported = std::fs::read_to_string(folder().join("bands.csv")).unwrap();
    let exported = rows(&exported);
    let column = |name: &str| exported[0].iter().position(|cell| *cell == name).unwrap();
    let [size, thickness, nm, reflectance] = [
        "grain_size_um",
        "thickness_cm",
        "wavelength_nm",
        "reflectance",
    ]
    .map(column);
    for row in &rows(&query)[1..] {
        let found = exported[1..].iter().find(|cells| {
            cells[size] == "250" && cells[thickness] == "50" && number(cells[nm]) == number(row[1])
        });
        let difference = number(found.unwrap()[reflectance]) - number(row[4]);
        assert!(difference.abs() < 1e-6, "{row:?} {found:?}");
    }
    // the standard errors of the database are averaged, too
    text(
        folder(),
        "export db --from database --format csv --bands viirs:M3 --out se.csv",
    );
    let errors = std::fs::read_to_string(folder().join("se.csv")).unwrap();
    let errors = rows(&errors);
    let se = errors[0]
        .iter()
        .position(|cell| *cell == "reflectance_se")
        .unwrap();
    assert!(
        errors[1..]
            .iter()
            .all(|row| (1e-6..0.02).contains(&number(row[se])))
    );
}

#[test]
fn bands_that_were_measured_give_the_snow() {
    let query = format!("query db {AT} --quantity reflectance --bands sentinel2a:B2,B3,B4,B5,B8A");
    let csv = text(folder(), &query);
    let rows = rows(&csv);
    let mut pixel = "Band; Reflectance (%); SD\n".to_owned();
    // in any order
    for row in rows[1..].iter().rev() {
        let value = format!("{:.3}", 100.0 * number(row[4])).replace('.', ",");
        pixel += &format!("{}; {value}; 0,5\n", row[0].to_lowercase());
    }
    std::fs::write(folder().join("pixel.csv"), pixel).unwrap();
    let line = "retrieve pixel.csv --within db --bands sentinel2a:B2,B3,B4,B5,B8,B8A --fix thickness_cm=20 --json";
    let found: Value = serde_json::from_str(&text(folder(), line)).unwrap();
    let mut estimates = found["estimates"].as_array().unwrap().iter();
    let size = estimates.find(|e| e["name"] == "grain_size_um").unwrap();
    let best = size["best"].as_f64().unwrap();
    assert!((best / 300.0 - 1.0).abs() < 0.02, "{size}");
    let spectrum = &found["spectra"][0];
    assert_eq!(
        spectrum["wavelength_nm"].as_array().map(Vec::len),
        Some(5),
        "{spectrum}"
    );
    let exact = text(
        folder(),
        &format!("{} --exact --rays 20000", line.replace("B8,", "")),
    );
    let exact: Value = serde_json::from_str(&exact).unwrap();
    assert!(
        exact["exact"]["largest_in_sigma"].as_f64().unwrap() < 1.0,
        "{}",
        exact["exact"]
    );
}

#[test]
fn wrong_requests_are_refused() {
    let folder = folder();
    std::fs::write(folder.join("words.csv"), "B2 is bright\n").unwrap();
    std::fs::write(folder.join("far.csv"), "nm,x\n5100,1\n5200,1\n").unwrap();
    std::fs::write(folder.join("dim.csv"), "nm,power\n500,1\n600,1\n").unwrap();
    let query = format!("query db {AT}");
    for (line, part) in [
        (
            "simulate sample.toml --bands sentinel2c",
            "no sensor is named `sentinel2c`",
        ),
        (
            "simulate sample.toml --bands modis:B99",
            "modis has no band `B99`",
        ),
        (
            "simulate sample.toml --bands words.csv",
            "words.csv: no row with a wavelength",
        ),
        (
            "simulate sample.toml --bands far.csv --sun equal_energy",
            "far.csv: the wavelengths (none) do not cover x; needed are 5100 to 5200 nm",
        ),
        (
            "simulate sample.toml --bands modis:B1 --sun dim.csv",
            "dim.csv: no power at all wavelengths of the band B1",
        ),
        (
            "simulate sample.toml --bands modis --sun moon",
            "no solar spectrum is named `moon`",
        ),
        ("simulate sample.toml --sun astm_global", "--bands"),
        (
            "simulate sample.toml --bands modis --goniometer",
            "cannot be used with",
        ),
        (
            "simulate sample.toml --bands modis --view-deg 0",
            "cannot be used with",
        ),
        (
            &format!("{query} --bands landsat8"),
            "choose bands that are covered: landsat8:B1,B2,B3,B4,B5",
        ),
        (
            "export db --format spd --bands modis",
            "--bands applies only to netcdf, csv and npz",
        ),
        (
            "export db --format csv --bands viirs:M7,I2",
            "the bands M7 and I2 have the same mean wavelength",
        ),
        (
            "retrieve words.csv --within db --bands sentinel2a:B3,B4",
            "no row begins with the name of a band",
        ),
    ] {
        let message = message(folder, line);
        assert!(message.contains(part), "{line}: {message}");
    }
}
