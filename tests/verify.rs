//! `verify` passes on a newly built database. It reports the error in a database that was
//! damaged, exchanged or changed, or whose stated bounds are not met.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicBool, AtomicU64};

use sha2::{Digest, Sha256};
use splitsnow::batch;
use splitsnow::colour::Colorimeter;
use splitsnow::compress::{
    BAND_ERRORS, BOUNDS, Bands, Choice, CompactFile, CompactVariant, Compressed, compress,
    with_metadata,
};
use splitsnow::config;
use splitsnow::engine::{Cache, Control, Engine, EngineError, Request};
use splitsnow::error_budget::{ERROR_BUDGET, ErrorBudget};
use splitsnow::grid::Grid;
use splitsnow::lookup::{Database, SubstrateKind};
use splitsnow::measurement::{Quantity, Spectrum};
use splitsnow::parameter::Parameter;
use splitsnow::store::{Access, COMPACT, Store, Variable};
use splitsnow::transport::Substrate;
use splitsnow::verify::{Verification, VerifyError, VerifyOptions, VerifyReport};

const NODES: &str = "fresh simulations at nodes of the grid";
const COMPACT_CHECK: &str = "compact file against the database";
const OPTIONS: VerifyOptions = VerifyOptions {
    samples: 6,
    points: 0,
    seed: 1,
    rays: None,
    point_rays: Some(1 << 15),
    seconds: None,
};

/// A grid of 8 jobs and 24 curves.
fn grid() -> Grid {
    let mut grid = crate::common::grid(Engine::Spectral);
    grid.axes.set(Parameter::Thickness, vec![0.3, 0.5, 1.0]);
    grid.wavelengths_nm = (0..7).map(|i| 400.0 + 50.0 * f64::from(i)).collect();
    grid.run.rays = 500;
    grid
}

type SimulationResult = Result<Vec<Spectrum>, EngineError>;

fn build(
    dir: &Path,
    grid: &Grid,
    simulate: impl Fn(&Request<'_>, &Control<'_>) -> SimulationResult + Sync,
    adjust: impl Fn(&mut Compressed),
) {
    let store = Store::build(dir, grid, &BTreeMap::new(), Access::Exclusive).unwrap();
    let options = batch::BatchOptions::default();
    batch::run(grid, &store, simulate, &options, &AtomicBool::new(false)).unwrap();
    write_compact(&store, grid, Choice::Bounds(grid.compression), adjust);
}

fn write_compact(store: &Store, grid: &Grid, choice: Choice, adjust: impl Fn(&mut Compressed)) {
    let colour = Colorimeter::new(&grid.wavelengths_nm).unwrap();
    let bands = Bands::new(&grid.wavelengths_nm);
    let bands = match choice {
        Choice::Bounds(bounds) => bands.bounded(bounds.max_rmse),
        Choice::Components(_) => bands,
    };
    let compressed = |quantity, variable| {
        let curves = store.read(variable).unwrap().mapv(f64::from);
        let mut compressed = compress(
            curves.view(),
            quantity,
            colour.as_ref(),
            &bands,
            choice,
            CompactVariant::default(),
        )
        .unwrap();
        adjust(&mut compressed);
        compressed
    };
    CompactFile {
        axes: &grid.axes,
        absent: &[],
        wavelengths_nm: &grid.wavelengths_nm,
        substrate: SubstrateKind::Black,
        transmittance: Some(&compressed(
            Quantity::Transmittance,
            Variable::TRANSMITTANCE,
        )),
        reflectance: Some(&compressed(Quantity::Reflectance, Variable::REFLECTANCE)),
        provenance: &serde_json::to_string(&store.attributes()).unwrap(),
        extra: &BTreeMap::new(),
    }
    .write(&store.dir().join(COMPACT))
    .unwrap();
}

/// Simulates without modification.
fn unmodified(request: &Request<'_>, control: &Control<'_>) -> SimulationResult {
    Engine::Spectral.run(request, control)
}

/// Built once and never changed.
static FRESH: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    build(dir.path(), &grid(), unmodified, |_| {});
    dir
});

/// A copy of [`FRESH`] for modification.
fn copy() -> tempfile::TempDir {
    copy_of(&FRESH)
}

fn copy_of(built: &tempfile::TempDir) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for (name, bytes) in crate::common::dir_bytes(built.path()) {
        let path = dir.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    dir
}

