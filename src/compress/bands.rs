//! The wavelength bands of curves, each with its own bound on the compression error
//! (docs/methods.md).
//!
//! A bound on the colour, or on the RMSE over all wavelengths, hardly constrains a band that
//! is invisible or has few wavelengths.
use std::ops::Range;

use ndarray::ArrayView2;
use serde::{Deserialize, Serialize};

use super::{DEFAULT_MAX_RMSE, ErrorRow, ErrorStatistics, MaxAbsError};
use crate::accuracy::rms;
use crate::spectrum::Band;

/// Bound of a band's RMSE in units of the largest standard error in the band. No small
/// number of components reproduces noise that is independent from wavelength to
/// wavelength; its RMSE is one standard error on average. Over the ten wavelengths of a
/// narrow band the RMSE exceeds two standard errors in 2 of 100,000 curves (chi-square). A
/// smaller factor would spend components on noise.
pub const NOISE_FACTOR: f64 = 2.0;

/// The bands of a list of wavelengths.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Bands {
    wavelengths_nm: Vec<f64>,
    parts: Vec<BandColumns>,
}

/// The columns (wavelengths) of one band, with their noise and bound.
#[derive(Debug, Clone, PartialEq)]
pub struct BandColumns {
    /// The band.
    pub band: Band,
    /// Columns of the wavelengths in the band; at least one.
    pub columns: Range<usize>,
    /// Root mean square standard error over these wavelengths, the largest of all curves;
    /// `None` if it is not known.
    pub standard_error: Option<f64>,
    /// Bound: the RMSE of every curve over these wavelengths must be below this. `None` for
    /// no bound.
    pub max_rmse: Option<f64>,
}

/// The compression errors in one band, as a file states them: JSON under
/// [`BAND_ERRORS`](super::BAND_ERRORS).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BandError {
    /// The band.
    pub band: Band,
    /// Its first wavelength in the file, nm.
    pub from_nm: f64,
    /// Its last wavelength in the file, nm.
    pub to_nm: f64,
    /// Number of wavelengths in the band.
    pub wavelengths: usize,
    /// The bound, see [`BandColumns::max_rmse`].
    pub max_rmse: Option<f64>,
    /// The noise, see [`BandColumns::standard_error`].
    pub standard_error: Option<f64>,
    /// Statistics of the RMSE per curve over the band's wavelengths.
    pub rmse: ErrorStatistics,
    /// The largest absolute error of any curve at any of these wavelengths.
    pub largest: MaxAbsError,
}

impl Bands {
    /// The bands of `wavelengths_nm` (nm, increasing), without bounds.
    #[must_use]
    pub fn new(wavelengths_nm: &[f64]) -> Self {
        // Rounded as files hold them, so that a reader gets the same bands.
        let nm: Vec<f64> = wavelengths_nm
            .iter()
            .map(|&nm| f64::from(nm as f32))
            .collect();
        let mut parts: Vec<BandColumns> = Vec::new();
        for (column, band) in nm.iter().map(|&nm| Band::containing(nm)).enumerate() {
            match parts.last_mut() {
                Some(part) if part.band == band => part.columns.end = column + 1,
                _ => parts.push(BandColumns {
                    band,
                    columns: column..column + 1,
                    standard_error: None,
                    max_rmse: None,
                }),
            }
        }
        Self {
            wavelengths_nm: nm,
            parts,
        }
    }

    /// Sets the standard error of each band from those of the curves, `[s, l]`, and of all curves
    /// before: blocks of curves may be given one after the other.
    #[must_use]
    pub fn with_noise(mut self, standard_errors: ArrayView2<f32>) -> Self {
        for part in &mut self.parts {
            let before = part.standard_error.unwrap_or(0.0);
            let Range { start, end } = part.columns;
            let rms_of_curve = |row: ndarray::ArrayView1<f32>| {
                let band_errors = row.iter().skip(start).take(end - start);
                rms(band_errors.map(|&se| f64::from(se)))
            };
            let rows = standard_errors.rows().into_iter();
            part.standard_error = Some(rows.map(rms_of_curve).fold(before, f64::max));
        }
        self
    }

