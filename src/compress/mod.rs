//! Compression of a database: singular value decomposition, the error of every
//! number of components, and the compact file (docs/methods.md; Varsa 2025,
//! sections 5.2, 6.5 and 8.2).
//!
//! Transmittance and reflectance are compressed separately, each with its own
//! number of components. So are the anisotropy factors of a database with views.
mod absent;
mod anisotropy;
mod annotation;
mod bands;
mod blocks;
mod choice;
mod compact;
mod errors;
mod fidelity;
mod model;
mod precision;
mod svd;
mod weight;

pub use anisotropy::AnisotropyFactors;
pub use annotation::with_metadata;
pub(crate) use bands::rmse_in;
pub use bands::{BandColumns, BandError, Bands, NOISE_FACTOR};
pub use blocks::CurveBlocks;
pub use choice::{Bounds, Choice, DEFAULT_MAX_DELTA_E, DEFAULT_MAX_RMSE, choose};
pub use compact::{CompactError, CompactFile};
pub use errors::{BandStatistics, CurveError, ErrorRow, ErrorStatistics, ErrorTable, MaxAbsError};
pub(crate) use errors::{BandTally, error_in};
pub use fidelity::{BandErrors, CurveErrors, curve_errors};
pub use model::CurveModel;
pub use precision::{Integers, Quantised, StoredCoefficients};
pub use svd::Decomposition;

use ndarray::Array2;
use thiserror::Error;

use crate::colour::Colorimeter;
pub use crate::lookup::format::{BAND_ERRORS, BOUNDS, ERROR_TABLE, PROVENANCE};
pub use crate::lookup::{Basis, Precision};
use crate::measurement::Quantity;
use crate::store::StoreError;

impl From<StoreError> for CompressError {
    fn from(error: StoreError) -> Self {
        Self::Read(error.to_string())
    }
}

/// Least number of rows in the error table, if there are as many components.
const ROWS: usize = 12;

/// The reason why curves could not be compressed.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum CompressError {
    /// There are no curves or no wavelengths.
    #[error(
        "a matrix of {rows} curves at {columns} wavelengths cannot be compressed: both must be at least 1"
    )]
    Empty {
        /// Number of curves.
        rows: usize,
        /// Number of wavelengths.
        columns: usize,
    },
    /// A value is NaN, infinite or above 1e6 in magnitude.
    #[error(
        "curve {row} has the value {value} at wavelength number {column} (both from 0); values must be finite and at most {max:e} in magnitude. NaN marks a curve that is not simulated yet: build the database first",
        max = svd::MAX_MAGNITUDE
    )]
    Value {
        /// Row of the matrix, from 0.
        row: usize,
        /// Column of the matrix, from 0.
        column: usize,
        /// The value found.
        value: f64,
    },
    /// Curves could not be read.
    #[error("{0}")]
    Read(String),
    /// The decomposition did not converge.
    #[error(
        "the singular value decomposition of the curves did not converge; please report this with the database"
    )]
    NoConvergence,
    /// The request names more components than exist.
    #[error(
        "{components} components were requested; this database has 1 to {limit}; ask for one of these numbers"
    )]
    Components {
        /// The number requested.
        components: usize,
        /// The largest number possible.
        limit: usize,
    },
    /// A bound is not above 0.
    #[error("{name} = {value} is not a bound; it must be a number above 0")]
    Bound {
        /// Name of the bound.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// Even with all components the errors exceed a bound.
    #[error(
        "with all {components} components the largest {name} is {reached:.3e}, not below {bound:e}: `{}` coefficients cannot be more accurate; raise the bound{}",
        precision.name(),
        if *precision == Precision::F32 { "" } else { ", or use f32" }
    )]
    Unreachable {
        /// The error measure that exceeds its bound.
        name: &'static str,
        /// Its bound.
        bound: f64,
        /// Its largest value over the curves.
        reached: f64,
        /// The number of all components.
        components: usize,
        /// The precision of the coefficients.
        precision: Precision,
    },
}

