//! The command line.
mod measure;
mod simulate;
mod verify;

use clap::Parser;

#[derive(Debug, Parser)]
#[command(name = "splitsnow", version)]
enum Command {
    Measure(measure::Args),
    Verify(verify::Args),
}

/// Runs the command line.
///
/// # Errors
/// What to tell the user.
pub fn run() -> anyhow::Result<()> {
    match Command::parse() {
        Command::Measure(args) => measure::run(args),
        Command::Verify(args) => verify::run(args),
    }
}
