//! Axes beyond the five, each of which may or may not be there. They run slower
//! than the five, in the order of [`ExtraAxis`].
use std::collections::BTreeMap;
use std::fmt::{self, Write};

use super::{Axes, Fixed, Grid, GridError, Spread};
use crate::grain::TruncatedNormal;
use crate::optics::Carbon;
use crate::transport::Ground;

/// What an axis beyond the five is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ExtraAxis {
    /// Black carbon, ng per g of snow.
    BlackCarbon,
    /// Water saturation of the pore space.
    WaterSaturation,
    /// Temperature, Celsius.
    Temperature,
    /// Mean sphericity of the grains.
    Sphericity,
    /// Lambertian reflectance of the substrate, the same at all wavelengths.
    SubstrateReflectance,
}

/// One value on each axis beyond the five that is there.
pub type Conditions = BTreeMap<ExtraAxis, f64>;

impl ExtraAxis {
    /// All, slowest first.
    pub const ALL: [Self; 5] = [
        Self::BlackCarbon,
        Self::WaterSaturation,
        Self::Temperature,
        Self::Sphericity,
        Self::SubstrateReflectance,
    ];

    /// As files spell it, with the unit as suffix.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::BlackCarbon => "black_carbon_ng_g",
            Self::WaterSaturation => "water_saturation",
            Self::Temperature => "temperature_c",
            Self::Sphericity => "sphericity",
            Self::SubstrateReflectance => "substrate_reflectance",
        }
    }

    /// The axis of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|axis| axis.name() == name)
    }

    /// What it is, for people.
    #[must_use]
    pub const fn long_name(self) -> &'static str {
        match self {
            Self::BlackCarbon => "mass of black carbon per mass of snow",
            Self::WaterSaturation => "share of the pore space that is water",
            Self::Temperature => "temperature of the snow",
            Self::Sphericity => "mean sphericity of the grains",
            Self::SubstrateReflectance => "Lambertian reflectance of the substrate",
        }
    }

    /// Unit; "1" for a pure number.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Self::BlackCarbon => "ng/g",
            Self::Temperature => "degC",
            _ => "1",
        }
    }

    /// Whether a value is physical, and those that are, in words.
    pub(super) fn range(self) -> (fn(f64) -> bool, &'static str) {
        match self {
            Self::BlackCarbon => (|c| c >= 0.0, "[0, infinity)"),
            Self::WaterSaturation => (|s| (0.0..=0.5).contains(&s), "[0, 0.5]"),
            Self::Temperature => (|t| (-40.0..=0.0).contains(&t), "[-40, 0]"),
            Self::Sphericity => (|s| s > 0.0 && s <= 1.0, "(0, 1]"),
            Self::SubstrateReflectance => (|r| (0.0..=1.0).contains(&r), "[0, 1]"),
        }
    }
}

/// How many combinations of values there are; 1 without axes.
#[must_use]
pub(crate) fn combinations<T>(axes: &BTreeMap<ExtraAxis, Vec<T>>) -> u64 {
    let lengths = axes.values().map(|values| values.len() as u64);
    lengths.fold(1, u64::saturating_mul)
}

/// The positions along the axes of combination `number`, the last axis fastest;
/// modulo their number.
pub(crate) fn positions<T>(axes: &BTreeMap<ExtraAxis, Vec<T>>, mut number: u64) -> Vec<u64> {
    let mut positions = Vec::with_capacity(axes.len());
    for values in axes.values().rev() {
        let n = (values.len() as u64).max(1);
        positions.push(number % n);
        number /= n;
    }
    positions.reverse();
    positions
}

/// The values of combination `number`.
pub(crate) fn combination<T: Copy>(
    axes: &BTreeMap<ExtraAxis, Vec<T>>,
    number: u64,
) -> BTreeMap<ExtraAxis, T> {
    let positions = positions(axes, number);
    let values = axes.iter().zip(positions);
    let values = values.filter_map(|((axis, values), i)| Some((*axis, *values.get(i as usize)?)));
    values.collect()
}

/// `at` and the conditions there, for messages.
#[must_use]
pub fn described(at: &impl fmt::Display, conditions: &Conditions) -> String {
    let mut text = at.to_string();
    for (axis, value) in conditions {
        let _ = write!(text, ", {} {}", axis.name(), *value as f32);
    }
    text
}

