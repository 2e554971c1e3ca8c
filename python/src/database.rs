//! A compact file and look-ups in it.
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use numpy::{PyArray1, PyReadonlyArray1, PyReadwriteArray2};
use pyo3::exceptions::{PyFileNotFoundError, PyOSError, PyValueError};
use pyo3::prelude::*;
use rayon::ThreadPool;
use rayon::prelude::*;
use splitsnow::lookup::{self, Lookup, LookupError, Varsa2025};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Parameter, Point};
use splitsnow::spectrum::Resampling;

use crate::colour::{Eye, Light};
use crate::points::{Method, Points, refused};
use crate::pool::pool;

/// Prepared look-ups kept, and observers; a look-up of a `linear` file may take 1 GB.
const KEPT: usize = 8;

/// What is looked up: quantity, method, values of optional axes by name.
type Asked = (String, String, Vec<(String, f64)>);

/// What a look-up is prepared for: its quantity and conditions, as bits.
type Key = (Quantity, Vec<(Parameter, u64)>);

/// A compact file in memory, with the look-ups prepared so far.
#[pyclass(frozen)]
pub(crate) struct Database {
    file: lookup::Database,
    prepared: Kept<Key, Lookup>,
    observers: Kept<(String, Light), Eye>,
}

/// What was made last, by what it is for.
struct Kept<K, V>(Mutex<Vec<(K, Arc<V>)>>);

impl<K: PartialEq, V> Kept<K, V> {
    /// What is for `key`, made if it must be. The lock is not held while it is: two
    /// threads may both make the same.
    fn get<E>(&self, key: K, make: impl FnOnce() -> Result<V, E>) -> Result<Arc<V>, E> {
        let lock = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, value)) = lock().iter().find(|(known, _)| *known == key) {
            return Ok(value.clone());
        }
        let value = Arc::new(make()?);
        let mut kept = lock();
        if kept.len() == KEPT {
            kept.remove(0);
        }
        kept.push((key, value.clone()));
        Ok(value)
    }
}

/// An error of reading a file or preparing a look-up.
fn failed(error: LookupError) -> PyErr {
    match error {
        LookupError::Io { path, source } => match source.raw_os_error() {
            // with its number it becomes FileNotFoundError and the like
            Some(number) => PyOSError::new_err((number, source.to_string(), path)),
            None => PyOSError::new_err(format!("cannot read {}: {source}", path.display())),
        },
        other @ LookupError::NoCompactFile { .. } => {
            PyFileNotFoundError::new_err(other.to_string())
        }
        other => PyValueError::new_err(other.to_string()),
    }
}

fn quantity(name: &str) -> PyResult<Quantity> {
    let found = Quantity::ALL.into_iter().find(|q| q.name() == name);
    let names = Quantity::ALL.map(Quantity::name).join(", ");
    let message =
        || PyValueError::new_err(format!("no quantity is named `{name}`; there are {names}"));
    found.ok_or_else(message)
}

