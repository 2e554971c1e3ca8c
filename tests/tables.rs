//! Shards and threads share the tables of grain events, which changes no byte of a database.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use serde_json::Value;

use crate::common::{Folder, assert_same, dir_bytes};

/// 12 jobs; grains of three shapes, each at two refractive indices.
const GRID: &str = "version = 1
[axes]
facetness = [0.1, 0.5, 0.9]
grain_size_um = [300, 500]
density_kg_m3 = [100, 200]
thickness_cm = [1, 2]
incidence_angle_deg = [0, 60]
[wavelengths]
start_nm = 400
stop_nm = 700
step_nm = 50
[run]
engine = \"hybrid\"
rays = 200
";
/// Parts of all tables.
const PARTS: u64 = 3 * 2 * 8;
const TABLES: &str = ".splitsnow-tables";

/// The files of a build by one process on one thread, which draws each table once.
static EXPECTED: LazyLock<BTreeMap<String, Vec<u8>>> = LazyLock::new(|| {
    let folder = Folder::new(GRID);
    let report = folder.succeeds("build g.toml --threads 1 --json");
    assert_eq!(parts(&report), [PARTS, 0]);
    dir_bytes(&folder.out("g"))
});

/// Numbers of parts of tables that a build drew and read, from its report.
fn parts(report: &str) -> [u64; 2] {
    let report: Value = serde_json::from_str(report).unwrap();
    ["drawn", "read"].map(|kind| report["table_parts"][kind].as_u64().unwrap())
}

fn shard(index: u64, count: u64) -> String {
    format!("build g.toml --threads 1 --json --shard {index}/{count}")
}

/// The parts that are stored.
fn stored(folder: &Folder) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder.out("g").join(TABLES)).unwrap();
    entries.map(|entry| entry.unwrap().path()).collect()
}

fn assert_finished(dir: &Path) {
    assert_same(&EXPECTED, &dir_bytes(dir));
    assert!(!dir.join(TABLES).exists());
}

#[test]
fn shards_one_after_the_other_draw_each_table_once() {
    let folder = Folder::new(GRID);
    let mut all = [0, 0];
    for index in 0..12 {
        let [drawn, read] = parts(&folder.succeeds(&shard(index, 12)));
        assert_eq!(drawn + read, 16, "{index}");
        all = [all[0] + drawn, all[1] + read];
    }
    assert_eq!(all, [PARTS, 12 * 16 - PARTS]);
    // the shard that was last needs them no more
    assert!(!folder.out("g").join(TABLES).exists());
    folder.succeeds("build g.toml --finish 12");
    assert_finished(&folder.out("g"));
}

#[test]
fn shards_side_by_side_draw_each_table_once() {
    let folder = Folder::new(GRID);
    let all: Vec<[u64; 2]> = std::thread::scope(|scope| {
        let folder = &folder;
        let shards = (0..12).map(|index| scope.spawn(move || folder.succeeds(&shard(index, 12))));
        let shards: Vec<_> = shards.collect();
        let reports = shards.into_iter().map(|shard| shard.join().unwrap());
        reports.map(|report| parts(&report)).collect()
    });
    let sum = |kind: usize| all.iter().map(|parts| parts[kind]).sum::<u64>();
    assert_eq!([sum(0), sum(1)], [PARTS, 12 * 16 - PARTS], "{all:?}");
    folder.succeeds("build g.toml --finish 12");
    assert_finished(&folder.out("g"));
}

#[test]
fn threads_draw_each_table_once() {
    let folder = Folder::new(GRID);
    let report = folder.succeeds("build g.toml --threads 6 --json");
    assert_eq!(parts(&report)[0], PARTS);
    assert_finished(&folder.out("g"));
}

/// A damaged part is drawn again, and replaced.
#[test]
fn damaged_tables_are_not_believed() {
    let folder = Folder::new(GRID);
    assert_eq!(parts(&folder.succeeds(&shard(0, 12))), [16, 0]);
    let files = stored(&folder);
    assert_eq!(files.len(), 16);
    let whole: Vec<Vec<u8>> = files.iter().map(|file| fs::read(file).unwrap()).collect();
    for (i, (file, bytes)) in files.iter().zip(&whole).enumerate() {
        let mut damaged = bytes.clone();
        match i % 4 {
            0 => damaged[i * 1000] ^= 1,
            1 => damaged.truncate(i * 1000),
            2 => damaged.clone_from(&whole[i - 1]),
            _ => continue,
        }
        fs::write(file, damaged).unwrap();
    }
    assert_eq!(parts(&folder.succeeds(&shard(1, 12))), [12, 4]);
    for (file, bytes) in files.iter().zip(&whole) {
        assert!(fs::read(file).unwrap() == *bytes, "{}", file.display());
    }
    folder.succeeds("build g.toml");
    assert_finished(&folder.out("g"));
}

/// Tables are a convenience: where they cannot be kept, the build warns and goes on.
#[test]
fn a_build_goes_on_without_tables() {
    let folder = Folder::new(GRID);
    let obstacle = folder.out("g").join(TABLES);
    fs::create_dir_all(folder.out("g")).unwrap();
    fs::write(&obstacle, "").unwrap();
    for index in 0..2 {
        let output = folder.run(&shard(index, 2));
        let warning = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{warning}");
        assert!(
            warning.starts_with(
                "warning: tables of grain events are not shared between processes, which takes more time: cannot create out/g/.splitsnow-tables: "
            ) && warning.lines().count() == 1,
            "{warning}"
        );
        let report = String::from_utf8(output.stdout).unwrap();
        assert_eq!(parts(&report)[1], 0);
    }
    folder.succeeds("build g.toml --finish 2");
    fs::remove_file(&obstacle).unwrap();
    assert_finished(&folder.out("g"));
}

/// The claims of a killed process end with it, and an interrupted build leaves its tables to the
/// next.
#[test]
fn a_killed_process_holds_nobody_up() {
    // tables of the largest size, which take some time
    let slow = GRID.replace("rays = 200", "rays = 65536");
    let folder = Folder::new(&slow);
    let mut child = folder.command(&shard(0, 12)).spawn().unwrap();
    let locked = || {
        let entries = fs::read_dir(folder.out("g").join(TABLES)).ok();
        let mut entries = entries.into_iter().flatten().flatten();
        entries.any(|entry| entry.file_name().to_string_lossy().ends_with(".lock"))
    };
    while !locked() && child.try_wait().unwrap().is_none() {
        std::thread::yield_now();
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let [drawn, read] = parts(&folder.succeeds(&shard(1, 12)));
    assert!(drawn > 0 && drawn + read == 16, "{drawn} {read}");
    assert!(folder.out("g").join(TABLES).exists());
    // another grid in its place deletes them
    folder.write("g.toml", GRID);
    folder.succeeds("build g.toml --fresh");
    assert_finished(&folder.out("g"));
}
