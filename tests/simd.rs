//! The instruction sets for which kernels are compiled: all give the same bytes, and the
//! program says which it has.
use std::path::Path;
use std::process::{Command, Output};

use assert_cmd::cargo::cargo_bin;
use splitsnow::simd::Level;

use crate::common::{assert_same, dir_bytes};

const SAMPLES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/samples");

fn splitsnow(dir: &Path, level: &str, args: &str) -> Output {
    let mut command = Command::new(cargo_bin!("splitsnow"));
    command.current_dir(dir).env("SPLITSNOW_SIMD", level);
    command.args(args.split_whitespace()).output().unwrap()
}

/// Standard output of a command that must end well.
fn printed(dir: &Path, level: &str, args: &str) -> String {
    let output = splitsnow(dir, level, args);
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{level}: {args}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// What every level prints for `args`, which is the same.
fn same(args: &str) {
    let dir = tempfile::tempdir().unwrap();
    let mut levels = Level::supported().map(Level::name);
    let first = levels.next().unwrap();
    let expected = printed(dir.path(), first, args);
    assert!(expected.len() > 100, "{expected}");
    for level in levels {
        let found = printed(dir.path(), level, args);
        assert!(found == expected, "{args}: {first} and {level} differ");
    }
}

#[test]
fn measurements_are_the_same_bytes() {
    for engine in ["reference", "spectral", "tabulated", "hybrid"] {
        for sample in ["representative", "soot_on_grass", "mixture"] {
            // walks through thick wet snow are long
            if (engine, sample) != ("reference", "mixture") {
                same(&format!(
                    "measure {SAMPLES}/{sample}.toml --engine {engine} --rays 64"
                ));
            }
        }
    }
}

#[test]
fn goniometer_runs_are_the_same_bytes() {
    for engine in ["spectral", "tabulated"] {
        same(&format!(
            "measure {SAMPLES}/soot_on_grass.toml --engine {engine} --rays 256 --goniometer --sensors 50"
        ));
    }
}

#[test]
fn databases_and_answers_are_the_same_bytes() {
    const GRID: &str = "\
version = 1
[axes]
facetness = [0.1, 0.9]
grain_size_um = [100, 300]
density_kg_m3 = [200, 400]
thickness_cm = [1, 4]
angle_deg = [0, 60]
[wavelengths]
start_nm = 400
stop_nm = 700
step_nm = 50
[run]
rays = 64
";
    const ASKED: &str = "query out --facetness 0.3 --grain-size-um 150 --density-kg-m3 250 \
                         --thickness-cm 2.5 --angle-deg 20";
    let mut expected = None;
    for level in Level::supported() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("grid.toml"), GRID).unwrap();
        printed(
            dir.path(),
            level.name(),
            "build grid.toml --out out --engine tabulated",
        );
        let answer = printed(dir.path(), level.name(), ASKED);
        let found = (dir_bytes(&dir.path().join("out")), answer);
        let (bytes, answer) = expected.get_or_insert_with(|| found.clone());
        assert_same(bytes, &found.0);
        assert_eq!(*answer, found.1, "{level}");
    }
}

#[test]
fn a_level_that_is_not_there_is_an_error() {
    let dir = tempfile::tempdir().unwrap();
    let missing = Level::ALL.into_iter().find(|level| !level.is_supported());
    let missing = missing.map_or("none", Level::name);
    for bad in ["avx9000", "V1", missing] {
        for args in [
            "--version -v",
            &format!("measure {SAMPLES}/representative.toml"),
        ] {
            let output = splitsnow(dir.path(), bad, args);
            assert_eq!(output.status.code(), Some(1), "{bad}");
            assert!(output.stdout.is_empty());
            let error = String::from_utf8(output.stderr).unwrap();
            let names: Vec<_> = Level::supported().map(Level::name).collect();
            assert!(error.starts_with("error: SPLITSNOW_SIMD"), "{error}");
            assert!(
                error.contains(bad) && error.contains(&names.join(", ")),
                "{error}"
            );
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }
}

#[test]
fn the_version_tells_the_level() {
    let dir = tempfile::tempdir().unwrap();
    let best = Level::supported().last().unwrap();
    for (asked, used) in Level::supported()
        .map(|level| (level.name(), level))
        .chain([("", best)])
    {
        for args in ["--version -v", "-vV", "-v --version"] {
            let text = printed(dir.path(), asked, args);
            assert!(text.starts_with("splitsnow 0."), "{text}");
            assert!(
                text.contains(&format!("instruction set: {used}\n")),
                "{text}"
            );
        }
    }
    let plain = printed(dir.path(), "", "--version");
    assert_eq!(plain.lines().count(), 1);
}
