//! The database on disk: a Zarr v3 store that is both checkpoint and result.
//!
//! ```text
//! DIR/database.zarr/
//!   zarr.json                  attributes; metadata of all arrays inline
//!   transmittance/ reflectance/ transmittance_se/ reflectance_se/
//!     zarr.json                float32 [facetness, grain_size_um, density_kg_m3,
//!     c.0.0.0.0.0.0 ...          thickness_cm, angle_deg, wavelength_nm], optional
//!                                axes before these
//!   transmittance_diffuse/ ...   the same without angle_deg, if the grid has `diffuse`
//!   facetness/ ... wavelength_nm/   float64 coordinates
//!   curve_status/              int8 [grain_size_um, thickness_cm], only if some curves do
//!                                not exist: these have 1, and NaN in all quantities
//!   jobs/lost_share/ jobs/committed/   float64 and uint64 [job]
//! DIR/.splitsnow-lock          empty; the process that holds its lock may write
//! DIR/.splitsnow-held-...      replaces the lock if the file system has no locks
//! DIR/.splitsnow-units/        finished units of jobs that are not done
//! DIR/.splitsnow-jobs/         jobs that are done, one file each, until they are packed
//! DIR/.splitsnow-runs/         journals of the processes of an unfinished build
//! DIR/.splitsnow-tables/       tables of grain events that these processes share
//! ```
//!
//! A job (see [`crate::grid::Jobs`]) is one chunk of each array. The chunks of a pack of jobs
//! share a file, a Zarr shard, which is written when all of them are done; until then each job is
//! a file of its own. Every chunk ends with its CRC-32C, and so does the index of a shard. A
//! missing chunk reads as NaN. A job is done if its commit mark matches the bytes of its chunks. A
//! truncated, corrupted, missing or foreign chunk is thus detected, and the job is run again.
//! Every byte is determined by the grid and the program alone: it never depends on time, host,
//! threads, shards or interruptions.
//!
//! Databases of version 1 have a file of each array for each job. They are read and continued as
//! they are.
mod claim;
mod description;
mod error;
mod file;
mod job;
mod layout;
mod lock;
mod packing;
mod packs;
mod read;
mod space;
mod table_directory;
mod unit_directory;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use description::{Description, Stored};
use layout::{ArrayLayout, Contents};
use lock::Lock;
pub(crate) use packing::{Packer, Survey};

use crate::atomic::resolved;
use crate::grid::{Grid, Jobs, SizeAxis};
use crate::lookup::SubstrateKind;
use crate::parameter::Axes;

pub use crate::lookup::{COMPACT, DIFFUSE, VIEWS, VIEWS_DIFFUSE};
pub use description::FORMAT_VERSION;
pub use error::StoreError;
pub(crate) use layout::WAVELENGTH;
#[cfg(feature = "netcdf")]
pub(crate) use layout::coordinate_about;
pub use lock::Access;
pub use read::Variable;
pub use space::{estimated_bytes, estimated_files};

/// Name of the database in an output directory.
const DATABASE: &str = "database.zarr";
/// Directory that file systems have in their root; ignored in an otherwise empty directory.
const SYSTEM: &str = "lost+found";
/// Folder of the journals of builds, in an output directory.
pub(crate) const JOURNALS: &str = ".splitsnow-runs";
/// Name of the file that identifies a directory as a database.
const ROOT: &str = "zarr.json";

/// An open database.
#[derive(Debug)]
pub struct Store {
    dir: PathBuf,
    root: PathBuf,
    description: Description,
    layout: ArrayLayout,
    writer: Option<Arc<file::Writer>>,
    // Declared last, so that it is dropped last: all writes happen under the lock.
    _lock: Option<Lock>,
}

