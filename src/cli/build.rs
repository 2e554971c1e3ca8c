//! `splitsnow build`: the main job.
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use anyhow::{anyhow, bail};
use serde::Serialize;
use serde_json::json;

use super::bar::Bar;
use super::common::{self, GridArgs, Interrupted};
use super::compact::{self, Report};
use crate::batch::{self, BatchError, Options, Source};
use crate::config::grid::GridFile;
use crate::engine::{Control, Request};
use crate::grid::Shard;
use crate::store::{self, Access, Store, StoreError};

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

#[derive(Serialize)]
struct Summary<'a> {
    jobs: u64,
    jobs_run: u64,
    nodes: u64,
    nodes_reused: u64,
    #[serde(flatten)]
    report: &'a Report,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let file = args.grid.open()?;
    let grid = &file.grid;
    let inputs = common::data_hashes(grid)?;
    let dir = args.grid.dir(&file);
    let threads = args.grid.threads()?;
    let cancel = common::interrupt_flag()?;
    let sources = sources(args, &file, &inputs, &dir)?;
    if args.fresh {
        store::remove(&dir)?;
    }
    let access = args.shard.map_or(Access::Exclusive, Access::Shard);
    let store = Store::build(&dir, grid, &inputs, access).map_err(|e| growing(e, &dir))?;
    let bar = Bar::new();
    let options = Options {
        threads,
        shard: args.shard,
        progress: Some(&bar),
    };
    let engine = grid.run.engine;
    let simulate = |request: &Request<'_>, control: &Control<'_>| engine.run(request, control);
    let done = match batch::run_from(grid, &store, &sources, simulate, &options, cancel) {
        Err(BatchError::Interrupted { done, total }) => {
            return Err(interrupted(&format!("{done} of {total} jobs are done and safe")).into());
        }
        done => done?,
    };
    if args.shard.is_some() {
        return report_shard(args, &store, &done);
    }
    if cancel.load(Ordering::Relaxed) {
        return Err(interrupted("all jobs are done and safe").into());
    }
    let asked = compact::Asked::plain(grid.compression, file.viewing.clone());
    let report = compact::write(&store, &asked)?;
    if args.json {
        return common::print_json(&Summary {
            jobs: done.jobs,
            jobs_run: done.run,
            nodes: done.nodes,
            nodes_reused: done.reused,
            report: &report,
        });
    }
    let mut text = format!("{} jobs, {} of them run now\n", done.jobs, done.run);
    text += &reused(args, &done);
    write!(text, "\n{report}")?;
    common::print(&text)
}

/// The databases to take spectra over from, all of them fit for it.
fn sources(
    args: &Args,
    file: &GridFile,
    inputs: &BTreeMap<String, String>,
    dir: &Path,
) -> anyhow::Result<Vec<Source>> {
    let place = |path: &Path| std::fs::canonicalize(path).ok();
    for path in &args.from {
        let here = place(path) == place(dir) || place(path) == place(&store::database(dir));
        if args.fresh && here && place(path).is_some() {
            bail!(
                "--fresh would delete {}, which --from is to take spectra over from; choose another output directory with --out",
                path.display()
            );
        }
    }
    let open = |path: &PathBuf| Source::open(path, &file.grid, inputs, args.grid.path());
    Ok(args.from.iter().map(open).collect::<Result<_, _>>()?)
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
fn reused(args: &Args, done: &batch::Summary) -> String {
    if args.from.is_empty() {
        return String::new();
    }
    format!("reused {} of {} nodes\n", done.reused, done.nodes)
}

fn interrupted(safe: &str) -> Interrupted {
    let words = std::env::args_os().map(|word| word.to_string_lossy().into_owned());
    // Which would delete what is safe.
    let words: Vec<_> = words.filter(|word| word != "--fresh").collect();
    Interrupted(format!("{safe}; to go on: {}", words.join(" ")))
}

fn report_shard(args: &Args, store: &Store, done: &batch::Summary) -> anyhow::Result<()> {
    let left = store.missing(None)?.len();
    let shard = args.shard.map(|shard| shard.to_string());
    if args.json {
        return common::print_json(&json!({
            "shard": shard,
            "database": store.path(),
            "jobs": done.jobs,
            "jobs_run": done.run,
            "jobs_left": left,
            "nodes_reused": done.reused,
            "lost_share": { "mean": done.mean_lost_share, "max": done.max_lost_share },
        }));
    }
    let mut text = format!(
        "shard {}: {} jobs, {} of them run now; {left} of {} jobs of the database are left\n",
        shard.unwrap_or_default(),
        done.jobs,
        done.run,
        store.jobs().count()
    );
    text += &reused(args, done);
    if done.max_lost_share > 0.0 {
        writeln!(
            text,
            "lost rays: {:.4} % hit the event limit (worst curve {:.4} %)",
            100.0 * done.mean_lost_share,
            100.0 * done.max_lost_share
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
