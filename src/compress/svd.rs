//! Singular value decomposition of a matrix of curves (docs/methods.md;
//! Varsa 2025, sections 5.2 and 6.5).
//!
//! M (`[s, l]`, curves by wavelengths, not centred) = U Sigma V^T. Only V and Sigma are
//! kept, because C = M V. M is folded block by block into the triangular factor R of a QR
//! decomposition, M^T M = R^T R, and R, at most `l x l`, is decomposed. Besides M itself
//! this takes a few hundred kilobytes for any number of curves. M^T M is never formed, because
//! it would halve the number of accurate digits of the small singular values.
//!
//! On one platform the result depends on M alone, to the last bit. The sign of a basis vector
//! is arbitrary; it is chosen so that the entry of largest magnitude (the first of equals) is
//! positive.
use nalgebra::{DMatrix, SVD};
use ndarray::{Array2, ArrayView2};

use super::{CompressError, CurveBlocks, blocks};

/// Number of rows folded into R at a time.
const BLOCK: usize = 1024;

/// Largest magnitude allowed for an entry of M: far above any reflectance, far below the
/// overflow of f32.
pub(super) const MAX_MAGNITUDE: f64 = 1e6;

/// Basis vectors and singular values of a matrix of curves.
#[derive(Debug, Clone, PartialEq)]
pub struct Decomposition {
    /// Orthonormal columns in the order of decreasing singular values, `[l, r]`, r = min(s, l).
    pub basis: Array2<f64>,
    /// Singular values in decreasing order, `[r]`.
    pub singular_values: Vec<f64>,
}

impl Decomposition {
    /// Decomposes `curves`, `[s, l]`, with one row per curve and one column per wavelength.
    ///
    /// # Errors
    /// [`CompressError::Empty`] without curves or wavelengths; [`CompressError::Value`] for an
    /// entry that is not finite or above 1e6 in magnitude; [`CompressError::NoConvergence`].
    pub fn new(curves: impl CurveBlocks) -> Result<Self, CompressError> {
        let scale = blocks::largest(&curves)?;
        // Scaling keeps the squares of all significant entries from underflowing.
        let scale = if scale > 0.0 { scale } else { 1.0 };
        let columns = curves.shape().1;
        let mut triangle = Triangle {
            factor: DMatrix::zeros(0, columns),
            rows: Vec::new(),
        };
        curves.visit(&mut |block| {
            for row in block.rows() {
                triangle.add(row.iter().map(|value| value / scale));
            }
            Ok(())
        })?;
        triangle.fold();
        let triangle = triangle.factor;
        let svd = SVD::try_new(triangle, false, true, 5.0 * f64::EPSILON, 1_000 * columns)
            .ok_or(CompressError::NoConvergence)?;
        let vectors = svd.v_t.ok_or(CompressError::NoConvergence)?;
        let mut basis = Array2::from_shape_fn((columns, vectors.nrows()), |(i, j)| vectors[(j, i)]);
        for mut vector in basis.columns_mut() {
            let mut largest: f64 = 0.0;
            for &entry in &vector {
                if entry.abs() > largest.abs() {
                    largest = entry;
                }
            }
            if largest < 0.0 {
                // `-entry` would turn 0 into -0.
                vector.mapv_inplace(|entry| 0.0 - entry);
            }
        }
        let singular_values = svd.singular_values.iter().map(|v| v * scale).collect();
        Ok(Self {
            basis,
            singular_values,
        })
    }

    /// The largest number of components, min(s, l).
    #[must_use]
    pub fn rank_limit(&self) -> usize {
        self.singular_values.len()
    }
}

/// The triangular factor R of the rows added so far. They are folded in [`BLOCK`] at a time,
/// however they come.
struct Triangle {
    factor: DMatrix<f64>,
    /// Values of the rows that are not folded in yet.
    rows: Vec<f64>,
}

impl Triangle {
    fn add(&mut self, row: impl Iterator<Item = f64>) {
        self.rows.extend(row);
        if self.rows.len() == BLOCK * self.factor.ncols() {
            self.fold();
        }
    }

    fn fold(&mut self) {
        if self.rows.is_empty() {
            return;
        }
        let (folded, columns) = self.factor.shape();
        let rows = self.rows.len() / columns;
        let stacked =
            DMatrix::from_fn(folded + rows, columns, |i, j| match i.checked_sub(folded) {
                Some(i) => self.rows[i * columns + j],
                None => self.factor[(i, j)],
            });
        self.factor = stacked.qr().unpack_r();
        self.rows.clear();
    }
}

