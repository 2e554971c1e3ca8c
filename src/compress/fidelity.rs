//! How closely a compact file reproduces the spectra it was made from.
use ndarray::ArrayView2;

use super::{BandTally, Bands, CurveError, MaxAbsError, error_in};
use crate::colour::Colorimeter;
use crate::lookup::{Database, LookupError};
use crate::measurement::Quantity;
use crate::spectrum::Band;

/// Errors of every curve, in row order; NaN for curves that do not exist.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveErrors {
    /// RMSE, `[s]`.
    pub rmse: Vec<f64>,
    /// Colour difference, `[s]`; `None` without a colorimeter.
    pub delta_e: Option<Vec<f64>>,
    /// Errors by band of the file's wavelengths.
    pub bands: Vec<BandErrors>,
}

/// Errors of every curve in one band, in row order.
#[derive(Debug, Clone, PartialEq)]
pub struct BandErrors {
    /// The band.
    pub band: Band,
    /// RMSE over the wavelengths of the band, `[s]`.
    pub rmse: Vec<f64>,
    /// The largest absolute error at any of these wavelengths.
    pub largest: MaxAbsError,
}

/// The errors of the compact file against `curves` (`[s, l]`), the matrix of `quantity`.
/// They equal those in the file's error table to the last bit.
///
/// # Errors
/// [`LookupError::NoQuantity`] if the file lacks the quantity; [`LookupError::Shape`] if
/// `curves` has another shape than the file.
///
/// # Panics
/// If `colour` has another number of wavelengths.
pub fn curve_errors(
    database: &Database,
    quantity: Quantity,
    curves: ArrayView2<f64>,
    colour: Option<&Colorimeter>,
) -> Result<CurveErrors, LookupError> {
    database.require(quantity)?;
    require_count("curves", database.curves(), curves.nrows())?;
    require_count(
        "wavelengths",
        database.wavelengths_nm().len(),
        curves.ncols(),
    )?;
    let mut errors = CurveErrors {
        rmse: Vec::with_capacity(curves.nrows()),
        delta_e: colour.map(|_| Vec::with_capacity(curves.nrows())),
        bands: Vec::new(),
    };
    let nm = database.wavelengths_nm();
    let bands = Bands::new(nm);
    let mut in_bands = vec![(Vec::new(), BandTally::new()); bands.parts().len()];
    for (row, original) in curves.rows().into_iter().enumerate() {
        if !database.exists(row) {
            errors.rmse.push(f64::NAN);
            errors
                .delta_e
                .iter_mut()
                .for_each(|column| column.push(f64::NAN));
            in_bands
                .iter_mut()
                .for_each(|(column, _)| column.push(f64::NAN));
            continue;
        }
        let rebuilt = database.curve(row, quantity).unwrap_or_default();
        let rebuilt: Vec<f64> = rebuilt.into_iter().map(f64::from).collect();
        let original = original.to_vec();
        for (part, (column, tally)) in bands.parts().iter().zip(&mut in_bands) {
            let (rmse, largest, largest_column) = error_in(&original, &rebuilt, &part.columns);
            column.push(rmse);
            tally.add(row, rmse, largest, nm[largest_column]);
        }
        let error = CurveError::between(&original, &rebuilt, colour);
        errors.rmse.push(error.rmse);
        if let (Some(column), Some(delta_e)) = (&mut errors.delta_e, error.delta_e) {
            column.push(delta_e);
        }
    }
    let finished = bands.parts().iter().zip(in_bands);
    errors.bands = finished
        .map(|(part, (rmse, tally))| BandErrors {
            band: part.band,
            rmse,
            largest: tally.finish().largest,
        })
        .collect();
    Ok(errors)
}

/// Refuses a count that differs from the file's.
fn require_count(
    dimension: &'static str,
    expected: usize,
    found: usize,
) -> Result<(), LookupError> {
    if expected == found {
        return Ok(());
    }
    Err(LookupError::Shape {
        dimension,
        expected,
        found,
    })
}
