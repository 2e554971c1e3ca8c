//! What is stored of a job: a chunk of each array of spectra, the share of lost rays, and the
//! commit mark, a hash of both.
//!
//! A job that is done is first a file `DIR/.splitsnow-jobs/JOB`: the mark, the share, and the
//! chunks, one after the other. When all jobs of its pack are done, they move into the arrays.
use std::fs;
use std::path::PathBuf;

use sha2::{Digest, Sha256};

use super::{Store, StoreError, Variable, file};
use crate::measurement::{Measured, Spectrum, ViewFactors};
use crate::parameter::Parameter;

/// Folder of the files of jobs, in the output directory.
pub(super) const JOBS: &str = ".splitsnow-jobs";

/// What is stored of a job.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct JobRecord {
    /// The commit mark.
    pub(super) mark: u64,
    /// Largest share of lost rays.
    pub(super) lost: f64,
    /// The chunk of each array, with its checksum.
    pub(super) chunks: Vec<Vec<u8>>,
}

impl JobRecord {
    fn to_bytes(&self) -> Vec<u8> {
        let head = [self.mark.to_le_bytes(), self.lost.to_le_bytes()];
        [&head.concat()[..], &self.chunks.concat()].concat()
    }

    /// The inverse of [`to_bytes`](Self::to_bytes) for chunks of these `lengths`; `None` if the
    /// length does not fit.
    fn parse(bytes: &[u8], lengths: impl Iterator<Item = usize>) -> Option<Self> {
        let (mark, bytes) = bytes.split_first_chunk()?;
        let (lost, mut bytes) = bytes.split_first_chunk()?;
        let mut chunks = Vec::new();
        for length in lengths {
            let (chunk, rest) = bytes.split_at_checked(length)?;
            chunks.push(chunk.to_vec());
            bytes = rest;
        }
        bytes.is_empty().then(|| Self {
            mark: u64::from_le_bytes(*mark),
            lost: f64::from_le_bytes(*lost),
            chunks,
        })
    }

    /// The values of the chunk of the array with this position.
    pub(super) fn values(&self, array: usize) -> Vec<f32> {
        let bytes = self.chunks.get(array).map_or(&[][..], Vec::as_slice);
        let (values, _checksum) = bytes.as_chunks();
        let values = values.iter().map(|value| f32::from_le_bytes(*value));
        values.take(bytes.len() / size_of::<f32>() - 1).collect()
    }
}

/// `bytes` followed by their CRC-32C, as Zarr's codec of that name writes them.
pub(super) fn with_checksum(mut bytes: Vec<u8>) -> Vec<u8> {
    let checksum = crc32c::crc32c(&bytes);
    bytes.extend(checksum.to_le_bytes());
    bytes
}

impl Store {
    /// Stores the spectra of `job`, one per curve in storage order, and its factors toward views,
    /// if the database has views, likewise. With diffuse light, its spectrum follows those at the
    /// incidence angles, for each thickness; its factors have a single azimuth.
    ///
    /// # Errors
    /// [`StoreError::Io`] if the store is open for reading only;
    /// [`StoreError::Spectra`] if the spectra do not fit the job, a curve that exists has a
    /// value that is not finite, or a curve that does not exist has a value other than NaN;
    /// [`StoreError::Io`] or [`StoreError::DiskFull`] if a file cannot be written.
    pub fn commit(
        &self,
        job: u64,
        spectra: &[Spectrum],
        views: &[ViewFactors],
    ) -> Result<(), StoreError> {
        let writer = self.writer()?;
        self.check_spectra(job, spectra, views)?;
        let record = self.record_of(job, spectra, views);
        if self.layout.packs.jobs() == 1 {
            self.write_pack(self.layout.packs.of(job), &[Some(record)])?;
        } else {
            let folder = self.dir.join(JOBS);
            fs::create_dir_all(&folder).map_err(StoreError::io("create", &folder))?;
            writer.write(&self.job_file(job), &record.to_bytes())?;
        }
        self.delete_units(job)
    }

    /// Whether `job` is done: the hash in its commit mark matches what is stored of it.
    ///
    /// # Errors
    /// [`StoreError::Io`] if a file exists but cannot be read.
    pub fn is_done(&self, job: u64) -> Result<bool, StoreError> {
        Ok(self.record(job)?.is_some())
    }

    /// What is stored of `job`, in its own file or in its pack; `None` if it is not done or
    /// damaged.
    pub(super) fn record(&self, job: u64) -> Result<Option<JobRecord>, StoreError> {
        match self.unpacked(job)? {
            Some(record) => Ok(Some(record)),
            None => self.packed(job),
        }
    }

    /// What the file of `job` holds; `None` if it has none or a damaged one.
    pub(super) fn unpacked(&self, job: u64) -> Result<Option<JobRecord>, StoreError> {
        let Some(bytes) = file::read(&self.job_file(job))? else {
            return Ok(None);
        };
        let record = JobRecord::parse(&bytes, self.layout.chunk_bytes());
        Ok(record.filter(|record| self.is_intact(job, record)))
    }

    /// Whether the mark of `record` is that of its bytes.
    pub(super) fn is_intact(&self, job: u64, record: &JobRecord) -> bool {
        record.mark == self.mark(job, &record.chunks, record.lost)
    }

    /// The file of `job`, which exists until the job is packed.
    pub(super) fn job_file(&self, job: u64) -> PathBuf {
        self.dir.join(JOBS).join(job.to_string())
    }

