//! Compression errors: per curve, and tabulated per number of components
//! (docs/methods.md).
//!
//! The errors are those that a reader of the file gets: coefficients rounded as they are
//! stored, the basis rounded to f32, the spectrum rounded to f32.
use std::fmt;
use std::ops::Range;

use ndarray::{ArrayView1, ArrayView2};
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use serde::{Deserialize, Serialize, Serializer};

use super::{Bands, Basis};
use crate::accuracy::{RootMeanSquare, RunningSummary, rmse};
use crate::colour::Colorimeter;
use crate::lookup::add_component;
use crate::measurement::Quantity;
use crate::spectrum::Band;

/// The error of one reconstructed spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurveError {
    /// Root mean square difference over the wavelengths (Varsa 2025, eq. 6.4).
    pub rmse: f64,
    /// Colour difference Delta-E; `None` if the wavelengths do not determine a colour.
    pub delta_e: Option<f64>,
}

impl CurveError {
    /// Compares `rebuilt` with `original`, both `[l]`.
    ///
    /// # Panics
    /// If the spectra differ in length, or the colorimeter has another number of wavelengths.
    #[must_use]
    pub fn between(original: &[f64], rebuilt: &[f64], colour: Option<&Colorimeter>) -> Self {
        assert_eq!(original.len(), rebuilt.len(), "spectra of one length");
        Self {
            rmse: rmse(original, rebuilt),
            delta_e: colour.map(|c| c.difference(original, rebuilt)),
        }
    }
}

/// Compares `rebuilt` with `original` in some columns. Returns the RMSE, the largest
/// absolute error, and the column of the largest error.
pub(crate) fn error_in(
    original: &[f64],
    rebuilt: &[f64],
    columns: &Range<usize>,
) -> (f64, f64, usize) {
    let mut rmse = RootMeanSquare::default();
    let (mut largest, mut largest_column) = (0.0, columns.start);
    let pairs = original.iter().zip(rebuilt).enumerate();
    for (column, (a, b)) in pairs.skip(columns.start).take(columns.len()) {
        let error = (a - b).abs();
        rmse.add(error);
        if error > largest {
            (largest, largest_column) = (error, column);
        }
    }
    (rmse.value(), largest, largest_column)
}

/// The largest absolute error of all curves over some wavelengths.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MaxAbsError {
    /// The absolute error.
    #[serde(serialize_with = "six_digits")]
    pub error: f64,
    /// Wavelength of the error, nm.
    pub wavelength_nm: f64,
    /// Row of the first curve with this error.
    pub curve: usize,
}

/// Errors over all curves in one band.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BandStatistics {
    /// Statistics of the RMSE per curve over the band's wavelengths.
    pub rmse: ErrorStatistics,
    /// The largest absolute error at any of these wavelengths.
    pub largest: MaxAbsError,
}

/// Smallest, mean and largest value of one error measure over all curves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ErrorStatistics {
    /// Smallest value.
    #[serde(serialize_with = "six_digits")]
    pub min: f64,
    /// Mean value.
    #[serde(serialize_with = "six_digits")]
    pub mean: f64,
    /// Largest value.
    #[serde(serialize_with = "six_digits")]
    pub max: f64,
    /// Row of the first curve with the largest value.
    pub worst_curve: usize,
}

/// Serialises six significant digits, which keeps headers short.
fn six_digits<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    let short = format!("{value:.5e}").parse().unwrap_or(*value);
    serializer.serialize_f64(short)
}

impl From<RunningSummary> for ErrorStatistics {
    fn from(summary: RunningSummary) -> Self {
        Self {
            min: summary.min,
            mean: summary.mean(),
            max: summary.max,
            worst_curve: summary.worst,
        }
    }
}

/// Accumulates [`BandStatistics`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct BandTally {
    rmse: RunningSummary,
    largest: MaxAbsError,
}

impl BandTally {
    pub(crate) fn new() -> Self {
        let largest = MaxAbsError {
            error: -1.0,
            wavelength_nm: f64::NAN,
            curve: 0,
        };
        Self {
            rmse: RunningSummary::default(),
            largest,
        }
    }

    /// Adds the RMSE and the largest error (with its wavelength) of the next curve.
    pub(crate) fn add(&mut self, curve: usize, rmse: f64, error: f64, wavelength_nm: f64) {
        if error > self.largest.error {
            self.largest = MaxAbsError {
                error,
                wavelength_nm,
                curve,
            };
        }
        self.rmse.add(curve, rmse);
    }

    pub(crate) fn finish(self) -> BandStatistics {
        BandStatistics {
            rmse: self.rmse.into(),
            largest: self.largest,
        }
    }
}

/// Errors over all curves with a given number of components.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ErrorRow {
    /// Number of components, l'.
    pub components: usize,
    /// Statistics of the RMSE per curve.
    pub rmse: ErrorStatistics,
    /// Statistics of the colour difference; `None` if the wavelengths do not determine a colour.
    pub delta_e: Option<ErrorStatistics>,
    /// Errors by band, in the order of [`Band::ALL`]; `None` for bands without wavelengths.
    #[serde(serialize_with = "largest_rmse")]
    pub bands: [Option<BandStatistics>; Band::ALL.len()],
}

