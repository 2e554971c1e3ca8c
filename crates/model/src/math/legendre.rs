//! Legendre polynomials.
use splitsnow_spectra::simd::{F64x8, Simd};

/// Number of degrees, 0 to 63.
pub const DEGREES: usize = 64;

/// (2l + 1) / (l + 1) and l / (l + 1).
const STEPS: [[f64; 2]; DEGREES + 1] = {
    let mut steps = [[0.0; 2]; DEGREES + 1];
    let mut l = 0;
    while l <= DEGREES {
        let x = l as f64;
        steps[l] = [(2.0 * x + 1.0) / (x + 1.0), x / (x + 1.0)];
        l += 1;
    }
    steps
};

/// Writes P_l(x) to `values[l]` for l = 0, 1, ..., at most [`DEGREES`] values. Any further
/// values are not changed.
#[inline(always)]
pub fn legendre(x: f64, values: &mut [f64]) {
    let (mut p, mut next) = (1.0, x);
    for (value, [a, b]) in values.iter_mut().zip(&STEPS[1..]) {
        *value = p;
        (p, next) = (next, a * x * next - b * p);
    }
}

/// [`legendre`] of eight numbers.
#[inline(always)]
pub(crate) fn legendre_lanes<S: Simd>(x: F64x8<S>, values: &mut [F64x8<S>]) {
    let (mut p, mut next) = (F64x8::ONE, x);
    for (value, [a, b]) in values.iter_mut().zip(&STEPS[1..]) {
        *value = p;
        (p, next) = (next, F64x8::splat(*a) * x * next - F64x8::splat(*b) * p);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_polynomials_are_one_at_one() {
        let mut p = [0.0; DEGREES];
        legendre(1.0, &mut p);
        assert!(p.iter().all(|p| (p - 1.0).abs() < 1e-12), "{p:?}");
    }

    #[test]
    fn low_degrees_match_their_formulas() {
        let mut p = [0.0; 5];
        let x = 0.3;
        legendre(x, &mut p);
        let expected = [
            1.0,
            x,
            (3.0 * x * x - 1.0) / 2.0,
            (5.0 * x * x * x - 3.0 * x) / 2.0,
            (35.0 * x.powi(4) - 30.0 * x * x + 3.0) / 8.0,
        ];
        for (p, e) in p.iter().zip(expected) {
            assert!((p - e).abs() < 1e-15, "{p} {e}");
        }
    }

    #[test]
    fn eight_at_once_are_those_one_by_one() {
        use splitsnow_spectra::simd::Portable;
        let x = [-1.0, -0.7, -0.1, 0.0, 0.2, 0.5, 0.9, 1.0];
        let mut lanes = [F64x8::<Portable>::ZERO; 40];
        legendre_lanes(F64x8::new(x), &mut lanes);
        for (lane, x) in x.into_iter().enumerate() {
            let mut values = [0.0; 40];
            legendre(x, &mut values);
            assert_eq!(lanes.map(|p| p.as_array()[lane]), values, "{x}");
        }
    }
}
