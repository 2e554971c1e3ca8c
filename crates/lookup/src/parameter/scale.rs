//! Coordinates of the axes in which curves are smooth.
//!
//! y = -ln T (and -ln(1 - R)) is nearly linear in each of these coordinates, so that a few
//! nodes and linear interpolation between them are enough. docs/methods.md gives the reason
//! for each axis. The constants were fitted to configs/thesis.toml; they do not affect
//! values at nodes.
use splitsnow_spectra::elementary::{exp_neg, ln};
use splitsnow_spectra::simd::{F64x8, Portable};
use std::f64::consts::{LN_2, LOG2_E};

use super::Parameter;

/// A coordinate that increases with the value x of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scale {
    /// x.
    Linear,
    /// ln x.
    Log,
    /// ln(1 + x / s).
    Shifted(f64),
    /// sqrt(x + s).
    Root(f64),
    /// -ln(1 - s x).
    Complement(f64),
    /// -exp(-x / s).
    Saturating(f64),
    /// a exp(-mu / s) - mu, where mu is the cosine of x degrees.
    Grazing([f64; 2]),
}

/// Natural logarithm of one number, from the vectorised implementation.
fn ln_of(x: f64) -> f64 {
    ln::<Portable>(F64x8::splat(x)).to_array()[0]
}

impl Scale {
    /// The coordinate of `x`.
    #[must_use]
    pub fn place(self, x: f64) -> f64 {
        match self {
            Self::Linear => x,
            Self::Log => ln_of(x),
            Self::Shifted(s) => ln_of(1.0 + x / s),
            Self::Root(s) => (x + s).sqrt(),
            Self::Complement(s) => -ln_of(1.0 - s * x),
            Self::Saturating(s) => -exp_neg(x / s),
            Self::Grazing([a, s]) => {
                let mu = libm::cos(x.to_radians());
                a * exp_neg(mu / s) - mu
            }
        }
    }

    /// `n` values from `first` to `last`, evenly spaced in the coordinate and rounded to
    /// four digits; the ends are exact.
    #[must_use]
    pub fn spread(self, [first, last]: [f64; 2], n: usize) -> Vec<f64> {
        let (begin, end) = (self.place(first), self.place(last));
        let value = |i: usize| {
            let target = begin + (end - begin) * i as f64 / (n - 1) as f64;
            let mut range = [first, last];
            for _ in 0..40 {
                let middle = 0.5 * (range[0] + range[1]);
                range[usize::from(self.place(middle) > target)] = middle;
            }
            let rounded = format!("{:.3e}", range[0]).parse().unwrap_or(range[0]);
            f64::clamp(rounded, first, last)
        };
        match n {
            0 => Vec::new(),
            1 => vec![first],
            _ => {
                let mut values: Vec<f64> = (0..n).map(value).collect();
                (values[0], values[n - 1]) = (first, last);
                values
            }
        }
    }
}

/// Scale constants, taken from the records.
const FACETNESS: f64 = match Parameter::Facetness.record().scale {
    Scale::Saturating(decay) => decay,
    _ => f64::NAN,
};
const THICKNESS_CM: f64 = match Parameter::Thickness.record().scale {
    Scale::Shifted(scale) => scale,
    _ => f64::NAN,
};
const GRAZING: [f64; 2] = match Parameter::Incidence.record().scale {
    Scale::Grazing(constants) => constants,
    _ => [f64::NAN; 2],
};

/// Natural logarithm of a normal positive number, with an error below 1e-12 times max(1, |ln x|).
/// Shorter than [`ln`], and without waiting for each term: look-ups round it to single precision.
#[inline(always)]
fn short_ln(x: f64) -> f64 {
    // x = 2^k m, m from sqrt 1/2 to sqrt 2
    const LEAST: u64 = 0x3fe6_a09e_667f_3bcd;
    let above = x.to_bits().wrapping_sub(LEAST) as i64 >> 52;
    let m = f64::from_bits(x.to_bits().wrapping_sub((above as u64) << 52));
    // ln m = 2 artanh(s), |s| <= 0.172
    let s = (m - 1.0) / (m + 1.0);
    let y = s * s;
    let y2 = y * y;
    let tail = (1.0 / 7.0 + y * (1.0 / 9.0)) + y2 * (1.0 / 11.0 + y * (1.0 / 13.0));
    let p = (1.0 / 3.0 + y * (1.0 / 5.0)) + y2 * tail;
    above as f64 * LN_2 + (s + s) * (1.0 + y * p)
}

