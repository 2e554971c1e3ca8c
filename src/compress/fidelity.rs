//! How well a compact file holds the spectra it was made from.
use ndarray::ArrayView2;

use super::{BandTally, Bands, CurveError, Largest, error_in};
use crate::colour::Colorimeter;
use crate::lookup::{Database, LookupError};
use crate::measurement::Quantity;
use crate::spectrum::Band;

/// Errors of every curve, in row order; NaN of those that do not exist.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveErrors {
    /// RMSE, `[s]`.
    pub rmse: Vec<f64>,
    /// Colour difference, `[s]`; `None` without a colorimeter.
    pub delta_e: Option<Vec<f64>>,
    /// By band of the file's wavelengths.
    pub bands: Vec<BandErrors>,
}

/// Errors of every curve in one band, in row order.
#[derive(Debug, Clone, PartialEq)]
pub struct BandErrors {
    /// The band.
    pub band: Band,
    /// RMSE over its wavelengths, `[s]`.
    pub rmse: Vec<f64>,
    /// The largest error at any of them.
    pub largest: Largest,
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
    database.require(quantity)?;
    expect("curves", database.curves(), curves.nrows())?;
    expect(
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
            errors.delta_e.iter_mut().for_each(|all| all.push(f64::NAN));
            in_bands.iter_mut().for_each(|(all, _)| all.push(f64::NAN));
            continue;
        }
        let rebuilt = database.curve(row, quantity).unwrap_or_default();
        let rebuilt: Vec<f64> = rebuilt.into_iter().map(f64::from).collect();
        let original = original.to_vec();
        for (part, (all, tally)) in bands.parts().iter().zip(&mut in_bands) {
            let (rmse, largest, at) = error_in(&original, &rebuilt, &part.columns);
            all.push(rmse);
            tally.add(row, rmse, largest, nm[at]);
        }
        let error = CurveError::between(&original, &rebuilt, colour);
        errors.rmse.push(error.rmse);
        if let (Some(all), Some(delta_e)) = (&mut errors.delta_e, error.delta_e) {
            all.push(delta_e);
        }
    }
    let found = bands.parts().iter().zip(in_bands);
    errors.bands = found
        .map(|(part, (rmse, tally))| BandErrors {
            band: part.band,
            rmse,
            largest: tally.finish().largest,
        })
        .collect();
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
