//! `verify` passes on a database that was just built, and says what is wrong
//! with one that was damaged, exchanged, changed or promises too much.
#![allow(clippy::unwrap_used)]
mod common;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicBool, AtomicU64};

use splitsnow::batch;
use splitsnow::colour::Colorimeter;
use splitsnow::compress::{Choice, CompactFile, Compressed, Variant, compress};
use splitsnow::config;
use splitsnow::engine::{Cache, Control, Engine, EngineError, Request};
use splitsnow::grid::Grid;
use splitsnow::measurement::{Quantity, Spectrum};
use splitsnow::store::{Access, COMPACT, Store, Variable};
use splitsnow::verify::{Options, Report, Verification, VerifyError};

const NODES: &str = "fresh simulations at nodes of the grid";
const COMPACT_CHECK: &str = "compact file against the database";
const OPTIONS: Options = Options {
    samples: 6,
    seed: 1,
    rays: None,
};

/// A grid of 8 jobs and 24 curves.
fn grid() -> Grid {
    let mut grid = common::grid(Engine::Spectral);
    grid.axes.thickness_cm = vec![0.3, 0.5, 1.0];
    grid.wavelengths_nm = (0..7).map(|i| 400.0 + 50.0 * f64::from(i)).collect();
    grid.run.rays = 500;
    grid
}

type Simulated = Result<Vec<Spectrum>, EngineError>;

fn build(
    dir: &Path,
    grid: &Grid,
    simulate: impl Fn(&Request<'_>, &Control<'_>) -> Simulated + Sync,
    promise: impl Fn(&mut Compressed),
) {
    let store = Store::build(dir, grid, &BTreeMap::new(), Access::Exclusive).unwrap();
    let options = batch::Options::default();
    batch::run(grid, &store, simulate, &options, &AtomicBool::new(false)).unwrap();
    let colour = Colorimeter::new(&grid.wavelengths_nm).unwrap();
    let compressed = |quantity, variable| {
        let curves = store.read(variable).unwrap().mapv(f64::from);
        let choice = Choice::Bounds(grid.compression);
        let mut compressed = compress(
            curves.view(),
            quantity,
            colour.as_ref(),
            choice,
            Variant::default(),
        )
        .unwrap();
        promise(&mut compressed);
        compressed
    };
    CompactFile {
        axes: &grid.axes,
        wavelengths_nm: &grid.wavelengths_nm,
        transmittance: Some(&compressed(
            Quantity::Transmittance,
            Variable::Transmittance,
        )),
        reflectance: Some(&compressed(Quantity::Reflectance, Variable::Reflectance)),
        provenance: &serde_json::to_string(&store.attributes()).unwrap(),
        extra: &BTreeMap::new(),
    }
    .write(&dir.join(COMPACT))
    .unwrap();
}

/// The engine itself.
fn honest(request: &Request<'_>, control: &Control<'_>) -> Simulated {
    Engine::Spectral.run(request, control)
}

/// Built once, never changed.
static FRESH: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    build(dir.path(), &grid(), honest, |_| {});
    dir
});

/// A copy to be damaged.
fn copy() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for (name, bytes) in common::dir_bytes(FRESH.path()) {
        let path = dir.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    dir
}

fn verify(dir: &Path, options: Options) -> Report {
    let (cancel, rays_done) = (AtomicBool::new(false), AtomicU64::new(0));
    let cache = Cache::default();
    let control = Control {
        parallel: true,
        cancel: &cancel,
        rays_done: &rays_done,
        cache: &cache,
    };
    let verification = Verification::open(dir, options).unwrap();
    let report = verification.run(&control).unwrap();
    let done = rays_done.into_inner();
    assert!(done <= verification.walks().unwrap());
    report
}

/// Files only.
fn verify_files(dir: &Path) -> Report {
    let options = Options {
        samples: 0,
        ..OPTIONS
    };
    verify(dir, options)
}

#[track_caller]
fn assert_fails(report: &Report, check: &str, message: &str) {
    assert_eq!(report.failed(), [check], "{report}");
    assert!(report.to_string().contains(message), "{report}");
}

