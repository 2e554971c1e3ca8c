//! What the shape of a grain has to tell, and the shapes there are. How to add
//! one: docs/design.md.
//!
//! A body is convex and symmetric about its centre, the origin. Lengths are in
//! units of half the grain's size s, its largest extent in any direction
//! (docs/methods.md, The sample: for a spheroid the major semi-axis b = s/2). Of
//! sphericity Psi, the largest sphere that fits in it has the radius Psi^2
//! (Varsa 2025, eq. 4.2: Psi = sqrt(c/b)).
use splitsnow_spectra::simd::{F64x8, Simd};

use crate::grain::body::Bodies;
#[cfg(doc)]
use crate::grain::spheroid::Spheroid;
use crate::math::{Real, Vec3, Vec3x8};
use crate::rng::{Fingerprint, Stream};

/// The attitude and proportions of a body, in numbers that only its shape
/// reads: three for the attitude and two for the proportions are enough for an
/// ellipsoid or a prism, and fill a row of a table.
pub type Numbers<R> = [R; 5];

/// The downward component of a vector, for one number or for eight. A trait and not a closure,
/// so that it is always inlined.
pub trait Down<R> {
    /// Of a vector in the frame of a body's numbers.
    fn down(&self, vector: [R; 3]) -> R;
}

/// Where the third axis of the frame points down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Upright;

impl<R> Down<R> for Upright {
    #[inline(always)]
    fn down(&self, [_, _, z]: [R; 3]) -> R {
        z
    }
}

/// A shape, with the parameters that all grains of a type have in common. What
/// takes no `self` follows from the numbers of a body alone.
pub trait GrainShape {
    /// Which numbers these are.
    const FORM: Form;

    /// Adds what tells this shape from others to the identity of a snow.
    #[must_use]
    fn identify(&self, digest: Fingerprint) -> Fingerprint;

    /// Surface over volume of a body of sphericity `psi` and full length 1, of
    /// which K2 is a quarter (docs/methods.md, Mean free distance: A(Psi)).
    fn surface_to_volume(&self, psi: f64) -> f64;

    /// Eight bodies of these sphericities in attitudes uniform over all
    /// (docs/methods.md, The grain event).
    fn draw<S: Simd>(&self, psi: F64x8<S>, rng: &mut Stream<S>) -> Numbers<F64x8<S>>;

    /// Points proposed uniformly over the whole surface, and a mask of those to
    /// keep (docs/methods.md, The grain event).
    fn sample<S: Simd>(body: &Numbers<F64x8<S>>, rng: &mut Stream<S>) -> (Vec3x8<S>, F64x8<S>);

    /// Outward normals at points of the surface, of any length.
    fn normal<S: Simd>(body: &Numbers<F64x8<S>>, at: Vec3x8<S>) -> Vec3x8<S>;

    /// Distances from points of the surface along unit directions `d` to the far
    /// surface; not above 0 where `d` points outward (docs/methods.md, The grain event).
    fn chord<S: Simd>(body: &Numbers<F64x8<S>>, at: Vec3x8<S>, d: Vec3x8<S>) -> F64x8<S>;

    /// Half of the vertical extent; `down` gives the downward component of a
    /// vector in the frame of the body's numbers. Decides whether a grain fits
    /// between the planes of a slab (docs/methods.md, The walk).
    fn half_height<R: Real>(body: &Numbers<R>, down: &impl Down<R>) -> R;

    /// A point of the half that faces a ray of direction `d`, uniform over the
    /// area projected along `d`, and the outward normal there, of any length;
    /// `u` and the (sin, cos) of `azimuth` are uniform variates (docs/methods.md,
    /// The grain event, `entry = "projected"`).
    fn projected_point(body: &Numbers<f64>, d: Vec3, u: f64, azimuth: (f64, f64)) -> (Vec3, Vec3);

    /// The same body in a frame turned about z: (x, y) is `(cos x + sin y, cos y - sin x)` there.
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

/// `$work` with the shape of `$shape` as `$law`.
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

/// `$work` with the shape of bodies of `$form` as the type `$G`.
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

// Calls by form. The step of a grain event chooses once for all that is in it.
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
    pub(super) fn normal<S: Simd>(self, body: &Numbers<F64x8<S>>, at: Vec3x8<S>) -> Vec3x8<S> {
        with_form!(self, G => G::normal(body, at))
    }

    #[inline(always)]
    pub(super) fn chord<S: Simd>(
        self,
        body: &Numbers<F64x8<S>>,
        at: Vec3x8<S>,
        d: Vec3x8<S>,
    ) -> F64x8<S> {
        with_form!(self, G => G::chord(body, at, d))
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
