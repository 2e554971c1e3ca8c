//! How well a compact file holds the spectra it was made from.
use ndarray::ArrayView2;

use super::{Database, LookupError};
use crate::colour::Colorimeter;
use crate::compress::CurveError;
use crate::measurement::Quantity;

/// Errors of every curve, in row order; NaN of those that do not exist.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveErrors {
    /// RMSE, `[s]`.
    pub rmse: Vec<f64>,
    /// Colour difference, `[s]`; `None` without a colorimeter.
    pub delta_e: Option<Vec<f64>>,
}

/// The errors of the compact file against `curves` (`[s, l]`), the matrix of
/// `quantity`: to the last bit those that its error table was made from.
///
/// # Errors
/// [`LookupError::NoQuantity`]; [`LookupError::Shape`] if `curves` is of another
/// shape.
///
/// # Panics
/// If `colour` is of another number of wavelengths.
pub fn errors_of(
    database: &Database,
    quantity: Quantity,
    curves: ArrayView2<f64>,
    colour: Option<&Colorimeter>,
) -> Result<CurveErrors, LookupError> {
    database.expect(quantity)?;
    expect("curves", database.curves(), curves.nrows())?;
    expect("wavelengths", database.wavelengths_nm.len(), curves.ncols())?;
    let mut errors = CurveErrors {
        rmse: Vec::with_capacity(curves.nrows()),
        delta_e: colour.map(|_| Vec::with_capacity(curves.nrows())),
    };
    for (row, original) in curves.rows().into_iter().enumerate() {
        if !database.exists(row) {
            errors.rmse.push(f64::NAN);
            errors.delta_e.iter_mut().for_each(|all| all.push(f64::NAN));
            continue;
        }
        let rebuilt = database.curve(row, quantity).unwrap_or_default();
        let rebuilt: Vec<f64> = rebuilt.into_iter().map(f64::from).collect();
        let error = CurveError::between(&original.to_vec(), &rebuilt, colour);
        errors.rmse.push(error.rmse);
        if let (Some(all), Some(delta_e)) = (&mut errors.delta_e, error.delta_e) {
            all.push(delta_e);
        }
    }
    Ok(errors)
}

fn expect(what: &'static str, expected: usize, found: usize) -> Result<(), LookupError> {
    if expected == found {
        return Ok(());
    }
    Err(LookupError::Shape {
        what,
        expected,
        found,
    })
}
