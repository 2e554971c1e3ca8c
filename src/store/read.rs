//! Reading and checking of a database.
use ndarray::Array2;
use zarrs::array::ArrayError;

use super::layout::ZarrArray;
use super::{ROOT, Store, StoreError, file};
use crate::grid::Shard;
use crate::measurement::{Measured, Spectrum};
use crate::parameter::Parameter;

/// An array of spectra in the database.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Variable {
    /// Directional-hemispherical transmittance.
    Transmittance,
    /// Directional-hemispherical reflectance.
    Reflectance,
    /// Standard error of the transmittance.
    TransmittanceSe,
    /// Standard error of the reflectance.
    ReflectanceSe,
    /// Bi-hemispherical transmittance, under diffuse (isotropic) light.
    TransmittanceDiffuse,
    /// Bi-hemispherical reflectance, under diffuse (isotropic) light.
    ReflectanceDiffuse,
    /// Standard error of the bi-hemispherical transmittance.
    TransmittanceDiffuseSe,
    /// Standard error of the bi-hemispherical reflectance.
    ReflectanceDiffuseSe,
}

impl Variable {
    /// The variables under collimated light, in the order in which the chunks of a job are
    /// written.
    pub const ALL: [Self; 4] = [
        Self::Transmittance,
        Self::Reflectance,
        Self::TransmittanceSe,
        Self::ReflectanceSe,
    ];

    /// The variables under diffuse light, in the same order; their arrays have no axis of
    /// incidence angles.
    pub const DIFFUSE: [Self; 4] = [
        Self::TransmittanceDiffuse,
        Self::ReflectanceDiffuse,
        Self::TransmittanceDiffuseSe,
        Self::ReflectanceDiffuseSe,
    ];

    /// The corresponding variable under diffuse light.
    #[must_use]
    pub fn diffuse(self) -> Self {
        let mut pairs = Self::ALL.into_iter().zip(Self::DIFFUSE);
        let pair = pairs.find(|(collimated, _)| *collimated == self);
        pair.map_or(self, |(_, diffuse)| diffuse)
    }

    /// Whether the variable belongs to diffuse light.
    #[must_use]
    pub fn is_diffuse(self) -> bool {
        Self::DIFFUSE.contains(&self)
    }

    /// Name of the array.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Transmittance => "transmittance",
            Self::Reflectance => "reflectance",
            Self::TransmittanceSe => "transmittance_se",
            Self::ReflectanceSe => "reflectance_se",
            Self::TransmittanceDiffuse => "transmittance_diffuse",
            Self::ReflectanceDiffuse => "reflectance_diffuse",
            Self::TransmittanceDiffuseSe => "transmittance_diffuse_se",
            Self::ReflectanceDiffuseSe => "reflectance_diffuse_se",
        }
    }

    /// Description of the variable, as stored in the attribute `long_name`.
    #[must_use]
    pub fn long_name(self) -> &'static str {
        match self {
            Self::Transmittance => "directional-hemispherical transmittance",
            Self::Reflectance => "directional-hemispherical reflectance",
            Self::TransmittanceSe => "standard error of the transmittance",
            Self::ReflectanceSe => "standard error of the reflectance",
            Self::TransmittanceDiffuse => "bi-hemispherical transmittance of isotropic light",
            Self::ReflectanceDiffuse => "bi-hemispherical reflectance of isotropic light",
            Self::TransmittanceDiffuseSe => {
                "standard error of the transmittance of isotropic light"
            }
            Self::ReflectanceDiffuseSe => "standard error of the reflectance of isotropic light",
        }
    }
}

/// Result of a check of all files of a database.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Integrity {
    /// Number of jobs of the database.
    pub jobs: u64,
    /// Numbers of the jobs that are not done or whose files are damaged.
    pub missing: Vec<u64>,
    /// Damaged metadata and coordinate files: paths within the database.
    pub damaged: Vec<String>,
    /// Intact metadata files in the spelling of an earlier version, which
    /// [`Store::build`] renews: paths within the database.
    pub outdated: Vec<String>,
}

impl Integrity {
    /// Whether no file is missing or damaged.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.missing.is_empty() && self.damaged.is_empty()
    }
}

impl Store {
    /// Numbers of the jobs that are not done, of the database or of one shard, increasing.
    ///
    /// # Errors
    /// [`StoreError::Io`] if a file exists but cannot be read.
    pub fn missing(&self, shard: Option<Shard>) -> Result<Vec<u64>, StoreError> {
        let mut missing = Vec::new();
        for job in 0..self.layout.jobs.count() {
            if shard.is_none_or(|shard| shard.owns(job)) && !self.is_done(job)? {
                missing.push(job);
            }
        }
        Ok(missing)
    }

