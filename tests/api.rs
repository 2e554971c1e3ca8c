//! The library writes the same files as the program, to the byte.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::common::{assert_same, dir_bytes};
use assert_cmd::cargo::cargo_bin;
use splitsnow::batch::{Progress, RunInfo};
use splitsnow::build::{self, BuildError, BuildOptions, CompressionRequest};
use splitsnow::compress::{Basis, Choice};
use splitsnow::config::grid::{self, GridFile};
use splitsnow::grid::Shard;
use splitsnow::{Database, Quantity, plan};

/// A folder with the grid file `tiny.toml`, modified by `change`.
fn folder(change: impl Fn(String) -> String) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let text = include_str!("cli/build.in/tiny.toml").to_string();
    std::fs::write(dir.path().join("tiny.toml"), change(text)).unwrap();
    dir
}

/// Adds isotropic light and another colour difference formula.
fn diffuse(text: String) -> String {
    text.replace("[axes]", "[axes]\ndiffuse = true")
        .replace("\"spectral\"", "\"hybrid\"")
        + "\n[compression]\nmax_delta_e = 0.5\ndelta_e = \"cie2000\"\n"
}

fn program(dir: &Path, args: &[&str]) {
    let mut command = Command::new(cargo_bin!("splitsnow"));
    let output = command.current_dir(dir).args(args).output().unwrap();
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{errors}");
}

fn file(dir: &Path) -> GridFile {
    grid::read(&dir.join("tiny.toml")).unwrap()
}

fn options(file: &GridFile) -> BuildOptions<'static> {
    let mut options = BuildOptions::default();
    options.viewing = file.viewing.clone();
    options
}

#[test]
fn the_library_writes_the_bytes_of_the_program() {
    for change in [|text| text, diffuse] {
        let dir = folder(change);
        program(dir.path(), &["build", "tiny.toml"]);
        let expected = dir_bytes(&dir.path().join("out/tiny"));
        assert!(expected.contains_key("snow.safetensors"));

        let file = file(dir.path());
        let out = dir.path().join("library");
        let report = splitsnow::build(&file.grid, &out, &options(&file)).unwrap();
        assert_eq!(report.jobs_run, report.jobs);
        assert!(report.share.is_none());
        assert_same(&expected, &dir_bytes(&out));
        let compact = report.compact.unwrap();
        assert_eq!(compact.curves, 8);
        let has_diffuse = expected.contains_key("diffuse.safetensors");
        assert_eq!(compact.diffuse.is_some(), has_diffuse);
        assert_eq!(
            Database::open(&out).unwrap(),
            Database::open(&compact.compact).unwrap()
        );

        // both compress the database again, with other options
        let compress_options = [
            "--max-rmse",
            "0.01",
            "--basis",
            "log",
            "--quantity",
            "transmittance",
        ];
        program(
            dir.path(),
            &[&["compress", "out/tiny"][..], &compress_options[..]].concat(),
        );
        let mut bounds = file.grid.compression;
        (bounds.max_delta_e, bounds.max_rmse) = (2.3, Some(0.01));
        let mut request = CompressionRequest::plain(bounds, Default::default());
        request.variant.basis = Basis::Log;
        request.quantities = vec![Quantity::Transmittance];
        let compact = build::compress(&out, &request).unwrap();
        assert!(compact.reflectance.is_none());
        let expected = dir_bytes(&dir.path().join("out/tiny"));
        assert_same(&expected, &dir_bytes(&out));
        request.choice = Choice::Components(99);
        let error = build::compress(&out, &request).unwrap_err();
        assert!(matches!(error, BuildError::Compress { .. }), "{error}");
    }
}

/// Counts the calls of the progress interface.
#[derive(Debug, Default)]
struct ProgressCounter {
    begun: AtomicU64,
    done: AtomicU64,
    ended: AtomicBool,
    compressing: AtomicBool,
}

