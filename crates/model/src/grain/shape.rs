//! The interface of grain shapes, and the available shapes. How to add one:
//! docs/design.md.
//!
//! A body is convex and symmetric about its centre, the origin. Lengths are in units of
//! half the grain size s, its largest extent in any direction (docs/methods.md, The
//! sample: for a spheroid the major semi-axis b = s/2). One number gives the proportions of a
//! body: the sphericity Psi of a spheroid, in which the largest inscribed sphere has the
//! radius Psi^2 (Varsa 2025, eq. 4.2: Psi = sqrt(c/b)), or the aspect ratio of a prism.
use splitsnow_spectra::simd::{F64x8, Simd};

use crate::grain::body::Bodies;
#[cfg(doc)]
use crate::grain::{Hexagonal, Oblate, Spheroid};
use crate::math::{Real, Vec3x8};
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

    /// Surface-to-volume ratio of a body of this proportion and full length 1. K2 is a
    /// quarter of it (docs/methods.md, Mean free distance: A(Psi)).
    fn surface_to_volume(&self, proportion: f64) -> f64;

    /// Radius of the largest sphere in a body of this proportion.
    fn inscribed(&self, proportion: f64) -> f64;

    /// Eight bodies of these proportions with isotropic orientations (docs/methods.md, The
    /// grain event).
    fn draw<S: Simd>(&self, proportion: F64x8<S>, rng: &mut Stream<S>) -> Numbers<F64x8<S>>;

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
    /// See [`Oblate`].
    Oblate,
    /// See [`Hexagonal`].
    Hexagonal,
}

/// The shape of a body, without the parameters of its type of grain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Form {
    /// See [`Spheroid`].
    #[default]
    Spheroid,
    /// See [`Oblate`].
    Oblate,
    /// See [`Hexagonal`].
    Hexagonal,
}

/// Evaluates `$work` with the shape of `$shape` bound to `$law`.
macro_rules! with_law {
    ($shape:expr, $law:ident => $work:expr) => {
        match $shape {
            $crate::grain::Shape::Spheroid => {
                let $law = &$crate::grain::Spheroid;
                $work
            }
            $crate::grain::Shape::Oblate => {
                let $law = &$crate::grain::Oblate;
                $work
            }
            $crate::grain::Shape::Hexagonal => {
                let $law = &$crate::grain::Hexagonal;
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
            $crate::grain::Form::Oblate => {
                type $G = $crate::grain::Oblate;
                $work
            }
            $crate::grain::Form::Hexagonal => {
                type $G = $crate::grain::Hexagonal;
                $work
            }
        }
    };
}

impl Shape {
    /// All shapes.
    pub const ALL: [Self; 3] = [Self::Spheroid, Self::Oblate, Self::Hexagonal];

    /// The name used in configs and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Spheroid => "spheroid",
            Self::Oblate => "oblate",
            Self::Hexagonal => "hexagonal",
        }
    }

    /// Whether the proportion of these bodies is an aspect ratio instead of a sphericity.
    #[must_use]
    pub const fn has_aspect_ratio(self) -> bool {
        matches!(self, Self::Hexagonal)
    }

    /// See [`GrainShape::identify`].
    #[must_use]
    pub fn identify(&self, digest: Fingerprint) -> Fingerprint {
        with_law!(self, law => law.identify(digest))
    }

    /// See [`GrainShape::surface_to_volume`].
    #[must_use]
    pub fn surface_to_volume(&self, proportion: f64) -> f64 {
        with_law!(self, law => law.surface_to_volume(proportion))
    }

    /// See [`GrainShape::inscribed`].
    #[must_use]
    pub fn inscribed(&self, proportion: f64) -> f64 {
        with_law!(self, law => law.inscribed(proportion))
    }

    /// See [`GrainShape::draw`].
    #[inline(always)]
    pub fn draw<S: Simd>(&self, proportion: F64x8<S>, rng: &mut Stream<S>) -> Bodies<S> {
        fn form<G: GrainShape>(_: &G) -> Form {
            G::FORM
        }
        with_law!(self, law => Bodies::new([form(law); 8], law.draw(proportion, rng)))
    }
}

