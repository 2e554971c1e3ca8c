//! Curves that do not exist, in a compact file.
//!
//! They are compressed by leaving them out: their rows of coefficients hold zeros, or
//! integers 0, which readers never show.
use ndarray::{Array2, ArrayView2};

use super::{Coefficients, Compressed, Integers, Quantised};

impl Compressed {
    /// What was made of the rows `rows`, increasing, of `curves` curves, as of them
    /// all.
    #[must_use]
    pub fn spread_over(mut self, rows: &[usize], curves: usize) -> Self {
        if rows.len() == curves {
            return self;
        }
        self.coefficients = match self.coefficients {
            Coefficients::F32(values) => Coefficients::F32(spread(values.view(), rows, curves)),
            Coefficients::F16(values) => Coefficients::F16(spread(values.view(), rows, curves)),
            Coefficients::Quantised(all) => {
                let wide = |component: Quantised| Quantised {
                    integers: match component.integers {
                        Integers::U8(all) => Integers::U8(placed(&all, rows, curves)),
                        Integers::U16(all) => Integers::U16(placed(&all, rows, curves)),
                    },
                    ..component
                };
                Coefficients::Quantised(all.into_iter().map(wide).collect())
            }
        };
        let row = |curve: &mut usize| *curve = rows.get(*curve).copied().unwrap_or(*curve);
        for errors in &mut self.table.rows {
            row(&mut errors.rmse.worst_curve);
            if let Some(delta_e) = &mut errors.delta_e {
                row(&mut delta_e.worst_curve);
            }
            for band in errors.bands.iter_mut().flatten() {
                row(&mut band.rmse.worst_curve);
                row(&mut band.largest.curve);
            }
        }
        self
    }
}

fn spread<T: Copy + Default>(values: ArrayView2<T>, rows: &[usize], curves: usize) -> Array2<T> {
    let mut all = Array2::from_elem((curves, values.ncols()), T::default());
    for (from, row) in values.rows().into_iter().zip(rows) {
        all.row_mut(*row).assign(&from);
    }
    all
}

fn placed<T: Copy + Default>(values: &[T], rows: &[usize], curves: usize) -> Vec<T> {
    let mut all = vec![T::default(); curves];
    for (value, row) in values.iter().zip(rows) {
        all[*row] = *value;
    }
    all
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::compress::{Bands, Choice, Precision, Variant, compress};
    use crate::measurement::Quantity;

    #[test]
    fn every_row_keeps_its_coefficients() {
        let curves =
            Array2::from_shape_fn((6, 4), |(i, j)| 0.1 + 0.1 * (i as f64) + 0.02 * j as f64);
        let rows = [0, 2, 3, 5, 6, 8];
        let bands = Bands::new(&[390.0, 500.0, 600.0, 900.0]);
        for precision in Precision::ALL {
            let variant = Variant {
                precision,
                ..Variant::default()
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
