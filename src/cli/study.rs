//! `splitsnow study`: draws figures of one sample in several variants.
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};

use super::common::{self, Interrupted, Spinner, ThreadArgs};
use super::walking;
use crate::config::study::{self as file, StudyFile};
use crate::engine::{Engine, EngineError};
use crate::lab::report;
use crate::lab::study::{self, Studied, StudySettings};

/// Draw studies: the spectra or BRDFs of a sample in several variants in one picture
///
/// A study file names a sample, lists variants with the keys that each changes, and says
/// what to draw. For each study, writes a picture (SVG and PNG) and its values with standard
/// errors (CSV), and prints means over bands, or peaks of the BRDF. The studies in
/// configs/studies are the experiments of docs/validation.md.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "\
Examples:
  splitsnow study
  splitsnow study configs/studies --rays 131072 --out out/fine
  splitsnow study configs/studies/black_carbon.toml --rays 4096")]
pub(super) struct Args {
    /// Study files (TOML), or folders that hold study files
    #[arg(value_name = "STUDY.toml", default_value = "configs/studies")]
    studies: Vec<PathBuf>,
    /// Output directory
    #[arg(long, value_name = "DIR", default_value = "out/studies")]
    out: PathBuf,
    /// Engine that simulates the samples
    #[arg(long, default_value = Engine::Auto.name(), value_parser = common::engine_parser())]
    engine: Engine,
    /// Rays of each variant, as in `simulate`; twice as many for a BRDF
    #[arg(long, value_name = "N", default_value_t = 16_384, value_parser = clap::value_parser!(u64).range(1..))]
    rays: u64,
    /// Seed of the random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    threads: ThreadArgs,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let cancel = common::interrupt_flag()?;
    // Reads all files before the first run, so that a wrong file costs no time.
    let studies = read(&args.studies)?;
    for study in &studies {
        common::warn(&study.warnings);
        common::notes(&study.notes);
    }
    let settings = StudySettings {
        engine: args.engine,
        rays: args.rays,
        seed: args.seed,
    };
    common::check_output_dir(&args.out)?;
    let spinner = Spinner::new("starting");
    // All studies share one pool and one cache, because variants share tables of grain events.
    walking::run(args.threads, None, cancel, |control| {
        for study in &studies {
            let say = |variant: &file::StudyVariant| {
                spinner.say(&format!("{}: {}", study.name, variant.label));
            };
            let studied = match study::run(study, settings, control, say) {
                Err(EngineError::Cancelled) => {
                    let safe = "the studies printed are finished";
                    return Err(Interrupted(safe.into()).into());
                }
                studied => studied.with_context(|| format!("in the study {}", study.name))?,
            };
            write_study(args, &studied)?;
        }
        Ok(())
    })?
}

/// Writes the files of a finished study and prints its table.
fn write_study(args: &Args, studied: &Studied) -> anyhow::Result<()> {
    let files = report::write_study(&args.out, studied)?;
    let files: Vec<_> = files.iter().map(|file| common::one_line(file)).collect();
    let table = report::study_table(studied);
    common::print(&format!("{table}  {}\n\n", files.join(", ")))
}

/// The studies in `paths`.
///
/// # Errors
/// If a file cannot be read, or two studies have the same name.
fn read(paths: &[PathBuf]) -> anyhow::Result<Vec<StudyFile>> {
    let mut studies: Vec<StudyFile> = Vec::new();
    for path in paths {
        for path in files(path)? {
            let study = file::read(&path)?;
            if studies.iter().any(|other| other.name == study.name) {
                bail!(
                    "{}: another study is also named {}, and would write the same files; rename one",
                    path.display(),
                    study.name
                );
            }
            studies.push(study);
        }
    }
    Ok(studies)
}

/// The file `path`, or the .toml files in the folder `path`, sorted.
fn files(path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let failed = |error| {
        anyhow!(
            "cannot list {}: {error}; check its permissions",
            path.display()
        )
    };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(path).map_err(failed)? {
        let file = entry.map_err(failed)?.path();
        if file.extension().is_some_and(|end| end == "toml") {
            files.push(file);
        }
    }
    if files.is_empty() {
        bail!(
            "{}: this folder holds no study file (.toml); give a study file, or a folder such as configs/studies",
            path.display()
        );
    }
    files.sort();
    Ok(files)
}
