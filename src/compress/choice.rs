//! The choice of the number of components.
use serde::{Deserialize, Serialize};

use super::bands::rmse_in;
use super::{Bands, CompressError, ErrorRow, ErrorTable, Precision};
use crate::grid::Compression;

/// Default bound on Delta-E, a just noticeable difference (Varsa 2025, section 8.2); also the
/// default of grid files.
pub const DEFAULT_MAX_DELTA_E: f64 = 2.3;

/// Smallest default bound on the RMSE of every curve in each band ([`Bands::bounded`]), and
/// the bound over all wavelengths if nothing else is bounded. It is about the largest error
/// that Varsa 2025, section 8.2 accepts with two components.
pub const DEFAULT_MAX_RMSE: f64 = 0.002;

/// How the number of components is chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Choice {
    /// The smallest number that keeps these bounds on every curve.
    Bounds(Compression),
    /// This number.
    Components(usize),
}

/// The bounds that every curve of a compressed quantity keeps, as its file states them (JSON
/// under [`BOUNDS`](super::BOUNDS)); `None` for no bound.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    /// Every Delta-E*ab is below this value.
    pub max_delta_e: Option<f64>,
    /// Every RMSE over all wavelengths is below this value.
    pub max_rmse: Option<f64>,
}

impl Choice {
    /// The bounds over all wavelengths for curves with or without a colour; the bounds of
    /// `bands` apply as well.
    #[must_use]
    pub fn bounds(self, coloured: bool, bands: &Bands) -> Bounds {
        let Self::Bounds(requested) = self else {
            return Bounds::default();
        };
        let is_bounded = coloured || bands.are_bounded();
        let default = (!is_bounded).then_some(DEFAULT_MAX_RMSE);
        Bounds {
            max_delta_e: coloured.then_some(requested.max_delta_e),
            max_rmse: requested.max_rmse.or(default),
        }
    }
}

