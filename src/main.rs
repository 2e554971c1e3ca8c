//! The program `splitsnow`.
use std::process::ExitCode;

fn main() -> ExitCode {
    splitsnow::cli::run()
}
