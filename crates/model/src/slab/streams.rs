//! Streams: Gauss-Legendre nodes of the cosine on each hemisphere, and quantities that
//! depend on the nodes alone.
use std::f64::consts::PI;

use super::{Matrix, SlabError};

/// The streams of a hemisphere; both hemispheres have the same.
#[derive(Debug, Clone)]
pub struct Streams {
    pub(super) cosines: Vec<f64>,
    pub(super) weights: Vec<f64>,
    /// `[2 n, n]`: P_l at the cosines.
    pub(super) legendre: Matrix,
    /// `[n - 1, n - 1]`, one row for each even l >= 2: sqrt((2l + 1) w) P_l in an orthonormal
    /// basis whose first vector is sqrt(w). The first component, which is 0, is omitted.
    pub(super) even: Matrix,
    /// `[n, n]`, one row for each odd l: sqrt((2l + 1) w) P_l.
    pub(super) odd: Matrix,
    /// `[n, n]`: transformation into that basis times diag(1/mu).
    pub(super) basis_over_cosine: Matrix,
    /// sqrt(w mu): the flux in a stream per symmetrised intensity.
    pub(super) flux: Vec<f64>,
    /// `[n, n]`: factors from the symmetrised operators to the operators on fluxes.
    pub(super) flux_ratio: Matrix,
}

impl Streams {
    /// Maximum number of streams per hemisphere.
    pub const MAX: usize = 64;

    /// `n` streams per hemisphere, 2 to [`Self::MAX`].
    ///
    /// # Errors
    /// [`SlabError::Streams`] for any other `n`.
    pub fn new(n: usize) -> Result<Self, SlabError> {
        if !(2..=Self::MAX).contains(&n) {
            return Err(SlabError::Streams { n });
        }
        let (cosines, weights) = gauss_legendre(n);
        let columns: Vec<_> = cosines.iter().map(|&x| legendre(2 * n, x)).collect();
        let legendre = Matrix::from_fn(2 * n, n, |l, i| columns[i][l]);

        // Householder reflection of q = sqrt(w) onto the first axis
        let q: Vec<f64> = weights.iter().map(|w| w.sqrt()).collect();
        let mut v = q.clone();
        v[0] -= 1.0;
        let half_square = 1.0 - q[0];
        let term = |l: usize, i: usize| (2.0 * l as f64 + 1.0).sqrt() * q[i] * legendre[(l, i)];
        let along: Vec<f64> = (0..2 * n)
            .map(|l| (0..n).map(|i| v[i] * term(l, i)).sum::<f64>() / half_square)
            .collect();
        let even = Matrix::from_fn(n - 1, n - 1, |l, i| {
            let (l, i) = (2 * l + 2, i + 1);
            term(l, i) - v[i] * along[l]
        });
        let odd = Matrix::from_fn(n, n, |l, i| term(2 * l + 1, i));
        let basis_over_cosine = Matrix::from_fn(n, n, |i, j| {
            let identity = f64::from(u8::from(i == j));
            (identity - v[i] * v[j] / half_square) / cosines[j]
        });
        let flux: Vec<f64> = (0..n).map(|i| (weights[i] * cosines[i]).sqrt()).collect();
        let flux_ratio = Matrix::from_fn(n, n, |i, j| flux[i] / flux[j]);
        Ok(Self {
            cosines,
            weights,
            legendre,
            even,
            odd,
            basis_over_cosine,
            flux,
            flux_ratio,
        })
    }

    /// Number of streams per hemisphere.
    #[must_use]
    pub fn count(&self) -> usize {
        self.cosines.len()
    }

    /// Cosines of the angles from the normal, increasing in (0, 1).
    #[must_use]
    pub fn cosines(&self) -> &[f64] {
        &self.cosines
    }

    /// Weights of the integral over the cosine from 0 to 1. Their sum is 1.
    #[must_use]
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }
}

/// P_0 to P_(count - 1) at `x`.
pub(super) fn legendre(count: usize, x: f64) -> Vec<f64> {
    let mut p = vec![1.0, x];
    for l in 2..count {
        let m = l as f64;
        p.push(((2.0 * m - 1.0) * x * p[l - 1] - (m - 1.0) * p[l - 2]) / m);
    }
    p.truncate(count);
    p
}

/// Nodes and weights on the interval from 0 to 1: zeros of P_n by Newton's method
/// (Abramowitz and Stegun, 25.4.30).
fn gauss_legendre(n: usize) -> (Vec<f64>, Vec<f64>) {
    (0..n)
        .map(|i| {
            let mut x = -libm::cos(PI * (i as f64 + 0.75) / (n as f64 + 0.5));
            let mut slope = 0.0;
            for _ in 0..8 {
                let p = legendre(n + 1, x);
                slope = n as f64 * (p[n - 1] - x * p[n]) / (1.0 - x * x);
                x -= p[n] / slope;
            }
            (
                0.5 * (1.0 + x),
                1.0 / ((1.0 - x) * (1.0 + x) * slope * slope),
            )
        })
        .unzip()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Abramowitz and Stegun, table 25.4, mapped to (0, 1).
    #[test]
    fn nodes_and_weights_match_tabulated_values() {
        let tables: [(usize, &[(f64, f64)]); 3] = [
            (2, &[(0.577_350_269_189_626, 1.0)]),
            (
                4,
                &[
                    (0.339_981_043_584_856, 0.652_145_154_862_546),
                    (0.861_136_311_594_053, 0.347_854_845_137_454),
                ],
            ),
            (
                8,
                &[
                    (0.183_434_642_495_650, 0.362_683_783_378_362),
                    (0.525_532_409_916_329, 0.313_706_645_877_887),
                    (0.796_666_477_413_627, 0.222_381_034_453_374),
                    (0.960_289_856_497_536, 0.101_228_536_290_376),
                ],
            ),
        ];
        for (n, table) in tables {
            let streams = Streams::new(n).unwrap();
            for (i, (x, w)) in table.iter().enumerate() {
                for (j, sign) in [(n / 2 - 1 - i, -1.0), (n / 2 + i, 1.0)] {
                    assert!((streams.cosines()[j] - 0.5 * (1.0 + sign * x)).abs() < 6e-16);
                    assert!((streams.weights()[j] - 0.5 * w).abs() < 6e-16);
                }
            }
        }
    }

    #[test]
    fn powers_are_integrated_exactly() {
        for n in 2..=Streams::MAX {
            let streams = Streams::new(n).unwrap();
            for power in 0..2 * n as i32 {
                let nodes = streams.cosines().iter().zip(streams.weights());
                let integral: f64 = nodes.map(|(x, w)| w * x.powi(power)).sum();
                let exact = 1.0 / (f64::from(power) + 1.0);
                assert!((integral / exact - 1.0).abs() < 2e-13, "{n} {power}");
            }
        }
    }

    #[test]
    fn stream_numbers_out_of_range_are_rejected() {
        for n in [0, 1, 65] {
            assert!(matches!(Streams::new(n), Err(SlabError::Streams { .. })));
        }
    }
}
