//! Coordinates of the axes in which curves are smooth.
//!
//! y = -ln T (and -ln(1 - R)) is nearly linear in each of these coordinates, so that a few
//! nodes and linear interpolation between them are enough. docs/methods.md gives the reason
//! for each axis. The constants were fitted to configs/thesis.toml; they do not affect
//! values at nodes.
use splitsnow_spectra::elementary::{exp_neg, ln};
use splitsnow_spectra::simd::{F64x8, Portable, Simd};

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

/// [`Scale::place`] of facetness, grain size, density and thickness, with the logarithms
/// computed in one vector.
#[inline(always)]
pub(crate) fn slab_places<S: Simd>([facetness, size, density, thickness]: [f64; 4]) -> [f64; 4] {
    let logs = [
        size,
        density,
        1.0 + thickness / THICKNESS_CM,
        1.0,
        1.0,
        1.0,
        1.0,
        1.0,
    ];
    let [size, density, thickness, ..] = ln(F64x8::<S>::new(logs)).to_array();
    [-exp_neg(facetness / FACETNESS), size, density, thickness]
}

/// Coordinates of [`Parameter::CORE`] in single precision.
#[inline(always)]
pub(crate) fn core_places<S: Simd>(values: [f32; 5]) -> [f32; 5] {
    let [facetness, size, density, thickness, angle] = values.map(f64::from);
    let mu = libm::cos(angle.to_radians());
    let [facetness, size, density, thickness] =
        slab_places::<S>([facetness, size, density, thickness]);
    let [height, decay] = GRAZING;
    [
        facetness,
        size,
        density,
        thickness,
        height * exp_neg(mu / decay) - mu,
    ]
    .map(|place| place as f32)
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
    fn vectorised_coordinates_are_identical() {
        for values in [
            [0.3, 250.0, 300.0, 4.0, 60.0],
            [0.0, 11.0, 549.0, 1e6, 89.9],
        ] {
            let values: [f32; 5] = values;
            let found = core_places::<Portable>(values);
            for ((parameter, value), found) in Parameter::CORE.into_iter().zip(values).zip(found) {
                let place = parameter.record().scale.place(f64::from(value)) as f32;
                assert_eq!(found.to_bits(), place.to_bits(), "{parameter:?}");
            }
        }
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
