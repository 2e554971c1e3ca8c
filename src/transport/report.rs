//! What walks report, and how absorption enters it.
use std::ops::Range;

use crate::math::{Vec3, exp_neg};

/// How walks end by absorption.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Absorption {
    /// Absorption coefficient of ice, 1/m: of the wavelength walked, or the
    /// least of all wavelengths that share the walk.
    pub ice_per_m: f64,
    /// The same of water, 1/m.
    pub water_per_m: f64,
    /// Optical depth that every ray survives (0: analog absorption).
    pub deferred: f64,
}

impl Absorption {
    /// Weight of a ray that has survived the paths given, for a wavelength
    /// with the absorption coefficients given, none below these: exp(-depth)
    /// over the chance to survive. At most 1, and unbiased.
    #[inline]
    #[must_use]
    pub fn weight(&self, path: &Path, ice_per_m: f64, water_per_m: f64) -> f64 {
        let survived =
            self.ice_per_m * path.ice_m + self.water_per_m * path.water_m - self.deferred;
        exp_neg(ice_per_m * path.ice_m + water_per_m * path.water_m - survived.max(0.0))
    }
}

/// Path lengths of a ray in the snow, m.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Path {
    /// In ice.
    pub ice_m: f64,
    /// In the water of the pores.
    pub water_m: f64,
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
    /// Hit an event limit.
    Lost,
}

/// What walks report to.
pub trait Sink {
    /// A walk ended, in the same way for all `thicknesses` (positions in the
    /// list given to [`crate::transport::Walk::walk`]). A ray that left the snow did so along
    /// the unit vector `direction` (z downward; it entered at azimuth 0).
    fn end(&mut self, thicknesses: Range<usize>, end: End, path: &Path, direction: Vec3);

    /// Asked now and then: whether to give up.
    fn stop(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_make_up_for_deferred_absorption() {
        let path = Path {
            ice_m: 4.0,
            water_m: 2.0,
        };
        let absorption = |deferred| Absorption {
            ice_per_m: 1.0,
            water_per_m: 0.5,
            deferred,
        };
        let exp = |x: f64| libm::exp(-x);
        let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-14, "{a} {b}");
        // 5 optical depths, 2 of them survived by chance: exp(-5) / exp(-2)
        close(absorption(3.0).weight(&path, 1.0, 0.5), exp(3.0));
        close(absorption(3.0).weight(&path, 2.0, 1.0), exp(8.0));
        // none deferred: all survived by chance; all deferred: all in the weight
        close(absorption(0.0).weight(&path, 1.0, 0.5), 1.0);
        close(absorption(9.0).weight(&path, 1.0, 0.5), exp(5.0));
    }
}
