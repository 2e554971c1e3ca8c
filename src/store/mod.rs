//! The database on disk: a Zarr v3 store that is checkpoint and result in one.
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
//!   curve_status/              int8 [grain_size_um, thickness_cm], if there are curves
//!                                that do not exist: 1, and NaN in all quantities
//!   jobs/lost_share/ jobs/committed/   float64 and uint64 [job]
//! DIR/.splitsnow-lock          empty; who holds its lock may write
//! DIR/.splitsnow-units/        what is finished of jobs that are not done
//! DIR/.splitsnow-held-...      instead, where the file system has no locks
//! ```
//!
//! One chunk is one job (see [`crate::grid::Jobs`]); every chunk ends in
//! its CRC-32C. A chunk that is not there reads as NaN. A job is done when its
//! mark in `jobs/committed` agrees with the bytes of its five chunks: torn,
//! flipped, missing or foreign ones are found, and the job is run again.
//! Every byte follows from the grid and the program alone: never from time,
//! host, threads, shards, or what interrupted the work.
mod claim;
mod description;
mod error;
mod file;
mod job;
mod layout;
mod lock;
mod read;
mod space;
mod unit_directory;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use description::Description;
use layout::{Contents, Layout};
use lock::Lock;

use crate::atomic::resolved;
use crate::grid::{GivenSizes, Grid, Jobs};
use crate::lookup::SubstrateKind;
use crate::parameter::Axes;

pub use crate::lookup::COMPACT;
pub use description::FORMAT_VERSION;
pub use error::StoreError;
pub(crate) use layout::WAVELENGTH;
#[cfg(feature = "netcdf")]
pub(crate) use layout::coordinate_about;
pub use lock::Access;
pub use read::Variable;
pub use space::estimated_bytes;

/// The database in an output directory.
const DATABASE: &str = "database.zarr";
/// What a disk may have in its uppermost directory.
const SYSTEM: &str = "lost+found";
/// The file that makes a directory a database.
const ROOT: &str = "zarr.json";
/// The compact file of its curves under isotropic light, if it has such.
pub const DIFFUSE: &str = "diffuse.safetensors";

/// An open database.
#[derive(Debug)]
pub struct Store {
    dir: PathBuf,
    root: PathBuf,
    description: Description,
    layout: Layout,
    writer: Option<Arc<file::Writer>>,
    // Dropped last: nothing is written without it.
    _lock: Option<Lock>,
}

