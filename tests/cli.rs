//! The command line: its output, and the independence of the written files from
//! threads and shards.
//!
//! The expected output is in `tests/cli/*.trycmd`. TRYCMD=overwrite updates it.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use crate::common::{assert_same, dir_bytes};
use assert_cmd::cargo::cargo_bin;

/// How long to wait for a process.
const TIMEOUT: Duration = Duration::from_secs(60);
const SAMPLE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/configs/samples/representative.toml"
);
const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/scenes/block.toml");

fn splitsnow(dir: &Path, args: &str) -> Command {
    let mut command = Command::new(cargo_bin!("splitsnow"));
    command.current_dir(dir).args(args.split_whitespace());
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Runs a command, which must succeed, and returns its standard output.
fn run(dir: &Path, args: &str) -> String {
    output_of(splitsnow(dir, args).spawn().unwrap())
}

/// Waits for a process, which must succeed, and returns its standard output.
fn output_of(child: Child) -> String {
    let output = child.wait_with_output().unwrap();
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{errors}");
    assert_eq!(errors, "");
    String::from_utf8(output.stdout).unwrap()
}

/// A folder with the grid file `tiny.toml`, modified by `change`.
fn folder(change: impl Fn(String) -> String) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let text = include_str!("cli/build.in/tiny.toml").to_string();
    std::fs::write(dir.path().join("tiny.toml"), change(text)).unwrap();
    dir
}

/// All files of the output directory.
fn output_files(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    dir_bytes(&dir.join("out/tiny"))
}

#[test]
fn output_equals_the_snapshots() {
    let cases = trycmd::TestCases::new();
    cases.env("COLUMNS", "100").case("tests/cli/*.trycmd");
}

/// A build says at once what it will do, also where no progress bar is shown.
#[test]
fn a_build_prints_its_first_line_before_it_runs() {
    let dir = folder(|text| text.replace("rays = 300", "rays = 3000000000"));
    let mut child = splitsnow(dir.path(), "build tiny.toml").spawn().unwrap();
    let mut line = String::new();
    let mut output = BufReader::new(child.stdout.take().unwrap());
    output.read_line(&mut line).unwrap();
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(line, "4 jobs, 4 of them run now\n");
}

#[test]
fn files_do_not_depend_on_threads_and_shards() {
    for engine in ["spectral", "reference", "tabulated", "auto"] {
        let build = format!("build tiny.toml --engine {engine}");
        let one_thread = folder(|text| text);
        run(one_thread.path(), &format!("{build} --threads 1"));
        let expected = output_files(one_thread.path());
        assert!(expected.contains_key("snow.safetensors"));

        let two_threads = folder(|text| text);
        run(two_threads.path(), &format!("{build} --threads 2"));
        assert_same(&expected, &output_files(two_threads.path()));
        assert!(run(two_threads.path(), &build).contains("jobs, 0 of them run now"));
        assert_same(&expected, &output_files(two_threads.path()));

        for count in 1..=3 {
            let dir = folder(|text| text);
            let shard = |i| splitsnow(dir.path(), &format!("{build} --shard {i}/{count}"));
            let shards: Vec<Child> = (0..count).map(|i| shard(i).spawn().unwrap()).collect();
            for child in shards {
                let text = output_of(child);
                assert!(text.contains(&format!("/{count}: ")), "{text}");
            }
            assert!(!output_files(dir.path()).contains_key("snow.safetensors"));
            assert!(run(dir.path(), &build).contains("jobs, 0 of them run now"));
            assert_same(&expected, &output_files(dir.path()));
        }
    }
}

/// `--threads` overrides SLURM_CPUS_PER_TASK, which overrides RAYON_NUM_THREADS. An invalid
/// value is refused before anything is written, and the message names its variable.
#[test]
fn the_environment_limits_the_threads() {
    let dir = folder(|text| text);
    let run_with = |args: &str, [slurm, rayon]: [&str; 2]| {
        let mut command = splitsnow(dir.path(), args);
        command.env("SLURM_CPUS_PER_TASK", slurm);
        command.env("RAYON_NUM_THREADS", rayon);
        command.output().unwrap()
    };
    for (option, limits, expected) in [
        ("", ["3", "5"], 3),
        ("", ["", "5"], 5),
        (" --threads 2", ["3", "5"], 2),
    ] {
        let output = run_with(&format!("plan tiny.toml --json{option}"), limits);
        let plan: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(plan["threads"], expected);
    }
    std::fs::copy(SAMPLE, dir.path().join("sample.toml")).unwrap();
    std::fs::copy(SCENE, dir.path().join("scene.toml")).unwrap();
    for command in [
        "build tiny.toml",
        "plan tiny.toml",
        "measure sample.toml --rays 8",
        "tradeoff",
        "fit scene.toml",
    ] {
        for limits in [["0", "2"], ["", "two"]] {
            let output = run_with(command, limits);
            let text = String::from_utf8(output.stderr).unwrap();
            let variable = ["SLURM_CPUS_PER_TASK is `0`", "RAYON_NUM_THREADS is `two`"];
            let variable = variable[usize::from(limits[0].is_empty())];
            assert!(
                !output.status.success() && text.contains(variable),
                "{text}"
            );
        }
    }
    assert!(!dir.path().join("out").exists());
}

