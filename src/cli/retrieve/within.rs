//! The database that `retrieve` searches: made, built or opened.
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{anyhow, bail, ensure};
use sha2::{Digest, Sha256};

use super::Args;
use crate::atomic;
use crate::build::{self, BuildError, BuildOptions};
use crate::cli::bar::Bar;
use crate::cli::common::{self, Interrupted};
use crate::comparison::{self, RANGE_NM};
use crate::config::grid;
use crate::lookup::Database;
use crate::optics::MODEL_RANGE_NM;
use crate::plan::{self, PlanOptions};
use crate::retrieve::{BoxRequest, DefaultBox, MeasuredInput};
use crate::store::{COMPACT, StoreError};

/// Pause between attempts to work in a directory in which another process works.
const PAUSE: Duration = Duration::from_millis(500);

/// Whether the box is a grid file.
fn is_grid(within: &Path) -> bool {
    within.extension().is_some_and(|end| end == "toml") && !within.is_dir()
}

impl Args {
    /// The longest wavelength of the files that is used, nm: for bands that of the model, within a
    /// box as its wavelengths need it.
    pub(super) fn longest_nm(&self) -> anyhow::Result<f64> {
        Ok(match &self.within {
            _ if self.bands.is_given() => MODEL_RANGE_NM.1,
            None => self.longest_nm.unwrap_or(RANGE_NM.1),
            Some(grid) if is_grid(grid) => {
                comparison::longest_nm(&grid::read(grid)?.grid.wavelengths_nm)
            }
            Some(file) => {
                let file = match self.diffuse {
                    true => common::diffuse_path(file)?,
                    false => file.clone(),
                };
                comparison::longest_nm(Database::open(file)?.wavelengths_nm())
            }
        })
    }

    /// The directory that holds what is made.
    fn keep_in(&self) -> &Path {
        self.keep_in.as_deref().unwrap_or(Path::new("out"))
    }

    /// Writes a grid file of the snows that may have these spectra, and notes what it assumes.
    pub(super) fn default_box(
        &self,
        inputs: Vec<MeasuredInput>,
        nm: &[f64],
    ) -> anyhow::Result<PathBuf> {
        let found = DefaultBox::new(&BoxRequest {
            inputs: &inputs,
            wavelengths_nm: nm,
            free: &self.free,
            fix: &self.fix,
            diffuse: self.diffuse,
        })?;
        let digest = Sha256::digest(&found.text);
        let id: String = digest.iter().take(4).map(|b| format!("{b:02x}")).collect();
        let path = self.keep_in().join(format!("retrieve_{id}.toml"));
        if fs::read_to_string(&path).is_ok_and(|text| text == found.text) {
            common::note(&format!("searching the snows of {}", path.display()));
        } else {
            let made = fs::create_dir_all(self.keep_in());
            made.map_err(|error| self.cannot_keep(self.keep_in(), &error))?;
            let written = atomic::write(&path, found.text.as_bytes());
            // another process may write the same text at the same time
            if !fs::read_to_string(&path).is_ok_and(|text| text == found.text) {
                written.map_err(|error| self.cannot_keep(&path, &error))?;
            }
            common::note(&format!(
                "searching the snows of {}, made from what is known; --within gives other snows",
                path.display()
            ));
        }
        for assumed in &found.assumed {
            common::note(&format!("assumed: {assumed}"));
        }
        Ok(path)
    }

    /// The error of making the grid or its directory.
    fn cannot_keep(&self, path: &Path, error: &std::io::Error) -> anyhow::Error {
        anyhow!(
            "cannot write {}, which is kept for the next spectrum: {error}; check its permissions and its disk, or keep it elsewhere with --keep-in DIR",
            path.display()
        )
    }

