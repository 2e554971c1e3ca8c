//! The grid of a spectral database: its axes, its cells and its jobs
//! (docs/methods.md).
//!
//! Curves and jobs are numbered in storage order, slowest axis first: those
//! beyond the five, facetness, grain size, density, thickness, angle.
mod absent;
mod check;
mod describe;
mod extra;
mod job;
mod jobs;
mod shard;

use std::collections::BTreeMap;

use crate::engine::{Engine, MaxError};
use crate::grain::{SizeLaw, SizeMeasure, TruncatedNormal};
use crate::optics::Carbon;
use crate::transport::{Ground, Layer, Model};

pub use absent::MIN_GRAIN_LENGTHS;
pub use check::GridError;
pub(crate) use describe::{carbon_lines, list, normal, number, reflectance};
pub use extra::{Conditions, ExtraAxis, described};
pub(crate) use extra::{combination, combinations, positions};
pub use job::Job;
pub use jobs::{Jobs, Shape, job_shape};
pub use shard::{Shard, ShardError};

/// The five axes, and those beyond, each strictly increasing and not empty. Storage
/// order, slowest first: those beyond, facetness, grain size, density, thickness,
/// angle.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Axes {
    /// Mean facetness, [0, 1].
    pub facetness: Vec<f64>,
    /// Mean grain size, um.
    pub grain_size_um: Vec<f64>,
    /// Dry density, kg/m3.
    pub density_kg_m3: Vec<f64>,
    /// Slab thickness, cm.
    pub thickness_cm: Vec<f64>,
    /// Polar angle of incidence, degrees from the normal, [0, 90).
    pub angle_deg: Vec<f64>,
    /// Axes beyond the five, usually none.
    pub extra: BTreeMap<ExtraAxis, Vec<f64>>,
    /// What the grain sizes were told by, if not as such, and its values, increasing.
    pub told: Option<(SizeMeasure, Vec<f64>)>,
}

impl Axes {
    /// Names of the five axes in storage order, as files spell them.
    pub const NAMES: [&str; 5] = [
        "facetness",
        "grain_size_um",
        "density_kg_m3",
        "thickness_cm",
        "angle_deg",
    ];

    /// Names and values of the five axes in storage order.
    #[must_use]
    pub fn named(&self) -> [(&'static str, &[f64]); 5] {
        let [f, s, d, h, a] = Self::NAMES;
        [
            (f, &self.facetness),
            (s, &self.grain_size_um),
            (d, &self.density_kg_m3),
            (h, &self.thickness_cm),
            (a, &self.angle_deg),
        ]
    }

    /// What each grain size was told by, in the order of the sizes.
    #[must_use]
    pub fn told_by_size(&self) -> Option<(SizeMeasure, Vec<f64>)> {
        let mut told = self.told.clone();
        if let Some((SizeMeasure::SpecificSurface, values)) = &mut told {
            values.reverse();
        }
        told
    }

    /// Names and values of all axes in storage order.
    #[must_use]
    pub fn all(&self) -> Vec<(&'static str, &[f64])> {
        let extra = self.extra.iter();
        let extra = extra.map(|(axis, values)| (axis.name(), values.as_slice()));
        extra.chain(self.named()).collect()
    }

    /// How many combinations of the axes beyond the five there are; 1 without.
    #[must_use]
    pub fn combinations(&self) -> u64 {
        combinations(&self.extra)
    }

    /// Combination `number` of them.
    #[must_use]
    pub fn conditions(&self, number: u64) -> Conditions {
        combination(&self.extra, number)
    }

    /// Lengths of the five axes in storage order.
    #[must_use]
    pub fn shape(&self) -> Shape {
        self.named().map(|(_, values)| values.len() as u64)
    }
}

/// Widths of the laws around an axis value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Facetness is cut to mean -+ this (and to [0, 1]).
    pub facetness_half_width: f64,
    /// Standard deviation of facetness.
    pub facetness_sd: f64,
    /// Grain size is uniform in mean -+ this, um.
    pub grain_size_half_width_um: f64,
    /// Where sphericity is an axis, it is cut to mean -+ this (and to (0, 1]).
    pub sphericity_half_width: f64,
    /// Standard deviation of sphericity there.
    pub sphericity_sd: f64,
    /// How often grains of such sizes are met.
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

/// What every cell of the grid has in common.
#[derive(Debug, Clone, PartialEq)]
pub struct Fixed {
    /// Sphericity law of the grains.
    pub sphericity: TruncatedNormal,
    /// Temperature, Celsius.
    pub temperature_c: f64,
    /// Water saturation of the pore space.
    pub water_saturation: f64,
    /// Black carbon.
    pub black_carbon: Option<Carbon>,
    /// Brown carbon.
    pub brown_carbon: Option<Carbon>,
    /// Layers under the snow of the axes, downward: the thickness axis is that
    /// of all layers together.
    pub below: Vec<Layer>,
    /// What they lie on.
    pub ground: Ground,
    /// Choices within the model.
    pub model: Model,
    /// Whether isotropic light falls on it, too, beside that of the angles; only with
    /// engines one job of which has all angles.
    pub diffuse: bool,
}

impl Fixed {
    /// Clean, dry snow on black ground.
    #[must_use]
    pub fn dry(sphericity: TruncatedNormal, temperature_c: f64) -> Self {
        Self {
            sphericity,
            temperature_c,
            water_saturation: 0.0,
            black_carbon: None,
            brown_carbon: None,
            below: Vec::new(),
            ground: Ground::Black,
            model: Model::default(),
            diffuse: false,
        }
    }

