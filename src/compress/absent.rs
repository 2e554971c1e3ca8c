//! Curves that do not exist, in a compact file.
//!
//! Compression leaves these curves out. The file has rows of coefficients for them that hold
//! zeros (or integers 0), which readers never use.
use ndarray::{Array2, ArrayView2};

use super::{Compressed, Integers, Quantised, StoredCoefficients};

impl Compressed {
    /// Expands the result for the existing curves to all `curves` rows of the database.
    /// `rows` (increasing) are the rows of the existing curves.
    #[must_use]
    pub fn spread_over(mut self, rows: &[usize], curves: usize) -> Self {
        if rows.len() == curves {
            return self;
        }
        self.coefficients = match self.coefficients {
            StoredCoefficients::F32(values) => {
                StoredCoefficients::F32(spread(values.view(), rows, curves))
            }
            StoredCoefficients::F16(values) => {
                StoredCoefficients::F16(spread(values.view(), rows, curves))
            }
            StoredCoefficients::Quantised(components) => {
                let expand = |component: Quantised| Quantised {
                    integers: match component.integers {
                        Integers::U8(values) => Integers::U8(spread_list(&values, rows, curves)),
                        Integers::U16(values) => Integers::U16(spread_list(&values, rows, curves)),
                    },
                    ..component
                };
                StoredCoefficients::Quantised(components.into_iter().map(expand).collect())
            }
        };
        let renumber = |curve: &mut usize| *curve = rows.get(*curve).copied().unwrap_or(*curve);
        for errors in &mut self.table.rows {
            renumber(&mut errors.rmse.worst_curve);
            if let Some(delta_e) = &mut errors.delta_e {
                renumber(&mut delta_e.worst_curve);
            }
            for band in errors.bands.iter_mut().flatten() {
                renumber(&mut band.rmse.worst_curve);
                renumber(&mut band.largest.curve);
            }
        }
        self
    }
}

/// A matrix of `curves` rows with row i of `values` at row `rows[i]`, and zeros elsewhere.
fn spread<T: Copy + Default>(values: ArrayView2<T>, rows: &[usize], curves: usize) -> Array2<T> {
    let mut matrix = Array2::from_elem((curves, values.ncols()), T::default());
    for (from, row) in values.rows().into_iter().zip(rows) {
        matrix.row_mut(*row).assign(&from);
    }
    matrix
}

/// A list of `curves` values with `values[i]` at index `rows[i]`, and zeros elsewhere.
fn spread_list<T: Copy + Default>(values: &[T], rows: &[usize], curves: usize) -> Vec<T> {
    let mut list = vec![T::default(); curves];
    for (value, row) in values.iter().zip(rows) {
        list[*row] = *value;
    }
    list
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::compress::{Bands, Choice, CompactVariant, Precision, compress};
    use crate::measurement::Quantity;

    #[test]
    fn every_row_keeps_its_coefficients() {
        let curves =
            Array2::from_shape_fn((6, 4), |(i, j)| 0.1 + 0.1 * (i as f64) + 0.02 * j as f64);
        let rows = [0, 2, 3, 5, 6, 8];
        let bands = Bands::new(&[390.0, 500.0, 600.0, 900.0]);
        for precision in Precision::ALL {
            let variant = CompactVariant {
                precision,
                ..CompactVariant::default()
            };
            let few = compress(
                curves.view(),
                Quantity::Reflectance,
                None,
                &bands,
                Choice::Components(2),
                variant,
            );
            let few = few.unwrap();
            let all = few.clone().spread_over(&rows, 9);
            let (few_rows, all_rows) = (few.coefficients.decoded(), all.coefficients.decoded());
            assert_eq!(all_rows.dim(), (9, 2));
            for (i, row) in rows.iter().enumerate() {
                assert_eq!(all_rows.row(*row), few_rows.row(i));
            }
            for (one, other) in all.table.rows.iter().zip(&few.table.rows) {
                assert_eq!(one.rmse.worst_curve, rows[other.rmse.worst_curve]);
                for (one, other) in one.bands.iter().flatten().zip(other.bands.iter().flatten()) {
                    assert_eq!(one.rmse.worst_curve, rows[other.rmse.worst_curve]);
                    assert_eq!(one.largest.curve, rows[other.largest.curve]);
                }
            }
            assert_eq!(few.clone().spread_over(&[0, 1, 2, 3, 4, 5], 6), few);
        }
    }
}
