//! A point in parameter space.
use std::fmt;
use std::ops::Index;

use splitsnow_spectra::units::HALF_SPACE_CM;

use super::Parameter;

/// Values of some parameters, in their units. A parameter without a value reads as NaN.
///
/// ```
/// use splitsnow_lookup::{Parameter, Point};
///
/// let point = Point::from([(Parameter::Facetness, 0.3), (Parameter::Density, 275.0)]);
/// assert_eq!(point[Parameter::Density], 275.0);
/// assert_eq!(point.get(Parameter::Thickness), None);
/// assert_eq!(point.to_string(), "facetness 0.3, density 275 kg m-3");
/// let half_space = Point::from([(Parameter::Thickness, 1e6)]);
/// assert_eq!(half_space.to_string(), "thickness inf cm");
/// ```
#[derive(Clone, Copy)]
pub struct Point([f64; Parameter::COUNT]);

impl Point {
    /// A point with these values of [`Parameter::CORE`].
    #[must_use]
    pub fn from_core(values: [f64; 5]) -> Self {
        Parameter::CORE.into_iter().zip(values).collect()
    }

    /// The value of `parameter`, if it has one.
    #[must_use]
    pub fn get(&self, parameter: Parameter) -> Option<f64> {
        Some(self[parameter]).filter(|value| !value.is_nan())
    }

    /// Sets the value of `parameter`; NaN removes it.
    pub fn set(&mut self, parameter: Parameter, value: f64) {
        self.0[parameter.index()] = value;
    }

    /// This point with the value of `parameter` set.
    #[must_use]
    pub fn with(mut self, parameter: Parameter, value: f64) -> Self {
        self.set(parameter, value);
        self
    }

    /// This point with the values of `other` added; they take precedence.
    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        for (parameter, value) in other.iter() {
            self.set(parameter, value);
        }
        self
    }

    /// The parameters that have a value, and the values, in storage order.
    pub fn iter(&self) -> impl Iterator<Item = (Parameter, f64)> + '_ {
        Parameter::ALL
            .into_iter()
            .filter_map(|parameter| Some((parameter, self.get(parameter)?)))
    }

    /// Whether no parameter has a value.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.iter().all(|value| value.is_nan())
    }

    /// The values of the optional parameters that describe the snow and its substrate.
    #[must_use]
    pub fn optional(&self) -> Self {
        let optional = self.iter().filter(|(p, _)| p.is_optional() && !p.is_view());
        optional.collect()
    }

    /// The values of [`Parameter::CORE`]; NaN for a missing value.
    #[must_use]
    #[inline]
    pub fn core(&self) -> [f64; 5] {
        let [a, b, c, d, e] = Parameter::CORE;
        [self[a], self[b], self[c], self[d], self[e]]
    }
}

impl Default for Point {
    fn default() -> Self {
        Self([f64::NAN; Parameter::COUNT])
    }
}

/// Two points are equal if the same parameters have the same values.
impl PartialEq for Point {
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}

impl Index<Parameter> for Point {
    type Output = f64;

    #[inline]
    fn index(&self, parameter: Parameter) -> &f64 {
        &self.0[parameter.index()]
    }
}

impl<const N: usize> From<[(Parameter, f64); N]> for Point {
    fn from(values: [(Parameter, f64); N]) -> Self {
        values.into_iter().collect()
    }
}

impl FromIterator<(Parameter, f64)> for Point {
    fn from_iter<I: IntoIterator<Item = (Parameter, f64)>>(values: I) -> Self {
        let mut point = Self::default();
        for (parameter, value) in values {
            point.set(parameter, value);
        }
        point
    }
}

/// Lists the core parameters first, then the optional ones.
impl fmt::Display for Point {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let optional = Parameter::ALL.into_iter().filter(|p| p.is_optional());
        let mut separator = "";
        for parameter in Parameter::CORE.into_iter().chain(optional) {
            let Some(value) = self.get(parameter) else {
                continue;
            };
            let record = parameter.record();
            let value = match parameter == Parameter::Thickness && value >= HALF_SPACE_CM {
                true => f64::INFINITY,
                false => value,
            };
            // to the digits of single precision
            write!(f, "{separator}{} {}", record.label, value as f32)?;
            match record.unit {
                "1" => {}
                "degree" => write!(f, " degrees")?,
                unit => write!(f, " {unit}")?,
            }
            separator = ", ";
        }
        Ok(())
    }
}

impl fmt::Debug for Point {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_map().entries(self.iter()).finish()
    }
}
