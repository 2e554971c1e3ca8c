//! Storage of the finished units of jobs that are not done, in the output directory.
//!
//! A file `DIR/.splitsnow-units/JOB-NUMBER` begins with 32 bytes: the SHA-256 over the hash
//! of the database's identity, the job, and the rest of the file, which is written by the
//! engine ([`crate::engine::Units`]). Truncated, corrupted and foreign files are ignored.
//! The files of a job are deleted when it is done.
use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use sha2::{Digest, Sha256};

use super::{Store, StoreError, file};
use crate::engine::UnitStore;

/// Folder of the files, in the output directory.
pub(super) const UNITS: &str = ".splitsnow-units";
/// Bytes of a digest.
const DIGEST: usize = 32;

/// Storage of the finished units of one job.
#[derive(Debug, Clone)]
pub(crate) struct UnitDirectory(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    folder: PathBuf,
    writer: Arc<file::Writer>,
    identity: [u8; 32],
    job: u64,
    /// Number of the next file.
    next: AtomicU64,
    failure: Mutex<Option<StoreError>>,
}

impl Store {
    /// The storage of the units of `job`, and the units that are stored already, oldest
    /// first.
    pub(crate) fn unit_directory(
        &self,
        job: u64,
    ) -> Result<(UnitDirectory, Vec<Vec<u8>>), StoreError> {
        let files = self.units(job)?;
        let unit_directory = Shared {
            folder: self.dir.join(UNITS),
            writer: Arc::clone(self.writer()?),
            identity: self.description.identity.digest(),
            job,
            next: AtomicU64::new(files.last().map_or(0, |(number, _)| number + 1)),
            failure: Mutex::default(),
        };
        let mut stored_units = Vec::new();
        for (_, path) in files {
            let bytes = file::read(&path)?.unwrap_or_default();
            if let Some((digest, units)) = bytes.split_at_checked(DIGEST)
                && unit_directory.digest(units) == digest
            {
                stored_units.push(units.to_vec());
            }
        }
        Ok((UnitDirectory(Arc::new(unit_directory)), stored_units))
    }

    /// Deletes the units of `job`.
    pub(super) fn delete_units(&self, job: u64) -> Result<(), StoreError> {
        let files = self.units(job)?;
        files
            .iter()
            .try_for_each(|(_, path)| file::remove_file(path))
    }

    /// Deletes the units of jobs that are done, which a killed process may have left.
    pub(super) fn delete_finished_units(&self) -> Result<(), StoreError> {
        let mut jobs: Vec<u64> = self.all_units()?.iter().map(|unit| unit.0).collect();
        jobs.dedup();
        for job in jobs {
            if job >= self.layout.jobs.count() || self.is_done(job)? {
                self.delete_units(job)?;
            }
        }
        Ok(())
    }

    /// Number and path of the files of `job`, sorted by number.
    fn units(&self, job: u64) -> Result<Vec<(u64, PathBuf)>, StoreError> {
        let units = self.all_units()?.into_iter();
        let units = units.filter(|unit| unit.0 == job);
        Ok(units.map(|(_, number, path)| (number, path)).collect())
    }

    /// Job, number and path of all files, sorted by job and number.
    fn all_units(&self) -> Result<Vec<(u64, u64, PathBuf)>, StoreError> {
        let folder = self.dir.join(UNITS);
        if !folder.exists() {
            return Ok(Vec::new());
        }
        let mut units = Vec::new();
        for entry in fs::read_dir(&folder).map_err(StoreError::io("read", &folder))? {
            let entry = entry.map_err(StoreError::io("read", &folder))?;
            let name = entry.file_name();
            let numbers = name.to_str().and_then(|name| name.split_once('-'));
            if let Some((job, number)) = numbers
                && let (Ok(job), Ok(number)) = (job.parse(), number.parse())
            {
                units.push((job, number, entry.path()));
            }
        }
        units.sort();
        Ok(units)
    }
}

impl UnitDirectory {
    /// Takes the first error in storing units, if there was one.
    pub(crate) fn failure(&self) -> Option<StoreError> {
        let failure = self.0.failure.lock();
        failure.unwrap_or_else(PoisonError::into_inner).take()
    }
}

