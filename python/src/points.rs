//! Look-ups at many points in parallel.
use numpy::PyReadonlyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::ThreadPool;
use rayon::prelude::*;
use splitsnow::lookup::{Lookup, LookupError, Varsa2025};
use splitsnow::parameter::Point;

/// Number of rows per task; fewer are not worth waking a thread.
const TASK: usize = 1024;

/// Index of the point whose look-up failed, and the error.
pub(crate) type Failure = (usize, Box<LookupError>);

/// A prepared look-up method.
pub(crate) enum Method<'a> {
    Smooth(&'a Lookup),
    Varsa2025(Varsa2025<'a>),
}

impl Method<'_> {
    fn spectrum(&self, point: Point, spectrum: &mut [f32]) -> Result<(), LookupError> {
        match self {
            Self::Smooth(lookup) => lookup.spectrum(point, spectrum),
            Self::Varsa2025(published) => {
                spectrum.copy_from_slice(&published.spectrum(point)?);
                Ok(())
            }
        }
    }
}

/// Coordinates on the five core axes; each column has one value for all points or one per
/// point.
pub(crate) struct Points<'a> {
    columns: [&'a [f64]; 5],
    count: usize,
}

impl<'a> Points<'a> {
    /// The points of the broadcast `shape`, in row-major order.
    pub(crate) fn new(columns: &'a [PyReadonlyArray1<f64>; 5], shape: &[usize]) -> PyResult<Self> {
        let count = shape.iter().product();
        let mut slices = [&[][..]; 5];
        for (slice, column) in slices.iter_mut().zip(columns) {
            *slice = column.as_slice()?;
            if slice.len() != 1 && slice.len() != count {
                let found = slice.len();
                let message = format!("a coordinate has {found} values; expected 1 or {count}");
                return Err(PyValueError::new_err(message));
            }
        }
        let columns = slices;
        Ok(Self { columns, count })
    }

    pub(crate) fn count(&self) -> usize {
        self.count
    }

    fn point(&self, index: usize) -> Point {
        let value = |axis: usize| match self.columns[axis] {
            [value] => *value,
            values => values[index],
        };
        Point::from_core(std::array::from_fn(value))
    }

    /// Looks up the spectrum of each point (`wavelengths` values) and writes it with
    /// `finish` to the row of the point in `rows`, `[count][width]`.
    ///
    /// # Errors
    /// The failure of the first point that has one.
    pub(crate) fn fill<T: Send>(
        &self,
        pool: &ThreadPool,
        method: &Method,
        wavelengths: usize,
        (rows, width): (&mut [T], usize),
        finish: impl Fn(&[f32], &mut [T]) + Sync,
    ) -> Result<(), Failure> {
        let task = |(number, rows): (usize, &mut [T])| {
            let mut spectrum = vec![0.0; wavelengths];
            for (i, row) in rows.chunks_exact_mut(width).enumerate() {
                let index = number * TASK + i;
                let result = method.spectrum(self.point(index), &mut spectrum);
                result.map_err(|error| (index, Box::new(error)))?;
                finish(&spectrum, row);
            }
            Ok(())
        };
        if self.count <= TASK {
            return task((0, rows));
        }
        let tasks = || {
            let tasks = rows.par_chunks_mut(TASK * width).enumerate();
            let failures = tasks.filter_map(|rows| task(rows).err());
            failures.min_by_key(|(index, _)| *index)
        };
        pool.install(tasks).map_or(Ok(()), Err)
    }
}

/// The `ValueError` for a failed look-up, with its position in the broadcast arguments.
pub(crate) fn failure_exception((index, error): Failure, shape: &[usize]) -> PyErr {
    let mut rest = index;
    let mut position: Vec<usize> = Vec::new();
    for length in shape.iter().rev() {
        position.push(rest % length);
        rest /= length;
    }
    position.reverse();
    PyValueError::new_err(match shape {
        [] => error.to_string(),
        _ => format!("element {position:?}: {error}"),
    })
}
