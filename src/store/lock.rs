//! Who may write: one process alone, or several that hold different shards.
//! The operating system drops the locks of a process that ends in any way.
use std::fs::{self, File, TryLockError};
use std::path::Path;

use super::{StoreError, file};
use crate::grid::Shard;

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
}

impl Lock {
    /// Creates `dir` if need be and takes it.
    pub(super) fn take(dir: &Path, access: Access) -> Result<Self, StoreError> {
        if dir.exists() && !dir.is_dir() {
            return Err(StoreError::NotADirectory { path: dir.into() });
        }
        fs::create_dir_all(dir).map_err(StoreError::io("create", dir))?;
        let whole = open(&dir.join(LOCK))?;
        match access {
            Access::Exclusive => {
                check(whole.try_lock(), dir, "in")?;
                clean(dir)?;
                Ok(Self {
                    _files: vec![whole],
                })
            }
            Access::Shard(shard) => {
                check(whole.try_lock_shared(), dir, "alone in")?;
                let part = open(&dir.join(format!("{SHARD_LOCK}{}", shard.file_name())))?;
                check(part.try_lock(), dir, &format!("on shard {shard} of"))?;
                Ok(Self {
                    _files: vec![whole, part],
                })
            }
        }
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

fn open(path: &Path) -> Result<File, StoreError> {
    let mut options = File::options();
    options.create(true).truncate(false).write(true);
    options.open(path).map_err(StoreError::io("open", path))
}

fn check(outcome: Result<(), TryLockError>, dir: &Path, what: &str) -> Result<(), StoreError> {
    outcome.map_err(|error| match error {
        TryLockError::WouldBlock => StoreError::Busy {
            what: what.into(),
            path: dir.into(),
        },
        TryLockError::Error(error) => StoreError::io("lock", dir)(error),
    })
}

/// Deletes what shards and killed processes left. Safe only for a process
/// that is alone: shards hold the directory while they hold their lock files.
fn clean(dir: &Path) -> Result<(), StoreError> {
    file::remove_dir(&dir.join(file::PARTIAL))?;
    for entry in fs::read_dir(dir).map_err(StoreError::io("read", dir))? {
        let entry = entry.map_err(StoreError::io("read", dir))?;
        if entry.file_name().to_string_lossy().starts_with(SHARD_LOCK) {
            file::remove_file(&entry.path())?;
        }
    }
    Ok(())
}
