//! The result as numbers: estimates with credible intervals, correlations, what the data
//! determine, and chi-square. [`super::output`] gives it as text.
use splitsnow_retrieval::{CredibleInterval, Information, Posterior};

use super::RetrieveError;
use super::exact::{ExactCheck, ExactOptions};
use super::residuals::{FittedSpectrum, fitted};
use super::setup::Setup;
use crate::grain::SizeMeasure;
use crate::lookup::Database;
use crate::parameter::{Parameter, Point};

/// Number of points at which optical radius and surface are evaluated for means.
const MOST_POINTS: usize = 20_000;

/// How well an unknown is known from the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Determined {
    /// The data remove 90 % or more of the variance that it had before.
    Yes,
    /// 50 to 90 %.
    Partly,
    /// Less than half.
    No,
}

impl Determined {
    fn of(share: f64) -> Self {
        match share {
            0.9.. => Self::Yes,
            0.5.. => Self::Partly,
            _ => Self::No,
        }
    }

    /// The word in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Yes => "yes",
            Self::Partly => "partly",
            Self::No => "no",
        }
    }
}

/// An unknown, or a quantity that follows from the unknowns.
#[derive(Debug, Clone, PartialEq)]
pub struct RetrievedQuantity {
    /// Its name, with the unit as suffix.
    pub name: &'static str,
    /// Its unit as UDUNITS spells it.
    pub unit: &'static str,
    /// Of the most probable snow.
    pub best: f64,
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
    /// Median and credible intervals.
    pub interval: CredibleInterval,
    /// Range before the measurement.
    pub range: [f64; 2],
    /// Share of the variance before the measurement that the data remove.
    pub from_data: f64,
}

impl RetrievedQuantity {
    /// How well it is known from the data.
    #[must_use]
    pub fn determined(&self) -> Determined {
        Determined::of(self.from_data)
    }
}

/// Two unknowns.
#[derive(Debug, Clone, PartialEq)]
pub struct Pair {
    /// Their names.
    pub names: [&'static str; 2],
    /// Correlation after the measurement.
    pub correlation: f64,
    /// Cosine between the derivatives of the spectra, in units of their errors.
    pub cosine: f64,
}

/// How well the most probable snow explains the measured values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GoodnessOfFit {
    /// Chi-square of the measured values, with their covariance.
    pub chi_square: f64,
    /// Number of values.
    pub values: usize,
    /// Values less the combinations that they determine.
    pub degrees_of_freedom: f64,
    /// Probability of a larger chi-square if the stated errors are right.
    pub probability: f64,
}

impl GoodnessOfFit {
    fn new(chi_square: f64, values: usize, used: f64) -> Self {
        let degrees_of_freedom = (values as f64 - used).max(0.5);
        Self {
            chi_square,
            values,
            degrees_of_freedom,
            probability: probability_above(chi_square, degrees_of_freedom),
        }
    }

    /// What chi-square says.
    #[must_use]
    pub fn verdict(&self) -> &'static str {
        match self.probability {
            ..0.001 => {
                "the fit is worse than the stated errors allow: the snow is not in the file, or the errors are larger; the intervals are too narrow"
            }
            ..0.05 => "the fit is somewhat worse than the stated errors allow",
            ..0.999 => "the fit is as good as the stated errors allow",
            _ => {
                "the fit is better than the stated errors: they are overestimated, and the intervals are wide"
            }
        }
    }
}

/// Probability that chi-square with so many degrees of freedom exceeds `value` (Wilson and
/// Hilferty 1931; within .01 from one degree of freedom on).
fn probability_above(value: f64, degrees: f64) -> f64 {
    let spread = 2.0 / (9.0 * degrees);
    let normal = (libm::cbrt(value / degrees) - 1.0 + spread) / spread.sqrt();
    0.5 * libm::erfc(normal / std::f64::consts::SQRT_2)
}

/// The snow of the measured spectra.
#[derive(Debug, Clone)]
pub struct Retrieval {
    /// Specific surface area and optical radius, if the file states its grains; then the unknowns.
    pub estimates: Vec<RetrievedQuantity>,
    /// Number of `estimates` that follow from the unknowns.
    pub derived: usize,
    /// Values that are known in all spectra, by name.
    pub known: Vec<(&'static str, f64)>,
    /// Covariance of the unknowns.
    pub covariance: Vec<Vec<f64>>,
    /// All pairs of unknowns.
    pub pairs: Vec<Pair>,
    /// What the data determine.
    pub information: Information,
    /// How well the most probable snow fits.
    pub goodness: GoodnessOfFit,
    /// Whether the search for the optimum ended.
    pub converged: bool,
    /// Measured and fitted spectra.
    pub spectra: Vec<FittedSpectrum>,
    /// What the engine says, if it was asked.
    pub exact: Option<ExactCheck>,
    /// The distribution of the unknowns, as places in their ranges.
    pub posterior: Posterior,
    /// Most probable places.
    pub best: Vec<f64>,
    /// Errors of the measurement and of the file, as text.
    pub errors: Vec<String>,
    /// The values at the places of each unknown, for charts; of the grain size, the specific
    /// surface area if the file states its grains.
    pub scales: Vec<PlaceScale>,
}

/// The values of a quantity at evenly spaced places of an unknown, from 0 to 1.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaceScale {
    /// Name of the quantity.
    pub name: &'static str,
    /// Values at the places.
    pub values: Vec<f64>,
}

