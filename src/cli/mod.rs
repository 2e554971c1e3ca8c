//! The command line: one file per command, with its arguments and its `run` function.
//!
//! Results go to standard output; warnings, notes and progress go to standard error.
//! Exit codes: 0 on success, 1 after an error (one line `error: ...`), 2 for a wrong
//! command line, 130 after an interruption.
mod against;
mod bands;
mod bar;
mod build;
mod common;
mod compact;
mod completions;
mod compress;
mod doctor;
mod export;
mod goniometer;
mod init;
#[cfg(feature = "exr")]
mod lut;
mod man;
mod plan;
mod point;
mod profile;
mod query;
mod retrieve;
#[cfg(feature = "serve")]
mod serve;
mod shard;
mod simulate;
mod spectra;
mod status;
#[cfg(feature = "charts")]
mod study;
mod submit;
mod tailor;
#[cfg(feature = "charts")]
mod tradeoff;
mod verify;
mod views;
mod walking;

use std::ffi::{OsStr, OsString};
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use crate::atomic;
use crate::simd;

/// Generate and compress spectral databases of snow
///
/// A first-principles Monte Carlo model traces light from ice grain to ice grain.
/// SPLITSnow simulates a grid of snow parameters and stores a database of reflectance
/// and transmittance spectra with their standard errors. It compresses the database to
/// one small file that renderers and retrievals evaluate.
#[derive(Debug, Parser)]
#[command(name = "splitsnow", version, after_help = TYPICAL_SEQUENCE)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

/// What `splitsnow` prints without arguments.
const STORY: &str = concat!(
    "splitsnow ",
    env!("CARGO_PKG_VERSION"),
    ": spectral databases of snow

A grid file lists snows: facetness, grain size, density, thickness, incidence angle.
`build` traces light from ice grain to ice grain through each of them, and stores the
spectra that come back and that come through. It then compresses all spectra to one
file of a few kilobytes, which renderers evaluate anywhere between the grid's values.

Try it; this takes less than a minute:
  splitsnow init                        write example configs to ./configs
  splitsnow build configs/quick.toml    simulate and compress 216 spectra

`splitsnow --help` lists all commands.
"
);

const TYPICAL_SEQUENCE: &str = "\
A typical sequence:
  splitsnow init                        write example configs to ./configs
  splitsnow plan configs/quick.toml     estimate the jobs, time, bytes and errors
  splitsnow build configs/quick.toml    make the database, the compact file, the error table
  splitsnow query out/quick --facetness 0.1 --grain-size-um 100 \\
      --density-kg-m3 200 --thickness-cm 1 --incidence-angle-deg 0
                                        print one spectrum as CSV

`build` may be interrupted or killed at any time. The same command then resumes, and
the result is identical to the byte.

`splitsnow help COMMAND` gives details and examples. README.md and the folder docs/
explain the model, the config files and the file formats.";

#[derive(Debug, Subcommand)]
enum Command {
    Init(init::Args),
    Plan(plan::Args),
    Build(build::Args),
    Status(status::Args),
    Submit(submit::Args),
    Compress(compress::Args),
    Verify(verify::Args),
    #[command(alias = "fit")]
    Tailor(tailor::Args),
    Query(query::Args),
    Export(export::Args),
    #[command(alias = "measure")]
    Simulate(simulate::Args),
    Retrieve(retrieve::Args),
    #[cfg(feature = "serve")]
    Serve(serve::Args),
    #[cfg(feature = "charts")]
    Tradeoff(tradeoff::Args),
    #[cfg(feature = "charts")]
    Study(study::Args),
    Doctor(doctor::Args),
    Completions(completions::Args),
    Man(man::Args),
}

/// Joins every negative number in `words` to the option before it, so that clap does not
/// read the number as an option: `--incidence-angle-deg -1e-16` becomes
/// `--incidence-angle-deg=-1e-16`.
fn join_negative_numbers(words: impl Iterator<Item = OsString>) -> Vec<OsString> {
    let mut joined: Vec<OsString> = Vec::new();
    for word in words {
        let text = word.to_str().unwrap_or_default();
        let is_number = text.starts_with('-') && text.parse::<f64>().is_ok();
        match joined.last_mut() {
            Some(option) if is_number && lacks_value(option) => {
                option.push("=");
                option.push(&word);
            }
            _ => joined.push(word),
        }
    }
    joined
}

/// Whether `word` is a long option without `=VALUE`.
fn lacks_value(word: &OsStr) -> bool {
    let text = word.to_str().unwrap_or_default();
    text.len() > 2 && text.starts_with("--") && !text.contains('=')
}

