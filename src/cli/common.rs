//! Arguments, output and formatting shared by the commands.
use std::fmt::Display;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow, bail};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use indicatif::ProgressBar;
use serde::Serialize;
use thiserror::Error;

use crate::atomic;
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
    /// Output directory [default: out/NAME, where NAME is the name of the grid file]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Simulate with this engine instead of the grid file's
    #[arg(long, value_parser = engine_parser())]
    engine: Option<Engine>,
    #[command(flatten)]
    threads: ThreadArgs,
}

/// The number of threads to run on.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(super) struct ThreadArgs {
    /// Number of threads [default: SLURM_CPUS_PER_TASK, else RAYON_NUM_THREADS, else the
    /// processors available to this process]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(threads::MAX_THREADS)))]
    threads: Option<u16>,
}

impl ThreadArgs {
    /// The number of threads, from the option or the environment.
    pub(super) fn count(self) -> Result<usize, ThreadsError> {
        threads::threads(self.threads)
    }
}

impl GridArgs {
    /// Reads the grid file and prints its warnings and notes to standard error.
    pub(super) fn open(&self) -> anyhow::Result<GridFile> {
        let mut file = grid::read(&self.grid)?;
        if let Some(engine) = self.engine {
            file.grid.run.engine = engine;
        }
        warn(&file.warnings);
        notes(&file.notes);
        Ok(file)
    }

    /// The path of the grid file.
    pub(super) fn path(&self) -> &Path {
        &self.grid
    }

    /// The output directory of the database of `file`, which need not exist yet.
    pub(super) fn dir(&self, file: &GridFile) -> PathBuf {
        let default = || Path::new("out").join(&file.name);
        self.out.clone().unwrap_or_else(default)
    }

    /// The command line that runs `command` on this grid file, output directory and engine.
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

    /// The number of threads, from the option or the environment.
    pub(super) fn threads(&self) -> Result<usize, ThreadsError> {
        self.threads.count()
    }
}

/// Parses the name of an engine; aliases are accepted but not listed.
pub(super) fn engine_parser() -> impl TypedValueParser<Value = Engine> {
    let shown = Engine::ALL.map(|engine| PossibleValue::new(engine.name()));
    let hidden = Engine::ALIASES.map(|(name, _)| PossibleValue::new(name).hide(true));
    PossibleValuesParser::new(shown.into_iter().chain(hidden))
        .try_map(|text| Engine::named(&text).ok_or_else(|| format!("there is no engine {text}")))
}

/// Parses one of `values` by its `name`.
pub(super) fn name_parser<T, const N: usize>(
    values: [T; N],
    name: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync + 'static,
{
    PossibleValuesParser::new(values.map(name)).try_map(move |text| {
        let matching = values.into_iter().find(|&value| name(value) == text);
        matching.ok_or_else(|| format!("there is no value {text}"))
    })
}

/// Parses a finite number above 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("the value must be a finite number above 0".into()),
    }
}

/// The path of the compact file for isotropic light: `path` itself or the file in that directory.
///
/// # Errors
/// If the file does not exist.
pub(super) fn diffuse_path(path: &Path) -> anyhow::Result<PathBuf> {
    let file = if path.is_file() {
        path.to_path_buf()
    } else {
        path.join(DIFFUSE)
    };
    if !file.exists() {
        bail!(
            "no {DIFFUSE} in {}; run `splitsnow build` on a grid file with axes.diffuse = true",
            path.display()
        );
    }
    Ok(file)
}

/// A run that was stopped. Holds the text after "interrupted: ": the work that is safe, and how
/// to resume.
#[derive(Debug, Error)]
#[error("interrupted: {0}")]
pub(super) struct Interrupted(pub(super) String);

/// Exit code after Ctrl-C.
const EXIT_INTERRUPTED: u8 = 130;
/// Exit code after SIGTERM, SIGUSR1 and `--stop-after`: try again later (`EX_TEMPFAIL`).
const EXIT_STOPPED: u8 = 75;

/// The flags that stop a run: set by any request, and set by those that end with
/// [`EXIT_STOPPED`].
static FLAGS: LazyLock<[Arc<AtomicBool>; 2]> = LazyLock::new(Default::default);

/// Time within which repeated signals are one request: `timeout` and batch systems send theirs to
/// the process and to its group, so it arrives twice.
const SAME_REQUEST: Duration = Duration::from_millis(500);

/// The flag that stops a run. The first Ctrl-C sets it, and the second ends the process at once
/// unless it comes within [`SAME_REQUEST`]. So do SIGTERM and, on Unix, SIGUSR1, which batch systems send before a time limit. Call this
/// function only once per process.
pub(super) fn interrupt_flag() -> anyhow::Result<&'static AtomicBool> {
    let [flag, _] = &*FLAGS;
    let mut first = None;
    ctrlc::set_handler(move || {
        let [flag, _] = &*FLAGS;
        flag.store(true, Ordering::Relaxed);
        match first {
            None => {
                first = Some(Instant::now());
                note("\nstopping (Ctrl-C again stops at once)");
            }
            Some(first) if first.elapsed() < SAME_REQUEST => {}
            Some(_) => std::process::exit(exit_code().into()),
        }
    })
    .context("cannot listen for Ctrl-C")?;
    #[cfg(unix)]
    listen_for_batch_systems().context("cannot listen for SIGUSR1")?;
    Ok(flag)
}

