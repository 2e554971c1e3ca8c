//! Interrupted builds. Finished work is kept, damaged files are detected, and the
//! finished directory equals that of an uninterrupted build on one thread, to the byte.
#![cfg(unix)]
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::common::{assert_same, dir_bytes};
use assert_cmd::cargo::cargo_bin;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// 3 x 2 x 2 x 12 x 4 = 576 curves in 48 jobs. A chunk has 12 thicknesses at 31
/// wavelengths, which is larger than a disk block.
const GRID: &str = "version = 1
[axes]
facetness = [0.1, 0.5, 0.9]
grain_size_um = [300, 500]
density_kg_m3 = [100, 200]
thickness_cm = [1, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7, 1.8, 1.9, 2, 2.1]
incidence_angle_deg = [0, 20, 40, 60]
[wavelengths]
start_nm = 400
stop_nm = 700
step_nm = 10
[run]
engine = \"spectral\"
rays = 2000
";

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("g.toml"), GRID).unwrap();
        Self(dir)
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn command(&self, program: &str, args: &[&str]) -> Command {
        let mut command = Command::new(program);
        command.current_dir(self.path()).args(args);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    fn splitsnow(&self, args: &[&str]) -> Command {
        self.command(cargo_bin!("splitsnow").to_str().unwrap(), args)
    }

    /// Runs a build, which must succeed, and returns its output.
    fn build(&self, options: &[&str]) -> String {
        let output = self
            .splitsnow(&[&["build", "g.toml"], options].concat())
            .output()
            .unwrap();
        let text = text(&output);
        assert!(output.status.success(), "{text}");
        text
    }

    /// Kills a build after a delay. Returns false if the build finished before that.
    fn kill_after(&self, delay: Duration) -> bool {
        let mut child = self.splitsnow(&["build", "g.toml"]).spawn().unwrap();
        sleep(delay);
        child.kill().unwrap();
        let output = child.wait_with_output().unwrap();
        let killed = output.status.signal() == Some(9);
        assert!(killed || output.status.success(), "{}", text(&output));
        killed
    }

    /// All files of the output directory, including lock files. Lock files are empty, and
    /// a finished build leaves exactly one.
    fn output_files(&self) -> BTreeMap<String, Vec<u8>> {
        dir_bytes(&self.path().join("out/g"))
    }

    /// The files of an uninterrupted build on one thread, and its duration.
    fn expected() -> (BTreeMap<String, Vec<u8>>, Duration) {
        let folder = Self::new();
        let begin = Instant::now();
        folder.build(&["--threads", "1"]);
        (folder.output_files(), begin.elapsed())
    }

    fn file(&self, name: &str) -> std::path::PathBuf {
        self.path().join("out/g").join(name)
    }
}

fn text(output: &Output) -> String {
    let both = [output.stdout.as_slice(), &output.stderr].concat();
    String::from_utf8(both).unwrap()
}

/// Kills builds at random moments and continues them, until there are enough kills. A
/// third of the kills come while the database is created or opened, the others later.
/// Each finished build is run and killed up to four more times, while it is compressed again.
#[test]
fn killed_builds_continue_at_any_moment() {
    let (expected, duration) = Folder::expected();
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
    let mut random_delay = |max: Duration| max.mul_f64(rng.random());
    let start = Duration::from_millis(30);
    let (mut kills, mut builds) = (0, 0);
    while kills < 30 || builds < 3 {
        let folder = Folder::new();
        for max_delay in [start, duration / 4, duration / 2].into_iter().cycle() {
            if !folder.kill_after(random_delay(max_delay)) {
                break;
            }
            kills += 1;
        }
        for _ in 0..4 {
            kills += u32::from(folder.kill_after(random_delay(start)));
        }
        folder.build(&[]);
        assert_same(&expected, &folder.output_files());
        builds += 1;
    }
}

#[test]
fn signals_stop_a_build_cleanly_and_the_message_names_the_next_command() {
    let (expected, duration) = Folder::expected();
    for (signal, code) in [("-INT", 130), ("-TERM", 75)] {
        let folder = Folder::new();
        let child = folder
            .splitsnow(&["build", "g.toml", "--fresh"])
            .spawn()
            .unwrap();
        sleep(duration / 5);
        let id = child.id().to_string();
        assert!(
            Command::new("kill")
                .args([signal, &id])
                .status()
                .unwrap()
                .success()
        );
        let output = child.wait_with_output().unwrap();
        let text = text(&output);
        assert_eq!(output.status.code(), Some(code), "{text}");
        assert!(
            text.contains(" of 48 jobs are done and safe; to go on: "),
            "{text}"
        );
        assert!(text.ends_with("splitsnow build g.toml\n"), "{text}");
        let jobs = folder.build(&[]);
        assert!(!jobs.contains("48 of them run now"), "{jobs}");
        assert_same(&expected, &folder.output_files());
    }
}

