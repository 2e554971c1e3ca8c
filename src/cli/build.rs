//! `splitsnow build`: the main job.
use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use serde_json::json;

use super::bar::Bar;
use super::common::{self, GridArgs, Interrupted};
use super::compact::Words;
use crate::build::{self, BuildError, Options, Report, Share};
use crate::grid::Shard;
use crate::store::StoreError;

/// Build the database of a grid and compress it; goes on where it stopped
///
/// Runs the jobs that are missing in the output directory, on all cores, and
/// stores each as it ends. Once all are done, compresses the curves, prints the
/// errors for each number of components, by band, and the largest error, and writes the
/// compact file `snow.safetensors` beside `database.zarr`.
///
/// Ctrl-C, a kill or a full disk lose nothing that was finished: run the same
/// command again. The result is the same to the byte, whatever the threads,
/// shards and interruptions. A directory made from another grid, seed, engine
/// or data table is refused.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "\
Examples:
  splitsnow build configs/quick.toml
  splitsnow build configs/thesis.toml --out /data/thesis --threads 8

  Three processes side by side, and then one that compresses:
  splitsnow build configs/thesis.toml --shard 0/3
  splitsnow build configs/thesis.toml --shard 1/3
  splitsnow build configs/thesis.toml --shard 2/3
  splitsnow build configs/thesis.toml

  A table that grows: only what DIR does not have is simulated:
  splitsnow build more.toml --from out/less")]
pub(super) struct Args {
    #[command(flatten)]
    grid: GridArgs,
    /// Run share I of N of the jobs only (I from 0), and do not compress
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Take over the spectra that the database in DIR already has, of a grid that
    /// differs in the values of its axes only; may be given several times
    #[arg(long, value_name = "DIR")]
    from: Vec<PathBuf>,
    /// Delete the database that is there, and start again
    #[arg(long)]
    fresh: bool,
    /// Print the summary as JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let file = args.grid.open()?;
    let dir = args.grid.dir(&file);
    let bar = Bar::new();
    let options = Options {
        threads: args.grid.threads()?,
        shard: args.shard,
        from: args.from.clone(),
        grid_file: args.grid.path().into(),
        fresh: args.fresh,
        viewing: file.viewing,
        progress: Some(&bar),
        cancel: Some(common::interrupt_flag()?),
    };
    let built = build::build(&file.grid, &dir, &options);
    drop(bar);
    let report = built.map_err(|error| explained(error, &dir))?;
    if let Some(share) = &report.share {
        return report_share(args, &report, share);
    }
    if args.json {
        return common::print_json(&report);
    }
    let mut text = format!(
        "{} jobs, {} of them run now\n",
        report.jobs, report.jobs_run
    );
    text += &reused(args, &report);
    if let Some(compact) = &report.compact {
        write!(text, "\n{}", Words(compact))?;
    }
    common::print(&text)
}

/// How to go on.
fn explained(error: BuildError, dir: &Path) -> anyhow::Error {
    match error {
        BuildError::Interrupted { done, jobs } if done == jobs => {
            interrupted("all jobs are done and safe").into()
        }
        BuildError::Interrupted { done, jobs } => {
            interrupted(&format!("{done} of {jobs} jobs are done and safe")).into()
        }
        BuildError::Store(error) => growing(error, dir),
        error => error.into(),
    }
}

/// How to go on with a database whose grid has changed.
fn growing(error: StoreError, dir: &Path) -> anyhow::Error {
    let of_axes = matches!(&error, StoreError::Differs { key, .. } if key.starts_with("axes."));
    if !of_axes {
        return error.into();
    }
    anyhow!(
        "{error}; to keep the spectra it has, give another --out and --from {}",
        dir.display()
    )
}

/// How many spectra were taken over, if any were to be.
fn reused(args: &Args, report: &Report) -> String {
    if args.from.is_empty() {
        return String::new();
    }
    format!("reused {} of {} nodes\n", report.nodes_reused, report.nodes)
}

fn interrupted(safe: &str) -> Interrupted {
    let words = std::env::args_os().map(|word| word.to_string_lossy().into_owned());
    // Which would delete what is safe.
    let words: Vec<_> = words.filter(|word| word != "--fresh").collect();
    Interrupted(format!("{safe}; to go on: {}", words.join(" ")))
}

fn report_share(args: &Args, report: &Report, share: &Share) -> anyhow::Result<()> {
    let (jobs, left, lost) = (report.jobs, share.jobs_left, share.lost_share);
    if args.json {
        return common::print_json(&json!({
            "shard": share.shard.to_string(),
            "database": share.database,
            "jobs": jobs,
            "jobs_run": report.jobs_run,
            "jobs_left": left,
            "nodes_reused": report.nodes_reused,
            "lost_share": lost,
        }));
    }
    let mut text = format!(
        "shard {}: {jobs} jobs, {} of them run now; {left} of {} jobs of the database are left\n",
        share.shard, report.jobs_run, share.database_jobs
    );
    text += &reused(args, report);
    if lost.max > 0.0 {
        writeln!(
            text,
            "lost rays: {:.4} % hit the event limit (worst curve {:.4} %)",
            100.0 * lost.mean,
            100.0 * lost.max
        )?;
    }
    let others = if left == 0 {
        ""
    } else {
        "the other shards, then "
    };
    writeln!(
        text,
        "next: {others}{}, which compresses",
        args.grid.command("build")
    )?;
    common::print(&text)
}
