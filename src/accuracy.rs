//! Measures of accuracy: root mean squares, and summaries of the errors of many curves.

/// The mean of `values`; NaN if there are none.
pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Accumulates a root mean square.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RootMeanSquare {
    squares: f64,
    count: usize,
}

impl RootMeanSquare {
    pub(crate) fn add(&mut self, value: f64) {
        self.squares += value * value;
        self.count += 1;
    }

    /// The root mean square of the values added; NaN if there are none.
    pub(crate) fn value(self) -> f64 {
        (self.squares / self.count as f64).sqrt()
    }
}

/// The root mean square of `values`; NaN if there are none.
pub(crate) fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut sum = RootMeanSquare::default();
    values.into_iter().for_each(|value| sum.add(value));
    sum.value()
}

/// The root mean square difference of two spectra of one length (Varsa 2025, eq. 6.4).
pub(crate) fn rmse(a: &[f64], b: &[f64]) -> f64 {
    rms(a.iter().zip(b).map(|(a, b)| a - b))
}

/// Smallest, mean and largest of the values added. Each value belongs to a numbered item.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RunningSummary {
    count: usize,
    sum: f64,
    pub(crate) min: f64,
    pub(crate) max: f64,
    /// Number of the first item with the largest value.
    pub(crate) worst: usize,
}

impl RunningSummary {
    /// Adds the value of `item`.
    pub(crate) fn add(&mut self, item: usize, value: f64) {
        if self.count == 0 || value < self.min {
            self.min = value;
        }
        if self.count == 0 || value > self.max {
            (self.max, self.worst) = (value, item);
        }
        self.sum += value;
        self.count += 1;
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The mean; NaN if no value was added.
    pub(crate) fn mean(&self) -> f64 {
        self.sum / self.count as f64
    }
}

/// The smallest of the `sorted` values that at least `percent` % of them do not exceed;
/// `None` if there are no values.
pub(crate) fn percentile(sorted: &[f64], percent: usize) -> Option<f64> {
    let rank = (sorted.len() * percent).div_ceil(100).max(1);
    sorted.get(rank - 1).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn root_mean_squares_by_hand() {
        assert_eq!(rms([3.0, -4.0]), 12.5_f64.sqrt());
        assert_eq!(rmse(&[0.5, 1.0], &[0.25, 1.25]), 0.25);
        assert!(rms([]).is_nan());
    }

    #[test]
    fn the_first_of_equal_values_is_the_worst() {
        let mut summary = RunningSummary::default();
        assert!(summary.is_empty());
        for (item, value) in [(4, 1.0), (6, 3.0), (7, 3.0), (9, -1.0)] {
            summary.add(item, value);
        }
        assert_eq!((summary.min, summary.max, summary.worst), (-1.0, 3.0, 6));
        assert_eq!(summary.mean(), 1.5);
    }

    #[test]
    fn percentiles_by_hand() {
        let values: Vec<f64> = (1..=100).map(f64::from).collect();
        assert_eq!(percentile(&values, 95), Some(95.0));
        assert_eq!(percentile(&values, 0), Some(1.0));
        assert_eq!(percentile(&[3.0], 95), Some(3.0));
        assert_eq!(percentile(&[], 95), None);
    }
}
