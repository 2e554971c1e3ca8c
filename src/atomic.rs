//! Replaces a file as a whole.
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::host::is_unsupported;

/// Symbolic links followed, at most, as by the operating system.
const LINKS: usize = 40;

/// Writes `bytes` to `path` so that at any moment, power loss included, the
/// file is the old one or the new one: a temporary file in the same directory
/// is synced and renamed over it. A failed write leaves no temporary file, and
/// its error says what became of the old one.
///
/// A symbolic link stays one: what it points to is written, in its own
/// directory. One process at a time writes `path` (a database directory is
/// locked by whoever changes it), so a temporary file of another one is what a
/// killed process left: it is removed. Should two write after all, one fails.
///
/// A device or a pipe is written to, not replaced. Where directories cannot be
/// synced, the file is in place all the same: see [`unsynced`].
pub(crate) fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    match fs::metadata(path) {
        Ok(there) if !there.is_file() && !there.is_dir() => {
            return OpenOptions::new().write(true).open(path)?.write_all(bytes);
        }
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    let path = &resolved(path);
    let directory = directory(path);
    replace(directory, path, bytes).map_err(|error| {
        let old = if path.is_file() {
            "; the old file is untouched"
        } else {
            ""
        };
        io::Error::new(error.kind(), format!("{error}{old}"))
    })?;
    // The rename itself must survive a power loss; only Unix can sync a directory.
    if cfg!(unix)
        && let Err(error) = File::open(directory).and_then(|directory| directory.sync_all())
    {
        if !is_unsupported(&error) && error.kind() != io::ErrorKind::PermissionDenied {
            let text = format!(
                "the new file is in place, but its directory cannot be synced to the disk ({error}): a power loss may still bring the old one back"
            );
            return Err(io::Error::new(error.kind(), text));
        }
        let mut unsynced = UNSYNCED.lock().unwrap_or_else(PoisonError::into_inner);
        unsynced.get_or_insert((directory.into(), error));
    }
    Ok(())
}

static UNSYNCED: Mutex<Option<(PathBuf, io::Error)>> = Mutex::new(None);

/// The first directory, since this was asked last, that cannot be synced where
/// it lies: for a warning. Files written there are whole and in place.
#[cfg(feature = "cli")]
pub(crate) fn unsynced() -> Option<(PathBuf, io::Error)> {
    let mut unsynced = UNSYNCED.lock().unwrap_or_else(PoisonError::into_inner);
    unsynced.take()
}

/// `path`, or where it points as a symbolic link, whether that is there or not.
pub(crate) fn resolved(path: &Path) -> PathBuf {
    let mut path = path.to_path_buf();
    for _ in 0..LINKS {
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

fn replace(directory: &Path, path: &Path, bytes: &[u8]) -> io::Result<()> {
    let name = path
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "not a file name"))?;
    let prefix = format!(".{}.tmp-", name.to_string_lossy());
    for entry in fs::read_dir(directory)? {
        let entry = entry?;
        if entry.file_name().to_string_lossy().starts_with(&prefix) {
            fs::remove_file(entry.path())?;
        }
    }
    let temporary = directory.join(format!("{prefix}{}", std::process::id()));
    let written = renamed(&temporary, path, bytes);
    if written.is_err() {
        // The first error is the one to tell; there may be no file to remove.
        let _ = fs::remove_file(&temporary);
    }
    written
}

fn renamed(temporary: &Path, path: &Path, bytes: &[u8]) -> io::Result<()> {
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
}
