//! Coordinates of the axes in which curves are smooth.
//!
//! With y = -ln T (and -ln(1 - R)), y against each of these is close to a
//! straight line, so that few nodes do and a linear step between them is right:
//!
//! | axis | coordinate | why |
//! |---|---|---|
//! | facetness f | -exp(-f/0.18) | facets act on y as a saturating exponential |
//! | grain size, density | logarithm | y depends on their ratio, as on a power |
//! | thickness h | ln(1 + h/0.5 cm) | without absorption 1/T grows like 1 + h/h0 |
//! | angle | mu - 0.4 exp(-mu/0.02), mu its cosine | y is linear in mu, but for grazing light, whose first grain must fit under the surface |
//!
//! The constants are measured on configs/thesis.toml (docs/methods.md); they move
//! no value on a node.
use wide::f64x8;

use crate::elementary::{exp_neg, ln};

/// Decay of the facetness.
const FACETNESS: f64 = 0.18;
/// Scale of the thickness, cm.
const THICKNESS_CM: f64 = 0.5;
/// Size and decay of what grazing light adds.
const GRAZING: [f64; 2] = [0.4, 0.02];

/// Coordinates of facetness, grain size, density, thickness and angle, each
/// growing with its axis.
#[inline]
pub(super) fn smooth(point: [f32; 5]) -> [f32; 5] {
    let [facetness, size, density, thickness, angle] = point.map(f64::from);
    let mu = libm::cos(angle.to_radians());
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
    let [size, density, thickness, ..] = ln(f64x8::new(logs)).to_array();
    let [height, decay] = GRAZING;
    [
        -exp_neg(facetness / FACETNESS),
        size,
        density,
        thickness,
        height * exp_neg(mu / decay) - mu,
    ]
    .map(|place| place as f32)
}

/// Derivative of the thickness' coordinate, 1/cm.
pub(super) fn thickness_slope(thickness_cm: f32) -> f32 {
    1.0 / (THICKNESS_CM as f32 + thickness_cm)
}

/// `n` values of an axis (in the order of [`crate::compress::AXES`]) from `first`
/// to `last`, evenly spaced in its coordinate, to four digits but for the ends.
#[must_use]
pub fn spread(axis: usize, [first, last]: [f64; 2], n: usize) -> Vec<f64> {
    let place = |value: f64| {
        let mut point = [0.0, 1.0, 1.0, 0.0, 0.0];
        if let Some(at) = point.get_mut(axis) {
            *at = value as f32;
        }
        f64::from(smooth(point).get(axis).copied().unwrap_or_default())
    };
    let (begin, end) = (place(first), place(last));
    let value = |i: usize| {
        let target = begin + (end - begin) * i as f64 / (n - 1) as f64;
        let mut range = [first, last];
        for _ in 0..40 {
            let middle = 0.5 * (range[0] + range[1]);
            range[usize::from(place(middle) > target)] = middle;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grow_with_their_axes_and_follow_their_formulas() {
        let ends = [[0.0, 10.0, 1.0, 0.0, 0.0], [1.0, 3000.0, 900.0, 1e5, 89.99]];
        let mut before = smooth(ends[0]);
        for i in 1..=1000 {
            let t = i as f32 / 1000.0;
            let point: [f32; 5] =
                std::array::from_fn(|a| ends[0][a] + t * (ends[1][a] - ends[0][a]));
            let here = smooth(point);
            for axis in 0..5 {
                assert!(here[axis] > before[axis], "{axis} {point:?}");
            }
            before = here;
        }
        let [f, g, d, h, a] = smooth([0.3, 250.0, 300.0, 4.0, 60.0]).map(f64::from);
        let close = |x: f64, y: f64| assert!((x - y).abs() < 3e-7 * y.abs(), "{x} {y}");
        close(f, -(-0.3_f64 / 0.18).exp());
        close(g, 250_f64.ln());
        close(d, 300_f64.ln());
        close(h, 9_f64.ln());
        close(a, 0.4 * (-25_f64).exp() - 0.5);
    }

    #[test]
    fn spread_evenly() {
        let values = spread(3, [1.0, 50.0], 5);
        assert_eq!((values[0], values[4]), (1.0, 50.0));
        let place = |h: f64| (1.0 + h / 0.5).ln();
        let step = (place(50.0) - place(1.0)) / 4.0;
        for pair in values.windows(2) {
            assert!(
                (place(pair[1]) - place(pair[0]) - step).abs() < 2e-3,
                "{values:?}"
            );
        }
        assert_eq!(spread(0, [0.3, 0.3], 1), [0.3]);
        let angles = spread(4, [0.0, 89.0], 9);
        assert!(angles.is_sorted() && angles[7] > 80.0, "{angles:?}");
    }
}
