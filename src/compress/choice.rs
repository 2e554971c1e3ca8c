//! Choosing the number of components.
use serde::{Deserialize, Serialize};

use super::{CompressError, ErrorRow, ErrorTable, Precision};
use crate::grid::Compression;

/// Bound on Delta-E where none is given: a just noticeable difference (Varsa
/// 2025, section 8.2), as in grid files.
pub const DEFAULT_MAX_DELTA_E: f64 = 2.3;

/// Bound on the RMSE of every curve where neither a colour nor a bound of the
/// user's can decide (a database without visible wavelengths): about the largest
/// error that Varsa 2025, section 8.2 accepts with two components.
pub const DEFAULT_MAX_RMSE: f64 = 0.002;

/// How the number of components is found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Choice {
    /// The smallest that keeps these bounds on every curve.
    Bounds(Compression),
    /// This many.
    Components(usize),
}

/// What holds on every curve of a compressed quantity, as its file states it
/// (JSON under [`BOUNDS`](super::BOUNDS)); `None` where nothing was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    /// Every Delta-E*ab is below this.
    pub max_delta_e: Option<f64>,
    /// Every RMSE is below this.
    pub max_rmse: Option<f64>,
}

impl Choice {
    /// The bounds that curves with or without a colour keep.
    #[must_use]
    pub fn bounds(self, coloured: bool) -> Bounds {
        let Self::Bounds(asked) = self else {
            return Bounds::default();
        };
        let default = (!coloured).then_some(DEFAULT_MAX_RMSE);
        Bounds {
            max_delta_e: coloured.then_some(asked.max_delta_e),
            max_rmse: asked.max_rmse.or(default),
        }
    }
}

/// The smallest number of components in `table` whose largest Delta-E is below
/// `bounds.max_delta_e` and whose largest RMSE is below `bounds.max_rmse`, where
/// that is set. Without a colour only the RMSE decides, with
/// [`DEFAULT_MAX_RMSE`] unless one is set. `precision` is told in the error only.
///
/// # Errors
/// [`CompressError::Bound`] for a bound that is not above 0;
/// [`CompressError::Unreachable`], of the table's last row, if no row keeps them.
pub fn choose(
    table: &ErrorTable,
    bounds: &Compression,
    precision: Precision,
) -> Result<usize, CompressError> {
    let coloured = table.rows.iter().all(|row| row.delta_e.is_some());
    let max_rmse = Choice::Bounds(*bounds).bounds(coloured).max_rmse;
    let max_rmse = max_rmse.unwrap_or(f64::INFINITY);
    let named = [("max_delta_e", bounds.max_delta_e), ("max_rmse", max_rmse)];
    for (name, value) in named {
        if value.is_nan() || value <= 0.0 {
            return Err(CompressError::Bound { name, value });
        }
    }
    let broken = |row: &ErrorRow| {
        let reached = row.delta_e.map(|e| e.max);
        let rmse = ("RMSE", max_rmse, row.rmse.max);
        let measures = reached.map(|e| ("Delta-E", bounds.max_delta_e, e));
        measures
            .into_iter()
            .chain([rmse])
            .find(|(_, bound, reached)| reached.is_nan() || reached >= bound)
    };
    let mut last = None;
    for row in &table.rows {
        match broken(row) {
            None => return Ok(row.components),
            Some(measure) => last = Some((row.components, measure)),
        }
    }
    let (components, (name, bound, reached)) = last.unwrap_or((0, ("RMSE", max_rmse, f64::NAN)));
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
    use crate::compress::Statistics;

    fn statistics(max: f64) -> Statistics {
        Statistics {
            min: 0.0,
            mean: max / 2.0,
            max,
            worst_curve: 0,
        }
    }

    /// Largest errors of Varsa 2025, section 8.2 for 1 to 4 components.
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

    #[test]
    fn the_published_table_gives_two_components() {
        assert_eq!(
            choose(&published(true), &bounds(2.3, None), Precision::F32),
            Ok(2)
        );
    }

    #[test]
    fn both_bounds_hold_and_are_strict() {
        let table = published(true);
        assert_eq!(
            choose(&table, &bounds(2.3, Some(0.001915)), Precision::F32),
            Ok(3)
        );
        assert_eq!(
            choose(&table, &bounds(1.0, Some(0.01)), Precision::F32),
            Ok(3)
        );
        assert_eq!(choose(&table, &bounds(1.3955, None), Precision::F32), Ok(3));
        assert_eq!(choose(&table, &bounds(3.0, None), Precision::F32), Ok(1));
    }

    #[test]
    fn without_colour_the_rmse_decides() {
        let table = published(false);
        assert_eq!(choose(&table, &bounds(2.3, None), Precision::F32), Ok(2));
        assert_eq!(
            choose(&table, &bounds(2.3, Some(0.005)), Precision::F32),
            Ok(1)
        );
    }

    #[test]
    fn what_cannot_be_kept_is_said() {
        let table = published(true);
        let error = choose(&table, &bounds(0.1, None), Precision::F32).unwrap_err();
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
            let refused = |b| {
                matches!(
                    choose(&table, &b, Precision::F32),
                    Err(CompressError::Bound { .. })
                )
            };
            assert!(refused(bounds(bad, None)));
            assert!(refused(bounds(2.3, Some(bad))));
        }
    }
}
