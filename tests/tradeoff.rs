//! `tradeoff`: its files and its table, for a slab that takes little time.
#![allow(clippy::unwrap_used)]
use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

/// Few grains and an unusual density, which gives one warning.
const SLAB: &str = include_str!("data/slab.toml");
const CHARTS: [&str; 3] = ["tradeoff", "scaling", "components"];

/// The database to compress: 24 noisy curves.
const GRID: &str = "\
version = 1
[axes]
facetness = [0.1, 0.5]
grain_size_um = [800, 1000]
density_kg_m3 = [400]
thickness_cm = [1, 2, 4]
incidence_angle_deg = [0, 60]
[wavelengths]
start_nm = 400
stop_nm = 700
step_nm = 10
[run]
engine = \"spectral\"
rays = 300
";

fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("slab.toml"), SLAB).unwrap();
    fs::write(dir.path().join("grid.toml"), GRID).unwrap();
    dir
}

/// The same folder with the database of the grid in `out/grid`.
fn built() -> tempfile::TempDir {
    let dir = folder();
    let mut build = Command::new(env!("CARGO_BIN_EXE_splitsnow"));
    let build = build.args(["build", "grid.toml"]).current_dir(dir.path());
    text(&build.output().unwrap());
    dir
}

fn command(dir: &Path, args: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_splitsnow"));
    command.arg("tradeoff").args(args.split_whitespace());
    command.current_dir(dir);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn text(output: &Output) -> String {
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// The rows of a CSV file, by column.
fn rows(path: &Path) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    reader.deserialize().map(Result::unwrap).collect()
}

fn number(row: &BTreeMap<String, String>, column: &str) -> f64 {
    let value: f64 = row[column].parse().unwrap();
    assert!(value.is_finite() && value > 0.0, "{column} = {value}");
    value
}

#[test]
fn all_files_are_written_and_parse() {
    let dir = built();
    let args = "slab.toml --out out --database out/grid --engine reference --engine spectral --budget 2 --truth-rays 4096 --seeds 2";
    let table = text(&command(dir.path(), args).output().unwrap());
    let out = dir.path().join("out");
    for line in [
        "reference 16",
        "spectral 64",
        "reference 100000 +",
        "RMSE 0.01, visible",
    ] {
        assert!(table.lines().any(|l| l.starts_with(line)), "{table}");
    }
    for name in CHARTS {
        let svg = fs::read_to_string(out.join(format!("{name}.svg"))).unwrap();
        assert!(svg.starts_with("<svg width=\"1200\"") && svg.ends_with("</svg>\n"));
        let png = fs::read(out.join(format!("{name}.png"))).unwrap();
        // signature, length and type of the first chunk, and the width stored in it
        assert_eq!(&png[..8], b"\x89PNG\r\n\x1a\n");
        assert_eq!(png[16..20], 1200_u32.to_be_bytes());
    }

    let errors = rows(&out.join("tradeoff.csv"));
    let mut cells = BTreeMap::new();
    for row in &errors {
        assert_eq!(row["sample"], "slab");
        for column in ["cpu_seconds", "rmse", "max_abs_error", "truth_rmse_se"] {
            number(row, column);
        }
        assert!(number(row, "max_abs_error") >= number(row, "rmse"));
        assert_eq!(row["truth_rays"], "4096");
        let visible = row["band"] == "visible";
        assert_eq!(row["wavelengths"], if visible { "31" } else { "15" });
        assert_eq!(row["delta_e"].is_empty(), !visible);
        let cell = (
            row["engine"].clone(),
            row["rays"].clone(),
            row["kind"].clone(),
        );
        *cells.entry(cell).or_insert(0) += 1;
    }
    // both quantities in both bands for each setting
    assert!(cells.values().all(|count| *count == 4), "{cells:?}");
    let baseline = ("reference", "100000", "extrapolated");
    assert!(cells.contains_key(&(baseline.0.into(), baseline.1.into(), baseline.2.into())));

    let costs = rows(&out.join("scaling.csv"));
    for varied in ["thickness_cm", "wavelengths", "thicknesses", "angles"] {
        for engine in ["reference", "spectral"] {
            let matching = costs
                .iter()
                .filter(|r| r["varied"] == varied && r["engine"] == engine);
            assert!(matching.clone().count() >= 1, "{varied} {engine}");
            assert!(matching.map(|row| number(row, "cpu_seconds")).sum::<f64>() > 0.0);
        }
    }
    let components = rows(&out.join("components.csv"));
    let variant_rows = |quantity: &str, basis: &str, precision: &str| -> Vec<_> {
        let matching = components.iter().filter(|row| {
            (&*row["quantity"], &*row["basis"], &*row["precision"]) == (quantity, basis, precision)
        });
        matching.cloned().collect()
    };
    for quantity in ["transmittance", "reflectance"] {
        let linear = variant_rows(quantity, "linear", "f32");
        let full = variant_rows(quantity, "log", "f32");
        for rows in [&linear, &full] {
            assert_eq!(rows.len(), 8);
            // up to the precision of f32
            for pair in rows[..4].windows(2) {
                assert!(number(&pair[0], "rmse_mean") > number(&pair[1], "rmse_mean"));
                assert!(number(&pair[0], "bytes") < number(&pair[1], "bytes"));
            }
        }
        for precision in ["f16", "quantised_16"] {
            let half = variant_rows(quantity, "log", precision);
            assert_eq!(half.len(), 8);
            let smaller = |(a, b)| number(a, "bytes") < number(b, "bytes");
            assert!(half.iter().zip(&full).all(smaller), "{precision}");
        }
        let narrow = variant_rows(quantity, "log", "quantised");
        assert!(!narrow.is_empty());
        assert!(narrow.iter().all(|row| number(row, "delta_e_max") < 2.3));
    }
}

/// The values of a setting do not depend on the time budget, on the number of threads, or on
/// whether the truth was read from a file.
#[test]
fn values_are_reproducible_and_the_truth_is_reused() {
    let dir = built();
    let args =
        "slab.toml --database out/grid --engine spectral --truth-rays 512 --seeds 2 --json --out";
    let values = |args: &str, out: &str| {
        let json = text(
            &command(dir.path(), &format!("{args} {out}"))
                .output()
                .unwrap(),
        );
        let json: Value = serde_json::from_str(&json).unwrap();
        assert_eq!(json["truth_rays"], 512);
        assert_eq!(json["files"].as_array().unwrap().len(), 9);
        let settings = json["settings"].as_array().unwrap().clone();
        let value = |s: &Value| (s["rays"].clone(), s["error"].clone(), s["truth_se"].clone());
        let first = settings.iter().filter(|s| s["rays"] == 64);
        let first: Vec<_> = first.map(value).collect();
        assert_eq!(first.len(), 4);
        first
    };
    let first_values = values(&format!("--budget 0.2 --threads 1 {args}"), "one");
    assert_eq!(
        first_values,
        values(&format!("--budget 0.4 --threads 2 {args}"), "two")
    );
    let truths = |out: &str| -> Vec<_> {
        let entries = fs::read_dir(dir.path().join(out).join("truth")).unwrap();
        entries.map(|entry| entry.unwrap().path()).collect()
    };
    assert_eq!(truths("one").len(), 2);
    // the truth file is used: changing it changes the result
    for path in truths("one") {
        let text = fs::read_to_string(&path).unwrap();
        let mut truth: Value = serde_json::from_str(&text).unwrap();
        for part in truth["reflectance"].as_array_mut().unwrap() {
            part.as_array_mut().unwrap().fill(0.125.into());
        }
        fs::write(path, truth.to_string()).unwrap();
    }
    assert_ne!(first_values, values(&format!("--budget 0.2 {args}"), "one"));
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_names_the_files_it_keeps() {
    let dir = folder();
    let mut child = command(dir.path(), "slab.toml --truth-rays 1000000000000 --out out")
        .spawn()
        .unwrap();
    let mut errors = BufReader::new(child.stderr.take().unwrap());
    // once the warning is printed, the handler of Ctrl-C is installed
    let mut warning = String::new();
    errors.read_line(&mut warning).unwrap();
    assert!(warning.starts_with("warning: slab.toml:8:"), "{warning}");
    let id = child.id().to_string();
    assert!(
        Command::new("kill")
            .args(["-INT", &id])
            .status()
            .unwrap()
            .success()
    );
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    assert!(output.stdout.is_empty());
    let mut rest = String::new();
    errors.read_to_string(&mut rest).unwrap();
    assert_eq!(
        rest,
        "\nstopping (Ctrl-C again stops at once)\ninterrupted: nothing was written but the truths finished in out/truth\n"
    );
}
