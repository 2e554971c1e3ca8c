//! Look-ups at many points in parallel.
use numpy::PyReadonlyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::ThreadPool;
use rayon::prelude::*;
use splitsnow::lookup::{DirectionalQuantity, Directions, Lookup, LookupError, Varsa2025};
use splitsnow::parameter::{Parameter, Point};
use splitsnow::units::HALF_SPACE_CM;

/// Number of rows per task; fewer are not worth waking a thread.
const TASK: usize = 1024;

/// Index of the point whose look-up failed, and the error.
pub(crate) type Failure = (usize, Box<LookupError>);

/// A prepared look-up method.
pub(crate) enum Method<'a> {
    Smooth(&'a Lookup),
    Varsa2025(Varsa2025<'a>),
    Directional(&'a Directions, DirectionalQuantity),
}

impl Method<'_> {
    fn spectrum(&self, point: Point, spectrum: &mut [f32]) -> Result<(), LookupError> {
        match self {
            Self::Smooth(lookup) => lookup.spectrum(point, spectrum),
            Self::Varsa2025(published) => {
                spectrum.copy_from_slice(&published.spectrum(point)?);
                Ok(())
            }
            Self::Directional(directions, quantity) => {
                directions.spectrum(*quantity, point, spectrum)
            }
        }
    }
}

/// Number of core axes.
const CORE: usize = Parameter::CORE.len();

/// Coordinates on the core axes, or on these and those of the view; each column has one value
/// for all points or one per point.
pub(crate) struct Points<'a> {
    core: [&'a [f64]; CORE],
    views: Vec<(Parameter, &'a [f64])>,
    count: usize,
}

impl<'a> Points<'a> {
    /// The points of the broadcast `shape`, in row-major order, for an output of so many values
    /// in rows of `width`.
    pub(crate) fn new(
        columns: &'a [PyReadonlyArray1<f64>],
        shape: &[usize],
        (values, width): (usize, usize),
    ) -> PyResult<Self> {
        let count = shape.iter().product();
        if width.checked_mul(count) != Some(values) || width == 0 {
            return Err(PyValueError::new_err(
                "the output array does not have the shape of the points",
            ));
        }
        let mut slices = Vec::with_capacity(columns.len());
        for column in columns {
            let slice = column.as_slice()?;
            if slice.len() != 1 && slice.len() != count {
                let found = slice.len();
                let message = format!("a coordinate has {found} values; expected 1 or {count}");
                return Err(PyValueError::new_err(message));
            }
            slices.push(slice);
        }
        let Some((core, views)) = slices.split_first_chunk() else {
            let message = format!("a point needs {CORE} coordinates or more");
            return Err(PyValueError::new_err(message));
        };
        let views = Parameter::VIEWS.into_iter().zip(views.iter().copied());
        Ok(Self {
            core: *core,
            views: views.collect(),
            count,
        })
    }

    fn point(&self, index: usize) -> Point {
        let value = |column: &[f64]| match column {
            [value] => *value,
            values => values[index],
        };
        let mut point = Point::from_core(self.core.map(value));
        if point.get(Parameter::Thickness) == Some(f64::INFINITY) {
            // files store a half space as this finite thickness
            point.set(Parameter::Thickness, HALF_SPACE_CM);
        }
        for (parameter, column) in &self.views {
            point.set(*parameter, value(column));
        }
        point
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
