//! Atomic replacement of files.
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::host::is_unsupported;

/// Largest number of symbolic links followed; the same as that of Linux.
const MAX_LINKS: usize = 40;

/// Replaces the file at `path` by `bytes` such that at any moment, even after a power loss,
/// it has either the old or the new contents: writes a temporary file in the same directory,
/// syncs it, and renames it to `path`. A failed write leaves no temporary file, and its
/// error says whether the old file is unchanged.
///
/// A symbolic link is kept, and its target is replaced. Only one process at a time may
/// write to `path` (processes lock a database directory before they change it). A temporary
/// file of another process is thus left over from a killed process, and is deleted. If two
/// processes write nevertheless, one of them fails.
///
/// A device or a pipe is written to, not replaced. If the directory cannot be synced, the
/// file is written all the same: see [`unsynced`].
///
/// # Errors
/// The file cannot be written or renamed, or syncing its directory fails on a file system
/// that supports it.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    match fs::metadata(path) {
        Ok(metadata) if !metadata.is_file() && !metadata.is_dir() => {
            return OpenOptions::new().write(true).open(path)?.write_all(bytes);
        }
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    let path = &resolved(path);
    let directory = directory(path);
    replace(directory, path, bytes).map_err(|error| {
        let old = if path.is_file() {
            "; the old file is unchanged"
        } else {
            ""
        };
        io::Error::new(error.kind(), format!("{error}{old}"))
    })?;
    // Syncing the directory makes the rename survive a power loss; only Unix can do it.
    if cfg!(unix)
        && let Err(error) = File::open(directory).and_then(|directory| directory.sync_all())
    {
        if !is_unsupported(&error) && error.kind() != io::ErrorKind::PermissionDenied {
            let text = format!(
                "the new file is written, but its directory cannot be synced to the disk ({error}): after a power loss, the old file may reappear"
            );
            return Err(io::Error::new(error.kind(), text));
        }
        let mut unsynced = UNSYNCED.lock().unwrap_or_else(PoisonError::into_inner);
        unsynced.get_or_insert((directory.into(), error));
    }
    Ok(())
}

/// Checks that [`write`] can write a file at `path`. Writes nothing that stays.
///
/// # Errors
/// `path` is a directory, or no file can be made in its directory.
#[cfg(feature = "cli")]
pub(crate) fn check(path: &Path) -> io::Result<()> {
    match fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => {
            return Err(io::Error::new(
                io::ErrorKind::IsADirectory,
                "it is a directory",
            ));
        }
        Ok(metadata) if !metadata.is_file() => return Ok(()),
        _ => {}
    }
    let path = resolved(path);
    let temporary = temporary(directory(&path), &path)?;
    File::create_new(&temporary)?;
    fs::remove_file(temporary)
}

/// The first directory that could not be synced, with the error.
static UNSYNCED: Mutex<Option<(PathBuf, io::Error)>> = Mutex::new(None);

/// The first directory, since the last call, whose file system does not support syncing; for
/// a warning. Files in it have been written completely.
#[cfg(feature = "cli")]
pub(crate) fn unsynced() -> Option<(PathBuf, io::Error)> {
    let mut unsynced = UNSYNCED.lock().unwrap_or_else(PoisonError::into_inner);
    unsynced.take()
}

/// `path` itself or, if it is a symbolic link, its final target, which need not exist.
pub(crate) fn resolved(path: &Path) -> PathBuf {
    let mut path = path.to_path_buf();
    for _ in 0..MAX_LINKS {
        let Ok(target) = fs::read_link(&path) else {
            break;
        };
        path = directory(&path).join(target);
    }
    path
}

fn directory(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    }
}

/// Start of the names of temporary files for `path`.
fn prefix(path: &Path) -> io::Result<String> {
    let name = path
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "not a file name"))?;
    Ok(format!(".{}.tmp-", name.to_string_lossy()))
}

/// The temporary file of this process for `path` in `directory`.
fn temporary(directory: &Path, path: &Path) -> io::Result<PathBuf> {
    Ok(directory.join(format!("{}{}", prefix(path)?, std::process::id())))
}

fn replace(directory: &Path, path: &Path, bytes: &[u8]) -> io::Result<()> {
    let prefix = prefix(path)?;
    for entry in fs::read_dir(directory)? {
        let entry = entry?;
        if entry.file_name().to_string_lossy().starts_with(&prefix) {
            fs::remove_file(entry.path())?;
        }
    }
    let temporary = temporary(directory, path)?;
    let result = write_and_rename(&temporary, path, bytes);
    if result.is_err() {
        // An error of the deletion is ignored: the file may not exist.
        let _ = fs::remove_file(&temporary);
    }
    result
}

fn write_and_rename(temporary: &Path, path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = File::create_new(temporary)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    drop(file);
    fs::rename(temporary, path)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn names(directory: &Path) -> Vec<String> {
        let entries = fs::read_dir(directory).unwrap();
        let mut names: Vec<_> = entries
            .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_is_written_to_and_stays() {
        use std::os::unix::fs::FileTypeExt;
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&path).status();
        assert!(made.unwrap().success());
        let reader = std::thread::spawn({
            let path = path.clone();
            move || fs::read(path)
        });
        write(&path, b"through").unwrap();
        assert_eq!(reader.join().unwrap().unwrap(), b"through");
        assert!(fs::metadata(&path).unwrap().file_type().is_fifo());
        assert_eq!(names(directory.path()), ["pipe"]);
    }

    #[test]
    fn replaces_the_old_file_and_clears_what_a_killed_writer_left() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("file");
        fs::write(directory.path().join(".file.tmp-1"), "torn").unwrap();
        write(&path, b"old").unwrap();
        write(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names(directory.path()), ["file"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_stay_links() {
        let (directory, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let (link, inner) = (
            directory.path().join("link"),
            directory.path().join("inner"),
        );
        let target = other.path().join("target");
        std::os::unix::fs::symlink(&target, &inner).unwrap();
        std::os::unix::fs::symlink("inner", &link).unwrap();
        for bytes in [&b"first"[..], b"second"] {
            write(&link, bytes).unwrap();
            assert_eq!(fs::read(&target).unwrap(), bytes);
            assert_eq!(fs::read_link(&link).unwrap(), Path::new("inner"));
        }
        assert_eq!(names(directory.path()), ["inner", "link"]);
        assert_eq!(names(other.path()), ["target"]);
        // round in a circle
        fs::remove_file(&inner).unwrap();
        std::os::unix::fs::symlink("link", &inner).unwrap();
        assert!(write(&link, b"new").is_err());
    }

    #[test]
    fn a_failed_write_leaves_nothing() {
        let directory = tempfile::tempdir().unwrap();
        // A directory that is not empty cannot be replaced by a file.
        let path = directory.path().join("file");
        fs::create_dir(&path).unwrap();
        fs::write(path.join("inside"), "x").unwrap();
        assert!(write(&path, b"new").is_err());
        assert_eq!(names(directory.path()), ["file"]);
        assert!(write(&directory.path().join("missing/file"), b"new").is_err());
        assert!(write(Path::new("/"), b"new").is_err());
    }

    #[cfg(feature = "cli")]
    #[test]
    fn a_check_finds_what_a_write_would_and_leaves_nothing() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("file");
        check(&path).unwrap();
        write(&path, b"old").unwrap();
        check(&path).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert!(check(directory.path()).is_err());
        assert!(check(&directory.path().join("missing/file")).is_err());
        assert!(check(&path.join("inside")).is_err());
        assert_eq!(names(directory.path()), ["file"]);
    }
}
