//! `splitsnow tradeoff`: charts speed against accuracy.
use anyhow::bail;
use std::path::{Path, PathBuf};

use serde_json::json;

use super::common::{self, Interrupted, Spinner, ThreadArgs};
use crate::config::grid;
use crate::engine::Engine;
use crate::lab::report;
use crate::lab::tradeoff::{
    self, CompressionSource, NamedSample, Results, TradeoffError, TradeoffOptions,
};

/// The grid whose compression is charted if no database is given.
const GRID: (&str, &str) = (
    "configs/quick.toml",
    include_str!("../../configs/quick.toml"),
);

/// Chart speed against accuracy: every engine, error against CPU time
///
/// Runs the engines at a ladder of settings on some samples, at 400-700 nm and 700-1400 nm,
/// and compares reflectance, transmittance and colour with a converged reference (the
/// truth). Writes charts (SVG and PNG) and CSV files, and prints a table that ends with the
/// recommended engine for each bound on the error. Also charts how the cost scales, and the
/// error of compression against its cost.
///
/// The truth is stored in the folder `truth` of the output directory and reused by later
/// runs. Errors below the standard error of the truth cannot be resolved; raise --truth-rays
/// to resolve smaller errors.
#[derive(Debug, clap::Args)]
#[command(
    allow_negative_numbers = true,
    after_long_help = "\
Examples:
  splitsnow tradeoff
  splitsnow tradeoff --budget 3600 --truth-rays 2000000 --seeds 16

  A quick look at one engine and one sample:
  splitsnow tradeoff configs/samples/small.toml --engine hybrid --budget 2 --seeds 2 \\
      --truth-rays 2000 --truth-engine hybrid --database out/quick --out out/look"
)]
pub(super) struct Args {
    /// Sample files; their wavelengths are ignored [default: the files in configs/tradeoff]
    #[arg(value_name = "SAMPLE.toml")]
    samples: Vec<PathBuf>,
    /// Output directory
    #[arg(long, value_name = "DIR", default_value = "out/tradeoff")]
    out: PathBuf,
    /// CPU seconds to spend, approximately; includes the truth only without --truth-rays
    #[arg(long, value_name = "SECONDS", default_value_t = 400.0, value_parser = common::positive)]
    budget: f64,
    /// Engine to chart; may be given several times [default: all]
    #[arg(long, value_parser = common::engine_parser())]
    engine: Vec<Engine>,
    /// Runs of each setting, each with its own random numbers
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u64).range(1..=32))]
    seeds: u64,
    /// Engine of the truth
    #[arg(long, value_name = "ENGINE", default_value = Engine::Spectral.name(), value_parser = common::engine_parser())]
    truth_engine: Engine,
    /// Rays of the truth [default: as many as two fifths of --budget allow]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    truth_rays: Option<u64>,
    /// Output directory of a finished build whose compression is charted [default:
    /// configs/quick.toml, built in memory]
    #[arg(long, value_name = "DIR")]
    database: Option<PathBuf>,
    #[command(flatten)]
    threads: ThreadArgs,
    /// Print the table as JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let cancel = common::interrupt_flag()?;
    let options = options(args)?;
    let spinner = Spinner::new("reading");
    let measured = tradeoff::run(&options, cancel, &|activity| spinner.say(activity));
    drop(spinner);
    let results = match measured {
        Err(TradeoffError::Cancelled) => {
            let truth_folder = options.truth_folder.display();
            let safe = format!("nothing was written but the truths finished in {truth_folder}");
            return Err(Interrupted(safe).into());
        }
        measured => measured?,
    };
    let files = report::write(&args.out, &results)?;
    common::print(&if args.json {
        let mut value = report::json(&results);
        value["files"] = json!(files);
        format!("{value:#}\n")
    } else {
        text(&results, &args.out, &files)
    })
}

fn options(args: &Args) -> anyhow::Result<TradeoffOptions> {
    let samples = if args.samples.is_empty() {
        NamedSample::defaults()?
    } else {
        NamedSample::read(&args.samples)?
    };
    for sample in &samples {
        common::warn(&sample.file.warnings);
        common::notes(&sample.file.notes);
    }
    let source = match &args.database {
        Some(dir) => CompressionSource::Database(dir.clone()),
        None => CompressionSource::Grid(Box::new(grid::parse(GRID.0, GRID.1)?.grid)),
    };
    if args.engine.contains(&Engine::Auto) {
        bail!("--engine auto only chooses among the other engines; name one of those");
    }
    let engines = Engine::ALL.into_iter().filter(|e| *e != Engine::Auto);
    let chosen = |engine: &Engine| args.engine.is_empty() || args.engine.contains(engine);
    Ok(TradeoffOptions {
        samples,
        engines: engines.filter(chosen).collect(),
        seeds: args.seeds,
        budget: args.budget,
        threads: args.threads.count()?,
        truth_engine: args.truth_engine,
        truth_rays: args.truth_rays,
        truth_folder: args.out.join("truth"),
        source,
    })
}

fn text(results: &Results, out: &Path, files: &[PathBuf]) -> String {
    let names = files.iter().filter_map(|path| path.file_name());
    let names: Vec<_> = names.map(|name| name.to_string_lossy()).collect();
    let table = report::table(results);
    format!("{table}\nin {}: {}\n", out.display(), names.join(", "))
}
