//! `splitsnow build`: simulates and compresses the database of a grid.
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::anyhow;
use serde_json::json;

use super::bar::{Bar, counts};
use super::common::{self, GridArgs, Interrupted};
use super::compact::CompactSummary;
use super::shard::ShardArg;
use super::submit;
use crate::build::{self, BuildError, BuildOptions, BuildReport, ShardReport};
use crate::grid::Shard;
use crate::store::{Store, StoreError};

/// Build the database of a grid and compress it; resumes after an interruption
///
/// Runs the jobs that are missing in the output directory, on all cores, and stores each
/// job as it ends. When all jobs are done, `build` compresses the curves, prints the errors
/// for each number of components (overall and by band) and the largest error, and writes
/// the compact file `snow.safetensors` beside `database.zarr`.
///
/// Ctrl-C, a kill or a full disk lose no finished job: run the same command again to
/// resume. SIGTERM, SIGUSR1 and --stop-after end a build with exit code 75, Ctrl-C with 130. The result is identical to the byte, whatever the threads, shards and
/// interruptions. `build` refuses a directory made from another grid, seed, engine or
/// data table.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "\
Examples:
  splitsnow build configs/thesis.toml --out /data/thesis --threads 8

  Run three processes side by side, then one that compresses:
  splitsnow build configs/thesis.toml --shard 0/3
  splitsnow build configs/thesis.toml --shard 1/3
  splitsnow build configs/thesis.toml --shard 2/3
  splitsnow build configs/thesis.toml

  Run one task of a Slurm array that was submitted with --array=0-11, and end in time:
  splitsnow build configs/thesis.toml --shard env/12 --stop-after 50m

  Extend a database: simulate only the spectra that out/less does not have:
  splitsnow build more.toml --from out/less

  A small database to try things out:
  splitsnow build configs/quick.toml")]
pub(super) struct Args {
    #[command(flatten)]
    grid: GridArgs,
    /// Run only share I of N of the jobs (I from 0 to N-1) and do not compress. `env` and `env/N`
    /// take the share from the job array of Slurm, PBS, SGE, Kubernetes or AWS Batch, or from
    /// SPLITSNOW_SHARD=I/N
    #[arg(long, value_name = "I/N|env|env/N")]
    shard: Option<ShardArg>,
    /// End after this time, such as 50m, 2h or 90s, with exit code 75. The same command goes on
    #[arg(long, value_name = "TIME", value_parser = common::time_limit)]
    stop_after: Option<Duration>,
    /// Only compress, and never simulate: if jobs are missing, name their shards of N and fail
    #[arg(long, value_name = "N", conflicts_with_all = ["shard", "stop_after", "from", "fresh"],
          value_parser = clap::value_parser!(u64).range(1..))]
    finish: Option<u64>,
    /// Reuse the spectra of the database in DIR, whose grid may differ in the values of its
    /// axes only; may be given several times
    #[arg(long, value_name = "DIR")]
    from: Vec<PathBuf>,
    /// Delete the database in the output directory and start again
    #[arg(long)]
    fresh: bool,
    /// Print the summary as JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let file = args.grid.open()?;
    let dir = args.grid.dir(&file);
    let shard = args.shard.map(ShardArg::shard).transpose()?;
    let bar = Bar::new(!args.json && shard.is_none());
    let cancel = common::interrupt_flag()?;
    if let Some(time) = args.stop_after {
        common::stop_after(time);
    }
    let options = BuildOptions {
        threads: args.grid.threads()?,
        shard,
        only_compress: args.finish.is_some(),
        from: args.from.clone(),
        grid_file: args.grid.path().into(),
        fresh: args.fresh,
        viewing: file.viewing,
        progress: Some(&bar),
        cancel: Some(cancel),
    };
    let built = build::build(&file.grid, &dir, &options);
    drop(bar);
    let report = built.map_err(|error| match (error, args.finish) {
        (BuildError::Unfinished { .. }, Some(shards)) => unfinished(&dir, shards),
        (error, _) => explained(error, &dir),
    })?;
    if let Some(reason) = &report.unshared_tables {
        common::warn(&[format!(
            "tables of grain events are not shared between processes, which takes more time: {reason}"
        )]);
    }
    if let Some(share) = &report.share {
        return report_share(args, &report, share);
    }
    if args.json {
        return common::print_json(&report);
    }
    // The bar has printed the counts if there was something to run.
    let mut text = match report.jobs_run {
        0 => counts(report.jobs, 0),
        _ => String::new(),
    };
    text += &reused(args, &report);
    if let Some(compact) = &report.compact {
        write!(text, "\n{}", CompactSummary(compact))?;
    }
    common::print(&text)
}