/// Whether the arguments ask for the long form of the version: `--version -v`, `-V -v`,
/// `-vV` and the like. The first of `words` is the name of the program.
fn asks_for_long_version(words: &[OsString]) -> bool {
    let mut asked = [false; 2];
    for word in words.iter().skip(1) {
        let found = match word.to_str() {
            Some("-V" | "--version") => [true, false],
            Some("-v" | "--verbose") => [false, true],
            Some("-vV" | "-Vv") => [true; 2],
            _ => return false,
        };
        asked = [asked[0] || found[0], asked[1] || found[1]];
    }
    asked == [true; 2]
}

/// The version, the target and the instruction sets.
fn long_version(level: simd::Level) -> String {
    let supported: Vec<_> = simd::Level::supported().map(simd::Level::name).collect();
    format!(
        "splitsnow {}\ntarget: {}-{}\ninstruction set: {level}\nsupported here: {}\n",
        env!("CARGO_PKG_VERSION"),
        std::env::consts::ARCH,
        std::env::consts::OS,
        supported.join(", ")
    )
}

/// Parses the arguments of this process and runs the command.
#[must_use]
pub fn run() -> ExitCode {
    let words = join_negative_numbers(std::env::args_os());
    let is_long_version = asks_for_long_version(&words);
    let command = if is_long_version {
        None
    } else {
        Cli::parse_from(words).command
    };
    let level = match simd::requested() {
        Ok(level) => level,
        Err(error) => {
            common::note(&format!("error: {error}"));
            return ExitCode::FAILURE;
        }
    };
    let result = match command {
        None if is_long_version => common::print(&long_version(level)),
        None => common::print(STORY),
        Some(command) => run_command(command, level),
    };
    if let Some((directory, error)) = atomic::unsynced() {
        common::warn(&[format!(
            "{} cannot be synced to the disk ({error}); the files are in place, but a power loss in the next minute may undo the last writes",
            directory.display()
        )]);
    }
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if error.is::<common::Interrupted>() => {
            common::note(&error.to_string());
            ExitCode::from(common::exit_code())
        }
        Err(error) => {
            common::note(&format!("error: {}", common::message(&error)));
            ExitCode::FAILURE
        }
    }
}

fn run_command(command: Command, level: simd::Level) -> anyhow::Result<()> {
    match command {
        Command::Init(args) => init::run(&args),
        Command::Plan(args) => plan::run(&args),
        Command::Build(args) => build::run(&args),
        Command::Status(args) => status::run(&args),
        Command::Submit(args) => submit::run(&args),
        Command::Compress(args) => compress::run(&args),
        Command::Verify(args) => verify::run(&args),
        Command::Tailor(args) => tailor::run(&args),
        Command::Query(args) => query::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Retrieve(args) => retrieve::run(&args),
        #[cfg(feature = "serve")]
        Command::Serve(args) => serve::run(&args),
        #[cfg(feature = "charts")]
        Command::Tradeoff(args) => tradeoff::run(&args),
        #[cfg(feature = "charts")]
        Command::Study(args) => study::run(&args),
        Command::Doctor(args) => doctor::run(&args, level),
        Command::Completions(args) => completions::run(&args, Cli::command()),
        Command::Man(args) => man::run(&args, Cli::command()),
    }
}

#[cfg(test)]
mod tests {
    use super::CommandFactory;

    #[test]
    fn the_arguments_are_consistent() {
        super::Cli::command().debug_assert();
    }

    #[test]
    fn numbers_below_zero_belong_to_the_option_before() {
        let joined = |line: &str| {
            let words = super::join_negative_numbers(line.split(' ').map(Into::into)).into_iter();
            let words: Vec<_> = words.filter_map(|word| word.into_string().ok()).collect();
            words.join(" ")
        };
        for (line, expected) in [
            (
                "q --incidence-angle-deg -1e-16 --json",
                "q --incidence-angle-deg=-1e-16 --json",
            ),
            ("q --temperature-c -5", "q --temperature-c=-5"),
            (
                "q --incidence-angle-deg 1e-16",
                "q --incidence-angle-deg 1e-16",
            ),
            (
                "q --incidence-angle-deg --quantity r",
                "q --incidence-angle-deg --quantity r",
            ),
            ("q --a=-1 -2", "q --a=-1 -2"),
            ("q -5", "q -5"),
        ] {
            assert_eq!(joined(line), expected);
        }
    }
}
