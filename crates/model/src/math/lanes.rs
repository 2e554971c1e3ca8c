//! Vectors of eight f64 and their elementary functions, for eight walks side by side. No
//! operation is fused, so results are bitwise identical on all machines.
use std::f64::consts::FRAC_PI_4;
use std::ops::{Add, Mul};

use splitsnow_spectra::simd::{F64x8, Portable, Simd};

/// The lanes whose bits are set in a mask.
pub(crate) fn set_lanes(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = mask.trailing_zeros() as usize;
        mask &= mask.wrapping_sub(1);
        (lane < 8).then_some(lane)
    })
}

/// Eight three-vectors.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Vec3x8<S: Simd = Portable> {
    /// First horizontal components.
    pub x: F64x8<S>,
    /// Second horizontal components.
    pub y: F64x8<S>,
    /// Depth components.
    pub z: F64x8<S>,
}

impl<S: Simd> Vec3x8<S> {
    /// The vectors (x, y, z).
    #[inline(always)]
    #[must_use]
    pub fn new(x: F64x8<S>, y: F64x8<S>, z: F64x8<S>) -> Self {
        Self { x, y, z }
    }

    /// Scalar products.
    #[inline(always)]
    #[must_use]
    pub fn dot(self, o: Self) -> F64x8<S> {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    /// `self + s * o`.
    #[inline(always)]
    #[must_use]
    pub fn plus(self, s: F64x8<S>, o: Self) -> Self {
        Self::new(self.x + s * o.x, self.y + s * o.y, self.z + s * o.z)
    }

    /// Unit vectors in the same directions.
    #[inline(always)]
    #[must_use]
    pub fn unit(self) -> Self {
        self * (F64x8::ONE / self.dot(self).sqrt())
    }

    /// `self` where `mask` is set, `o` elsewhere.
    #[inline(always)]
    #[must_use]
    pub fn or_where_not(self, mask: F64x8<S>, o: Self) -> Self {
        Self::new(
            mask.select(self.x, o.x),
            mask.select(self.y, o.y),
            mask.select(self.z, o.z),
        )
    }

    /// Two unit vectors that complete each unit vector to an orthonormal frame
    /// (Duff et al. 2017, JCGT 6(1)).
    #[inline(always)]
    #[must_use]
    pub fn frame(self) -> (Self, Self) {
        let sign = F64x8::ONE | (self.z & F64x8::splat(-0.0));
        let a = -F64x8::ONE / (sign + self.z);
        let b = self.x * self.y * a;
        (
            Self::new(
                F64x8::ONE + sign * self.x * self.x * a,
                sign * b,
                -sign * self.x,
            ),
            Self::new(b, sign + self.y * self.y * a, -self.y),
        )
    }

    /// Writes one lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, v: super::Vec3) {
        self.x.as_mut_array()[lane] = v.x;
        self.y.as_mut_array()[lane] = v.y;
        self.z.as_mut_array()[lane] = v.z;
    }

    /// Reads one lane.
    #[inline(always)]
    #[must_use]
    pub fn get(&self, lane: usize) -> super::Vec3 {
        super::Vec3::new(
            self.x.as_array()[lane],
            self.y.as_array()[lane],
            self.z.as_array()[lane],
        )
    }
}

impl<S: Simd> Add for Vec3x8<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self::new(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}

impl<S: Simd> Mul<F64x8<S>> for Vec3x8<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: F64x8<S>) -> Self {
        Self::new(self.x * s, self.y * s, self.z * s)
    }
}

/// (sin, cos) of `t * pi / 4` for t in [-1, 1], with an absolute error below 3e-14.
#[inline(always)]
#[must_use]
pub fn sincos_eighth<S: Simd>(t: F64x8<S>) -> (F64x8<S>, F64x8<S>) {
    let x = t * F64x8::splat(FRAC_PI_4);
    let y = x * x;
    let mut s = F64x8::splat(1.0 / 6_227_020_800.0);
    for c in [
        -1.0 / 39_916_800.0,
        1.0 / 362_880.0,
        -1.0 / 5_040.0,
        1.0 / 120.0,
        -1.0 / 6.0,
    ] {
        s = s * y + F64x8::splat(c);
    }
    let mut c = F64x8::splat(-1.0 / 87_178_291_200.0);
    for k in [
        1.0 / 479_001_600.0,
        -1.0 / 3_628_800.0,
        1.0 / 40_320.0,
        -1.0 / 720.0,
        1.0 / 24.0,
        -0.5,
    ] {
        c = c * y + F64x8::splat(k);
    }
    (x + x * y * s, F64x8::ONE + y * c)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sincos_eighth_matches_libm() {
        for i in -1000..=1000 {
            let t = f64::from(i) / 1000.0;
            let (s, c) = sincos_eighth::<Portable>(F64x8::splat(t));
            assert!((s.to_array()[0] - libm::sin(t * FRAC_PI_4)).abs() < 3e-14);
            assert!((c.to_array()[0] - libm::cos(t * FRAC_PI_4)).abs() < 3e-14);
        }
    }

    #[test]
    fn frames_are_orthonormal() {
        for v in [
            (0.0, 0.0, 1.0),
            (0.0, 0.0, -1.0),
            (1.0, 0.0, 0.0),
            (0.3, -0.5, -0.2),
        ] {
            let n: Vec3x8 =
                Vec3x8::new(F64x8::splat(v.0), F64x8::splat(v.1), F64x8::splat(v.2)).unit();
            let (t, b) = n.frame();
            for (p, q, e) in [
                (n, t, 0.0),
                (n, b, 0.0),
                (t, b, 0.0),
                (t, t, 1.0),
                (b, b, 1.0),
            ] {
                assert!((p.dot(q).to_array()[0] - e).abs() < 1e-15, "{v:?}");
            }
        }
    }
}
