//! What the data determine: eigenvectors of the Fisher information at the most probable point, in
//! units of the prior. It is linear there, so it says little where the derivatives change within
//! the interval of an unknown.
use nalgebra::{DMatrix, SymmetricEigen};

use crate::{Inverse, Optimum};

/// The combinations of the unknowns that the data determine, at the most probable point: the
/// eigenvectors of the Fisher information in units of the prior. A combination with the
/// information 1 is known from the data as well as from the prior; a larger one is determined by
/// the data.
#[derive(Debug, Clone, PartialEq)]
pub struct Information {
    /// Information of each combination, decreasing.
    pub values: Vec<f64>,
    /// Weights of the unknowns in each combination, each in units of its prior standard
    /// deviation; of length 1, the largest positive.
    pub directions: Vec<Vec<f64>>,
    /// Cosines between the derivatives of the whitened spectra with the unknowns.
    pub cosines: Vec<Vec<f64>>,
}

impl Information {
    /// The information at `optimum`.
    #[must_use]
    pub fn new(inverse: &Inverse<'_>, optimum: &Optimum) -> Self {
        let fisher = optimum.jacobian.tr_mul(&optimum.jacobian);
        let n = fisher.nrows();
        let sd: Vec<f64> = inverse
            .unknowns()
            .iter()
            .map(|unknown| unknown.prior_variance().sqrt())
            .collect();
        let scaled = DMatrix::from_fn(n, n, |i, j| sd[i] * fisher[(i, j)] * sd[j]);
        let eigen = SymmetricEigen::new(scaled);
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let direction = |k: &usize| {
            let column: Vec<f64> = eigen.eigenvectors.column(*k).iter().copied().collect();
            let largest = column
                .iter()
                .copied()
                .max_by(|a, b| a.abs().total_cmp(&b.abs()));
            let sign = largest.unwrap_or(1.0).signum();
            column.into_iter().map(|w| sign * w).collect()
        };
        let cosine = |i: usize, j: usize| {
            let scale = (fisher[(i, i)] * fisher[(j, j)]).sqrt();
            if scale > 0.0 {
                fisher[(i, j)] / scale
            } else {
                0.0
            }
        };
        Self {
            values: order
                .iter()
                .map(|k| eigen.eigenvalues[*k].max(0.0))
                .collect(),
            directions: order.iter().map(direction).collect(),
            cosines: (0..n)
                .map(|i| (0..n).map(|j| cosine(i, j)).collect())
                .collect(),
        }
    }

    /// Number of combinations with an information above 1.
    #[must_use]
    pub fn determined(&self) -> usize {
        self.values.iter().filter(|value| **value > 1.0).count()
    }

    /// Degrees of freedom that the data take: each combination counts with the share of its
    /// posterior that is from the data.
    #[must_use]
    pub fn degrees_of_freedom(&self) -> f64 {
        self.values.iter().map(|value| value / (1.0 + value)).sum()
    }
}