impl Fixed {
    /// The same with the values of `conditions`; the law of the sphericity is as
    /// wide as `spread` says.
    ///
    /// # Errors
    /// That law is no distribution.
    pub fn at(&self, conditions: &Conditions, spread: &Spread) -> Result<Self, GridError> {
        let mut fixed = self.clone();
        for (axis, &value) in conditions {
            match axis {
                ExtraAxis::BlackCarbon => {
                    let kind = self.black_carbon.unwrap_or_else(|| Carbon::black(0.0));
                    fixed.black_carbon = Some(Carbon {
                        concentration_ng_g: value,
                        ..kind
                    });
                }
                ExtraAxis::WaterSaturation => fixed.water_saturation = value,
                ExtraAxis::Temperature => fixed.temperature_c = value,
                ExtraAxis::Sphericity => fixed.sphericity = spread.sphericity_law(value)?,
                ExtraAxis::SubstrateReflectance if value == 0.0 => fixed.ground = Ground::Black,
                ExtraAxis::SubstrateReflectance => fixed.ground = Ground::Grey(value),
            }
        }
        Ok(fixed)
    }
}

impl Spread {
    /// Sphericity around an axis value: cut to mean -+ half width, and to (0, 1].
    pub(crate) fn sphericity_law(&self, mean: f64) -> Result<TruncatedNormal, GridError> {
        let half_width = self.sphericity_half_width;
        let min = (mean - half_width).max(LEAST_SPHERICITY.min(mean));
        let max = (mean + half_width).min(1.0);
        TruncatedNormal::new(min, max, mean, self.sphericity_sd).map_err(|source| GridError::Law {
            axis: ExtraAxis::Sphericity.name(),
            value: mean,
            source,
        })
    }
}

/// Where laws of the sphericity are cut: no spheroid has 0.
const LEAST_SPHERICITY: f64 = 0.01;

impl Grid {
    /// The same grid at one combination of the axes beyond the five, without them.
    ///
    /// # Errors
    /// As [`Fixed::at`].
    pub fn at(&self, conditions: &Conditions) -> Result<Self, GridError> {
        let mut grid = self.clone();
        grid.axes.extra.clear();
        grid.fixed = self.fixed.at(conditions, &self.spread)?;
        Ok(grid)
    }

    /// Whether there is water in any snow of it.
    #[must_use]
    pub fn is_wet(&self) -> bool {
        self.fixed.is_wet() || self.axes.is_wet()
    }
}

impl Axes {
    /// Whether there is water on an axis.
    #[must_use]
    pub fn is_wet(&self) -> bool {
        let saturations = self.extra.get(&ExtraAxis::WaterSaturation);
        let most = saturations.and_then(|values| values.last());
        most.is_some_and(|most| *most > 0.0)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::engine::Engine;
    use crate::grid::tests::{small, with_extra};

    #[test]
    fn the_last_axis_runs_fastest_and_the_five_faster() {
        let grid = with_extra(small(Engine::Spectral));
        let jobs = grid.jobs().unwrap();
        assert_eq!((jobs.count(), jobs.curves()), (6 * 8, 6 * 24));
        let job = |n| grid.job(&jobs, n).unwrap();
        for n in 0..8 {
            let surface = job(n).pack.surface;
            assert_eq!(surface.black_carbon.unwrap().concentration_ng_g, 0.0);
            assert_eq!(surface.water_saturation, 0.0);
        }
        assert_eq!(job(8).pack.surface.water_saturation, 0.1);
        assert_eq!(
            job(8).pack.surface.black_carbon,
            job(0).pack.surface.black_carbon
        );
        let last = job(47);
        assert_eq!(last.pack.surface.black_carbon, Some(Carbon::black(400.0)));
        assert_eq!(last.pack.surface.water_saturation, 0.1);
        assert!(
            last.to_string()
                .ends_with("degrees, black_carbon_ng_g 400, water_saturation 0.1"),
            "{last}"
        );
        // the rest of a job is that of the same job of the first combination
        let first = job(7);
        assert_eq!(last.angles_deg, first.angles_deg);
        assert_eq!(last.pack.surface.grains, first.pack.surface.grains);
        assert!(grid.job(&jobs, 48).is_err());
    }

    #[test]
    fn conditions_replace_what_is_fixed() {
        let grid = small(Engine::Spectral);
        let fixed = |axis, value| grid.at(&[(axis, value)].into()).unwrap().fixed;
        assert_eq!(fixed(ExtraAxis::Temperature, -7.0).temperature_c, -7.0);
        let law = fixed(ExtraAxis::Sphericity, 0.9).sphericity;
        assert_eq!((law.min(), law.max(), law.mean()), (0.75, 1.0, 0.9));
        let law = fixed(ExtraAxis::Sphericity, 0.1).sphericity;
        assert_eq!((law.min(), law.max()), (0.01, 0.25));
        let ground = |value| fixed(ExtraAxis::SubstrateReflectance, value).ground;
        assert_eq!(
            (ground(0.0), ground(0.3)),
            (Ground::Black, Ground::Grey(0.3))
        );
    }
}
