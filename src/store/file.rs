//! Whole files only: written under another name, flushed to the disk, then
//! renamed. A process killed at any moment leaves either no file or all of it.
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use super::{Access, StoreError};
use crate::atomic::resolved;

/// Folder for files being written, beside the database or, where that is on
/// another file system, in the folder they belong to. Never read: what is
/// left in it by a killed process is deleted by the next one that has the
/// directory for itself.
pub(super) const PARTIAL: &str = ".splitsnow-partial";

/// Writes whole files into the database.
#[derive(Debug)]
pub(super) struct Writer {
    partial: PathBuf,
    /// Folders to which nothing can be renamed from there.
    across: Mutex<BTreeSet<PathBuf>>,
    /// Unique among live processes, since each holds the lock it names.
    owner: Access,
    next: AtomicU64,
    #[cfg(test)]
    pub(super) writes_left: AtomicU64,
}

impl Writer {
    pub(super) fn new(dir: &Path, owner: Access) -> Result<Self, StoreError> {
        let partial = dir.join(PARTIAL);
        fs::create_dir_all(&partial).map_err(StoreError::io("create", &partial))?;
        Ok(Self {
            partial,
            across: Mutex::default(),
            owner,
            next: AtomicU64::new(0),
            #[cfg(test)]
            writes_left: AtomicU64::new(u64::MAX),
        })
    }

    /// Whether no other process writes there.
    pub(super) fn is_alone(&self) -> bool {
        self.owner == Access::Exclusive
    }

    /// A path no other live writer uses.
    pub(super) fn scratch(&self) -> PathBuf {
        self.scratch_in(&self.partial)
    }

    fn scratch_in(&self, partial: &Path) -> PathBuf {
        let n = self.next.fetch_add(1, Ordering::Relaxed);
        partial.join(format!("{}-{n}", self.owner.file_name()))
    }

    /// Makes `target` hold exactly `bytes`, or leaves it as it was.
    pub(super) fn write(&self, target: &Path, bytes: &[u8]) -> Result<(), StoreError> {
        let folder = target.parent().unwrap_or(target);
        let across = || self.across.lock().unwrap_or_else(PoisonError::into_inner);
        if !across().contains(folder) {
            match self.write_by(&self.scratch(), target, bytes) {
                Err(error) if error.kind() == io::ErrorKind::CrossesDevices => {}
                written => return written.map_err(StoreError::io("write", target)),
            }
            across().insert(folder.into());
        }
        let partial = folder.join(PARTIAL);
        fs::create_dir_all(&partial).map_err(StoreError::io("create", &partial))?;
        self.write_by(&self.scratch_in(&partial), target, bytes)
            .map_err(StoreError::io("write", target))
    }

    fn write_by(&self, scratch: &Path, target: &Path, bytes: &[u8]) -> io::Result<()> {
        let written = self
            .flush(scratch, bytes)
            .and_then(|()| fs::rename(scratch, target));
        if written.is_err() {
            // Best effort: a leftover is deleted at the next start anyway.
            let _ = fs::remove_file(scratch);
        }
        written
    }

    fn flush(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        #[cfg(test)]
        if self.writes_left.fetch_sub(1, Ordering::Relaxed) == 0 {
            self.writes_left.store(0, Ordering::Relaxed);
            fs::write(path, bytes.get(..bytes.len() / 2).unwrap_or_default())?;
            return Err(io::ErrorKind::StorageFull.into());
        }
        let mut file = File::create(path)?;
        file.write_all(bytes)?;
        file.sync_all()
    }
}

/// A process that was alone leaves no folder behind; a shard's may be in use.
impl Drop for Writer {
    fn drop(&mut self) {
        if self.is_alone() {
            let across = self.across.get_mut();
            let across = across.unwrap_or_else(PoisonError::into_inner);
            // What a failed deletion leaves is deleted at the next start.
            let _ = fs::remove_dir_all(&self.partial);
            for folder in across.iter() {
                let _ = fs::remove_dir_all(folder.join(PARTIAL));
            }
        }
    }
}

/// Refuses `path` if it, or what it lies in, is a symbolic link to nothing: what
/// the system says of such a path tells nobody what is wrong.
pub(super) fn check_links(path: &Path) -> Result<(), StoreError> {
    for part in path.ancestors() {
        let is_link = fs::symlink_metadata(part).is_ok_and(|there| there.is_symlink());
        if is_link && !part.exists() {
            return Err(StoreError::Dangling {
                path: part.into(),
                target: resolved(part),
            });
        }
    }
    Ok(())
}

/// The bytes of a file, `None` if there is none.
pub(super) fn read(path: &Path) -> Result<Option<Vec<u8>>, StoreError> {
    match fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(StoreError::io("read", path)(error)),
    }
}

/// Deletes a folder and all in it; it may be absent.
pub(super) fn remove_dir(path: &Path) -> Result<(), StoreError> {
    match fs::remove_dir_all(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(StoreError::io("delete", path)(error))
        }
        _ => Ok(()),
    }
}

/// Deletes a file; it may be absent.
pub(super) fn remove_file(path: &Path) -> Result<(), StoreError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(StoreError::io("delete", path)(error))
        }
        _ => Ok(()),
    }
}