impl Shared {
    fn digest(&self, units: &[u8]) -> [u8; DIGEST] {
        Sha256::new()
            .chain_update(self.identity)
            .chain_update(self.job.to_le_bytes())
            .chain_update(units)
            .finalize()
            .into()
    }

    fn write(&self, units: &[u8]) -> Result<(), StoreError> {
        fs::create_dir_all(&self.folder).map_err(StoreError::io("create", &self.folder))?;
        let number = self.next.fetch_add(1, Ordering::Relaxed);
        let path = self.folder.join(format!("{}-{number}", self.job));
        self.writer
            .write(&path, &[&self.digest(units), units].concat())
    }
}

impl UnitStore for UnitDirectory {
    fn append(&self, units: &[u8]) -> bool {
        let result = self.0.write(units);
        let stored = result.is_ok();
        if let Err(error) = result {
            let failure = self.0.failure.lock();
            failure
                .unwrap_or_else(PoisonError::into_inner)
                .get_or_insert(error);
        }
        stored
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::Path;

    use super::*;
    use crate::engine::Engine;
    use crate::grid::tests::small;
    use crate::measurement::{Measured, Spectrum};
    use crate::store::Access;

    fn open(dir: &Path, seed: u64) -> Store {
        let mut grid = small(Engine::Spectral);
        grid.run.seed = seed;
        Store::build(dir, &grid, &BTreeMap::new(), Access::Exclusive).unwrap()
    }

    fn kept(store: &Store, job: u64) -> Vec<Vec<u8>> {
        store.unit_directory(job).unwrap().1
    }

    #[test]
    fn what_is_kept_comes_back_unless_it_is_damaged() {
        let (dir, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let store = open(dir.path(), 1);
        let (unit_directory, none) = store.unit_directory(3).unwrap();
        assert!(none.is_empty() && unit_directory.append(b"one") && unit_directory.append(b"two"));
        // after another start
        let (unit_directory, before) = store.unit_directory(3).unwrap();
        assert_eq!(before, [b"one", b"two"]);
        assert!((0..9).all(|_| unit_directory.append(b"more")) && kept(&store, 3).len() == 11);
        assert!(kept(&store, 0).is_empty());
        drop((unit_directory, store));
        let store = open(dir.path(), 1);
        assert_eq!(kept(&store, 3)[..2], [b"one", b"two"]);
        let file = |name: &str| dir.path().join(UNITS).join(name);
        let whole = fs::read(file("3-1")).unwrap();
        let foreign = open(other.path(), 2);
        assert!(foreign.unit_directory(3).unwrap().0.append(b"two"));
        let foreign = fs::read(other.path().join(UNITS).join("3-0")).unwrap();
        let mut flipped = whole.clone();
        flipped[34] ^= 1;
        for damaged in [&whole[..34], &whole[..9], &[], &flipped, &foreign] {
            fs::write(file("3-1"), damaged).unwrap();
            assert_eq!(kept(&store, 3)[..2], [&b"one"[..], b"more"]);
        }
        // of another job
        fs::write(file("4-0"), &whole).unwrap();
        assert!(kept(&store, 4).is_empty());
    }

    #[test]
    fn a_job_that_is_done_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join(UNITS);
        let measured = Measured {
            value: 0.5,
            se: 0.1,
        };
        let store = open(dir.path(), 1);
        let count = store.layout.jobs.wavelengths() as usize;
        let spectrum = Spectrum {
            reflectance: vec![measured; count],
            transmittance: vec![measured; count],
            lost: vec![0.0; count],
        };
        let spectra = vec![spectrum; store.layout.jobs.curves_per_job() as usize];
        for job in [1, 12] {
            assert!(store.unit_directory(job % 8).unwrap().0.append(b"units"));
        }
        let left = fs::read(folder.join("1-0")).unwrap();
        store.commit(1, &spectra, &[]).unwrap();
        assert!(kept(&store, 1).is_empty() && kept(&store, 4).len() == 1);
        drop(store);
        // killed before they were deleted
        fs::write(folder.join("1-0"), left).unwrap();
        let store = open(dir.path(), 1);
        assert!(!folder.join("1-0").exists() && folder.join("4-0").exists());
        store.commit(4, &spectra, &[]).unwrap();
        drop(store);
        assert!(!folder.exists());
    }
}
