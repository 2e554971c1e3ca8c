//! Prolate spheroids (docs/methods.md; Varsa 2025, eq. 4.2).
//!
//! With c the minor semi-axis in units of the major one, K = c^2 - 1 and a the axis, the
//! surface is |x|^2 + K (x.a)^2 = c^2 and the normal at x is along x + K (x.a) a. The
//! numbers of a body are a, K and c. For a sphere K = 0, and a and c do not matter.
use splitsnow_spectra::simd::{F64x8, Simd};

use crate::grain::body::Body;
use crate::grain::shape::{Down, Form, GrainShape, Numbers};
use crate::math::{Real, Vec3, Vec3x8};
use crate::rng::{Fingerprint, Stream};

/// The shape of Varsa 2025. Its only parameter is the sphericity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spheroid;

impl Spheroid {
    /// The spheroid with minor semi-axis `minor` = Psi^2 and the unit vector `axis` along the
    /// major axis.
    #[must_use]
    pub fn body(minor: f64, axis: Vec3) -> Body<f64> {
        Body {
            form: Form::Spheroid,
            numbers: [axis.x, axis.y, axis.z, minor * minor - 1.0, minor],
        }
    }

    /// The axis and K.
    #[inline(always)]
    #[must_use]
    pub fn parts([x, y, z, flattening, _]: &Numbers<f64>) -> (Vec3, f64) {
        (Vec3::new(*x, *y, *z), *flattening)
    }
}

/// The axes and K of eight bodies.
#[inline(always)]
pub(super) fn parts<S: Simd>(
    [x, y, z, flattening, _]: &Numbers<F64x8<S>>,
) -> (Vec3x8<S>, F64x8<S>) {
    (Vec3x8::new(*x, *y, *z), *flattening)
}

impl GrainShape for Spheroid {
    const FORM: Form = Form::Spheroid;

    /// Adds nothing: the random numbers of spheroids predate the other shapes.
    fn identify(&self, digest: Fingerprint) -> Fingerprint {
        digest
    }

    /// 3 (1 + asin(e) / (Psi^2 e)), e = sqrt(1 - Psi^4); 6 for the sphere.
    fn surface_to_volume(&self, psi: f64) -> f64 {
        let e = (1.0 - psi.powi(4)).max(0.0).sqrt();
        let ratio = if e < 1e-4 {
            1.0 + e * e / 6.0
        } else {
            libm::asin(e) / e
        };
        3.0 * (1.0 + ratio / (psi * psi))
    }

    fn inscribed(&self, psi: f64) -> f64 {
        psi * psi
    }

    #[inline(always)]
    fn draw<S: Simd>(&self, psi: F64x8<S>, rng: &mut Stream<S>) -> Numbers<F64x8<S>> {
        let minor = psi * psi;
        let Vec3x8 { x, y, z } = rng.direction();
        [x, y, z, minor * minor - F64x8::ONE, minor]
    }

    #[inline(always)]
    fn sample<S: Simd>(body: &Numbers<F64x8<S>>, rng: &mut Stream<S>) -> (Vec3x8<S>, F64x8<S>) {
        // A point of the unit sphere, stretched. The area it represents is scaled by
        // sqrt(1 + K u^2), at most 1, where u is its component along the axis.
        let ((axis, flattening), minor) = (parts(body), body[4]);
        let p = rng.direction();
        let u = p.dot(axis);
        let r = rng.uniform();
        let kept = (r * r).lt(F64x8::ONE + flattening * u * u);
        ((p * minor).plus((F64x8::ONE - minor) * u, axis), kept)
    }

    #[inline(always)]
    fn normal<S: Simd>(body: &Numbers<F64x8<S>>, point: Vec3x8<S>) -> Vec3x8<S> {
        let (axis, flattening) = parts(body);
        point.plus(flattening * point.dot(axis), axis)
    }

