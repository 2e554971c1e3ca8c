//! What a walk reports, and how absorption enters it.
use std::ops::Range;

use super::{Leg, TRACERS, Tracers};
use crate::math::{Vec3, exp_neg};
use crate::optics::Index;

/// Absorption coefficients at one wavelength.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Coefficients {
    /// Absorption coefficient of ice, 1/m.
    pub ice_per_m: f64,
    /// Absorption coefficient of water, 1/m.
    pub water_per_m: f64,
    /// Factors of the sums over impurities ([`Tracers::factors`]).
    pub impurities: [f64; TRACERS],
}

impl Coefficients {
    /// Coefficients of ice and water at `wavelength_nm`, and of impurities with the
    /// given `tracers`.
    #[must_use]
    pub fn at(wavelength_nm: f64, (ice, water): (Index, Index), tracers: &Tracers) -> Self {
        Self {
            ice_per_m: ice.absorption_per_m(wavelength_nm),
            water_per_m: water.absorption_per_m(wavelength_nm),
            impurities: tracers.factors(wavelength_nm),
        }
    }

    /// The smallest value of each coefficient in `all`.
    #[must_use]
    pub fn least(all: &[Self]) -> Self {
        let least =
            |value: &dyn Fn(&Self) -> f64| all.iter().map(value).fold(f64::INFINITY, f64::min);
        Self {
            ice_per_m: least(&|c| c.ice_per_m),
            water_per_m: least(&|c| c.water_per_m),
            impurities: std::array::from_fn(|i| least(&|c| c.impurities[i])),
        }
    }

    /// Optical depth of a path.
    #[inline(always)]
    #[must_use]
    pub fn depth(&self, path: &Path) -> f64 {
        let clean = self.ice_per_m * path.ice_m + self.water_per_m * path.water_m;
        let impurities = self.impurities.iter().zip(&path.impurities);
        impurities.fold(clean, |sum, (factor, depth)| sum + factor * depth)
    }
}

/// How walks end by absorption.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Absorption {
    /// Coefficients of the wavelength walked, or the smallest of all wavelengths that
    /// share the walk.
    pub coefficients: Coefficients,
    /// Optical depth up to which no ray is absorbed (0: analog absorption).
    pub deferred: f64,
}

impl Absorption {
    /// Weight of a ray that has survived `path`, for a wavelength with `coefficients`,
    /// none of which is below those of the walk: exp(-depth) over the probability of
    /// surviving. It is at most 1 and unbiased.
    #[inline(always)]
    #[must_use]
    pub fn weight(&self, path: &Path, coefficients: &Coefficients) -> f64 {
        let survived = self.coefficients.depth(path) - self.deferred;
        exp_neg(coefficients.depth(path) - survived.max(0.0))
    }
}

/// The path of a ray in the snow.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Path {
    /// Path length in ice, m.
    pub ice_m: f64,
    /// Path length in the pore water, m.
    pub water_m: f64,
    /// Sums over impurities ([`Tracers::per_m`]).
    pub impurities: [f64; TRACERS],
    /// Horizontal distance from the point of entry, m, in the plane of incidence and
    /// perpendicular to it. 0 if the walk does not follow it.
    pub offset_m: [f64; 2],
    /// Number of reflections by the substrate.
    pub bounces: u32,
}

/// How a walk ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// Left through the upper plane.
    Reflected,
    /// Left through the lower plane.
    Transmitted,
    /// Absorbed in ice or water.
    Absorbed,
    /// Reached an event limit.
    Lost,
}

/// Receives the results of walks.
pub trait Sink {
    /// A walk ended in the same way for all `thicknesses` (positions in the list given
    /// to [`crate::transport::Walk::walk`]). A ray that left the snow travels along the
    /// unit vector `direction` (z downward; it entered at azimuth 0).
    fn end(&mut self, thicknesses: Range<usize>, end: End, path: &Path, direction: Vec3);

    /// Whether [`Sink::leg`] is to be called. Rays are then absorbed only after the leg in which
    /// absorption ends them.
    fn follows(&self) -> bool {
        false
    }

    /// A ray that is absorbed at the optical depth `budget` (of the walk's own absorption) moved
    /// along `leg`. It may have been absorbed on the way.
    fn leg(&mut self, _leg: &Leg, _budget: f64) {}

    /// Whether to stop early. Called at intervals.
    fn stop(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_compensate_for_deferred_absorption() {
        let path = Path {
            ice_m: 4.0,
            water_m: 2.0,
            impurities: [0.5, 0.0, 0.0, 0.0],
            ..Path::default()
        };
        let coefficients = |ice_per_m, water_per_m, impurity| Coefficients {
            ice_per_m,
            water_per_m,
            impurities: [impurity, 0.0, 0.0, 0.0],
        };
        let absorption = |deferred| Absorption {
            coefficients: coefficients(0.5, 0.5, 4.0),
            deferred,
        };
        let exp = |x: f64| libm::exp(-x);
        let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-14, "{a} {b}");
        // 5 optical depths, 2 of them survived by chance: exp(-5) / exp(-2)
        let same = coefficients(0.5, 0.5, 4.0);
        close(absorption(3.0).weight(&path, &same), exp(3.0));
        let more = coefficients(1.0, 1.0, 8.0);
        close(absorption(3.0).weight(&path, &more), exp(8.0));
        // nothing deferred: survival is all by chance; everything deferred: all in the weight
        close(absorption(0.0).weight(&path, &same), 1.0);
        close(absorption(9.0).weight(&path, &same), exp(5.0));
    }
}