    /// Checks every file of the database.
    ///
    /// # Errors
    /// [`StoreError::Io`] if a file exists but cannot be read.
    pub fn verify(&self) -> Result<Integrity, StoreError> {
        let mut former = self.layout.static_files(self.former_attributes())?;
        let former = former.remove(ROOT).filter(|_| self.description.agrees());
        let (mut damaged, mut outdated) = (Vec::new(), Vec::new());
        for (path, bytes) in self.static_files()? {
            let stored = file::read(&self.root.join(&path))?;
            if path == ROOT && stored.is_some() && stored == former {
                outdated.push(path);
            } else if stored.as_deref() != Some(&bytes) {
                damaged.push(path);
            }
        }
        Ok(Integrity {
            jobs: self.layout.jobs.count(),
            missing: self.missing(None)?,
            damaged,
            outdated,
        })
    }

    /// All curves of a variable as an array [curves, wavelengths], with curves in storage
    /// order; those under diffuse light have no axis of incidence angles. Jobs that are not
    /// done have NaN: check with [`missing`](Self::missing) first.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] if a chunk is damaged or cannot be read.
    pub fn read(&self, quantity: Variable) -> Result<Array2<f32>, StoreError> {
        let array = self.layout.quantity(quantity)?;
        let values: Vec<f32> = array
            .retrieve_array_subset(&array.subset_all())
            .map_err(|error| self.damaged(array, &error))?;
        let jobs = &self.layout.jobs;
        let angles = match quantity.is_diffuse() {
            true => self.axes().values(Parameter::Incidence).len() as u64,
            false => 1,
        };
        let shape = (
            (jobs.curves() / angles) as usize,
            jobs.wavelengths() as usize,
        );
        Array2::from_shape_vec(shape, values).map_err(StoreError::zarr(quantity.name()))
    }

    /// Largest share of lost rays over the curves and wavelengths of `job`, 0 to 1; NaN if
    /// the job is not done.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] if the chunk is damaged or cannot be read.
    pub fn lost_share(&self, job: u64) -> Result<f64, StoreError> {
        let array = &self.layout.lost;
        let share: Vec<f64> = array
            .retrieve_chunk(&[job])
            .map_err(|error| self.damaged(array, &error))?;
        Ok(share.first().copied().unwrap_or(f64::NAN))
    }

    /// The spectra of `job`, one per curve in storage order; each has the largest share of
    /// lost rays of the job. `None` if the job is not done.
    ///
    /// # Errors
    /// [`StoreError::Io`] or [`StoreError::Damaged`] if a chunk cannot be read.
    pub fn spectra(&self, job: u64) -> Result<Option<Vec<Spectrum>>, StoreError> {
        if !self.is_done(job)? {
            return Ok(None);
        }
        let wavelengths = self.layout.jobs.wavelengths() as usize;
        let angles = self.layout.jobs.block_along(Parameter::Incidence);
        let lights = self.layout.lights();
        let values = |quantity: Variable| {
            let array = self.layout.quantity(quantity)?;
            let chunk = self.layout.chunk(quantity, job)?;
            let values: Result<Vec<f32>, _> = array.retrieve_chunk(&chunk);
            values.map_err(|error| self.damaged(array, &error))
        };
        let groups: &[[Variable; 4]] = match self.has_diffuse() {
            true => &[Variable::ALL, Variable::DIFFUSE],
            false => &[Variable::ALL],
        };
        let mut chunks = Vec::new();
        for group in groups {
            let group: Result<Vec<_>, _> = group.iter().map(|quantity| values(*quantity)).collect();
            chunks.push(group?);
        }
        let lost = self.lost_share(job)?;
        let measured = |values: &[f32], errors: &[f32], row: usize| {
            let pairs = values.iter().zip(errors).skip(row * wavelengths);
            let measured = pairs.map(|(value, se)| Measured {
                value: f64::from(*value),
                se: f64::from(*se),
            });
            measured.take(wavelengths).collect()
        };
        let spectrum = |curve: usize| {
            let (slab, light) = (curve / lights, curve % lights);
            // for each thickness, diffuse light follows the incidence angles
            let (group, row) = match light.checked_sub(angles) {
                None => (0, slab * angles + light),
                Some(_) => (1, slab),
            };
            let [t, r, t_se, r_se] = [0, 1, 2, 3].map(|i| chunks[group][i].as_slice());
            Spectrum {
                reflectance: measured(r, r_se, row),
                transmittance: measured(t, t_se, row),
                lost: vec![lost; wavelengths],
            }
        };
        let slabs = self.layout.jobs.block_along(Parameter::Thickness);
        Ok(Some((0..slabs * lights).map(spectrum).collect()))
    }

    fn damaged(&self, array: &ZarrArray, error: &ArrayError) -> StoreError {
        StoreError::Damaged {
            path: self
                .root
                .join(array.path().as_str().trim_start_matches('/')),
            reason: error.to_string(),
        }
    }
}