#[test]
fn a_plain_build_keeps_the_bounds_of_its_grid_file() {
    let dir = folder(|text| text + "\n[compression]\nmax_delta_e = 0.05\n");
    run(dir.path(), "build tiny.toml");
    let expected = output_files(dir.path());
    run(dir.path(), "compress out/tiny --components 1");
    assert!(expected != output_files(dir.path()));
    run(dir.path(), "compress out/tiny --max-delta-e 0.05");
    assert_same(&expected, &output_files(dir.path()));
    run(dir.path(), "compress out/tiny");
    run(dir.path(), "build tiny.toml");
    assert_same(&expected, &output_files(dir.path()));
}

#[test]
fn the_given_colour_difference_is_used_and_verified() {
    let viewing = "illuminants = [\"E\", \"LED-B5\"]\ndelta_e = \"cie2000\"\n";
    let dir = folder(|text| format!("{text}\n[compression]\nmax_delta_e = 0.5\n{viewing}"));
    run(dir.path(), "build tiny.toml");
    let expected = output_files(dir.path());
    run(dir.path(), "compress out/tiny --max-delta-e 0.5");
    assert!(expected != output_files(dir.path()));
    let options = "--max-delta-e 0.5 --illuminant E --illuminant LED-B5 --delta-e cie2000";
    run(dir.path(), &format!("compress out/tiny {options}"));
    assert_same(&expected, &output_files(dir.path()));
    let report = run(
        dir.path(),
        "verify out/tiny --samples 2 --rays 100 --points 0",
    );
    assert!(
        report.contains("Delta-E: cie2000, the worst of E, LED-B5"),
        "{report}"
    );

    // The file states a formula other than the one it was made with, or an unknown one.
    let path = dir.path().join("out/tiny/snow.safetensors");
    let original = std::fs::read(&path).unwrap();
    for (other, problem) in [
        ("cie1976", "its error table states"),
        ("cie1994", "no colour difference is named `cie1994`"),
    ] {
        let mut changed = original.clone();
        let offset = changed
            .windows(7)
            .position(|bytes| bytes == b"cie2000")
            .unwrap();
        changed[offset..offset + 7].copy_from_slice(other.as_bytes());
        std::fs::write(&path, changed).unwrap();
        let verify = splitsnow(dir.path(), "verify out/tiny --samples 0 --points 0");
        let output = { verify }.output().unwrap();
        let report = String::from_utf8(output.stdout).unwrap();
        assert_eq!(output.status.code(), Some(1));
        assert!(report.contains(problem), "{report}");
    }
}

#[test]
fn a_fresh_build_starts_from_scratch() {
    let dir = folder(|text| text);
    run(dir.path(), "build tiny.toml");
    let expected = output_files(dir.path());
    std::fs::write(dir.path().join("out/tiny/mine.txt"), "stays").unwrap();
    run(dir.path(), "build tiny.toml --engine reference --fresh");
    assert!(run(dir.path(), "build tiny.toml --fresh").contains("4 jobs, 4 of them run now"));
    let mut found = output_files(dir.path());
    assert_eq!(found.remove("mine.txt").unwrap(), b"stays");
    assert_same(&expected, &found);
}

/// A database records the content of a user's data table, not its path.
#[test]
fn a_changed_data_table_is_refused() {
    let wet =
        |text: String| text + "[fixed]\nwater_saturation = 0.1\n[model]\nwater = \"water.csv\"\n";
    let dir = folder(wet);
    let table = dir.path().join("water.csv");
    std::fs::write(&table, "wavelength_nm,n,k\n300,1.34,1e-9\n800,1.33,1e-8\n").unwrap();
    run(dir.path(), "build tiny.toml");
    std::fs::write(&table, "wavelength_nm,n,k\n300,1.34,1e-9\n800,1.33,2e-8\n").unwrap();
    let output = splitsnow(dir.path(), "build tiny.toml").output().unwrap();
    let errors = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(
        errors.starts_with("error: out/tiny/database.zarr was made with data.water = "),
        "{errors}"
    );
}

