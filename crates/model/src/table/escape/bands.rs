//! Bands eight side by side, so that no loop over bands has a remainder.
use splitsnow_spectra::simd::{F64x8, Simd};

use super::EscapeBand;
use crate::transport::{Path, TRACERS};

/// Properties of eight bands.
#[derive(Debug)]
pub(super) struct BandLanes {
    ice_per_m: F64x8,
    water_per_m: F64x8,
    impurities: [F64x8; TRACERS],
    /// Weight that a ray keeps where the substrate reflects it.
    pub(super) kept: F64x8,
    /// Fraction of the light arriving at the substrate that counts as transmitted.
    pub(super) transmitted: F64x8,
}

/// A value of every band, in groups of eight. The last band fills up its group.
pub(super) fn lanes(bands: &[EscapeBand], of: impl Fn(&EscapeBand) -> f64) -> Vec<F64x8> {
    let group = |first: usize| {
        F64x8::new(std::array::from_fn(|i| {
            of(&bands[(first + i).min(bands.len() - 1)])
        }))
    };
    (0..bands.len()).step_by(8).map(group).collect()
}

impl BandLanes {
    /// All `bands`; rays are reflected by the substrate with the probability `bounce`.
    pub(super) fn all(bands: &[EscapeBand], bounce: f64) -> Vec<Self> {
        let group = |bands: &[EscapeBand]| {
            let of = |value: &dyn Fn(&EscapeBand) -> f64| lanes(bands, value)[0];
            Self {
                ice_per_m: of(&|band| band.coefficients.ice_per_m),
                water_per_m: of(&|band| band.coefficients.water_per_m),
                impurities: std::array::from_fn(|i| of(&|band| band.coefficients.impurities[i])),
                kept: of(&|band| {
                    if bounce > 0.0 {
                        band.reflected / bounce
                    } else {
                        0.0
                    }
                }),
                transmitted: of(&|band| band.transmitted),
            }
        };
        bands.chunks(8).map(group).collect()
    }

    /// Optical depths of a path.
    #[inline(always)]
    pub(super) fn depth<S: Simd>(&self, path: &Path) -> F64x8<S> {
        let mut sum = self.ice_per_m.on() * F64x8::splat(path.ice_m);
        sum += self.water_per_m.on() * F64x8::splat(path.water_m);
        for (factor, depth) in self.impurities.iter().zip(&path.impurities) {
            sum += factor.on() * F64x8::splat(*depth);
        }
        sum
    }
}
