//! The command line: one file per command, with its arguments and its `run`.
//!
//! Results go to standard output, all else to standard error. Exit codes: 0
//! when everything asked for is done, 1 with one line `error: ...`, 2 for a
//! wrong command line, 130 when interrupted.
mod against;
mod build;
mod common;
mod compact;
mod compress;
mod export;
mod fit;
mod goniometer;
mod measure;
mod pilot;
mod plan;
mod point;
mod query;
mod simulate;
mod study;
mod tradeoff;
mod verify;

use std::any::TypeId;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

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
      --density-kg-m3 200 --thickness-cm 1 --angle-deg 0
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
    Fit(fit::Args),
    Query(query::Args),
    Export(export::Args),
    Measure(measure::Args),
    Tradeoff(tradeoff::Args),
    Study(study::Args),
}

/// The command line, in which every number may be negative in any notation: clap's
/// `allow_negative_numbers` takes `-1`, but `-1e-16` for an option.
fn command() -> clap::Command {
    let number = |arg: clap::Arg| {
        let is_number = arg.get_value_parser().type_id() == TypeId::of::<f64>();
        if is_number {
            arg.allow_hyphen_values(true)
        } else {
            arg
        }
    };
    Cli::command().mut_subcommands(|command| command.mut_args(number))
}

/// Runs the command that the arguments of this process ask for.
#[must_use]
pub fn run() -> ExitCode {
    let parsed = Cli::from_arg_matches(&command().get_matches());
    let cli = parsed.unwrap_or_else(|error| error.format(&mut command()).exit());
    let done = match cli.command {
        Command::Plan(args) => plan::run(&args),
        Command::Build(args) => build::run(&args),
        Command::Compress(args) => compress::run(&args),
        Command::Verify(args) => verify::run(&args),
        Command::Fit(args) => fit::run(&args),
        Command::Query(args) => query::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Measure(args) => measure::run(&args),
        Command::Tradeoff(args) => tradeoff::run(&args),
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
    #[test]
    fn the_arguments_are_consistent() {
        super::command().debug_assert();
    }
}