fn verify(dir: &Path, options: VerifyOptions) -> VerifyReport {
    verify_with_budget(dir, options).0
}

fn verify_with_budget(dir: &Path, options: VerifyOptions) -> (VerifyReport, Option<ErrorBudget>) {
    let (cancel, rays_done) = (AtomicBool::new(false), AtomicU64::new(0));
    let cache = Cache::default();
    let control = Control {
        parallel: true,
        cancel: &cancel,
        rays_done: &rays_done,
        cache: &cache,
    };
    let verification = Verification::open(dir, options).unwrap();
    let found = verification.run(&control).unwrap();
    let done = rays_done.into_inner();
    assert!(done <= verification.walks().unwrap());
    found
}

/// Verifies the files only, without simulations.
fn verify_files(dir: &Path) -> VerifyReport {
    let options = VerifyOptions {
        samples: 0,
        ..OPTIONS
    };
    verify(dir, options)
}

#[track_caller]
fn assert_fails(report: &VerifyReport, check: &str, message: &str) {
    assert_eq!(report.failed(), [check], "{report}");
    assert!(report.to_string().contains(message), "{report}");
}

#[test]
fn a_fresh_build_passes() {
    let report = verify(FRESH.path(), OPTIONS);
    assert!(report.passed(), "{report}");
    assert_eq!(report.checks.len(), 3);
    assert_eq!(
        report,
        verify(FRESH.path(), OPTIONS),
        "the report depends only on its options"
    );
    let other = VerifyOptions { seed: 2, ..OPTIONS };
    assert_ne!(report, verify(FRESH.path(), other));
    let more_samples_than_jobs = VerifyOptions {
        samples: 100,
        rays: Some(50),
        ..OPTIONS
    };
    let report = verify(FRESH.path(), more_samples_than_jobs);
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
    let run_verify = |dir: &Path, args: &[&str]| {
        let mut command = assert_cmd::Command::cargo_bin("splitsnow").unwrap();
        command.arg("verify").arg(dir).args(args).output().unwrap()
    };
    let args = ["--samples", "2", "--rays", "100", "--points", "0"];
    let args = [&args[..], &["--threads"]].concat();
    let single_threaded = run_verify(FRESH.path(), &[&args[..], &["1"]].concat());
    assert!(single_threaded.status.success(), "{single_threaded:?}");
    let text = String::from_utf8(single_threaded.stdout.clone()).unwrap();
    assert!(
        text.ends_with("\nPASS\n") && text.contains("Delta-E max"),
        "{text}"
    );
    assert_eq!(
        single_threaded.stdout,
        run_verify(FRESH.path(), &[&args[..], &["2"]].concat()).stdout
    );

    let dir = copy();
    fs::remove_file(dir.path().join(COMPACT)).unwrap();
    let files_only = ["--samples", "0", "--points", "0", "--json"];
    let failed = run_verify(dir.path(), &files_only);
    assert_eq!(failed.status.code(), Some(1));
    let json: serde_json::Value = serde_json::from_slice(&failed.stdout).unwrap();
    assert_eq!(json["passed"], false);
    assert_eq!(json["checks"][0]["passed"], true);
    assert_eq!(json["checks"][1]["name"], COMPACT_CHECK);
    let errors = String::from_utf8(failed.stderr).unwrap();
    assert!(errors.contains(COMPACT_CHECK), "{errors}");

    // checks for which there was no time are omitted
    let late = run_verify(FRESH.path(), &["--seconds", "1e-9"]);
    assert_eq!(late.status.code(), Some(1), "{late:?}");
    let errors = String::from_utf8(late.stderr).unwrap();
    assert!(
        errors.contains("not everything that was asked for"),
        "{errors}"
    );

    let empty = tempfile::tempdir().unwrap();
    let none = run_verify(empty.path(), &[]);
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
    let chunk = dir.path().join("database.zarr/reflectance/c.0.0.0.0.0.0");
    let mut bytes = fs::read(&chunk).unwrap();
    // eight jobs, each with two numbers in the index, and a checksum
    let job = (bytes.len() - 4) / 8 - 16;
    bytes[5 * job + 5] ^= 1;
    fs::write(&chunk, bytes).unwrap();
    let report = verify(dir.path(), OPTIONS);
    let message = "job 5 is missing or damaged: facetness 0.5, grain size 100 um";
    assert_fails(&report, "files of the database", message);

    let dir = copy();
    fs::write(dir.path().join("database.zarr/angle_deg/c.0"), "").unwrap();
    let report = verify_files(dir.path());
    assert_fails(&report, "files of the database", "angle_deg/c.0 is damaged");
}

