//! Hexagonal prisms with flat faces: columns and plates (docs/methods.md, Shapes).
//!
//! With the aspect ratio r = height / diameter between opposite edges, the half height is
//! h = r / sqrt(1 + r^2) and the circumradius is a = 1 / sqrt(1 + r^2): the longest diagonal
//! has the length 2. The numbers of a body are h and, before it, a unit quaternion (w, x, y, z).
//! It rotates x to a direction across two faces and z to the axis of the prism.
use splitsnow_spectra::simd::{F64x8, Simd};

use crate::grain::shape::{Down, Form, GrainShape, Numbers};
use crate::math::{Real, Vec3x8};
use crate::rng::{Fingerprint, Stream};

/// Prisms of any aspect ratio, in random orientation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hexagonal;

/// cos 30 degrees: the apothem of a hexagon of circumradius 1.
const APOTHEM: f64 = 0.866_025_403_784_438_6;

/// The axes of a body: across two faces, across two edges, and along the prism.
#[inline(always)]
fn axes<R: Real>([w, x, y, z, _]: &Numbers<R>) -> [[R; 3]; 3] {
    let (w, x, y, z) = (*w, *x, *y, *z);
    let two = R::ONE + R::ONE;
    [
        [
            R::ONE - two * (y * y + z * z),
            two * (x * y + w * z),
            two * (x * z - w * y),
        ],
        [
            two * (x * y - w * z),
            R::ONE - two * (x * x + z * z),
            two * (y * z + w * x),
        ],
        [
            two * (x * z + w * y),
            two * (y * z - w * x),
            R::ONE - two * (x * x + y * y),
        ],
    ]
}

/// Absolute value.
#[inline(always)]
fn magnitude<R: Real>(x: R) -> R {
    x.max(R::ZERO - x)
}

/// Circumradius for the half height.
#[inline(always)]
fn circumradius<R: Real>(half_height: R) -> R {
    (R::ONE - half_height * half_height).max(R::ZERO).sqrt()
}

// Functions instead of closures, which may be compiled without the instruction set.

#[inline(always)]
fn vector<S: Simd>([x, y, z]: [F64x8<S>; 3]) -> Vec3x8<S> {
    Vec3x8::new(x, y, z)
}

/// 1 where the mask is set, -1 elsewhere.
#[inline(always)]
fn sign<S: Simd>(mask: F64x8<S>) -> F64x8<S> {
    mask.select(F64x8::ONE, -F64x8::ONE)
}

/// `x` across two faces and `y` across two edges, rotated about the axis of the prism.
#[inline(always)]
fn rotated<S: Simd>(
    [face, edge, _]: &[Vec3x8<S>; 3],
    [x, y]: [F64x8<S>; 2],
    [cos, sin]: [F64x8<S>; 2],
) -> Vec3x8<S> {
    (*face * (x * cos - y * sin)).plus(x * sin + y * cos, *edge)
}

/// The axes of eight bodies.
#[inline(always)]
fn axes_x8<S: Simd>(body: &Numbers<F64x8<S>>) -> [Vec3x8<S>; 3] {
    let [a, b, c] = axes(body);
    [vector(a), vector(b), vector(c)]
}

/// Components of a vector across the four pairs of faces, the basal ones last.
#[inline(always)]
fn across<S: Simd>([face, edge, along]: &[Vec3x8<S>; 3], v: Vec3x8<S>) -> [F64x8<S>; 4] {
    let (x, y) = (v.dot(*face), v.dot(*edge));
    let (half, height) = (F64x8::splat(0.5), F64x8::splat(APOTHEM));
    [
        x,
        half * x + height * y,
        height * y - half * x,
        v.dot(*along),
    ]
}

/// Distances of the four pairs of faces from the centre.
#[inline(always)]
fn extents<S: Simd>(body: &Numbers<F64x8<S>>) -> [F64x8<S>; 4] {
    let side = F64x8::splat(APOTHEM) * circumradius(body[4]);
    [side, side, side, body[4]]
}

impl GrainShape for Hexagonal {
    const FORM: Form = Form::Hexagonal;

    fn identify(&self, digest: Fingerprint) -> Fingerprint {
        digest.and_text("hexagonal")
    }

    /// 2 / h + 8 / (sqrt(3) a), with h and a as above.
    fn surface_to_volume(&self, aspect_ratio: f64) -> f64 {
        let a = 1.0 / (1.0 + aspect_ratio * aspect_ratio).sqrt();
        2.0 / (aspect_ratio * a) + 4.0 / (APOTHEM * a)
    }

    fn inscribed(&self, aspect_ratio: f64) -> f64 {
        aspect_ratio.min(APOTHEM) / (1.0 + aspect_ratio * aspect_ratio).sqrt()
    }

    /// A uniform quaternion, from two azimuths (Shoemake 1992, Graphics Gems III).
    #[inline(always)]
    fn draw<S: Simd>(&self, aspect_ratio: F64x8<S>, rng: &mut Stream<S>) -> Numbers<F64x8<S>> {
        let u = rng.uniform();
        let (first, second) = (u.sqrt(), (F64x8::ONE - u).sqrt());
        let (sin1, cos1) = rng.azimuth();
        let (sin2, cos2) = rng.azimuth();
        let diagonal = (F64x8::ONE + aspect_ratio * aspect_ratio).sqrt();
        [
            first * cos1,
            second * sin2,
            second * cos2,
            first * sin1,
            aspect_ratio / diagonal,
        ]
    }