/// exp(-x) for x from 0 to 700, with a relative error below 1e-12 times max(1, x / 100).
#[inline(always)]
fn short_exp_neg(x: f64) -> f64 {
    // exp(-x) = 2^-k exp(r), |r| <= ln 2 / 2; adding 1.5 * 2^52 rounds to an integer
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let shifted = x * LOG2_E + ROUND;
    let r = (shifted - ROUND) * LN_2 - x;
    let (r2, r4) = (r * r, r * r * (r * r));
    let low = (1.0 + r) + r2 * (0.5 + r * (1.0 / 6.0));
    let middle = (1.0 / 24.0 + r * (1.0 / 120.0)) + r2 * (1.0 / 720.0 + r * (1.0 / 5_040.0));
    let high = (1.0 / 40_320.0 + r * (1.0 / 362_880.0)) + r2 * (1.0 / 3_628_800.0);
    let p = low + r4 * (middle + r4 * high);
    f64::from_bits(p.to_bits().wrapping_sub(shifted.to_bits() << 52))
}

/// Cosine of 0 to 90 degrees, with an error below 1e-14.
#[inline(always)]
fn short_cos(degrees: f64) -> f64 {
    let angle = degrees.to_radians();
    let z = angle * angle;
    let (z2, z4) = (z * z, z * z * (z * z));
    let low = (1.0 - z * 0.5) + z2 * (1.0 / 24.0 - z * (1.0 / 720.0));
    let middle = (1.0 / 40_320.0 - z * (1.0 / 3_628_800.0))
        + z2 * (1.0 / 479_001_600.0 - z * (1.0 / 87_178_291_200.0));
    let high = 1.0 / 20_922_789_888_000.0 - z * (1.0 / 6_402_373_705_728_000.0);
    low + z4 * (middle + z4 * high)
}

/// [`Scale::place`] of facetness, grain size, density and thickness, with an error below 1e-12
/// times max(1, place).
#[inline(always)]
pub(crate) fn slab_places([facetness, size, density, thickness]: [f64; 4]) -> [f64; 4] {
    [
        -short_exp_neg(facetness * (1.0 / FACETNESS)),
        short_ln(size),
        short_ln(density),
        short_ln(1.0 + thickness * (1.0 / THICKNESS_CM)),
    ]
}

/// Coordinates of [`Parameter::CORE`] in single precision.
#[inline(always)]
pub(crate) fn core_places(values: [f32; 5]) -> [f32; 5] {
    let [facetness, size, density, thickness, angle] = values.map(f64::from);
    let [facetness, size, density, thickness] = slab_places([facetness, size, density, thickness]);
    let mu = short_cos(angle);
    let [height, decay] = GRAZING;
    let angle = height * short_exp_neg(mu * (1.0 / decay)) - mu;
    [facetness, size, density, thickness, angle].map(|place| place as f32)
}

