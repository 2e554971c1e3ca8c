//! Applies the values of axes to the fixed properties of the snow.
use super::{Fixed, Grid, GridError, Spread};
use crate::grain::TruncatedNormal;
use crate::lookup::SubstrateKind;
use crate::optics::Carbon;
use crate::parameter::{Axes, Parameter, Point};
use crate::transport::Substrate;

impl Fixed {
    /// A copy with the values of `point`. `spread` gives the width of the sphericity
    /// distribution.
    ///
    /// # Errors
    /// [`GridError::Law`] if the sphericity distribution is invalid.
    pub fn at(&self, point: &Point, spread: &Spread) -> Result<Self, GridError> {
        let mut fixed = self.clone();
        for (parameter, value) in point.iter() {
            match parameter {
                Parameter::BlackCarbon => {
                    let kind = fixed.black_carbon.unwrap_or_else(|| Carbon::black(0.0));
                    fixed.black_carbon = Some(Carbon {
                        concentration_ng_g: value,
                        ..kind
                    });
                }
                Parameter::Absorber => {
                    if let Some(first) = fixed.absorbers.first_mut() {
                        first.concentration_ng_g = 1e3 * value;
                    }
                }
                Parameter::WaterSaturation => fixed.water_saturation = value,
                Parameter::Temperature => fixed.temperature_c = value,
                Parameter::Sphericity => fixed.proportion = spread.sphericity_law(value)?,
                Parameter::SubstrateReflectance if value == 0.0 => {
                    fixed.substrate = Substrate::Black
                }
                Parameter::SubstrateReflectance => fixed.substrate = Substrate::Grey(value),
                // parameters of the grains, the surface layer and the light are not fixed
                _ => {}
            }
        }
        Ok(fixed)
    }
}

impl Spread {
    /// Facetness distribution around an axis value: truncated to mean +- half width, and to
    /// [0, 1].
    ///
    /// # Errors
    /// [`GridError::Law`] if there is no such distribution.
    pub fn facetness_law(&self, mean: f64) -> Result<TruncatedNormal, GridError> {
        let half_width = self.facetness_half_width;
        let (min, max) = ((mean - half_width).max(0.0), (mean + half_width).min(1.0));
        TruncatedNormal::new(min, max, mean, self.facetness_sd).map_err(|source| GridError::Law {
            axis: Parameter::Facetness.name(),
            value: mean,
            source,
        })
    }

    /// Sphericity distribution around an axis value: truncated to mean +- half width, and
    /// to (0, 1].
    pub(crate) fn sphericity_law(&self, mean: f64) -> Result<TruncatedNormal, GridError> {
        let half_width = self.sphericity_half_width;
        let min = (mean - half_width).max(LEAST_SPHERICITY.min(mean));
        let max = (mean + half_width).min(1.0);
        TruncatedNormal::new(min, max, mean, self.sphericity_sd).map_err(|source| GridError::Law {
            axis: Parameter::Sphericity.name(),
            value: mean,
            source,
        })
    }
}

/// Smallest sphericity of a distribution: no spheroid has sphericity 0.
const LEAST_SPHERICITY: f64 = 0.01;

impl Grid {
    /// The same grid without its optional axes, at the values of `point` on these axes.
    ///
    /// # Errors
    /// As [`Fixed::at`].
    pub fn at(&self, point: &Point) -> Result<Self, GridError> {
        let mut grid = self.clone();
        let core = Parameter::CORE.map(|p| (p, self.axes.values(p).to_vec()));
        grid.axes = Axes::from(core);
        grid.fixed = self.fixed.at(&point.optional(), &self.spread)?;
        Ok(grid)
    }

    /// Whether any snow of the grid contains liquid water.
    #[must_use]
    pub fn is_wet(&self) -> bool {
        let saturations = self.axes.values(Parameter::WaterSaturation);
        self.fixed.is_wet() || saturations.last().is_some_and(|largest| *largest > 0.0)
    }