impl Store {
    /// Opens the database of `grid` in `dir` for writing; makes both if need
    /// be. `extra` are further inputs that decide its values, such as the
    /// hashes of the data tables, by name.
    ///
    /// # Errors
    /// The grid is impossible or larger than the disk; the directory is in
    /// use, cannot be written, or holds a database made from other inputs.
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
        let asked = Description::new(grid, extra);
        let stored = stored(&root)?;
        if let Some(stored) = &stored {
            stored.check_same(&asked, &root)?;
        } else {
            space::check(dir, &jobs, jobs.count())?;
        }
        let writer = file::Writer::new(dir, access)?;
        let contents = Contents {
            axes: grid.axes.clone(),
            given_sizes: grid.given_sizes.clone(),
            wavelengths_nm: grid.wavelengths_nm.clone(),
            engine: grid.run.engine,
            absent: grid.absent()?,
            diffuse: grid.fixed.diffuse,
        };
        let layout = Layout::new(&root, contents)?;
        let store = Self {
            dir: dir.into(),
            root,
            description: asked,
            layout,
            writer: Some(Arc::new(writer)),
            _lock: Some(lock),
        };
        if stored.is_none() {
            store.create()?;
        }
        store.mend()?;
        if access == Access::Exclusive {
            store.forget_done()?;
        }
        Ok(store)
    }

    /// Whether there is a database in `dir`, whatever its state.
    #[must_use]
    pub fn is_at(dir: &Path) -> bool {
        dir.join(DATABASE).exists()
    }

    /// Opens the database in `dir` for reading, whatever grid made it.
    ///
    /// # Errors
    /// There is none, it is not ours, of another format, or its metadata are
    /// damaged.
    pub fn open(dir: &Path) -> Result<Self, StoreError> {
        Self::open_with(dir, None)
    }

    /// Opens the database in `path`, or that is `path`, to take spectra over into
    /// one of `grid` and `extra` (see [`build`](Self::build)).
    ///
    /// # Errors
    /// As [`open`](Self::open); it differs in more than the values of axes.
    pub fn open_source(
        path: &Path,
        grid: &Grid,
        extra: &BTreeMap<String, String>,
    ) -> Result<Self, StoreError> {
        let store = if path.ends_with(DATABASE) {
            Self::open(path.parent().unwrap_or(path))?
        } else {
            Self::open(path)?
        };
        let asked = Description::new(grid, extra);
        store.description.check_nodes(&asked, &store.root)?;
        Ok(store)
    }

    /// Refuses if [`build`](Self::build) would refuse to go on with this
    /// database for `grid` and `extra`.
    ///
    /// # Errors
    /// It was made from other inputs.
    pub fn check_same(
        &self,
        grid: &Grid,
        extra: &BTreeMap<String, String>,
    ) -> Result<(), StoreError> {
        let asked = Description::new(grid, extra);
        self.description.check_same(&asked, &self.root)
    }

    /// Like [`open`](Self::open), and keeps all other processes from writing.
    ///
    /// # Errors
    /// As `open`; the directory is in use or cannot be written.
    pub fn open_exclusive(dir: &Path) -> Result<Self, StoreError> {
        if !Self::is_at(dir) {
            return Err(StoreError::Absent { path: dir.into() });
        }
        let lock = Lock::take(dir, Access::Exclusive)?;
        Self::open_with(dir, Some(lock))
    }

    fn open_with(dir: &Path, lock: Option<Lock>) -> Result<Self, StoreError> {
        let root = dir.join(DATABASE);
        let description = stored(&root)?.ok_or_else(|| StoreError::Absent { path: dir.into() })?;
        description.check_format(&root)?;
        Ok(Self {
            dir: dir.into(),
            layout: Layout::new(&root, description.contents(&root)?)?,
            root,
            description,
            writer: None,
            _lock: lock,
        })
    }

    /// Makes the empty database: complete under another name, then renamed; or,
    /// in a directory that is there, such as the target of a link, its root, to
    /// which `build` adds the rest.
    fn create(&self) -> Result<(), StoreError> {
        let writer = self.writer()?;
        if self.root.exists() {
            let mut files = self.layout.static_files(&self.description)?;
            let root = files.remove(ROOT).unwrap_or_default();
            writer.write(&self.root.join(ROOT), &root)?;
            return self.check_stored();
        }
        let scratch = writer.scratch();
        file::remove_dir(&scratch)?;
        for (path, bytes) in self.layout.static_files(&self.description)? {
            let path = scratch.join(path);
            let folder = path.parent().unwrap_or(&scratch);
            fs::create_dir_all(folder).map_err(StoreError::io("create", folder))?;
            writer.write(&path, &bytes)?;
        }
        match fs::rename(&scratch, &self.root) {
            // Another shard was first; `build` goes on with what it made.
            Err(_) if self.root.exists() => {
                file::remove_dir(&scratch)?;
                self.check_stored()
            }
            renamed => renamed.map_err(StoreError::io("create", &self.root)),
        }
    }

    /// Refuses if another process made another database.
    fn check_stored(&self) -> Result<(), StoreError> {
        let absent = || StoreError::Absent {
            path: self.dir.clone(),
        };
        let stored = stored(&self.root)?.ok_or_else(absent)?;
        stored.check_same(&self.description, &self.root)
    }

    /// Writes metadata and coordinates anew where they are not what they must be.
    fn mend(&self) -> Result<(), StoreError> {
        let writer = self.writer()?;
        for (path, bytes) in self.layout.static_files(&self.description)? {
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

    /// Refuses to go on if the disk cannot hold `count` more jobs.
    ///
    /// # Errors
    /// It cannot, or its free space cannot be measured.
    pub fn check_space(&self, count: u64) -> Result<(), StoreError> {
        space::check(&self.dir, &self.layout.jobs, count)
    }

    /// The output directory.
    #[must_use]
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// The Zarr store in it.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.root
    }

    /// The axes.
    #[must_use]
    pub fn axes(&self) -> &Axes {
        self.layout.axes()
    }

    /// For each grain size, how many of the thinnest thicknesses have no curve
    /// ([`Grid::absent`]): they are NaN. Empty if all have.
    #[must_use]
    pub fn absent(&self) -> &[usize] {
        self.layout.absent()
    }

    /// Whether it holds curves under isotropic light ([`Variable::DIFFUSE`]), too.
    #[must_use]
    pub fn has_diffuse(&self) -> bool {
        self.layout.has_diffuse()
    }

    /// Wavelengths, nm.
    #[must_use]
    pub fn wavelengths_nm(&self) -> &[f64] {
        self.layout.wavelengths_nm()
    }

    /// The jobs it is made of.
    #[must_use]
    pub fn jobs(&self) -> &Jobs {
        &self.layout.jobs
    }

    /// By what the grain sizes were given, if not as such.
    #[must_use]
    pub fn given_sizes(&self) -> Option<&GivenSizes> {
        self.layout.given_sizes()
    }

    /// What lies under the snow of the axes.
    #[must_use]
    pub fn substrate(&self) -> SubstrateKind {
        self.description.substrate()
    }

    /// The text of a grid file that makes this database.
    #[must_use]
    pub fn config(&self) -> &str {
        &self.description.config
    }

    /// Attributes of the database: what it is, and from what it was made.
    #[must_use]
    pub fn attributes(&self) -> serde_json::Map<String, serde_json::Value> {
        self.description.attributes()
    }

    /// Lets the disk fill up after `writes` more files.
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
            StoreError::io("write, it is open for reading only:", &self.root)(reason)
        })
    }
}