#[test]
fn a_fresh_build_passes() {
    let report = verify(FRESH.path(), OPTIONS);
    assert!(report.passed(), "{report}");
    assert_eq!(report.checks.len(), 4);
    assert_eq!(
        report,
        verify(FRESH.path(), OPTIONS),
        "a function of its options"
    );
    let other = Options { seed: 2, ..OPTIONS };
    assert_ne!(report, verify(FRESH.path(), other));
    let more_than_there_are = Options {
        samples: 100,
        rays: Some(50),
        ..OPTIONS
    };
    let report = verify(FRESH.path(), more_than_there_are);
    assert!(report.passed(), "{report}");
    assert!(
        report
            .to_string()
            .contains("8 nodes of different jobs, 50 rays"),
        "{report}"
    );
}

#[test]
fn the_command_prints_the_report() {
    let command = |dir: &Path, args: &[&str]| {
        let mut command = assert_cmd::Command::cargo_bin("splitsnow").unwrap();
        command.arg("verify").arg(dir).args(args).output().unwrap()
    };
    let args = ["--samples", "2", "--rays", "100", "--threads"];
    let one = command(FRESH.path(), &[&args[..], &["1"]].concat());
    assert!(one.status.success(), "{one:?}");
    let text = String::from_utf8(one.stdout.clone()).unwrap();
    assert!(
        text.ends_with("\nPASS\n") && text.contains("Delta-E max"),
        "{text}"
    );
    assert_eq!(
        one.stdout,
        command(FRESH.path(), &[&args[..], &["2"]].concat()).stdout
    );

    let dir = copy();
    fs::remove_file(dir.path().join(COMPACT)).unwrap();
    let failed = command(dir.path(), &["--samples", "0", "--json"]);
    assert_eq!(failed.status.code(), Some(1));
    let json: serde_json::Value = serde_json::from_slice(&failed.stdout).unwrap();
    assert_eq!(json["passed"], false);
    assert_eq!(json["checks"][0]["passed"], true);
    assert_eq!(json["checks"][1]["name"], COMPACT_CHECK);
    let errors = String::from_utf8(failed.stderr).unwrap();
    assert!(errors.contains(COMPACT_CHECK), "{errors}");

    let empty = tempfile::tempdir().unwrap();
    let none = command(empty.path(), &[]);
    assert_eq!(none.status.code(), Some(1));
    assert!(
        String::from_utf8(none.stderr)
            .unwrap()
            .contains("no database in")
    );
}

#[test]
fn a_damaged_job_is_named() {
    let dir = copy();
    let chunk = dir.path().join("database.zarr/reflectance/c.1.0.0.0.1.0");
    let mut bytes = fs::read(&chunk).unwrap();
    bytes[5] ^= 1;
    fs::write(&chunk, bytes).unwrap();
    let report = verify(dir.path(), OPTIONS);
    let message = "job 5 is missing or damaged: facetness 0.5, grain size 50-150 um";
    assert_fails(&report, "files of the database", message);

    let dir = copy();
    fs::write(dir.path().join("database.zarr/angle_deg/c.0"), "").unwrap();
    let report = verify_files(dir.path());
    assert_fails(&report, "files of the database", "angle_deg/c.0 is damaged");
}

#[test]
fn a_compact_file_of_another_database_is_refused() {
    let mut grid = grid();
    grid.run.seed = 8;
    grid.run.rays = 20;
    let other = tempfile::tempdir().unwrap();
    build(other.path(), &grid, common::simulate, |_| {});
    let dir = copy();
    fs::copy(other.path().join(COMPACT), dir.path().join(COMPACT)).unwrap();
    let report = verify_files(dir.path());
    assert_fails(
        &report,
        COMPACT_CHECK,
        "its seed is 8, that of the database 7",
    );
    assert!(
        report
            .to_string()
            .contains("run.rays = 20: only in the compact file"),
        "{report}"
    );

    fs::write(dir.path().join(COMPACT), "PK").unwrap();
    let report = verify(dir.path(), OPTIONS);
    assert_fails(
        &report,
        COMPACT_CHECK,
        "cannot be used as a compact snow database",
    );
    assert!(
        report.checks.iter().any(|check| check.name == NODES),
        "{report}"
    );
}

#[test]
fn changed_coefficients_are_found() {
    let dir = copy();
    let path = dir.path().join(COMPACT);
    let mut bytes = fs::read(&path).unwrap();
    let header = 8 + u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let json: serde_json::Value = serde_json::from_slice(&bytes[8..header]).unwrap();
    let begin = json["transmittance.coefficients"]["data_offsets"][0]
        .as_u64()
        .unwrap();
    let at = header + begin as usize;
    let first = f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    bytes[at..at + 4].copy_from_slice(&(first * 1.001).to_le_bytes());
    fs::write(&path, bytes).unwrap();
    let message = "of transmittance, its coefficients give";
    assert_fails(&verify_files(dir.path()), COMPACT_CHECK, message);
}