#[test]
fn a_compact_file_of_another_database_is_rejected() {
    let mut grid = grid();
    grid.run.seed = 8;
    grid.run.rays = 20;
    let other = tempfile::tempdir().unwrap();
    build(other.path(), &grid, crate::common::simulate, |_| {});
    let dir = copy();
    fs::copy(other.path().join(COMPACT), dir.path().join(COMPACT)).unwrap();
    let report = verify_files(dir.path());
    assert_fails(
        &report,
        COMPACT_CHECK,
        "its seed is 8, but that of the database is 7",
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
fn changed_coefficients_are_detected() {
    let dir = copy();
    let path = dir.path().join(COMPACT);
    let mut bytes = fs::read(&path).unwrap();
    let header = 8 + u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let json: serde_json::Value = serde_json::from_slice(&bytes[8..header]).unwrap();
    let begin = json["transmittance.coefficients"]["data_offsets"][0]
        .as_u64()
        .unwrap();
    let offset = header + begin as usize;
    let first = f32::from_le_bytes(bytes[offset..offset + 4].try_into().unwrap());
    bytes[offset..offset + 4].copy_from_slice(&(first * 1.001).to_le_bytes());
    fs::write(&path, bytes).unwrap();
    let message = "of transmittance, but its coefficients give";
    assert_fails(&verify_files(dir.path()), COMPACT_CHECK, message);
}

#[test]
fn an_unmet_bound_fails() {
    let dir = tempfile::tempdir().unwrap();
    let tight = |compressed: &mut Compressed| compressed.bounds.max_rmse = Some(1e-9);
    build(dir.path(), &grid(), crate::common::simulate, tight);
    assert_fails(
        &verify_files(dir.path()),
        COMPACT_CHECK,
        "is not below 1.000e-9",
    );
}

/// The report ends with the checks that there was no time for. An unmet bound still fails.
#[test]
fn an_exhausted_time_budget_lists_the_missing_checks() {
    let options = VerifyOptions {
        points: 16,
        seconds: Some(0.0),
        ..OPTIONS
    };
    let (report, error_budget) = verify_with_budget(FRESH.path(), options);
    assert!(report.passed() && error_budget.is_none(), "{report}");
    let names: Vec<_> = report.checks.iter().map(|check| check.name).collect();
    assert_eq!(names, ["files of the database", COMPACT_CHECK]);
    let text = report.to_string();
    let end = text.lines().rev().take(3).collect::<Vec<_>>();
    assert!(end[2].starts_with("PASS  of what was checked"), "{text}");
    assert!(
        end[1].contains("6 of 6 fresh simulations at nodes"),
        "{text}"
    );
    assert!(
        end[0].contains("random points of the error budget"),
        "{text}"
    );

    let dir = tempfile::tempdir().unwrap();
    let tight = |compressed: &mut Compressed| compressed.bounds.max_rmse = Some(1e-9);
    build(dir.path(), &grid(), crate::common::simulate, tight);
    let report = verify(dir.path(), options);
    assert_fails(&report, COMPACT_CHECK, "FAIL  of what was checked");
    // enough time for all checks
    let options = VerifyOptions {
        seconds: Some(1e9),
        ..OPTIONS
    };
    assert_eq!(verify(FRESH.path(), options), verify(FRESH.path(), OPTIONS));
}

#[test]
fn an_unmet_bound_of_a_band_fails() {
    let dir = tempfile::tempdir().unwrap();
    let nm = grid().wavelengths_nm;
    let tight = |compressed: &mut Compressed| {
        compressed.bands = Bands::new(&nm).bounded(Some(1e-9));
    };
    build(dir.path(), &grid(), crate::common::simulate, tight);
    let message = "RMSE in visible";
    let report = verify_files(dir.path());
    assert_fails(&report, COMPACT_CHECK, message);
    assert!(
        report.to_string().contains("is not below 1.000e-9"),
        "{report}"
    );
    // files without band errors, as written by earlier versions
    let none = |compressed: &mut Compressed| compressed.bands = Bands::default();
    let dir = tempfile::tempdir().unwrap();
    build(dir.path(), &grid(), crate::common::simulate, none);
    let report = verify_files(dir.path());
    assert!(report.passed(), "{report}");
}

#[test]
fn changed_errors_of_a_band_fail() {
    let dir = copy();
    let path = dir.path().join(COMPACT);
    let bytes = fs::read(&path).unwrap();
    let text = Database::from_bytes(&bytes).unwrap().metadata()[BAND_ERRORS].clone();
    let mut stated: serde_json::Value = serde_json::from_str(&text).unwrap();
    let error = stated["reflectance"][0]["largest"]["error"]
        .as_f64()
        .unwrap();
    stated["reflectance"][0]["largest"]["error"] = (error / 2.0).into();
    for (text, message) in [
        (
            stated.to_string(),
            "as the largest error of reflectance in visible",
        ),
        (
            r#"{"transmittance":[]}"#.to_owned(),
            "have no entry for visible",
        ),
        ("{".to_owned(), "`band_errors` cannot be read"),
    ] {
        fs::write(
            &path,
            with_metadata(&bytes, &[(BAND_ERRORS, Some(&text))]).unwrap(),
        )
        .unwrap();
        assert_fails(&verify_files(dir.path()), COMPACT_CHECK, message);
    }
}

/// One snow at 5 thicknesses and 4 angles, with low noise.
fn one_snow() -> Grid {
    let mut grid = grid();
    grid.axes.set(Parameter::Facetness, vec![0.5]);
    grid.axes.set(Parameter::GrainSize, vec![300.0]);
    grid.axes
        .set(Parameter::Thickness, vec![1.0, 2.0, 4.0, 8.0, 16.0]);
    grid.axes
        .set(Parameter::Incidence, vec![0.0, 30.0, 55.0, 75.0]);
    grid.wavelengths_nm = vec![400.0, 500.0, 600.0, 700.0];
    grid.run.engine = Engine::Hybrid;
    grid.run.rays = 20_000;
    grid
}

fn hybrid(request: &Request<'_>, control: &Control<'_>) -> SimulationResult {
    Engine::Hybrid.run(request, control)
}

static ONE_SNOW: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    build(dir.path(), &one_snow(), hybrid, |_| {});
    dir
});

