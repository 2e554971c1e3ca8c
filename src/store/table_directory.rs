//! Storage of tables of grain events beside a database that is not finished, so that all shards and
//! threads of its build share them.
//!
//! A file `DIR/.splitsnow-tables/NAME` is a part of a table; its name is a hash of what it was made
//! from ([`crate::engine::TableStore`], which also checks what is read). Whoever draws the part
//! holds the lock of the file `NAME.lock`. The system releases it when the process ends in any way.
//! Without locks, processes may draw the same part, and one of the equal files stays.
//!
//! The tables are a cache. If one cannot be written, the build goes on without. They are not
//! flushed to the disk, and take at most 1 GiB and a tenth of the free space: the oldest files
//! make room for new ones.
use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

use super::{Store, StoreError, file};
use crate::engine::TableStore;

/// Folder of the files, in the output directory.
pub(super) const TABLES: &str = ".splitsnow-tables";
/// Ending of the names of files for locks.
const LOCK: &str = "lock";
/// Most bytes of all files.
const MAX_BYTES: u64 = 1 << 30;
/// Part of the free space that the files may take.
const SHARE_OF_FREE: u64 = 10;
/// The folder is measured again after this part of its limit has been written, because other
/// processes write there too.
const PARTS_OF_LIMIT: u64 = 64;

/// Storage of the tables of one build.
#[derive(Debug, Clone)]
pub(crate) struct TableDirectory(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    folder: PathBuf,
    writer: Arc<file::Writer>,
    max_bytes: u64,
    /// The parts that this process draws, with their locks if there are any.
    claims: Mutex<BTreeMap<String, Option<File>>>,
    /// Bytes that may be written before the folder is measured again.
    allowance: Mutex<u64>,
    /// Set when nothing can be stored: sharing would only make others wait.
    is_off: AtomicBool,
    failure: Mutex<Option<StoreError>>,
}

impl Store {
    /// The storage of the tables of this build.
    ///
    /// # Errors
    /// [`StoreError::Io`] if the store is open for reading only.
    pub(crate) fn table_directory(&self) -> Result<TableDirectory, StoreError> {
        Ok(TableDirectory(Arc::new(Shared {
            folder: self.dir.join(TABLES),
            writer: Arc::clone(self.writer()?),
            max_bytes: MAX_BYTES,
            claims: Mutex::default(),
            allowance: Mutex::default(),
            is_off: AtomicBool::new(false),
            failure: Mutex::default(),
        })))
    }

    /// Deletes the tables, when all jobs are done. If that fails, the next build does it.
    pub(crate) fn delete_tables(&self) {
        let _ = fs::remove_dir_all(self.dir.join(TABLES));
    }
}

impl TableDirectory {
    /// Takes the first error in storing tables, if there was one.
    pub(crate) fn failure(&self) -> Option<StoreError> {
        held(&self.0.failure).take()
    }
}

/// What a mutex holds.
fn held<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    fn lock_path(&self, name: &str) -> PathBuf {
        self.path(name).with_extension(LOCK)
    }

    /// Stores a part, if there is room for it.
    fn store(&self, name: &str, bytes: &[u8]) -> Result<(), StoreError> {
        fs::create_dir_all(&self.folder).map_err(StoreError::io("create", &self.folder))?;
        if self.make_room(bytes.len() as u64)? {
            self.writer.write_unflushed(&self.path(name), bytes)
        } else {
            self.is_off.store(true, Ordering::Relaxed);
            Ok(())
        }
    }

    /// Whether there is room for `bytes` more; deletes the oldest files if necessary.
    fn make_room(&self, bytes: u64) -> Result<bool, StoreError> {
        let mut allowance = held(&self.allowance);
        if *allowance < bytes {
            let free = fs4::available_space(&self.folder);
            let free = free.map_err(StoreError::io("measure", &self.folder))?;
            let mut files = files(&self.folder)?;
            let mut taken: u64 = files.iter().map(|(_, bytes, _)| bytes).sum();
            let limit = self.max_bytes.min((free + taken) / SHARE_OF_FREE);
            let wanted = bytes.max(limit / PARTS_OF_LIMIT);
            if wanted > limit {
                return Ok(false);
            }
            files.sort();
            for (_, bytes, path) in files {
                if taken + wanted <= limit {
                    break;
                }
                // another process may have deleted it
                let _ = fs::remove_file(path);
                taken -= bytes;
            }
            *allowance = wanted;
        }
        *allowance -= bytes;
        Ok(true)
    }
}

/// Time, bytes and path of the parts in `folder`. Those that vanish meanwhile are left out.
fn files(folder: &Path) -> Result<Vec<(SystemTime, u64, PathBuf)>, StoreError> {
    let entries = fs::read_dir(folder).map_err(StoreError::io("read", folder))?;
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let parts = paths.filter(|path| path.extension().is_none_or(|ending| ending != LOCK));
    let found = parts.filter_map(|path| {
        let metadata = fs::metadata(&path).ok()?;
        let written = metadata.modified().unwrap_or(SystemTime::UNIX_EPOCH);
        metadata
            .is_file()
            .then_some((written, metadata.len(), path))
    });
    Ok(found.collect())
}

impl TableStore for TableDirectory {
    fn read(&self, name: &str) -> Option<Vec<u8>> {
        fs::read(self.0.path(name)).ok()
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        let shared = &self.0;
        if shared.is_off.load(Ordering::Relaxed) {
            return;
        }
        if let Err(error) = shared.store(name, bytes) {
            shared.is_off.store(true, Ordering::Relaxed);
            held(&shared.failure).get_or_insert(error);
        }
    }

