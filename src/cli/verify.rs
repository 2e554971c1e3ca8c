//! `splitsnow verify`: checks a finished database or tailored file.
use std::path::PathBuf;

use serde_json::json;

use super::common::{self, Interrupted, ThreadArgs};
use super::walking;
use crate::atomic;
use crate::compress::with_metadata;
use crate::error_budget::{ERROR_BUDGET, FORMER_KEY};
use crate::lookup::Database;
use crate::store::{COMPACT, Store};
use crate::tailor::SCENE;
use crate::verify::{self, Verification, VerifyError, VerifyOptions};

/// Check a finished database: files, compact file, fresh simulations
///
/// Checks that every job is complete; that the compact file was made from this database and
/// rebuilds its curves within the bounds it states; that fresh simulations at random nodes
/// agree with the stored spectra; and how far look-ups anywhere in the compact file's box
/// are from fresh simulations of many more rays. The last check measures the errors of
/// simulation, compression and interpolation, also by axis. They are the error budget of the
/// file, stored in it for `splitsnow query --explain`. For a file made by `splitsnow
/// tailor`, `verify` proves that the scene's bound holds.
///
/// Exits with 1 if a check fails. A correct database fails by chance about once in a
/// million runs. If the CPU time of --seconds runs out, `verify` judges the simulations
/// that have ended, lists in the last lines what was not checked, stores no error budget and
/// exits with 1.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "\
Examples:
  splitsnow verify out/quick
  splitsnow verify out/quick --samples 100 --points 2000 --seconds 3600
  splitsnow verify out/quick --samples 4 --points 0 --json")]
pub(super) struct Args {
    /// Output directory of `build` or `tailor`
    #[arg(value_name = "DIR")]
    dir: PathBuf,
    /// Random points of the error budget, 0 to 1000000; 0 skips the error budget
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = clap::value_parser!(u64).range(..=1_000_000))]
    points: u64,
    /// Fresh simulations at random nodes, 0 to 1000000; 0 skips this check
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u64).range(..=1_000_000))]
    samples: u64,
    /// Seed that chooses the points and the random numbers of the fresh simulations
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Rays of each fresh simulation at a node [default: the database's number of rays]
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    rays: Option<u64>,
    /// Rays of each fresh simulation at a random point [default: 524288]
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    point_rays: Option<u64>,
    /// CPU seconds, in all threads together, after which no further simulation starts
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
    let options = VerifyOptions {
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
    // `Verification` reports what is missing of an incomplete database.
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
            "{} holds no database, and its compact file was not made by `splitsnow tailor`; give the output directory of `build` or `tailor`",
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
        let bytes = with_metadata(&bytes, &[(ERROR_BUDGET, Some(&text)), (FORMER_KEY, None)])?;
        if let Err(error) = atomic::write(&compact, &bytes) {
            common::note(&format!(
                "the error budget cannot be stored in {}: {error}",
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
        "{} failed: {}; the report above says where; build or compress again what is wrong",
        args.dir.display(),
        failed.join(", ")
    );
    anyhow::ensure!(
        report.not_checked.is_empty(),
        "not everything that was asked for was checked in {}: the last lines of the report list what is missing; give more --seconds",
        args.dir.display()
    );
    Ok(())
}
