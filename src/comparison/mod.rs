//! Comparison of a simulated spectrum with a measured one: residuals and their root mean
//! square, overall and per band (docs/formats.md). The comparison needs no physics.
mod error;
mod exclusion;
mod measured;

use crate::measurement::Measured;
pub use crate::spectrum::Band;

pub use error::MeasuredError;
pub use exclusion::{Exclusion, excluded};
pub use measured::{Hints, Matched, MeasuredSpectrum, RANGE_NM, VALUES, listed, longest_nm};

/// Varsa 2025 calls a root mean square error below this value good.
pub const GOOD_RMSE: f64 = 0.03;

/// One wavelength of a comparison.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResidualPoint {
    /// The measured value.
    pub matched: Matched,
    /// The simulated value with its standard error.
    pub simulated: Measured,
}

impl ResidualPoint {
    /// Simulated minus measured.
    #[must_use]
    pub fn residual(&self) -> f64 {
        self.simulated.value - self.matched.value
    }
}

/// Statistics of the residuals at some points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResidualStatistics {
    /// Number of points, at least 1.
    pub points: usize,
    /// Root mean square residual.
    pub rmse: f64,
    /// Mean residual; positive if the simulation is brighter.
    pub bias: f64,
    /// Mean standard error of the simulation; noise alone gives an RMSE of about this size.
    pub mean_simulated_se: f64,
    /// Mean standard uncertainty of the measurement; `None` if the file does not state it.
    pub mean_uncertainty: Option<f64>,
}

impl ResidualStatistics {
    /// The statistics of `points`; `None` if there are none.
    fn of(points: &[&ResidualPoint]) -> Option<Self> {
        let mean = |part: &dyn Fn(&ResidualPoint) -> Option<f64>| -> Option<f64> {
            let sum: Option<f64> = points.iter().map(|point| part(point)).sum();
            sum.filter(|_| !points.is_empty())
                .map(|sum| sum / points.len() as f64)
        };
        Some(Self {
            points: points.len(),
            rmse: mean(&|point| Some(point.residual() * point.residual()))?.sqrt(),
            bias: mean(&|point| Some(point.residual()))?,
            mean_simulated_se: mean(&|point| Some(point.simulated.se))?,
            mean_uncertainty: mean(&|point| point.matched.uncertainty),
        })
    }
}

/// A simulated spectrum compared with a measured one.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// The wavelengths with both values, in order, including the excluded ones.
    pub points: Vec<ResidualPoint>,
}

impl Comparison {
    /// Compares `matched` with `simulated`, which holds a value for every wavelength of the list
    /// for which `matched` was made.
    #[must_use]
    pub fn new(matched: &[Matched], simulated: &[Measured]) -> Self {
        let point = |matched: &Matched| {
            let (matched, simulated) = (*matched, *simulated.get(matched.index)?);
            Some(ResidualPoint { matched, simulated })
        };
        Self {
            points: matched.iter().filter_map(point).collect(),
        }
    }

    /// Statistics over all wavelengths that are not excluded; `None` if there are none.
    #[must_use]
    pub fn overall(&self) -> Option<ResidualStatistics> {
        self.statistics(|_| true)
    }

    /// Statistics over the wavelengths of a band that are not excluded; `None` if there are none.
    #[must_use]
    pub fn band(&self, band: Band) -> Option<ResidualStatistics> {
        self.statistics(|nm| band.holds(nm))
    }

    /// Statistics over the wavelengths beyond all bands that are not excluded; `None` if there
    /// are none.
    #[must_use]
    pub fn beyond_bands(&self) -> Option<ResidualStatistics> {
        self.statistics(|nm| nm > RANGE_NM.1)
    }

    /// Statistics over the wavelengths that are not excluded and for which `is_in_band` holds.
    fn statistics(&self, is_in_band: impl Fn(f64) -> bool) -> Option<ResidualStatistics> {
        let is_counted =
            |point: &&ResidualPoint| !point.matched.excluded && is_in_band(point.matched.nm);
        let points: Vec<&ResidualPoint> = self.points.iter().filter(is_counted).collect();
        ResidualStatistics::of(&points)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-12
    }

    /// Residuals 0.03, 0.04 | -0.02 | 1 (excluded) | 0.06 at the last wavelength.
    #[test]
    fn by_hand() {
        let measured = [
            (399.0, 0.50, false),
            (399.5, 0.50, false),
            (400.0, 0.52, false),
            (1800.0, -0.5, true),
            (2500.0, 0.44, false),
        ];
        let matched: Vec<Matched> = measured
            .into_iter()
            .enumerate()
            .map(|(index, (nm, value, excluded))| Matched {
                index,
                nm,
                value,
                uncertainty: Some(0.01),
                excluded,
            })
            .collect();
        let simulated = [0.53, 0.54, 0.5, 0.5, 0.5].map(|value| Measured { value, se: 0.002 });
        let comparison = Comparison::new(&matched, &simulated);
        let rmse = |band| comparison.band(band).unwrap().rmse;
        assert!(close(rmse(Band::UvA), 0.00125_f64.sqrt()));
        assert!(close(rmse(Band::Visible), 0.02));
        assert!(close(rmse(Band::IrB), 0.06));
        assert_eq!(comparison.band(Band::IrA), None);
        let overall = comparison.overall().unwrap();
        // (9 + 16 + 4 + 36) / 4 = 16.25 in units of 1e-4
        assert!(close(overall.rmse, 0.001_625_f64.sqrt()));
        assert!(close(overall.bias, 0.11 / 4.0));
        assert!(close(overall.mean_simulated_se, 0.002));
        assert!(close(overall.mean_uncertainty.unwrap(), 0.01));
        assert_eq!((overall.points, comparison.points.len()), (4, 5));
    }
}
