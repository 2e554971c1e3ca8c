//! The recommended setting for each bound on the error.
use serde::Serialize;

use super::{ChartPoint, Metrics, SpectralDomain};
use crate::measurement::Quantity;

/// An error measure of [`Metrics`] for which bounds are set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Delta-E*ab.
    DeltaE,
    /// RMSE over the wavelengths.
    Rmse,
}

impl Measure {
    /// The name for people.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::DeltaE => "Delta-E",
            Self::Rmse => "RMSE",
        }
    }

    /// The value of the measure; `None` for Delta-E if the spectra have no colour.
    #[must_use]
    pub fn of(self, metrics: &Metrics) -> Option<f64> {
        match self {
            Self::DeltaE => metrics.delta_e,
            Self::Rmse => Some(metrics.rmse),
        }
    }
}

/// A bound on the error of both transmittance and reflectance, over all samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// The measure that is bounded.
    pub measure: Measure,
    /// The band in which it is bounded.
    pub band: SpectralDomain,
    /// The largest error allowed.
    pub value: f64,
}

impl Bound {
    /// All bounds for which a recommendation is given.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let bound = |measure, band| {
            move |value| Self {
                measure,
                band,
                value,
            }
        };
        let colours = [2.3, 1.0, 0.3, 0.1].map(bound(Measure::DeltaE, SpectralDomain::Visible));
        let rmse = |band| [1e-2, 1e-3, 3e-4].map(bound(Measure::Rmse, band));
        let errors = SpectralDomain::ALL.into_iter().flat_map(rmse);
        colours.into_iter().chain(errors).collect()
    }
}

/// A setting with its cost and its error in the measure of a bound.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Name of the engine.
    pub engine: &'static str,
    /// Name of the setting.
    pub setting: String,
    /// CPU seconds for one spectrum of the band, mean over the samples.
    pub cpu_seconds: f64,
    /// The larger of the errors of transmittance and reflectance, on the sample with the largest
    /// error.
    pub error: f64,
    /// The standard error of the truth in the same measure; smaller errors cannot be resolved.
    pub floor: f64,
}

/// The recommendation for a bound.
#[derive(Debug, Clone, PartialEq)]
pub struct Recommendation {
    /// The bound.
    pub bound: Bound,
    /// The cheapest measured setting that keeps the bound; `None` if no setting does.
    pub best: Option<Candidate>,
    /// The measured setting with the smallest error; `None` if nothing was measured.
    pub nearest: Option<Candidate>,
}

/// The recommendation for `bound` from `points`. Settings that were extrapolated, or not
/// measured on every sample, are not considered.
#[must_use]
pub fn recommend(bound: Bound, points: &[ChartPoint]) -> Recommendation {
    let candidates: Vec<Candidate> = points
        .iter()
        .filter(|point| point.band == bound.band && point.quantity == Quantity::Transmittance)
        .filter_map(|point| candidate(bound, point, points))
        .collect();
    let within = candidates.iter().filter(|c| c.error <= bound.value);
    let best = within.min_by(|a, b| a.cpu_seconds.total_cmp(&b.cpu_seconds));
    let nearest = candidates.iter().min_by(|a, b| a.error.total_cmp(&b.error));
    Recommendation {
        bound,
        best: best.cloned(),
        nearest: nearest.cloned(),
    }
}