/// The database in the output directory `dir`, if there is one.
#[must_use]
pub fn database(dir: &Path) -> PathBuf {
    dir.join(DATABASE)
}

/// Once no job is half done, there is no folder for their units.
impl Drop for Store {
    fn drop(&mut self) {
        // Another shard may be about to write there.
        if self.writer.as_ref().is_some_and(|writer| writer.is_alone()) {
            // It fails where there are some, which stay.
            let _ = fs::remove_dir(self.dir.join(unit_directory::UNITS));
        }
    }
}

/// Deletes the database in `dir` and the compact file made from it, for a
/// fresh start. Nothing else is touched. It is no error if there is none.
///
/// # Errors
/// Another process is at work there, what is there was not made by this
/// program, or it cannot be deleted.
pub fn remove(dir: &Path) -> Result<(), StoreError> {
    if !dir.exists() {
        return file::check_links(dir);
    }
    let _lock = Lock::take(dir, Access::Exclusive)?;
    let root = dir.join(DATABASE);
    if stored(&root)?.is_none() {
        return Ok(());
    }
    // The file made from the database never outlives it, and the database is
    // out of the way at once: a kill leaves no half of it.
    file::remove_file(&resolved(&dir.join(COMPACT)))?;
    file::remove_file(&resolved(&dir.join(DIFFUSE)))?;
    file::remove_dir(&dir.join(unit_directory::UNITS))?;
    let writer = file::Writer::new(dir, Access::Exclusive)?;
    let scratch = writer.scratch();
    if root.is_symlink() {
        return empty(&root);
    }
    fs::rename(&root, &scratch).map_err(StoreError::io("delete", &root))?;
    file::remove_dir(&scratch)
}

/// Deletes what is in the database at `root`, a link, which stays. Its root goes
/// last: before that, a kill leaves a database that
/// lacks some jobs.
fn empty(root: &Path) -> Result<(), StoreError> {
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

/// Whether the directory `root` holds nothing but what the system put there, or
/// a process that was killed before it wrote the database's root.
fn is_vacant(root: &Path) -> Result<bool, StoreError> {
    for entry in fs::read_dir(root).map_err(StoreError::io("read", root))? {
        let name = entry.map_err(StoreError::io("read", root))?.file_name();
        if name != file::PARTIAL && name != SYSTEM {
            return Ok(false);
        }
    }
    Ok(true)
}

/// What the database at `root` was made from; `None` if there is none.
fn stored(root: &Path) -> Result<Option<Description>, StoreError> {
    if !root.exists() {
        return Ok(None);
    }
    match file::read(&root.join(ROOT))? {
        Some(bytes) => Description::read(&bytes, root).map(Some),
        // A link is where the user wants it.
        None if root.is_symlink() && is_vacant(root)? => Ok(None),
        None => Err(StoreError::Foreign {
            path: root.into(),
            reason: "it has no zarr.json".into(),
        }),
    }
}