    #[inline(always)]
    fn chord<S: Simd>(body: &Numbers<F64x8<S>>, point: Vec3x8<S>, d: Vec3x8<S>) -> F64x8<S> {
        let (axis, flattening) = parts(body);
        let u = d.dot(axis);
        F64x8::splat(-2.0) * Self::normal(body, point).dot(d) / (F64x8::ONE + flattening * u * u)
    }

    /// sqrt(c^2 (1 - a_z^2) + a_z^2).
    #[inline(always)]
    fn half_height<R: Real>([x, y, z, flattening, _]: &Numbers<R>, down: &impl Down<R>) -> R {
        let axis = down.down([*x, *y, *z]);
        let square = R::ONE + *flattening * (R::ONE - axis * axis);
        square.max(R::ZERO).sqrt()
    }

    #[inline(always)]
    fn turned([x, y, z, flattening, minor]: &Numbers<f64>, cos: f64, sin: f64) -> Numbers<f64> {
        let turned = [cos * x + sin * y, cos * y - sin * x];
        [turned[0], turned[1], *z, *flattening, *minor]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grain::{Bodies, Shape, Upright};
    use crate::rng::Key;

    fn rng() -> Stream {
        Stream::new(Key {
            seed: 7,
            cell: 0,
            purpose: [0; 3],
            batch: 0,
        })
    }

    /// Residual of the surface equation: (x.a)^2 + |x - (x.a) a|^2 / c^2 - 1.
    fn surface_residual(flattening: f64, axis: Vec3, x: Vec3) -> f64 {
        let u = x.dot(axis);
        (u * u + (x.dot(x) - u * u) / (1.0 + flattening) - 1.0).abs()
    }

    #[test]
    fn points_and_chords_lie_on_the_surface() {
        let mut rng = rng();
        for psi in [0.05f64, 0.3, 0.8, 1.0] {
            for _ in 0..2000 {
                let s = Shape::Spheroid.draw(F64x8::splat(psi), &mut rng);
                let d = rng.direction();
                let (x, _) = s.sample(&mut rng);
                let far = x.plus(s.chord(x, d), d);
                for lane in 0..8 {
                    let body = s.get(lane);
                    let (axis, k) = Spheroid::parts(&body.numbers);
                    // unit vectors are accurate to 3e-14; dividing by c^2 = Psi^4 magnifies that
                    let rounding = 3e-13 / psi.powi(4);
                    assert!(surface_residual(k, axis, x.get(lane)) < rounding);
                    assert!(surface_residual(k, axis, far.get(lane)) < rounding);
                    assert!(x.get(lane).z.abs() <= body.half_height(&Upright) + 1e-12);
                }
            }
        }
    }

    #[test]
    fn sampled_points_reach_the_half_height() {
        let mut rng = rng();
        let body = Spheroid::body(0.36, Vec3::new(0.48, 0.6, 0.64));
        let s = Bodies::splat(&body);
        let top = body.half_height(&Upright);
        assert_eq!(s.half_height(&Upright).to_array(), [top; 8]);
        let mut highest = 0f64;
        for _ in 0..50_000 {
            highest = highest.max(s.sample(&mut rng).0.get(0).z);
        }
        assert!(
            highest <= top + 1e-12 && highest > 0.999 * top,
            "{highest} {top}"
        );
    }
    #[test]
    fn surface_to_volume_has_the_right_limits() {
        let surface_to_volume = |psi| Spheroid.surface_to_volume(psi);
        assert!((surface_to_volume(1.0) - 6.0).abs() < 1e-12);
        assert!((surface_to_volume(1.0 - 1e-9) - 6.0).abs() < 1e-6);
        // a thin needle: S/V -> 3 pi / (2 Psi^2)
        let psi: f64 = 0.01;
        let needle = 1.5 * std::f64::consts::PI / (psi * psi);
        assert!((surface_to_volume(psi) / needle - 1.0).abs() < 1e-3);
    }
}