    /// The compact file, built first if `within` is a grid file. `made`: by [`Self::default_box`].
    pub(super) fn database(
        &self,
        within: &Path,
        made: bool,
        cancel: Option<&AtomicBool>,
    ) -> anyhow::Result<Database> {
        let dir = match is_grid(within) {
            true => self.built(within, made, cancel)?,
            false => {
                ensure!(
                    self.keep_in.is_none(),
                    "--keep-in is for a database that is built, but {} exists; remove it",
                    within.display()
                );
                within.to_owned()
            }
        };
        let path = match self.diffuse {
            true => common::diffuse_path(&dir)?,
            false => dir,
        };
        Ok(Database::open(path)?)
    }

    /// Builds the database of the grid file, or continues it. Returns its directory.
    fn built(
        &self,
        within: &Path,
        made: bool,
        cancel: Option<&AtomicBool>,
    ) -> anyhow::Result<PathBuf> {
        let file = grid::read(within)?;
        // of a grid that the user did not write, lines and keys say nothing
        match file.warnings.len() {
            0 => {}
            count if made => common::note(&format!(
                "the grid has {count} warnings, which `splitsnow plan {}` prints; --within takes a changed copy",
                within.display()
            )),
            _ => common::warn(&file.warnings),
        }
        common::notes(&file.notes);
        ensure!(
            !self.diffuse || file.grid.fixed.diffuse,
            "{} has no curves under diffuse light; add axes.diffuse = true, or remove --diffuse",
            within.display()
        );
        let dir = self.keep_in().join(&file.name);
        let threads = self.threads.count()?;
        let options = PlanOptions {
            threads,
            seconds: 2.0,
            dir: Some(dir.clone()),
        };
        if !dir.join(COMPACT).exists() {
            let plan = plan::plan(&file.grid, &options)?;
            common::note(&format!(
                "building {} first: {} spectra at {} wavelengths, about {} of CPU time, {} on {} threads, {} on disk",
                dir.display(),
                plan.curves,
                file.grid.wavelengths_nm.len(),
                common::duration(plan.core_seconds),
                common::duration(plan.wall_seconds),
                plan.threads,
                common::bytes(plan.database_bytes + plan.compact_bytes)
            ));
        }
        let build = || {
            let bar = Bar::new(false);
            build::build(
                &file.grid,
                &dir,
                &BuildOptions {
                    threads,
                    shard: None,
                    only_compress: false,
                    from: Vec::new(),
                    grid_file: within.to_owned(),
                    fresh: false,
                    viewing: file.viewing.clone(),
                    progress: Some(&bar),
                    cancel,
                },
            )
        };
        let mut built = build();
        if matches!(&built, Err(BuildError::Store(StoreError::Busy { .. }))) {
            common::note(&format!(
                "another process works in {}; waiting until it ends (Ctrl-C stops this one)",
                dir.display()
            ));
            while matches!(&built, Err(BuildError::Store(StoreError::Busy { .. }))) {
                if cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed)) {
                    return Err(Interrupted(
                        "nothing was written; the other process goes on".into(),
                    )
                    .into());
                }
                std::thread::sleep(PAUSE);
                built = build();
            }
        }
        let report = built.map_err(|error| {
            let not_kept = matches!(
                &error,
                BuildError::Store(
                    StoreError::Io { .. }
                        | StoreError::NotADirectory { .. }
                        | StoreError::DiskFull { .. }
                        | StoreError::TooLarge { .. }
                )
            );
            let error = crate::cli::build::explained(error, &dir);
            match not_kept {
                true => anyhow!("{error}; --keep-in DIR keeps the database elsewhere"),
                false => error,
            }
        })?;
        if report.jobs_run > 0 {
            common::note(&format!(
                "{}: {} jobs run; the next retrieval reads {} at once",
                dir.display(),
                report.jobs_run,
                dir.join(COMPACT).display()
            ));
        }
        if report.compact.is_none() {
            bail!(
                "{} is not complete; run `splitsnow build {}`",
                dir.display(),
                within.display()
            );
        }
        Ok(dir)
    }
}
