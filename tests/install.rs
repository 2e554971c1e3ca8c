//! First use of an installed program: the story without arguments, `init`, the example of
//! every command, `doctor`, `completions` and `man`.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;
use std::process::Output;

use assert_cmd::cargo::cargo_bin;

use crate::common::{assert_same, dir_bytes};

fn splitsnow(args: &[&str]) -> Output {
    let mut command = assert_cmd::Command::cargo_bin("splitsnow").unwrap();
    command.env_remove("SLURM_CPUS_PER_TASK");
    command.env("RAYON_NUM_THREADS", "3");
    command.args(args).output().unwrap()
}

fn stdout(args: &[&str]) -> String {
    let output = splitsnow(args);
    assert!(output.status.success(), "{args:?}: {output:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// The commands that `help` lists.
fn commands() -> Vec<String> {
    let help = stdout(&["--help"]);
    let list = help.split("Commands:\n").nth(1).unwrap();
    let lines = list.lines().take_while(|line| !line.is_empty());
    let names = lines.filter_map(|line| line.split_whitespace().next());
    let names = names.filter(|name| *name != "help").map(str::to_owned);
    names.collect()
}

#[test]
fn without_arguments_the_program_says_what_to_try() {
    let story = stdout(&[]);
    assert!(story.contains("splitsnow init"), "{story}");
    assert!(story.contains("splitsnow build configs/quick.toml"));
}

#[test]
fn init_writes_the_examples_and_keeps_what_exists() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().to_str().unwrap();
    stdout(&["init", dir]);
    for name in ["configs", "schema"] {
        let committed = dir_bytes(&Path::new(env!("CARGO_MANIFEST_DIR")).join(name));
        assert_same(&committed, &dir_bytes(&folder.path().join(name)));
    }
    let changed = folder.path().join("configs/quick.toml");
    fs::write(&changed, "mine").unwrap();
    fs::remove_file(folder.path().join("configs/thesis.toml")).unwrap();
    let text = stdout(&["init", dir]);
    assert!(text.starts_with("1 files written"), "{text}");
    assert!(text.contains("kept, differs from the example:"), "{text}");
    assert_eq!(fs::read_to_string(changed).unwrap(), "mine");

    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    let refused = splitsnow(&["init", file.to_str().unwrap()]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("cannot write"));
}

/// The last example in the help of `command`, which may span lines that end in `\`.
fn last_example(command: &str) -> Vec<String> {
    let help = stdout(&[command, "--help"]);
    let help = help.replace("\\\n", " ");
    let mut lines = help.lines().rev();
    let last = lines.find(|line| !line.trim().is_empty()).unwrap();
    let words: Vec<String> = last.split_whitespace().map(str::to_owned).collect();
    assert_eq!(
        words[0], "splitsnow",
        "the help of {command} ends with {last}"
    );
    assert_eq!(words[1], command, "the help of {command} ends with {last}");
    words
}

/// Runs the last example of every command after `init` and `build`, in an empty folder.
#[test]
fn the_last_example_of_every_command_runs() {
    let folder = tempfile::tempdir().unwrap();
    let run = |words: &[String]| {
        let mut line = words.join(" ");
        if line.contains(" serve") {
            // it ends with Ctrl-C, and then without an error
            line = format!("timeout --preserve-status --signal=INT 2 {line}");
        }
        let mut shell = assert_cmd::Command::new("sh");
        shell.current_dir(folder.path()).env("HOME", folder.path());
        let program = cargo_bin!("splitsnow").parent().unwrap().to_owned();
        let path = std::env::var("PATH").unwrap();
        shell.env("PATH", format!("{}:{path}", program.display()));
        let output = shell.args(["-c", &line]).output().unwrap();
        assert!(output.status.success(), "{line}: {output:?}");
    };
    let mut commands = commands();
    let first = ["init", "build"];
    commands.retain(|command| !first.contains(&command.as_str()));
    for command in first.into_iter().chain(commands.iter().map(String::as_str)) {
        if command == "completions" {
            fs::create_dir_all(folder.path().join(".config/fish/completions")).unwrap();
        }
        run(&last_example(command));
    }
}

#[test]
fn completions_list_every_command() {
    let commands = commands();
    assert!(commands.len() >= 13, "{commands:?}");
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = stdout(&["completions", shell]);
        for command in &commands {
            assert!(script.contains(command), "{shell} lacks {command}");
        }
        assert!(script.contains("incidence-angle-deg"), "{shell}");
    }
    let refused = splitsnow(&["completions", "csh"]);
    assert_eq!(refused.status.code(), Some(2));
}

