//! How well a compact file holds spectra it was made from, or new ones.
use ndarray::ArrayView2;

use super::{Database, LookupError};
use crate::colour::Colorimeter;
use crate::compress::CurveError;
use crate::measurement::Quantity;

/// Errors of every curve, in row order.
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
        let rebuilt = widen(&database.curve(row, quantity).unwrap_or_default());
        let error = CurveError::between(&original.to_vec(), &rebuilt, colour);
        errors.rmse.push(error.rmse);
        if let (Some(all), Some(delta_e)) = (&mut errors.delta_e, error.delta_e) {
            all.push(delta_e);
        }
    }
    Ok(errors)
}

impl Database {
    /// `spectrum` (`[l]`), a new one, say off the nodes, projected on the basis
    /// of `quantity`: what compression alone does to it. Coefficients are f32
    /// whatever those of the file.
    ///
    /// # Errors
    /// [`LookupError::NoQuantity`]; [`LookupError::Shape`] if `spectrum` is of
    /// another length.
    pub fn project(&self, quantity: Quantity, spectrum: &[f64]) -> Result<Vec<f32>, LookupError> {
        self.expect(quantity)?;
        expect("wavelengths", self.wavelengths_nm.len(), spectrum.len())?;
        let projected = spectrum.iter().map(|&m| self.kind.projected(quantity, m));
        let projected: Vec<f64> = projected.collect();
        let basis = self.basis(quantity);
        let coefficients = basis.columns().into_iter().map(|vector| {
            let products = vector
                .iter()
                .zip(&projected)
                .map(|(&v, m)| f64::from(v) * m);
            products.sum::<f64>() as f32
        });
        Ok(self.rebuild(quantity, coefficients))
    }

    /// The error of [`Database::project`].
    ///
    /// # Errors
    /// As [`Database::project`].
    ///
    /// # Panics
    /// If `colour` is of another number of wavelengths.
    pub fn projection_error(
        &self,
        quantity: Quantity,
        spectrum: &[f64],
        colour: Option<&Colorimeter>,
    ) -> Result<CurveError, LookupError> {
        let rebuilt = widen(&self.project(quantity, spectrum)?);
        Ok(CurveError::between(spectrum, &rebuilt, colour))
    }
}

fn widen(spectrum: &[f32]) -> Vec<f64> {
    spectrum.iter().map(|&v| f64::from(v)).collect()
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
