//! Many small jobs: memory and files do not grow with their number.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::dir_bytes;
use splitsnow::Database;
use splitsnow::store::Store;

const JOBS: usize = 100_000;
const SHARDS: usize = 50;

/// The example `scale`, which cargo builds beside the tests.
fn scale() -> PathBuf {
    let own = std::env::current_exe().unwrap();
    own.ancestors().nth(2).unwrap().join("examples/scale")
}

/// Runs a part and returns its largest memory, MB.
fn peak_mb(dir: &Path, part: &str) -> u64 {
    let jobs = JOBS.to_string();
    let output = Command::new(scale()).arg(dir).args([&jobs, part]).output();
    let output = output.unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{part}: {output:?}");
    let peak = text.lines().find_map(|line| line.strip_prefix("peak_mb "));
    peak.unwrap().parse().unwrap()
}

/// A hundred thousand jobs in fifty shards are finished and compressed.
#[test]
#[ignore = "writes 100,000 files"]
fn a_hundred_thousand_jobs() {
    // in memory where that is possible: the number of files is tested, not the disk
    let memory = Path::new("/dev/shm");
    let dir = match memory.is_dir() {
        true => tempfile::tempdir_in(memory),
        false => tempfile::tempdir(),
    };
    let dir = dir.unwrap();
    for shard in 0..SHARDS {
        let peak = peak_mb(dir.path(), &format!("{shard}/{SHARDS}"));
        assert!(peak < 50, "shard {shard}: {peak} MB");
        // each packs its jobs
        let jobs = fs::read_dir(dir.path().join(".splitsnow-jobs")).unwrap();
        assert_eq!(jobs.count(), 0, "{shard}");
    }
    let peak = peak_mb(dir.path(), "finish");
    assert!(peak < 300, "{peak} MB");

    let files = dir_bytes(dir.path());
    // 100 packs of 1000 jobs in six arrays, and metadata
    assert!(files.len() < 700, "{} files", files.len());
    let store = Store::open(dir.path()).unwrap();
    assert!(store.unmarked().unwrap().is_empty());
    let file = Database::open(dir.path().join("snow.safetensors")).unwrap();
    assert_eq!(file.curves(), JOBS);
}
