//! The most probable point: the method of Levenberg (1944) and Marquardt (1963) from the best
//! points of a coarse grid, and intervals in the approximation of Laplace, which holds where the
//! spectrum is linear in the unknowns over an interval. Another optimum far from all starts is
//! not found.
use nalgebra::{Cholesky, DMatrix, DVector};

use crate::{Inverse, Observation, Scratch};

/// Largest number of points of the coarse grid.
const MOST_STARTS: usize = 256;
/// Largest number of derivatives of one search.
const MOST_STEPS: usize = 40;
/// A search ends if the cost would fall by less than this.
const TOLERANCE: f64 = 1e-6;

/// The most probable point.
#[derive(Debug, Clone)]
pub struct Optimum {
    /// Places of the unknowns.
    pub u: Vec<f64>,
    /// Sum of squares of the whitened residuals: chi-square.
    pub chi_square: f64,
    /// The same for the Gaussian priors.
    pub prior_square: f64,
    /// Derivatives of the whitened residuals with the places.
    pub jacobian: DMatrix<f64>,
    /// Half the derivatives of the cost with the places; not 0 at the ends of a range.
    pub gradient: Vec<f64>,
    /// Whether the search ended by its tolerance.
    pub converged: bool,
}

impl Optimum {
    /// Half of the second derivatives of the cost: the inverse is the covariance of the places in
    /// the approximation of Laplace.
    #[must_use]
    pub fn precision(&self, inverse: &Inverse<'_>) -> DMatrix<f64> {
        let mut precision = self.jacobian.tr_mul(&self.jacobian);
        for (i, unknown) in inverse.unknowns().iter().enumerate() {
            precision[(i, i)] += unknown.gaussian().map_or(0.0, |[_, sd]| sd.powi(-2));
        }
        precision
    }

    /// Ends of the central share `mass` of unknown `i`, as places, in the approximation of Laplace:
    /// a Gaussian cut off at the ends of the range. The ranges of the other unknowns count as
    /// Gaussians of the same variance.
    #[must_use]
    pub fn interval(&self, inverse: &Inverse<'_>, i: usize, mass: f64) -> [f64; 2] {
        let mut precision = self.jacobian.tr_mul(&self.jacobian);
        for (j, unknown) in inverse.unknowns().iter().enumerate() {
            precision[(j, j)] += match j == i {
                true => unknown.gaussian().map_or(1e-6, |[_, sd]| sd.powi(-2)),
                false => 1.0 / unknown.prior_variance(),
            };
        }
        let Some(factor) = Cholesky::new(precision) else {
            return [f64::NAN; 2];
        };
        let covariance = factor.inverse();
        let gradient = self.gradient.iter().enumerate();
        let step: f64 = gradient.map(|(j, g)| covariance[(i, j)] * g).sum();
        let (mean, sd) = (self.u[i] - step, covariance[(i, i)].sqrt());
        // from the nearer tail, so that the difference keeps its digits
        let side = if mean > 0.5 { -1.0 } else { 1.0 };
        let above = |u: f64| libm::erfc(side * (u - mean) / (sd * std::f64::consts::SQRT_2));
        let [first, last] = [0.0, 1.0].map(above);
        let place = |share: f64| {
            let wanted = first + share * (last - first);
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..24 {
                let middle = 0.5 * (low + high);
                match (above(middle) - wanted) * side > 0.0 {
                    true => low = middle,
                    false => high = middle,
                }
            }
            0.5 * (low + high)
        };
        [place(0.5 - 0.5 * mass), place(0.5 + 0.5 * mass)]
    }