const CERTIFY: VerifyOptions = VerifyOptions {
    samples: 0,
    points: 16,
    ..OPTIONS
};

/// The report and error budget of [`ONE_SNOW`].
static CERTIFIED: LazyLock<(VerifyReport, Option<ErrorBudget>)> =
    LazyLock::new(|| verify_with_budget(ONE_SNOW.path(), CERTIFY));

#[test]
fn the_error_budget_depends_only_on_its_seed() {
    let (report, error_budget) = &*CERTIFIED;
    assert!(report.passed(), "{report}");
    assert_eq!(report.checks.len(), 3);
    let error_budget = error_budget.as_ref().unwrap();
    assert!(error_budget.points >= 16);
    let json = serde_json::to_string(&error_budget).unwrap();
    let again: ErrorBudget = serde_json::from_str(&json).unwrap();
    assert_eq!(&again, error_budget);
    let chain = &error_budget.quantities["transmittance"];
    let total = chain.total.delta_e.unwrap();
    assert!(total.mean > 0.0 && total.mean <= total.p95 && total.p95 <= total.max);
    assert_eq!(chain.worst[0].delta_e, Some(total.max));
    let axes: Vec<_> = chain.axes.keys().collect();
    assert_eq!(axes, ["angle_deg", "thickness_cm"]);
    // noise is low, so most of the error is the bound of the compression
    assert!(total.max < 2.3, "{error_budget}");

    let other = VerifyOptions { seed: 2, ..CERTIFY };
    let other = verify_with_budget(ONE_SNOW.path(), other).1.unwrap();
    assert_ne!(other.quantities, error_budget.quantities);
    assert_eq!(verify_with_budget(ONE_SNOW.path(), OPTIONS).1, None);
}

