//! Locks: either one process may write to an output directory, or several that hold
//! different shards. The operating system releases the locks of a process that ends in any
//! way. If the file system does not support locks, files replace them ([`claim`]).
use std::fs::{self, File, TryLockError};
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

use super::{StoreError, claim, file};
use crate::grid::Shard;
use crate::host::is_unsupported;

const LOCK: &str = ".splitsnow-lock";
const SHARD_LOCK: &str = ".splitsnow-lock-shard-";
/// Pause between attempts to take a lock, and number of attempts after the first.
const ATTEMPTS: (Duration, u32) = (Duration::from_millis(10), 20);

/// Access of a process to an output directory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// No other process may write.
    Exclusive,
    /// The process runs one shard of the jobs; others may run other shards.
    Shard(Shard),
}

/// The locks on an output directory; released on drop.
#[derive(Debug)]
pub(super) struct Lock {
    _files: Vec<File>,
    _claim: Option<claim::Claim>,
}

impl Lock {
    /// Locks `dir`; creates it if it does not exist.
    ///
    /// # Errors
    /// Another process holds `dir`, it is not a directory, or it cannot be created or locked.
    pub(super) fn take(dir: &Path, access: Access) -> Result<Self, StoreError> {
        if dir.exists() && !dir.is_dir() {
            return Err(StoreError::NotADirectory { path: dir.into() });
        }
        file::check_links(dir)?;
        fs::create_dir_all(dir).map_err(StoreError::io("create", dir))?;
        let files = system_locks(dir, access)?;
        let claim = match files {
            // a host on which this file system has no locks may have left a claim
            Some(_) => claim::check(dir, access).map(|()| None)?,
            None => Some(claim::Claim::take(dir, access)?),
        };
        if access == Access::Exclusive {
            clean(dir)?;
        }
        Ok(Self {
            _files: files.unwrap_or_default(),
            _claim: claim,
        })
    }
}

impl Access {
    /// Part of file names that distinguishes processes that may run at the same time.
    pub(crate) fn file_name(self) -> String {
        match self {
            Self::Exclusive => "alone".into(),
            Self::Shard(shard) => format!("shard-{}", shard.file_name()),
        }
    }
}

/// The operating system's locks; `None` if the file system of `dir` does not support them.
fn system_locks(dir: &Path, access: Access) -> Result<Option<Vec<File>>, StoreError> {
    let whole = open(&dir.join(LOCK))?;
    match access {
        Access::Exclusive => {
            let locked = try_lock(|| whole.try_lock(), dir, "in")?;
            Ok(locked.then(|| vec![whole]))
        }
        Access::Shard(shard) => {
            if !try_lock(|| whole.try_lock_shared(), dir, "alone in")? {
                return Ok(None);
            }
            let part = open(&dir.join(format!("{SHARD_LOCK}{}", shard.file_name())))?;
            let role = format!("on shard {shard} of");
            let locked = try_lock(|| part.try_lock(), dir, &role)?;
            Ok(locked.then(|| vec![whole, part]))
        }
    }
}

fn open(path: &Path) -> Result<File, StoreError> {
    let mut options = File::options();
    options.create(true).truncate(false).write(true);
    options.open(path).map_err(StoreError::io("open", path))
}

/// Whether a lock was taken; false if the file system does not support locks. `role` is
/// the role of the other process in the error message ([`StoreError::Busy`]). Tries for a moment:
/// a lock that this process has released is still held by a child that it is just starting.
fn try_lock(
    lock: impl Fn() -> Result<(), TryLockError>,
    dir: &Path,
    role: &str,
) -> Result<bool, StoreError> {
    let (pause, attempts) = ATTEMPTS;
    let is_held =
        |outcome: &Result<(), TryLockError>| matches!(outcome, Err(TryLockError::WouldBlock));
    let mut outcome = lock();
    for _ in 0..attempts {
        if !is_held(&outcome) {
            break;
        }
        sleep(pause);
        outcome = lock();
    }
    match outcome {
        Ok(()) => Ok(true),
        Err(TryLockError::WouldBlock) => Err(StoreError::Busy {
            role: role.into(),
            path: dir.into(),
        }),
        Err(TryLockError::Error(error)) if is_unsupported(&error) => Ok(false),
        Err(TryLockError::Error(error)) => Err(StoreError::io("lock", dir)(error)),
    }
}

/// Deletes the partial files and lock files that shards and killed processes left. Safe
/// only with exclusive access: a shard that holds its lock file also holds the directory.
fn clean(dir: &Path) -> Result<(), StoreError> {
    let root = dir.join(super::DATABASE);
    file::remove_dir(&dir.join(file::PARTIAL))?;
    for folder in [root.join("jobs"), root] {
        file::remove_dir(&folder.join(file::PARTIAL))?;
        // The folder does not exist if there is no database yet.
        for entry in fs::read_dir(&folder).into_iter().flatten() {
            let array = entry.map_err(StoreError::io("read", &folder))?.path();
            if array.is_dir() {
                file::remove_dir(&array.join(file::PARTIAL))?;
            }
        }
    }
    for entry in fs::read_dir(dir).map_err(StoreError::io("read", dir))? {
        let entry = entry.map_err(StoreError::io("read", dir))?;
        if entry.file_name().to_string_lossy().starts_with(SHARD_LOCK) {
            file::remove_file(&entry.path())?;
        }
    }
    Ok(())
}
