//! The files of a job: four chunks of spectra, the share of lost rays, and the commit mark,
//! a hash of the other five files that is written last.
use sha2::{Digest, Sha256};

use super::layout::{ZarrArray, encode};
use super::{Store, StoreError, Variable, file};
use crate::measurement::{Measured, Spectrum};
use crate::parameter::Parameter;

impl Store {
    /// Stores the spectra of `job`, one per curve in storage order. With diffuse light, its
    /// spectrum follows those at the incidence angles, for each thickness.
    ///
    /// # Errors
    /// [`StoreError::Io`] if the store is open for reading only;
    /// [`StoreError::Spectra`] if the spectra do not fit the job, a curve that exists has a
    /// value that is not finite, or a curve that does not exist has a value other than NaN;
    /// [`StoreError::Io`] or [`StoreError::DiskFull`] if a file cannot be written.
    pub fn commit(&self, job: u64, spectra: &[Spectrum]) -> Result<(), StoreError> {
        let writer = self.writer()?;
        self.check_spectra(job, spectra)?;
        let mut hash = self.commit_hash(job);
        for (quantity, array) in self.layout.quantities() {
            let angles = self.layout.jobs.block_along(Parameter::Incidence);
            let slab_values = |slab: &'_ [Spectrum]| -> Vec<f32> {
                let (collimated, diffuse) = slab.split_at(angles.min(slab.len()));
                let spectra = if quantity.is_diffuse() {
                    diffuse
                } else {
                    collimated
                };
                spectra.iter().flat_map(|s| values(s, quantity)).collect()
            };
            let slabs = spectra.chunks(self.layout.lights().max(1));
            let values: Vec<f32> = slabs.flat_map(slab_values).collect();
            let bytes = encode(array, &values)?;
            hash.add(&bytes);
            let chunk = self.layout.chunk(quantity, job)?;
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

    fn file(&self, array: &ZarrArray, chunk: &[u64]) -> std::path::PathBuf {
        self.root.join(array.chunk_key(chunk).as_str())
    }

    fn commit_hash(&self, job: u64) -> CommitHash {
        CommitHash(
            Sha256::new()
                .chain_update(self.description.identity.digest())
                .chain_update(job.to_le_bytes()),
        )
    }

    fn check_spectra(&self, job: u64, spectra: &[Spectrum]) -> Result<(), StoreError> {
        let refuse = |reason: String| Err(StoreError::Spectra { job, reason });
        let lights = self.layout.lights();
        let curves = (self.layout.jobs.block_along(Parameter::Thickness) * lights) as u64;
        if spectra.len() as u64 != curves {
            return refuse(format!("{} spectra for {curves} curves", spectra.len()));
        }
        let absent = self.layout.absent_of(job)?;
        for (curve, spectrum) in spectra.iter().enumerate() {
            let lengths = [
                spectrum.reflectance.len(),
                spectrum.transmittance.len(),
                spectrum.lost.len(),
            ];
            let wavelengths = self.layout.jobs.wavelengths();
            if lengths.iter().any(|n| *n as u64 != wavelengths) {
                return refuse(format!("{lengths:?} values for {wavelengths} wavelengths"));
            }
            for quantity in Variable::ALL {
                let is_invalid = |v: &f32| {
                    if curve / lights < absent {
                        !v.is_nan()
                    } else {
                        !v.is_finite()
                    }
                };
                if let Some(value) = values(spectrum, quantity).find(is_invalid) {
                    return refuse(format!("{} is {value}", quantity.name()));
                }
            }
        }
        Ok(())
    }
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

fn values(spectrum: &Spectrum, quantity: Variable) -> impl Iterator<Item = f32> {
    let (measured, part): (&[Measured], fn(&Measured) -> f64) = match quantity {
        Variable::Transmittance | Variable::TransmittanceDiffuse => {
            (&spectrum.transmittance, |m| m.value)
        }
        Variable::Reflectance | Variable::ReflectanceDiffuse => {
            (&spectrum.reflectance, |m| m.value)
        }
        Variable::TransmittanceSe | Variable::TransmittanceDiffuseSe => {
            (&spectrum.transmittance, |m| m.se)
        }
        Variable::ReflectanceSe | Variable::ReflectanceDiffuseSe => {
            (&spectrum.reflectance, |m| m.se)
        }
    };
    measured.iter().map(move |m| part(m) as f32)
}