#[test]
fn damage_between_runs_is_found_and_repaired() {
    let (expected, _) = Folder::expected();
    let folder = Folder::new();
    folder.build(&[]);
    let chunk = |array: &str| folder.file(&format!("database.zarr/{array}"));
    // 48 jobs in one file of each array
    let pack = "c.0.0.0.0.0.0";
    let job = |number: usize, offset: usize| number * (12 * 31 * 4 + 4) + offset;
    let edit = |name: &str, change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = fs::read(chunk(name)).unwrap();
        change(&mut bytes);
        fs::write(chunk(name), bytes).unwrap();
    };
    let flip_bit = |name: &str, offset: usize| edit(name, &|bytes| bytes[offset] ^= 0x10);
    let truncate = |name: &str, length: usize| edit(name, &|bytes| bytes.truncate(length));
    flip_bit(&format!("transmittance/{pack}"), job(0, 100));
    truncate(&format!("reflectance_se/{pack}"), job(47, 0));
    flip_bit(&format!("reflectance/{pack}"), job(30, 77));
    flip_bit("jobs/lost_share/c.0", 41 * 8);
    edit("jobs/committed/c.0", &|marks| {
        marks.copy_within(3 * 8..4 * 8, 4 * 8);
        marks[40 * 8..41 * 8].fill(0);
    });
    flip_bit("zarr.json", 0);
    let output = folder.splitsnow(&["build", "g.toml"]).output().unwrap();
    assert!(
        text(&output).contains("zarr.json is not JSON"),
        "{}",
        text(&output)
    );
    flip_bit("zarr.json", 0);
    truncate("../snow.safetensors", 1000);
    assert!(folder.build(&[]).starts_with("48 jobs, 6 of them run now"));
    assert_same(&expected, &folder.output_files());
}

/// Writes fail as on a full disk, because files are limited to one block. Metadata, jobs, arrays
/// and the compact file fail in turn.
#[test]
fn failed_writes_lose_nothing() {
    let (expected, _) = Folder::expected();
    let folder = Folder::new();
    let assert_write_fails = |file: &str| {
        // Without the trap, the signal kills the process before it can report the error.
        let script = "trap '' XFSZ; ulimit -f 1; exec \"$0\" build g.toml";
        let program = cargo_bin!("splitsnow").to_str().unwrap();
        let output = folder
            .command("sh", &["-c", script, program])
            .output()
            .unwrap();
        // the number of jobs was printed before
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{text}");
        assert!(text.starts_with("error: cannot write out/g/"), "{text}");
        assert!(
            text.contains(file) && text.contains("File too large"),
            "{text}"
        );
        assert_eq!(text.lines().count(), 1, "{text}");
    };
    assert_write_fails("zarr.json");
    folder.build(&["--shard", "0/2"]);
    assert_write_fails(".splitsnow-jobs/");
    folder.build(&["--shard", "1/2"]);
    assert_write_fails("database.zarr/transmittance/c.");
    folder.build(&["--shard", "0/1"]);
    assert_write_fails("snow.safetensors");
    assert!(folder.build(&[]).starts_with("48 jobs, 0 of them run now"));
    assert_same(&expected, &folder.output_files());
}

/// Batch systems send a signal before a time limit. The build ends by itself, says so by its exit
/// code, and goes on later.
#[test]
fn a_build_ends_when_a_batch_system_asks() {
    let expected = Folder::new();
    expected.build(&["--threads", "1"]);
    let folder = Folder::new();
    let arguments = ["build", "g.toml", "--threads", "1"];
    let done = || {
        let jobs = fs::read_dir(folder.file(".splitsnow-jobs"));
        jobs.map_or(0, Iterator::count)
    };
    let stopped = |output: Output| {
        let text = text(&output);
        assert_eq!(output.status.code(), Some(75), "{text}");
        assert!(
            text.contains("jobs are done and safe; to go on: "),
            "{text}"
        );
    };
    for signal in ["USR1", "TERM"] {
        let before = done();
        let child = folder.splitsnow(&arguments).spawn().unwrap();
        while done() == before {
            sleep(Duration::from_millis(1));
        }
        let id = child.id().to_string();
        assert!(
            folder
                .command("kill", &["-s", signal, &id])
                .status()
                .unwrap()
                .success()
        );
        stopped(child.wait_with_output().unwrap());
    }
    let limited = [&arguments[..], &["--stop-after", "0.05s"]].concat();
    stopped(folder.splitsnow(&limited).output().unwrap());
    assert!(done() < 48);
    folder.build(&[]);
    assert_same(&expected.output_files(), &folder.output_files());
}

/// A job of several seconds stores parts of its result. The build is killed each time a new
/// part is stored.
#[test]
fn a_job_that_is_killed_repeatedly_finishes() {
    let one_long_job = GRID
        .replace("[0.1, 0.5, 0.9]", "[0.1]")
        .replace("[300, 500]", "[300]")
        .replace("[100, 200]", "[100]")
        .replace("[0, 20, 40, 60]", "[0]")
        .replace("rays = 2000", "rays = 120000");
    let folder = || {
        let folder = Folder::new();
        fs::write(folder.path().join("g.toml"), &one_long_job).unwrap();
        folder
    };
    let expected = folder();
    assert!(
        expected
            .build(&["--threads", "1"])
            .starts_with("1 jobs, 1 of them")
    );
    let folder = folder();
    let parts = folder.file(".splitsnow-units");
    let stored_parts = || {
        let entries = fs::read_dir(&parts).into_iter().flatten();
        let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        names
    };
    let (mut kills, mut truncated) = (0, false);
    loop {
        let before = stored_parts();
        let mut child = folder
            .splitsnow(&["build", "g.toml", "--threads", "1"])
            .spawn()
            .unwrap();
        while stored_parts() == before && child.try_wait().unwrap().is_none() {
            sleep(Duration::from_millis(20));
        }
        child.kill().unwrap();
        let output = child.wait_with_output().unwrap();
        if output.status.signal() != Some(9) {
            assert!(output.status.success(), "{}", text(&output));
            break;
        }
        // Truncate a part, as after a power failure: it must be ignored. The file does not
        // exist if the job was already finished.
        if !truncated && let Ok(bytes) = fs::read(parts.join("0-0")) {
            fs::write(parts.join("0-0"), &bytes[..bytes.len() / 2]).unwrap();
            truncated = true;
        }
        kills += 1;
        assert!(kills < 60);
    }
    assert!(truncated, "the job is too short for this test");
    assert_same(&expected.output_files(), &folder.output_files());
}
