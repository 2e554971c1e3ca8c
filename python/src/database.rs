//! Look-ups in a compact file.
use std::path::PathBuf;
use std::sync::Arc;

use numpy::{PyArray1, PyReadonlyArray1, PyReadwriteArray2};
use pyo3::exceptions::{PyFileNotFoundError, PyOSError, PyValueError};
use pyo3::prelude::*;
use rayon::ThreadPool;
use rayon::prelude::*;
use splitsnow::lookup::{self, Lookup, LookupError, Varsa2025};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Parameter, Point};
use splitsnow::spectrum::Resampling;

use crate::cache::Cache;
use crate::colour::{ColourConverter, PyIlluminant};
use crate::points::{Method, Points, failure_exception};
use crate::pool::pool;

/// Capacity of each cache. A prepared look-up of a `linear` file may take 1 GB.
const CACHE_SIZE: usize = 8;

/// A look-up request: quantity, method, values of optional axes by name.
type Request = (String, String, Vec<(String, f64)>);

/// Cache key of a prepared look-up.
type Key = (Quantity, Conditions);

/// Values on optional axes, as bits.
pub(crate) type Conditions = Vec<(Parameter, u64)>;

/// A compact file in memory, with caches of prepared look-ups and colour converters.
#[pyclass(frozen)]
pub(crate) struct Database {
    file: lookup::Database,
    lookups: Cache<Key, Lookup>,
    converters: Cache<(String, PyIlluminant), ColourConverter>,
}

/// The Python exception for an error in reading a file or preparing a look-up.
pub(crate) fn to_exception(error: LookupError) -> PyErr {
    match error {
        LookupError::Io { path, source } => match source.raw_os_error() {
            // with its number it becomes the matching subclass, e.g. FileNotFoundError
            Some(number) => PyOSError::new_err((number, source.to_string(), path)),
            None => PyOSError::new_err(format!("cannot read {}: {source}", path.display())),
        },
        other @ LookupError::NoCompactFile { .. } => {
            PyFileNotFoundError::new_err(other.to_string())
        }
        other => PyValueError::new_err(other.to_string()),
    }
}

pub(crate) fn quantity(name: &str) -> PyResult<Quantity> {
    let found = Quantity::ALL.into_iter().find(|q| q.name() == name);
    let names = Quantity::ALL.map(Quantity::name).join(", ");
    let message =
        || PyValueError::new_err(format!("no quantity is named `{name}`; use one of {names}"));
    found.ok_or_else(message)
}

#[pymethods]
impl Database {
    #[new]
    fn open(py: Python, path: PathBuf) -> PyResult<Self> {
        let file = py
            .detach(|| lookup::Database::open(&path))
            .map_err(to_exception)?;
        Ok(Self {
            file,
            lookups: Cache::new(CACHE_SIZE),
            converters: Cache::new(CACHE_SIZE),
        })
    }

    #[getter]
    fn wavelengths_nm<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.file.wavelengths_nm())
    }

    /// Name and values of each axis, slowest first.
    #[getter]
    fn axes<'py>(&self, py: Python<'py>) -> Vec<(&'static str, Bound<'py, PyArray1<f64>>)> {
        let axes = self.file.axes().iter();
        axes.map(|(parameter, values)| (parameter.name(), PyArray1::from_slice(py, values)))
            .collect()
    }

    /// Name and number of components of each quantity.
    #[getter]
    fn components(&self) -> Vec<(&'static str, usize)> {
        let stored = Quantity::ALL.into_iter().filter(|q| self.file.has(*q));
        stored
            .map(|q| (q.name(), self.file.components(q)))
            .collect()
    }

    #[getter]
    fn basis(&self) -> &'static str {
        self.file.basis_kind().name()
    }

    #[getter]
    fn precision(&self) -> &'static str {
        self.file.precision().name()
    }

    #[getter]
    fn metadata(&self) -> std::collections::BTreeMap<String, String> {
        self.file.metadata().clone()
    }

    /// Writes the spectra at points of the broadcast `shape` to `out`, `[points,
    /// wavelengths]`.
    fn spectra(
        &self,
        py: Python,
        request: Request,
        points: [PyReadonlyArray1<f64>; 5],
        shape: Vec<usize>,
        wavelengths_nm: Option<Vec<f64>>,
        mut out: PyReadwriteArray2<f32>,
    ) -> PyResult<()> {
        let resampling = wavelengths_nm.map(|to| Resampling::new(self.file.wavelengths_nm(), &to));
        let width = out.as_array().ncols();
        self.fill(
            py,
            &request,
            (&points, &shape),
            (out.as_slice_mut()?, width),
            |spectrum, row| match &resampling {
                Some(resampling) => resampling.write(spectrum, row),
                None => row.copy_from_slice(spectrum),
            },
        )
    }

    /// Writes the colours at points of the broadcast `shape` to `out`, `[points, 3]`.
    fn colours(
        &self,
        py: Python,
        request: Request,
        points: [PyReadonlyArray1<f64>; 5],
        shape: Vec<usize>,
        viewing: (String, PyIlluminant),
        mut out: PyReadwriteArray2<f64>,
    ) -> PyResult<()> {
        let converter = self.converters.get(viewing.clone(), || {
            ColourConverter::new(self.file.wavelengths_nm(), &viewing)
        })?;
        self.fill(
            py,
            &request,
            (&points, &shape),
            (out.as_slice_mut()?, 3),
            |spectrum, row| {
                let spectrum: Vec<f64> = spectrum.iter().map(|v| f64::from(*v)).collect();
                row.copy_from_slice(&converter.colour(&spectrum));
            },
        )
    }

    /// Writes the curves at the nodes, row-major over the axes, to `out`, `[s, l]`.
    fn nodes(&self, py: Python, name: &str, mut out: PyReadwriteArray2<f32>) -> PyResult<()> {
        let (quantity, pool) = (quantity(name)?, pool(py)?);
        let l = self.file.wavelengths_nm().len();
        let rows = out.as_slice_mut()?;
        py.detach(|| {
            let copy = |(row, into): (usize, &mut [f32])| {
                let curve = self.file.curve(row, quantity).unwrap_or_default();
                into.iter_mut()
                    .zip(curve)
                    .for_each(|(into, value)| *into = value);
            };
            pool.install(|| rows.par_chunks_exact_mut(l).enumerate().for_each(copy));
        });
        Ok(())
    }
}