    /// Every point is kept.
    #[inline(always)]
    fn sample<S: Simd>(body: &Numbers<F64x8<S>>, rng: &mut Stream<S>) -> (Vec3x8<S>, F64x8<S>) {
        let (one, two, half) = (F64x8::ONE, F64x8::splat(2.0), F64x8::splat(0.5));
        let axes = axes_x8(body);
        let along = axes[2];
        let (h, a) = (body[4], circumradius(body[4]));
        // of the basal faces and of the six sides, in units of a
        let basal = F64x8::splat(6.0 * APOTHEM) * a;
        let is_basal = (rng.uniform() * (basal + F64x8::splat(12.0) * h)).lt(basal);
        let (choice, u, v) = (rng.uniform(), rng.uniform(), rng.uniform());
        // rotated by 0, 120 or -120 degrees
        let (third, apothem) = (F64x8::splat(1.0 / 3.0), F64x8::splat(APOTHEM));
        let is_first = choice.lt(third);
        let sin = choice.lt(third + third).select(apothem, -apothem);
        let turn = [
            is_first.select(one, -half),
            is_first.select(F64x8::ZERO, sin),
        ];
        // a third of a basal face is a rhombus between corners 120 degrees apart
        let rhombus = [a * apothem * (u - v), a * half * (u + v)];
        let on_basal = rotated(&axes, rhombus, turn).plus(h * sign(rng.uniform().lt(half)), along);
        // a side on either end of a direction across two faces
        let is_near = u.lt(half);
        let u = two * u - is_near.select(F64x8::ZERO, one);
        let place = [a * apothem * sign(is_near), a * (u - half)];
        let on_side = rotated(&axes, place, turn).plus(h * (two * v - one), along);
        (on_basal.or_where_not(is_basal, on_side), half.lt(one))
    }

    /// The normal of the pair of faces that the point lies farthest beyond.
    #[inline(always)]
    fn normal<S: Simd>(body: &Numbers<F64x8<S>>, point: Vec3x8<S>) -> Vec3x8<S> {
        let axes = axes_x8(body);
        let [face, edge, along] = axes;
        let (half, height) = (F64x8::splat(0.5), F64x8::splat(APOTHEM));
        let normals = [
            face,
            (face * half).plus(height, edge),
            (edge * height).plus(-half, face),
            along,
        ];
        let (places, extents) = (across(&axes, point), extents(body));
        let mut normal = normals[0];
        let mut farthest = places[0].abs() / extents[0];
        let mut place = places[0];
        for pair in 1..4 {
            let ratio = places[pair].abs() / extents[pair];
            let beyond = ratio.gt(farthest);
            farthest = beyond.select(ratio, farthest);
            place = beyond.select(places[pair], place);
            normal = normals[pair].or_where_not(beyond, normal);
        }
        normal * sign(place.ge(F64x8::ZERO))
    }

    #[inline(always)]
    fn chord<S: Simd>(body: &Numbers<F64x8<S>>, point: Vec3x8<S>, d: Vec3x8<S>) -> F64x8<S> {
        let axes = axes_x8(body);
        let (places, slopes, extents) = (across(&axes, point), across(&axes, d), extents(body));
        // a direction parallel to a pair of faces does not meet it
        let least = F64x8::splat(1e-30);
        let mut chord = F64x8::splat(4.0);
        for pair in 0..4 {
            let ahead = slopes[pair].lt(F64x8::ZERO);
            let place = ahead.select(-places[pair], places[pair]);
            let left = (extents[pair] - place).max(F64x8::ZERO);
            chord = chord.min(left / slopes[pair].abs().max(least));
        }
        chord
    }

    #[inline(always)]
    fn half_height<R: Real>(body: &Numbers<R>, down: &impl Down<R>) -> R {
        let [face, edge, along] = axes(body).map(|axis| down.down(axis));
        let (h, a) = (body[4], circumradius(body[4]));
        // the corners: at 90 and at +-30 degrees of the direction across two faces
        let (half, apothem) = (R::from_f64(0.5), R::from_f64(APOTHEM));
        let slanted = magnitude(face) * apothem + magnitude(edge) * half;
        h * magnitude(along) + a * slanted.max(magnitude(edge))
    }

    fn turned([w, x, y, z, h]: &Numbers<f64>, cos: f64, sin: f64) -> Numbers<f64> {
        // half of the angle of a rotation by -phi about z
        let (half_cos, half_sin) = if cos >= 0.0 {
            let half_cos = (0.5 * (1.0 + cos)).sqrt();
            (half_cos, 0.5 * sin / half_cos)
        } else {
            let half_sin = (0.5 * (1.0 - cos)).sqrt().copysign(sin);
            (0.5 * sin / half_sin, half_sin)
        };
        [
            half_cos * w + half_sin * z,
            half_cos * x + half_sin * y,
            half_cos * y - half_sin * x,
            half_cos * z - half_sin * w,
            *h,
        ]
    }
}
