//! What the commands share.
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Context, bail};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use indicatif::ProgressBar;
use serde::Serialize;
use thiserror::Error;

use crate::config::grid::{self, GridFile};
use crate::engine::Engine;
use crate::store::DIFFUSE;
use crate::threads::{self, ThreadsError};

/// The arguments of commands that work from a grid file.
#[derive(Debug, clap::Args)]
pub(super) struct GridArgs {
    /// Grid file, such as configs/quick.toml
    #[arg(value_name = "GRID.toml")]
    grid: PathBuf,
    /// Output directory [default: out/<name of the grid file>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Engine, instead of the grid file's
    #[arg(long, value_parser = engine_parser())]
    engine: Option<Engine>,
    #[command(flatten)]
    threads: ThreadArgs,
}

/// How many threads to run on.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(super) struct ThreadArgs {
    /// Threads [default: SLURM_CPUS_PER_TASK, else RAYON_NUM_THREADS, else what this process may use]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(threads::MAX_THREADS)))]
    threads: Option<u16>,
}

impl ThreadArgs {
    pub(super) fn count(self) -> Result<usize, ThreadsError> {
        threads::threads(self.threads)
    }
}

impl GridArgs {
    /// Reads the grid file; its warnings go to standard error.
    pub(super) fn open(&self) -> anyhow::Result<GridFile> {
        let mut file = grid::read(&self.grid)?;
        if let Some(engine) = self.engine {
            file.grid.run.engine = engine;
        }
        warn(&file.warnings);
        notes(&file.notes);
        Ok(file)
    }

    /// The grid file.
    pub(super) fn path(&self) -> &Path {
        &self.grid
    }

    /// Where the database of `file` is or will be.
    pub(super) fn dir(&self, file: &GridFile) -> PathBuf {
        let default = || Path::new("out").join(&file.name);
        self.out.clone().unwrap_or_else(default)
    }

    /// The line that starts `command` with the arguments that name the database.
    pub(super) fn command(&self, command: &str) -> String {
        let mut line = format!("splitsnow {command} {}", self.grid.display());
        if let Some(out) = &self.out {
            line += &format!(" --out {}", out.display());
        }
        if let Some(engine) = self.engine {
            line += &format!(" --engine {}", engine.name());
        }
        line
    }

    pub(super) fn threads(&self) -> Result<usize, ThreadsError> {
        self.threads.count()
    }
}

/// Engines by name.
pub(super) fn engine_parser() -> impl TypedValueParser<Value = Engine> {
    let shown = Engine::ALL.map(|engine| PossibleValue::new(engine.name()));
    let hidden = Engine::ALIASES.map(|(name, _)| PossibleValue::new(name).hide(true));
    PossibleValuesParser::new(shown.into_iter().chain(hidden))
        .try_map(|text| Engine::named(&text).ok_or_else(|| format!("nothing is named {text}")))
}

/// One of `all` by its name.
pub(super) fn named<T, const N: usize>(
    all: [T; N],
    name: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync + 'static,
{
    PossibleValuesParser::new(all.map(name)).try_map(move |text| {
        let found = all.into_iter().find(|&value| name(value) == text);
        found.ok_or_else(|| format!("nothing is named {text}"))
    })
}

/// A finite number above 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("it must be a number above 0".into()),
    }
}

/// The compact file of isotropic light in the directory `path`.
pub(super) fn diffuse_path(path: &Path) -> anyhow::Result<PathBuf> {
    let file = if path.is_file() {
        path.to_path_buf()
    } else {
        path.join(DIFFUSE)
    };
    if !file.exists() {
        bail!(
            "no {DIFFUSE} in {}; `splitsnow build` makes it of a grid with axes.diffuse = true",
            path.display()
        );
    }
    Ok(file)
}

/// A run that was stopped by the user. What is said after "interrupted: ":
/// what is safe, and how to go on.
#[derive(Debug, Error)]
#[error("interrupted: {0}")]
pub(super) struct Interrupted(pub(super) String);