    /// Covariance of the places after the measurement, in the approximation of Laplace. The finite
    /// range of each unknown counts as a Gaussian of the same variance, so that it is finite.
    #[must_use]
    pub fn covariance(&self, inverse: &Inverse<'_>) -> DMatrix<f64> {
        let mut precision = self.jacobian.tr_mul(&self.jacobian);
        for (i, unknown) in inverse.unknowns().iter().enumerate() {
            precision[(i, i)] += 1.0 / unknown.prior_variance();
        }
        let n = precision.nrows();
        Cholesky::new(precision).map_or_else(
            || DMatrix::from_element(n, n, f64::NAN),
            |factor| factor.inverse(),
        )
    }
}

/// Number of places per unknown of the coarse grid.
fn starts_per_unknown(unknowns: usize) -> usize {
    let mut count: usize = 9;
    while count > 2 && count.pow(unknowns as u32) > MOST_STARTS {
        count -= 1;
    }
    count
}

/// The places of the coarse grid: the middles of equal cells.
fn starts(unknowns: usize) -> Vec<Vec<f64>> {
    let per = starts_per_unknown(unknowns);
    // for many unknowns only some corners of the cube
    let count = per.pow(unknowns.min(8) as u32);
    let place = |number: usize, axis: usize| {
        let digit = number / per.pow(axis.min(7) as u32) % per;
        (digit as f64 + 0.5) / per as f64
    };
    let start = |number| (0..unknowns).map(|axis| place(number, axis)).collect();
    (0..count).map(start).collect()
}

/// The coarse grid of spectra that many observations with the same emulator, wavelengths, errors
/// and known values share.
#[derive(Debug, Clone)]
pub struct StartTable {
    starts: Vec<(Vec<f64>, Vec<f64>)>,
}

impl StartTable {
    /// The modelled spectra for an `inverse` problem with one observation.
    #[must_use]
    pub fn new(inverse: &Inverse<'_>) -> Self {
        let mut scratch = Scratch::default();
        let mut modelled = vec![0.0; inverse.values()];
        let starts = starts(inverse.unknowns().len()).into_iter();
        let found = starts.filter_map(|u| {
            let exists = inverse.model(&u, &mut scratch, &mut modelled);
            exists.then(|| (u, modelled.clone()))
        });
        Self {
            starts: found.collect(),
        }
    }

    /// The start whose spectrum is nearest to that of `observation`, in units of its errors
    /// without correlation.
    fn nearest(&self, observation: &Observation<'_>) -> Option<&[f64]> {
        let square = |modelled: &[f64]| -> f64 {
            let pairs = modelled.iter().zip(observation.measured());
            pairs.map(|(m, y)| (m - y).powi(2)).sum()
        };
        let costs = self.starts.iter().map(|(u, m)| (u, square(m)));
        let best = costs.min_by(|a, b| a.1.total_cmp(&b.1));
        best.map(|(u, _)| u.as_slice())
    }
}

