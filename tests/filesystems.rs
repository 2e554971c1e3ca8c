//! File systems that lack locks, that cannot sync a directory, and that are
//! reached by symbolic links: the program as it is, in front of a C library
//! that says what such file systems say.
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

/// `flock()` where there is none: ENOLCK, ENOSYS, EOPNOTSUPP.
const NO_LOCKS: [&str; 3] = ["37", "38", "95"];
const HELD: &str = ".splitsnow-held-alone";

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

/// A folder in which builds run, as if its file systems lacked what `lacks` says.
struct Folder {
    dir: tempfile::TempDir,
    lacks: Vec<(&'static str, String)>,
}

impl Folder {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("g.toml"), GRID).unwrap();
        // as long as it is waited for: 50 times as many walks
        let long = GRID.replace("rays = 1000", "rays = 50000");
        fs::write(dir.path().join("long.toml"), long).unwrap();
        let lacks = Vec::new();
        Self { dir, lacks }
    }

    fn lacking(name: &'static str, value: &str) -> Self {
        let mut folder = Self::new();
        folder.lacks.push((name, value.into()));
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
        command.envs(self.lacks.iter().map(|(name, value)| (name, value)));
        command.spawn().unwrap()
    }

    fn run(&self, args: &[&str]) -> Output {
        self.spawn(args).wait_with_output().unwrap()
    }

    /// What it says on standard error.
    fn ends_well(&self, args: &[&str]) -> String {
        let output = self.run(args);
        let text = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{args:?}: {text}");
        text
    }

    /// The one line of a refusal.
    fn is_refused(&self, args: &[&str]) -> String {
        let output = self.run(args);
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{args:?}: {text}");
        assert_eq!(text.lines().count(), 1, "{text}");
        text
    }

    fn bytes(&self) -> BTreeMap<String, Vec<u8>> {
        dir_bytes(&self.path("out/g"))
    }
}

/// What `g.toml` gives on an ordinary disk.
fn expected() -> &'static BTreeMap<String, Vec<u8>> {
    static EXPECTED: OnceLock<BTreeMap<String, Vec<u8>>> = OnceLock::new();
    EXPECTED.get_or_init(|| {
        let folder = Folder::new();
        folder.ends_well(&["build", "g.toml"]);
        folder.bytes()
    })
}

#[test]
fn without_locks_all_is_as_with_them() {
    for number in NO_LOCKS {
        let folder = Folder::lacking("NO_FLOCK", number);
        for part in ["0/2", "1/2"] {
            folder.ends_well(&["build", "g.toml", "--shard", part]);
        }
        assert_eq!(folder.ends_well(&["build", "g.toml"]), "");
        assert_same(expected(), &folder.bytes());
        folder.ends_well(&["compress", "out/g"]);
        folder.ends_well(&["build", "g.toml", "--fresh"]);
        assert_same(expected(), &folder.bytes());
    }
}

#[test]
fn without_locks_one_process_excludes_another_and_a_killed_one_none() {
    let mut folder = Folder::lacking("NO_FLOCK", NO_LOCKS[0]);
    let build = ["build", "long.toml", "--out", "out/g"];
    let held = folder.path("out/g").join(HELD);
    let mut first = folder.spawn(&build);
    let root = folder.path("out/g/database.zarr/zarr.json");
    while !held.exists() || !root.exists() {
        assert!(first.try_wait().unwrap().is_none());
        sleep(Duration::from_millis(1));
    }
    let busy = format!(
        "error: another splitsnow process is working as process {} in out/g; ",
        first.id()
    );
    let shard = [&build[..], &["--shard", "0/2"]].concat();
    let others = [&build[..], &["compress", "out/g"], &shard];
    for other in others {
        let text = folder.is_refused(other);
        assert!(text.starts_with(&busy), "{text}");
    }
    // where locks work, or do again
    let lacks = std::mem::take(&mut folder.lacks);
    assert!(folder.is_refused(&build).starts_with(&busy));
    folder.lacks = lacks;
    first.kill().unwrap();
    assert_eq!(first.wait().unwrap().signal(), Some(9), "ended too early");
    assert!(held.exists());
    folder.ends_well(&["build", "g.toml", "--out", "out/g", "--fresh"]);
    assert_same(expected(), &folder.bytes());
}

#[test]
fn what_cannot_be_known_of_another_host_is_explained() {
    let folder = Folder::lacking("NO_FLOCK", NO_LOCKS[0]);
    let owner = "{\"host\": \"node17\", \"process\": 4242, \"namespace\": null, \"started\": 7}";
    for (name, content, who) in [
        (HELD, owner, "process 4242 on host \"node17\""),
        (HELD, "", "an unknown process"),
        // waited for, then explained
        (".splitsnow-gate", owner, "process 4242 on host \"node17\""),
    ] {
        let file = Path::new("out/g").join(name);
        fs::create_dir_all(folder.path("out/g")).unwrap();
        fs::write(folder.path("out/g").join(name), content).unwrap();
        let text = folder.is_refused(&["build", "g.toml"]);
        let head = format!("error: out/g is held by {who}, ");
        assert!(text.starts_with(&head), "{text}");
        let advice = format!("delete {} and run the same command again", file.display());
        assert!(text.contains(&advice), "{text}");
        fs::remove_file(folder.path("out/g").join(name)).unwrap();
        folder.ends_well(&["build", "g.toml"]);
        assert_same(expected(), &folder.bytes());
    }
}

