//! File systems without locks, file systems that cannot sync a directory, and
//! output behind symbolic links to another file system.
//!
//! A preloaded library (tests/filesystems/shim.c) replaces `flock()`, `fsync()`
//! and `rename()`. They fail with the errors of such file systems. The program
//! itself is unchanged.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::{MetadataExt, symlink};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::thread::sleep;
use std::time::Duration;

use crate::common::{assert_same, dir_bytes};
use assert_cmd::cargo::cargo_bin;

const GRID: &str = "version = 1
[axes]
facetness = [0.1, 0.5]
grain_size_um = [300]
density_kg_m3 = [100, 200]
thickness_cm = [1, 2]
incidence_angle_deg = [0, 40]
[wavelengths]
start_nm = 400
stop_nm = 700
step_nm = 100
[run]
engine = \"spectral\"
rays = 1000
";

/// Errors of `flock()` on file systems without locks: ENOLCK, ENOSYS, EOPNOTSUPP.
const NO_LOCKS: [&str; 3] = ["37", "38", "95"];
/// Where locks do not work, this file names the process that holds the directory exclusively.
const OWNER_FILE: &str = ".splitsnow-held-alone";

/// Compiles the preloaded library once and returns its path.
fn shim() -> &'static Path {
    static SHIM: OnceLock<PathBuf> = OnceLock::new();
    SHIM.get_or_init(|| {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/filesystems/shim.c");
        let library = Path::new(env!("CARGO_TARGET_TMPDIR")).join("shim.so");
        let mut cc = Command::new("cc");
        cc.args(["-shared", "-fPIC", "-O1", "-Wall", "-Werror", "-o"]);
        assert!(cc.args([&library, &source]).status().unwrap().success());
        library
    })
}

/// A folder in which the program runs with simulated file system errors.
struct Folder {
    dir: tempfile::TempDir,
    /// Environment variables for the shim: each makes one function fail.
    failures: Vec<(&'static str, String)>,
}

impl Folder {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("g.toml"), GRID).unwrap();
        // 50 times as many walks: long enough to be interrupted
        let long = GRID.replace("rays = 1000", "rays = 50000");
        fs::write(dir.path().join("long.toml"), long).unwrap();
        let failures = Vec::new();
        Self { dir, failures }
    }

    fn failing(name: &'static str, value: &str) -> Self {
        let mut folder = Self::new();
        folder.failures.push((name, value.into()));
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn spawn(&self, args: &[&str]) -> Child {
        let mut command = Command::new(cargo_bin!("splitsnow"));
        command.current_dir(&self.dir).args(args);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command.env("LD_PRELOAD", shim());
        command.envs(self.failures.iter().map(|(name, value)| (name, value)));
        command.spawn().unwrap()
    }

    fn run(&self, args: &[&str]) -> Output {
        self.spawn(args).wait_with_output().unwrap()
    }

    /// Runs the program, which must succeed, and returns its standard error.
    fn succeeds(&self, args: &[&str]) -> String {
        let output = self.run(args);
        let text = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{args:?}: {text}");
        text
    }

    /// Runs the program, which must fail, and returns its error message of one line.
    fn fails(&self, args: &[&str]) -> String {
        let output = self.run(args);
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{args:?}: {text}");
        assert_eq!(text.lines().count(), 1, "{text}");
        text
    }

    /// All files of the output directory `out/g`.
    fn output_files(&self) -> BTreeMap<String, Vec<u8>> {
        dir_bytes(&self.path("out/g"))
    }
}

/// The output files of `g.toml` on an ordinary disk.
fn expected() -> &'static BTreeMap<String, Vec<u8>> {
    static EXPECTED: OnceLock<BTreeMap<String, Vec<u8>>> = OnceLock::new();
    EXPECTED.get_or_init(|| {
        let folder = Folder::new();
        folder.succeeds(&["build", "g.toml"]);
        folder.output_files()
    })
}

#[test]
fn without_locks_the_output_is_the_same() {
    for errno in NO_LOCKS {
        let folder = Folder::failing("NO_FLOCK", errno);
        for shard in ["0/2", "1/2"] {
            folder.succeeds(&["build", "g.toml", "--shard", shard]);
        }
        assert_eq!(folder.succeeds(&["build", "g.toml"]), "");
        assert_same(expected(), &folder.output_files());
        folder.succeeds(&["compress", "out/g"]);
        folder.succeeds(&["build", "g.toml", "--fresh"]);
        assert_same(expected(), &folder.output_files());
    }
}