    /// The kind of substrate under the surface layer, including the layers below.
    #[must_use]
    pub fn substrate(&self) -> SubstrateKind {
        let reflects = !matches!(self.fixed.substrate, Substrate::Black);
        if !self.fixed.below.is_empty() {
            SubstrateKind::Layers
        } else if reflects || self.axes.has(Parameter::SubstrateReflectance) {
            SubstrateKind::Reflecting
        } else {
            SubstrateKind::Black
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::engine::Engine;
    use crate::grid::GridSettings;
    use crate::grid::tests::{small, with_extra};
    use crate::optics::{Absorber, Species};

    /// An axis without effect here would give the same snow at every value. A fixed value that
    /// stays in the description of the grid would contradict the axis.
    #[test]
    fn every_optional_axis_changes_the_snow_and_replaces_its_fixed_value() {
        for parameter in Parameter::ALL {
            if Parameter::CORE.contains(&parameter) || parameter.is_view() {
                continue;
            }
            let mut grid = small(Engine::Spectral);
            grid.fixed.black_carbon = Some(Carbon::black(10.0));
            grid.fixed.absorbers = vec![Absorber {
                name: "dust".into(),
                concentration_ng_g: 0.0,
                sedimentation: 1.0,
                mass_absorption: Species::find("dust_libya").unwrap().mass_absorption(),
                per_wet_mass: false,
                scattering: None,
            }];
            let record = parameter.record();
            let (low, high) = (record.ordinary.min, record.ordinary.max);
            let (low, high) = (0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high);
            let at = |value| {
                let point: Point = [(parameter, value)].into_iter().collect();
                grid.fixed.at(&point, &grid.spread).unwrap()
            };
            assert_ne!(at(low), at(high), "{parameter:?}");
            grid.axes.set(parameter, vec![low, high]);
            let text = grid.to_config();
            let parsed = crate::config::grid::parse("grid.toml", &text);
            let parsed = parsed.unwrap_or_else(|error| panic!("{parameter:?}: {error}\n{text}"));
            assert_eq!(parsed.grid.axes, grid.axes, "{parameter:?}");
            let stored = GridSettings::parse(&text).unwrap();
            assert_eq!(stored, grid.describe(), "{parameter:?}");
        }
    }

    #[test]
    fn optional_axes_run_slower() {
        let grid = with_extra(small(Engine::Spectral));
        let jobs = grid.jobs().unwrap();
        assert_eq!((jobs.count(), jobs.curves()), (6 * 8, 6 * 24));
        let job = |n| grid.job(&jobs, n).unwrap();
        for n in 0..8 {
            let surface = job(n).snowpack.surface;
            assert_eq!(surface.black_carbon.unwrap().concentration_ng_g, 0.0);
            assert_eq!(surface.water_saturation, 0.0);
        }
        assert_eq!(job(8).snowpack.surface.water_saturation, 0.1);
        assert_eq!(
            job(8).snowpack.surface.black_carbon,
            job(0).snowpack.surface.black_carbon
        );
        let last = job(47);
        assert_eq!(
            last.snowpack.surface.black_carbon,
            Some(Carbon::black(400.0))
        );
        assert_eq!(last.snowpack.surface.water_saturation, 0.1);
        assert!(
            last.to_string()
                .contains("black carbon 400 ng g-1, water saturation 0.1, thickness"),
            "{last}"
        );
        // the rest of a job is that of the same job of the first combination
        let first = job(7);
        assert_eq!(last.angles_deg, first.angles_deg);
        assert_eq!(last.snowpack.surface.grains, first.snowpack.surface.grains);
        assert!(grid.job(&jobs, 48).is_err());
    }

    #[test]
    fn axes_replace_what_is_fixed() {
        let grid = small(Engine::Spectral);
        let fixed = |axis, value| grid.at(&Point::from([(axis, value)])).unwrap().fixed;
        assert_eq!(fixed(Parameter::Temperature, -7.0).temperature_c, -7.0);
        let law = fixed(Parameter::Sphericity, 0.9).proportion;
        assert_eq!((law.min(), law.max(), law.mean()), (0.75, 1.0, 0.9));
        let law = fixed(Parameter::Sphericity, 0.1).proportion;
        assert_eq!((law.min(), law.max()), (0.01, 0.25));
        let substrate = |value| fixed(Parameter::SubstrateReflectance, value).substrate;
        assert_eq!(
            (substrate(0.0), substrate(0.3)),
            (Substrate::Black, Substrate::Grey(0.3))
        );
    }
}
