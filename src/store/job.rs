//! The files of a job: a chunk of each array of spectra, the share of lost rays, and the commit
//! mark, a hash of the other files that is written last.
use sha2::{Digest, Sha256};

use super::layout::{ZarrArray, encode};
use super::{Store, StoreError, Variable, file};
use crate::measurement::{Measured, Spectrum, ViewFactors};
use crate::parameter::Parameter;

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
        let mut hash = self.commit_hash(job);
        let wavelengths = self.layout.jobs.wavelengths() as usize;
        for (variable, array) in self.layout.quantities() {
            let own = (0..spectra.len()).filter(|c| self.is_diffuse(*c) == variable.is_diffuse);
            let own: Vec<_> = own
                .map(|curve| measured(variable, spectra, views, curve))
                .collect();
            // views run slower than curves
            let mut values: Vec<f32> = Vec::new();
            for view in 0..self.view_count(variable) {
                for curve in &own {
                    let row = curve.iter().skip(view * wavelengths).take(wavelengths);
                    values.extend(row.map(|measured| value(variable, measured)));
                }
            }
            let bytes = encode(array, &values)?;
            hash.add(&bytes);
            let chunk = self.layout.chunk(variable, job)?;
            writer.write(&self.file(array, &chunk), &bytes)?;
        }
        let lost = &self.layout.lost;
        let shares = spectra.iter().flat_map(|spectrum| &spectrum.lost);
        let bytes = encode(lost, &[shares.copied().fold(0.0, f64::max)])?;
        hash.add(&bytes);
        writer.write(&self.file(lost, &[job]), &bytes)?;
        let committed = &self.layout.committed;
        let mark = encode(committed, &[hash.finish()])?;
        writer.write(&self.file(committed, &[job]), &mark)?;
        self.delete_units(job)
    }

    /// Whether `job` is done: its commit mark exists and matches the bytes of its chunks.
    ///
    /// # Errors
    /// [`StoreError::Io`] if a file exists but cannot be read.
    pub fn is_done(&self, job: u64) -> Result<bool, StoreError> {
        let committed = &self.layout.committed;
        let Some(mark) = file::read(&self.file(committed, &[job]))? else {
            return Ok(false);
        };
        let mut paths = Vec::new();
        for (quantity, array) in self.layout.quantities() {
            paths.push(self.file(array, &self.layout.chunk(quantity, job)?));
        }
        paths.push(self.file(&self.layout.lost, &[job]));
        let mut hash = self.commit_hash(job);
        for path in paths {
            let Some(bytes) = file::read(&path)? else {
                return Ok(false);
            };
            hash.add(&bytes);
        }
        Ok(mark == encode(committed, &[hash.finish()])?)
    }

    pub(super) fn file(&self, array: &ZarrArray, chunk: &[u64]) -> std::path::PathBuf {
        self.root.join(array.chunk_key(chunk).as_str())
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