/// Serialises the largest RMSE of each band by the name of the band. Files state the other
/// band errors only for the chosen row.
fn largest_rmse<S: Serializer>(
    bands: &[Option<BandStatistics>; Band::ALL.len()],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let named = Band::ALL.into_iter().zip(bands);
    let named =
        named.filter_map(|(band, statistics)| Some((band.name(), statistics.as_ref()?.rmse.max)));
    let short = |value: f64| format!("{value:.5e}").parse().unwrap_or(value);
    serializer.collect_map(named.map(|(name, max)| (name, short(max))))
}

/// Errors for 1, 2, ... components, and the number chosen. `Display` prints an aligned
/// table for users; serialisation gives the table that files hold.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ErrorTable {
    /// One row per number of components, from 1.
    pub rows: Vec<ErrorRow>,
    /// The number of components chosen; `None` before the choice.
    pub chosen: Option<usize>,
}

/// How curves are reconstructed and compared.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reconstruction<'a> {
    /// Quantity that the components decompose.
    pub(super) kind: Basis,
    /// Quantity of the curves.
    pub(super) quantity: Quantity,
    /// Basis, `[l, l']` or with more columns.
    pub(super) basis: ArrayView2<'a, f32>,
    pub(super) colour: Option<&'a Colorimeter>,
    pub(super) bands: &'a Bands,
}

/// Number of curves whose errors are computed before they are added: all threads have some, and
/// the errors take little memory.
const ROWS_AT_ONCE: usize = 1024;

/// Error of a curve with one number of components; in each band RMSE, largest error and its column.
type RowError = (CurveError, Vec<(f64, f64, usize)>);

/// Accumulates the errors of curves with a first, ... and a last number of components.
#[derive(Debug)]
pub(super) struct TableTally<'a> {
    how: Reconstruction<'a>,
    first: usize,
    /// Number of curves added.
    rows: usize,
    tallies: Vec<(RunningSummary, RunningSummary, Vec<BandTally>)>,
}

impl<'a> TableTally<'a> {
    pub(super) fn new(how: Reconstruction<'a>, first: usize, last: usize) -> Self {
        let in_bands = vec![BandTally::new(); how.bands.parts().len()];
        let row_tallies = (
            RunningSummary::default(),
            RunningSummary::default(),
            in_bands,
        );
        Self {
            how,
            first,
            rows: 0,
            tallies: vec![row_tallies; (last + 1).saturating_sub(first)],
        }
    }

    /// Adds the next `curves`, `[n, l]`. `coefficients` gives those of a row of them. The errors
    /// are computed on all threads and added in the order of rows.
    pub(super) fn add(
        &mut self,
        curves: ArrayView2<f64>,
        coefficients: impl Fn(usize) -> Vec<f32> + Sync,
    ) {
        let (how, first) = (self.how, self.first);
        for begin in (0..curves.nrows()).step_by(ROWS_AT_ONCE) {
            let rows = begin..curves.nrows().min(begin + ROWS_AT_ONCE);
            let errors: Vec<Vec<RowError>> = rows
                .into_par_iter()
                .map(|row| how.errors(curves.row(row), &coefficients(row), first))
                .collect();
            for errors in errors {
                self.add_row(&errors);
            }
        }
    }

    fn add_row(&mut self, errors: &[RowError]) {
        let bands = self.how.bands;
        for ((rmse, colours, tallies), (error, in_bands)) in self.tallies.iter_mut().zip(errors) {
            rmse.add(self.rows, error.rmse);
            (error.delta_e.into_iter()).for_each(|e| colours.add(self.rows, e));
            for (tally, (rmse, largest, column)) in tallies.iter_mut().zip(in_bands) {
                tally.add(self.rows, *rmse, *largest, bands.wavelength_nm(*column));
            }
        }
        self.rows += 1;
    }

    pub(super) fn finish(self) -> ErrorTable {
        let how = self.how;
        let tallies = self.tallies.into_iter().enumerate();
        let rows = tallies.map(|(i, (rmse, colours, in_bands))| {
            let mut row = ErrorRow {
                components: self.first + i,
                rmse: rmse.into(),
                delta_e: how.colour.map(|_| colours.into()),
                bands: [None; Band::ALL.len()],
            };
            for (part, tally) in how.bands.parts().iter().zip(in_bands) {
                row.bands[part.band as usize] = Some(tally.finish());
            }
            row
        });
        ErrorTable {
            rows: rows.collect(),
            chosen: None,
        }
    }
}

