//! Who may write: one process alone, or several that hold different shards.
//! The operating system drops the locks of a process that ends in any way;
//! where the file system has none, files stand in for them ([`claim`]).
use std::fs::{self, File, TryLockError};
use std::path::Path;

use super::{StoreError, claim, file};
use crate::grid::Shard;
use crate::host::is_unsupported;

const LOCK: &str = ".splitsnow-lock";
const SHARD_LOCK: &str = ".splitsnow-lock-shard-";

/// What a process does in an output directory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Works alone.
    Exclusive,
    /// Runs one share of the jobs, beside others.
    Shard(Shard),
}

/// Held as long as this lives.
#[derive(Debug)]
pub(super) struct Lock {
    _files: Vec<File>,
    _claim: Option<claim::Claim>,
}

impl Lock {
    /// Creates `dir` if need be and takes it.
    pub(super) fn take(dir: &Path, access: Access) -> Result<Self, StoreError> {
        if dir.exists() && !dir.is_dir() {
            return Err(StoreError::NotADirectory { path: dir.into() });
        }
        file::check_links(dir)?;
        fs::create_dir_all(dir).map_err(StoreError::io("create", dir))?;
        let files = system(dir, access)?;
        let claim = match files {
            // others, or a host from before, may be without locks
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
    /// Distinguishes the files of processes that may run at the same time.
    pub(super) fn file_name(self) -> String {
        match self {
            Self::Exclusive => "alone".into(),
            Self::Shard(shard) => format!("shard-{}", shard.file_name()),
        }
    }
}

/// The operating system's locks; `None` where the file system of `dir` has none.
fn system(dir: &Path, access: Access) -> Result<Option<Vec<File>>, StoreError> {
    let whole = open(&dir.join(LOCK))?;
    match access {
        Access::Exclusive => {
            let taken = check(whole.try_lock(), dir, "in")?;
            Ok(taken.then(|| vec![whole]))
        }
        Access::Shard(shard) => {
            if !check(whole.try_lock_shared(), dir, "alone in")? {
                return Ok(None);
            }
            let part = open(&dir.join(format!("{SHARD_LOCK}{}", shard.file_name())))?;
            let taken = check(part.try_lock(), dir, &format!("on shard {shard} of"))?;
            Ok(taken.then(|| vec![whole, part]))
        }
    }
}

fn open(path: &Path) -> Result<File, StoreError> {
    let mut options = File::options();
    options.create(true).truncate(false).write(true);
    options.open(path).map_err(StoreError::io("open", path))
}

/// Whether a lock was taken; false where there are none.
fn check(outcome: Result<(), TryLockError>, dir: &Path, what: &str) -> Result<bool, StoreError> {
    match outcome {
        Ok(()) => Ok(true),
        Err(TryLockError::WouldBlock) => Err(StoreError::Busy {
            what: what.into(),
            path: dir.into(),
        }),
        Err(TryLockError::Error(error)) if is_unsupported(&error) => Ok(false),
        Err(TryLockError::Error(error)) => Err(StoreError::io("lock", dir)(error)),
    }
}

/// Deletes what shards and killed processes left. Safe only for a process
/// that is alone: shards hold the directory while they hold their lock files.
fn clean(dir: &Path) -> Result<(), StoreError> {
    let root = dir.join(super::DATABASE);
    file::remove_dir(&dir.join(file::PARTIAL))?;
    for folder in [root.join("jobs"), root] {
        file::remove_dir(&folder.join(file::PARTIAL))?;
        // None, if there is no database yet.
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
