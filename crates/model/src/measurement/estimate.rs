//! Running sums of a Monte Carlo estimate.
use serde::{Deserialize, Serialize};

use crate::measurement::Measured;

/// Smallest effective number of scores from which the variance is estimated.
const FEWEST_SCORES: f64 = 10.0;

/// Sum and sum of squares of the scores of rays. Rays that scored nothing are counted
/// by the number of rays passed to [`Estimate::measured`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Estimate {
    sum: f64,
    sum_sq: f64,
}

impl Estimate {
    /// Adds one ray's score.
    #[inline]
    pub fn add(&mut self, score: f64) {
        self.sum += score;
        self.sum_sq += score * score;
    }

    /// Adds `count` scores of 1.
    pub fn add_count(&mut self, count: u64) {
        self.sum += count as f64;
        self.sum_sq += count as f64;
    }

    /// Adds the sums of another estimate.
    #[inline]
    pub fn merge(&mut self, other: &Self) {
        self.sum += other.sum;
        self.sum_sq += other.sum_sq;
    }

    /// Mean over `rays` rays and its standard error.
    ///
    /// If every ray scored 0 or every ray scored 1, the sample variance is 0 and carries
    /// no information. The standard error is then 1/rays, the size of a contribution
    /// that may have been missed. It is also at least 1/rays if most of the sum comes
    /// from fewer than ten rays: if scores differ greatly in size, the largest may be too
    /// rare to be in the sample.
    #[must_use]
    pub fn measured(&self, rays: u64) -> Measured {
        let n = rays as f64;
        let value = self.sum / n;
        if self.sum_sq == 0.0 || self.sum_sq == n {
            return Measured { value, se: 1.0 / n };
        }
        let variance = (self.sum_sq / n - value * value).max(0.0);
        let se = (variance / (n - 1.0).max(1.0)).sqrt();
        // effective number of scores: that many equal scores would have these sums
        let scores = self.sum * self.sum / self.sum_sq;
        let missed = if scores < FEWEST_SCORES { 1.0 / n } else { 0.0 };
        Measured {
            value,
            se: se.max(missed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_standard_error_by_hand() {
        let (mut a, mut b) = (Estimate::default(), Estimate::default());
        for _ in 0..8 {
            a.add(1.0);
            a.add(0.5);
            b.add(0.25);
        }
        a.merge(&b);
        // of four rays 1, 0.5, 0.25, 0: mean 7/16
        let m = a.measured(32);
        assert!((m.value - 0.4375).abs() < 1e-15);
        let squares = [1.0, 0.5, 0.25, 0.0].map(|x: f64| 8.0 * (x - 0.4375).powi(2));
        let variance = squares.iter().sum::<f64>() / 31.0;
        assert!((m.se - (variance / 32.0).sqrt()).abs() < 1e-15);
    }

    /// A thousand scores from 1 to exp(-30) include the largest possible ones. Five
    /// scores of 1e-20 do not exclude a score of 1 in ten thousand rays.
    #[test]
    fn few_large_scores_are_not_trusted() {
        let mut broad = Estimate::default();
        (0..1000).for_each(|i| broad.add(libm::exp(-0.03 * f64::from(i))));
        assert!(broad.measured(1000).se < 5e-3);
        let mut rare = Estimate::default();
        (0..5).for_each(|_| rare.add(1e-20));
        let missed = rare.measured(1000);
        assert!(missed.value < 1e-22 && missed.se == 1e-3, "{missed:?}");
    }

    #[test]
    fn equal_scores_have_an_error_of_one_ray() {
        assert_eq!(
            Estimate::default().measured(1000),
            Measured {
                value: 0.0,
                se: 1e-3
            }
        );
        let mut all = Estimate::default();
        all.add_count(1000);
        assert_eq!(
            all.measured(1000),
            Measured {
                value: 1.0,
                se: 1e-3
            }
        );
    }
}