#[test]
fn biased_curves_increase_the_error_budget() {
    let dir = tempfile::tempdir().unwrap();
    let shifted = |request: &Request<'_>, control: &Control<'_>| -> SimulationResult {
        let mut spectra = hybrid(request, control)?;
        for spectrum in &mut spectra {
            let both = [&mut spectrum.transmittance, &mut spectrum.reflectance];
            both.into_iter().flatten().for_each(|m| m.value *= 0.95);
        }
        Ok(spectra)
    };
    build(dir.path(), &one_snow(), shifted, |_| {});
    let good = CERTIFIED.1.clone().unwrap();
    let shifted = verify_with_budget(dir.path(), CERTIFY).1.unwrap();
    for quantity in Quantity::ALL {
        let chain = |error_budget: &ErrorBudget| error_budget.quantities[quantity.name()].clone();
        let (good, shifted) = (chain(&good), chain(&shifted));
        let mean = |m: splitsnow::error_budget::Measures| m.rmse.mean;
        for (good, shifted) in [
            (good.total, shifted.total),
            (good.interpolation, shifted.interpolation),
            (good.simulation.unwrap(), shifted.simulation.unwrap()),
        ] {
            assert!(mean(shifted) > 3.0 * mean(good), "{good:?} {shifted:?}");
        }
        // compression meets the requested bound in both files, although one may need fewer
        // components
        let bound = one_snow().compression.max_delta_e;
        for compression in [good.compression, shifted.compression] {
            assert!(compression.delta_e.unwrap().max < bound, "{compression:?}");
        }
        assert_eq!(shifted.noise, good.noise);
    }
}

#[test]
fn coarse_compression_increases_the_error_budget() {
    let dir = copy_of(&ONE_SNOW);
    let path = dir.path().join(COMPACT);
    let chain = || {
        let (report, error_budget) = verify_with_budget(dir.path(), CERTIFY);
        assert!(report.passed(), "{report}");
        error_budget.unwrap().quantities["transmittance"].clone()
    };
    let chain_with = |components| {
        let store = Store::open(dir.path()).unwrap();
        write_compact(&store, &one_snow(), Choice::Components(components), |_| {});
        chain()
    };
    let (fine, coarse) = (chain_with(4), chain_with(1));
    let max = |m: splitsnow::error_budget::Measures| m.delta_e.unwrap().max;
    assert!(max(fine.compression) < 1e-2, "{fine:?}");
    assert!(max(coarse.compression) > 0.3, "{coarse:?}");
    assert_eq!(coarse.interpolation, fine.interpolation);

    // a stated bound that the file does not meet
    let bounds = r#"{"transmittance":{"max_delta_e":0.1,"max_rmse":null},"reflectance":{"max_delta_e":null,"max_rmse":null}}"#;
    let lowered = with_metadata(&fs::read(&path).unwrap(), &[(BOUNDS, Some(bounds))]).unwrap();
    fs::write(&path, lowered).unwrap();
    assert_fails(
        &verify_files(dir.path()),
        COMPACT_CHECK,
        "is not below 0.1000",
    );
}

#[test]
fn the_command_stores_the_error_budget_in_the_file() {
    let dir = copy_of(&ONE_SNOW);
    let path = dir.path().join(COMPACT);
    let run_verify = |threads| {
        let mut command = assert_cmd::Command::cargo_bin("splitsnow").unwrap();
        command.arg("verify").arg(dir.path());
        command.args(["--samples", "0", "--points", "16", "--point-rays", "32768"]);
        command.args(["--threads", threads]);
        command.assert().success().get_output().stdout.clone()
    };
    let report = String::from_utf8(run_verify("1")).unwrap();
    assert!(report.contains("off the nodes in angle_deg"), "{report}");
    let file = Database::open(&path).unwrap();
    let stored: ErrorBudget = serde_json::from_str(&file.metadata()[ERROR_BUDGET]).unwrap();
    let stored_points = stored.points;
    assert_eq!(CERTIFIED.1, Some(stored));
    let bytes = fs::read(&path).unwrap();
    assert_eq!(String::from_utf8(run_verify("2")).unwrap(), report);
    assert_eq!(fs::read(&path).unwrap(), bytes);

    let mut query = assert_cmd::Command::cargo_bin("splitsnow").unwrap();
    query.arg("query").arg(dir.path()).arg("--explain");
    let point = "--facetness 0.5 --grain-size-um 300 --density-kg-m3 300 --thickness-cm 3 --incidence-angle-deg 9";
    let output = query.args(point.split(' ')).assert().success();
    let text = String::from_utf8(output.get_output().stdout.clone()).unwrap();
    let points = format!("# {stored_points} random points against");
    assert!(
        text.contains(&points) && text.contains("\n#   whole chain "),
        "{text}"
    );
}

