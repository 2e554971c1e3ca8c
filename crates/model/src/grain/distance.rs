//! Mean free distance between grains (Varsa 2025, appendix B), for both size laws.
//!
//! A straight line meets 1/dbar grains per metre at random. Its mean chord in a grain is
//! 4 volume / surface (Cauchy, for a convex body met uniformly over its projected area).
//! The walk draws the sizes and shapes of the grains it meets from their distributions, so
//! the path in ice per metre is <4 volume / surface> / dbar, a mean over the grains met.
//! [`SizeLaw::Consistent`] equates this to the volume fraction V of ice. With independent
//! size s and sphericity Psi, surface / volume = A(Psi) / s, and therefore
//!
//! `dbar = <s> <4 / A(Psi)> / V`, so `K1 = 1 / <s>` and `K2 = 1 / <4 / A(Psi)>`.
//!
//! For the published K1, `K1 <s>` is 1 for a single size, 1.15 for 300-750 um and 7.3 for
//! 50-3000 um: the walk meets that many times the ice given by the density. The published
//! K2 adds 1.6 % at the usual spread of the sphericity. In either case the snow that the
//! walk meets has the specific surface area 4 K1 K2 / ice density.
use std::cell::RefCell;

use crate::grain::{GrainType, Shape, SizeLaw, SizeRange, TruncatedNormal};
use crate::optics::ice_density_kg_m3;

/// Mean free distance, m, between grains of dry snow of the given density and temperature;
/// infinite at density 0 (Varsa 2025, eqs. B.1-B.9).
#[must_use]
pub fn mean_free_distance_m(grain: &GrainType, density_kg_m3: f64, temperature_c: f64) -> f64 {
    let ice_fraction = density_kg_m3 / ice_density_kg_m3(temperature_c);
    let shape = shape_factor(grain.shape, &grain.proportion, grain.size.law());
    1.0 / (ice_fraction * size_factor_per_m(&grain.size) * shape)
}

/// Specific surface area, m2/kg, that this distance implies.
#[must_use]
pub fn specific_surface_m2_kg(grain: &GrainType, temperature_c: f64) -> f64 {
    let shape = shape_factor(grain.shape, &grain.proportion, grain.size.law());
    4.0 * size_factor_per_m(&grain.size) * shape / ice_density_kg_m3(temperature_c)
}

/// K1, 1/m: the mean inverse size (eq. B.7 with the sign of its logarithm corrected), or
/// the inverse of the mean size, depending on the size law. 1/s for a single size.
#[must_use]
pub fn size_factor_per_m(size: &SizeRange) -> f64 {
    let (min, max) = (size.min_m(), size.max_m());
    if size.law() == SizeLaw::Consistent {
        return 2.0 / (min + max);
    }
    let ratio = (max - min) / min;
    if ratio < 1e-8 {
        return 1.0 / (min * max).sqrt();
    }
    ratio / (max * libm::log1p(ratio))
}

/// Ratio of the ice that a ray meets to the ice given by the density, due to the spread of
/// these sizes. At least 1; exactly 1 under [`SizeLaw::Consistent`].
#[must_use]
pub fn overpacking(size: &SizeRange) -> f64 {
    0.5 * (size.min_m() + size.max_m()) * size_factor_per_m(size)
}

/// K2: a quarter of the surface-to-volume ratio of grains of unit length, averaged over the
/// truncated normal distribution of the proportion. [`SizeLaw::Consistent`] uses the
/// harmonic mean. The last factors of a thread are remembered.
#[must_use]
pub fn shape_factor(shape: Shape, proportion: &TruncatedNormal, law: SizeLaw) -> f64 {
    let key = (shape, *proportion, law);
    KNOWN_FACTORS.with_borrow_mut(|known| {
        if let Some((_, factor)) = known.iter().find(|(other, _)| *other == key) {
            return *factor;
        }
        let factor = integrated_shape_factor(shape, proportion, law);
        known.truncate(MOST_KNOWN - 1);
        known.insert(0, (key, factor));
        factor
    })
}

/// Number of shape factors that are remembered: more than a snowpack has types of grains.
const MOST_KNOWN: usize = 32;

type FactorKey = (Shape, TruncatedNormal, SizeLaw);