impl Store {
    /// Opens the database of `grid` in `dir` for writing; creates directory and database if
    /// they do not exist. `extra` has further inputs that affect the spectra, by name, such
    /// as the hashes of the data tables.
    ///
    /// # Errors
    /// The grid is invalid or too large for the disk; or the directory is in use, cannot be
    /// written, or holds a database made from other inputs.
    pub fn build(
        dir: &Path,
        grid: &Grid,
        extra: &BTreeMap<String, String>,
        access: Access,
    ) -> Result<Self, StoreError> {
        let jobs = grid.jobs()?;
        let lock = Lock::take(dir, access)?;
        let root = dir.join(DATABASE);
        file::check_links(&root)?;
        let stored = read_stored(&root)?;
        let format = stored
            .as_ref()
            .map_or(FORMAT_VERSION, |stored| stored.identity.format());
        let requested = Description::new(grid, extra, format);
        if let Some(stored) = &stored {
            stored.identity.check_format(&root)?;
            stored.identity.check_same(&requested.identity, &root)?;
        } else {
            let views = grid.views.as_ref().map_or(0, |views| views.axes.count());
            space::check(dir, &jobs, views, jobs.count())?;
        }
        let writer = file::Writer::new(dir, access)?;
        let contents = Contents {
            axes: grid.axes.clone(),
            size_axis: grid.size_axis.clone(),
            wavelengths_nm: grid.wavelengths_nm.clone(),
            engine: grid.run.engine,
            absent: grid.absent()?,
            diffuse: grid.fixed.diffuse,
            views: grid
                .views
                .as_ref()
                .map(|views| views.axes.clone())
                .unwrap_or_default(),
            format,
        };
        let layout = ArrayLayout::new(&root, contents)?;
        let store = Self {
            dir: dir.into(),
            root,
            description: requested,
            layout,
            writer: Some(Arc::new(writer)),
            _lock: Some(lock),
        };
        if stored.is_none() {
            store.create()?;
        }
        store.repair()?;
        if access == Access::Exclusive {
            store.delete_finished_units()?;
        }
        Ok(store)
    }

    /// Whether `dir` has a database, in whatever state.
    #[must_use]
    pub fn is_at(dir: &Path) -> bool {
        dir.join(DATABASE).exists()
    }

    /// Opens the database in `dir` for reading, whatever its grid.
    ///
    /// # Errors
    /// The database does not exist, was not made by this program, has another format
    /// version, or has damaged metadata.
    pub fn open(dir: &Path) -> Result<Self, StoreError> {
        Self::open_with(dir, None)
    }

    /// Opens a database for reading, to reuse its spectra in the database of `grid` and
    /// `extra` (see [`build`](Self::build)). `path` is the database or its output directory.
    ///
    /// # Errors
    /// As [`open`](Self::open); [`StoreError::OtherNodes`] if it differs in more than the
    /// values of the axes.
    pub fn open_for_reuse(
        path: &Path,
        grid: &Grid,
        extra: &BTreeMap<String, String>,
    ) -> Result<Self, StoreError> {
        let store = if path.ends_with(DATABASE) {
            Self::open(path.parent().unwrap_or(path))?
        } else {
            Self::open(path)?
        };
        let identity = &store.description.identity;
        let requested = Description::new(grid, extra, identity.format());
        identity.check_nodes(&requested.identity, &store.root)?;
        Ok(store)
    }

    /// Checks that [`build`](Self::build) would continue this database for `grid` and
    /// `extra`.
    ///
    /// # Errors
    /// [`StoreError::Differs`] if it was made from other inputs.
    pub fn check_same(
        &self,
        grid: &Grid,
        extra: &BTreeMap<String, String>,
    ) -> Result<(), StoreError> {
        let identity = &self.description.identity;
        let requested = Description::new(grid, extra, identity.format());
        identity.check_same(&requested.identity, &self.root)
    }

    /// Like [`open`](Self::open), and prevents all other processes from writing.
    ///
    /// # Errors
    /// As [`open`](Self::open), and if the directory is in use or cannot be written.
    pub fn open_exclusive(dir: &Path) -> Result<Self, StoreError> {
        if !Self::is_at(dir) {
            return Err(StoreError::Absent { path: dir.into() });
        }
        let lock = Lock::take(dir, Access::Exclusive)?;
        Self::open_with(dir, Some(lock))
    }

    fn open_with(dir: &Path, lock: Option<Lock>) -> Result<Self, StoreError> {
        let root = dir.join(DATABASE);
        let stored = read_stored(&root)?.ok_or_else(|| StoreError::Absent { path: dir.into() })?;
        stored.identity.check_format(&root)?;
        let description = stored.describe(&root)?;
        Ok(Self {
            dir: dir.into(),
            layout: ArrayLayout::new(&root, description.contents(&root)?)?,
            root,
            description,
            writer: None,
            _lock: lock,
        })
    }