impl PlaceScale {
    /// Number of places.
    const PLACES: usize = 101;

    /// The value at place `u`.
    #[must_use]
    pub fn value(&self, u: f64) -> f64 {
        let at = u.clamp(0.0, 1.0) * (self.values.len() - 1) as f64;
        let below = (at as usize).min(self.values.len() - 2);
        let share = at - below as f64;
        self.values[below] * (1.0 - share) + self.values[below + 1] * share
    }
}

impl Setup {
    /// Finds the snow. `seed` is that of the sampler, which is used for more than four unknowns.
    /// With `exact` the engine checks and improves the optimum.
    ///
    /// # Errors
    /// [`RetrieveError`] if there is no spectrum in the ranges, or the engine fails.
    pub fn retrieve(
        &self,
        database: &Database,
        seed: u64,
        exact: Option<&ExactOptions<'_>>,
    ) -> Result<Retrieval, RetrieveError> {
        let mut offsets = vec![0.0; self.values()];
        let optimum = self.inverse(&offsets).best();
        let mut optimum = optimum.ok_or(RetrieveError::NoSpectrum)?;
        let mut check = None;
        if let Some(options) = exact {
            let (found, corrections, improved) = self.exact(database, optimum, options)?;
            (check, offsets, optimum) = (Some(found), corrections, improved);
        }
        let inverse = self.inverse(&offsets);
        let posterior = Posterior::new(&inverse, &optimum, seed);
        let information = Information::new(&inverse, &optimum);
        let used = information.degrees_of_freedom();
        let mut estimates = self.derived(&posterior, &optimum.u);
        let derived = estimates.len();
        let (own, covariance) = self.own_estimates(&posterior, &optimum.u);
        estimates.extend(own);
        let n = self.unknowns.len();
        let mut pairs = Vec::new();
        for i in 0..n {
            for j in i + 1..n {
                let scale = (covariance[i][i] * covariance[j][j]).sqrt();
                pairs.push(Pair {
                    names: [i, j].map(|k| self.unknowns[k].parameter().key()),
                    correlation: covariance[i][j] / scale,
                    cosine: information.cosines[i][j],
                });
            }
        }
        let (known, best) = (self.known(), optimum.u.clone());
        Ok(Retrieval {
            spectra: fitted(self, &inverse, &optimum.u, &posterior, &offsets),
            goodness: GoodnessOfFit::new(optimum.chi_square, self.values(), used),
            converged: optimum.converged,
            best: best.clone(),
            estimates,
            derived,
            known,
            covariance,
            pairs,
            information,
            exact: check,
            posterior,
            errors: self.errors(),
            scales: self.scales(&best),
        })
    }

    /// The scale of each unknown.
    fn scales(&self, best: &[f64]) -> Vec<PlaceScale> {
        let common = self.first_fixed();
        let scale = |(i, unknown): (usize, &splitsnow_retrieval::Unknown)| {
            let measure = SizeMeasure::SpecificSurface;
            let grains = match unknown.parameter() {
                Parameter::GrainSize => self.grains.as_ref(),
                _ => None,
            };
            let value = |k: usize| {
                let u = k as f64 / (PlaceScale::PLACES - 1) as f64;
                let mut places = best.to_vec();
                places[i] = u;
                match grains {
                    Some(grains) => grains.measure(measure, &self.point(&common, &places)),
                    None => unknown.value(u),
                }
            };
            PlaceScale {
                name: grains.map_or(unknown.parameter().key(), |_| measure.name()),
                values: (0..PlaceScale::PLACES).map(value).collect(),
            }
        };
        self.unknowns.iter().enumerate().map(scale).collect()
    }

    /// The values that are the same in all spectra.
    fn known(&self) -> Vec<(&'static str, f64)> {
        let zero = vec![0.0; self.values()];
        let inverse = self.inverse(&zero);
        let mut points = inverse.observations().iter().map(|o| o.fixed());
        let first = points.next().unwrap_or_default();
        let rest: Vec<Point> = points.collect();
        first
            .iter()
            .filter(|(p, value)| rest.iter().all(|point| point.get(*p) == Some(*value)))
            .map(|(parameter, value)| (parameter.key(), value))
            .collect()
    }

