//! `verify`: re-checks a finished database.
use std::path::PathBuf;

use serde_json::json;

use super::common::{self, Interrupted};
use super::simulate;
use crate::verify::{Options, Verification, VerifyError};

/// Check a finished database anew: files, compact file, fresh simulations
///
/// Checks that every job is whole; that the compact file was made from this
/// database and rebuilds its curves within the bounds it states; that fresh
/// simulations at random nodes agree with what is stored; and that spectra
/// simulated off the nodes are expressed by the compact file's bases within
/// those bounds. Exits with 1 if anything fails; a database that is right fails
/// by chance about twice in a million runs.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Output directory of `build`
    dir: PathBuf,
    /// Fresh simulations on the nodes, and as many off them; 0 checks files only
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u64).range(..=1_000_000))]
    samples: u64,
    /// Chooses points and random numbers of the fresh simulations
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Rays of a fresh simulation [default: as many as the database's]
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    rays: Option<u64>,
    /// Threads; 0 is one per core
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let cancel = common::interrupt_flag()?;
    let options = Options {
        samples: args.samples as usize,
        seed: args.seed,
        rays: args.rays,
    };
    let verification = Verification::open(&args.dir, options)?;
    let walks = verification.walks()?;
    let result = simulate::run(args.threads, walks, cancel, |control| {
        verification.run(control)
    })?;
    let report = match result {
        Err(VerifyError::Cancelled) => return Err(Interrupted("nothing was written".into()).into()),
        result => result?,
    };
    common::print(&if args.json {
        let value = json!({ "passed": report.passed(), "checks": report.checks });
        format!("{value:#}\n")
    } else {
        format!("{report}\n")
    })?;
    let failed = report.failed();
    anyhow::ensure!(
        failed.is_empty(),
        "{} failed: {}",
        args.dir.display(),
        failed.join("; ")
    );
    Ok(())
}