#[test]
fn two_processes_do_not_share_a_directory() {
    let dir = folder(|text| text.replace("rays = 300", "rays = 10000000"));
    let mut first = splitsnow(dir.path(), "build tiny.toml").spawn().unwrap();
    wait_for(&dir.path().join("out/tiny/database.zarr"));
    for args in [
        "build tiny.toml",
        "build tiny.toml --shard 0/2",
        "build tiny.toml --fresh",
        "compress out/tiny",
    ] {
        let output = splitsnow(dir.path(), args).output().unwrap();
        let errors = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{args}");
        assert!(
            errors.starts_with("error: another splitsnow process is working "),
            "{errors}"
        );
        assert_eq!(errors.lines().count(), 1);
    }
    first.kill().unwrap();
    first.wait().unwrap();
}

fn wait_for(path: &Path) {
    let begin = std::time::Instant::now();
    while !path.exists() {
        assert!(
            begin.elapsed() < TIMEOUT,
            "{} did not appear",
            path.display()
        );
        sleep(Duration::from_millis(5));
    }
}

/// A reader that closes the pipe early is not an error, but a full device is.
#[test]
#[cfg(target_os = "linux")]
fn a_closed_pipe_is_not_an_error() {
    let dir = folder(|text| text);
    run(dir.path(), "build tiny.toml");
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let help = splitsnow(dir.path(), "build tiny.toml")
        .stdout(writer)
        .output()
        .unwrap();
    assert_eq!(
        (help.status.code(), help.stderr.as_slice()),
        (Some(0), &b""[..])
    );
    let full = File::options().write(true).open("/dev/full").unwrap();
    let output = splitsnow(dir.path(), "build tiny.toml")
        .stdout(full)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(
        errors.starts_with("error: cannot write to standard output: "),
        "{errors}"
    );
}

/// `measure`, `fit` and `doubling` still work, and help does not list them.
#[test]
fn former_names_of_commands_and_engines_work() {
    let run = |args: &[&str]| {
        let mut command = assert_cmd::Command::cargo_bin("splitsnow").unwrap();
        let output = command
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .args(args)
            .output()
            .unwrap();
        assert!(output.status.success(), "{args:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let sample = "configs/samples/small.toml";
    let rest = ["--rays", "256", "--seed", "3"];
    let old = run(&[&["measure", sample, "--engine", "doubling"][..], &rest].concat());
    let new = run(&[&["simulate", sample, "--engine", "hybrid"][..], &rest].concat());
    assert_eq!(old, new);
    assert!(run(&["fit", "--help"]).contains("SCENE.toml"));
    let help = run(&["--help"]);
    for former in ["measure  ", "fit  ", "doubling"] {
        assert!(!help.contains(former), "{former}: {help}");
    }
}

/// What a message may ask the user to do, as the first word of its last clause.
const ADVICE: &[&str] = &[
    "add", "ask", "build", "change", "check", "choose", "compress", "correct", "delete", "export",
    "extend", "fill", "finish", "free", "give", "include", "leave", "lower", "make", "move",
    "name", "raise", "remove", "rename", "report", "restore", "run", "set", "sort", "swap", "use",
    "wait", "write",
];

/// Whether a message ends with what to do: the text after `help: `, or its last clause, begins
/// with a word of [`ADVICE`].
fn advises(message: &str) -> bool {
    let last = message.lines().last().unwrap_or_default();
    let begins = |text: &str| {
        let word = text.split(|c: char| !c.is_alphabetic()).next();
        word.is_some_and(|word| ADVICE.contains(&word))
    };
    let clause = last.rsplit("; ").next().unwrap_or_default();
    let help = last.trim().strip_prefix("help: ").unwrap_or_default();
    begins(help) || begins(clause.trim().trim_start_matches("help: "))
}

/// The messages in the transcripts are those of the program; other tests compare them.
#[test]
fn errors_end_with_what_to_do() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let mut silent = Vec::new();
    let mut count = 0;
    let mut check = |message: &str| {
        count += 1;
        if !advises(message) {
            silent.push(message.to_owned());
        }
    };
    for name in ["build", "errors", "export", "help", "query", "usage"] {
        let text = std::fs::read_to_string(folder.join(format!("cli/{name}.trycmd"))).unwrap();
        for block in text.split("\n? 1\n").skip(1) {
            check(block.split("\n\n").next().unwrap());
        }
    }
    for name in ["grid", "sample", "scene", "snowpack", "study"] {
        let text =
            std::fs::read_to_string(folder.join(format!("config_errors/{name}.txt"))).unwrap();
        text.trim().split("\n\n").for_each(&mut check);
    }
    assert!(count > 200, "{count}");
    assert!(silent.is_empty(), "{}", silent.join("\n\n"));
}
