//! Look-ups of the light toward views, in two compact files.
use std::path::{Path, PathBuf};
use std::sync::Arc;

use numpy::{PyArray1, PyReadonlyArray1, PyReadwriteArray2};
use pyo3::exceptions::{PyFileNotFoundError, PyValueError};
use pyo3::prelude::*;
use splitsnow::lookup::{self, DirectionalQuantity, LookupError, VIEWS, VIEWS_DIFFUSE};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::Point;
use splitsnow::spectrum::Resampling;

use crate::cache::Cache;
use crate::database::{Conditions, bits, optional_point, to_exception};
use crate::points::{Method, Points, failure_exception};
use crate::pool::pool;

/// File name of the compact file of reflectance and transmittance under diffuse light.
const DIFFUSE: &str = "diffuse.safetensors";
/// Metadata key of the description of the light, which begins with [`DIFFUSE_LIGHT`] if it is
/// diffuse.
const ILLUMINATION: &str = "illumination";
const DIFFUSE_LIGHT: &str = "diffuse";
/// Capacity of the cache. A prepared look-up of two `linear` quantities may take 2 GB.
const CACHE_SIZE: usize = 4;

/// A look-up request: name of the quantity, values of optional axes by name.
type Request = (String, Vec<(String, f64)>);

/// The compact files of one kind of light in memory, with a cache of prepared look-ups.
#[pyclass(frozen)]
pub(crate) struct Directions {
    database: lookup::Database,
    anisotropy: lookup::Database,
    diffuse: bool,
    prepared: Cache<Conditions, lookup::Directions>,
}

#[pymethods]
impl Directions {
    /// Opens two compact files, or those of an output directory.
    #[new]
    fn open(
        py: Python,
        path: PathBuf,
        anisotropy_path: Option<PathBuf>,
        diffuse: bool,
    ) -> PyResult<Self> {
        let files = py.detach(|| read(&path, anisotropy_path.as_deref(), diffuse));
        let (database, anisotropy) = files?;
        Ok(Self {
            database,
            anisotropy,
            diffuse,
            prepared: Cache::new(CACHE_SIZE),
        })
    }

    #[getter]
    fn wavelengths_nm<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.database.wavelengths_nm())
    }

    /// Name and values of each axis, slowest first.
    #[getter]
    fn axes<'py>(&self, py: Python<'py>) -> Vec<(&'static str, Bound<'py, PyArray1<f64>>)> {
        let axes = self.anisotropy.axes().iter();
        axes.map(|(parameter, values)| (parameter.name(), PyArray1::from_slice(py, values)))
            .collect()
    }

    /// Names of the quantities that both files hold.
    #[getter]
    fn quantities(&self) -> Vec<&'static str> {
        let both = |quantity| self.database.has(quantity) && self.anisotropy.has(quantity);
        let stored = DirectionalQuantity::ALL.into_iter().filter(|q| match q {
            DirectionalQuantity::TransmittanceFactor => both(Quantity::Transmittance),
            _ => both(Quantity::Reflectance),
        });
        stored.map(|q| q.name(self.diffuse)).collect()
    }

    /// Writes the spectra at points of the broadcast `shape` to `out`, `[points,
    /// wavelengths]`. The last two coordinates are those of the view.
    fn spectra(
        &self,
        py: Python,
        request: Request,
        points: [PyReadonlyArray1<f64>; 7],
        shape: Vec<usize>,
        wavelengths_nm: Option<Vec<f64>>,
        mut out: PyReadwriteArray2<f32>,
    ) -> PyResult<()> {
        let (name, conditions) = request;
        let quantity = quantity(&name, self.diffuse)?;
        let optional = optional_point(&conditions)?;
        if let Some((axis, _)) = optional.iter().find(|(axis, _)| axis.is_view()) {
            let key = axis.key();
            let message = format!("{key} is an argument of its own; leave it out of conditions");
            return Err(PyValueError::new_err(message));
        }
        let width = out.as_array().ncols();
        let rows = out.as_slice_mut()?;
        let points = Points::new(&points, &shape, (rows.len(), width))?;
        let own = self.database.wavelengths_nm();
        let resampling = wavelengths_nm.map(|to| Resampling::new(own, &to));
        let finish = |spectrum: &[f32], row: &mut [f32]| match &resampling {
            Some(resampling) => resampling.write(spectrum, row),
            None => row.copy_from_slice(spectrum),
        };
        let pool = pool(py)?;
        py.detach(|| {
            let directions = self.prepared(optional).map_err(to_exception)?;
            let method = Method::Directional(&directions, quantity);
            let filled = points.fill(&pool, &method, own.len(), (rows, width), finish);
            filled.map_err(|failure| failure_exception(failure, &shape))
        })
    }
}