#[test]
fn a_bound_that_is_not_kept_fails() {
    let dir = tempfile::tempdir().unwrap();
    let tight = |compressed: &mut Compressed| compressed.bounds.max_rmse = Some(1e-9);
    build(dir.path(), &grid(), common::simulate, tight);
    assert_fails(
        &verify_files(dir.path()),
        COMPACT_CHECK,
        "is not below 1.000e-9",
    );
}

/// Spectra off the nodes that the bases cannot express: one component, made
/// from curves of one shape, beside an engine that gives another.
#[test]
fn bases_that_do_not_express_fresh_spectra_fail() {
    let dir = tempfile::tempdir().unwrap();
    let flat = |request: &Request<'_>, control: &Control<'_>| -> Simulated {
        let mut spectra = honest(request, control)?;
        for spectrum in &mut spectra {
            for measured in [&mut spectrum.transmittance, &mut spectrum.reflectance] {
                for (number, value) in measured.iter_mut().enumerate() {
                    *value = measured_at(number, value.se);
                }
            }
        }
        Ok(spectra)
    };
    build(dir.path(), &grid(), flat, |_| {});
    let options = Options {
        rays: Some(20_000),
        ..OPTIONS
    };
    let report = verify(dir.path(), options);
    assert_eq!(report.failed().len(), 2, "{report}");
    let broken = |measure: &str| {
        let figures = report.checks.iter().flat_map(|check| &check.figures);
        let mut of = figures.filter(|figure| figure.measure == measure);
        of.any(|figure| !figure.holds())
    };
    assert!(
        broken("largest |z|") && broken("Delta-E max beyond noise"),
        "{report}"
    );
}

fn measured_at(number: usize, se: f64) -> splitsnow::measurement::Measured {
    let value = if number.is_multiple_of(2) { 0.1 } else { 0.6 };
    splitsnow::measurement::Measured { value, se }
}

#[test]
fn a_small_bias_of_all_nodes_is_found() {
    let dir = tempfile::tempdir().unwrap();
    let biased = |request: &Request<'_>, control: &Control<'_>| -> Simulated {
        let mut spectra = honest(request, control)?;
        for measured in spectra.iter_mut().flat_map(|s| &mut s.reflectance) {
            measured.value += 5.0 * measured.se;
        }
        Ok(spectra)
    };
    build(dir.path(), &grid(), biased, |_| {});
    let options = Options {
        samples: 8,
        ..OPTIONS
    };
    let report = verify(dir.path(), options);
    assert_fails(&report, NODES, "|sum of z| / sqrt(nodes)");
    let failing: Vec<_> = report
        .checks
        .iter()
        .flat_map(|c| &c.figures)
        .filter(|f| !f.holds())
        .collect();
    assert!(
        failing.iter().any(|f| f.measure.starts_with("|sum")),
        "{report}"
    );
}

#[test]
fn cancelling_stops_it() {
    let verification = Verification::open(FRESH.path(), OPTIONS).unwrap();
    let (cancel, rays_done) = (AtomicBool::new(true), AtomicU64::new(0));
    let cache = Cache::default();
    let control = Control {
        parallel: true,
        cancel: &cancel,
        rays_done: &rays_done,
        cache: &cache,
    };
    let error = verification.run(&control).unwrap_err();
    assert!(matches!(error, VerifyError::Cancelled), "{error}");
}

#[test]
fn the_grid_of_a_database_is_in_it() {
    for engine in Engine::ALL {
        let mut grid = common::grid(engine);
        grid.run.rays = 12_345;
        grid.fixed.water_saturation = 0.1;
        grid.fixed.model.entry = splitsnow::transport::Entry::Projected;
        grid.compression.max_rmse = Some(0.1);
        let dir = tempfile::tempdir().unwrap();
        let store = Store::build(dir.path(), &grid, &BTreeMap::new(), Access::Exclusive).unwrap();
        drop(store);
        let store = Store::open(dir.path()).unwrap();
        let mut again = config::grid::parse("any.toml", store.config())
            .unwrap()
            .grid;
        assert_ne!(
            again, grid,
            "the bounds of the compression are no part of a database"
        );
        again.compression = grid.compression;
        assert_eq!(again, grid);
    }
}