    /// What is known of the first spectrum.
    fn first_fixed(&self) -> Point {
        let zero = vec![0.0; self.values()];
        let inverse = self.inverse(&zero);
        let first = inverse.observations().first();
        first.map(|spectrum| spectrum.fixed()).unwrap_or_default()
    }

    /// The point of the first spectrum at places `u`.
    pub(super) fn point(&self, common: &Point, u: &[f64]) -> Point {
        let mut point = *common;
        for (unknown, u) in self.unknowns.iter().zip(u) {
            point.set(unknown.parameter(), unknown.value(*u));
        }
        point
    }

    /// Specific surface area and optical radius, if the size is unknown and the file states its
    /// grains.
    fn derived(&self, posterior: &Posterior, best: &[f64]) -> Vec<RetrievedQuantity> {
        let size =
            |unknown: &splitsnow_retrieval::Unknown| unknown.parameter() == Parameter::GrainSize;
        let (Some(grains), Some(at)) = (&self.grains, self.unknowns.iter().position(size)) else {
            return Vec::new();
        };
        let common = self.first_fixed();
        let thinned = posterior.thinned(MOST_POINTS);
        let estimate = |measure: SizeMeasure| {
            let value = |u: &[f64]| grains.measure(measure, &self.point(&common, u));
            let interval = thinned.interval(value);
            let mean = thinned.average(value);
            let variance = thinned.average(|u| (value(u) - mean).powi(2));
            let ends = [0.0, 1.0].map(|end| {
                let mut u = best.to_vec();
                u[at] = end;
                value(&u)
            });
            RetrievedQuantity {
                name: measure.name(),
                unit: measure.about().1,
                best: value(best),
                mean,
                sd: variance.sqrt(),
                interval,
                range: [ends[0].min(ends[1]), ends[0].max(ends[1])],
                from_data: self.share_from_data(posterior, at),
            }
        };
        [SizeMeasure::SpecificSurface, SizeMeasure::OpticalRadius]
            .map(estimate)
            .into()
    }

    /// Share of the variance of a place that the data remove.
    fn share_from_data(&self, posterior: &Posterior, i: usize) -> f64 {
        let mean = posterior.average(|u| u[i]);
        let variance = posterior.average(|u| (u[i] - mean).powi(2));
        1.0 - variance / self.unknowns[i].prior_variance()
    }

    /// The unknowns and their covariance.
    fn own_estimates(
        &self,
        posterior: &Posterior,
        best: &[f64],
    ) -> (Vec<RetrievedQuantity>, Vec<Vec<f64>>) {
        let n = self.unknowns.len();
        let value = |i: usize, u: &[f64]| self.unknowns[i].value(u[i]);
        let means: Vec<f64> = (0..n).map(|i| posterior.average(|u| value(i, u))).collect();
        let product = |i: usize, j: usize| {
            posterior.average(|u| (value(i, u) - means[i]) * (value(j, u) - means[j]))
        };
        let covariance: Vec<Vec<f64>> = (0..n)
            .map(|i| (0..n).map(|j| product(i, j)).collect())
            .collect();
        let estimate = |i: usize| {
            let record = self.unknowns[i].parameter().record();
            RetrievedQuantity {
                name: record.key,
                unit: record.unit,
                best: value(i, best),
                mean: means[i],
                sd: covariance[i][i].sqrt(),
                interval: posterior.interval(|u| value(i, u)),
                range: self.unknowns[i].range(),
                from_data: self.share_from_data(posterior, i),
            }
        };
        ((0..n).map(estimate).collect(), covariance)
    }

    /// The stated errors, one line each.
    fn errors(&self) -> Vec<String> {
        let noise = self.noise;
        let stated = self.inputs.iter().flat_map(|input| &input.uncertainties);
        let stated = stated.filter(|sd| sd.is_some()).count();
        let own = match stated {
            0 => format!("{} for each value", noise.value),
            all if all == self.values() => "as the files state for each value".to_owned(),
            some => format!(
                "as stated for {some} values, {} for the others",
                noise.value
            ),
        };
        let mut lines = vec![format!(
            "measurement: {own}; {} % of the level of each spectrum; {} correlated over {} nm",
            1e2 * noise.level,
            noise.correlated,
            noise.length_nm
        )];
        for (quantity, error) in &self.emulator_errors {
            lines.push(format!("look-up of {}: {}", quantity.name(), error.source));
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chi_squares_have_their_probabilities() {
        // from tables
        for (value, degrees, expected) in [
            (3.841, 1.0, 0.05),
            (18.307, 10.0, 0.05),
            (9.342, 10.0, 0.5),
            (124.34, 100.0, 0.05),
        ] {
            let found = probability_above(value, degrees);
            assert!((found - expected).abs() < 0.01, "{value} {found}");
        }
    }
}
