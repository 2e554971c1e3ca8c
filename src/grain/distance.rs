//! Mean free distance between grains (Varsa 2025, appendix B).
//!
//! The published K1 implies grain numbers falling as s^-4 while the walk meets
//! sizes uniformly; it is kept as published. The specific surface area that
//! the walk's extinction implies is 4 K1 K2 / ice density (convex grains).
use crate::grain::{GrainType, SizeRange, TruncatedNormal};
use crate::optics::ice_density_kg_m3;

/// Mean free distance, m, between grains of dry snow of the density and
/// temperature given; infinite at density 0 (Varsa 2025, eqs. B.1-B.9).
#[must_use]
pub fn mean_free_distance_m(grain: &GrainType, density_kg_m3: f64, temperature_c: f64) -> f64 {
    let ice_fraction = density_kg_m3 / ice_density_kg_m3(temperature_c);
    1.0 / (ice_fraction * size_factor_per_m(&grain.size) * shape_factor(&grain.sphericity))
}

/// K1, 1/m: mean inverse size (eq. B.7 with the sign of its logarithm mended);
/// 1/s for a single size.
#[must_use]
pub fn size_factor_per_m(size: &SizeRange) -> f64 {
    let (min, max) = (size.min_m(), size.max_m());
    let ratio = (max - min) / min;
    if ratio < 1e-8 {
        return 1.0 / (min * max).sqrt();
    }
    ratio / (max * libm::log1p(ratio))
}

/// K2: a quarter of the mean surface-to-volume ratio of spheroids of unit
/// length over the truncated normal of the sphericity.
#[must_use]
pub fn shape_factor(sphericity: &TruncatedNormal) -> f64 {
    let (min, max, mean, sd) = (
        sphericity.min(),
        sphericity.max(),
        sphericity.mean(),
        sphericity.sd(),
    );
    if sd == 0.0 || min == max {
        return surface_to_volume(mean) / 4.0;
    }
    // Simpson over [min, max] cut to 12 standard deviations, 2000 panels
    let (low, high) = (min.max(mean - 12.0 * sd), max.min(mean + 12.0 * sd));
    let panels = 2000;
    let step = (high - low) / f64::from(panels);
    let (mut weighted, mut total) = (0.0, 0.0);
    for i in 0..=panels {
        let psi = low + step * f64::from(i);
        let z = (psi - mean) / sd;
        let simpson = if i == 0 || i == panels {
            1.0
        } else {
            2.0 + 2.0 * f64::from(i % 2)
        };
        let density = simpson * libm::exp(-0.5 * z * z);
        weighted += density * surface_to_volume(psi);
        total += density;
    }
    weighted / (4.0 * total)
}

/// Surface-to-volume ratio of a prolate spheroid of unit full length:
/// 3 (1 + asin(e) / (Psi^2 e)), e = sqrt(1 - Psi^4); 6 for the sphere.
fn surface_to_volume(psi: f64) -> f64 {
    let e = (1.0 - psi.powi(4)).max(0.0).sqrt();
    let ratio = if e < 1e-4 {
        1.0 + e * e / 6.0
    } else {
        libm::asin(e) / e
    };
    3.0 * (1.0 + ratio / (psi * psi))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn limits() {
        assert!((surface_to_volume(1.0) - 6.0).abs() < 1e-12);
        assert!((surface_to_volume(1.0 - 1e-9) - 6.0).abs() < 1e-6);
        let one = SizeRange::new(4e-4, 4e-4).unwrap();
        assert_eq!(size_factor_per_m(&one), 2500.0);
        let narrow = SizeRange::new(4e-4, 4e-4 * (1.0 + 1e-7)).unwrap();
        assert!((size_factor_per_m(&narrow) / 2500.0 - 1.0).abs() < 1e-6);
        // a thin needle: pi c^2 cross-section, S/V -> (pi / 2) / (c / 2 * ...) : 3 pi / (2 Psi^2)
        let psi: f64 = 0.01;
        let needle = 1.5 * std::f64::consts::PI / (psi * psi);
        assert!((surface_to_volume(psi) / needle - 1.0).abs() < 1e-3);
    }

    #[test]
    fn size_factor_is_the_published_integral() {
        // (max - min) / (min max ln(max / min)), 300-750 um
        let size = SizeRange::new(300e-6, 750e-6).unwrap();
        let expected = 450e-6 / (300e-6 * 750e-6 * 2.5f64.ln());
        assert!((size_factor_per_m(&size) / expected - 1.0).abs() < 1e-12);
        assert!((size_factor_per_m(&size) - 2183.0).abs() < 1.0);
    }
}
