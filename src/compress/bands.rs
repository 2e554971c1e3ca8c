//! The bands that curves reach over: what the compression may be off by in each
//! (docs/methods.md).
//!
//! A bound on the colour, or on the mean over all wavelengths, says little of a band
//! that no eye sees or that has few of the wavelengths. So each band has its own.
use std::ops::Range;

use ndarray::ArrayView2;
use serde::{Deserialize, Serialize};

use super::{DEFAULT_MAX_RMSE, ErrorRow, Largest, Statistics};
use crate::spectrum::Band;

/// The bound of a band in its largest standard error. Noise that is independent from
/// wavelength to wavelength, which no small number of components holds, has an RMSE of
/// one standard error in the mean; over the ten wavelengths of a narrow band it is above
/// two in 2 of 100,000 curves (chi-square). Below this, components would be spent on noise.
pub const NOISE_FACTOR: f64 = 2.0;

/// The bands of some wavelengths.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Bands {
    wavelengths_nm: Vec<f64>,
    parts: Vec<Part>,
}

/// The wavelengths of one band.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// The band.
    pub band: Band,
    /// Which of the wavelengths; at least one.
    pub columns: Range<usize>,
    /// Root mean square standard error over these wavelengths, the largest of all
    /// curves; `None` where it is not known.
    pub standard_error: Option<f64>,
    /// The RMSE of every curve over these wavelengths must be below this.
    pub max_rmse: Option<f64>,
}

/// What the compression costs in one band, as a file says it: JSON under
/// [`BAND_ERRORS`](super::BAND_ERRORS).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BandError {
    /// The band.
    pub band: Band,
    /// Its first wavelength in the file, nm.
    pub from_nm: f64,
    /// Its last wavelength in the file, nm.
    pub to_nm: f64,
    /// How many there are.
    pub wavelengths: usize,
    /// See [`Part::max_rmse`].
    pub max_rmse: Option<f64>,
    /// See [`Part::standard_error`].
    pub standard_error: Option<f64>,
    /// RMSE per curve over its wavelengths.
    pub rmse: Statistics,
    /// The largest error of any curve at any of its wavelengths.
    pub largest: Largest,
}

impl Bands {
    /// Those of `wavelengths_nm`, nm, which increase: without bounds.
    #[must_use]
    pub fn new(wavelengths_nm: &[f64]) -> Self {
        // As files have them, so that a reader finds the same bands.
        let nm: Vec<f64> = wavelengths_nm
            .iter()
            .map(|&nm| f64::from(nm as f32))
            .collect();
        let mut parts: Vec<Part> = Vec::new();
        for (column, band) in nm.iter().map(|&nm| Band::containing(nm)).enumerate() {
            match parts.last_mut() {
                Some(part) if part.band == band => part.columns.end = column + 1,
                _ => parts.push(Part {
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

    /// The same with the standard errors of the curves, `[s, l]`.
    #[must_use]
    pub fn with_noise(mut self, standard_errors: ArrayView2<f32>) -> Self {
        for part in &mut self.parts {
            let Range { start, end } = part.columns;
            let of_curve = |row: ndarray::ArrayView1<f32>| {
                let there = row.iter().skip(start).take(end - start);
                let squares: f64 = there.map(|&se| f64::from(se).powi(2)).sum();
                (squares / (end - start) as f64).sqrt()
            };
            let rows = standard_errors.rows().into_iter();
            part.standard_error = Some(rows.map(of_curve).fold(0.0, f64::max));
        }
        self
    }

    /// The same with bounds: `max_rmse` in every band, or, where that is `None`, in each
    /// [`NOISE_FACTOR`] times its standard error, two digits of it, but at least
    /// [`DEFAULT_MAX_RMSE`].
    #[must_use]
    pub fn bounded(mut self, max_rmse: Option<f64>) -> Self {
        for part in &mut self.parts {
            let noise = NOISE_FACTOR * part.standard_error.unwrap_or(0.0);
            let default = two_digits(noise).max(DEFAULT_MAX_RMSE);
            part.max_rmse = Some(max_rmse.unwrap_or(default));
        }
        self
    }

    /// By wavelength.
    #[must_use]
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// Whether all that there are have bounds, and there are some.
    pub(super) fn are_bounded(&self) -> bool {
        !self.parts.is_empty() && self.parts.iter().all(|part| part.max_rmse.is_some())
    }

    /// The wavelength of a column, nm.
    pub(super) fn wavelength_nm(&self, column: usize) -> f64 {
        self.wavelengths_nm.get(column).copied().unwrap_or(f64::NAN)
    }

    /// What `row` says of each.
    pub(super) fn errors(&self, row: &ErrorRow) -> Vec<BandError> {
        let error = |part: &Part| {
            let found = row.bands[part.band as usize]?;
            Some(BandError {
                band: part.band,
                from_nm: self.wavelength_nm(part.columns.start),
                to_nm: self.wavelength_nm(part.columns.end - 1),
                wavelengths: part.columns.len(),
                max_rmse: part.max_rmse,
                standard_error: part.standard_error,
                rmse: found.rmse,
                largest: found.largest,
            })
        };
        self.parts.iter().filter_map(error).collect()
    }
}

/// What the RMSE over a band's wavelengths is called.
pub(crate) fn rmse_in(band: Band) -> &'static str {
    match band {
        Band::UvA => "RMSE in uv_a",
        Band::Visible => "RMSE in visible",
        Band::IrA => "RMSE in ir_a",
        Band::IrB => "RMSE in ir_b",
    }
}

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
        let of = |bands: Bands| -> Vec<_> { bands.parts.iter().map(|p| p.max_rmse).collect() };
        // sqrt((9 + 16) / 2) = 3.54 in units of 1e-3
        let defaults = [DEFAULT_MAX_RMSE, 0.0071, 0.0024].map(Some);
        assert_eq!(of(bands.clone().bounded(None)), defaults);
        assert_eq!(of(bands.clone().bounded(Some(1e-5))), [Some(1e-5); 3]);
        assert_eq!(
            of(Bands::new(&nm).bounded(None)),
            [Some(DEFAULT_MAX_RMSE); 3]
        );
        assert_eq!(of(bands.clone()), [None; 3]);
        assert!(bands.clone().bounded(None).are_bounded() && !bands.are_bounded());
        assert!(!Bands::default().bounded(None).are_bounded());
    }
}
