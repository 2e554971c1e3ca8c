//! Reading and checking of a database.
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use ndarray::Array2;
use zarrs::array::ArrayError;

use super::job::JOBS;
use super::layout::ZarrArray;
use super::{ROOT, Store, StoreError, file};
use crate::measurement::{Measured, Quantity, Spectrum};
use crate::parameter::Parameter;

/// An array of spectra in the database.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Variable {
    /// Whether it belongs to transmitted or reflected light.
    pub quantity: Quantity,
    /// Whether the light is diffuse (isotropic). The array then has no axes of the incidence
    /// angle and the azimuth.
    pub is_diffuse: bool,
    /// Whether the values are factors toward views. The array then has the axes of the view.
    pub is_view: bool,
    /// Whether the values are standard errors.
    pub is_error: bool,
}

impl Variable {
    /// Directional-hemispherical transmittance.
    pub const TRANSMITTANCE: Self = Self::of(Quantity::Transmittance);

    /// Directional-hemispherical reflectance.
    pub const REFLECTANCE: Self = Self::of(Quantity::Reflectance);

    /// Reflectance and transmittance of collimated light and their standard errors, in the order
    /// in which the chunks of a job are written.
    pub const ALL: [Self; 4] = [
        Self::TRANSMITTANCE,
        Self::REFLECTANCE,
        Self::TRANSMITTANCE.se(),
        Self::REFLECTANCE.se(),
    ];

    /// Directional-hemispherical reflectance or transmittance.
    #[must_use]
    pub const fn of(quantity: Quantity) -> Self {
        Self {
            quantity,
            is_diffuse: false,
            is_view: false,
            is_error: false,
        }
    }

    /// The variables of a database, in the order in which the chunks of a job are written.
    pub(super) fn stored(diffuse: bool, views: bool) -> Vec<Self> {
        let mut variables = Self::ALL.to_vec();
        if diffuse {
            variables.extend(Self::ALL.map(Self::diffuse));
        }
        if views {
            let toward = variables.iter().map(|variable| variable.toward_views());
            variables.extend(toward.collect::<Vec<_>>());
        }
        variables
    }

    /// The same under diffuse light.
    #[must_use]
    pub const fn diffuse(mut self) -> Self {
        self.is_diffuse = true;
        self
    }

    /// The same toward views: reflectance and transmittance factors.
    #[must_use]
    pub const fn toward_views(mut self) -> Self {
        self.is_view = true;
        self
    }

    /// Whether its array has the axis of `parameter`, if the database has it. Diffuse light has
    /// neither an incidence angle nor an azimuth.
    #[must_use]
    pub const fn has_axis(self, parameter: Parameter) -> bool {
        match parameter {
            Parameter::View => self.is_view,
            Parameter::RelativeAzimuth => self.is_view && !self.is_diffuse,
            Parameter::Incidence => !self.is_diffuse,
            _ => true,
        }
    }

    /// The standard error of the variable.
    #[must_use]
    pub const fn se(mut self) -> Self {
        self.is_error = true;
        self
    }

