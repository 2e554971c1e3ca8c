//! Whatever ends a build, at whatever moment: nothing is lost, nothing broken
//! is trusted, and the finished directory is, to the byte, that of an
//! uninterrupted build on one thread.
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

/// 3 x 2 x 2 x 12 x 4 = 576 curves in 48 jobs; 12 thicknesses at 31
/// wavelengths, so that a chunk is larger than a block of the disk's.
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

    /// A build that must end well.
    fn build(&self, more: &[&str]) -> String {
        let output = self
            .splitsnow(&[&["build", "g.toml"], more].concat())
            .output()
            .unwrap();
        let text = text(&output);
        assert!(output.status.success(), "{text}");
        text
    }

    /// Kills a build; false if it had ended well before.
    fn kill_after(&self, moment: Duration) -> bool {
        let mut child = self.splitsnow(&["build", "g.toml"]).spawn().unwrap();
        sleep(moment);
        child.kill().unwrap();
        let output = child.wait_with_output().unwrap();
        let killed = output.status.signal() == Some(9);
        assert!(killed || output.status.success(), "{}", text(&output));
        killed
    }

    /// The output directory. No file is left out: the lock files are empty,
    /// and only the one that a finished build has stays.
    fn bytes(&self) -> BTreeMap<String, Vec<u8>> {
        dir_bytes(&self.path().join("out/g"))
    }

    /// What an uninterrupted build on one thread gives, and its time.
    fn expected() -> (BTreeMap<String, Vec<u8>>, Duration) {
        let folder = Self::new();
        let begin = Instant::now();
        folder.build(&["--threads", "1"]);
        (folder.bytes(), begin.elapsed())
    }

    fn file(&self, name: &str) -> std::path::PathBuf {
        self.path().join("out/g").join(name)
    }
}

fn text(output: &Output) -> String {
    let both = [output.stdout.as_slice(), &output.stderr].concat();
    String::from_utf8(both).unwrap()
}

/// Kills until there were enough, of builds begun anew and gone on with. One in
/// three comes while the database is created or opened, the others anywhere;
/// finished databases are killed while they are compressed again.
#[test]
fn kills_at_any_moment() {
    let (expected, whole) = Folder::expected();
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
    let mut moment = |most: Duration| most.mul_f64(rng.random());
    let start = Duration::from_millis(30);
    let (mut kills, mut builds) = (0, 0);
    while kills < 30 || builds < 3 {
        let folder = Folder::new();
        for most in [start, whole / 4, whole / 2].into_iter().cycle() {
            if !folder.kill_after(moment(most)) {
                break;
            }
            kills += 1;
        }
        for _ in 0..4 {
            kills += u32::from(folder.kill_after(moment(start)));
        }
        folder.build(&[]);
        assert_same(&expected, &folder.bytes());
        builds += 1;
    }
}

#[test]
fn ctrl_c_stops_cleanly_and_says_how_to_go_on() {
    let (expected, whole) = Folder::expected();
    for signal in ["-INT", "-TERM"] {
        let folder = Folder::new();
        let child = folder
            .splitsnow(&["build", "g.toml", "--fresh"])
            .spawn()
            .unwrap();
        sleep(whole / 5);
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
        assert_eq!(output.status.code(), Some(130), "{text}");
        assert!(
            text.contains(" of 48 jobs are done and safe; to go on: "),
            "{text}"
        );
        assert!(text.ends_with("splitsnow build g.toml\n"), "{text}");
        let jobs = folder.build(&[]);
        assert!(!jobs.contains("48 of them run now"), "{jobs}");
        assert_same(&expected, &folder.bytes());
    }
}

