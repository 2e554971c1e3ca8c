//! Substrate spectra from files: reading, errors, and storage in databases.
use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::Command;

use assert_cmd::cargo::cargo_bin;
use splitsnow::config::{grid, sample, scene};
use splitsnow::transport::Substrate;

const SAMPLE: &str = include_str!("../configs/samples/soot_on_grass.toml");
const QUICK: &str = include_str!("../configs/quick.toml");
const TINY: &str = include_str!("cli/build.in/tiny.toml");

/// Wavelengths, nm, and reflectance of a synthetic soil.
fn soil() -> Vec<(f64, f64)> {
    let rows = (35..=105).map(|i| f64::from(i) * 10.0);
    rows.map(|nm| (nm, 0.1 + 4e-4 * (nm - 350.0))).collect()
}

/// The soil as CSV text, with some cells changed.
fn csv(change: impl Fn(f64) -> Option<&'static str>) -> String {
    let mut text = "wavelength_nm,reflectance\n".to_owned();
    for (nm, value) in soil() {
        let cell = change(nm).map_or(value.to_string(), str::to_owned);
        writeln!(text, "{nm},{cell}").unwrap();
    }
    text
}

/// The substrate of a sample with the file `text`, and the note printed; or the error message.
fn read_substrate(text: &str) -> Result<(Substrate, String), String> {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("soil.txt"), text).unwrap();
    let sample_text = SAMPLE.replace("data/grass_made_up.csv", "soil.txt");
    let name = dir.path().join("s.toml").display().to_string();
    let file = sample::parse(&name, &sample_text).map_err(|error| error.to_string())?;
    let [note] = &file.notes[..] else {
        panic!("{:?}", file.notes)
    };
    assert!(note.starts_with("read ") && !note.contains('\n'), "{note}");
    Ok((file.snowpack.substrate, note.clone()))
}

#[test]
fn all_file_formats_give_the_same_substrate() {
    let (plain, _) = read_substrate(&csv(|_| None)).unwrap();
    let (mut tabs, mut descending) = (
        String::from("WL (um)\tRefl. %\n"),
        String::from("nm;albedo\n"),
    );
    let mut bare = String::new();
    for (nm, value) in soil() {
        writeln!(tabs, "{}\t{}", nm / 1000.0, 100.0 * value).unwrap();
        writeln!(bare, "  {nm}   {value}").unwrap();
    }
    for (nm, value) in soil().into_iter().rev() {
        writeln!(descending, "{nm};{}", value.to_string().replace('.', ",")).unwrap();
    }
    for (text, expected_note) in [
        (
            &tabs,
            "percent (as the file states); wavelengths in column 1, um (as the file states)",
        ),
        (&descending, "descending: reversed; 71 of 71 rows used"),
        (
            &bare,
            "2 columns by spaces; reflectance in column 2 (the first), fraction (guessed",
        ),
    ] {
        let (substrate, note) = read_substrate(text).unwrap();
        assert!(note.contains(expected_note), "{note}");
        for nm in (400..=1000).step_by(10).map(f64::from) {
            let (a, b) = (
                substrate.reflectance(nm).unwrap(),
                plain.reflectance(nm).unwrap(),
            );
            assert!((a - b).abs() < 1e-14, "{nm} nm: {a} {b}");
        }
    }
    assert!((plain.reflectance(500.0).unwrap() - 0.16).abs() < 1e-14);
    // only the values in use are stored
    assert_eq!(plain.reflectance(390.0), None);
}

#[test]
fn small_gaps_are_interpolated_and_large_ones_rejected() {
    let masked = |from: f64, to: f64, cell: &'static str| {
        read_substrate(&csv(move |nm| (from..=to).contains(&nm).then_some(cell)))
    };
    // gaps of two rows of 10 nm, and gaps outside the wavelengths in use, are accepted
    for (from, to, cell, expected_note) in [
        (500.0, 510.0, "NaN", "2 without a value (lines 17-18)"),
        (
            500.0,
            510.0,
            "1.2",
            "2 outside the possible range (lines 17-18)",
        ),
        (
            700.0,
            700.0,
            "-0.02",
            "1 outside the possible range (line 37)",
        ),
        (1010.0, 1050.0, "-999", "5 without a value (lines 68-72)"),
        (350.0, 390.0, "", "5 without a value (lines 2-6)"),
    ] {
        let (substrate, note) = masked(from, to, cell).unwrap();
        assert!(note.contains(expected_note), "{note}");
        let nm = from.clamp(400.0, 1000.0);
        let found = substrate.reflectance(nm).unwrap();
        assert!(
            (found - (0.1 + 4e-4 * (nm - 350.0))).abs() < 1e-14,
            "{found}"
        );
    }
    for (from, to, cell, message) in [
        (
            500.0,
            520.0,
            "NaN",
            "has no usable value between 490 and 530 nm, but one is needed at 500 nm\n  help: fill the gap",
        ),
        (
            500.0,
            520.0,
            "-0.1",
            "has no usable value between 490 and 530 nm",
        ),
        (
            980.0,
            1050.0,
            "NaN",
            "covers 350 to 970 nm, but the wavelengths run from 400 to 1000 nm\n  help: extend",
        ),
        (
            350.0,
            1050.0,
            "1.5",
            ":2: 1.5 at 350 nm is not a valid reflectance: allowed 0 to 1, and 71 of 71 rows",
        ),
    ] {
        let error = masked(from, to, cell).unwrap_err();
        assert!(
            error.contains("`substrate.reflectance` = \"soil.txt\" "),
            "{error}"
        );
        assert!(error.contains(message), "{error}");
    }
    // widely spaced rows are interpolated linearly if no row is missing
    let (two, _) = read_substrate("wavelength_nm,reflectance\n400,0.1\n1000,0.7\n").unwrap();
    assert!((two.reflectance(700.0).unwrap() - 0.4).abs() < 1e-14);
}

