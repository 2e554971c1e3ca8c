//! Packs on disk: when all jobs of a pack are done, they move from files of their own into one file
//! of each array. The bytes of these files follow from the jobs alone, so a file that differs from
//! them is written again.
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::job::{JobRecord, with_checksum};
use super::{Store, StoreError, file};

/// Offset and length in the index of a shard of a chunk that does not exist.
const NO_CHUNK: [u64; 2] = [u64::MAX; 2];

/// The bytes of the files of a pack; `None` for one that does not exist.
type PackFiles = Vec<Option<Vec<u8>>>;

/// Which jobs and packs of a database are not as they should be.
#[derive(Debug, Default)]
pub(crate) struct Survey {
    /// Numbers of the jobs that are not done or damaged.
    pub(crate) missing: Vec<u64>,
    /// Packs whose jobs are all done, but not all in the arrays.
    pub(crate) loose: Vec<u64>,
}

/// Packs the jobs of a run: each pack when the last of its jobs is done.
#[derive(Debug)]
pub(crate) struct Packer<'a> {
    store: &'a Store,
    /// Number of missing jobs of each pack.
    left: Mutex<BTreeMap<u64, usize>>,
}

impl<'a> Packer<'a> {
    /// A packer for a run of the jobs `missing`, among the jobs `own`. Only packs whose jobs all
    /// belong to `own` are packed, because other processes may write the others.
    ///
    /// # Errors
    /// [`StoreError`] if a pack without missing jobs cannot be packed.
    pub(crate) fn new(
        store: &'a Store,
        own: &Range<u64>,
        missing: &[u64],
        loose: &[u64],
    ) -> Result<Self, StoreError> {
        let packs = &store.layout.packs;
        let is_own = |pack: &u64| {
            let jobs = packs.range(*pack);
            own.contains(&jobs.start) && jobs.end <= own.end
        };
        for pack in loose.iter().copied().filter(is_own) {
            store.pack(pack)?;
        }
        let mut left = BTreeMap::new();
        for pack in missing.iter().map(|job| packs.of(*job)).filter(is_own) {
            *left.entry(pack).or_default() += 1;
        }
        // A process killed while it deleted them leaves files of jobs that are packed.
        for job in store.job_files()? {
            let pack = packs.of(job);
            if is_own(&pack) && !left.contains_key(&pack) {
                file::remove_file(&store.job_file(job))?;
            }
        }
        Ok(Self {
            store,
            left: Mutex::new(left),
        })
    }

    /// Packs the pack of `job`, which was committed now, if it was the last one.
    ///
    /// # Errors
    /// As [`Store::commit`].
    pub(crate) fn committed(&self, job: u64) -> Result<(), StoreError> {
        let pack = self.store.layout.packs.of(job);
        let is_whole = {
            let mut left = self.left.lock().unwrap_or_else(PoisonError::into_inner);
            let left = left.get_mut(&pack);
            left.is_some_and(|left| {
                *left -= 1;
                *left == 0
            })
        };
        match is_whole {
            true => self.store.pack(pack),
            false => Ok(()),
        }
    }
}

impl Store {
    /// Reads all files of the database.
    ///
    /// # Errors
    /// [`StoreError::Io`] if a file exists but cannot be read.
    pub(crate) fn survey(&self) -> Result<Survey, StoreError> {
        let mut survey = Survey::default();
        for pack in 0..self.layout.packs.count() {
            let (files, records) = self.found(pack)?;
            let jobs = self.layout.packs.range(pack).zip(&records);
            let missing = jobs.filter(|(_, record)| record.is_none());
            let mut missing: Vec<u64> = missing.map(|(job, _)| job).collect();
            if missing.is_empty() && self.pack_bytes(&records) != files {
                survey.loose.push(pack);
            }
            survey.missing.append(&mut missing);
        }
        Ok(survey)
    }

    /// The files of `pack` whose bytes are not those that its jobs, all done, must have.
    pub(super) fn unlike(&self, pack: u64) -> Result<Vec<PathBuf>, StoreError> {
        let (files, records) = self.found(pack)?;
        let expected = self.pack_bytes(&records);
        let found = files.iter().zip(&expected).zip(self.pack_paths(pack));
        Ok(found
            .filter(|((found, want), _)| found != want)
            .map(|(_, path)| path)
            .collect())
    }

