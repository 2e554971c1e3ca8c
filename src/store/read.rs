//! Reading a database back.
use ndarray::Array2;
use zarrs::array::ArrayError;

use super::layout::ZarrArray;
use super::{Store, StoreError, file};
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
    /// Transmittance of isotropic light.
    TransmittanceDiffuse,
    /// Reflectance of isotropic light.
    ReflectanceDiffuse,
    /// Standard error of the transmittance of isotropic light.
    TransmittanceDiffuseSe,
    /// Standard error of the reflectance of isotropic light.
    ReflectanceDiffuseSe,
}

impl Variable {
    /// All under collimated light, in the order in which a job's chunks are written.
    pub const ALL: [Self; 4] = [
        Self::Transmittance,
        Self::Reflectance,
        Self::TransmittanceSe,
        Self::ReflectanceSe,
    ];

    /// All under isotropic light, likewise; their arrays have no axis of angles.
    pub const DIFFUSE: [Self; 4] = [
        Self::TransmittanceDiffuse,
        Self::ReflectanceDiffuse,
        Self::TransmittanceDiffuseSe,
        Self::ReflectanceDiffuseSe,
    ];

    /// The same under isotropic light.
    #[must_use]
    pub fn diffuse(self) -> Self {
        let both = Self::ALL.into_iter().zip(Self::DIFFUSE);
        let mut same = both.filter_map(|(one, other)| (one == self).then_some(other));
        same.next().unwrap_or(self)
    }

    /// Whether it is of isotropic light.
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

    /// What it is, for people.
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

/// What a check of the database found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Integrity {
    /// Jobs there are.
    pub jobs: u64,
    /// Jobs that were never done, or whose files are damaged.
    pub missing: Vec<u64>,
    /// Metadata and coordinate files that are damaged, below the database.
    pub damaged: Vec<String>,
}

impl Integrity {
    /// Whether everything is there and whole.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.missing.is_empty() && self.damaged.is_empty()
    }
}

impl Store {
    /// Jobs still to be run, of all or of one shard, in order.
    ///
    /// # Errors
    /// A file is there but cannot be read.
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
    /// A file is there but cannot be read.
    pub fn verify(&self) -> Result<Integrity, StoreError> {
        let mut damaged = Vec::new();
        for (path, bytes) in self.layout.static_files(&self.description)? {
            if file::read(&self.root.join(&path))?.as_deref() != Some(&bytes) {
                damaged.push(path);
            }
        }
        Ok(Integrity {
            jobs: self.layout.jobs.count(),
            missing: self.missing(None)?,
            damaged,
        })
    }

    /// All curves of a quantity, [curves, wavelengths], curves in storage
    /// order, those of isotropic light without the axis of angles; NaN where a job has written nothing. Ask [`missing`](Self::missing)
    /// first whether all jobs are done.
    ///
    /// # Errors
    /// A chunk is torn, or cannot be read.
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

    /// Largest share of lost rays over the curves and wavelengths of `job`;
    /// NaN if it is not done.
    ///
    /// # Errors
    /// The chunk is torn, or cannot be read.
    pub fn lost_share(&self, job: u64) -> Result<f64, StoreError> {
        let array = &self.layout.lost;
        let share: Vec<f64> = array
            .retrieve_chunk(&[job])
            .map_err(|error| self.damaged(array, &error))?;
        Ok(share.first().copied().unwrap_or(f64::NAN))
    }

    /// The spectra of `job`, one per curve in storage order, each with the largest
    /// lost share of the job; `None` if it is not done.
    ///
    /// # Errors
    /// A chunk cannot be read.
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
        let kinds: &[[Variable; 4]] = match self.has_diffuse() {
            true => &[Variable::ALL, Variable::DIFFUSE],
            false => &[Variable::ALL],
        };
        let mut read = Vec::new();
        for kind in kinds {
            let four: Result<Vec<_>, _> = kind.iter().map(|quantity| values(*quantity)).collect();
            read.push(four?);
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
            // those of isotropic light follow those of the angles of each thickness
            let (kind, row) = match light.checked_sub(angles) {
                None => (0, slab * angles + light),
                Some(_) => (1, slab),
            };
            let [t, r, t_se, r_se] = [0, 1, 2, 3].map(|i| read[kind][i].as_slice());
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