#[test]
fn substrates_are_compared_by_content() {
    let dir = tempfile::tempdir().unwrap();
    let name = dir.path().join("g.toml").display().to_string();
    for (file, text) in [
        ("a.csv", csv(|_| None)),
        ("b.txt", csv(|_| None).replace(',', "\t")),
        ("c.csv", csv(|nm| (nm == 500.0).then_some("0.2"))),
        // differs outside the wavelengths in use
        ("d.csv", csv(|nm| (nm == 900.0).then_some("0.2"))),
    ] {
        fs::write(dir.path().join(file), text).unwrap();
    }
    let parse_with = |value: &str| {
        let text = format!("{QUICK}\n[fixed.substrate]\nreflectance = {value}\n");
        grid::parse(&name, &text).map(|file| file.grid)
    };
    let [a, b, c, d] =
        ["a.csv", "b.txt", "c.csv", "d.csv"].map(|f| parse_with(&format!("{f:?}")).unwrap());
    assert_eq!(a.describe(), b.describe());
    assert_eq!(a.describe(), d.describe());
    assert_ne!(a.describe(), c.describe());
    let again = grid::parse("elsewhere/g.toml", &a.to_config())
        .unwrap()
        .grid;
    assert_eq!(again, a);
    let error = parse_with("[0.1, 0.2]").unwrap_err().to_string();
    assert!(
        error.contains("has 2 values for 31 wavelengths\n  help: give one"),
        "{error}"
    );
    let at_one_wavelength = |value: &str| {
        let single = QUICK.replace(
            "start_nm = 400\nstop_nm = 700\nstep_nm = 10",
            "values_nm = [500]",
        );
        let text = format!("{single}\n[fixed.substrate]\nreflectance = {value}\n");
        grid::parse(&name, &text).unwrap().grid.fixed.substrate
    };
    assert_eq!(
        (
            at_one_wavelength("[0.3]"),
            at_one_wavelength("\"c.csv\""),
            at_one_wavelength("[0]")
        ),
        (Substrate::Grey(0.3), Substrate::Grey(0.2), Substrate::Black)
    );

    let text = include_str!("../configs/scenes/igloo.toml");
    let text = format!("{text}\n[fixed.substrate]\nreflectance = \"c.csv\"\n");
    let file = scene::parse(&name, &text).unwrap();
    assert_eq!(file.notes.len(), 1);
    let stored = scene::parse("elsewhere/s.toml", &file.self_contained()).unwrap();
    assert_eq!(stored.scene, file.scene);
    assert_eq!(stored.scene.fixed.substrate.reflectance(500.0), Some(0.2));
}

fn run(dir: &Path, args: &str) -> [String; 2] {
    let mut command = Command::new(cargo_bin!("splitsnow"));
    let output = command
        .current_dir(dir)
        .args(args.split_whitespace())
        .output()
        .unwrap();
    let texts = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(output.status.success(), "{texts:?}");
    texts
}

#[test]
fn a_database_does_not_need_the_file_of_its_substrate() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let tiny = |file: &str| format!("{TINY}\n[fixed.substrate]\nreflectance = {file:?}\n");
    fs::write(dir.join("tiny.toml"), tiny("soil.csv")).unwrap();
    fs::write(dir.join("soil.csv"), csv(|_| None)).unwrap();
    let [_, stderr] = run(dir, "build tiny.toml");
    assert!(
        stderr.starts_with("read soil.csv: a table") && stderr.lines().count() == 1,
        "{stderr}"
    );
    // another file with the same numbers is the same substrate, so nothing is simulated again
    fs::rename(dir.join("soil.csv"), dir.join("moved.txt")).unwrap();
    fs::write(dir.join("tiny.toml"), tiny("moved.txt")).unwrap();
    let [report, _] = run(dir, "build tiny.toml");
    assert!(report.starts_with("4 jobs, 0 of them run now"), "{report}");
    fs::remove_file(dir.join("moved.txt")).unwrap();
    let [report, stderr] = run(dir, "verify out/tiny --samples 2 --rays 100 --points 0");
    assert!(
        report.ends_with("PASS\n") && stderr.is_empty(),
        "{report}{stderr}"
    );
    let root = fs::read_to_string(dir.join("out/tiny/database.zarr/zarr.json")).unwrap();
    assert!(root.contains("Lambertian substrate with the spectrum fixed.substrate of config"));
    assert!(!root.contains("soil.csv"));
}