    /// The packs of `own` whose jobs are all files. Reads no file.
    pub(crate) fn loose_of(&self, own: &Range<u64>) -> Result<Vec<u64>, StoreError> {
        let mut jobs: BTreeMap<u64, u64> = BTreeMap::new();
        for job in self
            .job_files()?
            .into_iter()
            .filter(|job| own.contains(job))
        {
            *jobs.entry(self.layout.packs.of(job)).or_default() += 1;
        }
        jobs.retain(|pack, count| {
            let range = self.layout.packs.range(*pack);
            *count == range.end - range.start
        });
        Ok(jobs.into_keys().collect())
    }

    /// Moves the jobs of `pack` into the arrays. Those that are there already stay. Does nothing
    /// if one of them is not done.
    fn pack(&self, pack: u64) -> Result<(), StoreError> {
        let (_, records) = self.found(pack)?;
        if records.iter().any(Option::is_none) {
            return Ok(());
        }
        self.write_pack(pack, &records)?;
        self.layout
            .packs
            .range(pack)
            .try_for_each(|job| file::remove_file(&self.job_file(job)))
    }

    /// The files of `pack` as [`read_pack`](Self::read_pack) gives them, and its jobs that are
    /// done: those in the arrays, and those that have files of their own.
    fn found(&self, pack: u64) -> Result<(PackFiles, Vec<Option<JobRecord>>), StoreError> {
        let files = self.read_pack(pack)?;
        let mut records = self.records(pack, &files);
        for (job, record) in self.layout.packs.range(pack).zip(&mut records) {
            if record.is_none() {
                *record = self.unpacked(job)?;
            }
        }
        Ok((files, records))
    }

    /// Writes the files of `pack`, the commit marks last.
    pub(super) fn write_pack(
        &self,
        pack: u64,
        records: &[Option<JobRecord>],
    ) -> Result<(), StoreError> {
        let writer = self.writer()?;
        let paths = self.pack_paths(pack);
        for (path, bytes) in paths.iter().zip(self.pack_bytes(records)) {
            writer.write(path, &bytes.unwrap_or_default())?;
        }
        Ok(())
    }

    /// The files of `pack`: of each quantity, of the shares of lost rays, and of the marks.
    fn pack_paths(&self, pack: u64) -> Vec<PathBuf> {
        let quantities = self.layout.quantities();
        let files =
            quantities.map(|(variable, array)| self.layout.pack_file(array, variable, pack));
        let per_job = [&self.layout.lost, &self.layout.committed];
        let per_job = per_job.map(|array| array.chunk_key(&[pack]).to_string());
        let files = files.chain(per_job);
        files.map(|file| self.root.join(file)).collect()
    }

    /// The bytes of the files of `pack`, in the order of [`pack_paths`](Self::pack_paths); a file
    /// that does not exist is `None`.
    fn read_pack(&self, pack: u64) -> Result<PackFiles, StoreError> {
        let paths = self.pack_paths(pack).into_iter();
        paths.map(|path| file::read(&path)).collect()
    }

    /// The jobs of `pack` that are in its `files` and intact.
    fn records(&self, pack: u64, files: &[Option<Vec<u8>>]) -> Vec<Option<JobRecord>> {
        let range = self.layout.packs.range(pack);
        let [arrays @ .., lost, committed] = files else {
            return Vec::new();
        };
        let record = |(position, job): (usize, u64)| {
            let slice = |file: &Option<Vec<u8>>, length: usize| {
                let bytes = file.as_ref()?.get(position * length..)?.get(..length)?;
                Some(bytes.to_vec())
            };
            let number = |file| slice(file, 8)?.try_into().ok().map(u64::from_le_bytes);
            let chunks = arrays.iter().zip(self.layout.chunk_bytes());
            let chunks = chunks.map(|(file, length)| slice(file, length));
            let record = JobRecord {
                mark: number(committed)?,
                lost: f64::from_bits(number(lost)?),
                chunks: chunks.collect::<Option<_>>()?,
            };
            self.is_intact(job, &record).then_some(record)
        };
        (0..).zip(range).map(record).collect()
    }

    /// What is stored of `job` in its pack; `None` if it is not there or damaged.
    pub(super) fn packed(&self, job: u64) -> Result<Option<JobRecord>, StoreError> {
        let packs = &self.layout.packs;
        let position = job - packs.range(packs.of(job)).start;
        let numbers = [size_of::<u64>(); 2];
        let paths = self.pack_paths(packs.of(job));
        let mut parts = Vec::new();
        for (path, length) in paths.iter().zip(self.layout.chunk_bytes().chain(numbers)) {
            match read_part(path, position * length as u64, length)? {
                Some(bytes) => parts.push(bytes),
                None => return Ok(None),
            }
        }
        let mut number = || {
            let bytes = parts.pop().and_then(|bytes| bytes.try_into().ok());
            bytes.map(u64::from_le_bytes).unwrap_or_default()
        };
        let (mark, lost) = (number(), f64::from_bits(number()));
        let record = JobRecord {
            mark,
            lost,
            chunks: parts,
        };
        Ok(self.is_intact(job, &record).then_some(record))
    }

