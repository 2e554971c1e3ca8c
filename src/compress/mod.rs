//! Compression of a database: singular value decomposition, the error of every
//! number of components, and the compact file (docs/methods.md; Varsa 2025,
//! sections 5.2, 6.5 and 8.2).
//!
//! Transmittance and reflectance are compressed apart, each with its own number
//! of components.
mod choice;
mod compact;
mod errors;
pub(crate) mod format;
mod svd;

pub use choice::{Bounds, Choice, DEFAULT_MAX_RMSE, choose};
pub use compact::{CompactError, CompactFile};
pub(crate) use errors::add_component;
pub use errors::{CurveError, ErrorRow, ErrorTable, Statistics, error_table};
pub use format::{AXES, BOUNDS, Coordinate, ERROR_TABLE, PROVENANCE};
pub use svd::Decomposition;

use ndarray::{Array2, ArrayView2, Axis};
use thiserror::Error;

use crate::colour::Colorimeter;

/// Rows of the error table that are always there, if there are as many components.
const ROWS: usize = 12;

/// Why curves could not be compressed.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum CompressError {
    /// Nothing to compress.
    #[error(
        "a matrix of {rows} curves at {columns} wavelengths cannot be compressed: both must be at least 1"
    )]
    Empty {
        /// Curves.
        rows: usize,
        /// Wavelengths.
        columns: usize,
    },
    /// An entry is NaN, infinite or huge.
    #[error(
        "curve {row} has the value {value} at wavelength number {column} (both from 0); values must be finite and at most {max:e} in magnitude. NaN marks a curve that is not simulated yet: build the database first",
        max = svd::MAX_MAGNITUDE
    )]
    Value {
        /// Row of the matrix.
        row: usize,
        /// Column of the matrix.
        column: usize,
        /// The entry.
        value: f64,
    },
    /// The decomposition did not converge.
    #[error(
        "the singular value decomposition of the curves did not converge; please report this with the database"
    )]
    NoConvergence,
    /// More components asked for than exist.
    #[error("{components} components were asked for; this database has 1 to {limit}")]
    Components {
        /// What was asked for.
        components: usize,
        /// The most there are.
        limit: usize,
    },
    /// A bound that nothing can be below.
    #[error("{name} = {value} is not a bound; it must be a number above 0")]
    Bound {
        /// Which one.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// Even all components do not keep the bounds.
    #[error(
        "with all {components} components the largest {name} is {reached:.3e}, not below {bound:e}: f32 holds no more; raise the bound"
    )]
    Unreachable {
        /// The measure that fails.
        name: &'static str,
        /// Its bound.
        bound: f64,
        /// Its largest value over the curves.
        reached: f64,
        /// All there are.
        components: usize,
    },
}

/// A compressed matrix: spectrum `j` is row j of `coefficients` times `basis`^T.
#[derive(Debug, Clone, PartialEq)]
pub struct Compressed {
    /// C', `[s, l']`.
    pub coefficients: Array2<f32>,
    /// V', `[l, l']`.
    pub basis: Array2<f32>,
    /// Errors per number of components, with the chosen one marked.
    pub table: ErrorTable,
    /// The bounds that chose it.
    pub bounds: Bounds,
}

impl Compressed {
    /// The number of components chosen, l'.
    #[must_use]
    pub fn components(&self) -> usize {
        self.basis.ncols()
    }
}

/// Compresses `curves`, `[s, l]`; `colour` is of the same l wavelengths.
///
/// # Errors
/// See [`CompressError`].
///
/// # Panics
/// If `colour` is of another number of wavelengths.
pub fn compress(
    curves: ArrayView2<f64>,
    colour: Option<&Colorimeter>,
    choice: Choice,
) -> Result<Compressed, CompressError> {
    let decomposition = Decomposition::new(curves)?;
    let limit = decomposition.rank_limit();
    let first = match choice {
        Choice::Components(components) if !(1..=limit).contains(&components) => {
            return Err(CompressError::Components { components, limit });
        }
        Choice::Components(components) => components.max(ROWS),
        Choice::Bounds(_) => ROWS,
    };
    let mut table = error_table(curves, &decomposition, colour, first);
    let components = match choice {
        Choice::Components(components) => components,
        Choice::Bounds(bounds) => match choose(&table, &bounds) {
            Err(CompressError::Unreachable { .. }) if first < limit => {
                table = error_table(curves, &decomposition, colour, limit);
                let chosen = choose(&table, &bounds)?;
                table.rows.truncate(chosen);
                chosen
            }
            chosen => chosen?,
        },
    };
    table.chosen = Some(components);
    let (kept, _) = decomposition.basis.view().split_at(Axis(1), components);
    let coefficients = Array2::from_shape_fn((curves.nrows(), components), |(row, column)| {
        errors::coefficient(curves.row(row), kept.column(column))
    });
    Ok(Compressed {
        coefficients,
        basis: kept.mapv(|v| v as f32),
        table,
        bounds: choice.bounds(colour.is_some()),
    })
}