#[pymethods]
impl Database {
    #[new]
    fn open(py: Python, path: PathBuf) -> PyResult<Self> {
        let file = py
            .detach(|| lookup::Database::open(&path))
            .map_err(failed)?;
        Ok(Self {
            file,
            prepared: Kept(Mutex::default()),
            observers: Kept(Mutex::default()),
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
        let there = Quantity::ALL.into_iter().filter(|q| self.file.has(*q));
        there.map(|q| (q.name(), self.file.components(q))).collect()
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

    /// Spectra at points in an answer of `shape`, into `out`, `[points, wavelengths]`.
    fn spectra(
        &self,
        py: Python,
        asked: Asked,
        points: [PyReadonlyArray1<f64>; 5],
        shape: Vec<usize>,
        wavelengths_nm: Option<Vec<f64>>,
        mut out: PyReadwriteArray2<f32>,
    ) -> PyResult<()> {
        let by = wavelengths_nm.map(|to| Resampling::new(self.file.wavelengths_nm(), &to));
        let width = out.as_array().ncols();
        self.fill(
            py,
            &asked,
            (&points, &shape),
            (out.as_slice_mut()?, width),
            |spectrum, row| match &by {
                Some(by) => by.write(spectrum, row),
                None => row.copy_from_slice(spectrum),
            },
        )
    }

    /// The same as colours, `[points, 3]`.
    fn colours(
        &self,
        py: Python,
        asked: Asked,
        points: [PyReadonlyArray1<f64>; 5],
        shape: Vec<usize>,
        seen: (String, Light),
        mut out: PyReadwriteArray2<f64>,
    ) -> PyResult<()> {
        let eye = self
            .observers
            .get(seen.clone(), || Eye::new(self.file.wavelengths_nm(), &seen))?;
        self.fill(
            py,
            &asked,
            (&points, &shape),
            (out.as_slice_mut()?, 3),
            |spectrum, row| {
                let spectrum: Vec<f64> = spectrum.iter().map(|v| f64::from(*v)).collect();
                row.copy_from_slice(&eye.sees(&spectrum));
            },
        )
    }

    /// The curves on the nodes, row-major over the axes, into `out`, `[s, l]`.
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
    fn fill<T: Send>(
        &self,
        py: Python,
        (name, method, conditions): &Asked,
        (columns, shape): (&[PyReadonlyArray1<f64>; 5], &[usize]),
        (rows, width): (&mut [T], usize),
        finish: impl Fn(&[f32], &mut [T]) + Sync + Send,
    ) -> PyResult<()> {
        let quantity = quantity(name)?;
        let optional = named(conditions)?;
        let points = Points::new(columns, shape)?;
        if width.checked_mul(points.count()) != Some(rows.len()) || width == 0 {
            return Err(PyValueError::new_err(
                "the answer has another shape than the points",
            ));
        }
        let pool = pool(py)?;
        let l = self.file.wavelengths_nm().len();
        let run = |pool: &ThreadPool| -> PyResult<()> {
            let lookup;
            let method = match method.as_str() {
                "smooth" => {
                    lookup = self.prepared(quantity, optional).map_err(failed)?;
                    Method::Smooth(&lookup)
                }
                "varsa2025" => {
                    let published = Varsa2025::new(&self.file, quantity).map_err(failed)?;
                    // refuses axes that the file has not, and values off the only one
                    self.file.at(optional).map_err(failed)?;
                    Method::Varsa2025(published)
                }
                other => {
                    let message =
                        format!("no method is named `{other}`; there are smooth, varsa2025");
                    return Err(PyValueError::new_err(message));
                }
            };
            let filled = points.fill(pool, &method, l, (rows, width), finish);
            filled.map_err(|error| refused(error, shape))
        };
        py.detach(|| run(&pool))
    }

    /// The look-up of `quantity` there.
    fn prepared(&self, quantity: Quantity, optional: Point) -> Result<Arc<Lookup>, LookupError> {
        let bits = optional
            .iter()
            .map(|(parameter, value)| (parameter, value.to_bits()));
        self.prepared.get((quantity, bits.collect()), || {
            Lookup::new(&self.file.at(optional)?, quantity)
        })
    }
}

/// Values of optional axes by their names.
fn named(values: &[(String, f64)]) -> PyResult<Point> {
    let one = |(name, value): &(String, f64)| {
        let axis = Parameter::named(name).filter(|axis| axis.is_optional());
        let axis = axis.ok_or_else(|| {
            let optional = Parameter::ALL.into_iter().filter(|axis| axis.is_optional());
            let names: Vec<_> = optional.map(Parameter::name).collect();
            let names = names.join(", ");
            PyValueError::new_err(format!("no axis is named `{name}`; there are {names}"))
        })?;
        if value.is_nan() {
            let message = format!("{name} = NaN is outside the database");
            return Err(PyValueError::new_err(message));
        }
        Ok((axis, *value))
    };
    values.iter().map(one).collect()
}

/// Name in files, unit and long name of every parameter that an axis may be of.
#[pyfunction]
pub(crate) fn parameters() -> Vec<[&'static str; 3]> {
    let about = |parameter: Parameter| {
        let record = parameter.record();
        [record.name, record.unit, record.long_name]
    };
    Parameter::ALL.map(about).into()
}
