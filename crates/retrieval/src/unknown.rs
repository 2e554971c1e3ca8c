//! Unknown parameters and their priors.
use splitsnow_lookup::Parameter;

/// What is known of an unknown before the measurement, within its range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Prior {
    /// All values of the coordinate are equally probable.
    Flat,
    /// A Gaussian of the coordinate, cut off at the ends of the range.
    Normal {
        /// Its mean.
        mean: f64,
        /// Its standard deviation.
        sd: f64,
    },
}

/// A parameter to be found. Its coordinate is its value, or for the grain size the natural
/// logarithm of it, so that size, optical radius and specific surface area are treated alike.
/// Its place `u` is 0 at the smallest and 1 at the largest coordinate, linear between.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unknown {
    parameter: Parameter,
    /// First and last coordinate.
    ends: [f64; 2],
    prior: Prior,
}

impl Unknown {
    /// The unknown `parameter` with a value in `range`. `prior` is one of the coordinate.
    #[must_use]
    pub fn new(parameter: Parameter, range: [f64; 2], prior: Prior) -> Self {
        Self {
            parameter,
            ends: range.map(|value| coordinate(parameter, value)),
            prior,
        }
    }

    /// The parameter.
    #[must_use]
    pub fn parameter(&self) -> Parameter {
        self.parameter
    }

    /// The prior.
    #[must_use]
    pub fn prior(&self) -> Prior {
        self.prior
    }

    /// Smallest and largest value.
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        [0.0, 1.0].map(|u| self.value(u))
    }

    fn width(&self) -> f64 {
        self.ends[1] - self.ends[0]
    }

    /// The value at place `u`.
    #[must_use]
    pub fn value(&self, u: f64) -> f64 {
        let coordinate = self.ends[0] + u * self.width();
        match is_logarithmic(self.parameter) {
            true => libm::exp(coordinate),
            false => coordinate,
        }
    }

    /// The place of a value.
    #[must_use]
    pub fn place(&self, value: f64) -> f64 {
        (coordinate(self.parameter, value) - self.ends[0]) / self.width()
    }

    /// Derivative of the value with the place, at place `u`.
    #[must_use]
    pub fn slope(&self, u: f64) -> f64 {
        match is_logarithmic(self.parameter) {
            true => self.width() * self.value(u),
            false => self.width(),
        }
    }

    /// Mean and standard deviation of a Gaussian prior, as places.
    pub(crate) fn gaussian(&self) -> Option<[f64; 2]> {
        match self.prior {
            Prior::Flat => None,
            Prior::Normal { mean, sd } => {
                Some([(mean - self.ends[0]) / self.width(), sd / self.width()])
            }
        }
    }

    /// Variance of the place before the measurement: that of the range, 1/12, reduced by the
    /// Gaussian.
    #[must_use]
    pub fn prior_variance(&self) -> f64 {
        let gaussian = self.gaussian().map_or(0.0, |[_, sd]| sd.powi(-2));
        1.0 / (12.0 + gaussian)
    }
}

/// Whether the coordinate of `parameter` is the logarithm of its value.
fn is_logarithmic(parameter: Parameter) -> bool {
    parameter == Parameter::GrainSize
}

/// The coordinate of a value.
fn coordinate(parameter: Parameter, value: f64) -> f64 {
    match is_logarithmic(parameter) {
        true => libm::log(value),
        false => value,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_logarithmic() {
        let size = Unknown::new(Parameter::GrainSize, [100.0, 400.0], Prior::Flat);
        assert!((size.value(0.5) - 200.0).abs() < 1e-9 && (size.place(200.0) - 0.5).abs() < 1e-12);
        assert!((size.slope(0.5) - 200.0 * libm::log(4.0)).abs() < 1e-9);
        let prior = Prior::Normal { mean: 0.4, sd: 0.1 };
        let facetness = Unknown::new(Parameter::Facetness, [0.0, 0.8], prior);
        assert_eq!(facetness.gaussian(), Some([0.5, 0.125]));
        assert!((facetness.prior_variance() - 1.0 / 76.0).abs() < 1e-12);
        assert_eq!(facetness.range(), [0.0, 0.8]);
    }
}