    fn record_of(&self, job: u64, spectra: &[Spectrum], views: &[ViewFactors]) -> JobRecord {
        let wavelengths = self.layout.jobs.wavelengths() as usize;
        let mut chunks = Vec::new();
        for (variable, _) in self.layout.quantities() {
            let own = (0..spectra.len()).filter(|c| self.is_diffuse(*c) == variable.is_diffuse);
            let own: Vec<_> = own
                .map(|curve| measured(variable, spectra, views, curve))
                .collect();
            // views run slower than curves
            let mut bytes: Vec<u8> = Vec::new();
            for view in 0..self.view_count(variable) {
                for curve in &own {
                    let row = curve.iter().skip(view * wavelengths).take(wavelengths);
                    bytes.extend(row.flat_map(|m| value(variable, m).to_le_bytes()));
                }
            }
            chunks.push(with_checksum(bytes));
        }
        let shares = spectra.iter().flat_map(|spectrum| &spectrum.lost);
        let lost = shares.copied().fold(0.0, f64::max);
        JobRecord {
            mark: self.mark(job, &chunks, lost),
            lost,
            chunks,
        }
    }

    /// The commit mark of `job` with these `chunks` and this share of lost rays.
    fn mark(&self, job: u64, chunks: &[Vec<u8>], lost: f64) -> u64 {
        let mut hash = self.commit_hash(job);
        for chunk in chunks {
            hash.add(chunk);
        }
        hash.add(&with_checksum(lost.to_le_bytes().to_vec()));
        hash.finish()
    }

    fn commit_hash(&self, job: u64) -> CommitHash {
        CommitHash(
            Sha256::new()
                .chain_update(self.description.identity.digest())
                .chain_update(job.to_le_bytes()),
        )
    }

    /// Whether curve number `curve` of a job is one under diffuse light.
    fn is_diffuse(&self, curve: usize) -> bool {
        let angles = self.layout.jobs.block_along(Parameter::Incidence);
        curve % self.layout.lights() >= angles
    }

    /// Number of views of a variable; 1 without views.
    fn view_count(&self, variable: Variable) -> usize {
        let views = self.layout.views();
        match (variable.is_view, variable.is_diffuse) {
            (false, _) => 1,
            (true, true) => views.values(Parameter::View).len(),
            (true, false) => views.count() as usize,
        }
    }

    fn check_spectra(
        &self,
        job: u64,
        spectra: &[Spectrum],
        views: &[ViewFactors],
    ) -> Result<(), StoreError> {
        let refuse = |reason: String| Err(StoreError::Spectra { job, reason });
        let lights = self.layout.lights();
        let curves = self.layout.jobs.block_along(Parameter::Thickness) * lights;
        if spectra.len() != curves {
            return refuse(format!("{} spectra for {curves} curves", spectra.len()));
        }
        let expected = if self.layout.views().is_empty() {
            0
        } else {
            curves
        };
        if views.len() != expected {
            let found = views.len();
            return refuse(format!("views of {found} curves instead of {expected}"));
        }
        let absent = self.layout.absent_of(job)?;
        let wavelengths = self.layout.jobs.wavelengths() as usize;
        for (curve, spectrum) in spectra.iter().enumerate() {
            if spectrum.lost.len() != wavelengths {
                let found = spectrum.lost.len();
                return refuse(format!(
                    "{found} shares of lost rays for {wavelengths} wavelengths"
                ));
            }
            for (variable, _) in self.layout.quantities() {
                if variable.is_diffuse != self.is_diffuse(curve) {
                    continue;
                }
                let measured = measured(variable, spectra, views, curve);
                let (found, name) = (measured.len(), variable.name());
                let expected = self.view_count(variable) * wavelengths;
                if found != expected {
                    return refuse(format!("{found} values of {name} instead of {expected}"));
                }
                let is_invalid = |v: &f32| {
                    if curve / lights < absent {
                        !v.is_nan()
                    } else {
                        !v.is_finite()
                    }
                };
                let mut values = measured.iter().map(|measured| value(variable, measured));
                if let Some(value) = values.find(is_invalid) {
                    return refuse(format!("{name} is {value}"));
                }
            }
        }
        Ok(())
    }
}

/// The values of `variable` of one curve, `[view][wavelength]`.
fn measured<'a>(
    variable: Variable,
    spectra: &'a [Spectrum],
    views: &'a [ViewFactors],
    curve: usize,
) -> &'a [Measured] {
    match variable.is_view {
        true => views[curve].of(variable.quantity),
        false => spectra[curve].of(variable.quantity),
    }
}

/// The value or the standard error, as stored.
fn value(variable: Variable, measured: &Measured) -> f32 {
    let value = match variable.is_error {
        true => measured.se,
        false => measured.value,
    };
    value as f32
}

/// The hash in a commit mark: over the identity of the database, the job and its files.
struct CommitHash(Sha256);

impl CommitHash {
    /// Adds a file, preceded by its length so that bytes cannot move between files.
    fn add(&mut self, file: &[u8]) {
        self.0.update((file.len() as u64).to_le_bytes());
        self.0.update(file);
    }

    fn finish(self) -> u64 {
        let digest: [u8; 32] = self.0.finalize().into();
        let [a, b, c, d, e, f, g, h, ..] = digest;
        u64::from_le_bytes([a, b, c, d, e, f, g, h])
    }
}
