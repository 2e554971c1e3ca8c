//! What a walk needs to know about the snow and the light.
use crate::grain::{GrainType, mean_free_distance_m};
use crate::optics::{IceTable, WaterTable};

/// Homogeneous snow, without its thickness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snow {
    /// The grains.
    pub grain: GrainType,
    /// Density of the dry snow, kg/m3, in [0, ice density).
    pub density_kg_m3: f64,
    /// Temperature, Celsius, in [-40, 0].
    pub temperature_c: f64,
    /// Fraction of the pore space that is water, in [0, 0.5].
    pub water_saturation: f64,
}

impl Snow {
    /// Mean free distance between grains, m (Varsa 2025, appendix B).
    #[must_use]
    pub fn mean_free_distance_m(&self) -> f64 {
        mean_free_distance_m(&self.grain, self.density_kg_m3, self.temperature_c)
    }
}

/// Where on a grain's facing side the ray enters it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Entry {
    /// Uniform over the surface area that faces the ray (Varsa 2025).
    #[default]
    Uniform,
    /// Uniform over the projected area: exact for randomly placed grains.
    Projected,
}

impl Entry {
    /// The name used in configs and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::Projected => "projected",
        }
    }
}

/// Choices within the model and its tables.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Model {
    /// Law of the entry point.
    pub entry: Entry,
    /// Refractive index of ice.
    pub ice: IceTable,
    /// Refractive index of water in the pores.
    pub water: WaterTable,
}

/// How light falls on the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Illumination {
    /// Parallel rays at a polar angle from the normal, radians, in [0, pi/2).
    Collimated {
        /// Angle between the rays and the surface normal.
        polar_angle_rad: f64,
    },
    /// Isotropic radiance over the upper hemisphere. What of it is more grazing
    /// than [`FIRST_FLIGHT`] allows, some 1e-6, falls at that limit.
    Diffuse,
}

/// Least depth of a ray's first flight, cosine times mean free distance, in
/// largest grains. At depth X a grain fits under the surface in some 2 X of
/// trials, so 10,000 trials fail with exp(-20,000 X): 1e-9 at this limit.
pub const FIRST_FLIGHT: f64 = 1e-3;

/// Cosine from the normal of a ray of isotropic radiance, for `u` uniform in
/// [0, 1): directions carry the weight of their cosine.
#[must_use]
pub fn diffuse_cosine(u: f64, mean_free_distance_m: f64, longest_grain_m: f64) -> f64 {
    let least = FIRST_FLIGHT * longest_grain_m / mean_free_distance_m;
    (1.0 - u).sqrt().max(least).min(1.0)
}
