//! Claims: files that replace locks where the file system does not support them. A claim
//! names the process that may write.
//!
//! A killed process leaves its claim behind. A later process on the same host sees from
//! the process id that its owner is gone, and takes over. A process on another host cannot
//! see this, and tells the user what to do. Claims are checked and created only while
//! holding the gate, a file that only one process can create.
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::Duration;

use super::{Access, StoreError, file};
use crate::host::{Process, State};

/// Prefix of the file name of a claim; [`Access::file_name`] follows.
const CLAIM: &str = ".splitsnow-held-";
/// Name of the gate, which a process holds while it checks and creates claims.
const GATE: &str = ".splitsnow-gate";
/// Pause between attempts to create the gate, and largest number of attempts.
const GATE_ATTEMPTS: (Duration, u32) = (Duration::from_millis(20), 250);

/// The claim of this process on a directory, until dropped.
#[derive(Debug)]
pub(super) struct Claim {
    path: PathBuf,
    content: Vec<u8>,
}

impl Claim {
    /// Claims `dir`.
    ///
    /// # Errors
    /// Another process holds `dir`, or a file cannot be read or written.
    pub(super) fn take(dir: &Path, access: Access) -> Result<Self, StoreError> {
        let content = content()?;
        let gate = close_gate(dir, &content)?;
        let path = dir.join(format!("{CLAIM}{}", access.file_name()));
        // The gate file becomes the claim: renaming it also opens the gate.
        let claimed = check(dir, access)
            .and_then(|()| fs::rename(&gate, &path).map_err(StoreError::io("create", &path)));
        if claimed.is_err() {
            // If the gate cannot be deleted, the next process reports it to the user.
            let _ = fs::remove_file(&gate);
        }
        claimed.map(|()| Self { path, content })
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        // The file may be the claim of another process, if the user deleted this one. If the
        // deletion fails, the claim names a process that is gone.
        if fs::read(&self.path).is_ok_and(|content| content == self.content) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Refuses `dir` if another process has a claim that excludes `access`, and deletes the
/// claims of processes that are gone.
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
                    role: format!("as process {} in", owner.process),
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
        || "an unknown process".into(),
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

/// Waits until the gate is open and closes it. Returns the gate file, which the caller must
/// delete or rename.
fn close_gate(dir: &Path, content: &[u8]) -> Result<PathBuf, StoreError> {
    let path = dir.join(GATE);
    let (pause, attempts) = GATE_ATTEMPTS;
    for _ in 0..attempts {
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
    let owner = file::read(&path)?.unwrap_or_default();
    Err(held(
        dir,
        serde_json::from_slice(&owner).ok().as_ref(),
        path,
    ))
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