impl Directions {
    /// The look-up at these values of the optional axes.
    fn prepared(&self, optional: Point) -> Result<Arc<lookup::Directions>, LookupError> {
        self.prepared.get(bits(optional), || {
            lookup::Directions::new(&self.database.at(optional)?, &self.anisotropy.at(optional)?)
        })
    }
}

/// Reads the file of reflectance and transmittance and that of anisotropy factors, and checks
/// that they belong together.
fn read(
    path: &Path,
    anisotropy_path: Option<&Path>,
    diffuse: bool,
) -> PyResult<(lookup::Database, lookup::Database)> {
    let anisotropy_path = match anisotropy_path {
        Some(file) => file.to_owned(),
        None if path.is_file() => {
            let path = path.display();
            let message = format!(
                "{path} is a single file; give the output directory, or the files of reflectance and of anisotropy factors"
            );
            return Err(PyValueError::new_err(message));
        }
        None if diffuse => part(path, VIEWS_DIFFUSE, "axes.view_deg and axes.diffuse = true")?,
        None => part(path, VIEWS, "axes.view_deg")?,
    };
    let database = if diffuse && path.is_dir() {
        lookup::Database::open(part(path, DIFFUSE, "axes.diffuse = true")?)
    } else {
        lookup::Database::open(path)
    };
    let database = database.map_err(to_exception)?;
    let light = database.metadata().get(ILLUMINATION);
    if light.is_some_and(|light| light.starts_with(DIFFUSE_LIGHT) != diffuse) {
        let (path, [of, other]) = (path.display(), lights(!diffuse));
        let message = format!(
            "{path} is of {of} light, not {other}; open it with diffuse={}",
            python(!diffuse)
        );
        return Err(PyValueError::new_err(message));
    }
    let anisotropy = lookup::Database::open(anisotropy_path).map_err(to_exception)?;
    lookup::Directions::check(&database, &anisotropy).map_err(to_exception)?;
    Ok((database, anisotropy))
}

/// The file of this name in the directory `path`, if it exists; a grid has it with `keys`.
fn part(path: &Path, name: &str, keys: &str) -> PyResult<PathBuf> {
    let file = path.join(name);
    if file.exists() {
        return Ok(file);
    }
    let path = path.display();
    let message =
        format!("no {name} in {path}; `splitsnow build` writes it for a grid with {keys}");
    Err(PyFileNotFoundError::new_err(message))
}

/// The kind of light that `diffuse` means, and the other one.
fn lights(diffuse: bool) -> [&'static str; 2] {
    if diffuse {
        ["diffuse", "collimated"]
    } else {
        ["collimated", "diffuse"]
    }
}

/// A truth value as in Python.
fn python(value: bool) -> &'static str {
    if value { "True" } else { "False" }
}

/// The quantity with this name under light of this kind.
fn quantity(name: &str, diffuse: bool) -> PyResult<DirectionalQuantity> {
    let named = |diffuse| {
        let mut all = DirectionalQuantity::ALL.into_iter();
        all.find(move |quantity| quantity.name(diffuse) == name)
    };
    if let Some(quantity) = named(diffuse) {
        return Ok(quantity);
    }
    let message = match named(!diffuse) {
        Some(quantity) => {
            let ([of, needed], own) = (lights(diffuse), quantity.name(diffuse));
            let other = python(!diffuse);
            format!(
                "{name} needs {needed} light and the files are of {of} light; ask for {own}, or open them with diffuse={other}"
            )
        }
        None => {
            let names = DirectionalQuantity::ALL.map(|quantity| quantity.name(diffuse));
            let names = names.join(", ");
            format!("no quantity is named `{name}`; use one of {names}")
        }
    };
    Err(PyValueError::new_err(message))
}