    /// Sets the bound of each band: `max_rmse`, or, if that is `None`, [`NOISE_FACTOR`] times
    /// the band's standard error, rounded to two digits, but at least [`DEFAULT_MAX_RMSE`].
    #[must_use]
    pub fn bounded(mut self, max_rmse: Option<f64>) -> Self {
        for part in &mut self.parts {
            let noise = NOISE_FACTOR * part.standard_error.unwrap_or(0.0);
            let default = two_digits(noise).max(DEFAULT_MAX_RMSE);
            part.max_rmse = Some(max_rmse.unwrap_or(default));
        }
        self
    }

    /// The bands in the order of wavelengths.
    #[must_use]
    pub fn parts(&self) -> &[BandColumns] {
        &self.parts
    }

    /// Whether there is at least one band and every band has a bound.
    pub(super) fn are_bounded(&self) -> bool {
        !self.parts.is_empty() && self.parts.iter().all(|part| part.max_rmse.is_some())
    }

    /// The wavelength of a column, nm.
    pub(super) fn wavelength_nm(&self, column: usize) -> f64 {
        self.wavelengths_nm.get(column).copied().unwrap_or(f64::NAN)
    }

    /// The errors of each band in `row`.
    pub(super) fn errors(&self, row: &ErrorRow) -> Vec<BandError> {
        let error = |part: &BandColumns| {
            let statistics = row.bands[part.band as usize]?;
            Some(BandError {
                band: part.band,
                from_nm: self.wavelength_nm(part.columns.start),
                to_nm: self.wavelength_nm(part.columns.end - 1),
                wavelengths: part.columns.len(),
                max_rmse: part.max_rmse,
                standard_error: part.standard_error,
                rmse: statistics.rmse,
                largest: statistics.largest,
            })
        };
        self.parts.iter().filter_map(error).collect()
    }
}

/// The name of the RMSE over a band's wavelengths, for messages.
pub(crate) fn rmse_in(band: Band) -> &'static str {
    match band {
        Band::UvA => "RMSE in uv_a",
        Band::Visible => "RMSE in visible",
        Band::IrA => "RMSE in ir_a",
        Band::IrB => "RMSE in ir_b",
    }
}

/// `value` rounded to two significant digits.
fn two_digits(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn every_wavelength_is_in_one() {
        let columns = |nm: &[f64]| -> Vec<_> {
            let bands = Bands::new(nm);
            let parts = bands.parts().iter();
            parts
                .map(|part| (part.band, part.columns.clone()))
                .collect()
        };
        assert_eq!(
            columns(&[300.0, 390.0, 400.0, 779.0, 780.0, 2000.0, 2600.0]),
            [
                (Band::UvA, 0..2),
                (Band::Visible, 2..4),
                (Band::IrA, 4..5),
                (Band::IrB, 5..7)
            ]
        );
        // 400 nm in a file
        assert_eq!(columns(&[399.999_999_99]), [(Band::Visible, 0..1)]);
        assert_eq!(columns(&[]), []);
    }

    #[test]
    fn bounds_are_two_standard_errors_but_at_least_the_floor() {
        let nm = [390.0, 500.0, 600.0, 900.0];
        let noise = array![
            [1e-4_f32, 0.003, 0.004, 0.001],
            [5e-4, 0.001, 0.001, 0.0012]
        ];
        let bands = Bands::new(&nm).with_noise(noise.view());
        let max_rmse =
            |bands: Bands| -> Vec<_> { bands.parts.iter().map(|p| p.max_rmse).collect() };
        // sqrt((9 + 16) / 2) = 3.54 in units of 1e-3
        let defaults = [DEFAULT_MAX_RMSE, 0.0071, 0.0024].map(Some);
        assert_eq!(max_rmse(bands.clone().bounded(None)), defaults);
        assert_eq!(max_rmse(bands.clone().bounded(Some(1e-5))), [Some(1e-5); 3]);
        assert_eq!(
            max_rmse(Bands::new(&nm).bounded(None)),
            [Some(DEFAULT_MAX_RMSE); 3]
        );
        assert_eq!(max_rmse(bands.clone()), [None; 3]);
        assert!(bands.clone().bounded(None).are_bounded() && !bands.are_bounded());
        assert!(!Bands::default().bounded(None).are_bounded());
    }
}