    /// Creates the empty database: completely under a temporary name, then renamed. If its
    /// directory exists already, such as the target of a link, only its root file is written,
    /// and `build` adds the rest.
    fn create(&self) -> Result<(), StoreError> {
        let writer = self.writer()?;
        if self.root.exists() {
            let mut files = self.static_files()?;
            let root = files.remove(ROOT).unwrap_or_default();
            writer.write(&self.root.join(ROOT), &root)?;
            return self.check_stored();
        }
        let scratch = writer.scratch();
        file::remove_dir(&scratch)?;
        for (path, bytes) in self.static_files()? {
            let path = scratch.join(path);
            let folder = path.parent().unwrap_or(&scratch);
            fs::create_dir_all(folder).map_err(StoreError::io("create", folder))?;
            writer.write(&path, &bytes)?;
        }
        match fs::rename(&scratch, &self.root) {
            // Another shard was first; `build` continues with its database.
            Err(_) if self.root.exists() => {
                file::remove_dir(&scratch)?;
                self.check_stored()
            }
            renamed => renamed.map_err(StoreError::io("create", &self.root)),
        }
    }

    /// Refuses the database if another process created it from other inputs.
    fn check_stored(&self) -> Result<(), StoreError> {
        let absent = || StoreError::Absent {
            path: self.dir.clone(),
        };
        let stored = read_stored(&self.root)?.ok_or_else(absent)?;
        let requested = &self.description.identity;
        stored.identity.check_same(requested, &self.root)
    }

    /// Rewrites metadata and coordinates that are missing or damaged.
    fn repair(&self) -> Result<(), StoreError> {
        let writer = self.writer()?;
        for (path, bytes) in self.static_files()? {
            let path = self.root.join(path);
            if file::read(&path)?.as_deref() != Some(&bytes) {
                if let Some(folder) = path.parent() {
                    fs::create_dir_all(folder).map_err(StoreError::io("create", folder))?;
                }
                writer.write(&path, &bytes)?;
            }
        }
        Ok(())
    }

    /// Path in the database and bytes of the metadata and coordinates.
    fn static_files(&self) -> Result<BTreeMap<String, Vec<u8>>, StoreError> {
        self.layout.static_files(self.description.attributes())
    }

    /// Checks that the disk has space for `count` more jobs.
    ///
    /// # Errors
    /// [`StoreError::TooLarge`] if it has not; [`StoreError::Io`] if the free space cannot be
    /// determined.
    pub fn check_space(&self, count: u64) -> Result<(), StoreError> {
        space::check(&self.dir, &self.layout.jobs, self.views_per_curve(), count)
    }

    /// The output directory.
    #[must_use]
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// The path of the Zarr store.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.root
    }

    /// The axes.
    #[must_use]
    pub fn axes(&self) -> &Axes {
        self.layout.axes()
    }

    /// For each grain size, the number of the thinnest thicknesses without a curve
    /// ([`Grid::absent`]), whose values are NaN. Empty if all curves exist.
    #[must_use]
    pub fn absent(&self) -> &[usize] {
        self.layout.absent()
    }

    /// The axes of the views; empty if there are none.
    #[must_use]
    pub fn views(&self) -> &Axes {
        self.layout.views()
    }

    /// Number of views per curve; 0 if there are none.
    fn views_per_curve(&self) -> u64 {
        match self.views().is_empty() {
            true => 0,
            false => self.views().count(),
        }
    }

    /// Estimated size of the finished database on disk, bytes.
    #[must_use]
    pub fn estimated_bytes(&self) -> u64 {
        estimated_bytes(self.jobs(), self.views_per_curve(), self.jobs().count())
    }

    /// Whether it has curves under diffuse light ([`Variable::is_diffuse`]).
    #[must_use]
    pub fn has_diffuse(&self) -> bool {
        self.layout.has_diffuse()
    }

    /// Wavelengths, nm.
    #[must_use]
    pub fn wavelengths_nm(&self) -> &[f64] {
        self.layout.wavelengths_nm()
    }

    /// The jobs of the database.
    #[must_use]
    pub fn jobs(&self) -> &Jobs {
        &self.layout.jobs
    }

    /// Values of the grain size axis if it is given by another measure than the size.
    #[must_use]
    pub fn size_axis(&self) -> Option<&SizeAxis> {
        self.layout.size_axis()
    }

    /// The kind of substrate under the surface layer, including the layers below.
    #[must_use]
    pub fn substrate(&self) -> SubstrateKind {
        self.description.substrate()
    }

    /// The text of a grid file that makes this database.
    #[must_use]
    pub fn config(&self) -> &str {
        &self.description.config
    }

    /// Attributes of the database: its description and its inputs.
    #[must_use]
    pub fn attributes(&self) -> serde_json::Map<String, serde_json::Value> {
        self.description.attributes()
    }

    /// The attributes as version 0.1 wrote them.
    pub(crate) fn former_attributes(&self) -> serde_json::Map<String, serde_json::Value> {
        self.description.former_attributes()
    }

    /// Deletes the journals of builds.
    ///
    /// # Errors
    /// [`StoreError::Io`] if they cannot be deleted.
    pub(crate) fn delete_journals(&self) -> Result<(), StoreError> {
        file::remove_dir(&self.dir.join(JOURNALS))
    }

    /// Simulates a disk that becomes full after `writes` more files.
    #[cfg(test)]
    pub(crate) fn fill_disk_after(&self, writes: u64) {
        if let Some(writer) = &self.writer {
            let ordering = std::sync::atomic::Ordering::Relaxed;
            writer.writes_left.store(writes, ordering);
        }
    }

    fn writer(&self) -> Result<&Arc<file::Writer>, StoreError> {
        self.writer.as_ref().ok_or_else(|| {
            let reason = std::io::ErrorKind::PermissionDenied.into();
            StoreError::io("write to the read-only database", &self.root)(reason)
        })
    }
}