impl Progress for ProgressCounter {
    fn begin(&self, run: RunInfo) {
        self.begun.store(run.jobs - run.done, Ordering::Relaxed);
    }

    fn job_done(&self) {
        self.done.fetch_add(1, Ordering::Relaxed);
    }

    fn end(&self) {
        self.ended.store(true, Ordering::Relaxed);
    }

    fn compressing(&self) {
        self.compressing.store(true, Ordering::Relaxed);
    }
}

#[test]
fn shards_sources_and_cancelling_work_as_in_the_program() {
    let dir = folder(|text| text);
    let file = file(dir.path());
    let (first, second) = (dir.path().join("first"), dir.path().join("second"));
    let error = build::compress(
        &first,
        &CompressionRequest::plain(file.grid.compression, Default::default()),
    );
    assert!(matches!(error, Err(BuildError::Store(_))));

    // build one shard; the report and the progress describe this shard
    let counter = ProgressCounter::default();
    let mut shared = options(&file);
    shared.shard = Some(Shard::new(0, 2).unwrap());
    shared.progress = Some(&counter);
    let report = splitsnow::build(&file.grid, &first, &shared).unwrap();
    let share = report.share.unwrap();
    assert_eq!((report.jobs, share.database_jobs), (2, 4));
    assert_eq!(share.jobs_left, 2);
    assert!(report.compact.is_none());
    let count = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
    assert_eq!((count(&counter.begun), count(&counter.done)), (2, 2));
    assert!(counter.ended.load(Ordering::Relaxed));
    assert!(!counter.compressing.load(Ordering::Relaxed));
    let request = CompressionRequest::plain(file.grid.compression, Default::default());
    let error = build::compress(&first, &request).unwrap_err();
    assert!(
        matches!(error, BuildError::Unfinished { missing: 2, .. }),
        "{error}"
    );

    // the plan counts the jobs that are left
    let mut plan_options = plan::PlanOptions::default();
    (plan_options.seconds, plan_options.threads) = (1e-9, 2);
    plan_options.dir = Some(first.clone());
    let plan = splitsnow::plan(&file.grid, &plan_options).unwrap();
    assert_eq!((plan.jobs, plan.jobs_left, plan.threads), (4, 2, 2));
    assert!(plan.refused.is_none());
    let mut other = file.grid.clone();
    other.run.seed += 1;
    let plan = splitsnow::plan(&other, &plan_options).unwrap();
    assert_eq!(plan.jobs_left, 4);
    assert!(plan.refused.unwrap().to_string().contains("seed"));

    // the cancel flag stops the build; finished jobs are kept
    let stop = AtomicBool::new(true);
    let mut stopped = options(&file);
    stopped.cancel = Some(&stop);
    let error = splitsnow::build(&file.grid, &first, &stopped).unwrap_err();
    assert!(
        matches!(error, BuildError::Interrupted { done: 2, jobs: 4 }),
        "{error}"
    );

    // another database reuses the finished nodes
    let mut reusing = options(&file);
    reusing.from = vec![first.clone()];
    reusing.progress = Some(&counter);
    let report = splitsnow::build(&file.grid, &second, &reusing).unwrap();
    assert_eq!((report.nodes, report.nodes_reused), (8, 4));
    assert!(counter.compressing.load(Ordering::Relaxed));
    reusing.fresh = true;
    let error = splitsnow::build(&file.grid, &first, &reusing).unwrap_err();
    assert!(
        matches!(error, BuildError::FreshDeletesSource { .. }),
        "{error}"
    );
    assert!(first.join("database.zarr").exists());
    let report = splitsnow::build(&file.grid, &second, &reusing).unwrap();
    assert_eq!(report.jobs_run, 4);
    program(dir.path(), &["build", "tiny.toml"]);
    let expected = dir_bytes(&dir.path().join("out/tiny"));
    assert_same(&expected, &dir_bytes(&second));
}
