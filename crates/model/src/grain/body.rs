//! Bodies of any shape, single or eight side by side.
use splitsnow_spectra::simd::{F64x8, Portable, Simd, Task};

use crate::grain::Spheroid;
use crate::grain::shape::{Down, Form, GrainShape, Numbers};
use crate::math::{Real, Vec3x8};
use crate::rng::Stream;

/// The solid body of a grain, in units of half its size.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Body<R> {
    /// Its shape.
    pub form: Form,
    /// Its orientation and proportions.
    pub numbers: Numbers<R>,
}

impl<R: Real> Body<R> {
    /// See [`super::GrainShape::half_height`].
    #[inline(always)]
    #[must_use]
    pub fn half_height(&self, down: &impl Down<R>) -> R {
        self.form.half_height(&self.numbers, down)
    }
}

impl Body<f64> {
    /// See [`super::GrainShape::turned`].
    #[inline(always)]
    #[must_use]
    pub fn turned(&self, cos: f64, sin: f64) -> Self {
        Self {
            form: self.form,
            numbers: self.form.turned(&self.numbers, cos, sin),
        }
    }

    /// The body in single precision, as stored in tables.
    #[inline(always)]
    #[must_use]
    pub fn rounded(&self) -> Body<f32> {
        Body {
            form: self.form,
            numbers: self.numbers.map(|v| v as f32),
        }
    }
}

impl From<Body<f32>> for Body<f64> {
    #[inline(always)]
    fn from(body: Body<f32>) -> Self {
        Self {
            form: body.form,
            numbers: body.numbers.map(f64::from),
        }
    }
}

/// Eight bodies side by side, possibly of different forms.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Bodies<S: Simd = Portable> {
    forms: [Form; 8],
    pub(super) numbers: Numbers<F64x8<S>>,
}

/// Evaluates `$of` for the `$form` of each lane, once for each form that occurs. This is a
/// macro because a closure may be compiled without the instruction set.
macro_rules! by_form {
    ($bodies:expr, $form:ident => $of:expr) => {{
        let mut found = [F64x8::ZERO; _];
        for $form in Form::ALL {
            let lanes = $bodies.lanes_of($form);
            if lanes.any() {
                for (all, value) in found.iter_mut().zip($of) {
                    *all = lanes.select(value, *all);
                }
            }
        }
        found
    }};
}

/// [`Bodies::half_height`] as a SIMD task.
struct HalfHeightTask<S: Simd, D>(Bodies<S>, D);

impl<S: Simd, D: Down<F64x8<S>>> Task for HalfHeightTask<S, D> {
    type Output = F64x8<S>;

    #[inline(always)]
    fn perform(self) -> F64x8<S> {
        let Self(bodies, down) = self;
        let [half] = by_form!(bodies, form => [form.half_height(&bodies.numbers, &down)]);
        half
    }
}

impl<S: Simd> Bodies<S> {
    /// Bodies of these forms and numbers.
    #[inline(always)]
    #[must_use]
    pub fn new(forms: [Form; 8], numbers: Numbers<F64x8<S>>) -> Self {
        Self { forms, numbers }
    }

    /// Eight copies of a body.
    #[inline(always)]
    #[must_use]
    pub fn splat(body: &Body<f64>) -> Self {
        Self::new([body.form; 8], body.numbers.map(F64x8::splat))
    }

    /// Reads one lane.
    #[inline(always)]
    #[must_use]
    pub fn get(&self, lane: usize) -> Body<f64> {
        Body {
            form: self.forms[lane],
            numbers: self.numbers.each_ref().map(|v| v.as_array()[lane]),
        }
    }

    /// Writes one lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, body: &Body<f64>) {
        self.forms[lane] = body.form;
        for (values, value) in self.numbers.iter_mut().zip(body.numbers) {
            values.as_mut_array()[lane] = value;
        }
    }

    /// The common form of all bodies; `None` in mixtures of shapes.
    #[inline(always)]
    pub(super) fn form(&self) -> Option<Form> {
        let first = self.forms[0];
        // one comparison instead of eight
        let packed = u64::from_le_bytes(self.forms.map(|form| form as u8));
        (packed == u64::from_le_bytes([first as u8; 8])).then_some(first)
    }

    /// The mask of the bodies of `form`.
    #[inline(always)]
    fn lanes_of(&self, form: Form) -> F64x8<S> {
        let mut lanes = F64x8::ZERO;
        for (mask, lane) in lanes.as_mut_array().iter_mut().zip(self.forms) {
            *mask = F64x8::<S>::mask(lane == form);
        }
        lanes
    }

    /// See [`super::GrainShape::sample`]. All bodies must be of the same form.
    #[inline(always)]
    pub fn sample(&self, rng: &mut Stream<S>) -> (Vec3x8<S>, F64x8<S>) {
        self.forms[0].sample(&self.numbers, rng)
    }

    /// See [`super::GrainShape::normal`].
    #[inline(always)]
    #[must_use]
    pub fn normal(&self, point: Vec3x8<S>) -> Vec3x8<S> {
        let [x, y, z] = by_form!(self, form => {
            let Vec3x8 { x, y, z } = form.normal(&self.numbers, point);
            [x, y, z]
        });
        Vec3x8 { x, y, z }
    }

    /// See [`super::GrainShape::chord`].
    #[inline(always)]
    #[must_use]
    pub fn chord(&self, point: Vec3x8<S>, d: Vec3x8<S>) -> F64x8<S> {
        let [chord] = by_form!(self, form => [form.chord(&self.numbers, point, d)]);
        chord
    }

    /// See [`super::GrainShape::half_height`].
    #[inline(always)]
    #[must_use]
    // Other forms than spheroids are computed in one function for all callers.
    pub fn half_height(&self, down: &(impl Down<F64x8<S>> + Copy)) -> F64x8<S> {
        if self.form() == Some(Form::Spheroid) {
            return Spheroid::half_height(&self.numbers, down);
        }
        S::outlined(HalfHeightTask(*self, *down))
    }
}