#[test]
fn damage_between_runs_is_found_and_repaired() {
    let (expected, _) = Folder::expected();
    let folder = Folder::new();
    folder.build(&[]);
    let chunk = |array: &str| folder.file(&format!("database.zarr/{array}"));
    let flip = |name: &str, at: usize| {
        let mut bytes = fs::read(chunk(name)).unwrap();
        bytes[at] ^= 0x10;
        fs::write(chunk(name), bytes).unwrap();
    };
    let truncate = |name: &str, length: u64| {
        let file = fs::OpenOptions::new()
            .write(true)
            .open(chunk(name))
            .unwrap();
        file.set_len(length).unwrap();
    };
    truncate("transmittance/c.0.0.0.0.0.0", 100);
    truncate("reflectance_se/c.0.1.0.0.1.0", 0);
    flip("reflectance/c.1.0.1.0.2.0", 77);
    fs::remove_file(chunk("jobs/committed/c.40")).unwrap();
    fs::remove_file(chunk("jobs/lost_share/c.41")).unwrap();
    fs::copy(chunk("jobs/committed/c.3"), chunk("jobs/committed/c.4")).unwrap();
    flip("zarr.json", 0);
    let output = folder.splitsnow(&["build", "g.toml"]).output().unwrap();
    assert!(
        text(&output).contains("zarr.json is not JSON"),
        "{}",
        text(&output)
    );
    flip("zarr.json", 0);
    truncate("../snow.safetensors", 1000);
    assert!(folder.build(&[]).starts_with("48 jobs, 6 of them run now"));
    assert_same(&expected, &folder.bytes());
}

/// Under a limit of one block no file of any size can be written: first the
/// metadata, then the chunks, then the compact file fail as on a full disk.
#[test]
fn failed_writes_lose_nothing() {
    let (expected, _) = Folder::expected();
    let folder = Folder::new();
    let fails = |what: &str| {
        // Without the trap the signal ends the process before it can tell.
        let script = "trap '' XFSZ; ulimit -f 1; exec \"$0\" build g.toml";
        let program = cargo_bin!("splitsnow").to_str().unwrap();
        let output = folder
            .command("sh", &["-c", script, program])
            .output()
            .unwrap();
        let text = text(&output);
        assert_eq!(output.status.code(), Some(1), "{text}");
        assert!(text.starts_with("error: cannot write out/g/"), "{text}");
        assert!(
            text.contains(what) && text.contains("File too large"),
            "{text}"
        );
        assert_eq!(text.lines().count(), 1, "{text}");
    };
    fails("zarr.json");
    folder.build(&["--shard", "0/2"]);
    fails("database.zarr/transmittance/c.");
    folder.build(&["--shard", "1/2"]);
    fails("snow.safetensors");
    assert!(folder.build(&[]).starts_with("48 jobs, 0 of them run now"));
    assert_same(&expected, &folder.bytes());
}

/// One job of some seconds, killed each time it has kept something of itself.
#[test]
fn a_job_that_is_killed_again_and_again_ends() {
    let long = GRID
        .replace("[0.1, 0.5, 0.9]", "[0.1]")
        .replace("[300, 500]", "[300]")
        .replace("[100, 200]", "[100]")
        .replace("[0, 20, 40, 60]", "[0]")
        .replace("rays = 2000", "rays = 120000");
    let folder = || {
        let folder = Folder::new();
        fs::write(folder.path().join("g.toml"), &long).unwrap();
        folder
    };
    let expected = folder();
    assert!(
        expected
            .build(&["--threads", "1"])
            .starts_with("1 jobs, 1 of them")
    );
    let folder = folder();
    let units = folder.file(".splitsnow-units");
    let state = || {
        let entries = fs::read_dir(&units).into_iter().flatten();
        let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        names
    };
    let (mut kills, mut torn) = (0, false);
    loop {
        let before = state();
        let mut child = folder
            .splitsnow(&["build", "g.toml", "--threads", "1"])
            .spawn()
            .unwrap();
        while state() == before && child.try_wait().unwrap().is_none() {
            sleep(Duration::from_millis(20));
        }
        child.kill().unwrap();
        let output = child.wait_with_output().unwrap();
        if output.status.signal() != Some(9) {
            assert!(output.status.success(), "{}", text(&output));
            break;
        }
        // Torn, as by a power cut: passed over. A kill may also find the job done and its
        // files deleted.
        if !torn && let Ok(bytes) = fs::read(units.join("0-0")) {
            fs::write(units.join("0-0"), &bytes[..bytes.len() / 2]).unwrap();
            torn = true;
        }
        kills += 1;
        assert!(kills < 60);
    }
    assert!(torn, "the job is too short for this test");
    assert_same(&expected.bytes(), &folder.bytes());
}
