//! `splitsnow build`: the main job.
use std::fmt::Write;
use std::sync::atomic::Ordering;

use serde::Serialize;
use serde_json::json;

use super::common::{self, GridArgs, Interrupted};
use super::compact::{self, Report};
use crate::batch::{self, BatchError, Options};
use crate::engine::{Control, Request};
use crate::grid::Shard;
use crate::store::{self, Access, Store};

/// Build the database of a grid and compress it; goes on where it stopped
///
/// Runs the jobs that are missing in the output directory, on all cores, and
/// stores each as it ends. Once all are done, compresses the curves, prints the
/// errors for each number of components, and writes the compact file
/// `snow.safetensors` beside `database.zarr`.
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
  splitsnow build configs/thesis.toml")]
pub(super) struct Args {
    #[command(flatten)]
    grid: GridArgs,
    /// Run share I of N of the jobs only (I from 0), and do not compress
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
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
    if args.fresh {
        store::remove(&dir)?;
    }
    let access = args.shard.map_or(Access::Exclusive, Access::Shard);
    let store = Store::build(&dir, grid, &inputs, access)?;
    let options = Options {
        threads,
        shard: args.shard,
        progress: true,
    };
    let engine = grid.run.engine;
    let simulate = |request: &Request<'_>, control: &Control<'_>| engine.run(request, control);
    let done = match batch::run(grid, &store, simulate, &options, cancel) {
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
            report: &report,
        });
    }
    let mut text = format!("{} jobs, {} of them run now\n\n", done.jobs, done.run);
    write!(text, "{report}")?;
    common::print(&text)
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