#[test]
fn every_command_has_a_manual_page() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("share/man1");
    stdout(&["man", dir.to_str().unwrap()]);
    let page = |name: &str| fs::read_to_string(dir.join(name)).unwrap();
    assert!(page("splitsnow.1").contains(".SH SYNOPSIS"));
    for command in commands() {
        let text = page(&format!("splitsnow-{command}.1"));
        assert!(
            text.contains(&format!(".TH splitsnow-{command}")),
            "{command}"
        );
        assert!(text.contains("Example"), "{command} has no example");
    }
    let pages = fs::read_dir(&dir).unwrap().count();
    assert_eq!(pages, commands().len() + 1);

    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    let refused = splitsnow(&["man", file.to_str().unwrap()]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("cannot write"));
}

#[test]
fn the_doctor_reports_what_a_bug_report_needs() {
    let json = stdout(&["doctor", "--json", "--python", "no-such-python"]);
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let value = |name: &str| json[name]["value"].as_str().unwrap().to_owned();
    assert!(value("splitsnow").starts_with(env!("CARGO_PKG_VERSION")));
    assert!(value("instruction_set").contains("this processor supports"));
    assert_eq!(
        value("threads"),
        "3, from: environment variable RAYON_NUM_THREADS"
    );
    assert!(value("disk").contains(" free in "), "{json}");
    assert!(value("python").contains("no-such-python"));
    assert!(
        json["python"]["help"]
            .as_str()
            .unwrap()
            .contains("--python")
    );

    let text = stdout(&["doctor", "--python", "no-such-python"]);
    for name in [
        "splitsnow",
        "instruction set",
        "threads",
        "memory",
        "disk",
        "python",
    ] {
        assert!(text.lines().any(|line| line.starts_with(name)), "{text}");
    }
    // no probe file is left behind
    let probes = fs::read_dir(".").unwrap().filter_map(Result::ok);
    let mut probes = probes.filter(|entry| entry.file_name().to_string_lossy().contains("doctor-"));
    assert!(probes.next().is_none());
}

/// A program in the place of Python: what it prints is the version; one that fails or
/// hangs is a finding, not an error.
#[cfg(unix)]
#[test]
fn the_doctor_asks_python() {
    use std::os::unix::fs::PermissionsExt;

    let folder = tempfile::tempdir().unwrap();
    let python = folder.path().join("python");
    let script = "#!/bin/sh\ncase \"$2\" in\n*mitsuba*) echo 'No module named mitsuba' >&2; exit 1;;\n*splitsnow*) echo 0.1.0;;\n*) echo 3.99.0;;\nesac\n";
    fs::write(&python, script).unwrap();
    fs::set_permissions(&python, fs::Permissions::from_mode(0o755)).unwrap();
    let text = stdout(&["doctor", "--python", python.to_str().unwrap()]);
    let line = |name: &str| {
        let mut lines = text.lines();
        lines
            .find(|line| line.starts_with(name))
            .unwrap()
            .to_owned()
    };
    assert!(line("python ").contains("3.99.0"), "{text}");
    assert!(line("python package").contains("0.1.0"), "{text}");
    assert!(
        line("mitsuba").contains("No module named mitsuba"),
        "{text}"
    );
    assert!(text.contains("-> pip install mitsuba"), "{text}");
}