#[test]
fn a_directory_that_cannot_be_synced_is_a_warning() {
    // EINVAL, EOPNOTSUPP
    for number in ["22", "95"] {
        let folder = Folder::lacking("NO_DIRECTORY_SYNC", number);
        let text = folder.ends_well(&["build", "g.toml"]);
        let head = "warning: out/g cannot be synced to the disk (";
        assert!(
            text.starts_with(head) && text.lines().count() == 1,
            "{text}"
        );
        assert_same(expected(), &folder.bytes());
        let text = folder.ends_well(&["export", "out/g", "--format", "csv", "--out", "g.csv"]);
        assert!(text.starts_with("warning: . cannot be synced"), "{text}");
    }
    // EIO: the disk is broken, and the file is there
    let folder = Folder::lacking("NO_DIRECTORY_SYNC", "5");
    let text = folder.is_refused(&["build", "g.toml"]);
    let head = "error: cannot write out/g/snow.safetensors: the new file is written, but ";
    assert!(
        text.starts_with(head) && !text.contains("old file is unchanged"),
        "{text}"
    );
    assert_same(expected(), &folder.bytes());
}

/// A directory on another file system than `folder`'s: shared memory, or one
/// that `rename()` is made to take for another.
fn other_disk(folder: &mut Folder) -> tempfile::TempDir {
    let device = |path: &Path| fs::metadata(path).map(|about| about.dev()).ok();
    let memory = Path::new("/dev/shm");
    if device(memory).is_some_and(|other| Some(other) != device(folder.dir.path()))
        && let Ok(dir) = tempfile::tempdir_in(memory)
    {
        return dir;
    }
    let dir = tempfile::tempdir().unwrap();
    let real = dir.path().canonicalize().unwrap();
    folder
        .lacks
        .push(("OTHER_DEVICE", real.to_str().unwrap().into()));
    dir
}

#[test]
fn links_to_another_disk_are_written_through() {
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
    for really in [true, false] {
        let mut folder = Folder::new();
        let disk = if really {
            other_disk(&mut folder)
        } else {
            let dir = tempfile::tempdir().unwrap();
            let real = dir.path().canonicalize().unwrap();
            folder
                .lacks
                .push(("OTHER_DEVICE", real.to_str().unwrap().into()));
            dir
        };
        let (there, file) = (disk.path().join("db"), disk.path().join("snow"));
        fs::create_dir(&there).unwrap();
        fs::create_dir_all(folder.path("out/g")).unwrap();
        let links = [(&there, "database.zarr"), (&file, "snow.safetensors")];
        for (target, name) in links {
            symlink(target, folder.path("out/g").join(name)).unwrap();
        }
        // in parts, whole, again from the start
        folder.ends_well(&["build", "g.toml", "--shard", "0/2"]);
        for more in [&[][..], &["--fresh"], &[]] {
            folder.ends_well(&[&["build", "g.toml"], more].concat());
            assert_same(&database, &dir_bytes(&there));
            assert_eq!(&fs::read(&file).unwrap(), compact);
            for (target, name) in links {
                let link = fs::read_link(folder.path("out/g").join(name));
                assert_eq!(&link.unwrap(), target);
            }
            assert_same(expected(), &folder.bytes());
        }
        assert_eq!(fs::read_dir(disk.path()).unwrap().count(), 2);
    }
}

#[test]
fn output_directories_behind_links_and_moved_arrays_work() {
    let mut folder = Folder::new();
    let disk = other_disk(&mut folder);
    symlink(disk.path(), folder.path("out")).unwrap();
    folder.ends_well(&["build", "g.toml"]);
    assert_same(expected(), &folder.bytes());
    // one array moved to the first disk, and some of it lost
    let array = folder.path("out/g/database.zarr/transmittance");
    let moved = folder.path("moved");
    let copied = Command::new("cp").arg("-r").args([&array, &moved]).status();
    assert!(copied.unwrap().success());
    fs::remove_dir_all(&array).unwrap();
    symlink(&moved, &array).unwrap();
    fs::remove_file(moved.join("c.0.0.0.0.0.0")).unwrap();
    fs::create_dir(moved.join(".splitsnow-partial")).unwrap();
    folder.ends_well(&["build", "g.toml"]);
    assert_same(expected(), &folder.bytes());
}

#[test]
fn links_to_nothing_are_explained() {
    let folder = Folder::new();
    symlink("/nowhere/at/all", folder.path("out")).unwrap();
    let nothing = |name: &str| {
        let text = folder.is_refused(&["build", "g.toml"]);
        let head =
            format!("error: {name} is a symbolic link to /nowhere/at/all, which does not exist;");
        assert!(text.starts_with(&head), "{text}");
    };
    nothing("out");
    fs::remove_file(folder.path("out")).unwrap();
    fs::create_dir_all(folder.path("out/g")).unwrap();
    symlink("/nowhere/at/all", folder.path("out/g/database.zarr")).unwrap();
    nothing("out/g/database.zarr");
}
