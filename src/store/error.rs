//! Errors of databases on disk.
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::grid::GridError;

/// Why a database could not be created, written, read or deleted.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StoreError {
    /// A file operation failed.
    #[error("cannot {action} {}: {source}; check the path, its permissions and its disk, or choose another directory", .path.display())]
    Io {
        /// The operation: a verb such as "read".
        action: &'static str,
        /// The file or directory.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The disk became full while writing.
    #[error(
        "the disk is full: cannot write {}; finished jobs are safe: free some space and run the same command again", .path.display()
    )]
    DiskFull {
        /// The file that did not fit.
        path: PathBuf,
    },
    /// The estimated size of the database exceeds the free space.
    #[error(
        "{} needs about {} more, but the disk has {} free; free some space, choose another disk, or shorten the axes",
        .path.display(), megabytes(*.needed), megabytes(*.available)
    )]
    TooLarge {
        /// Output directory.
        path: PathBuf,
        /// Estimated size of the jobs that are not done, bytes.
        needed: u64,
        /// Free space, bytes.
        available: u64,
    },
    /// The output path is not a directory.
    #[error("{} is a file, not a directory; choose another output directory", .path.display())]
    NotADirectory {
        /// The path.
        path: PathBuf,
    },
    /// Another process holds the directory or the same shard.
    #[error(
        "another splitsnow process is working {role} {}; wait until it ends, or choose another output directory", .path.display()
    )]
    Busy {
        /// How the other process works in the directory, such as "alone in".
        role: String,
        /// Output directory.
        path: PathBuf,
    },
    /// A process whose state is unknown holds the directory, and the file system has no
    /// locks.
    #[error(
        "{} is held by {owner}, and its file system does not support locks; wait until that process ends or, if it no longer runs, delete {} and run the same command again", .path.display(), .file.display()
    )]
    Held {
        /// Output directory.
        path: PathBuf,
        /// The process that holds it.
        owner: String,
        /// The file that claims the directory.
        file: PathBuf,
    },
    /// A symbolic link whose target does not exist.
    #[error(
        "{} is a symbolic link to {}, which does not exist; create that directory, mount its disk, or delete the link", .path.display(), .target.display()
    )]
    Dangling {
        /// The link.
        path: PathBuf,
        /// The target of the link.
        target: PathBuf,
    },
    /// The directory has no database.
    #[error("no database in {}; make one with `splitsnow build`", .path.display())]
    Absent {
        /// The directory.
        path: PathBuf,
    },
    /// A file or directory with the name of the database was not made by this program.
    #[error(
        "{} was not made by splitsnow ({reason}) and is not changed; move it away or choose another output directory", .path.display()
    )]
    Foreign {
        /// The file or directory.
        path: PathBuf,
        /// Why it is not recognised.
        reason: String,
    },
    /// The database was made from other inputs than those requested.
    #[error(
        "{} was made with {key} = {stored}, not {requested}; choose another output directory, or use --fresh to delete it and start again", .path.display()
    )]
    Differs {
        /// The database.
        path: PathBuf,
        /// First key that differs.
        key: String,
        /// Value in the database.
        stored: String,
        /// Requested value.
        requested: String,
    },
    /// No spectrum of a database can be reused, because its nodes differ in more than the
    /// values of the axes.
    #[error(
        "no spectra of {} can be reused: it was made with {key} = {stored}, not {requested}; only the values of the axes may differ; leave this --from out", .path.display()
    )]
    OtherNodes {
        /// The database.
        path: PathBuf,
        /// First key that differs.
        key: String,
        /// Value in the database.
        stored: String,
        /// Requested value.
        requested: String,
    },
    /// An array or a metadata file of the database is damaged.
    #[error("{} is damaged: {reason}; restore it from a copy, or build the database again with --fresh", .path.display())]
    Damaged {
        /// The damaged array or file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The spectra to store do not fit the job.
    #[error("job {job}: {reason}; this is a bug in splitsnow, please report it")]
    Spectra {
        /// The job.
        job: u64,
        /// What is wrong.
        reason: String,
    },
    /// The grid is invalid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The Zarr library failed.
    #[error("cannot store {name} as Zarr: {reason}; check the disk and run the same command again")]
    Zarr {
        /// The array or file.
        name: String,
        /// The library's message.
        reason: String,
    },
}

impl StoreError {
    /// Converts the error of an operation `action` on the file at `path`, for `map_err`.
    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
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

    /// Converts an error of the Zarr library, for `map_err`; `name` is that of the array or file.
    pub(super) fn zarr<E: ToString>(name: &str) -> impl FnOnce(E) -> Self {
        move |error| Self::Zarr {
            name: name.into(),
            reason: error.to_string(),
        }
    }
}

fn megabytes(bytes: u64) -> String {
    format!("{:.1} MB", bytes as f64 * 1e-6)
}
