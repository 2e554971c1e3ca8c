//! Compression of a database: singular value decomposition, the error of every
//! number of components, and the compact file (docs/methods.md; Varsa 2025,
//! sections 5.2, 6.5 and 8.2).
//!
//! Transmittance and reflectance are compressed apart, each with its own number
//! of components.
mod absent;
mod annotation;
mod bands;
mod choice;
mod compact;
mod errors;
mod fidelity;
mod model;
mod precision;
mod svd;
mod weight;

pub use annotation::annotated;
pub(crate) use bands::rmse_in;
pub use bands::{BandError, Bands, NOISE_FACTOR, Part};
pub use choice::{Bounds, Choice, DEFAULT_MAX_DELTA_E, DEFAULT_MAX_RMSE, choose};
pub use compact::{CompactError, CompactFile};
pub(crate) use errors::{BandTally, error_in};
pub use errors::{CurveError, ErrorRow, ErrorTable, InBand, Largest, Statistics};
pub use fidelity::{BandErrors, CurveErrors, errors_of};
pub use model::Model;
pub use precision::{Coefficients, Integers, Quantised};
pub use svd::Decomposition;

use ndarray::{Array2, ArrayView2};
use thiserror::Error;

use crate::colour::Colorimeter;
pub use crate::lookup::format::{BAND_ERRORS, BOUNDS, ERROR_TABLE, PROVENANCE};
pub use crate::lookup::{Basis, Precision};
use crate::measurement::Quantity;

/// Rows of the error table that are always there, if there are as many components.
const ROWS: usize = 12;

/// Why curves could not be compressed.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
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
        "with all {components} components the largest {name} is {reached:.3e}, not below {bound:e}: `{}` coefficients hold no more; raise the bound{}",
        precision.name(),
        if *precision == Precision::F32 { "" } else { ", or take f32" }
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
        /// The precision of the coefficients.
        precision: Precision,
    },
}

/// The variant of a compact file: how it holds both quantities.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Variant {
    /// What the components are of.
    pub basis: Basis,
    /// Numbers of the coefficients.
    pub precision: Precision,
}

/// A compressed matrix: row j of `coefficients` times `basis`^T gives spectrum
/// `j` as `kind` says.
#[derive(Debug, Clone, PartialEq)]
pub struct Compressed {
    /// What the components are of.
    pub kind: Basis,
    /// C', `[s, l']`.
    pub coefficients: Coefficients,
    /// V', `[l, l']`.
    pub basis: Array2<f32>,
    /// Errors per number of components, with the chosen one marked. If
    /// coefficients are quantised, they have 16 bits but in the chosen row.
    pub table: ErrorTable,
    /// The bounds that chose it, over all wavelengths.
    pub bounds: Bounds,
    /// The bands, with the bounds that chose it.
    pub bands: Bands,
}

impl Compressed {
    /// The number of components chosen, l'.
    #[must_use]
    pub fn components(&self) -> usize {
        self.basis.ncols()
    }

    /// The errors with the number of components chosen.
    #[must_use]
    pub fn errors(&self) -> Option<&ErrorRow> {
        let mut rows = self.table.rows.iter();
        rows.find(|row| row.components == self.components())
    }

    /// The same by band, by wavelength.
    #[must_use]
    pub fn band_errors(&self) -> Vec<BandError> {
        self.errors()
            .map_or(Vec::new(), |row| self.bands.errors(row))
    }

    /// How it is held.
    #[must_use]
    pub fn variant(&self) -> Variant {
        Variant {
            basis: self.kind,
            precision: self.coefficients.precision(),
        }
    }
}

/// Compresses `curves`, `[s, l]`, of `quantity`; `colour` and `bands` are of the same l
/// wavelengths. If a number is chosen by bounds, those that `bands` have are kept, too:
/// [`Bands::bounded`] has the defaults. Without them (`Bands::default()`) nothing bounds
/// what no eye sees, as long as there is a colour. Quantised coefficients have 8 bits where the bounds allow it and
/// 16 where they do not, or where there are no bounds.
///
/// # Errors
/// See [`CompressError`].
///
/// # Panics
/// If `colour` is of another number of wavelengths.
pub fn compress(
    curves: ArrayView2<f64>,
    quantity: Quantity,
    colour: Option<&Colorimeter>,
    bands: &Bands,
    choice: Choice,
    variant: Variant,
) -> Result<Compressed, CompressError> {
    let model = Model::new(curves, quantity, colour, bands, variant.basis)?;
    let bounds = choice.bounds(colour.is_some(), bands);
    let limit = model.rank_limit();
    let mut listed = match choice {
        Choice::Components(components) if !(1..=limit).contains(&components) => {
            return Err(CompressError::Components { components, limit });
        }
        Choice::Components(components) => components.max(ROWS),
        Choice::Bounds(_) => ROWS,
    };
    let (all, mut table, components) = loop {
        let all = model.coefficients(listed, variant.precision);
        let mut table = model.table(&all);
        if let Choice::Components(components) = choice {
            break (all, table, components);
        }
        match choose(&table, &bounds, bands, variant.precision) {
            Err(CompressError::Unreachable { .. }) if listed < limit => {
                listed = limit.min(2 * listed);
            }
            chosen => {
                let chosen = chosen?;
                table.rows.truncate(chosen.max(ROWS));
                break (all, table, chosen);
            }
        }
    };
    table.chosen = Some(components);
    let mut coefficients = all.first(components);
    if let (Choice::Bounds(_), Precision::Quantised) = (choice, variant.precision) {
        (coefficients, table.rows[components - 1]) = model.narrowed(components, &bounds)?;
    }
    Ok(Compressed {
        kind: variant.basis,
        coefficients,
        basis: model.basis(components),
        table,
        bounds,
        bands: bands.clone(),
    })
}
