//! Spectra from the sums over the nodes around a point, between the nodes and beyond the last
//! thickness.
use std::marker::PhantomData;

use splitsnow_spectra::Quantity;
use splitsnow_spectra::elementary::exp_neg_single as exp_neg;
use splitsnow_spectra::simd::{F32x8, Simd, Task};

use super::corners::{Corners, folded};
use super::{BLOCK, FEW, LANES, Lookup, THICKNESS, wide};
use crate::diffusion::Diffusion;
use crate::parameter::thickness_slope;

impl Lookup {
    /// Writes y per wavelength to `spectrum`, or the quantity if it is `FINISHED`: sums over
    /// `corners` of the values and slopes at the nodes below and above the thickness, with
    /// `weights`.
    #[inline(always)]
    pub(super) fn depths<S: Simd, const N: usize, const FINISHED: bool>(
        &self,
        corners: &Corners<N>,
        weights: [F32x8<S>; 2],
        spectrum: &mut [f32],
    ) {
        if self.components == 0 {
            // the components are the spectrum
            for (i, spectrum) in spectrum.chunks_mut(BLOCK * LANES).enumerate() {
                let vectors = spectrum.len().div_ceil(LANES);
                let block = corners.block(weights, self.width, i * BLOCK, vectors);
                for (to, y) in spectrum.chunks_mut(8).zip(block) {
                    self.write::<S, FINISHED>(y, to);
                }
            }
        } else if self.width == 1 {
            // the usual case of a tailored file: one vector, kept in registers
            let sum = corners.single(weights);
            let lanes = folded(sum, F32x8::ZERO).to_array();
            let [first, second, third, fourth, ..] = lanes.map(F32x8::<S>::splat);
            let chunks = self.basis.as_chunks::<LANES>().0;
            for (to, vectors) in spectrum.chunks_mut(8).zip(chunks) {
                let [a, b, c, d] = vectors.map(|vector| vector.on());
                let y = first * a + second * b + third * c + fourth * d;
                self.write::<S, FINISHED>(y, to);
            }
        } else {
            let mut few = [0.0; FEW];
            let mut many = Vec::new();
            let components = match few.get_mut(..self.width * LANES) {
                Some(few) => few,
                None => {
                    many.resize(self.width * LANES, 0.0);
                    &mut many[..]
                }
            };
            for (i, components) in components.chunks_mut(BLOCK * LANES).enumerate() {
                let block = corners.block(weights, self.width, i * BLOCK, components.len() / LANES);
                for (to, sums) in components.chunks_mut(8).zip(block) {
                    put(sums, to);
                }
            }
            self.rebuild::<S, FINISHED>(components, spectrum);
        }
    }

    /// Writes y per wavelength, or the quantity if it is `FINISHED`, from coefficients of the basis.
    #[inline(always)]
    pub(super) fn rebuild<S: Simd, const FINISHED: bool>(
        &self,
        components: &[f32],
        spectrum: &mut [f32],
    ) {
        let chunks = self.basis.chunks_exact(self.width * LANES);
        for (to, vectors) in spectrum.chunks_mut(8).zip(chunks) {
            let mut y = F32x8::<S>::ZERO;
            for (c, vector) in components.iter().zip(vectors) {
                y += F32x8::splat(*c) * vector.on();
            }
            self.write::<S, FINISHED>(y, to);
        }
    }

    /// Writes at most eight y, or the quantity if they are to be `FINISHED`.
    #[inline(always)]
    fn write<S: Simd, const FINISHED: bool>(&self, y: F32x8<S>, to: &mut [f32]) {
        let mut lanes = y.to_array();
        if FINISHED {
            for y in &mut lanes {
                *y = exp_neg(*y);
            }
            if self.quantity == Quantity::Reflectance {
                for value in &mut lanes {
                    *value = 1.0 - *value;
                }
            }
        }
        put(F32x8::<S>::new(lanes), to);
    }

