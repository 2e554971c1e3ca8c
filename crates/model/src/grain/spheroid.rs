//! Prolate spheroids in the way of rays: shape, attitude, and the points where
//! they are met (docs/methods.md), eight at once.
//!
//! Lengths are in units of the major semi-axis b = s/2; the centre is the
//! origin. With c the minor semi-axis, K = c^2 - 1 and a the axis, the surface
//! is |x|^2 + K (x.a)^2 = c^2 and the normal at x is along x + K (x.a) a.
use wide::f64x8;

use crate::math::{Vec3, Vec3x8};
use crate::rng::Stream;

/// Eight spheroids with major semi-axis 1.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Spheroids {
    /// Unit vectors along the major axes.
    pub axis: Vec3x8,
    /// K = c^2 - 1, in (-1, 0].
    pub flattening: f64x8,
}

impl Spheroids {
    /// Spheroids of minor semi-axis `minor` = Psi^2 (Varsa 2025, eq. 4.2).
    #[inline(always)]
    #[must_use]
    pub fn new(minor: f64x8, axis: Vec3x8) -> Self {
        Self {
            axis,
            flattening: minor * minor - f64x8::ONE,
        }
    }

    /// Outward normals at surface points `x`, not of unit length.
    #[inline(always)]
    #[must_use]
    pub fn normal(&self, x: Vec3x8) -> Vec3x8 {
        x.plus(self.flattening * x.dot(self.axis), self.axis)
    }

    /// Distances along unit directions `d` from surface points with
    /// unnormalised normals `n` to the far surface; <= 0 where `d` points outward.
    #[inline(always)]
    #[must_use]
    pub fn chord(&self, n: Vec3x8, d: Vec3x8) -> f64x8 {
        let u = d.dot(self.axis);
        f64x8::splat(-2.0) * n.dot(d) / (f64x8::ONE + self.flattening * u * u)
    }

    /// Points proposed uniformly over the whole surface, and which to keep.
    #[inline(always)]
    pub fn propose_point(&self, minor: f64x8, rng: &mut Stream) -> (Vec3x8, f64x8) {
        // A point of the unit sphere, stretched; the area it stands for grows
        // by sqrt(1 + K u^2), at most 1, with u its component along the axis.
        let p = rng.direction();
        let u = p.dot(self.axis);
        let r = rng.uniform();
        let kept = (r * r).simd_lt(f64x8::ONE + self.flattening * u * u);
        ((p * minor).plus((f64x8::ONE - minor) * u, self.axis), kept)
    }
}

/// Half of the extent along z of a spheroid with major semi-axis 1.
#[inline]
#[must_use]
pub fn half_height(flattening: f64, axis: Vec3) -> f64 {
    // c^2 (1 - a_z^2) + a_z^2
    (1.0 + flattening * (1.0 - axis.z * axis.z)).sqrt()
}

/// A point of the half that faces a ray of direction `d`, uniform over the
/// area projected along `d`; `u` and `(sin, cos)` are a uniform variate and a
/// uniform azimuth.
#[must_use]
pub fn projected_point(flattening: f64, axis: Vec3, d: Vec3, u: f64, azimuth: (f64, f64)) -> Vec3 {
    // Stretching is linear, so it keeps uniformity over the projected disc:
    // take a point of the disc of the unit sphere that the ray would see.
    let minor = (1.0 + flattening).sqrt();
    let stretch = |v: Vec3, across: f64| (v * across).plus((1.0 - across) * v.dot(axis), axis);
    let w = stretch(d, 1.0 / minor);
    let w = w * (1.0 / w.dot(w).sqrt());
    let (t1, t2) = w.frame();
    let r = u.sqrt();
    let p = (t1 * (r * azimuth.1))
        .plus(r * azimuth.0, t2)
        .plus(-(1.0 - u).sqrt(), w);
    stretch(p, minor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;

    fn rng() -> Stream {
        Stream::new(Key {
            seed: 7,
            cell: 0,
            purpose: [0; 3],
            batch: 0,
        })
    }

    /// How far `x` is from the surface: (x.a)^2 + |x - (x.a) a|^2 / c^2 - 1.
    fn off_surface(flattening: f64, axis: Vec3, x: Vec3) -> f64 {
        let u = x.dot(axis);
        (u * u + (x.dot(x) - u * u) / (1.0 + flattening) - 1.0).abs()
    }

    #[test]
    fn points_and_chords_lie_on_the_surface() {
        let mut rng = rng();
        for psi in [0.05f64, 0.3, 0.8, 1.0] {
            let minor = f64x8::splat(psi * psi);
            for _ in 0..2000 {
                let s = Spheroids::new(minor, rng.direction());
                let d = rng.direction();
                let (x, _) = s.propose_point(minor, &mut rng);
                let n = s.normal(x);
                let far = x.plus(s.chord(n, d), d);
                let k = s.flattening.to_array()[0];
                for lane in 0..8 {
                    let axis = s.axis.get(lane);
                    // unit vectors are good to 3e-14; dividing by c^2 = Psi^4 magnifies that
                    let rounding = 3e-13 / psi.powi(4);
                    assert!(off_surface(k, axis, x.get(lane)) < rounding);
                    assert!(off_surface(k, axis, far.get(lane)) < rounding);
                    assert!(x.get(lane).z.abs() <= half_height(k, axis) + 1e-12);
                    let azimuth = (0.6, 0.8);
                    let p = projected_point(k, axis, d.get(lane), 0.3, azimuth);
                    assert!(off_surface(k, axis, p) < rounding);
                    let normal = p.plus(k * p.dot(axis), axis);
                    assert!(normal.dot(d.get(lane)) < 0.0);
                }
            }
        }
    }

    #[test]
    fn half_height_is_reached() {
        let mut rng = rng();
        let minor = f64x8::splat(0.36);
        let axis = Vec3x8::new(f64x8::splat(0.48), f64x8::splat(0.6), f64x8::splat(0.64));
        let s = Spheroids::new(minor, axis);
        let top = half_height(s.flattening.to_array()[0], axis.get(0));
        let mut highest = 0f64;
        for _ in 0..50_000 {
            highest = highest.max(s.propose_point(minor, &mut rng).0.get(0).z);
        }
        assert!(
            highest <= top + 1e-12 && highest > 0.999 * top,
            "{highest} {top}"
        );
    }
}
