//! What is known of the snow: `--fix NAME=VALUE`, `--free NAME[=MIN..MAX|=MEAN+-SD]`.
use std::str::FromStr;

use crate::grain::SizeMeasure;
use crate::parameter::Parameter;

/// A parameter of the compact file, or a measure of its grains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Named {
    /// An axis.
    Axis(Parameter),
    /// Optical radius or specific surface area, in place of the grain size.
    Measure(SizeMeasure),
}

impl Named {
    /// The parameter that it determines.
    #[must_use]
    pub fn parameter(self) -> Parameter {
        match self {
            Self::Axis(parameter) => parameter,
            Self::Measure(_) => Parameter::GrainSize,
        }
    }

    /// Its name, as in config files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Axis(parameter) => parameter.key(),
            Self::Measure(measure) => measure.name(),
        }
    }
}

impl FromStr for Named {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let name = text.trim().replace('-', "_");
        let mut measures = SizeMeasure::ALL.into_iter();
        if let Some(measure) = measures.find(|measure| measure.name() == name) {
            return Ok(Self::Measure(measure));
        }
        let known = Parameter::named(&name).filter(|parameter| !parameter.is_view());
        known.map(Self::Axis).ok_or_else(|| {
            let axes = Parameter::ALL.into_iter().filter(|p| !p.is_view());
            let names = axes.map(Parameter::key);
            let names = names.chain(SizeMeasure::ALL.map(SizeMeasure::name));
            let names: Vec<_> = names.collect();
            format!(
                "there is no parameter {text}; use one of {}",
                names.join(", ")
            )
        })
    }
}

/// What is known of an unknown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Belief {
    /// Nothing but the range of the axis.
    Axis,
    /// A smallest and a largest value.
    Range([f64; 2]),
    /// A mean and a standard deviation.
    Normal([f64; 2]),
}

/// An unknown parameter and what is known of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeParameter {
    /// The parameter.
    pub named: Named,
    pub(super) belief: Belief,
}

/// A known value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownValue {
    /// The parameter.
    pub named: Named,
    /// Its value.
    pub value: f64,
}

/// A number; NaN is refused.
fn number(text: &str) -> Result<f64, String> {
    let number = text.trim().parse().ok().filter(|x: &f64| !x.is_nan());
    number.ok_or_else(|| format!("`{text}` is not a number"))
}

impl FromStr for FreeParameter {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let Some((name, value)) = text.split_once('=') else {
            let named = text.parse()?;
            return Ok(Self {
                named,
                belief: Belief::Axis,
            });
        };
        let named: Named = name.parse()?;
        let pair = |(a, b): (&str, &str)| Ok::<_, String>([number(a)?, number(b)?]);
        let separators = ["+-", "\u{b1}"];
        let normal = separators.iter().find_map(|sign| value.split_once(sign));
        let belief = match (normal, value.split_once("..")) {
            (Some(parts), _) => Belief::Normal(pair(parts)?),
            (None, Some(parts)) => Belief::Range(pair(parts)?),
            (None, None) => {
                return Err(format!(
                    "write {name}=MIN..MAX for a range, {name}=MEAN+-SD for a Gaussian, {name} for the range of the axis; a known value belongs to --fix"
                ));
            }
        };
        match belief {
            Belief::Range([min, max])
                if min.partial_cmp(&max) != Some(std::cmp::Ordering::Less) =>
            {
                Err(format!(
                    "{name}: the first value of a range must be below the second"
                ))
            }
            Belief::Normal([mean, sd]) if !(sd > 0.0 && sd.is_finite() && mean.is_finite()) => {
                Err(format!("{name}: the standard deviation must be above 0"))
            }
            belief => Ok(Self { named, belief }),
        }
    }
}

impl FromStr for KnownValue {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, value) = text
            .split_once('=')
            .ok_or_else(|| format!("write NAME=VALUE instead of `{text}`"))?;
        Ok(Self {
            named: name.parse()?,
            value: number(value)?,
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn ranges_gaussians_and_values() {
        let free = |text: &str| {
            text.parse::<FreeParameter>()
                .map(|free| (free.named.name(), free.belief))
        };
        let size = Parameter::GrainSize.key();
        assert_eq!(free("grain-size-um"), Ok((size, Belief::Axis)));
        assert_eq!(
            free("grain_size_um=100..400"),
            Ok((size, Belief::Range([100.0, 400.0])))
        );
        assert_eq!(
            free("ssa_m2_kg=26+-3"),
            Ok(("ssa_m2_kg", Belief::Normal([26.0, 3.0])))
        );
        assert_eq!(
            free("temperature_c=-5±2"),
            Ok(("temperature_c", Belief::Normal([-5.0, 2.0])))
        );
        assert_eq!(
            free("temperature_c=-9..-2"),
            Ok(("temperature_c", Belief::Range([-9.0, -2.0])))
        );
        for wrong in [
            "x",
            "facetness=0.3",
            "facetness=2..1",
            "facetness=0.2+-0",
            "facetness=a..b",
            "view_deg",
        ] {
            assert!(wrong.parse::<FreeParameter>().is_err(), "{wrong}");
        }
        let fixed: KnownValue = "thickness_cm=inf".parse().unwrap();
        assert_eq!(
            (fixed.named.name(), fixed.value),
            ("thickness_cm", f64::INFINITY)
        );
        for wrong in [
            "thickness_cm",
            "thickness_cm=nan",
            "y=1",
            "thickness_cm=1..2",
        ] {
            assert!(wrong.parse::<KnownValue>().is_err(), "{wrong}");
        }
    }
}
