//! Who may write, where the file system has no locks: a file says which process.
//!
//! Nothing takes the file of a killed process away, so it names host and process:
//! the next one on the same host sees that it is gone and takes over; one on
//! another host cannot see, and says what to do. Files are looked at and made
//! behind a gate: a file that only one process can create.
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::Duration;

use super::{Access, StoreError, file};
use crate::host::{Process, State};

/// Begins the name of the file of a process; its access ends it.
const CLAIM: &str = ".splitsnow-held-";
/// Held for a moment by whoever looks at the others.
const GATE: &str = ".splitsnow-gate";
/// How long and how often the gate is waited for.
const PATIENCE: (Duration, u32) = (Duration::from_millis(20), 250);

/// A directory that this process holds, until dropped.
#[derive(Debug)]
pub(super) struct Claim {
    path: PathBuf,
    content: Vec<u8>,
}

impl Claim {
    pub(super) fn take(dir: &Path, access: Access) -> Result<Self, StoreError> {
        let content = content()?;
        let gate = pass(dir, &content)?;
        let path = dir.join(format!("{CLAIM}{}", access.file_name()));
        // The gate opens as its file, which is whole, takes the other name.
        let taken = check(dir, access)
            .and_then(|()| fs::rename(&gate, &path).map_err(StoreError::io("create", &path)));
        if taken.is_err() {
            // What cannot be deleted is told to the next process, with what to do.
            let _ = fs::remove_file(&gate);
        }
        taken.map(|()| Self { path, content })
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        // Another's, if the user took this one's away; and what cannot be
        // deleted names a process that is gone.
        if fs::read(&self.path).is_ok_and(|content| content == self.content) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Refuses if a process that stands in the way of `access` holds `dir`; takes
/// away what those left that are gone.
pub(super) fn check(dir: &Path, access: Access) -> Result<(), StoreError> {
    for entry in fs::read_dir(dir).map_err(StoreError::io("read", dir))? {
        let entry = entry.map_err(StoreError::io("read", dir))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let Some(other) = name.strip_prefix(CLAIM) else {
            continue;
        };
        let own = access.file_name();
        if access != Access::Exclusive
            && ![Access::Exclusive.file_name(), own].contains(&other.into())
        {
            continue;
        }
        let path = entry.path();
        let Some(content) = file::read(&path)? else {
            continue;
        };
        let Ok(owner) = serde_json::from_slice::<Process>(&content) else {
            return Err(held(dir, None, path));
        };
        match owner.state() {
            State::Gone => file::remove_file(&path)?,
            State::Running => {
                return Err(StoreError::Busy {
                    what: format!("as process {} in", owner.process),
                    path: dir.into(),
                });
            }
            State::Elsewhere => return Err(held(dir, Some(&owner), path)),
        }
    }
    Ok(())
}

fn held(dir: &Path, owner: Option<&Process>, file: PathBuf) -> StoreError {
    let owner = owner.map_or_else(
        || "a process unknown".into(),
        |owner| format!("process {} on host {:?}", owner.process, owner.host),
    );
    StoreError::Held {
        path: dir.into(),
        owner,
        file,
    }
}

fn content() -> Result<Vec<u8>, StoreError> {
    let mut content =
        serde_json::to_vec_pretty(&Process::this()).map_err(StoreError::zarr("a lock file"))?;
    content.push(b'\n');
    Ok(content)
}

/// Waits for the gate and closes it: its file, which the caller has to remove.
fn pass(dir: &Path, content: &[u8]) -> Result<PathBuf, StoreError> {
    let path = dir.join(GATE);
    let (pause, times) = PATIENCE;
    for _ in 0..times {
        match File::create_new(&path) {
            Ok(mut file) => {
                return match file.write_all(content) {
                    Ok(()) => Ok(path),
                    Err(error) => {
                        let _ = fs::remove_file(&path);
                        Err(StoreError::io("write", &path)(error))
                    }
                };
            }
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => sleep(pause),
            Err(error) => return Err(StoreError::io("create", &path)(error)),
        }
    }
    let left = file::read(&path)?.unwrap_or_default();
    Err(held(dir, serde_json::from_slice(&left).ok().as_ref(), path))
}

#[cfg(all(test, unix))]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::grid::Shard;

    fn shard(index: u64) -> Access {
        Access::Shard(Shard::new(index, 2).unwrap())
    }

    #[test]
    fn claims_exclude_each_other_as_locks_do() {
        let dir = tempfile::tempdir().unwrap();
        let take = |access| Claim::take(dir.path(), access);
        let alone = take(Access::Exclusive).unwrap();
        for access in [Access::Exclusive, shard(0)] {
            let refused = take(access).unwrap_err().to_string();
            assert!(refused.contains("is working as process "), "{refused}");
            assert!(check(dir.path(), access).is_err());
        }
        drop(alone);
        let shards = [shard(0), shard(1)].map(|shard| take(shard).unwrap());
        assert!(take(shard(1)).is_err());
        assert!(take(Access::Exclusive).is_err());
        drop(shards);
        drop(take(Access::Exclusive).unwrap());
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
    }

    #[test]
    fn only_one_of_many_gets_it() {
        let dir = tempfile::tempdir().unwrap();
        let claims: Vec<_> = std::thread::scope(|scope| {
            let take = || Claim::take(dir.path(), Access::Exclusive);
            let all: Vec<_> = (0..8).map(|_| scope.spawn(take)).collect();
            all.into_iter().map(|one| one.join().unwrap()).collect()
        });
        assert_eq!(claims.iter().filter(|claim| claim.is_ok()).count(), 1);
    }
}