    /// Name of the array. Factors toward views have the names of Schaepman-Strub et al. (2006).
    #[must_use]
    pub const fn name(self) -> &'static str {
        use Quantity::{Reflectance, Transmittance};
        match (self.quantity, self.is_view, self.is_diffuse, self.is_error) {
            (Transmittance, false, false, false) => "transmittance",
            (Transmittance, false, false, true) => "transmittance_se",
            (Transmittance, false, true, false) => "transmittance_diffuse",
            (Transmittance, false, true, true) => "transmittance_diffuse_se",
            (Transmittance, true, false, false) => "btf",
            (Transmittance, true, false, true) => "btf_se",
            (Transmittance, true, true, false) => "hdtf",
            (Transmittance, true, true, true) => "hdtf_se",
            (Reflectance, false, false, false) => "reflectance",
            (Reflectance, false, false, true) => "reflectance_se",
            (Reflectance, false, true, false) => "reflectance_diffuse",
            (Reflectance, false, true, true) => "reflectance_diffuse_se",
            (Reflectance, true, false, false) => "brf",
            (Reflectance, true, false, true) => "brf_se",
            (Reflectance, true, true, false) => "hdrf",
            (Reflectance, true, true, true) => "hdrf_se",
        }
    }

    /// Description of the variable, as stored in the attribute `long_name`.
    #[must_use]
    pub const fn long_name(self) -> &'static str {
        use Quantity::{Reflectance, Transmittance};
        match (self.quantity, self.is_view, self.is_diffuse, self.is_error) {
            (Transmittance, false, false, false) => "directional-hemispherical transmittance",
            (Transmittance, false, false, true) => "standard error of the transmittance",
            (Transmittance, false, true, false) => {
                "bi-hemispherical transmittance of isotropic light"
            }
            (Transmittance, false, true, true) => {
                "standard error of the transmittance of isotropic light"
            }
            (Transmittance, true, false, false) => "bidirectional transmittance factor (BTF)",
            (Transmittance, true, false, true) => "standard error of the BTF",
            (Transmittance, true, true, false) => {
                "hemispherical-directional transmittance factor (HDTF) of isotropic light"
            }
            (Transmittance, true, true, true) => "standard error of the HDTF",
            (Reflectance, false, false, false) => "directional-hemispherical reflectance",
            (Reflectance, false, false, true) => "standard error of the reflectance",
            (Reflectance, false, true, false) => "bi-hemispherical reflectance of isotropic light",
            (Reflectance, false, true, true) => {
                "standard error of the reflectance of isotropic light"
            }
            (Reflectance, true, false, false) => "bidirectional reflectance factor (BRF)",
            (Reflectance, true, false, true) => "standard error of the BRF",
            (Reflectance, true, true, false) => {
                "hemispherical-directional reflectance factor (HDRF) of isotropic light"
            }
            (Reflectance, true, true, true) => "standard error of the HDRF",
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
    /// Damaged files of metadata and coordinates, and files of arrays that [`Store::build`] can
    /// write again without a simulation: paths within the database.
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
    /// Numbers of the jobs that are not in the arrays, increasing: those that are not done, and
    /// those that a build has not packed yet. Reads all files of the database.
    ///
    /// # Errors
    /// [`StoreError::Io`] if a file exists but cannot be read.
    pub fn missing(&self) -> Result<Vec<u64>, StoreError> {
        let survey = self.survey()?;
        let loose = survey.loose.into_iter();
        let loose = loose.flat_map(|pack| self.layout.packs.range(pack));
        let mut missing: Vec<u64> = survey.missing.into_iter().chain(loose).collect();
        missing.sort_unstable();
        Ok(missing)
    }

    /// Numbers of the jobs that are neither marked in the arrays nor have a file, increasing.
    /// Lists two directories and reads no file, so it does not see damage.
    ///
    /// # Errors
    /// [`StoreError::Io`] if a directory exists but cannot be read.
    pub fn unmarked(&self) -> Result<Vec<u64>, StoreError> {
        let mut marked = vec![false; self.layout.jobs.count() as usize];
        let first = self
            .root
            .join(self.layout.committed.chunk_key(&[0]).as_str());
        let folder = first.parent().unwrap_or(&self.root);
        let prefix = first.file_name().and_then(|name| name.to_str());
        let prefix = prefix.and_then(|name| name.strip_suffix('0'));
        let packs = numbered(folder, prefix.unwrap_or_default())?.into_iter();
        let packs = packs.filter(|pack| *pack < self.layout.packs.count());
        let packed = packs.flat_map(|pack| self.layout.packs.range(pack));
        for job in packed.chain(self.job_files()?) {
            if let Some(marked) = marked.get_mut(job as usize) {
                *marked = true;
            }
        }
        let jobs = (0..).zip(marked).filter(|(_, marked)| !marked);
        Ok(jobs.map(|(job, _)| job).collect())
    }

    /// Numbers of the jobs that have a file.
    pub(super) fn job_files(&self) -> Result<Vec<u64>, StoreError> {
        numbered(&self.dir.join(JOBS), "")
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
        let survey = self.survey()?;
        for pack in survey.loose {
            let files = self.unlike(pack)?.into_iter();
            let files = files.map(|path| {
                let within = path.strip_prefix(&self.root).unwrap_or(&path);
                within.display().to_string()
            });
            damaged.extend(files);
        }
        Ok(Integrity {
            jobs: self.layout.jobs.count(),
            missing: survey.missing,
            damaged,
            outdated,
        })
    }

    /// Calls `visit` with all spectra of a variable, in blocks `[spectra, wavelengths]` of
    /// consecutive ones in storage order: a pack each, where its spectra are consecutive.
    ///
    /// # Errors
    /// As [`read`](Self::read); the error of `visit`.
    pub(crate) fn visit<E: From<StoreError>>(
        &self,
        quantity: Variable,
        visit: &mut dyn FnMut(Array2<f32>) -> Result<(), E>,
    ) -> Result<(), E> {
        if quantity.is_view || !self.layout.has_consecutive_packs() {
            return visit(self.read(quantity)?);
        }
        let array = self.layout.quantity(quantity)?;
        let wavelengths = self.layout.jobs.wavelengths() as usize;
        let mut left = array.shape().iter().product::<u64>() as usize;
        for pack in 0..self.layout.packs.count() {
            let chunk = self.layout.pack_index(quantity, pack);
            let mut values: Vec<f32> = array
                .retrieve_chunk(&chunk)
                .map_err(|error| self.damaged(array, &error))?;
            // the last one may reach beyond the array
            values.truncate(left);
            left -= values.len();
            let shape = (values.len() / wavelengths, wavelengths);
            let block = Array2::from_shape_vec(shape, values);
            visit(block.map_err(StoreError::zarr(quantity.name()))?)?;
        }
        Ok(())
    }

    /// All spectra of a variable as an array [spectra, wavelengths], in storage order over the
    /// axes of its array. Jobs that are not done have NaN: check with
    /// [`missing`](Self::missing) first.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] if a chunk is damaged or cannot be read.
    pub fn read(&self, quantity: Variable) -> Result<Array2<f32>, StoreError> {
        let array = self.layout.quantity(quantity)?;
        let values: Vec<f32> = array
            .retrieve_array_subset(&array.subset_all())
            .map_err(|error| self.damaged(array, &error))?;
        let wavelengths = self.layout.jobs.wavelengths() as usize;
        let shape = (values.len() / wavelengths, wavelengths);
        Array2::from_shape_vec(shape, values).map_err(StoreError::zarr(quantity.name()))
    }

    /// The spectra of `job`, one per curve in storage order; each has the largest share of
    /// lost rays of the job. `None` if the job is not done.
    ///
    /// # Errors
    /// [`StoreError::Io`] if a file exists but cannot be read.
    pub fn spectra(&self, job: u64) -> Result<Option<Vec<Spectrum>>, StoreError> {
        let Some(record) = self.record(job)? else {
            return Ok(None);
        };
        let wavelengths = self.layout.jobs.wavelengths() as usize;
        let angles = self.layout.jobs.block_along(Parameter::Incidence);
        let lights = self.layout.lights();
        let variables: Vec<_> = self.layout.quantities().map(|(v, _)| v).collect();
        let values = |quantity: Variable| {
            let array = variables.iter().position(|other| *other == quantity);
            record.values(array.unwrap_or(usize::MAX))
        };
        let diffuse = self
            .has_diffuse()
            .then_some(Variable::ALL.map(Variable::diffuse));
        let groups = [Variable::ALL].into_iter().chain(diffuse);
        let chunks: Vec<_> = groups.map(|group| group.map(values)).collect();
        let lost = record.lost;
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

/// The numbers N of the files `prefix`N in `folder`, which need not exist.
fn numbered(folder: &Path, prefix: &str) -> Result<Vec<u64>, StoreError> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(StoreError::io("read", folder))?,
    };
    let mut numbers = Vec::new();
    for entry in entries {
        let name = entry.map_err(StoreError::io("read", folder))?.file_name();
        let number = name.to_str().and_then(|name| name.strip_prefix(prefix));
        numbers.extend(number.and_then(|number| number.parse::<u64>().ok()));
    }
    Ok(numbers)
}