    /// Largest share of lost rays of each of `jobs`, 0 to 1, over its curves and wavelengths; NaN
    /// if it is not done. The shares are not checked against the commit marks.
    ///
    /// # Errors
    /// [`StoreError::Io`] if a file exists but cannot be read.
    pub fn lost_shares(&self, jobs: Range<u64>) -> Result<Vec<f64>, StoreError> {
        let length = size_of::<f64>();
        let share = |bytes: &[u8]| bytes.try_into().map_or(f64::NAN, f64::from_le_bytes);
        let unpacked: BTreeSet<u64> = self.job_files()?.into_iter().collect();
        let packs = &self.layout.packs;
        let mut shares = Vec::new();
        // a file of many jobs is read once
        let mut read: Option<(u64, Vec<u8>)> = None;
        for job in jobs {
            if unpacked.contains(&job) {
                let bytes = read_part(&self.job_file(job), length as u64, length)?;
                shares.push(share(&bytes.unwrap_or_default()));
                continue;
            }
            let pack = packs.of(job);
            if read.as_ref().is_none_or(|(other, _)| *other != pack) {
                let path = self.layout.lost.chunk_key(&[pack]);
                let bytes = file::read(&self.root.join(path.as_str()))?;
                read = Some((pack, bytes.unwrap_or_default()));
            }
            let bytes = read.as_ref().map_or(&[][..], |(_, bytes)| bytes);
            let position = (job - packs.range(pack).start) as usize * length;
            let bytes = bytes.get(position..).and_then(|bytes| bytes.get(..length));
            shares.push(share(bytes.unwrap_or_default()));
        }
        Ok(shares)
    }

    /// The bytes that the files of a pack of these `records` must have, in the order of
    /// [`pack_paths`](Self::pack_paths).
    fn pack_bytes(&self, records: &[Option<JobRecord>]) -> PackFiles {
        let capacity = self.layout.packs.jobs() as usize;
        let records = || records.iter().flatten();
        let arrays = self.layout.chunk_bytes().enumerate();
        let arrays = arrays.map(|(array, length)| {
            let chunks = records().filter_map(|record| record.chunks.get(array));
            let mut bytes: Vec<u8> = chunks.flatten().copied().collect();
            if self.layout.is_sharded() {
                bytes.extend(index(records().count(), capacity, length as u64));
            }
            bytes
        });
        let per_job = |value: fn(&JobRecord) -> [u8; 8], fill: [u8; 8]| {
            let values = records().map(value).chain(std::iter::repeat(fill));
            with_checksum(values.take(capacity).flatten().collect())
        };
        let lost = per_job(|record| record.lost.to_le_bytes(), f64::NAN.to_le_bytes());
        let committed = per_job(|record| record.mark.to_le_bytes(), [0; 8]);
        arrays.chain([lost, committed]).map(Some).collect()
    }
}

/// The index at the end of a shard of `count` chunks of `length` bytes, with room for `capacity`
/// chunks: offset and length of each, and the checksum of both.
fn index(count: usize, capacity: usize, length: u64) -> Vec<u8> {
    let chunks = (0..count as u64).map(|chunk| [chunk * length, length]);
    let entries = chunks.chain(std::iter::repeat(NO_CHUNK)).take(capacity);
    with_checksum(entries.flatten().flat_map(u64::to_le_bytes).collect())
}

/// `length` bytes of a file from `offset`; `None` if it has fewer or does not exist.
fn read_part(path: &Path, offset: u64, length: usize) -> Result<Option<Vec<u8>>, StoreError> {
    let mut bytes = vec![0; length];
    let read = File::open(path).and_then(|mut file| {
        file.seek(SeekFrom::Start(offset))?;
        file.read_exact(&mut bytes)
    });
    match read {
        Ok(()) => Ok(Some(bytes)),
        Err(error) if [ErrorKind::NotFound, ErrorKind::UnexpectedEof].contains(&error.kind()) => {
            Ok(None)
        }
        Err(error) => Err(StoreError::io("read", path)(error)),
    }
}