/// SIGTERM, which the handler of Ctrl-C has too, and SIGUSR1 set the flags.
#[cfg(unix)]
fn listen_for_batch_systems() -> io::Result<()> {
    use signal_hook::consts::{SIGTERM, SIGUSR1};
    let [flag, stopped] = &*FLAGS;
    signal_hook::flag::register(SIGTERM, Arc::clone(stopped))?;
    signal_hook::flag::register(SIGUSR1, Arc::clone(stopped))?;
    signal_hook::flag::register(SIGUSR1, Arc::clone(flag))?;
    Ok(())
}

/// Stops the run after `time`.
pub(super) fn stop_after(time: Duration) {
    std::thread::spawn(move || {
        std::thread::sleep(time);
        let [flag, stopped] = &*FLAGS;
        stopped.store(true, Ordering::Relaxed);
        flag.store(true, Ordering::Relaxed);
    });
}

/// Exit code of a run that was stopped.
pub(super) fn exit_code() -> u8 {
    let [_, stopped] = &*FLAGS;
    match stopped.load(Ordering::Relaxed) {
        true => EXIT_STOPPED,
        false => EXIT_INTERRUPTED,
    }
}

/// Parses a time limit: a number with the unit s, m or h; without a unit, seconds.
pub(super) fn time_limit(text: &str) -> Result<Duration, String> {
    let (number, unit) = match text.chars().last() {
        Some('s') => (&text[..text.len() - 1], 1.0),
        Some('m') => (&text[..text.len() - 1], 60.0),
        Some('h') => (&text[..text.len() - 1], 3600.0),
        _ => (text, 1.0),
    };
    let seconds = number.parse::<f64>().ok().map(|number| number * unit);
    let seconds = seconds.filter(|seconds| *seconds > 0.0 && *seconds <= 1e9);
    seconds
        .map(Duration::from_secs_f64)
        .ok_or_else(|| "the time must be a number above 0 with a unit: 90s, 50m or 2h".into())
}

/// Writes `text` to standard output. A closed pipe (a reader such as `head` that stopped
/// reading) is not an error.
pub(super) fn print(text: &str) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        result => result.map_err(|error| {
            anyhow!("cannot write to standard output: {error}; check where it is redirected to")
        }),
    }
}

/// The error of writing to `path`.
pub(super) fn cannot_write(path: &Path, error: impl Display) -> anyhow::Error {
    anyhow!(
        "cannot write {}: {error}; check the path, its permissions and its disk, or choose another",
        path.display()
    )
}

/// Checks that a file can be written at `path`, before the work whose result goes there.
pub(super) fn check_output(path: &Path) -> anyhow::Result<()> {
    atomic::check(path).map_err(|error| cannot_write(path, error))
}

/// Checks that the directory `dir` exists or can be made, and that a file can be written in it.
pub(super) fn check_output_dir(dir: &Path) -> anyhow::Result<()> {
    let mut existing = dir.ancestors().filter(|path| path.exists());
    let existing = existing.next().unwrap_or(Path::new("."));
    if !existing.is_dir() {
        return Err(cannot_write(
            dir,
            format!("{} is a file", existing.display()),
        ));
    }
    atomic::check(&existing.join("splitsnow")).map_err(|error| cannot_write(dir, error))
}

/// Writes `value` to standard output as JSON.
pub(super) fn print_json(value: &impl Serialize) -> anyhow::Result<()> {
    print(&(serde_json::to_string_pretty(value)? + "\n"))
}

/// `path` as text on one line, for comments and notes.
pub(super) fn one_line(path: &Path) -> String {
    path.display().to_string().replace(['\n', '\r'], " ")
}

/// Writes a line to standard error; a failure to write is ignored.
pub(super) fn note(line: &str) {
    let _ = writeln!(io::stderr(), "{line}");
}

/// Writes lines to standard error; see [`note`].
pub(super) fn notes(lines: &[String]) {
    lines.iter().for_each(|line| note(line));
}

/// Writes lines to standard error, each with the prefix `warning: `.
pub(super) fn warn(warnings: &[String]) {
    for warning in warnings {
        note(&format!("warning: {warning}"));
    }
}

/// The text of an error, followed by the causes that the text does not already contain.
pub(super) fn message(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

/// A spinner on standard error that shows progress until it is dropped. Hidden if
/// standard error is not a terminal.
#[derive(Debug)]
pub(super) struct Spinner(ProgressBar);

impl Spinner {
    pub(super) fn new(activity: &'static str) -> Self {
        // Draws to standard error.
        let bar = ProgressBar::new_spinner();
        bar.set_message(activity);
        bar.enable_steady_tick(Duration::from_millis(200));
        Self(bar)
    }

    /// Changes the text shown.
    pub(super) fn say(&self, activity: &str) {
        self.0.set_message(activity.to_owned());
    }
}

impl Drop for Spinner {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// A number of bytes, formatted with a unit.
pub(super) fn bytes(count: u64) -> String {
    let scaled = count as f64;
    match count {
        0..1_000 => format!("{count} bytes"),
        1_000..1_000_000 => format!("{:.1} kB", scaled * 1e-3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", scaled * 1e-6),
        _ => format!("{:.1} GB", scaled * 1e-9),
    }
}

/// A duration in seconds, formatted with a unit.
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
    fn time_limits_have_units() {
        let seconds = |text| time_limit(text).map(|time| time.as_secs_f64());
        for (text, expected) in [("50m", 3000.0), ("1.5h", 5400.0), ("90s", 90.0), ("7", 7.0)] {
            assert_eq!(seconds(text), Ok(expected));
        }
        for wrong in ["", "m", "0s", "-1m", "nanh", "infs", "1d", "1e9h"] {
            assert!(seconds(wrong).is_err(), "{wrong}");
        }
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
