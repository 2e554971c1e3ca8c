//! The `splitsnow` command.
use std::process::ExitCode;

fn main() -> ExitCode {
    splitsnow::cli::run()
}
