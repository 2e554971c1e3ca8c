//! The grid of a spectral database: its axes, nodes and jobs (docs/methods.md). Curves and
//! jobs are numbered in storage order, slowest axis first
//! ([`crate::parameter::Parameter`]).
mod absent;
mod check;
mod describe;
mod fixed;
mod job;
mod jobs;
mod settings;
mod shard;
#[cfg(feature = "database")]
mod stored;
mod toml_text;
mod views;

use crate::engine::{Engine, MaxError};
use crate::grain::{Shape, SizeLaw, SizeMeasure, TruncatedNormal};
use crate::optics::{Absorber, Carbon};
use crate::parameter::Axes;
use crate::transport::{Layer, Model, Substrate};

pub use absent::{MIN_GRAIN_LENGTHS, absent_curves, existing_rows, why_absent};
pub use check::GridError;
pub use job::Job;
pub use jobs::Jobs;
#[cfg(feature = "database")]
pub(crate) use jobs::multi_index;
pub use settings::GridSettings;
#[cfg(feature = "database")]
pub(crate) use settings::config_text;
pub(crate) use settings::{
    AbsorberSettings, CarbonSettings, LawSettings, Reflectance, SizeSettings,
};
pub use shard::{Shard, ShardError};
pub(crate) use toml_text::{toml_entries, toml_text};
pub use views::GridViews;

/// The values of a grain size axis that is given by another measure than the size.
#[derive(Debug, Clone, PartialEq)]
pub struct SizeAxis {
    /// The measure.
    pub measure: SizeMeasure,
    /// Values of the measure, in its unit, increasing.
    pub values: Vec<f64>,
}

impl SizeAxis {
    /// The values in the order of the grain sizes.
    #[must_use]
    pub fn by_size(&self) -> Vec<f64> {
        let mut values = self.values.clone();
        if self.measure == SizeMeasure::SpecificSurface {
            values.reverse();
        }
        values
    }
}

/// Widths of the distributions around an axis value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Half width of the facetness distribution, which is truncated to mean +- this value
    /// and to [0, 1].
    pub facetness_half_width: f64,
    /// Standard deviation of facetness before truncation.
    pub facetness_sd: f64,
    /// Half width of the uniform grain size distribution, um.
    pub grain_size_half_width_um: f64,
    /// Half width of the sphericity distribution if sphericity is an axis; it is truncated
    /// to mean +- this value and to (0, 1].
    pub sphericity_half_width: f64,
    /// Standard deviation of sphericity before truncation, if sphericity is an axis.
    pub sphericity_sd: f64,
    /// How often a ray meets grains of each size in the size range.
    pub size_law: SizeLaw,
}

impl Default for Spread {
    /// Varsa 2025, section 8.1, and the widths of section 7.1.
    fn default() -> Self {
        Self {
            facetness_half_width: 0.1,
            facetness_sd: 0.072,
            grain_size_half_width_um: 50.0,
            sphericity_half_width: 0.15,
            sphericity_sd: 0.064,
            size_law: SizeLaw::default(),
        }
    }
}

/// Properties that all curves of a grid share.
#[derive(Debug, Clone, PartialEq)]
pub struct Fixed {
    /// Shape of the grains.
    pub shape: Shape,
    /// Distribution of their proportion: the sphericity, or the aspect ratio of prisms.
    pub proportion: TruncatedNormal,
    /// Temperature, degrees Celsius.
    pub temperature_c: f64,
    /// Water saturation: the fraction of the pore space that is liquid water.
    pub water_saturation: f64,
    /// Black carbon.
    pub black_carbon: Option<Carbon>,
    /// Brown carbon.
    pub brown_carbon: Option<Carbon>,
    /// Other absorbers; if [`crate::parameter::Parameter::Absorber`] is an axis, it gives the
    /// mass of the first one.
    pub absorbers: Vec<Absorber>,
    /// Layers under the surface layer, from the top down. The thickness axis is the total
    /// thickness of all layers.
    pub below: Vec<Layer>,
    /// The substrate.
    pub substrate: Substrate,
    /// Model options.
    pub model: Model,
    /// Whether there are curves under diffuse light in addition to those at the incidence
    /// angles; only with engines whose jobs have all angles.
    pub diffuse: bool,
}

