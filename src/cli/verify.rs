//! `verify`: re-checks a finished database.
use std::path::PathBuf;

use serde_json::json;

use super::common::{self, Interrupted, ThreadArgs};
use super::walking;
use crate::atomic;
use crate::compress::annotated;
use crate::error_budget::{ERROR_BUDGET, FORMER_KEY};
use crate::lookup::Database;
use crate::store::{COMPACT, Store};
use crate::tailor::SCENE;
use crate::verify::{self, Options, Verification, VerifyError};

/// Check a finished database anew: files, compact file, fresh simulations
///
/// Checks that every job is whole; that the compact file was made from this
/// database and rebuilds its curves within the bounds it states; that fresh
/// simulations at random nodes agree with what is stored; and how far the compact
/// file's answers anywhere in its box are from fresh simulations of many more
/// walks. These errors, split into those of simulation, compression and
/// interpolation and by axis, are the file's error budget and are kept in it, for
/// `splitsnow query --explain`. Of a file made by `splitsnow tailor` it proves that the
/// scene's bound holds. Exits with 1 if anything fails; a database that is right
/// fails by chance about once in a million runs. Where the budget of --seconds ends
/// first, what was simulated until then is judged, the last lines say what was not,
/// no error budget is kept in the file, and it exits with 1.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Output directory of `build` or `tailor`
    dir: PathBuf,
    /// Random points of the error budget; 0 leaves it out
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = clap::value_parser!(u64).range(..=1_000_000))]
    points: u64,
    /// Fresh simulations on the nodes; 0 makes none
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u64).range(..=1_000_000))]
    samples: u64,
    /// Chooses points and random numbers of the fresh simulations
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Rays of a fresh simulation on a node [default: as many as the database's]
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    rays: Option<u64>,
    /// Rays of a fresh simulation at a random point [default: 524288]
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    point_rays: Option<u64>,
    /// CPU seconds after which no more is simulated, in all threads together
    #[arg(long, value_name = "X", default_value = "600", value_parser = common::positive)]
    seconds: f64,
    #[command(flatten)]
    threads: ThreadArgs,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let cancel = common::interrupt_flag()?;
    let options = Options {
        samples: args.samples as usize,
        points: args.points as usize,
        seed: args.seed,
        rays: args.rays,
        point_rays: args.point_rays,
        seconds: Some(args.seconds),
    };
    let compact = if args.dir.is_file() {
        args.dir.clone()
    } else {
        args.dir.join(COMPACT)
    };
    // what is missing of a database is told by its checks
    let result = if Store::is_at(&args.dir) || !compact.exists() {
        let verification = Verification::open(&args.dir, options)?;
        let walks = verification.walks()?;
        walking::run(args.threads, Some(walks), cancel, |control| {
            verification.run(control)
        })?
    } else {
        let file = Database::open(&compact)?;
        anyhow::ensure!(
            file.metadata().contains_key(SCENE),
            "{} is no database and its compact file was not made by `splitsnow tailor`",
            args.dir.display()
        );
        let walks = verify::tailored_walks(&file, options)?;
        walking::run(args.threads, Some(walks), cancel, |control| {
            verify::tailored(&file, options, control)
        })?
    };
    let (report, error_budget) = match result {
        Err(VerifyError::Cancelled) => return Err(Interrupted("nothing was written".into()).into()),
        result => result?,
    };
    if let Some(error_budget) = error_budget {
        let bytes = std::fs::read(&compact)?;
        let text = serde_json::to_string(&error_budget)?;
        let bytes = annotated(&bytes, &[(ERROR_BUDGET, Some(&text)), (FORMER_KEY, None)])?;
        if let Err(error) = atomic::write(&compact, &bytes) {
            common::note(&format!(
                "the error budget is not kept: {}: {error}",
                compact.display()
            ));
        }
    }
    common::print(&if args.json {
        let value = json!({
            "passed": report.passed(),
            "checks": report.checks,
            "not_checked": report.not_checked,
        });
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
    anyhow::ensure!(
        report.not_checked.is_empty(),
        "not everything that was asked for was checked in {}: see the last lines of the report",
        args.dir.display()
    );
    Ok(())
}
