//! What the program does, through the library: the same files, to the byte.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::common::{assert_same, dir_bytes};
use assert_cmd::cargo::cargo_bin;
use splitsnow::batch::{Progress, RunInfo};
use splitsnow::build::{self, BuildError, CompressionRequest, Options};
use splitsnow::compress::{Basis, Choice};
use splitsnow::config::grid::{self, GridFile};
use splitsnow::grid::Shard;
use splitsnow::{Database, Quantity, plan};

/// A folder with the grid file `tiny.toml`, `change`d.
fn folder(change: impl Fn(String) -> String) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let text = include_str!("cli/build.in/tiny.toml").to_string();
    std::fs::write(dir.path().join("tiny.toml"), change(text)).unwrap();
    dir
}

/// With isotropic light, and colours of another formula.
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

fn options(file: &GridFile) -> Options<'static> {
    let mut options = Options::default();
    options.viewing = file.viewing.clone();
    options
}

#[test]
fn a_build_writes_the_bytes_of_the_program() {
    for change in [|text| text, diffuse] {
        let dir = folder(change);
        program(dir.path(), &["build", "tiny.toml"]);
        let expected = dir_bytes(&dir.path().join("out/tiny"));
        assert!(expected.contains_key("snow.safetensors"));

        let file = file(dir.path());
        let out = dir.path().join("whole");
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

        // another compact file, by either
        let words = [
            "--max-rmse",
            "0.01",
            "--basis",
            "log",
            "--quantity",
            "transmittance",
        ];
        program(
            dir.path(),
            &[&["compress", "out/tiny"][..], &words[..]].concat(),
        );
        let mut bounds = file.grid.compression;
        (bounds.max_delta_e, bounds.max_rmse) = (2.3, Some(0.01));
        let mut asked = CompressionRequest::plain(bounds, Default::default());
        asked.variant.basis = Basis::Log;
        asked.quantities = vec![Quantity::Transmittance];
        let compact = build::compress(&out, &asked).unwrap();
        assert!(compact.reflectance.is_none());
        let expected = dir_bytes(&dir.path().join("out/tiny"));
        assert_same(&expected, &dir_bytes(&out));
        asked.choice = Choice::Components(99);
        let error = build::compress(&out, &asked).unwrap_err();
        assert!(matches!(error, BuildError::Compress { .. }), "{error}");
    }
}

#[derive(Debug, Default)]
struct Counted {
    begun: AtomicU64,
    done: AtomicU64,
    ended: AtomicBool,
    compressing: AtomicBool,
}

impl Progress for Counted {
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
fn shares_sources_and_flags_do_as_in_the_program() {
    let dir = folder(|text| text);
    let file = file(dir.path());
    let (first, second) = (dir.path().join("first"), dir.path().join("second"));
    let error = build::compress(
        &first,
        &CompressionRequest::plain(file.grid.compression, Default::default()),
    );
    assert!(matches!(error, Err(BuildError::Store(_))));

    // one share, and what is told of it
    let counted = Counted::default();
    let mut shared = options(&file);
    shared.shard = Some(Shard::new(0, 2).unwrap());
    shared.progress = Some(&counted);
    let report = splitsnow::build(&file.grid, &first, &shared).unwrap();
    let share = report.share.unwrap();
    assert_eq!((report.jobs, share.database_jobs), (2, 4));
    assert_eq!(share.jobs_left, 2);
    assert!(report.compact.is_none());
    let count = |of: &AtomicU64| of.load(Ordering::Relaxed);
    assert_eq!((count(&counted.begun), count(&counted.done)), (2, 2));
    assert!(counted.ended.load(Ordering::Relaxed));
    assert!(!counted.compressing.load(Ordering::Relaxed));
    let asked = CompressionRequest::plain(file.grid.compression, Default::default());
    let error = build::compress(&first, &asked).unwrap_err();
    assert!(
        matches!(error, BuildError::Unfinished { missing: 2, .. }),
        "{error}"
    );

    // what is left is planned
    let mut planned = plan::Options::default();
    (planned.seconds, planned.threads) = (1e-9, 2);
    planned.dir = Some(first.clone());
    let plan = splitsnow::plan(&file.grid, &planned).unwrap();
    assert_eq!((plan.jobs, plan.jobs_left, plan.threads), (4, 2, 2));
    assert!(plan.refused.is_none());
    let mut other = file.grid.clone();
    other.run.seed += 1;
    let plan = splitsnow::plan(&other, &planned).unwrap();
    assert_eq!(plan.jobs_left, 4);
    assert!(plan.refused.unwrap().to_string().contains("seed"));

    // a flag stops it, and all is safe
    let stop = AtomicBool::new(true);
    let mut stopped = options(&file);
    stopped.cancel = Some(&stop);
    let error = splitsnow::build(&file.grid, &first, &stopped).unwrap_err();
    assert!(
        matches!(error, BuildError::Interrupted { done: 2, jobs: 4 }),
        "{error}"
    );

    // another database takes over what there is
    let mut taking = options(&file);
    taking.from = vec![first.clone()];
    taking.progress = Some(&counted);
    let report = splitsnow::build(&file.grid, &second, &taking).unwrap();
    assert_eq!((report.nodes, report.nodes_reused), (8, 4));
    assert!(counted.compressing.load(Ordering::Relaxed));
    taking.fresh = true;
    let error = splitsnow::build(&file.grid, &first, &taking).unwrap_err();
    assert!(
        matches!(error, BuildError::FreshDeletesSource { .. }),
        "{error}"
    );
    assert!(first.join("database.zarr").exists());
    let report = splitsnow::build(&file.grid, &second, &taking).unwrap();
    assert_eq!(report.jobs_run, 4);
    program(dir.path(), &["build", "tiny.toml"]);
    let expected = dir_bytes(&dir.path().join("out/tiny"));
    assert_same(&expected, &dir_bytes(&second));
}
