//! `splitsnow doctor`: what a bug report should say of the program and the machine.
use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde::Serialize;

use super::common;
use crate::atomic;
use crate::simd::Level;
use crate::threads;

/// Longest time that another program may take to answer.
const PATIENCE: Duration = Duration::from_secs(20);

/// Between two looks at a program that has not answered yet.
const POLL: Duration = Duration::from_millis(20);

/// Show version, processor, threads, disk and Python packages for a bug report
///
/// Nothing is changed, and nothing but the lines below leaves this machine: paste them
/// into a bug report.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "\
Examples:
  splitsnow doctor
  splitsnow doctor --json
  splitsnow doctor --python ~/venv/bin/python")]
pub(super) struct Args {
    /// Python interpreter that has the packages [default: python3, else python]
    #[arg(long, value_name = "PATH")]
    python: Option<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// One line of the report.
#[derive(Debug, Serialize)]
struct Finding {
    name: &'static str,
    /// What was found, or why nothing was.
    value: String,
    /// What to do, if something does not work.
    #[serde(skip_serializing_if = "Option::is_none")]
    help: Option<String>,
}

fn finding(name: &'static str, value: impl Into<String>) -> Finding {
    Finding {
        name,
        value: value.into(),
        help: None,
    }
}

pub(super) fn run(args: &Args, level: Level) -> anyhow::Result<()> {
    let mut findings = vec![
        finding("splitsnow", program()),
        finding("instruction set", instruction_set(level)),
        threads_finding(),
        finding("memory", memory().unwrap_or_else(|| "unknown".to_owned())),
        disk(Path::new(".")),
    ];
    findings.extend(python(args.python.as_deref()));
    if args.json {
        let findings = findings.iter();
        let all: serde_json::Map<_, _> = findings
            .map(|finding| (finding.name.replace(' ', "_"), serde_json::json!(finding)))
            .collect();
        return common::print(&format!("{:#}\n", serde_json::Value::from(all)));
    }
    let mut text = String::new();
    for Finding { name, value, help } in findings {
        let _ = writeln!(text, "{name:<16} {value}");
        if let Some(help) = help {
            let _ = writeln!(text, "{:<16} -> {help}", "");
        }
    }
    common::print(&text)
}

/// Version, target and features.
fn program() -> String {
    let features = [
        ("charts", cfg!(feature = "charts")),
        ("netcdf", cfg!(feature = "netcdf")),
        ("npz", cfg!(feature = "npz")),
    ];
    let on: Vec<_> = features
        .into_iter()
        .filter(|(_, on)| *on)
        .map(|(name, _)| name)
        .collect();
    format!(
        "{} for {}-{}, features: {}",
        env!("CARGO_PKG_VERSION"),
        std::env::consts::ARCH,
        std::env::consts::OS,
        if on.is_empty() {
            "none".to_owned()
        } else {
            on.join(", ")
        }
    )
}

fn instruction_set(level: Level) -> String {
    let supported: Vec<_> = Level::supported().map(Level::name).collect();
    format!("{level}; this processor supports {}", supported.join(", "))
}

/// How many threads a command starts, and what says so.
fn threads_finding() -> Finding {
    match threads::threads(None) {
        Ok(count) => {
            let is_set =
                |name: &&&str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
            let source = match threads::VARIABLES.iter().find(is_set) {
                Some(variable) => format!("environment variable {variable}"),
                None => "processors that this process may use".to_owned(),
            };
            finding("threads", format!("{count}, from: {source}"))
        }
        Err(error) => Finding {
            help: Some("unset the variable, or set it to a number of threads".to_owned()),
            ..finding("threads", error.to_string())
        },
    }
}

/// Memory of the machine as Linux tells it.
fn memory() -> Option<String> {
    let text = fs::read_to_string("/proc/meminfo").ok()?;
    let kilobytes = |key: &str| -> Option<u64> {
        let line = text.lines().find_map(|line| line.strip_prefix(key))?;
        line.trim_start_matches(':')
            .split_whitespace()
            .next()?
            .parse()
            .ok()
    };
    let [total, available] = [kilobytes("MemTotal")?, kilobytes("MemAvailable")?];
    Some(format!(
        "{} available of {}",
        common::bytes(1024 * available),
        common::bytes(1024 * total)
    ))
}

/// Free space in `dir`, and whether files can be written there as a build writes them.
fn disk(dir: &Path) -> Finding {
    let place = dir.canonicalize().unwrap_or_else(|_| dir.into());
    let free = fs4::available_space(&place);
    let free = free.map_or_else(
        |error| error.to_string(),
        |bytes| common::bytes(bytes) + " free",
    );
    let probe = place.join(format!(".splitsnow-doctor-{}", std::process::id()));
    let written = atomic::write(&probe, b"probe");
    let _ = fs::remove_file(&probe);
    let (what, help) = match written {
        Ok(()) if atomic::unsynced().is_some() => (
            "; the file system does not sync directories",
            Some("a power loss may undo the last minute of a build; everything else works"),
        ),
        Ok(()) => ("", None),
        Err(_) => (
            "; not writable",
            Some("run in a directory that you may write to, or give build --out DIR"),
        ),
    };
    Finding {
        help: help.map(str::to_owned),
        ..finding("disk", format!("{free} in {}{what}", place.display()))
    }
}

/// Version of Python and of the packages that work with this program.
fn python(asked: Option<&str>) -> Vec<Finding> {
    const VERSION: &str = "import platform; print(platform.python_version())";
    let candidates = asked.map_or_else(|| vec!["python3", "python"], |asked| vec![asked]);
    let mut answers = candidates.iter().map(|name| (*name, answer(name, VERSION)));
    let Some((interpreter, Ok(version))) = answers.find(|(_, answer)| answer.is_ok()) else {
        let missing = format!("none by the name {}", candidates.join(" or "));
        return vec![Finding {
            help: Some(
                "needed for `import splitsnow` and Mitsuba only; --python PATH names another"
                    .to_owned(),
            ),
            ..finding("python", missing)
        }];
    };
    let package = |name: &'static str, import: &str, help: &str| {
        let version =
            format!("import {import} as m; print(getattr(m, '__version__', 'without a version'))");
        match answer(interpreter, &version) {
            Ok(version) => finding(name, version),
            Err(reason) => Finding {
                help: Some(help.to_owned()),
                ..finding(name, reason)
            },
        }
    };
    vec![
        finding("python", format!("{version} ({interpreter})")),
        package("python package", "splitsnow", "pip install splitsnow"),
        package(
            "mitsuba",
            "mitsuba",
            "pip install mitsuba, if you render with it",
        ),
    ]
}

/// The line that `code` prints, or the last line of its error.
fn answer(interpreter: &str, code: &str) -> Result<String, String> {
    let mut child = Command::new(interpreter)
        .args(["-c", code])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| error.to_string())?;
    let start = Instant::now();
    while child
        .try_wait()
        .map_err(|error| error.to_string())?
        .is_none()
    {
        if start.elapsed() > PATIENCE {
            let _ = child.kill();
            let _ = child.wait();
            return Err(format!("no answer within {} s", PATIENCE.as_secs()));
        }
        std::thread::sleep(POLL);
    }
    let output = child
        .wait_with_output()
        .map_err(|error| error.to_string())?;
    let text = match output.status.success() {
        true => &output.stdout,
        false => &output.stderr,
    };
    let last = String::from_utf8_lossy(text);
    let last = last.trim().lines().last().unwrap_or("no answer").to_owned();
    if output.status.success() {
        Ok(last)
    } else {
        Err(last)
    }
}