impl Database {
    /// The compact file.
    pub(crate) fn file(&self) -> &lookup::Database {
        &self.file
    }

    fn fill<T: Send>(
        &self,
        py: Python,
        (name, method, conditions): &Request,
        (columns, shape): (&[PyReadonlyArray1<f64>; 5], &[usize]),
        (rows, width): (&mut [T], usize),
        finish: impl Fn(&[f32], &mut [T]) + Sync + Send,
    ) -> PyResult<()> {
        let quantity = quantity(name)?;
        let optional = optional_point(conditions)?;
        let points = Points::new(columns, shape, (rows.len(), width))?;
        let pool = pool(py)?;
        let l = self.file.wavelengths_nm().len();
        let run = |pool: &ThreadPool| -> PyResult<()> {
            let lookup;
            let method = match method.as_str() {
                "smooth" => {
                    lookup = self.lookup(quantity, optional).map_err(to_exception)?;
                    Method::Smooth(&lookup)
                }
                "varsa2025" => {
                    let published = Varsa2025::new(&self.file, quantity).map_err(to_exception)?;
                    // an error for axes that are not in the file, or values outside its axes
                    self.file.at(optional).map_err(to_exception)?;
                    Method::Varsa2025(published)
                }
                other => {
                    let message = format!("no method is named `{other}`; use smooth or varsa2025");
                    return Err(PyValueError::new_err(message));
                }
            };
            let filled = points.fill(pool, &method, l, (rows, width), finish);
            filled.map_err(|failure| failure_exception(failure, shape))
        };
        py.detach(|| run(&pool))
    }

    /// The look-up of `quantity` at these values of the optional axes.
    fn lookup(&self, quantity: Quantity, optional: Point) -> Result<Arc<Lookup>, LookupError> {
        self.lookups.get((quantity, bits(optional)), || {
            // anisotropy factors are refused before values of their axes are asked for
            match self.file.holds_anisotropy() {
                true => Lookup::new(&self.file, quantity),
                false => Lookup::new(&self.file.at(optional)?, quantity),
            }
        })
    }
}

/// The values of `optional`, for a cache key.
pub(crate) fn bits(optional: Point) -> Conditions {
    let values = optional.iter();
    values
        .map(|(axis, value)| (axis, value.to_bits()))
        .collect()
}

/// The point with these values of optional axes, given by name. A view is accepted, because the
/// files say best whether they have that axis.
pub(crate) fn optional_point(values: &[(String, f64)]) -> PyResult<Point> {
    let coordinate = |(name, value): &(String, f64)| {
        let axis = Parameter::named(name).filter(|axis| axis.is_optional());
        let axis = axis.ok_or_else(|| {
            let optional = Parameter::ALL.into_iter();
            let optional = optional.filter(|axis| axis.is_optional() && !axis.is_view());
            let names: Vec<_> = optional.map(Parameter::name).collect();
            let names = names.join(", ");
            PyValueError::new_err(format!(
                "no optional axis is named `{name}`; use one of {names}"
            ))
        })?;
        if value.is_nan() {
            let message = format!("{name} = NaN is outside the database; give a number");
            return Err(PyValueError::new_err(message));
        }
        Ok((axis, *value))
    };
    values.iter().map(coordinate).collect()
}

/// Name in files, unit and long name of every parameter that can be an axis.
#[pyfunction]
pub(crate) fn parameters() -> Vec<[&'static str; 3]> {
    let description = |parameter: Parameter| {
        let record = parameter.record();
        [record.name, record.unit, record.long_name]
    };
    Parameter::ALL.map(description).into()
}