/// The path of the database in the output directory `dir`; it need not exist.
#[must_use]
pub fn database(dir: &Path) -> PathBuf {
    dir.join(DATABASE)
}

/// Deletes the folders of units and of jobs if they are empty.
impl Drop for Store {
    fn drop(&mut self) {
        // With shards, another process may be about to write there.
        if self.writer.as_ref().is_some_and(|writer| writer.is_alone()) {
            for folder in [unit_directory::UNITS, job::JOBS] {
                // Fails if the folder still has files, which are kept.
                let _ = fs::remove_dir(self.dir.join(folder));
            }
        }
    }
}

/// Deletes the database in `dir` and its compact files, for a fresh start. Other files are
/// kept. Does nothing if there is no database.
///
/// # Errors
/// Another process is working in `dir`, the database was not made by this program, or a
/// file cannot be deleted.
pub fn remove(dir: &Path) -> Result<(), StoreError> {
    if !dir.exists() {
        return file::check_links(dir);
    }
    let _lock = Lock::take(dir, Access::Exclusive)?;
    let root = dir.join(DATABASE);
    if read_stored(&root)?.is_none() {
        return Ok(());
    }
    // The compact files are deleted first, so that they never outlive the database. The
    // database is renamed before it is deleted, so that a killed process leaves no part of
    // it under its name.
    file::remove_file(&resolved(&dir.join(COMPACT)))?;
    for other in [DIFFUSE, VIEWS, VIEWS_DIFFUSE] {
        file::remove_file(&resolved(&dir.join(other)))?;
    }
    let tables = table_directory::TABLES;
    for folder in [unit_directory::UNITS, job::JOBS, JOURNALS, tables] {
        file::remove_dir(&dir.join(folder))?;
    }
    let writer = file::Writer::new(dir, Access::Exclusive)?;
    let scratch = writer.scratch();
    if root.is_symlink() {
        return clear(&root);
    }
    fs::rename(&root, &scratch).map_err(StoreError::io("delete", &root))?;
    file::remove_dir(&scratch)
}

/// Deletes the contents of the database at `root`, which is a link, and keeps the link. The
/// root file is deleted last: a process killed before that leaves a valid database that
/// lacks some jobs.
fn clear(root: &Path) -> Result<(), StoreError> {
    for entry in fs::read_dir(root).map_err(StoreError::io("read", root))? {
        let path = entry.map_err(StoreError::io("read", root))?.path();
        match path.is_dir() {
            _ if path.ends_with(ROOT) || path.ends_with(SYSTEM) => {}
            true => file::remove_dir(&path)?,
            false => file::remove_file(&path)?,
        }
    }
    file::remove_file(&root.join(ROOT))
}

/// Whether the directory `root` is empty except for files of the system and partial files
/// of a process that was killed before it wrote the root file of the database.
fn is_vacant(root: &Path) -> Result<bool, StoreError> {
    for entry in fs::read_dir(root).map_err(StoreError::io("read", root))? {
        let name = entry.map_err(StoreError::io("read", root))?.file_name();
        if name != file::PARTIAL && name != SYSTEM {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Reads what the database at `root` was made from; `None` if there is no database.
///
/// # Errors
/// [`StoreError::Foreign`] if `root` was not made by this program; or it cannot be read.
fn read_stored(root: &Path) -> Result<Option<Stored>, StoreError> {
    if !root.exists() {
        return Ok(None);
    }
    match file::read(&root.join(ROOT))? {
        Some(bytes) => Stored::read(&bytes, root).map(Some),
        // The target of a link may be an empty directory that the user provides.
        None if root.is_symlink() && is_vacant(root)? => Ok(None),
        None => Err(StoreError::Foreign {
            path: root.into(),
            reason: "it has no zarr.json".into(),
        }),
    }
}