// Dispatch by form.
impl Form {
    /// All forms. Bodies of other forms would have no normals, chords and heights.
    pub(crate) const ALL: [Self; 3] = [Self::Spheroid, Self::Oblate, Self::Hexagonal];

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
    pub(super) fn turned(self, body: &Numbers<f64>, cos: f64, sin: f64) -> Numbers<f64> {
        with_form!(self, G => G::turned(body, cos, sin))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grain::{Bodies, Upright};
    use crate::rng::Key;

    /// Sums over points uniform on the surfaces of bodies of every shape, against volume and
    /// surface: the mean of x.n is 3 V / S (divergence theorem), and that of the normal is 0.
    /// Chords weighted by |n.d| have the mean 4 V / S (Cauchy). Chords end on the surface.
    /// No point is above the half height, and its mean over the orientations is half of the mean
    /// width. Limits are those of 4 standard errors.
    #[test]
    fn points_normals_and_chords_agree_with_volume_and_surface() {
        let mut rng = Stream::<splitsnow_spectra::simd::Portable>::new(Key {
            seed: 9,
            cell: 0,
            purpose: [0; 3],
            batch: 0,
        });
        for shape in Shape::ALL {
            for proportion in [0.25, 0.7, 1.0, 3.0] {
                if proportion > 1.0 && !shape.has_aspect_ratio() {
                    continue;
                }
                let label = format!("{} {proportion}", shape.name());
                let expected = 2.0 / shape.surface_to_volume(proportion);
                let mut count = 0.0;
                let [mut outward, mut chords, mut heights] = [[0.0f64; 2]; 3];
                let add = |[sum, squares]: &mut [f64; 2], value: f64| {
                    *sum += value;
                    *squares += value * value;
                };
                let (mut sum, mut nearest) = (Vec3x8::default(), f64::INFINITY);
                for _ in 0..60 {
                    let bodies = shape.draw(F64x8::splat(proportion), &mut rng);
                    let tops = bodies.half_height(&Upright).to_array();
                    tops.iter().for_each(|top| add(&mut heights, *top));
                    let mut highest = [0.0f64; 8];
                    for _ in 0..400 {
                        let (mut point, mut kept) = bodies.sample(&mut rng);
                        while (!kept).any() {
                            let (another, keep) = bodies.sample(&mut rng);
                            point = point.or_where_not(kept, another);
                            kept |= keep;
                        }
                        let normal = bodies.normal(point).unit();
                        sum = sum.plus(F64x8::ONE, normal);
                        let d = rng.direction();
                        let cos = normal.dot(d);
                        let d = (d * -F64x8::ONE).or_where_not(cos.gt(F64x8::ZERO), d);
                        let chord = bodies.chord(point, d);
                        let far = point.plus(chord, d);
                        let behind = bodies.chord(far, d * -F64x8::ONE);
                        for (lane, highest) in highest.iter_mut().enumerate() {
                            let get = |v: F64x8| v.to_array()[lane];
                            count += 1.0;
                            add(&mut outward, get(point.dot(normal)));
                            add(&mut chords, get(chord) * get(cos).abs());
                            // along an edge, the distance to the face beyond it is rounded
                            let off = (get(behind) - get(chord)).abs();
                            assert!(off * get(cos).abs() < 1e-9, "{label}: {off}");
                            *highest = highest.max(get(point.z).abs());
                            nearest = nearest.min(get(point.dot(point)).sqrt());
                        }
                    }
                    for (top, highest) in tops.into_iter().zip(highest) {
                        assert!(highest <= top + 1e-12, "{label}: {highest} above {top}");
                    }
                }
                let agrees = |what: &str, [sum, squares]: [f64; 2], count: f64, expected: f64| {
                    let mean = sum / count;
                    // rounding alone remains where all values are equal
                    let variance = (squares / count - mean * mean).max(0.0);
                    let error = (variance / count).sqrt() + 1e-9;
                    assert!(
                        (mean - expected).abs() < 4.0 * error,
                        "{label}: {what} {mean} +- {error}, {expected}"
                    );
                };
                agrees("x.n", outward, count, 3.0 * expected);
                // E|n.d| = 1/2
                agrees("chord", chords, count, 2.0 * expected);
                agrees(
                    "height",
                    heights,
                    480.0,
                    mean_half_height(shape, proportion),
                );
                // the mean square of the normals' mean is at most 1 / count
                let drift = sum.dot(sum).to_array().iter().sum::<f64>().sqrt() / count;
                assert!(drift < 4.0 / count.sqrt(), "{label}: {drift}");
                let inscribed = shape.inscribed(proportion);
                assert!(
                    nearest >= inscribed - 1e-12,
                    "{label}: {nearest} {inscribed}"
                );
                // some 200,000 points, of which more than 1e-4 are that near to the sphere
                assert!(nearest < 1.05 * inscribed, "{label}: {nearest} {inscribed}");
            }
        }
    }

    /// Half of the mean width. Of a spheroid: the mean of sqrt(c^2 + (1 - c^2) u^2) or
    /// sqrt(1 - (1 - c^2) u^2) over u. Of a prism: a quarter of the height and an eighth of the
    /// perimeter.
    fn mean_half_height(shape: Shape, proportion: f64) -> f64 {
        let c = proportion * proportion;
        let e = (1.0 - c * c).max(0.0).sqrt();
        match shape {
            Shape::Spheroid | Shape::Oblate if e == 0.0 => 1.0,
            Shape::Spheroid => 0.5 * (1.0 + c * c / e * (e / c).asinh()),
            Shape::Oblate => 0.5 * (c + e.asin() / e),
            Shape::Hexagonal => {
                let diagonal = (1.0 + proportion * proportion).sqrt();
                0.25 * (2.0 * proportion / diagonal) + 0.125 * 6.0 / diagonal
            }
        }
    }

    /// A body turned about z has the same half height and turned normals.
    #[test]
    fn turned_bodies_are_turned() {
        let mut rng = Stream::<splitsnow_spectra::simd::Portable>::new(Key {
            seed: 10,
            cell: 0,
            purpose: [0; 3],
            batch: 0,
        });
        for shape in Shape::ALL {
            for angle in [0.0f64, 0.3, 1.7, 3.0, 3.1, -2.0, -0.4] {
                let (sin, cos) = angle.sin_cos();
                let bodies = shape.draw(F64x8::splat(0.6), &mut rng);
                let (point, _) = bodies.sample(&mut rng);
                let body = bodies.get(0);
                let turned = body.turned(cos, sin);
                let height = |body: &crate::grain::Body<f64>| body.half_height(&Upright);
                assert!((height(&turned) - height(&body)).abs() < 1e-12);
                let turn = |v: crate::math::Vec3| {
                    crate::math::Vec3::new(cos * v.x + sin * v.y, cos * v.y - sin * v.x, v.z)
                };
                let mut moved = point;
                moved.set(0, turn(point.get(0)));
                let normal = turn(bodies.normal(point).unit().get(0));
                let found = Bodies::splat(&turned).normal(moved).unit().get(0);
                let off = found - normal;
                assert!(off.dot(off) < 1e-20, "{} {angle}: {off:?}", shape.name());
            }
        }
    }
}