impl Fixed {
    /// Clean, dry snow of spheroids on a black substrate.
    #[must_use]
    pub fn dry(sphericity: TruncatedNormal, temperature_c: f64) -> Self {
        Self {
            shape: Shape::Spheroid,
            proportion: sphericity,
            temperature_c,
            water_saturation: 0.0,
            black_carbon: None,
            brown_carbon: None,
            absorbers: Vec::new(),
            below: Vec::new(),
            substrate: Substrate::Black,
            model: Model::default(),
            diffuse: false,
        }
    }

    /// The carbon in the surface layer and in the layers below it.
    pub fn carbon(&self) -> impl Iterator<Item = &Carbon> {
        let own = [&self.black_carbon, &self.brown_carbon];
        let below = self.below.iter().flat_map(|layer| layer.snow.carbon());
        own.into_iter().flatten().chain(below)
    }

    /// Whether any layer has absorbers other than carbon.
    pub(crate) fn has_absorbers(&self) -> bool {
        let below = self.below.iter().flat_map(|layer| &layer.snow.absorbers);
        self.absorbers.iter().chain(below).next().is_some()
    }

    /// Whether any layer contains liquid water.
    #[must_use]
    pub fn is_wet(&self) -> bool {
        let below = self.below.iter();
        self.water_saturation > 0.0 || below.into_iter().any(|l| l.snow.water_saturation > 0.0)
    }
}

/// How the jobs are simulated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Run {
    /// The engine.
    pub engine: Engine,
    /// Seed of the random streams.
    pub seed: u64,
    /// Number of walks per curve (see [`crate::engine::Request::rays`]).
    pub rays: u64,
    /// Largest error of a curve that the engine `auto` may leave.
    pub max_error: MaxError,
}

/// Error bounds that determine the number of components of the compression.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compression {
    /// Largest colour difference Delta-E of any curve (default 2.3).
    pub max_delta_e: f64,
    /// Largest root-mean-square error of any curve; `None` for a bound derived from the
    /// standard errors.
    pub max_rmse: Option<f64>,
}

/// A spectral database as described by a grid file.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// The axes: those that every database has, and any optional ones.
    pub axes: Axes,
    /// Views toward which the light is computed too, if any.
    pub views: Option<GridViews>,
    /// Values of the grain size axis if it is given by another measure than the size.
    pub size_axis: Option<SizeAxis>,
    /// Widths of the distributions around an axis value.
    pub spread: Spread,
    /// Wavelengths, nm, strictly increasing.
    pub wavelengths_nm: Vec<f64>,
    /// Properties that all curves share.
    pub fixed: Fixed,
    /// Engine, seed, number of walks and largest error.
    pub run: Run,
    /// Error bounds of the compression.
    pub compression: Compression,
}

#[cfg(test)]
pub(crate) mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::parameter::Parameter;

    /// A small dry grid: 2 x 2 x 1 x 3 x 2 = 24 curves of 4 wavelengths.
    pub(crate) fn small(engine: Engine) -> Grid {
        Grid {
            axes: Axes::from([
                (Parameter::Facetness, vec![0.05, 0.5]),
                (Parameter::GrainSize, vec![100.0, 200.0]),
                (Parameter::Density, vec![300.0]),
                (Parameter::Thickness, vec![1.0, 2.0, 5.0]),
                (Parameter::Incidence, vec![0.0, 60.0]),
            ]),
            views: None,
            size_axis: None,
            spread: Spread::default(),
            wavelengths_nm: vec![400.0, 500.0, 600.0, 700.0],
            fixed: Fixed::dry(TruncatedNormal::new(0.6, 0.95, 0.798, 0.064).unwrap(), -1.0),
            run: Run {
                engine,
                seed: 7,
                rays: 100,
                max_error: MaxError::default(),
            },
            compression: Compression {
                max_delta_e: 2.3,
                max_rmse: None,
            },
        }
    }

    /// The same at three concentrations of carbon and two saturations.
    pub(crate) fn with_extra(mut grid: Grid) -> Grid {
        let axes = &mut grid.axes;
        axes.set(Parameter::BlackCarbon, vec![0.0, 100.0, 400.0]);
        axes.set(Parameter::WaterSaturation, vec![0.0, 0.1]);
        grid
    }
}