/// Refuses entries that are NaN, infinite or above [`MAX_MAGNITUDE`] in magnitude, in curves of
/// which `first` is the number of the first.
pub(super) fn check_values(curves: ArrayView2<f64>, first: usize) -> Result<(), CompressError> {
    let is_allowed = |value: f64| value.abs() <= MAX_MAGNITUDE;
    match curves
        .indexed_iter()
        .find(|(_, value)| !is_allowed(**value))
    {
        Some(((row, column), &value)) => Err(CompressError::Value {
            row: first + row,
            column,
            value,
        }),
        None => Ok(()),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use ndarray::array;
    use proptest::prelude::*;

    /// Checks that the basis is orthonormal, that (M V)^T (M V) has Sigma^2 on its diagonal, and
    /// that M V V^T = M.
    fn check(curves: &Array2<f64>) {
        let found = Decomposition::new(curves.view()).unwrap();
        let (rows, columns) = curves.dim();
        assert_eq!(found.rank_limit(), rows.min(columns));
        assert_eq!(found.basis.dim(), (columns, rows.min(columns)));
        let gram = found.basis.t().dot(&found.basis);
        let identity = Array2::<f64>::eye(found.rank_limit());
        assert!(
            (&gram - &identity).iter().all(|d| d.abs() < 1e-12),
            "{gram}"
        );
        // In units of the largest entry, so that no square underflows.
        let size = curves.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        let unit = curves / size.max(f64::MIN_POSITIVE);
        let coefficients = unit.dot(&found.basis);
        let rebuilt = coefficients.dot(&found.basis.t());
        let tolerance = 1e-13 * (rows * columns) as f64;
        assert!((&rebuilt - &unit).iter().all(|d| d.abs() < tolerance));
        let columns = coefficients.columns().into_iter();
        for (column, sigma) in columns.zip(&found.singular_values) {
            let norm = column.dot(&column).sqrt() * size;
            assert!((norm - sigma).abs() <= tolerance * size, "{norm} {sigma}");
        }
        assert!(found.singular_values.is_sorted_by(|a, b| a >= b));
        for vector in found.basis.columns() {
            let largest = vector
                .iter()
                .fold(0.0_f64, |a, &b| if b.abs() > a.abs() { b } else { a });
            assert!(largest > 0.0, "{vector}");
        }
    }

    #[test]
    fn shapes_and_ranks() {
        check(&Array2::zeros((40, 7)));
        check(&Array2::ones((40, 7)));
        check(&Array2::from_elem((40, 7), -0.25));
        check(&array![[0.3, 0.2, 0.1]]);
        check(&array![[0.3], [0.2], [0.7]]);
        check(&array![[0.0]]);
        check(&array![[1e-160, 2e-160], [3e-160, 1e-160], [1e-160, 0.0]]);
        // Fewer curves than wavelengths; rank two; more curves than one block.
        check(&Array2::from_shape_fn((5, 31), |(i, j)| {
            ((i * 31 + j) as f64).sin()
        }));
        check(&Array2::from_shape_fn((300, 31), |(i, j)| {
            (i as f64).cos() + (j as f64).sqrt()
        }));
        check(&Array2::from_shape_fn((2500, 9), |(i, j)| {
            ((i * j) as f64 * 0.01).sin()
        }));
    }

    /// Compares with the closed form for a 2 x 2 matrix.
    #[test]
    fn known_singular_values() {
        let found = Decomposition::new(array![[3.0, 0.0], [4.0, 5.0]].view()).unwrap();
        let expected = [45.0_f64.sqrt(), 5.0_f64.sqrt()];
        for (found, expected) in found.singular_values.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12);
        }
        let half = 0.5_f64.sqrt();
        assert!(
            (&found.basis.column(0) - &array![half, half])
                .iter()
                .all(|d| d.abs() < 1e-12)
        );
    }

    #[test]
    fn invalid_values_are_reported_with_row_and_column() {
        for bad in [f64::NAN, f64::INFINITY, 1e300] {
            let mut curves = Array2::<f64>::ones((4, 3));
            curves[[2, 1]] = bad;
            let error = Decomposition::new(curves.view()).unwrap_err();
            assert!(matches!(
                error,
                CompressError::Value {
                    row: 2,
                    column: 1,
                    ..
                }
            ));
        }
        let error = Decomposition::new(Array2::zeros((0, 3)).view()).unwrap_err();
        assert!(matches!(error, CompressError::Empty { .. }));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn random_matrices(rows in 1_usize..12, columns in 1_usize..12, values in proptest::collection::vec(-1.0_f64..1.0, 144)) {
            check(&Array2::from_shape_fn((rows, columns), |(i, j)| values[i * 12 + j]));
        }
    }
}
