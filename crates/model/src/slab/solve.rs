//! Systems of linear equations with many right-hand sides, solved row by row.
use splitsnow_spectra::simd::{Simd, SimdKernel, dispatch};

use super::matrix::{LANES, add_scaled, scale};
use super::{Matrix, SlabError};

/// [`Matrix::solve`] as a SIMD kernel: the matrix and the right-hand sides.
struct Elimination<const PIVOT: bool>(Matrix, Matrix);

impl<const PIVOT: bool> SimdKernel for Elimination<PIVOT> {
    type Output = Result<Matrix, SlabError>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        self.0.eliminate::<S, PIVOT>(self.1)
    }
}

impl Matrix {
    /// The solution X of `self` X = `right`, by Gaussian elimination with row pivoting.
    ///
    /// # Errors
    /// [`SlabError::Singular`] if all pivots of a column are 0 or NaN.
    ///
    /// # Panics
    /// If `self` is not square or `right` has a different number of rows.
    pub fn solve(self, right: Self) -> Result<Self, SlabError> {
        dispatch(Elimination::<true>(self, right))
    }

    /// The same for a symmetric positive definite matrix. There is no pivoting, which
    /// preserves accuracy if the rows have very different magnitudes.
    pub(super) fn solve_definite(self, right: Self) -> Result<Self, SlabError> {
        dispatch(Elimination::<false>(self, right))
    }

    #[inline(always)]
    fn eliminate<S: Simd, const PIVOT: bool>(mut self, mut right: Self) -> Result<Self, SlabError> {
        let n = self.rows();
        assert!(
            self.columns() == n && right.rows() == n,
            "solve: {n} rows, {} columns, {} rows on the right",
            self.columns(),
            right.rows()
        );
        for k in 0..n {
            if PIVOT {
                let best = self.largest_below(k);
                self.swap_rows(k, best);
                right.swap_rows(k, best);
            }
            let pivot = self[(k, k)];
            if pivot == 0.0 || pivot.is_nan() {
                return Err(SlabError::Singular);
            }
            let inverse = 1.0 / pivot;
            for i in k + 1..n {
                let factor = -self[(i, k)] * inverse;
                let (upper, lower) = self.wide_rows_mut(k, i);
                add_scaled::<S>(&mut lower[k / LANES..], factor, &upper[k / LANES..]);
                let (upper, lower) = right.wide_rows_mut(k, i);
                add_scaled::<S>(lower, factor, upper);
            }
        }
        Ok(back_substitute::<S>(&self, right))
    }

    /// The row at or below `k` with the largest entry in column `k`.
    fn largest_below(&self, k: usize) -> usize {
        let mut best = k;
        for i in k + 1..self.rows() {
            if self[(i, k)].abs() > self[(best, k)].abs() {
                best = i;
            }
        }
        best
    }
}

/// The solution X of U X = `right`, where U is the upper triangle of `upper`.
#[inline(always)]
pub(super) fn back_substitute<S: Simd>(upper: &Matrix, mut right: Matrix) -> Matrix {
    for i in (0..right.rows()).rev() {
        for j in i + 1..right.rows() {
            let (row, solved) = right.wide_rows_mut(i, j);
            add_scaled::<S>(row, -upper[(i, j)], solved);
        }
        let inverse = 1.0 / upper[(i, i)];
        scale::<S>(right.wide_row_mut(i), inverse);
    }
    right
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Irregular entries in (-1, 1).
    fn irregular_matrix(rows: usize, columns: usize) -> Matrix {
        Matrix::from_fn(rows, columns, |i, j| {
            libm::sin((1 + 37 * i + 11 * j + 5 * i * j) as f64)
        })
    }

    #[test]
    fn solutions_satisfy_their_equations() {
        for n in [1, 2, 3, 4, 5, 8, 11, 12, 33] {
            let a = irregular_matrix(n, n);
            let definite = &(&a * &a.transposed()) + &Matrix::identity(n);
            for columns in [1, 3, n] {
                let b = irregular_matrix(n, columns);
                let general = a.clone().solve(b.clone()).unwrap();
                let other = definite.clone().solve_definite(b.clone()).unwrap();
                for (a, x) in [(&a, general), (&definite, other)] {
                    let (residual, size) = (&(a * &x) - &b, largest(a) * largest(&x));
                    // backward error: rounding of sums of n terms
                    let rounding = 4.0 * f64::EPSILON * (n * n) as f64;
                    assert!(largest(&residual) < rounding * size.max(1.0), "{n}");
                }
            }
        }
    }

    fn largest(matrix: &Matrix) -> f64 {
        let rows = (0..matrix.rows()).flat_map(|i| matrix.row(i));
        rows.fold(0.0, |largest: f64, x| largest.max(x.abs()))
    }

    #[test]
    fn rows_are_pivoted_and_singular_matrices_rejected() {
        let swap = Matrix::from_fn(2, 2, |i, j| f64::from(u8::from(i != j)));
        let solved = swap.solve(Matrix::from_fn(2, 1, |i, _| i as f64)).unwrap();
        assert_eq!((solved[(0, 0)], solved[(1, 0)]), (1.0, 0.0));
        let flat = Matrix::from_fn(2, 2, |_, j| j as f64 + 1.0);
        assert_eq!(flat.solve(Matrix::identity(2)), Err(SlabError::Singular));
    }
}
