//! A layer of a snowpack with the outcomes of its grains.
use splitsnow_spectra::simd::{F64x8, Simd};

use super::bands::lanes;
use super::{EscapeBand, EscapeTable};
use crate::transport::{Layer, Model, TRACERS, Tracers};

/// Grains of one type, with outcomes in air and in water.
#[derive(Debug)]
pub(super) struct EscapeKind<'a> {
    /// Cumulative probability: a grain met is of this type or an earlier one.
    pub(super) cumulative: f64,
    pub(super) size_m: [f64; 2],
    pub(super) tables: [&'a EscapeTable; 2],
}

#[derive(Debug)]
pub(super) struct EscapeLayer<'a> {
    pub(super) kinds: Vec<EscapeKind<'a>>,
    /// Depths of its upper and lower planes, m.
    pub(super) top_m: f64,
    pub(super) base_m: f64,
    pub(super) mean_free_distance_m: f64,
    pub(super) longest_grain_m: f64,
    pub(super) water_saturation: f64,
    pub(super) in_ice: [f64; TRACERS],
    pub(super) in_pores: [f64; TRACERS],
    /// Absorption coefficient of its ice per band, 1/m.
    pub(super) ice_per_m: Vec<F64x8>,
    /// Absorption coefficient of its pores per band, filled with air and with water, 1/m.
    pub(super) pores_per_m: [Vec<F64x8>; 2],
}

impl<'a> EscapeLayer<'a> {
    pub(super) fn new(
        layer: &Layer,
        top_m: f64,
        tables: &'a [[EscapeTable; 2]],
        bands: &[EscapeBand],
        (tracers, model): (&Tracers, &Model),
    ) -> Self {
        let snow = &layer.snow;
        let [in_ice, in_pores] = tracers.per_m(snow, model);
        let impurities = |band: &EscapeBand, per_m: &[f64; TRACERS]| -> f64 {
            let factors = band.coefficients.impurities.iter();
            factors
                .zip(per_m)
                .map(|(factor, per_m)| factor * per_m)
                .sum()
        };
        let per_band = |f: &dyn Fn(&EscapeBand) -> f64| lanes(bands, f);
        let mut cumulative = 0.0;
        let grains = snow
            .meeting_shares()
            .into_iter()
            .zip(&snow.grains)
            .zip(tables);
        let kinds = grains.map(|((share, component), [air, water])| {
            cumulative += share;
            let size = component.grain.size;
            EscapeKind {
                cumulative,
                size_m: [size.min_m(), size.max_m()],
                tables: [air, water],
            }
        });
        Self {
            kinds: kinds.collect(),
            top_m,
            base_m: top_m + layer.thickness_m,
            mean_free_distance_m: snow.mean_free_distance_m(),
            longest_grain_m: snow.sizes_m()[1],
            water_saturation: snow.water_saturation,
            in_ice,
            in_pores,
            ice_per_m: per_band(&|b| b.coefficients.ice_per_m + impurities(b, &in_ice)),
            pores_per_m: [
                per_band(&|b| impurities(b, &in_pores)),
                per_band(&|b| b.coefficients.water_per_m + impurities(b, &in_pores)),
            ],
        }
    }

    /// Length of its part of the vertical from the depths `z_m` to the upper plane of the snowpack
    /// or, where `down` is set, to the lower one.
    #[inline(always)]
    pub(super) fn part_m<S: Simd>(&self, z_m: F64x8<S>, down: F64x8<S>) -> F64x8<S> {
        let [top, base] = [self.top_m, self.base_m].map(F64x8::splat);
        let part = down.select(base - z_m, z_m - top);
        part.max(F64x8::ZERO).min(base - top)
    }
}
