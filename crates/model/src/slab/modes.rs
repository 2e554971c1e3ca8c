//! The decay modes of a medium: the eigenproblem in the module documentation.
use splitsnow_spectra::simd::{F64x4, Simd, SimdKernel, dispatch};

use super::matrix::{add_scaled, dot, scale, weighted_product};
use super::solve::back_substitute;
use super::{Matrix, SlabError, Streams};

/// Lower bound of 1 - chi_0, which keeps the smallest decay rate above 0: far below any
/// rounding, far above underflow.
const LEAST_ABSORPTION: f64 = 1e-200;

/// Decay rates k and mode matrices with Y^T Z = 1: s' = -Z Z^T d, d' = -Y diag(k^2) Y^T s.
#[derive(Debug, Clone)]
pub(super) struct Modes {
    /// `[n]`: per unit optical depth, all above 0.
    pub(super) rates: Vec<f64>,
    /// `[n, n]`, a row per mode.
    pub(super) z: Matrix,
    /// `[n, n]`, a row per mode.
    pub(super) y: Matrix,
    /// Z^T Z.
    pub(super) z_gram: Matrix,
    /// Y^T Y.
    pub(super) y_gram: Matrix,
}

impl Modes {
    /// The modes of the medium with moments `chi`, of which the 0th is not used. `absorption`
    /// is 1 - chi_0, computed without cancellation.
    ///
    /// # Errors
    /// [`SlabError::Peaked`].
    pub(super) fn new(streams: &Streams, chi: &[f64], absorption: f64) -> Result<Self, SlabError> {
        dispatch(ModesTask {
            streams,
            chi,
            absorption,
        })
    }

    #[inline(always)]
    fn solve<S: Simd>(streams: &Streams, chi: &[f64], absorption: f64) -> Result<Self, SlabError> {
        let n = streams.count();
        let moment = |l: usize| -chi.get(l).copied().unwrap_or(0.0);
        let even: Vec<f64> = (1..n).map(|l| moment(2 * l)).collect();
        let odd: Vec<f64> = (0..n).map(|l| moment(2 * l + 1)).collect();
        let even = cholesky::<S>(one_plus(&streams.even, &even))?;
        let odd = cholesky::<S>(one_plus(&streams.odd, &odd))?;

        // N^T L; its first row has the factor sqrt(1 - chi_0)
        let basis = &streams.basis_over_cosine * &odd.transposed();
        let mut product = Matrix::zeros(n, n);
        let first = absorption.max(LEAST_ABSORPTION).sqrt();
        add_scaled::<S>(product.wide_row_mut(0), first, basis.wide_row(0));
        for i in 1..n {
            for j in i..n {
                let row = product.wide_row_mut(i);
                add_scaled::<S>(row, even[(i - 1, j - 1)], basis.wide_row(j));
            }
        }
        let rates = orthogonalise::<S>(&mut product);
        let directions = product;

        let mut z = &directions * &odd;
        for m in 0..n {
            for (entry, mu) in z.row_mut(m).iter_mut().zip(&streams.cosines) {
                *entry /= mu.sqrt();
            }
        }
        let mut y = back_substitute::<S>(&odd, directions.transposed());
        for (i, mu) in streams.cosines.iter().enumerate() {
            let root = mu.sqrt();
            y.row_mut(i).iter_mut().for_each(|entry| *entry *= root);
        }
        let ones = vec![1.0; n];
        let columns = z.transposed();
        Ok(Self {
            rates,
            z_gram: weighted_product(&columns, &ones, &columns),
            y_gram: weighted_product(&y, &ones, &y),
            z,
            y: y.transposed(),
        })
    }
}

/// [`Modes::new`] as a SIMD kernel.
struct ModesTask<'a> {
    streams: &'a Streams,
    chi: &'a [f64],
    absorption: f64,
}

impl SimdKernel for ModesTask<'_> {
    type Output = Result<Modes, SlabError>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        Modes::solve::<S>(self.streams, self.chi, self.absorption)
    }
}

/// 1 + V^T diag(d) V.
fn one_plus(vectors: &Matrix, d: &[f64]) -> Matrix {
    let mut sum = weighted_product(vectors, d, vectors);
    sum.add_diagonal(&vec![1.0; vectors.columns()]);
    sum
}

/// The upper triangular matrix U with U^T U = `a`.
#[inline(always)]
fn cholesky<S: Simd>(mut a: Matrix) -> Result<Matrix, SlabError> {
    let n = a.rows();
    for k in 0..n {
        let pivot = a[(k, k)];
        if pivot.is_nan() || pivot <= 0.0 {
            return Err(SlabError::Peaked);
        }
        let inverse = 1.0 / pivot.sqrt();
        let row = a.row_mut(k);
        row[..k].fill(0.0);
        row[k..].iter_mut().for_each(|entry| *entry *= inverse);
        for i in k + 1..n {
            let factor = -a[(k, i)];
            let (upper, lower) = a.wide_rows_mut(k, i);
            add_scaled::<S>(lower, factor, upper);
        }
    }
    Ok(a)
}

/// Replaces the rows of A = U diag(k) V^T by those of V^T and returns k. One-sided Jacobi
/// rotations find every singular value to a relative accuracy that does not depend on the
/// norms of the rows (Demmel and Veselic 1992).
#[inline(always)]
fn orthogonalise<S: Simd>(a: &mut Matrix) -> Vec<f64> {
    let n = a.rows();
    // Rotations converge quadratically: if a sweep meets no squared cosine above this, the
    // rows are orthogonal to rounding.
    const DONE: f64 = 1e-18;
    const ROUNDING: f64 = 1e-32;
    for _ in 0..40 {
        let mut squares = vec![0.0; n];
        for (i, square) in squares.iter_mut().enumerate() {
            *square = dot::<S>(a.wide_row(i), a.wide_row(i));
        }
        let mut largest: f64 = 0.0;
        // Pairs with equal sum share no row, so their rotations overlap in time.
        for sum in 0..n {
            for i in 0..n {
                let j = (sum + n - i) % n;
                if i >= j {
                    continue;
                }
                let (upper, lower) = a.wide_rows_mut(i, j);
                let product = dot::<S>(upper, lower);
                let cosine = product * product / (squares[i] * squares[j]);
                if cosine <= ROUNDING {
                    continue;
                }
                largest = largest.max(cosine);
                let zeta = (squares[j] - squares[i]) / (2.0 * product);
                let tangent = (1.0 / (zeta.abs() + (1.0 + zeta * zeta).sqrt())).copysign(zeta);
                let c = 1.0 / (1.0 + tangent * tangent).sqrt();
                squares[i] -= tangent * product;
                squares[j] += tangent * product;
                let (c, s) = (F64x4::<S>::splat(c), F64x4::splat(c * tangent));
                for (x, y) in upper.iter_mut().zip(lower) {
                    let (a, b) = (F64x4::new(*x), F64x4::new(*y));
                    *x = (c * a - s * b).to_array();
                    *y = (s * a + c * b).to_array();
                }
            }
        }
        if largest < DONE {
            break;
        }
    }
    let mut rates = vec![0.0; n];
    for (i, rate) in rates.iter_mut().enumerate() {
        let row = a.wide_row_mut(i);
        let norm = dot::<S>(row, row).sqrt();
        scale::<S>(row, 1.0 / norm);
        *rate = norm;
    }
    rates
}
