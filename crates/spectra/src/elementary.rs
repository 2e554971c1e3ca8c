//! Exponential and logarithm that give the same bits on every machine. The platform's
//! differ in the last bit, which would change a database's bytes; these also vectorise.
use std::f64::consts::{LN_2, LOG2_E, SQRT_2};

use crate::simd::{F64x8, Simd, U64x8};

/// exp(-x) for x >= 0; 0 beyond 700 and for an infinite x. Relative error
/// below 4e-16 times max(1, x).
#[inline(always)]
#[must_use]
pub fn exp_neg(x: f64) -> f64 {
    // exp(-x) = 2^-k exp(-r), |r| <= ln 2 / 2; adding 1.5 * 2^52 rounds to an integer.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let x = x.min(701.0);
    let shifted = x * LOG2_E + ROUND;
    let k = shifted - ROUND;
    // ln 2 in two parts so that the reduction is exact
    const LN_2_HI: f64 = 0.693_147_180_369_123_8;
    const LN_2_LO: f64 = LN_2 - LN_2_HI + 2.319_046_813_846_299_6e-17;
    let r = (k * LN_2_HI - x) + k * LN_2_LO;
    let mut p = 1.0 / 479_001_600.0;
    p = p * r + 1.0 / 39_916_800.0;
    p = p * r + 1.0 / 3_628_800.0;
    p = p * r + 1.0 / 362_880.0;
    p = p * r + 1.0 / 40_320.0;
    p = p * r + 1.0 / 5_040.0;
    p = p * r + 1.0 / 720.0;
    p = p * r + 1.0 / 120.0;
    p = p * r + 1.0 / 24.0;
    p = p * r + 1.0 / 6.0;
    p = p * r + 0.5;
    p = p * r * r + r + 1.0;
    // 2^-k by subtracting k from the exponent bits of p
    let scaled = f64::from_bits(p.to_bits().wrapping_sub(shifted.to_bits() << 52));
    if x > 700.0 { 0.0 } else { scaled }
}

/// exp(-x) in single precision, for x clamped to 0 to 87 and 0 if it is no
/// number; relative error below
/// 2e-7 times max(1, x). A loop over it vectorises.
#[allow(clippy::manual_clamp)] // `clamp` keeps NaN
#[inline(always)]
#[must_use]
pub fn exp_neg_single(x: f32) -> f32 {
    // as above: adding 1.5 * 2^23 rounds to an integer
    const ROUND: f32 = 12_582_912.0;
    const LN_2_HI: f32 = 0.693_359_4;
    const LN_2_LO: f32 = -2.121_944_4e-4;
    let x = x.max(0.0).min(87.0);
    let shifted = x * std::f32::consts::LOG2_E + ROUND;
    let k = shifted - ROUND;
    let r = (k * LN_2_HI - x) + k * LN_2_LO;
    let mut p = 1.0 / 5_040.0;
    p = p * r + 1.0 / 720.0;
    p = p * r + 1.0 / 120.0;
    p = p * r + 1.0 / 24.0;
    p = p * r + 1.0 / 6.0;
    p = p * r + 0.5;
    p = p * r * r + r + 1.0;
    f32::from_bits(p.to_bits().wrapping_sub(shifted.to_bits() << 23))
}

/// Natural logarithm of normal positive numbers; relative error below 1e-14.
#[inline(always)]
#[must_use]
pub fn ln<S: Simd>(x: F64x8<S>) -> F64x8<S> {
    let bits = x.to_bits();
    // exponent as a float: put it in the low bits of 2^52 and subtract that
    let biased = F64x8::from_bits((bits >> 52) | U64x8::splat(0x4330_0000_0000_0000));
    let exponent = biased - F64x8::splat(4_503_599_627_370_496.0 + 1023.0);
    let mantissa = F64x8::from_bits(
        (bits & U64x8::splat(0x000f_ffff_ffff_ffff)) | U64x8::splat(0x3ff0_0000_0000_0000),
    );
    let high = mantissa.gt(F64x8::splat(SQRT_2));
    let mantissa = high.select(mantissa * F64x8::splat(0.5), mantissa);
    let exponent = high.select(exponent + F64x8::ONE, exponent);
    // ln m = 2 artanh(s), s = (m - 1)/(m + 1), |s| <= 0.172
    let s = (mantissa - F64x8::ONE) / (mantissa + F64x8::ONE);
    let y = s * s;
    let mut p = F64x8::splat(1.0 / 17.0);
    for denominator in [15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0] {
        p = p * y + F64x8::splat(1.0 / denominator);
    }
    let twice = s + s;
    exponent * F64x8::splat(LN_2) + (twice + twice * y * p)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Portable;

    #[test]
    fn exp_neg_is_exp() {
        for i in 0..200_000 {
            let x = f64::from(i) * 0.0035;
            let (ours, exact) = (exp_neg(x), libm::exp(-x));
            assert!(
                (ours / exact - 1.0).abs() < 4e-16 * x.max(1.0),
                "{x}: {ours} {exact}"
            );
        }
        assert_eq!(exp_neg(0.0), 1.0);
        assert_eq!(exp_neg(1e9), 0.0);
        assert_eq!(exp_neg(f64::INFINITY), 0.0);
        assert_eq!(exp_neg(1e-300), 1.0);
    }

    #[test]
    fn single_precision_too() {
        for i in 0..200_000_u32 {
            let x = i as f32 * 4.3e-4;
            let (ours, exact) = (f64::from(exp_neg_single(x)), libm::exp(-f64::from(x)));
            assert!(
                (ours / exact - 1.0).abs() < 2e-7 * f64::from(x.max(1.0)),
                "{x}: {ours} {exact}"
            );
        }
        assert_eq!(exp_neg_single(0.0), 1.0);
        assert_eq!(exp_neg_single(-3.0), 1.0);
        assert_eq!(exp_neg_single(f32::NAN), 1.0);
        assert!((0.0..2e-38).contains(&exp_neg_single(1e30)));
    }

    #[test]
    fn ln_is_ln() {
        for i in 1..100_000 {
            let x = f64::from(i) * 1.7e-5;
            for x in [x, x * 1e-9, x * 1e12, 1.0 - x * 1e-6] {
                let (ours, exact) = (ln::<Portable>(F64x8::splat(x)).to_array()[3], libm::log(x));
                assert!(
                    (ours - exact).abs() <= 1e-14 * exact.abs() + 1e-300,
                    "{x}: {ours} {exact}"
                );
            }
        }
        assert_eq!(ln::<Portable>(F64x8::ONE).to_array()[0], 0.0);
    }
}
