//! Bodies of any shape: one, and eight side by side.
use wide::f64x8;

use crate::grain::shape::{Form, Numbers};
use crate::math::{Real, Vec3, Vec3x8};
use crate::rng::Stream;

/// The solid that a grain is, in units of half its size.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Body<R> {
    /// Its shape.
    pub form: Form,
    /// Its attitude and proportions.
    pub numbers: Numbers<R>,
}

impl<R: Real> Body<R> {
    /// See [`super::GrainShape::half_height`].
    #[inline(always)]
    #[must_use]
    pub fn half_height(&self, down: impl Fn([R; 3]) -> R) -> R {
        self.form.half_height(&self.numbers, down)
    }
}

impl Body<f64> {
    /// See [`super::GrainShape::projected_point`].
    #[inline(always)]
    #[must_use]
    pub fn projected_point(&self, d: Vec3, u: f64, azimuth: (f64, f64)) -> (Vec3, Vec3) {
        self.form.projected_point(&self.numbers, d, u, azimuth)
    }

    /// See [`super::GrainShape::turned`].
    #[inline(always)]
    #[must_use]
    pub fn turned(&self, cos: f64, sin: f64) -> Self {
        Self {
            form: self.form,
            numbers: self.form.turned(&self.numbers, cos, sin),
        }
    }

    /// Rounded, as tables hold it.
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

/// Eight bodies side by side, which may differ in form.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Bodies {
    forms: [Form; 8],
    pub(super) numbers: Numbers<f64x8>,
}

impl Bodies {
    /// Of these forms and numbers.
    #[inline(always)]
    #[must_use]
    pub fn new(forms: [Form; 8], numbers: Numbers<f64x8>) -> Self {
        Self { forms, numbers }
    }

    /// Eight times this one.
    #[inline(always)]
    #[must_use]
    pub fn splat(body: &Body<f64>) -> Self {
        Self::new([body.form; 8], body.numbers.map(f64x8::splat))
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
        for (all, one) in self.numbers.iter_mut().zip(body.numbers) {
            all.as_mut_array()[lane] = one;
        }
    }

    /// The form, if all are of one, as in snow without mixtures of shapes.
    #[inline(always)]
    pub(super) fn form(&self) -> Option<Form> {
        let first = self.forms[0];
        // one comparison instead of eight
        let all = u64::from_le_bytes(self.forms.map(|form| form as u8));
        (all == u64::from_le_bytes([first as u8; 8])).then_some(first)
    }

    /// What `of` gives for the form of each lane.
    #[inline(always)]
    fn by_form<const N: usize>(&self, of: impl Fn(Form) -> [f64x8; N]) -> [f64x8; N] {
        let mut found = of(self.forms[0]);
        if self.form().is_none() {
            for lane in 1..8 {
                let form = self.forms[lane];
                if self.forms[..lane].contains(&form) {
                    continue;
                }
                for (all, values) in found.iter_mut().zip(of(form)) {
                    for lane in (lane..8).filter(|lane| self.forms[*lane] == form) {
                        all.as_mut_array()[lane] = values.as_array()[lane];
                    }
                }
            }
        }
        found
    }

    /// See [`super::GrainShape::sample`]; for bodies of one form.
    #[inline(always)]
    pub fn sample(&self, rng: &mut Stream) -> (Vec3x8, f64x8) {
        self.forms[0].sample(&self.numbers, rng)
    }

    /// See [`super::GrainShape::normal`].
    #[inline(always)]
    #[must_use]
    pub fn normal(&self, at: Vec3x8) -> Vec3x8 {
        let [x, y, z] = self.by_form(|form| {
            let Vec3x8 { x, y, z } = form.normal(&self.numbers, at);
            [x, y, z]
        });
        Vec3x8 { x, y, z }
    }

    /// See [`super::GrainShape::chord`].
    #[inline(always)]
    #[must_use]
    pub fn chord(&self, at: Vec3x8, d: Vec3x8) -> f64x8 {
        let [chord] = self.by_form(|form| [form.chord(&self.numbers, at, d)]);
        chord
    }

    /// See [`super::GrainShape::half_height`].
    #[inline(always)]
    #[must_use]
    pub fn half_height(&self, down: impl Fn([f64x8; 3]) -> f64x8) -> f64x8 {
        let [half] = self.by_form(|form| [form.half_height(&self.numbers, &down)]);
        half
    }
}