thread_local! {
    /// The last shape factors. A simulation asks for the same ones again and again.
    static KNOWN_FACTORS: RefCell<Vec<(FactorKey, f64)>> = const { RefCell::new(Vec::new()) };
}

fn integrated_shape_factor(shape: Shape, proportion: &TruncatedNormal, law: SizeLaw) -> f64 {
    let (min, max, mean, sd) = (
        proportion.min(),
        proportion.max(),
        proportion.mean(),
        proportion.sd(),
    );
    if sd == 0.0 || min == max {
        return shape.surface_to_volume(mean) / 4.0;
    }
    // Simpson's rule over [min, max] cut to 12 standard deviations, 2000 panels
    let (low, high) = (min.max(mean - 12.0 * sd), max.min(mean + 12.0 * sd));
    let panels = 2000;
    let step = (high - low) / f64::from(panels);
    let (mut weighted, mut total) = (0.0, 0.0);
    for i in 0..=panels {
        let value = low + step * f64::from(i);
        let z = (value - mean) / sd;
        let simpson = if i == 0 || i == panels {
            1.0
        } else {
            2.0 + 2.0 * f64::from(i % 2)
        };
        let density = simpson * libm::exp(-0.5 * z * z);
        weighted += match law {
            SizeLaw::Varsa2025 => density * shape.surface_to_volume(value),
            SizeLaw::Consistent => density / shape.surface_to_volume(value),
        };
        total += density;
    }
    match law {
        SizeLaw::Varsa2025 => weighted / (4.0 * total),
        SizeLaw::Consistent => total / (4.0 * weighted),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn size_factor_of_a_single_size_is_its_inverse() {
        let single = SizeRange::new(4e-4, 4e-4).unwrap();
        assert_eq!(size_factor_per_m(&single), 2500.0);
        let narrow = SizeRange::new(4e-4, 4e-4 * (1.0 + 1e-7)).unwrap();
        assert!((size_factor_per_m(&narrow) / 2500.0 - 1.0).abs() < 1e-6);
    }

    #[test]
    fn size_factor_matches_the_published_integral() {
        // (max - min) / (min max ln(max / min)), 300-750 um
        let size = SizeRange::new(300e-6, 750e-6).unwrap();
        let expected = 450e-6 / (300e-6 * 750e-6 * 2.5f64.ln());
        assert!((size_factor_per_m(&size) / expected - 1.0).abs() < 1e-12);
        assert!((size_factor_per_m(&size) - 2183.0).abs() < 1.0);
    }

    /// Under the consistent law, <4 volume / surface> / dbar is the volume fraction of ice.
    /// Under the published law it is `ratio` times that.
    #[test]
    fn only_the_published_law_overpacks_wide_ranges() {
        let sizes = |min: f64, max: f64| SizeRange::new(min * 1e-6, max * 1e-6).unwrap();
        for (min, max, ratio) in [
            (300.0, 750.0, 1.146),
            (150.0, 800.0, 1.537),
            (50.0, 3000.0, 7.325),
            (400.0, 400.0, 1.0),
        ] {
            let published = sizes(min, max);
            let consistent = published.with_law(SizeLaw::Consistent);
            let found = size_factor_per_m(&published) / size_factor_per_m(&consistent);
            assert!((found - ratio).abs() < 5e-4, "{min}-{max} um: {found}");
            assert!((overpacking(&published) - found).abs() < 1e-12);
            assert!((overpacking(&consistent) - 1.0).abs() < 1e-12);
        }
        let psi = TruncatedNormal::new(0.6, 0.95, 0.798, 0.064).unwrap();
        let [published, consistent] = [SizeLaw::Varsa2025, SizeLaw::Consistent]
            .map(|law| shape_factor(Shape::Spheroid, &psi, law));
        assert!(
            // from an independent midpoint sum of 200,000 terms
            (published / consistent - 1.016_357).abs() < 2e-6,
            "{published} {consistent}"
        );
        let constant = TruncatedNormal::new(0.8, 0.8, 0.8, 0.0).unwrap();
        assert_eq!(
            shape_factor(Shape::Spheroid, &constant, SizeLaw::Varsa2025),
            shape_factor(Shape::Spheroid, &constant, SizeLaw::Consistent)
        );
    }
}