/// The setting of `transmitted` with the larger of its errors in both quantities.
fn candidate(bound: Bound, transmitted: &ChartPoint, points: &[ChartPoint]) -> Option<Candidate> {
    let same = |point: &&ChartPoint| {
        (point.quantity, point.band) == (Quantity::Reflectance, bound.band)
            && (point.setting, point.measured) == (transmitted.setting, true)
    };
    let reflected = points.iter().find(same).filter(|_| transmitted.measured)?;
    let larger = |part: fn(&ChartPoint) -> &Metrics| {
        let value = |point| bound.measure.of(part(point));
        Some(value(transmitted)?.max(value(reflected)?))
    };
    Some(Candidate {
        engine: transmitted.setting.engine.name(),
        setting: transmitted.setting.to_string(),
        cpu_seconds: transmitted.cpu_seconds,
        error: larger(|point| &point.error)?,
        floor: larger(|point| &point.floor)?,
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::engine::{Engine, Resolution};
    use crate::lab::tradeoff::Setting;

    /// A setting with `rays` rays, measured or not, with these RMSE of T and R; Delta-E is 100
    /// times the RMSE.
    fn points(rays: u64, cpu_seconds: f64, errors: [f64; 2], measured: bool) -> [ChartPoint; 2] {
        let metrics = |rmse| Metrics {
            rmse,
            max_abs: rmse,
            delta_e: Some(100.0 * rmse),
        };
        let point = |(quantity, error)| ChartPoint {
            setting: Setting {
                engine: Engine::Spectral,
                rays,
                resolution: Resolution::default(),
            },
            measured,
            band: SpectralDomain::Visible,
            quantity,
            cpu_seconds,
            error: metrics(error),
            floor: metrics(1e-4),
        };
        let [t, r] = errors;
        [(Quantity::Transmittance, t), (Quantity::Reflectance, r)].map(point)
    }

    fn rmse(value: f64) -> Bound {
        Bound {
            measure: Measure::Rmse,
            band: SpectralDomain::Visible,
            value,
        }
    }

    #[test]
    fn the_cheapest_within_in_both_quantities() {
        let all = [
            points(1, 1.0, [1e-3, 5e-2], true),
            points(2, 2.0, [2e-3, 9e-3], true),
            points(3, 1.5, [1e-2, 8e-3], true),
            points(4, 9.0, [1e-4, 2e-4], true),
        ]
        .concat();
        let rays = |bound| {
            let found = recommend(bound, &all);
            assert_eq!(found.nearest.unwrap().setting, "spectral 4");
            found.best.map(|best| best.setting)
        };
        assert_eq!(rays(rmse(1e-1)).as_deref(), Some("spectral 1"));
        // An error equal to the bound keeps it.
        assert_eq!(rays(rmse(1e-2)).as_deref(), Some("spectral 3"));
        assert_eq!(rays(rmse(9e-3)).as_deref(), Some("spectral 2"));
        assert_eq!(rays(rmse(1e-3)).as_deref(), Some("spectral 4"));
        assert_eq!(rays(rmse(1e-4)), None);
        let colour = Bound {
            measure: Measure::DeltaE,
            ..rmse(1.0)
        };
        assert_eq!(rays(colour).as_deref(), Some("spectral 3"));
    }

    #[test]
    fn only_what_was_measured_in_that_band() {
        let extrapolated = points(1, 1.0, [0.0, 0.0], false);
        assert_eq!(recommend(rmse(1.0), &extrapolated).nearest, None);
        let half = &points(1, 1.0, [0.0, 0.0], true)[..1];
        assert_eq!(recommend(rmse(1.0), half).nearest, None);
        let elsewhere = Bound {
            band: SpectralDomain::NearInfrared,
            ..rmse(1.0)
        };
        let visible = points(1, 1.0, [0.0, 0.0], true);
        assert_eq!(recommend(elsewhere, &visible).nearest, None);
    }

    proptest! {
        /// A tighter bound never costs less, and the recommended setting keeps the bound.
        #[test]
        fn tighter_costs_more(
            errors in proptest::collection::vec((0.0_f64..1.0, 0.0_f64..1.0, 0.1_f64..9.0), 1..20),
            bounds in (0.0_f64..1.0, 0.0_f64..1.0),
        ) {
            let all: Vec<ChartPoint> = (0..).zip(&errors)
                .flat_map(|(rays, &(t, r, cost))| points(rays, cost, [t, r], true))
                .collect();
            let (tight, loose) = (bounds.0.min(bounds.1), bounds.0.max(bounds.1));
            let (tight, loose) = (recommend(rmse(tight), &all), recommend(rmse(loose), &all));
            if let Some(best) = tight.best {
                prop_assert!(best.error <= tight.bound.value);
                let cheaper = loose.best.unwrap();
                prop_assert!(cheaper.cpu_seconds <= best.cpu_seconds);
            } else {
                prop_assert!(tight.nearest.unwrap().error > tight.bound.value);
            }
        }
    }
}