    /// Writes the quantity at `thickness_cm`, thicker than the last node, to `spectrum`; `corners`
    /// are at the node before the last.
    #[inline(always)]
    fn beyond<S: Simd, const N: usize>(
        &self,
        corners: &Corners<N>,
        thickness_cm: f32,
        spectrum: &mut [f32],
    ) {
        let (zero, value, slope) = (F32x8::<S>::ZERO, halves(1.0, 0.0), halves(0.0, 1.0));
        if self.quantity == Quantity::Reflectance {
            return self.depths::<S, N, true>(corners, [zero, value], spectrum);
        }
        let mut before = vec![0.0; spectrum.len()];
        let mut slopes = before.clone();
        self.depths::<S, N, false>(corners, [zero, value], spectrum);
        self.depths::<S, N, false>(corners, [value, zero], &mut before);
        self.depths::<S, N, false>(corners, [zero, slope], &mut slopes);
        let nodes = &self.values[THICKNESS];
        let last_cm = nodes[nodes.len() - 1];
        let step_cm = last_cm - nodes[nodes.len() - 2];
        let scale = thickness_slope(last_cm);
        slopes.iter_mut().for_each(|slope| *slope *= scale);
        let sides = before.chunks(8).zip(slopes.chunks(8));
        for (y, (before, slopes)) in spectrum.chunks_mut(8).zip(sides) {
            let end = Diffusion::<S> {
                y: wide(y),
                slope_per_cm: wide(slopes),
                before: wide(before),
                step_cm: f64::from(step_cm),
            };
            let deeper = end.deeper(f64::from(thickness_cm - last_cm)).to_array();
            self.write::<S, true>(F32x8::new(deeper.map(|y| y as f32)), y);
        }
    }
}

/// A look-up thicker than the last node. A task, so that it does not slow the others.
pub(super) struct Beyond<'a, S: Simd, const N: usize> {
    pub(super) lookup: &'a Lookup,
    pub(super) corners: Corners<'a, N>,
    pub(super) thickness_cm: f32,
    pub(super) spectrum: &'a mut [f32],
    pub(super) level: PhantomData<S>,
}

impl<S: Simd, const N: usize> Task for Beyond<'_, S, N> {
    type Output = ();

    #[inline(always)]
    fn perform(self) {
        let Self {
            lookup,
            corners,
            thickness_cm,
            spectrum,
            ..
        } = self;
        lookup.beyond::<S, N>(&corners, thickness_cm, spectrum);
    }
}

/// A vector with the weight `value` for values and `slope` for slopes.
#[inline(always)]
fn halves<S: Simd>(value: f32, slope: f32) -> F32x8<S> {
    F32x8::new(std::array::from_fn(
        |i| if i < LANES { value } else { slope },
    ))
}

/// Weights of the nodes below and above, `t` (0 to 1) of the way from one to the other;
/// the nodes are `step` apart.
#[inline(always)]
pub(super) fn hermite<S: Simd>(t: f32, step: f32) -> [F32x8<S>; 2] {
    let left = 1.0 - t;
    [
        halves((1.0 + 2.0 * t) * left * left, t * left * left * step),
        halves(t * t * (3.0 - 2.0 * t), -t * t * left * step),
    ]
}

/// Writes the first numbers of a vector.
#[inline(always)]
fn put<S: Simd>(from: F32x8<S>, to: &mut [f32]) {
    match to.first_chunk_mut::<8>() {
        Some(whole) => *whole = from.to_array(),
        None => {
            let (mut from, mut to) = (&from.as_array()[..], to);
            copy::<4>(&mut from, &mut to);
            copy::<2>(&mut from, &mut to);
            copy::<1>(&mut from, &mut to);
        }
    }
}

/// Copies `N` numbers if there is room for them.
#[inline(always)]
fn copy<const N: usize>(from: &mut &[f32], to: &mut &mut [f32]) {
    if let (Some((first, rest)), true) = (from.split_first_chunk::<N>(), to.len() >= N) {
        let (begin, end) = std::mem::take(to).split_at_mut(N);
        begin.copy_from_slice(first);
        (*from, *to) = (rest, end);
    }
}
