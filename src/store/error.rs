//! What can go wrong with a database on disk.
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::grid::GridError;

/// Why a database could not be made, written, read or removed.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The operating system refused.
    #[error("cannot {action} {}: {source}", .path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// On what.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
    /// No room left while writing.
    #[error(
        "the disk is full: cannot write {}; what was finished is safe: free some space and run the same command again", .path.display()
    )]
    DiskFull {
        /// The file that did not fit.
        path: PathBuf,
    },
    /// The estimated size exceeds the free space.
    #[error(
        "{} needs about {} more, but the disk has {} free; free some space, choose another disk, or shorten the axes",
        .path.display(), megabytes(*.needed), megabytes(*.available)
    )]
    TooLarge {
        /// Output directory.
        path: PathBuf,
        /// Estimated bytes still to be written.
        needed: u64,
        /// Free bytes.
        available: u64,
    },
    /// The output path exists and is no directory.
    #[error("{} is a file, not a directory; choose another output directory", .path.display())]
    NotADirectory {
        /// The path.
        path: PathBuf,
    },
    /// Another process holds the directory, or the same shard of it.
    #[error(
        "another splitsnow process is working {what} {}; wait until it ends, or choose another output directory", .path.display()
    )]
    Busy {
        /// Which part of it.
        what: String,
        /// Output directory.
        path: PathBuf,
    },
    /// A process that cannot be asked holds the directory, where the file system
    /// has no locks.
    #[error(
        "{} is held by {owner}, and its file system has no locks that end with a process; wait until that one ends or, if it is no longer there, delete {} and run the same command again", .path.display(), .file.display()
    )]
    Held {
        /// Output directory.
        path: PathBuf,
        /// Who holds it.
        owner: String,
        /// The file that says so.
        file: PathBuf,
    },
    /// A symbolic link to nothing.
    #[error(
        "{} is a symbolic link to {}, which is not there; make that directory, mount its disk, or remove the link", .path.display(), .target.display()
    )]
    Dangling {
        /// The link.
        path: PathBuf,
        /// Where it points.
        target: PathBuf,
    },
    /// There is no database.
    #[error("no database in {}; make one with `splitsnow build`", .path.display())]
    Absent {
        /// Directory that should hold it.
        path: PathBuf,
    },
    /// Something of that name exists but was not made by this program.
    #[error(
        "{} was not made by splitsnow ({reason}); it is left alone: move it away or choose another output directory", .path.display()
    )]
    Foreign {
        /// What was found.
        path: PathBuf,
        /// Why it is not recognised.
        reason: String,
    },
    /// The database was made from other inputs.
    #[error(
        "{} was made with {key} = {stored}, not {asked}; choose another output directory, or --fresh to delete it and start again", .path.display()
    )]
    Differs {
        /// The database.
        path: PathBuf,
        /// First key that differs.
        key: String,
        /// Its value in the database.
        stored: String,
        /// Its value now.
        asked: String,
    },
    /// The nodes of the database are not those asked for.
    #[error(
        "nothing can be taken over from {}: it was made with {key} = {stored}, not {asked}; only the values of the axes may differ", .path.display()
    )]
    OtherNodes {
        /// The database.
        path: PathBuf,
        /// First key that differs.
        key: String,
        /// Its value in the database.
        stored: String,
        /// Its value now.
        asked: String,
    },
    /// A part of the database other than a job's chunks is damaged.
    #[error("{} is damaged: {reason}", .path.display())]
    Damaged {
        /// The damaged part.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// Spectra that do not fit the job.
    #[error("job {job}: {reason}")]
    Spectra {
        /// The job.
        job: u64,
        /// What is wrong.
        reason: String,
    },
    /// The grid itself is impossible.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The Zarr library refused what should be valid.
    #[error("cannot lay out {what}: {reason}")]
    Zarr {
        /// Which array.
        what: String,
        /// The library's message.
        reason: String,
    },
}

impl StoreError {
    /// For `map_err` on an operation that tried to `action` the file at `path`.
    pub(super) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_path_buf();
        move |source| match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::DiskFull { path },
            _ => Self::Io {
                action,
                path,
                source,
            },
        }
    }

    /// For `map_err` on an operation of the Zarr library.
    pub(super) fn zarr<E: ToString>(what: &str) -> impl FnOnce(E) -> Self {
        move |error| Self::Zarr {
            what: what.into(),
            reason: error.to_string(),
        }
    }
}

fn megabytes(bytes: u64) -> String {
    format!("{:.1} MB", bytes as f64 * 1e-6)
}
