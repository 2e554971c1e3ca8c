//! The numbers of an error budget and their printed form.
use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};

use super::ErrorBudget;
use crate::accuracy::{mean, percentile};
use crate::compress::CurveError;

/// Number of worst points listed.
const NAMED: usize = 3;

/// Statistics of the errors of many spectra. Files hold mean, 95th percentile and maximum as
/// an array.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(into = "[f64; 3]", from = "[f64; 3]")]
pub struct ErrorSummary {
    /// Mean.
    pub mean: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Maximum.
    pub max: f64,
}

impl From<ErrorSummary> for [f64; 3] {
    fn from(ErrorSummary { mean, p95, max }: ErrorSummary) -> Self {
        [mean, p95, max]
    }
}

impl From<[f64; 3]> for ErrorSummary {
    fn from([mean, p95, max]: [f64; 3]) -> Self {
        Self { mean, p95, max }
    }
}

/// The errors of many spectra, as colour difference and as RMSE.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Measures {
    /// Delta-E; `None` if the wavelengths do not determine a colour.
    pub delta_e: Option<ErrorSummary>,
    /// RMSE over the wavelengths.
    pub rmse: ErrorSummary,
}

/// One of the points with the largest errors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WorstPoint {
    /// The point as text.
    pub at: String,
    /// Delta-E at the point; `None` if the wavelengths do not determine a colour.
    pub delta_e: Option<f64>,
    /// RMSE at the point.
    pub rmse: f64,
}

/// The errors of one quantity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct QuantityErrors {
    /// The file against the truth at random points: the whole chain.
    pub total: Measures,
    /// The file against the curves that it was made from.
    pub compression: Measures,
    /// The interpolated curves against the truth at the file's wavelengths: the errors of
    /// simulation and interpolation.
    pub interpolation: Measures,
    /// The curves against the truth at nodes; `None` if no node was simulated.
    pub simulation: Option<Measures>,
    /// The error of linear interpolation between the file's wavelengths; `None` if the file
    /// has all wavelengths of the truth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wavelengths: Option<Measures>,
    /// The difference that one standard error of the truth makes.
    pub noise: Measures,
    /// The interpolated curves against the truth at points off the nodes in one axis only, by
    /// the name of the axis.
    pub axes: BTreeMap<String, Measures>,
    /// The random points with the largest errors of the whole chain, largest first.
    pub worst: Vec<WorstPoint>,
}

/// Collects errors for [`QuantityErrors`].
#[derive(Default)]
pub(super) struct Collector {
    pub(super) total: Vec<(String, CurveError)>,
    pub(super) compression: Vec<CurveError>,
    pub(super) interpolation: Vec<CurveError>,
    pub(super) simulation: Vec<CurveError>,
    pub(super) wavelengths: Vec<CurveError>,
    pub(super) noise: Vec<CurveError>,
    pub(super) axes: BTreeMap<String, Vec<CurveError>>,
}

impl Collector {
    /// The summaries of the errors collected.
    pub(super) fn finish(mut self) -> QuantityErrors {
        // The worst points are those of the largest Delta-E, or RMSE if there is no colour.
        let size = |e: &CurveError| e.delta_e.unwrap_or(e.rmse);
        self.total.sort_by(|a, b| size(&b.1).total_cmp(&size(&a.1)));
        let worst = self.total.iter().take(NAMED).map(|(at, error)| WorstPoint {
            at: at.clone(),
            delta_e: error.delta_e.map(four_digits),
            rmse: four_digits(error.rmse),
        });
        let worst = worst.collect();
        let total: Vec<CurveError> = self.total.iter().map(|(_, error)| *error).collect();
        let axes = self.axes.into_iter();
        QuantityErrors {
            total: measures(&total),
            compression: measures(&self.compression),
            interpolation: measures(&self.interpolation),
            simulation: optional_measures(&self.simulation),
            wavelengths: optional_measures(&self.wavelengths),
            noise: measures(&self.noise),
            axes: axes
                .map(|(name, errors)| (name, measures(&errors)))
                .collect(),
            worst,
        }
    }
}

/// The summary of `errors`; `None` if there are none.
fn optional_measures(errors: &[CurveError]) -> Option<Measures> {
    (!errors.is_empty()).then(|| measures(errors))
}

/// The summary of `errors`.
fn measures(errors: &[CurveError]) -> Measures {
    let colours: Option<Vec<f64>> = errors.iter().map(|e| e.delta_e).collect();
    Measures {
        delta_e: colours.filter(|list| !list.is_empty()).map(summary),
        rmse: summary(errors.iter().map(|e| e.rmse).collect()),
    }
}

/// Mean, 95th percentile and maximum, to four digits.
fn summary(mut values: Vec<f64>) -> ErrorSummary {
    values.sort_by(f64::total_cmp);
    let Some(p95) = percentile(&values, 95) else {
        return ErrorSummary::default();
    };
    ErrorSummary {
        mean: four_digits(mean(&values)),
        p95: four_digits(p95),
        max: values.last().copied().map_or(p95, four_digits),
    }
}

/// `value` rounded to four significant digits, which exceeds the precision of any error here.
fn four_digits(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

impl fmt::Display for ErrorBudget {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(
            f,
            "{} random points against fresh simulations of {} walks (seed {})",
            self.points, self.rays, self.seed
        )?;
        for (quantity, chain) in &self.quantities {
            write!(
                f,
                "\n{quantity:<34}{:>8}{:>8}{:>8}{:>11}{:>10}{:>10}",
                "Delta-E", "p95", "max", "RMSE", "p95", "max"
            )?;
            let mut line = |name: &str, measures: &Measures| {
                write!(f, "\n  {name:<32}")?;
                match measures.delta_e {
                    Some(ErrorSummary { mean, p95, max }) => {
                        write!(f, "{mean:>8.3}{p95:>8.3}{max:>8.3}")?;
                    }
                    None => write!(f, "{:>24}", "-")?,
                }
                let ErrorSummary { mean, p95, max } = measures.rmse;
                write!(f, "{mean:>11.6}{p95:>10.6}{max:>10.6}")
            };
            line("whole chain", &chain.total)?;
            line("compression", &chain.compression)?;
            line("interpolation and simulation", &chain.interpolation)?;
            if let Some(simulation) = &chain.simulation {
                line("simulation, on nodes", simulation)?;
            }
            for (axis, measures) in &chain.axes {
                line(&format!("off the nodes in {axis}"), measures)?;
            }
            if let Some(wavelengths) = &chain.wavelengths {
                line("between the wavelengths", wavelengths)?;
            }
            line("noise of the fresh simulations", &chain.noise)?;
            for worst in &chain.worst {
                let WorstPoint { at, delta_e, rmse } = worst;
                let colour = delta_e.map_or(String::new(), |e| format!("Delta-E {e:.3}, "));
                write!(f, "\n  worst: {colour}RMSE {rmse:.6} at {at}")?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_by_hand() {
        let values = (1..=100).rev().map(f64::from).collect();
        let found = summary(values);
        assert_eq!((found.mean, found.p95, found.max), (50.5, 95.0, 100.0));
        assert_eq!(summary(vec![3.0]).p95, 3.0);
        assert_eq!(summary(Vec::new()), ErrorSummary::default());
    }
}
