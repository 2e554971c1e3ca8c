//! The command line: one file per command, with its arguments and its `run`.
//!
//! Results go to standard output, all else to standard error. Exit codes: 0
//! when everything asked for is done, 1 with one line `error: ...`, 2 for a
//! wrong command line, 130 when interrupted.
mod against;
mod bar;
mod build;
mod common;
mod compact;
mod compress;
mod export;
mod goniometer;
mod plan;
mod point;
mod query;
mod simulate;
#[cfg(feature = "charts")]
mod study;
mod tailor;
#[cfg(feature = "charts")]
mod tradeoff;
mod verify;
mod walking;

use std::ffi::{OsStr, OsString};
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::atomic;

/// Generates and compresses spectral databases of snow
///
/// A first-principles Monte Carlo model walks light from grain to grain. A grid
/// of snow parameters becomes a database of reflectance and transmittance
/// spectra with their standard errors, and one small file that renderers and
/// retrievals evaluate.
#[derive(Debug, Parser)]
#[command(name = "splitsnow", version, after_help = STORY)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const STORY: &str = "\
A typical sequence:
  splitsnow plan configs/quick.toml     what it will take: jobs, time, bytes, errors
  splitsnow build configs/quick.toml    the database, the compact file, the error table
  splitsnow query out/quick --facetness 0.1 --grain-size-um 100 \\
      --density-kg-m3 200 --thickness-cm 1 --incidence-angle-deg 0
                                        one spectrum of it, as CSV

`build` may be interrupted or killed at any time: the same command goes on where
it stopped, and the result is the same to the byte.

`splitsnow help COMMAND` has the details and examples; README.md and the folder
docs/ explain the model, the config files and the file formats.";

#[derive(Debug, Subcommand)]
enum Command {
    Plan(plan::Args),
    Build(build::Args),
    Compress(compress::Args),
    Verify(verify::Args),
    #[command(alias = "fit")]
    Tailor(tailor::Args),
    Query(query::Args),
    Export(export::Args),
    #[command(alias = "measure")]
    Simulate(simulate::Args),
    #[cfg(feature = "charts")]
    Tradeoff(tradeoff::Args),
    #[cfg(feature = "charts")]
    Study(study::Args),
}

/// `words` with every number below zero joined to the option in front of it:
/// `--incidence-angle-deg -1e-16` is `--incidence-angle-deg=-1e-16`, and no option of its own.
fn joined(words: impl Iterator<Item = OsString>) -> Vec<OsString> {
    let mut all: Vec<OsString> = Vec::new();
    for word in words {
        let text = word.to_str().unwrap_or_default();
        let is_number = text.starts_with('-') && text.parse::<f64>().is_ok();
        match all.last_mut() {
            Some(option) if is_number && is_open(option) => {
                option.push("=");
                option.push(&word);
            }
            _ => all.push(word),
        }
    }
    all
}

/// Whether a word is a long option without its value.
fn is_open(word: &OsStr) -> bool {
    let text = word.to_str().unwrap_or_default();
    text.len() > 2 && text.starts_with("--") && !text.contains('=')
}

/// Runs the command that the arguments of this process ask for.
#[must_use]
pub fn run() -> ExitCode {
    let cli = Cli::parse_from(joined(std::env::args_os()));
    let done = match cli.command {
        Command::Plan(args) => plan::run(&args),
        Command::Build(args) => build::run(&args),
        Command::Compress(args) => compress::run(&args),
        Command::Verify(args) => verify::run(&args),
        Command::Tailor(args) => tailor::run(&args),
        Command::Query(args) => query::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        #[cfg(feature = "charts")]
        Command::Tradeoff(args) => tradeoff::run(&args),
        #[cfg(feature = "charts")]
        Command::Study(args) => study::run(&args),
    };
    if let Some((directory, error)) = atomic::unsynced() {
        common::warn(&[format!(
            "{} cannot be synced to the disk ({error}); what was written there is in place, but a power loss in the next minute may undo it",
            directory.display()
        )]);
    }
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if error.is::<common::Interrupted>() => {
            common::note(&error.to_string());
            ExitCode::from(130)
        }
        Err(error) => {
            common::note(&format!("error: {}", common::message(&error)));
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn the_arguments_are_consistent() {
        super::Cli::command().debug_assert();
    }

    #[test]
    fn numbers_below_zero_belong_to_the_option_before() {
        let joined = |line: &str| {
            let words = super::joined(line.split(' ').map(Into::into)).into_iter();
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
