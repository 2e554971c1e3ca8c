//! `splitsnow man`: manual pages.
use std::path::PathBuf;

use super::common;

/// Write the manual pages into a directory
///
/// Writes splitsnow.1 and one page per command, such as splitsnow-build.1. The directory
/// is created if it does not exist.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "\
Examples:
  splitsnow man ~/.local/share/man/man1")]
pub(super) struct Args {
    /// Directory of the pages
    #[arg(value_name = "DIR")]
    dir: PathBuf,
}

pub(super) fn run(args: &Args, command: clap::Command) -> anyhow::Result<()> {
    let cannot_write = |error: std::io::Error| common::cannot_write(&args.dir, error);
    std::fs::create_dir_all(&args.dir).map_err(cannot_write)?;
    clap_mangen::generate_to(command, &args.dir).map_err(cannot_write)?;
    common::print(&format!("manual pages written to {}\n", args.dir.display()))
}
