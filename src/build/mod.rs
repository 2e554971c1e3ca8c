//! The main job: from a grid to its database and compact file; and from a database to
//! another compact file.
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
//! let mut options = build::Options::default();
//! options.viewing = file.viewing;
//! let report = splitsnow::build(&file.grid, &dir, &options)?;
//! assert_eq!((report.jobs, report.jobs_run), (1, 1));
//!
//! // Again: nothing is missing.
//! let report = splitsnow::build(&file.grid, &dir, &options)?;
//! assert_eq!(report.jobs_run, 0);
//! assert_eq!(Database::open(&dir)?.curves(), 2);
//! # Ok(())
//! # }
//! ```
mod compact;
mod error;
mod inputs;
mod report;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

pub use compact::{Asked, compress};
pub use error::BuildError;
pub use inputs::data_hashes;
pub use report::{Compact, LargestError, Lost, QuantityReport, Report, Share};

use crate::batch::{self, Progress, Source};
use crate::colour::Viewing;
use crate::engine::{Control, Request};
use crate::grid::{Grid, Shard};
use crate::store::{self, Access, Store};
use crate::threads::threads;

/// How to build.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Options<'a> {
    /// Threads; 0 is what [`threads`] says.
    pub threads: usize,
    /// Run this share of the jobs only, and do not compress.
    pub shard: Option<Shard>,
    /// Databases to take over from what they have of the spectra.
    pub from: Vec<PathBuf>,
    /// The grid file: tables that the grids of `from` name are looked for beside it.
    pub grid_file: PathBuf,
    /// Delete the database that is there, and start again.
    pub fresh: bool,
    /// How the compression compares colours.
    pub viewing: Viewing,
    /// What is told how the build goes on.
    pub progress: Option<&'a dyn Progress>,
    /// The build stops soon once this is set. A failure sets it, too.
    pub cancel: Option<&'a AtomicBool>,
}

/// Builds the database of `grid` in `dir` and compresses it; goes on where it stopped.
///
/// Runs the jobs that are missing and stores each as it ends. Once all are done, writes
/// the compact file, and that of isotropic light, if the grid has such. The files are a
/// function of `grid`, `options.viewing` and this version alone: never of threads, shards or
/// interruptions.
///
/// # Errors
/// See [`BuildError`]: the directory is in use or holds the database of another grid, a
/// job fails, a file cannot be written, or the build is cancelled.
pub fn build(
    grid: &Grid,
    dir: impl AsRef<Path>,
    options: &Options<'_>,
) -> Result<Report, BuildError> {
    let dir = dir.as_ref();
    let inputs = data_hashes(grid)?;
    let threads = match options.threads {
        0 => threads(None)?,
        asked => asked,
    };
    if options.fresh {
        keeps_sources(&options.from, dir)?;
    }
    let open = |path: &PathBuf| Source::open(path, grid, &inputs, &options.grid_file);
    let sources: Vec<Source> = options.from.iter().map(open).collect::<Result<_, _>>()?;
    if options.fresh {
        store::remove(dir)?;
    }
    let access = options.shard.map_or(Access::Exclusive, Access::Shard);
    let store = Store::build(dir, grid, &inputs, access)?;
    let run = batch::Options {
        threads,
        shard: options.shard,
        progress: options.progress,
    };
    let engine = grid.run.engine;
    let simulate = |request: &Request<'_>, control: &Control<'_>| engine.run(request, control);
    let never = AtomicBool::new(false);
    let cancel = options.cancel.unwrap_or(&never);
    let done = batch::run_from(grid, &store, &sources, simulate, &run, cancel)?;
    if let Some(shard) = options.shard {
        let share = Share::of(shard, &store, &done)?;
        return Ok(Report::new(&done, None, Some(share)));
    }
    if cancel.load(Ordering::Relaxed) {
        return Err(BuildError::Interrupted {
            done: done.jobs,
            jobs: done.jobs,
        });
    }
    if let Some(progress) = options.progress {
        progress.compressing();
    }
    let asked = Asked::plain(grid.compression, options.viewing.clone());
    let compact = compact::write(&store, &asked)?;
    Ok(Report::new(&done, Some(compact), None))
}

/// Refuses if the database in `dir`, which is to be deleted, is one of `sources`.
fn keeps_sources(sources: &[PathBuf], dir: &Path) -> Result<(), BuildError> {
    let place = |path: &Path| std::fs::canonicalize(path).ok();
    let here = [place(dir), place(&store::database(dir))];
    let own = |path: &&PathBuf| place(path).is_some() && here.contains(&place(path));
    match sources.iter().find(own) {
        Some(path) => Err(BuildError::OwnSource { path: path.clone() }),
        None => Ok(()),
    }
}
