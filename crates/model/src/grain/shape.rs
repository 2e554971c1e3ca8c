//! The interface of grain shapes, and the available shapes. How to add one:
//! docs/design.md.
//!
//! A body is convex and symmetric about its centre, the origin. Lengths are in units of
//! half the grain size s, its largest extent in any direction (docs/methods.md, The
//! sample: for a spheroid the major semi-axis b = s/2). In a body of sphericity Psi, the
//! largest inscribed sphere has the radius Psi^2 (Varsa 2025, eq. 4.2: Psi = sqrt(c/b)).
use splitsnow_spectra::simd::{F64x8, Simd};

use crate::grain::body::Bodies;
#[cfg(doc)]
use crate::grain::spheroid::Spheroid;
use crate::math::{Real, Vec3, Vec3x8};
use crate::rng::{Fingerprint, Stream};

/// Orientation and proportions of a body. Only its shape interprets these numbers. Three
/// for the orientation and two for the proportions suffice for an ellipsoid or a prism and
/// fill a row of a table.
pub type Numbers<R> = [R; 5];

/// The downward component of a vector, for one number or eight. A trait instead of a
/// closure, so that it is always inlined.
pub trait Down<R> {
    /// Downward component of a vector in the frame of a body's numbers.
    fn down(&self, vector: [R; 3]) -> R;
}

/// A frame whose third axis points down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Upright;

impl<R> Down<R> for Upright {
    #[inline(always)]
    fn down(&self, [_, _, z]: [R; 3]) -> R {
        z
    }
}

/// A shape, with the parameters that all grains of a type share. Functions without `self`
/// depend only on the numbers of a body.
pub trait GrainShape {
    /// The form that these bodies have.
    const FORM: Form;

    /// Adds the parameters of this shape to the identity of a snow.
    #[must_use]
    fn identify(&self, digest: Fingerprint) -> Fingerprint;

    /// Surface-to-volume ratio of a body of sphericity `psi` and full length 1. K2 is a
    /// quarter of it (docs/methods.md, Mean free distance: A(Psi)).
    fn surface_to_volume(&self, psi: f64) -> f64;

    /// Eight bodies of these sphericities with isotropic orientations (docs/methods.md, The
    /// grain event).
    fn draw<S: Simd>(&self, psi: F64x8<S>, rng: &mut Stream<S>) -> Numbers<F64x8<S>>;

    /// Proposes points uniform over the whole surface. The mask selects those to keep
    /// (docs/methods.md, The grain event).
    fn sample<S: Simd>(body: &Numbers<F64x8<S>>, rng: &mut Stream<S>) -> (Vec3x8<S>, F64x8<S>);

    /// Outward normals at points of the surface, not normalised.
    fn normal<S: Simd>(body: &Numbers<F64x8<S>>, point: Vec3x8<S>) -> Vec3x8<S>;

    /// Distances from points of the surface along unit directions `d` to the far surface; 0
    /// or negative if `d` points outward (docs/methods.md, The grain event).
    fn chord<S: Simd>(body: &Numbers<F64x8<S>>, point: Vec3x8<S>, d: Vec3x8<S>) -> F64x8<S>;

    /// Half of the vertical extent. `down` gives the downward component of a vector in the
    /// frame of the body's numbers. It determines whether a grain fits between the planes of
    /// a slab (docs/methods.md, The walk).
    fn half_height<R: Real>(body: &Numbers<R>, down: &impl Down<R>) -> R;

    /// A point of the half that faces a ray of direction `d`, uniform over the area projected
    /// along `d`, and the outward normal there, not normalised. `u` is a uniform variate and
    /// `azimuth` the (sin, cos) of a uniform angle (docs/methods.md, The grain event,
    /// `entry = "projected"`).
    fn projected_point(body: &Numbers<f64>, d: Vec3, u: f64, azimuth: (f64, f64)) -> (Vec3, Vec3);

    /// The same body in a frame rotated about z, where (x, y) becomes
    /// `(cos x + sin y, cos y - sin x)`.
    fn turned(body: &Numbers<f64>, cos: f64, sin: f64) -> Numbers<f64>;
}

/// The shape of the grains of a type.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Shape {
    /// See [`Spheroid`].
    #[default]
    Spheroid,
}

/// The shape of a body, without the parameters of its type of grain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Form {
    /// See [`Spheroid`].
    #[default]
    Spheroid,
}

/// Evaluates `$work` with the shape of `$shape` bound to `$law`.
macro_rules! with_law {
    ($shape:expr, $law:ident => $work:expr) => {
        match $shape {
            $crate::grain::Shape::Spheroid => {
                let $law = &$crate::grain::Spheroid;
                $work
            }
        }
    };
}
pub(super) use with_law;

/// Evaluates `$work` with the type `$G` of the shape of bodies of `$form`.
macro_rules! with_form {
    ($form:expr, $G:ident => $work:expr) => {
        match $form {
            $crate::grain::Form::Spheroid => {
                type $G = $crate::grain::Spheroid;
                $work
            }
        }
    };
}
pub(super) use with_form;

impl Shape {
    /// See [`GrainShape::identify`].
    #[must_use]
    pub fn identify(&self, digest: Fingerprint) -> Fingerprint {
        with_law!(self, law => law.identify(digest))
    }

    /// See [`GrainShape::surface_to_volume`].
    #[must_use]
    pub fn surface_to_volume(&self, psi: f64) -> f64 {
        with_law!(self, law => law.surface_to_volume(psi))
    }

    /// See [`GrainShape::draw`].
    #[inline(always)]
    pub fn draw<S: Simd>(&self, psi: F64x8<S>, rng: &mut Stream<S>) -> Bodies<S> {
        fn form<G: GrainShape>(_: &G) -> Form {
            G::FORM
        }
        with_law!(self, law => Bodies::new([form(law); 8], law.draw(psi, rng)))
    }
}

// Dispatch by form. The step of a grain event dispatches once for all of its calls.
impl Form {
    #[inline(always)]
    pub(super) fn sample<S: Simd>(
        self,
        body: &Numbers<F64x8<S>>,
        rng: &mut Stream<S>,
    ) -> (Vec3x8<S>, F64x8<S>) {
        with_form!(self, G => G::sample(body, rng))
    }

    #[inline(always)]
    pub(super) fn normal<S: Simd>(self, body: &Numbers<F64x8<S>>, point: Vec3x8<S>) -> Vec3x8<S> {
        with_form!(self, G => G::normal(body, point))
    }

    #[inline(always)]
    pub(super) fn chord<S: Simd>(
        self,
        body: &Numbers<F64x8<S>>,
        point: Vec3x8<S>,
        d: Vec3x8<S>,
    ) -> F64x8<S> {
        with_form!(self, G => G::chord(body, point, d))
    }

    #[inline(always)]
    pub(super) fn half_height<R: Real>(self, body: &Numbers<R>, down: &impl Down<R>) -> R {
        with_form!(self, G => G::half_height(body, down))
    }

    #[inline(always)]
    pub(super) fn projected_point(
        self,
        body: &Numbers<f64>,
        d: Vec3,
        u: f64,
        azimuth: (f64, f64),
    ) -> (Vec3, Vec3) {
        with_form!(self, G => G::projected_point(body, d, u, azimuth))
    }

    #[inline(always)]
    pub(super) fn turned(self, body: &Numbers<f64>, cos: f64, sin: f64) -> Numbers<f64> {
        with_form!(self, G => G::turned(body, cos, sin))
    }
}