/// Which of the shards have jobs that are missing, and how to run them.
fn unfinished(dir: &Path, shards: u64) -> anyhow::Error {
    let found = || -> anyhow::Result<(usize, Vec<u64>, u64)> {
        let store = Store::open(dir)?;
        let missing = store.survey()?.missing;
        let of = |index: &u64| {
            let range = Shard::new(*index, shards).map(|shard| shard.range(store.jobs()));
            range.is_ok_and(|range| missing.iter().any(|job| range.contains(job)))
        };
        let tasks = (0..shards).filter(of).collect();
        Ok((missing.len(), tasks, store.jobs().count()))
    };
    match found() {
        Err(error) => error,
        Ok((missing, tasks, jobs)) => {
            let again = submit::again(dir, &tasks)
                .unwrap_or_else(|| format!("run each of them with --shard I/{shards}"));
            anyhow!(
                "{missing} of {jobs} jobs are missing, in the shards {} of {shards}; nothing was simulated; to go on: {again}",
                submit::ranges(&tasks)
            )
        }
    }
}

/// Adds to a build error how to resume.
pub(super) fn explained(error: BuildError, dir: &Path) -> anyhow::Error {
    match error {
        BuildError::Interrupted { done, jobs } if done == jobs => {
            interrupted("all jobs are done and safe").into()
        }
        BuildError::Interrupted { done, jobs } => {
            interrupted(&format!("{done} of {jobs} jobs are done and safe")).into()
        }
        BuildError::Store(error) => suggest_from(error, dir),
        error => error.into(),
    }
}

/// Adds to the error of a changed grid how to reuse the spectra of `dir`, if only the axes
/// changed.
fn suggest_from(error: StoreError, dir: &Path) -> anyhow::Error {
    let axes_differ = matches!(&error, StoreError::Differs { key, .. } if key.starts_with("axes."));
    if !axes_differ {
        return error.into();
    }
    anyhow!(
        "{error}; give another --out and --from {} to reuse its spectra",
        dir.display()
    )
}

/// The line with the number of nodes reused, or nothing without `--from`.
fn reused(args: &Args, report: &BuildReport) -> String {
    if args.from.is_empty() {
        return String::new();
    }
    format!("reused {} of {} nodes\n", report.nodes_reused, report.nodes)
}

/// The error of an interrupted build: the work that is safe, and the command that resumes it.
fn interrupted(safe: &str) -> Interrupted {
    let words = std::env::args_os().map(|word| word.to_string_lossy().into_owned());
    // `--fresh` would delete the finished jobs.
    let words: Vec<_> = words.filter(|word| word != "--fresh").collect();
    Interrupted(format!("{safe}; to go on: {}", words.join(" ")))
}

fn report_share(args: &Args, report: &BuildReport, share: &ShardReport) -> anyhow::Result<()> {
    let (jobs, jobs_left, lost) = (report.jobs, share.jobs_left, share.lost_share);
    if args.json {
        return common::print_json(&json!({
            "shard": share.shard.to_string(),
            "database": share.database,
            "jobs": jobs,
            "jobs_run": report.jobs_run,
            "jobs_left": jobs_left,
            "nodes_reused": report.nodes_reused,
            "table_parts": report.table_parts,
            "lost_share": lost,
        }));
    }
    let mut text = format!(
        "shard {}: {jobs} jobs, {} of them run now; {jobs_left} of {} jobs of the database are left\n",
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
    let others = if jobs_left == 0 {
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
