//! Whole files only: written under another name, flushed to the disk, then
//! renamed. A process killed at any moment leaves either no file or all of it.
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use super::{Access, StoreError};

/// Folder beside the database for files being written. Never read: what is
/// left in it by a killed process is deleted by the next one that has the
/// directory for itself.
pub(super) const PARTIAL: &str = ".splitsnow-partial";

/// Writes whole files into the database.
#[derive(Debug)]
pub(super) struct Writer {
    partial: PathBuf,
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
            owner,
            next: AtomicU64::new(0),
            #[cfg(test)]
            writes_left: AtomicU64::new(u64::MAX),
        })
    }

    /// A path no other live writer uses.
    pub(super) fn scratch(&self) -> PathBuf {
        let n = self.next.fetch_add(1, Ordering::Relaxed);
        self.partial.join(format!("{}-{n}", self.owner.file_name()))
    }

    /// Makes `target` hold exactly `bytes`, or leaves it as it was.
    pub(super) fn write(&self, target: &Path, bytes: &[u8]) -> Result<(), StoreError> {
        let scratch = self.scratch();
        let written = self
            .flush(&scratch, bytes)
            .and_then(|()| fs::rename(&scratch, target));
        written.map_err(|error| {
            // Best effort: a leftover is deleted at the next start anyway.
            let _ = fs::remove_file(&scratch);
            StoreError::io("write", target)(error)
        })
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
        if self.owner == Access::Exclusive {
            // What a failed deletion leaves is deleted at the next start.
            let _ = fs::remove_dir_all(&self.partial);
        }
    }
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
