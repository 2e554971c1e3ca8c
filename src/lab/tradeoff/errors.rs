//! Error measures of a spectrum against the truth.
use serde::Serialize;

use crate::accuracy::{rms, rmse};
use crate::colour::Colorimeter;

/// Differences between two spectra, or statistics of such differences.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Metrics {
    /// Root mean square difference over the wavelengths.
    pub rmse: f64,
    /// Largest absolute difference at a wavelength.
    pub max_abs: f64,
    /// Delta-E*ab (D65, CIE 1931 2 degrees); `None` if the spectra have no colour.
    pub delta_e: Option<f64>,
}

impl Metrics {
    /// Compares `values` with `truth`, both `[l]`.
    ///
    /// # Panics
    /// If `colour` has another number of wavelengths.
    #[must_use]
    pub fn between(values: &[f64], truth: &[f64], colour: Option<&Colorimeter>) -> Self {
        let differences = values.iter().zip(truth).map(|(a, b)| (a - b).abs());
        Self {
            rmse: rmse(values, truth),
            max_abs: differences.fold(0.0, f64::max),
            delta_e: colour.map(|c| c.difference(values, truth)),
        }
    }

    /// The root mean square of each measure over `samples`.
    #[must_use]
    pub fn rms(samples: &[Self]) -> Self {
        let rms = |part: fn(&Self) -> f64| rms(samples.iter().map(part));
        let coloured = samples.iter().all(|metrics| metrics.delta_e.is_some());
        Self {
            rmse: rms(|m| m.rmse),
            max_abs: rms(|m| m.max_abs),
            delta_e: coloured.then(|| rms(|m| m.delta_e.unwrap_or_default())),
        }
    }

    /// The larger value of each measure.
    #[must_use]
    pub fn max(self, other: Self) -> Self {
        Self {
            rmse: self.rmse.max(other.rmse),
            max_abs: self.max_abs.max(other.max_abs),
            delta_e: self.delta_e.zip(other.delta_e).map(|(a, b)| a.max(b)),
        }
    }

    /// Each measure multiplied by `factor`.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            rmse: factor * self.rmse,
            max_abs: factor * self.max_abs,
            delta_e: self.delta_e.map(|e| factor * e),
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn measures_by_hand() {
        let found = Metrics::between(&[0.5, 0.1, 0.2], &[0.5, 0.4, 0.6], None);
        assert!((found.rmse - (0.25_f64 / 3.0).sqrt()).abs() < 1e-15);
        assert!((found.max_abs - 0.4).abs() < 1e-15);
        assert_eq!(found.delta_e, None);
    }

    #[test]
    fn statistics_by_hand() {
        let metrics = |rmse, delta_e| Metrics {
            rmse,
            max_abs: 2.0 * rmse,
            delta_e,
        };
        let pair = [metrics(3.0, Some(1.0)), metrics(4.0, Some(7.0))];
        let rms = Metrics::rms(&pair);
        assert!((rms.rmse - 12.5_f64.sqrt()).abs() < 1e-15);
        assert!((rms.max_abs - 50.0_f64.sqrt()).abs() < 1e-14);
        assert!((rms.delta_e.unwrap() - 5.0).abs() < 1e-15);
        assert_eq!(pair[0].max(pair[1]), pair[1]);
        assert_eq!(pair[0].scaled(2.0), metrics(6.0, Some(2.0)));
        assert_eq!(Metrics::rms(&[pair[0], metrics(1.0, None)]).delta_e, None);
    }

    /// L* is 116 Y^(1/3) - 16, and a grey has a* = b* = 0.
    #[test]
    fn delta_e_of_two_greys() {
        let nm: Vec<f64> = (40..=70).map(|i| f64::from(i) * 10.0).collect();
        let colour = Colorimeter::new(&nm).unwrap().unwrap();
        let found = Metrics::between(&[0.125; 31], &[0.216; 31], Some(&colour));
        assert!((found.delta_e.unwrap() - 116.0 * 0.1).abs() < 1e-9);
    }
}