impl Reconstruction<'_> {
    /// The errors of `curve` with the `first`, ... and all `coefficients`.
    fn errors(&self, curve: ArrayView1<f64>, coefficients: &[f32], first: usize) -> Vec<RowError> {
        let original: Vec<f64> = curve.iter().copied().collect();
        let mut sum = vec![0.0; original.len()];
        let mut errors = Vec::new();
        for (column, &coefficient) in coefficients.iter().enumerate() {
            add_component(&mut sum, coefficient, self.basis.column(column));
            if column + 1 < first {
                continue;
            }
            let rebuilt = sum.iter();
            let rebuilt = rebuilt.map(|sum| f64::from(self.kind.value(self.quantity, *sum) as f32));
            let rebuilt: Vec<f64> = rebuilt.collect();
            let parts = self.bands.parts().iter();
            let in_bands = parts.map(|part| error_in(&original, &rebuilt, &part.columns));
            let in_bands = in_bands.collect();
            errors.push((
                CurveError::between(&original, &rebuilt, self.colour),
                in_bands,
            ));
        }
        errors
    }
}

impl fmt::Display for ErrorTable {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "components   RMSE min      mean       max")?;
        if self.rows.iter().any(|row| row.delta_e.is_some()) {
            write!(f, "   Delta-E min     mean      max")?;
        }
        // A single band repeats the RMSE over all wavelengths, so it is not printed.
        let has_errors = |band: &Band| self.rows.iter().any(|r| r.bands[*band as usize].is_some());
        let bands: Vec<Band> = Band::ALL.into_iter().filter(has_errors).collect();
        let bands = if bands.len() > 1 { bands } else { Vec::new() };
        for band in &bands {
            write!(f, "  {:>11}", format!("{} max", band.name()))?;
        }
        for row in &self.rows {
            let ErrorStatistics { min, mean, max, .. } = row.rmse;
            let components = row.components;
            write!(f, "\n{components:>10}  {min:>9.6} {mean:>9.6} {max:>9.6}")?;
            if let Some(ErrorStatistics { min, mean, max, .. }) = row.delta_e {
                write!(f, "   {min:>11.4} {mean:>8.4} {max:>8.4}")?;
            }
            for band in &bands {
                let statistics = row.bands[*band as usize];
                let max = statistics.map_or(f64::NAN, |statistics| statistics.rmse.max);
                write!(f, "  {max:>11.6}")?;
            }
            if self.chosen == Some(components) {
                write!(f, "  <- chosen")?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn statistics(min: f64, mean: f64, max: f64) -> ErrorStatistics {
        ErrorStatistics {
            min,
            mean,
            max,
            worst_curve: 7,
        }
    }

    fn table(delta_e: [Option<ErrorStatistics>; 2]) -> ErrorTable {
        let rmse = [
            statistics(0.00013, 0.00149, 0.0047),
            statistics(1e-7, 0.123_456_78, 10.0),
        ];
        let rows = rmse.into_iter().zip(delta_e).zip(1..);
        ErrorTable {
            rows: rows
                .map(|((rmse, delta_e), components)| ErrorRow {
                    components,
                    rmse,
                    delta_e,
                    bands: [None; 4],
                })
                .collect(),
            chosen: Some(2),
        }
    }

    #[test]
    fn prints_aligned() {
        let colours = [
            statistics(0.0043, 0.7612, 2.8638),
            statistics(0.0, 1.0, 100.0),
        ];
        assert_eq!(
            format!("\n{}", table(colours.map(Some))),
            "
components   RMSE min      mean       max   Delta-E min     mean      max
         1   0.000130  0.001490  0.004700        0.0043   0.7612   2.8638
         2   0.000000  0.123457 10.000000        0.0000   1.0000 100.0000  <- chosen"
        );
        let mut by_band = table([None, None]);
        let largest = MaxAbsError {
            error: 0.01,
            wavelength_nm: 1170.0,
            curve: 3,
        };
        for row in &mut by_band.rows {
            let rmse = statistics(0.0, 0.001, 0.002 * row.components as f64);
            row.bands[1] = Some(BandStatistics { rmse, largest });
            row.bands[2] = row.bands[1];
        }
        assert_eq!(
            format!("\n{by_band}"),
            "
components   RMSE min      mean       max  visible max     ir_a max
         1   0.000130  0.001490  0.004700     0.002000     0.002000
         2   0.000000  0.123457 10.000000     0.004000     0.004000  <- chosen"
        );
        let json = serde_json::to_string(&by_band.rows[0]).unwrap_or_default();
        let tail = r#""delta_e":null,"bands":{"visible":0.002,"ir_a":0.002}}"#;
        assert!(json.ends_with(tail), "{json}");
        let without = table([None, None]).to_string();
        assert_eq!(
            without.lines().next(),
            Some("components   RMSE min      mean       max")
        );
    }

    #[test]
    fn serialises_six_digits_and_no_colour_as_null() {
        let json = serde_json::to_value(table([None, None])).unwrap_or_default();
        assert_eq!(json["rows"][1]["rmse"]["mean"], 0.123457);
        assert_eq!(json["rows"][1]["rmse"]["min"], 1e-7);
        assert_eq!(json["rows"][0]["rmse"]["worst_curve"], 7);
        assert!(json["rows"][0]["delta_e"].is_null());
        assert_eq!(json["chosen"], 2);
    }
}
