//! Atomic writing of files: each is written under a temporary name, flushed to the disk
//! and then renamed. A process killed at any moment leaves either no file or all of it.
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use super::{Access, StoreError};
use crate::atomic::resolved;

/// Folder for files that are being written. It is next to the database or, if the database
/// is on another file system, in the folder of the target. It is never read; the next
/// process with exclusive access deletes files that a killed process left in it.
pub(super) const PARTIAL: &str = ".splitsnow-partial";

/// Writes files of the database atomically.
#[derive(Debug)]
pub(super) struct Writer {
    partial: PathBuf,
    /// Folders on another file system than `partial`, to which files cannot be renamed.
    other_device: Mutex<BTreeSet<PathBuf>>,
    /// Access of this process; unique among live processes, which hold the lock for it.
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
            other_device: Mutex::default(),
            owner,
            next: AtomicU64::new(0),
            #[cfg(test)]
            writes_left: AtomicU64::new(u64::MAX),
        })
    }

    /// Whether this process has exclusive access to the directory.
    pub(super) fn is_alone(&self) -> bool {
        self.owner == Access::Exclusive
    }

    /// A new path in the folder for partial files that no other live writer uses.
    pub(super) fn scratch(&self) -> PathBuf {
        self.scratch_in(&self.partial)
    }

    fn scratch_in(&self, partial: &Path) -> PathBuf {
        let n = self.next.fetch_add(1, Ordering::Relaxed);
        partial.join(format!("{}-{n}", self.owner.file_name()))
    }

    /// Replaces the contents of `target` by `bytes`; on error, `target` is unchanged.
    pub(super) fn write(&self, target: &Path, bytes: &[u8]) -> Result<(), StoreError> {
        self.replace(target, bytes, true)
    }

    /// As [`write`](Self::write), but after a power loss the file may be damaged: for files that
    /// are checked when they are read, and may be lost.
    pub(super) fn write_unflushed(&self, target: &Path, bytes: &[u8]) -> Result<(), StoreError> {
        self.replace(target, bytes, false)
    }

    fn replace(&self, target: &Path, bytes: &[u8], flushed: bool) -> Result<(), StoreError> {
        let folder = target.parent().unwrap_or(target);
        let other_device = || {
            let folders = self.other_device.lock();
            folders.unwrap_or_else(PoisonError::into_inner)
        };
        let write_by = |scratch: &Path, target: &Path| {
            let written = self.create(scratch, bytes, flushed);
            let written = written.and_then(|()| fs::rename(scratch, target));
            if written.is_err() {
                // Best effort: the next start deletes leftover files.
                let _ = fs::remove_file(scratch);
            }
            written
        };
        if !other_device().contains(folder) {
            match write_by(&self.scratch(), target) {
                Err(error) if error.kind() == io::ErrorKind::CrossesDevices => {}
                written => return written.map_err(StoreError::io("write", target)),
            }
            other_device().insert(folder.into());
        }
        let partial = folder.join(PARTIAL);
        fs::create_dir_all(&partial).map_err(StoreError::io("create", &partial))?;
        write_by(&self.scratch_in(&partial), target).map_err(StoreError::io("write", target))
    }

    fn create(&self, path: &Path, bytes: &[u8], flushed: bool) -> io::Result<()> {
        #[cfg(test)]
        if self.writes_left.fetch_sub(1, Ordering::Relaxed) == 0 {
            self.writes_left.store(0, Ordering::Relaxed);
            fs::write(path, bytes.get(..bytes.len() / 2).unwrap_or_default())?;
            return Err(io::ErrorKind::StorageFull.into());
        }
        let mut file = File::create(path)?;
        file.write_all(bytes)?;
        if flushed {
            file.sync_all()?;
        }
        Ok(())
    }
}

/// Deletes the folders for partial files if this process has exclusive access; otherwise
/// another shard may be using them.
impl Drop for Writer {
    fn drop(&mut self) {
        if self.is_alone() {
            let folders = self.other_device.get_mut();
            let folders = folders.unwrap_or_else(PoisonError::into_inner);
            // Best effort: the next start deletes leftover folders.
            let _ = fs::remove_dir_all(&self.partial);
            for folder in folders.iter() {
                let _ = fs::remove_dir_all(folder.join(PARTIAL));
            }
        }
    }
}

/// Refuses `path` if it, or a directory that contains it, is a symbolic link whose target
/// does not exist. The system's own error for such a path does not name the cause.
pub(super) fn check_links(path: &Path) -> Result<(), StoreError> {
    for part in path.ancestors() {
        let is_link = fs::symlink_metadata(part).is_ok_and(|metadata| metadata.is_symlink());
        if is_link && !part.exists() {
            return Err(StoreError::Dangling {
                path: part.into(),
                target: resolved(part),
            });
        }
    }
    Ok(())
}

/// The bytes of a file; `None` if it does not exist.
pub(super) fn read(path: &Path) -> Result<Option<Vec<u8>>, StoreError> {
    match fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(StoreError::io("read", path)(error)),
    }
}

/// Deletes a folder with its contents; it need not exist.
pub(super) fn remove_dir(path: &Path) -> Result<(), StoreError> {
    match fs::remove_dir_all(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(StoreError::io("delete", path)(error))
        }
        _ => Ok(()),
    }
}

/// Deletes a file; it need not exist.
pub(super) fn remove_file(path: &Path) -> Result<(), StoreError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(StoreError::io("delete", path)(error))
        }
        _ => Ok(()),
    }
}
