//! Building: from a grid to its database and compact file, and from a database to another
//! compact file.
//!
//! ```
//! use splitsnow::{Database, build, config};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let dir = folder.path().join("tiny");
//! let file = config::grid::parse(
//!     "tiny.toml",
//!     r#"
//!     version = 1
//!     [axes]
//!     facetness = [0.5]
//!     grain_size_um = [400]
//!     density_kg_m3 = [200]
//!     thickness_cm = [1, 2]
//!     incidence_angle_deg = [0]
//!     [wavelengths]
//!     values_nm = [450, 550, 650]
//!     [run]
//!     engine = "spectral"
//!     rays = 64
//!     "#,
//! )?;
//! let mut options = build::BuildOptions::default();
//! options.viewing = file.viewing;
//! let report = splitsnow::build(&file.grid, &dir, &options)?;
//! assert_eq!((report.jobs, report.jobs_run), (1, 1));
//!
//! // Built again: no job is missing.
//! let report = splitsnow::build(&file.grid, &dir, &options)?;
//! assert_eq!(report.jobs_run, 0);
//! assert_eq!(Database::open(&dir)?.curves(), 2);
//! # Ok(())
//! # }
//! ```
mod compact;
mod error;
mod inputs;
mod journal;
mod report;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

pub(crate) use compact::view_file;
pub use compact::{CompressionRequest, compress};
pub use error::BuildError;
pub use inputs::data_hashes;
pub use journal::{BuildStatus, RunState, RunStatus, status};
pub use report::{
    BuildReport, CompactReport, LargestError, LostShare, QuantityReport, ShardReport,
};

use crate::batch::{self, Progress, ReuseSource};
use crate::colour::Viewing;
use crate::engine::{Control, Request};
use crate::grid::{Grid, Shard};
use crate::store::{self, Access, Store, Survey};
use crate::threads::threads;
use journal::Journal;

/// Options of a build.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct BuildOptions<'a> {
    /// Number of threads; 0 for the default of [`threads`].
    pub threads: usize,
    /// Run only the jobs of this shard, and do not compress.
    pub shard: Option<Shard>,
    /// Never simulate: compress, or fail if jobs are missing.
    pub only_compress: bool,
    /// Databases whose spectra are reused.
    pub from: Vec<PathBuf>,
    /// The grid file: data tables that the databases in `from` name are searched for in its
    /// directory.
    pub grid_file: PathBuf,
    /// Delete the existing database and start again.
    pub fresh: bool,
    /// How the compression compares colours.
    pub viewing: Viewing,
    /// Receives progress reports.
    pub progress: Option<&'a dyn Progress>,
    /// Setting this flag stops the build; a failure also sets it.
    pub cancel: Option<&'a AtomicBool>,
}

/// Builds the database of `grid` in `dir` and compresses it. Continues an interrupted build.
///
/// Runs the missing jobs, and stores each when it is done. When all are done, writes the
/// compact file; also that of diffuse light, if the grid has it. The files depend on `grid`,
/// `options.viewing` and the version of the program alone: never on threads, shards or
/// interruptions.
///
/// # Errors
/// [`BuildError`] if the directory is in use or has the database of another grid, a job
/// fails, a file cannot be read or written, or the build is cancelled.
pub fn build(
    grid: &Grid,
    dir: impl AsRef<Path>,
    options: &BuildOptions<'_>,
) -> Result<BuildReport, BuildError> {
    let dir = dir.as_ref();
    let inputs = data_hashes(grid)?;
    let threads = match options.threads {
        0 => threads(None)?,
        given => given,
    };
    if options.fresh {
        check_not_a_source(&options.from, dir)?;
    }
    let open = |path: &PathBuf| ReuseSource::open(path, grid, &inputs, &options.grid_file);
    let sources: Vec<ReuseSource> = options.from.iter().map(open).collect::<Result<_, _>>()?;
    if options.fresh {
        store::remove(dir)?;
    }
    let access = options.shard.map_or(Access::Exclusive, Access::Shard);
    let store = Store::build(dir, grid, &inputs, access)?;
    let surveyed = match options.only_compress {
        true => {
            let survey = store.survey()?;
            compact::check_none_missing(&store, survey.missing.len())?;
            Some(survey)
        }
        false => None,
    };
    let journal = Journal::new(dir, access, threads, options.progress);
    let report = run(
        grid,
        (&store, surveyed),
        &sources,
        threads,
        (options, &journal),
    );
    journal.close(report.as_ref());
    let report = report?;
    if options.shard.is_none() {
        store.delete_journals()?;
    }
    if report
        .share
        .as_ref()
        .is_none_or(|share| share.jobs_left == 0)
    {
        store.delete_tables();
    }
    Ok(report)
}

/// Runs the missing jobs of `store` and, without a shard, compresses the curves. `surveyed` is what
/// is missing, if it is known.
fn run(
    grid: &Grid,
    (store, surveyed): (&Store, Option<Survey>),
    sources: &[ReuseSource],
    threads: usize,
    (options, progress): (&BuildOptions<'_>, &dyn Progress),
) -> Result<BuildReport, BuildError> {
    let run = batch::BatchOptions {
        threads,
        shard: options.shard,
        progress: Some(progress),
    };
    let engine = grid.run.engine;
    let simulate = |request: &Request<'_>, control: &Control<'_>| engine.run(request, control);
    let never = AtomicBool::new(false);
    let cancel = options.cancel.unwrap_or(&never);
    let summary = batch::run_surveyed(grid, (store, surveyed), sources, simulate, &run, cancel)?;
    if let Some(shard) = options.shard {
        let share = ShardReport::of(shard, store, &summary)?;
        return Ok(BuildReport::new(&summary, None, Some(share)));
    }
    if cancel.load(Ordering::Relaxed) {
        return Err(BuildError::Interrupted {
            done: summary.jobs,
            jobs: summary.jobs,
        });
    }
    progress.compressing();
    let request = CompressionRequest::plain(grid.compression, options.viewing.clone());
    let compact = compact::write(store, &request, threads)?;
    Ok(BuildReport::new(&summary, Some(compact), None))
}

/// Refuses to delete the database in `dir` if it is one of `sources`.
fn check_not_a_source(sources: &[PathBuf], dir: &Path) -> Result<(), BuildError> {
    let canonical = |path: &Path| std::fs::canonicalize(path).ok();
    let targets = [canonical(dir), canonical(&store::database(dir))];
    let is_target =
        |path: &&PathBuf| canonical(path).is_some() && targets.contains(&canonical(path));
    match sources.iter().find(is_target) {
        Some(path) => Err(BuildError::FreshDeletesSource { path: path.clone() }),
        None => Ok(()),
    }
}