/// The variant of a compact file, the same for both quantities.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CompactVariant {
    /// Quantity that the components decompose.
    pub basis: Basis,
    /// Number format of the coefficients.
    pub precision: Precision,
}

/// A compressed matrix: row j of `coefficients` times `basis`^T gives spectrum `j`, in
/// the quantity that `kind` names.
#[derive(Debug, Clone, PartialEq)]
pub struct Compressed {
    /// Quantity that the components decompose.
    pub kind: Basis,
    /// Coefficients C', `[s, l']`.
    pub coefficients: StoredCoefficients,
    /// Basis V', `[l, l']`.
    pub basis: Array2<f32>,
    /// Errors per number of components, with the chosen number marked. Quantised
    /// coefficients have 16 bits in all rows but the chosen one.
    pub table: ErrorTable,
    /// The bounds over all wavelengths that decided the number of components.
    pub bounds: Bounds,
    /// The bands, with the bounds that decided the number of components.
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

    /// The errors of [`Self::errors`] by band, in the order of wavelengths.
    #[must_use]
    pub fn band_errors(&self) -> Vec<BandError> {
        self.errors()
            .map_or(Vec::new(), |row| self.bands.errors(row))
    }

    /// The basis and precision.
    #[must_use]
    pub fn variant(&self) -> CompactVariant {
        CompactVariant {
            basis: self.kind,
            precision: self.coefficients.precision(),
        }
    }
}

/// Compresses `curves`, `[s, l]`, of `quantity`. They are read several times, block by block, and
/// only their coefficients are kept. `colour` and `bands` have the same l
/// wavelengths. If `choice` gives bounds, the bounds of `bands` are kept as well;
/// [`Bands::bounded`] sets their defaults. With `Bands::default()` and a colour, nothing
/// bounds the errors at invisible wavelengths. Quantised coefficients have 8 bits where
/// the bounds allow it, and 16 where they do not or where there are no bounds.
///
/// # Errors
/// See [`CompressError`].
///
/// # Panics
/// If `colour` has another number of wavelengths.
pub fn compress(
    curves: impl CurveBlocks,
    quantity: Quantity,
    colour: Option<&Colorimeter>,
    bands: &Bands,
    choice: Choice,
    variant: CompactVariant,
) -> Result<Compressed, CompressError> {
    let model = CurveModel::new(curves, quantity, colour, bands, variant.basis)?;
    let bounds = choice.bounds(colour.is_some(), bands);
    let limit = model.rank_limit();
    let mut listed = match choice {
        Choice::Components(components) if !(1..=limit).contains(&components) => {
            return Err(CompressError::Components { components, limit });
        }
        Choice::Components(components) => components.max(ROWS),
        Choice::Bounds(_) => ROWS,
    };
    let (mut table, components) = loop {
        let mut table = model.table(listed, variant.precision)?;
        if let Choice::Components(components) = choice {
            break (table, components);
        }
        match choose(&table, &bounds, bands, variant.precision) {
            Err(CompressError::Unreachable { .. }) if listed < limit => {
                listed = limit.min(2 * listed);
            }
            chosen => {
                let chosen = chosen?;
                table.rows.truncate(chosen.max(ROWS));
                break (table, chosen);
            }
        }
    };
    table.chosen = Some(components);
    let coefficients = match (choice, variant.precision) {
        (Choice::Bounds(_), Precision::Quantised) => {
            let (coefficients, row) = model.quantised_to_bounds(components, &bounds)?;
            table.rows[components - 1] = row;
            coefficients
        }
        (_, precision) => model.coefficients(components, precision)?,
    };
    Ok(Compressed {
        kind: variant.basis,
        coefficients,
        basis: model.basis(components),
        table,
        bounds,
        bands: bands.clone(),
    })
}