/// Derivative of the coordinate of the thickness, 1/cm.
pub(crate) fn thickness_slope(thickness_cm: f32) -> f32 {
    1.0 / (THICKNESS_CM as f32 + thickness_cm)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_grow_with_their_parameters() {
        for parameter in Parameter::ALL {
            let record = parameter.record();
            let [min, max] = match parameter {
                Parameter::Sphericity => [0.01, 1.0],
                Parameter::GrainSize => [10.0, 3000.0],
                Parameter::Density => [1.0, 900.0],
                Parameter::Thickness => [0.0, 1e5],
                Parameter::Incidence => [0.0, 89.99],
                _ => [record.physical.min, record.physical.max],
            };
            let mut before = f64::NEG_INFINITY;
            for i in 0..=1000 {
                let here = record
                    .scale
                    .place(min + (max - min) * f64::from(i) / 1000.0);
                assert!(here > before, "{record:?}");
                before = here;
            }
            let values = record.scale.spread([min, max], 6);
            assert_eq!((values[0], values[5], values.len()), (min, max, 6));
            assert!(
                values.windows(2).all(|pair| pair[0] < pair[1]),
                "{values:?}"
            );
            assert_eq!(record.scale.spread([min, min], 1), [min]);
        }
    }

    #[test]
    fn coordinates_follow_their_formulas() {
        let place = |parameter: Parameter, x| parameter.record().scale.place(x);
        let close = |x: f64, y: f64| assert!((x - y).abs() < 1e-13 * y.abs(), "{x} {y}");
        close(place(Parameter::Facetness, 0.3), -(-0.3_f64 / 0.18).exp());
        close(place(Parameter::GrainSize, 250.0), 250_f64.ln());
        close(place(Parameter::Density, 300.0), 300_f64.ln());
        close(place(Parameter::Thickness, 4.0), 9_f64.ln());
        close(
            place(Parameter::Incidence, 60.0),
            0.4 * (-25_f64).exp() - 0.5,
        );
        close(place(Parameter::BlackCarbon, 400.0), 420_f64.sqrt());
        close(place(Parameter::WaterSaturation, 0.3), -0.7_f64.ln());
        close(place(Parameter::Sphericity, 0.8), 0.8_f64.ln());
        close(
            place(Parameter::SubstrateReflectance, 0.5),
            -(1.0 - 0.95 * 0.5_f64).ln(),
        );
        close(place(Parameter::Temperature, -7.0), -7.0);
    }

    #[test]
    fn short_functions_keep_their_bounds() {
        for i in 0..=100_000 {
            let part = f64::from(i) / 100_000.0;
            let angle = 90.0 * part;
            let exact = libm::cos(angle.to_radians());
            assert!((short_cos(angle) - exact).abs() < 1e-14, "{angle}");
            let x = 700.0 * part * part;
            let ratio = short_exp_neg(x) / libm::exp(-x);
            assert!((ratio - 1.0).abs() < 1e-12 * (x / 100.0).max(1.0), "{x}");
            for x in [1e-45, 0.7, 1.0, 1e3, 3.4e38].map(|x| x * (1.0 + part)) {
                let exact = libm::log(x);
                let error = (short_ln(x) - exact).abs();
                assert!(error < 1e-12 * exact.abs().max(1.0), "{x}");
            }
        }
    }

    /// Rounding to single precision hides the difference, except for a few values in a
    /// hundred thousand.
    #[test]
    fn coordinates_in_single_precision_are_those_of_the_scales() {
        let (mut count, mut different) = (0, 0);
        let first = [0.0, 11.0, 50.0, 0.0, 0.0];
        let last: [f32; 5] = [1.0, 3000.0, 549.0, 1e6, 89.99];
        for i in 0..=20_000 {
            let part = i as f32 / 20_000.0;
            let value = |axis: usize| first[axis] + part * part * (last[axis] - first[axis]);
            let values = std::array::from_fn(value);
            let found = core_places(values);
            for ((parameter, value), found) in Parameter::CORE.into_iter().zip(values).zip(found) {
                let place = parameter.record().scale.place(f64::from(value)) as f32;
                let steps = found.to_bits().abs_diff(place.to_bits());
                assert!(steps <= 1, "{parameter:?} {value}: {found} {place}");
                count += 1;
                different += steps;
            }
        }
        assert!(different <= count / 10_000, "{different} of {count}");
    }

    #[test]
    fn values_are_spread_evenly() {
        let scale = Parameter::Thickness.record().scale;
        let values = scale.spread([1.0, 50.0], 5);
        let step = (scale.place(50.0) - scale.place(1.0)) / 4.0;
        for pair in values.windows(2) {
            let found = scale.place(pair[1]) - scale.place(pair[0]);
            assert!((found - step).abs() < 2e-3, "{values:?}");
        }
        let angles = Parameter::Incidence.record().scale.spread([0.0, 89.0], 9);
        assert!(angles.is_sorted() && angles[7] > 80.0, "{angles:?}");
        let carbon = Parameter::BlackCarbon
            .record()
            .scale
            .spread([0.0, 400.0], 3);
        let halfway = (0.5 * (20_f64.sqrt() + 420_f64.sqrt())).powi(2) - 20.0;
        assert!((carbon[1] - halfway).abs() < 0.1, "{carbon:?}");
    }
}