    fn claim(&self, name: &str) -> bool {
        let shared = &self.0;
        if shared.is_off.load(Ordering::Relaxed) {
            return true;
        }
        let mut claims = held(&shared.claims);
        if claims.contains_key(name) {
            return false;
        }
        let _ = fs::create_dir_all(&shared.folder);
        let mut options = File::options();
        let options = options.create(true).truncate(false).write(true);
        let lock = options.open(shared.lock_path(name)).ok();
        let locked = lock.as_ref().map(File::try_lock);
        if let Some(Err(TryLockError::WouldBlock)) = locked {
            return false;
        }
        claims.insert(name.to_owned(), lock);
        true
    }

    fn release(&self, name: &str) {
        let lock = held(&self.0.claims).remove(name).flatten();
        if lock.is_some() {
            // Deleted while it is locked. One who has opened it meanwhile finds the part.
            let _ = fs::remove_file(self.0.lock_path(name));
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::collections::BTreeMap;
    use std::time::Duration;

    use super::*;
    use crate::engine::Engine;
    use crate::grid::Shard;
    use crate::grid::tests::small;
    use crate::store::Access;

    /// The store of shard `index` of 2.
    fn shard(dir: &Path, index: u64) -> Store {
        let shard = Shard::new(index, 2).unwrap();
        let grid = small(Engine::Hybrid);
        Store::build(dir, &grid, &BTreeMap::new(), Access::Shard(shard)).unwrap()
    }

    fn names(dir: &Path) -> Vec<String> {
        let entries = fs::read_dir(dir.join(TABLES)).unwrap();
        let name = |entry: fs::DirEntry| entry.file_name().to_string_lossy().into_owned();
        let mut names: Vec<String> = entries.map(|entry| name(entry.unwrap())).collect();
        names.sort();
        names
    }

    #[test]
    fn shards_share_parts_and_claims() {
        let dir = tempfile::tempdir().unwrap();
        let stores = [0, 1].map(|index| shard(dir.path(), index));
        let [one, other] = stores
            .each_ref()
            .map(|store| store.table_directory().unwrap());
        assert!(!dir.path().join(TABLES).exists(), "made when it is needed");
        assert!(one.read("a").is_none());
        assert!(one.claim("a"));
        // by the other process, and by another thread
        assert!(!other.claim("a") && !one.claim("a"));
        assert!(other.claim("b"));
        one.write("a", b"bytes");
        assert_eq!(names(dir.path()), ["a", "a.lock", "b.lock"]);
        one.release("a");
        other.release("b");
        assert_eq!(names(dir.path()), ["a"]);
        assert_eq!(other.read("a").unwrap(), b"bytes");
        // one that ended without a word
        assert!(one.claim("c") && !other.claim("c"));
        drop(one);
        assert!(other.claim("c"));
        stores[0].delete_tables();
        assert!(!dir.path().join(TABLES).exists());
        stores[1].delete_tables();
    }

    #[test]
    fn the_oldest_parts_make_room() {
        let dir = tempfile::tempdir().unwrap();
        let store = shard(dir.path(), 0);
        let limited = |max_bytes| {
            let TableDirectory(shared) = store.table_directory().unwrap();
            let shared = Arc::into_inner(shared).unwrap();
            TableDirectory(Arc::new(Shared {
                max_bytes,
                ..shared
            }))
        };
        let tables = limited(300);
        let past = SystemTime::now() - Duration::from_secs(9);
        for (age, name) in ["a", "b", "c", "d"].into_iter().enumerate() {
            tables.write(name, &[0; 100]);
            let file = File::options()
                .append(true)
                .open(tables.0.path(name))
                .unwrap();
            file.set_modified(past + Duration::from_secs(age as u64))
                .unwrap();
        }
        assert_eq!(names(dir.path()), ["b", "c", "d"]);
        // one that does not fit at all: nothing is deleted for it, and nobody waits any more
        tables.write("e", &[0; 301]);
        assert_eq!(names(dir.path()), ["b", "c", "d"]);
        assert!(tables.claim("f") && tables.claim("f"));
        assert!(tables.failure().is_none());
    }

    #[test]
    fn what_cannot_be_stored_is_told_once() {
        let dir = tempfile::tempdir().unwrap();
        let store = shard(dir.path(), 0);
        store.fill_disk_after(1);
        let tables = store.table_directory().unwrap();
        tables.write("a", b"fits");
        assert!(tables.claim("b") && !tables.claim("b"));
        tables.write("b", b"does not");
        tables.release("b");
        assert_eq!(names(dir.path()), ["a"]);
        assert!(tables.claim("b") && tables.claim("b"));
        tables.write("b", b"does not");
        let full = tables.failure();
        assert!(
            matches!(full, Some(StoreError::DiskFull { .. })),
            "{full:?}"
        );
        assert!(tables.failure().is_none());
        // a file in place of the folder
        store.delete_tables();
        fs::write(dir.path().join(TABLES), "").unwrap();
        let tables = store.table_directory().unwrap();
        assert!(tables.claim("a") && tables.read("a").is_none());
        tables.write("a", b"nowhere");
        tables.release("a");
        let error = tables.failure().unwrap().to_string();
        assert!(error.starts_with("cannot create "), "{error}");
    }
}