#[test]
fn without_locks_a_running_process_excludes_others_and_a_killed_one_does_not() {
    let mut folder = Folder::failing("NO_FLOCK", NO_LOCKS[0]);
    let build = ["build", "long.toml", "--out", "out/g"];
    let owner_file = folder.path("out/g").join(OWNER_FILE);
    let mut first = folder.spawn(&build);
    let database_root = folder.path("out/g/database.zarr/zarr.json");
    while !owner_file.exists() || !database_root.exists() {
        assert!(first.try_wait().unwrap().is_none());
        sleep(Duration::from_millis(1));
    }
    let busy = format!(
        "error: another splitsnow process is working as process {} in out/g; ",
        first.id()
    );
    let shard = [&build[..], &["--shard", "0/2"]].concat();
    let commands = [&build[..], &["compress", "out/g"], &shard];
    for command in commands {
        let text = folder.fails(command);
        assert!(text.starts_with(&busy), "{text}");
    }
    // a process for which locks work is excluded, too
    let failures = std::mem::take(&mut folder.failures);
    assert!(folder.fails(&build).starts_with(&busy));
    folder.failures = failures;
    first.kill().unwrap();
    assert_eq!(
        first.wait().unwrap().signal(),
        Some(9),
        "the build ended before it was killed"
    );
    assert!(owner_file.exists());
    folder.succeeds(&["build", "g.toml", "--out", "out/g", "--fresh"]);
    assert_same(expected(), &folder.output_files());
}

#[test]
fn owners_that_cannot_be_checked_are_explained() {
    let folder = Folder::failing("NO_FLOCK", NO_LOCKS[0]);
    let owner = "{\"host\": \"node17\", \"process\": 4242, \"namespace\": null, \"started\": 7}";
    for (name, content, who) in [
        (OWNER_FILE, owner, "process 4242 on host \"node17\""),
        (OWNER_FILE, "", "an unknown process"),
        // the program waits for this file before it gives up
        (".splitsnow-gate", owner, "process 4242 on host \"node17\""),
    ] {
        let file = Path::new("out/g").join(name);
        fs::create_dir_all(folder.path("out/g")).unwrap();
        fs::write(folder.path("out/g").join(name), content).unwrap();
        let text = folder.fails(&["build", "g.toml"]);
        let head = format!("error: out/g is held by {who}, ");
        assert!(text.starts_with(&head), "{text}");
        let advice = format!("delete {} and run the same command again", file.display());
        assert!(text.contains(&advice), "{text}");
        fs::remove_file(folder.path("out/g").join(name)).unwrap();
        folder.succeeds(&["build", "g.toml"]);
        assert_same(expected(), &folder.output_files());
    }
}

#[test]
fn a_directory_that_cannot_be_synced_causes_a_warning() {
    // EINVAL, EOPNOTSUPP
    for errno in ["22", "95"] {
        let folder = Folder::failing("NO_DIRECTORY_SYNC", errno);
        let text = folder.succeeds(&["build", "g.toml"]);
        let head = "warning: out/g cannot be synced to the disk (";
        assert!(
            text.starts_with(head) && text.lines().count() == 1,
            "{text}"
        );
        assert_same(expected(), &folder.output_files());
        let text = folder.succeeds(&["export", "out/g", "--format", "csv", "--out", "g.csv"]);
        assert!(text.starts_with("warning: . cannot be synced"), "{text}");
    }
    // EIO: the disk is broken; the program fails, but the new file is in place
    let folder = Folder::failing("NO_DIRECTORY_SYNC", "5");
    let text = folder.fails(&["build", "g.toml"]);
    let head = "error: cannot write out/g/snow.safetensors: the new file is written, but ";
    assert!(
        text.starts_with(head) && !text.contains("old file is unchanged"),
        "{text}"
    );
    // the journal of a failed build is kept
    fs::remove_dir_all(folder.path("out/g/.splitsnow-runs")).unwrap();
    assert_same(expected(), &folder.output_files());
}