impl Inverse<'_> {
    /// The most probable point of one observation, from the nearest spectrum of `table`; `None`
    /// if the model has no spectrum.
    #[must_use]
    pub fn best_from(&self, table: &StartTable, scratch: &mut Scratch) -> Option<Optimum> {
        let start = table.nearest(self.observations().first()?)?;
        self.search(start, scratch)
    }

    /// The most probable point, from the best three of a coarse grid; `None` if the model has no
    /// spectrum there.
    #[must_use]
    pub fn best(&self) -> Option<Optimum> {
        let (mut scratch, mut out) = (Scratch::default(), vec![0.0; self.values()]);
        let mut costs: Vec<(f64, Vec<f64>)> = starts(self.unknowns().len())
            .into_iter()
            .map(|u| (self.cost(&u, &mut scratch, &mut out), u))
            .filter(|(cost, _)| cost.is_finite())
            .collect();
        costs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let found = costs.iter().take(3);
        let found = found.filter_map(|(_, u)| self.search(u, &mut scratch));
        let cost = |o: &Optimum| o.chi_square + o.prior_square;
        found.min_by(|a, b| cost(a).total_cmp(&cost(b)))
    }

    /// Levenberg and Marquardt from `start`, within the range of each unknown.
    #[must_use]
    pub fn search(&self, start: &[f64], scratch: &mut Scratch) -> Option<Optimum> {
        let mut out = vec![0.0; self.values()];
        let mut u = start.to_vec();
        let mut squares = self.residuals(&u, scratch, &mut out);
        let mut jacobian = self.jacobian(&u, scratch)?;
        let (mut damping, mut converged) = (1e-2, false);
        let mut trial_out = out.clone();
        for _ in 0..MOST_STEPS {
            let (gradient, curvature) = self.quadratic(&u, &out, &jacobian);
            let is_free = |i: &usize| {
                let held = [
                    u[*i] <= 0.0 && gradient[*i] > 0.0,
                    u[*i] >= 1.0 && gradient[*i] < 0.0,
                ];
                held == [false; 2]
            };
            let free: Vec<usize> = (0..u.len()).filter(is_free).collect();
            let mut accepted = None;
            while damping < 1e8 {
                let Some(step) = step(&gradient, &curvature, &free, damping) else {
                    damping *= 10.0;
                    continue;
                };
                let mut trial = u.clone();
                for (i, step) in free.iter().zip(step.iter()) {
                    trial[*i] = (trial[*i] + step).clamp(0.0, 1.0);
                }
                let moved = DVector::from_iterator(
                    u.len(),
                    trial.iter().zip(&u).map(|(to, from)| to - from),
                );
                let predicted =
                    -2.0 * gradient.dot(&moved) - (moved.transpose() * &curvature * &moved)[0];
                if predicted < TOLERANCE {
                    converged = true;
                    break;
                }
                let found = self.residuals(&trial, scratch, &mut trial_out);
                if found.iter().sum::<f64>() < squares.iter().sum() {
                    accepted = Some((trial, found));
                    damping = (damping * 0.2).max(1e-9);
                    break;
                }
                damping *= 5.0;
            }
            let Some((trial, found)) = accepted else {
                break;
            };
            (u, squares) = (trial, found);
            std::mem::swap(&mut out, &mut trial_out);
            jacobian = self.jacobian(&u, scratch)?;
        }
        let [chi_square, prior_square] = squares;
        let (gradient, _) = self.quadratic(&u, &out, &jacobian);
        Some(Optimum {
            u,
            chi_square,
            prior_square,
            jacobian,
            gradient: gradient.as_slice().to_vec(),
            // no step of any length lowers the cost: a kink of the emulator at a node
            converged: converged || damping >= 1e8,
        })
    }

    /// Half the gradient of the cost, and half its second derivatives without those of the model.
    fn quadratic(
        &self,
        u: &[f64],
        residuals: &[f64],
        jacobian: &DMatrix<f64>,
    ) -> (DVector<f64>, DMatrix<f64>) {
        let residuals = DVector::from_column_slice(residuals);
        let mut gradient = jacobian.tr_mul(&residuals);
        let mut curvature = jacobian.tr_mul(jacobian);
        for (i, unknown) in self.unknowns().iter().enumerate() {
            if let Some([mean, sd]) = unknown.gaussian() {
                gradient[i] += (u[i] - mean) / (sd * sd);
                curvature[(i, i)] += 1.0 / (sd * sd);
            }
        }
        (gradient, curvature)
    }
}

/// The damped step of the free unknowns; `None` if the matrix is singular.
fn step(
    gradient: &DVector<f64>,
    curvature: &DMatrix<f64>,
    free: &[usize],
    damping: f64,
) -> Option<DVector<f64>> {
    let n = free.len();
    let matrix = DMatrix::from_fn(n, n, |i, j| {
        let value = curvature[(free[i], free[j])];
        match i == j {
            // the constant keeps directions without any information where they are
            true => value * (1.0 + damping) + damping + 1e-9,
            false => value,
        }
    });
    let right = DVector::from_iterator(n, free.iter().map(|i| -gradient[*i]));
    Some(Cholesky::new(matrix)?.solve(&right))
}
