//! Oblate spheroids (docs/methods.md, Shapes).
//!
//! With c the polar semi-axis in units of the equatorial one, K = 1/c^2 - 1 and a the axis,
//! the surface is |x|^2 + K (x.a)^2 = 1 and the normal at x is along x + K (x.a) a. The
//! numbers of a body are a, K and c.
use splitsnow_spectra::simd::{F64x8, Simd};

use crate::grain::shape::{Down, Form, GrainShape, Numbers};
use crate::grain::spheroid::{self, Spheroid};
use crate::math::{Real, Vec3x8};
use crate::rng::{Fingerprint, Stream};

/// Spheroids of sphericity Psi = sqrt(c), flattened along their axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Oblate;

impl GrainShape for Oblate {
    const FORM: Form = Form::Oblate;

    fn identify(&self, digest: Fingerprint) -> Fingerprint {
        digest.and_text("oblate")
    }

    /// 3 (1/c + c atanh(e) / e), with e = sqrt(1 - c^2); 6 for the sphere.
    fn surface_to_volume(&self, psi: f64) -> f64 {
        let c = psi * psi;
        let e = (1.0 - c * c).max(0.0).sqrt();
        let ratio = if e < 1e-4 {
            1.0 + e * e / 3.0
        } else {
            libm::atanh(e) / e
        };
        3.0 * (1.0 / c + c * ratio)
    }

    fn inscribed(&self, psi: f64) -> f64 {
        psi * psi
    }

    #[inline(always)]
    fn draw<S: Simd>(&self, psi: F64x8<S>, rng: &mut Stream<S>) -> Numbers<F64x8<S>> {
        let (axis, polar) = (rng.direction(), psi * psi);
        let flattening = F64x8::ONE / (polar * polar) - F64x8::ONE;
        [axis.x, axis.y, axis.z, flattening, polar]
    }

    /// Points of the sphere, flattened. The area per area of the sphere is at most 1.
    #[inline(always)]
    fn sample<S: Simd>(body: &Numbers<F64x8<S>>, rng: &mut Stream<S>) -> (Vec3x8<S>, F64x8<S>) {
        let (axis, _) = spheroid::parts(body);
        let polar = body[4];
        let p = rng.direction();
        let u = p.dot(axis);
        let r = rng.uniform();
        let area = polar * polar + (F64x8::ONE - polar * polar) * u * u;
        (p.plus((polar - F64x8::ONE) * u, axis), (r * r).lt(area))
    }

    #[inline(always)]
    fn normal<S: Simd>(body: &Numbers<F64x8<S>>, point: Vec3x8<S>) -> Vec3x8<S> {
        Spheroid::normal(body, point)
    }

    #[inline(always)]
    fn chord<S: Simd>(body: &Numbers<F64x8<S>>, point: Vec3x8<S>, d: Vec3x8<S>) -> F64x8<S> {
        Spheroid::chord(body, point, d)
    }

    /// sqrt(1 - a_z^2 + c^2 a_z^2).
    #[inline(always)]
    fn half_height<R: Real>([x, y, z, _, polar]: &Numbers<R>, down: &impl Down<R>) -> R {
        let axis = down.down([*x, *y, *z]);
        let square = R::ONE - (R::ONE - *polar * *polar) * axis * axis;
        square.max(R::ZERO).sqrt()
    }

    #[inline(always)]
    fn turned(body: &Numbers<f64>, cos: f64, sin: f64) -> Numbers<f64> {
        Spheroid::turned(body, cos, sin)
    }
}