#[test]
fn a_small_bias_of_all_nodes_is_detected() {
    let dir = tempfile::tempdir().unwrap();
    let biased = |request: &Request<'_>, control: &Control<'_>| -> SimulationResult {
        let mut spectra = unmodified(request, control)?;
        for measured in spectra.iter_mut().flat_map(|s| &mut s.reflectance) {
            measured.value += 5.0 * measured.se;
        }
        Ok(spectra)
    };
    build(dir.path(), &grid(), biased, |_| {});
    let options = VerifyOptions {
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
fn cancellation_stops_verification() {
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
fn a_database_contains_its_grid() {
    for engine in Engine::ALL {
        let mut grid = crate::common::grid(engine);
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
            "the database does not contain the bounds of the compression"
        );
        again.compression = grid.compression;
        assert_eq!(again, grid);
    }
}

/// `text` of a description in the spelling of version 0.1.
fn former(text: &str) -> String {
    text.replace("incidence_angle_deg = ", "angle_deg = ")
        .replace("\"hybrid\"", "\"doubling\"")
}

/// Rewrites the attributes of the database in `dir` and of its compact file as version 0.1
/// wrote them.
fn rewrite_as_version_0_1(dir: &Path) {
    let respell = |attributes: &mut serde_json::Value| {
        let config = former(attributes["config"].as_str().unwrap());
        let digest = Sha256::digest(&config);
        let digest: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
        attributes["config"] = config.into();
        attributes["config_sha256"] = digest.into();
        if attributes["engine"] == "hybrid" {
            attributes["engine"] = "doubling".into();
        }
        let bottom = attributes["bottom_boundary"].as_str().unwrap();
        attributes["bottom_boundary"] = bottom.replace("an substrate", "an ground").into();
    };
    let root = dir.join("database.zarr/zarr.json");
    let mut json: serde_json::Value = serde_json::from_slice(&fs::read(&root).unwrap()).unwrap();
    respell(&mut json["attributes"]);
    fs::write(&root, serde_json::to_string_pretty(&json).unwrap() + "\n").unwrap();
    let compact = dir.join(COMPACT);
    let file = Database::open(&compact).unwrap();
    let mut provenance = serde_json::from_str(&file.metadata()["provenance"]).unwrap();
    respell(&mut provenance);
    let entries = [("provenance", Some(&*provenance.to_string()))];
    let bytes = with_metadata(&fs::read(&compact).unwrap(), &entries).unwrap();
    fs::write(&compact, bytes).unwrap();
}

/// What an earlier version wrote is renewed by a build, but not damaged.
#[test]
fn a_database_of_an_earlier_version_is_intact() {
    const EARLIER: &str = "zarr.json was written by an earlier version: run `splitsnow build`";
    let on_grey = tempfile::tempdir().unwrap();
    let mut grey_grid = one_snow();
    grey_grid.run.rays = 2000;
    grey_grid.fixed.substrate = Substrate::Grey(0.3);
    build(on_grey.path(), &grey_grid, hybrid, |_| {});
    for (built, grid) in [(&*FRESH, grid()), (&on_grey, grey_grid)] {
        assert!(!verify_files(built.path()).to_string().contains(EARLIER));
        let dir = copy_of(built);
        rewrite_as_version_0_1(dir.path());
        let report = verify_files(dir.path());
        assert!(report.passed(), "{report}");
        assert!(report.to_string().contains(EARLIER), "{report}");
        let mut command = assert_cmd::Command::cargo_bin("splitsnow").unwrap();
        let files_only = ["--samples", "0", "--points", "0"];
        command.arg("verify").arg(dir.path()).args(files_only);
        command.assert().success();

        // a change of such metadata is still damage
        let root = dir.path().join("database.zarr/zarr.json");
        let whole = fs::read_to_string(&root).unwrap();
        for (text, changed) in [("\"seed\": 7", "\"seed\": 8"), ("of snow", "of snaw")] {
            let damaged = whole.replacen(text, changed, 1);
            assert_ne!(damaged, whole);
            fs::write(&root, damaged).unwrap();
            let report = verify_files(dir.path());
            assert_fails(&report, "files of the database", "zarr.json is damaged");
        }
        fs::write(&root, whole).unwrap();

        let store = Store::build(dir.path(), &grid, &BTreeMap::new(), Access::Exclusive).unwrap();
        assert!(store.missing().unwrap().is_empty());
        drop(store);
        let database = |dir: &Path| crate::common::dir_bytes(&dir.join("database.zarr"));
        crate::common::assert_same(&database(built.path()), &database(dir.path()));
        let report = verify_files(dir.path());
        assert!(report.passed(), "{report}");
        assert!(!report.to_string().contains(EARLIER), "{report}");
    }
}