/// A directory on another file system than `folder`. It is in shared memory if
/// possible; otherwise [`simulated_other_disk`] provides it.
fn other_disk(folder: &mut Folder) -> tempfile::TempDir {
    let device = |path: &Path| fs::metadata(path).map(|metadata| metadata.dev()).ok();
    let shared_memory = Path::new("/dev/shm");
    if device(shared_memory).is_some_and(|other| Some(other) != device(folder.dir.path()))
        && let Ok(dir) = tempfile::tempdir_in(shared_memory)
    {
        return dir;
    }
    simulated_other_disk(folder)
}

/// A directory on the same file system, for which `rename()` fails as if it were
/// on another one.
fn simulated_other_disk(folder: &mut Folder) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let real_path = dir.path().canonicalize().unwrap();
    folder
        .failures
        .push(("OTHER_DEVICE", real_path.to_str().unwrap().into()));
    dir
}

#[test]
fn builds_write_through_links_to_another_disk() {
    let database: BTreeMap<_, _> = expected()
        .iter()
        .filter_map(|(name, bytes)| {
            Some((
                name.strip_prefix("database.zarr/")?.to_owned(),
                bytes.clone(),
            ))
        })
        .collect();
    let compact = &expected()["snow.safetensors"];
    for make_disk in [other_disk, simulated_other_disk] {
        let mut folder = Folder::new();
        let disk = make_disk(&mut folder);
        let (database_dir, file) = (disk.path().join("db"), disk.path().join("snow"));
        fs::create_dir(&database_dir).unwrap();
        fs::create_dir_all(folder.path("out/g")).unwrap();
        let links = [
            (&database_dir, "database.zarr"),
            (&file, "snow.safetensors"),
        ];
        for (target, name) in links {
            symlink(target, folder.path("out/g").join(name)).unwrap();
        }
        // build one shard, complete it, rebuild everything, then rebuild nothing
        folder.succeeds(&["build", "g.toml", "--shard", "0/2"]);
        for options in [&[][..], &["--fresh"], &[]] {
            folder.succeeds(&[&["build", "g.toml"], options].concat());
            assert_same(&database, &dir_bytes(&database_dir));
            assert_eq!(&fs::read(&file).unwrap(), compact);
            for (target, name) in links {
                let link = fs::read_link(folder.path("out/g").join(name));
                assert_eq!(&link.unwrap(), target);
            }
            assert_same(expected(), &folder.output_files());
        }
        assert_eq!(fs::read_dir(disk.path()).unwrap().count(), 2);
    }
}

#[test]
fn builds_work_with_a_linked_output_directory_and_a_linked_array() {
    let mut folder = Folder::new();
    let disk = other_disk(&mut folder);
    symlink(disk.path(), folder.path("out")).unwrap();
    folder.succeeds(&["build", "g.toml"]);
    assert_same(expected(), &folder.output_files());
    // move one array back to the first disk, lose a chunk, and leave an unfinished write
    let array = folder.path("out/g/database.zarr/transmittance");
    let moved = folder.path("moved");
    let copied = Command::new("cp").arg("-r").args([&array, &moved]).status();
    assert!(copied.unwrap().success());
    fs::remove_dir_all(&array).unwrap();
    symlink(&moved, &array).unwrap();
    fs::remove_file(moved.join("c.0.0.0.0.0.0")).unwrap();
    fs::create_dir(moved.join(".splitsnow-partial")).unwrap();
    folder.succeeds(&["build", "g.toml"]);
    assert_same(expected(), &folder.output_files());
}

#[test]
fn links_to_nothing_are_explained() {
    let folder = Folder::new();
    symlink("/nowhere/at/all", folder.path("out")).unwrap();
    let assert_explained = |name: &str| {
        let text = folder.fails(&["build", "g.toml"]);
        let head =
            format!("error: {name} is a symbolic link to /nowhere/at/all, which does not exist;");
        assert!(text.starts_with(&head), "{text}");
    };
    assert_explained("out");
    fs::remove_file(folder.path("out")).unwrap();
    fs::create_dir_all(folder.path("out/g")).unwrap();
    symlink("/nowhere/at/all", folder.path("out/g/database.zarr")).unwrap();
    assert_explained("out/g/database.zarr");
}