/// A flag that the first Ctrl-C (or SIGTERM) sets; the second one ends the
/// process at once. To be called once.
pub(super) fn interrupt_flag() -> anyhow::Result<&'static AtomicBool> {
    static FLAG: AtomicBool = AtomicBool::new(false);
    ctrlc::set_handler(|| {
        if FLAG.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
        note("\nstopping (Ctrl-C again stops at once)");
    })
    .context("cannot listen for Ctrl-C")?;
    Ok(&FLAG)
}

/// Writes `text` to standard output. A reader that has seen enough, such as
/// `head`, is no failure.
pub(super) fn print(text: &str) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        done => done.context("cannot write to standard output"),
    }
}

/// Writes `value` to standard output as JSON.
pub(super) fn print_json(value: &impl Serialize) -> anyhow::Result<()> {
    print(&(serde_json::to_string_pretty(value)? + "\n"))
}

/// A path in a comment, which is one line whatever the file is called.
pub(super) fn one_line(path: &Path) -> String {
    path.display().to_string().replace(['\n', '\r'], " ")
}

/// Writes a line to standard error, where nobody may be listening.
pub(super) fn note(line: &str) {
    let _ = writeln!(io::stderr(), "{line}");
}

/// Writes lines to standard error.
pub(super) fn notes(lines: &[String]) {
    lines.iter().for_each(|line| note(line));
}

/// Writes warnings to standard error.
pub(super) fn warn(warnings: &[String]) {
    for warning in warnings {
        note(&format!("warning: {warning}"));
    }
}

/// The error and those of its causes that it does not already quote.
pub(super) fn message(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

/// A sign of life on standard error, if that is a terminal, until dropped.
#[derive(Debug)]
pub(super) struct Spinner(ProgressBar);

impl Spinner {
    pub(super) fn new(what: &'static str) -> Self {
        // Draws to standard error.
        let bar = ProgressBar::new_spinner();
        bar.set_message(what);
        bar.enable_steady_tick(Duration::from_millis(200));
        Self(bar)
    }

    /// Changes what it says.
    pub(super) fn say(&self, what: &str) {
        self.0.set_message(what.to_owned());
    }
}

impl Drop for Spinner {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// Bytes for people.
pub(super) fn bytes(count: u64) -> String {
    let scaled = count as f64;
    match count {
        0..1_000 => format!("{count} bytes"),
        1_000..1_000_000 => format!("{:.1} kB", scaled * 1e-3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", scaled * 1e-6),
        _ => format!("{:.1} GB", scaled * 1e-9),
    }
}

/// A duration for people.
pub(super) fn duration(seconds: f64) -> String {
    match seconds {
        ..10.0 => format!("{seconds:.1} s"),
        ..120.0 => format!("{seconds:.0} s"),
        ..7200.0 => format!("{:.0} min", seconds / 60.0),
        ..172_800.0 => format!("{:.1} h", seconds / 3600.0),
        _ => format!("{:.1} days", seconds / 86_400.0),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn numbers_for_people() {
        assert_eq!(
            [999, 1_000, 25_300, 1_300_000, 8_000_000_000].map(bytes),
            ["999 bytes", "1.0 kB", "25.3 kB", "1.3 MB", "8.0 GB"]
        );
        assert_eq!(
            [0.04, 9.0, 100.0, 3600.0, 40_000.0, 1e6].map(duration),
            ["0.0 s", "9.0 s", "100 s", "60 min", "11.1 h", "11.6 days"]
        );
    }

    #[test]
    fn bounds_are_positive_numbers() {
        assert_eq!(positive("2.3"), Ok(2.3));
        for wrong in ["0", "-1", "nan", "inf", "x", ""] {
            assert!(positive(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn causes_are_told_once() {
        let cause = io::Error::other("disk on fire");
        let error = anyhow::Error::new(cause).context("cannot write x");
        assert_eq!(message(&error), "cannot write x: disk on fire");
        let error = error.context("no luck: cannot write x: disk on fire");
        assert_eq!(message(&error), "no luck: cannot write x: disk on fire");
    }
}