    /// The carbon in the snow of the axes and in the layers under it.
    pub fn carbon(&self) -> impl Iterator<Item = &Carbon> {
        let own = [&self.black_carbon, &self.brown_carbon];
        let below = self.below.iter().flat_map(|layer| layer.snow.carbon());
        own.into_iter().flatten().chain(below)
    }

    /// Whether there is nothing below the snow of the axes.
    #[must_use]
    pub fn stands_free(&self) -> bool {
        self.below.is_empty() && matches!(self.ground, Ground::Black)
    }

    /// Whether there is water in any layer.
    #[must_use]
    pub fn is_wet(&self) -> bool {
        let below = self.below.iter();
        self.water_saturation > 0.0 || below.into_iter().any(|l| l.snow.water_saturation > 0.0)
    }
}

/// How the jobs are run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Run {
    /// Which engine.
    pub engine: Engine,
    /// Seed of the database.
    pub seed: u64,
    /// Walks per curve (see [`crate::engine::Request::rays`]).
    pub rays: u64,
    /// What `auto` is to hold.
    pub max_error: MaxError,
}

/// Bounds that choose the number of components.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compression {
    /// Largest Delta-E*ab allowed on any curve (default 2.3).
    pub max_delta_e: f64,
    /// Largest RMSE allowed on any curve.
    pub max_rmse: Option<f64>,
}

/// A whole database, as a config describes it.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// The axes.
    pub axes: Axes,
    /// Widths of the laws around an axis value.
    pub spread: Spread,
    /// Wavelengths, nm, strictly increasing.
    pub wavelengths_nm: Vec<f64>,
    /// What all cells share.
    pub fixed: Fixed,
    /// Engine, seed, rays.
    pub run: Run,
    /// Bounds of the compression.
    pub compression: Compression,
}

#[cfg(test)]
pub(crate) mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// A small dry grid: 2 x 2 x 1 x 3 x 2 = 24 curves of 4 wavelengths.
    pub(crate) fn small(engine: Engine) -> Grid {
        Grid {
            axes: Axes {
                facetness: vec![0.05, 0.5],
                grain_size_um: vec![100.0, 200.0],
                density_kg_m3: vec![300.0],
                thickness_cm: vec![1.0, 2.0, 5.0],
                angle_deg: vec![0.0, 60.0],
                ..Axes::default()
            },
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
        grid.axes.extra = BTreeMap::from([
            (ExtraAxis::BlackCarbon, vec![0.0, 100.0, 400.0]),
            (ExtraAxis::WaterSaturation, vec![0.0, 0.1]),
        ]);
        grid
    }
}