/// The smallest number of components in `table` that keeps every bound that is set: the
/// largest Delta-E below `bounds.max_delta_e`, the largest RMSE below `bounds.max_rmse`, and
/// the largest RMSE in each of `bands` below its bound. `precision` is used in the error only.
///
/// # Errors
/// [`CompressError::Bound`] for a bound that is not above 0;
/// [`CompressError::Unreachable`], for the table's last row, if no row keeps the bounds.
pub fn choose(
    table: &ErrorTable,
    bounds: &Bounds,
    bands: &Bands,
    precision: Precision,
) -> Result<usize, CompressError> {
    let band_bounds = bands.parts().iter().map(|part| ("max_rmse", part.max_rmse));
    let overall_bounds = [
        ("max_delta_e", bounds.max_delta_e),
        ("max_rmse", bounds.max_rmse),
    ];
    for (name, value) in overall_bounds.into_iter().chain(band_bounds) {
        match value {
            Some(value) if value.is_nan() || value <= 0.0 => {
                return Err(CompressError::Bound { name, value });
            }
            _ => {}
        }
    }
    // An error that is bounded but missing from the table counts as NaN, which breaks any bound.
    let nan = f64::NAN;
    let broken_bound = |row: &ErrorRow| {
        let colour = row.delta_e.map_or(nan, |e| e.max);
        let in_bands = bands.parts().iter().map(|part| {
            let statistics = row.bands[part.band as usize];
            let reached = statistics.map_or(nan, |statistics| statistics.rmse.max);
            (rmse_in(part.band), part.max_rmse, reached)
        });
        [
            ("Delta-E", bounds.max_delta_e, colour),
            ("RMSE", bounds.max_rmse, row.rmse.max),
        ]
        .into_iter()
        .chain(in_bands)
        .filter_map(|(name, bound, reached)| Some((name, bound?, reached)))
        .find(|(_, bound, reached)| reached.is_nan() || reached >= bound)
    };
    let mut last = None;
    for row in &table.rows {
        match broken_bound(row) {
            None => return Ok(row.components),
            Some(measure) => last = Some((row.components, measure)),
        }
    }
    let (components, (name, bound, reached)) = last.unwrap_or((0, ("RMSE", nan, nan)));
    Err(CompressError::Unreachable {
        name,
        bound,
        reached,
        components,
        precision,
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::compress::{BandStatistics, ErrorStatistics, MaxAbsError};
    use crate::spectrum::Band;

    fn statistics(max: f64) -> ErrorStatistics {
        ErrorStatistics {
            min: 0.0,
            mean: max / 2.0,
            max,
            worst_curve: 0,
        }
    }

    /// The largest errors that Varsa 2025, section 8.2 gives for 1 to 4 components.
    fn published(coloured: bool) -> ErrorTable {
        let errors = [
            (2.8638, 0.00470),
            (1.3955, 0.00192),
            (0.5203, 0.00191),
            (0.2672, 0.00183),
        ];
        let rows = errors
            .into_iter()
            .enumerate()
            .map(|(i, (colour, rmse))| ErrorRow {
                components: i + 1,
                rmse: statistics(rmse),
                delta_e: coloured.then(|| statistics(colour)),
                bands: [None; 4],
            });
        ErrorTable {
            rows: rows.collect(),
            chosen: None,
        }
    }

    fn bounds(max_delta_e: f64, max_rmse: Option<f64>) -> Compression {
        Compression {
            max_delta_e,
            max_rmse,
        }
    }

    /// The number chosen from a table without bands.
    fn chosen(table: &ErrorTable, requested: Compression) -> Result<usize, CompressError> {
        let none = Bands::default();
        let coloured = table.rows[0].delta_e.is_some();
        let bounds = Choice::Bounds(requested).bounds(coloured, &none);
        choose(table, &bounds, &none, Precision::F32)
    }

    #[test]
    fn the_published_table_gives_two_components() {
        assert_eq!(chosen(&published(true), bounds(2.3, None)), Ok(2));
    }

    #[test]
    fn both_bounds_hold_and_are_strict() {
        let table = published(true);
        assert_eq!(chosen(&table, bounds(2.3, Some(0.001915))), Ok(3));
        assert_eq!(chosen(&table, bounds(1.0, Some(0.01))), Ok(3));
        assert_eq!(chosen(&table, bounds(1.3955, None)), Ok(3));
        assert_eq!(chosen(&table, bounds(3.0, None)), Ok(1));
    }

    #[test]
    fn without_colour_the_rmse_decides() {
        let table = published(false);
        assert_eq!(chosen(&table, bounds(2.3, None)), Ok(2));
        assert_eq!(chosen(&table, bounds(2.3, Some(0.005))), Ok(1));
    }

    /// Each band has its own bound, independent of the colour and of the RMSE over all wavelengths.
    #[test]
    fn every_band_keeps_its_bound() {
        let mut table = published(true);
        for (row, error) in table.rows.iter_mut().zip([0.03, 0.004, 0.0019, 0.001]) {
            for (band, error) in [(Band::Visible, error / 10.0), (Band::IrA, error)] {
                let largest = MaxAbsError {
                    error,
                    wavelength_nm: 900.0,
                    curve: 0,
                };
                let rmse = statistics(error);
                row.bands[band as usize] = Some(BandStatistics { rmse, largest });
            }
        }
        let nm = [500.0, 900.0];
        let chosen_with = |requested, bands: &Bands| {
            let bounds = Choice::Bounds(requested).bounds(true, bands);
            choose(&table, &bounds, bands, Precision::F32)
        };
        let colour_alone = bounds(2.3, None);
        assert_eq!(chosen_with(colour_alone, &Bands::new(&nm)), Ok(2));
        let defaults = Bands::new(&nm).bounded(None);
        assert_eq!(chosen_with(colour_alone, &defaults), Ok(3));
        let loose = Bands::new(&nm).bounded(Some(0.005));
        assert_eq!(chosen_with(colour_alone, &loose), Ok(2));
        let tight = Bands::new(&nm).bounded(Some(1e-3));
        let error = chosen_with(colour_alone, &tight).unwrap_err().to_string();
        assert!(
            error.contains("largest RMSE in ir_a is 1.000e-3, not below 1e-3"),
            "{error}"
        );
        // a band that the table lacks
        let more = Bands::new(&[500.0, 2000.0]).bounded(None);
        assert!(chosen_with(colour_alone, &more).is_err());
        let without = Choice::Bounds(colour_alone).bounds(false, &defaults);
        assert_eq!(without, Bounds::default());
    }

    #[test]
    fn the_broken_bound_is_reported() {
        let table = published(true);
        let error = chosen(&table, bounds(0.1, None)).unwrap_err();
        let CompressError::Unreachable {
            name,
            bound,
            reached,
            components,
            ..
        } = error
        else {
            panic!("{error}");
        };
        assert_eq!(
            (name, bound, reached, components),
            ("Delta-E", 0.1, 0.2672, 4)
        );
        for bad in [0.0, -1.0, f64::NAN] {
            let refused = |b| matches!(chosen(&table, b), Err(CompressError::Bound { .. }));
            assert!(refused(bounds(bad, None)));
            assert!(refused(bounds(2.3, Some(bad))));
        }
    }
}
