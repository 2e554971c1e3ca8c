//! Extrapolation beyond the first and last thickness node.
//!
//! Light in snow diffuses: r = 1/T solves r'' = k^2 r along the thickness. Hence r grows
//! like sinh(k (h + z)): linearly without absorption (k = 0), exponentially with strong
//! absorption. The extrapolation of y = ln r matches the value and slope at a node. The
//! decay constant k lies between 0 and the slope, as for all snow, and is chosen so that
//! the curve passes through a second, thinner node.
//!
//! - **Thicker** than the last node: extrapolated from there, with k from the node before
//!   it.
//! - **Thinner** than the first node: extrapolated down to y = 0 at 0 cm, and stretched
//!   linearly in y where no k leads there. The same formula serves -ln(1 - R), which
//!   equals y without absorption. Within a few grains of the surface transport is not
//!   diffusive, but the model does not cover snow that thin.

use splitsnow_spectra::elementary::{exp_neg, ln};
use splitsnow_spectra::simd::{F64x8, Simd, Task};

/// Number of bisection steps for k.
const HALVINGS: u32 = 24;
/// Below this k h the solution is that without absorption.
const STRAIGHT: f64 = 1e-6;

/// y and its slope at a node, and y at a thinner node, for eight wavelengths.
#[derive(Debug, Clone, Copy)]
pub(super) struct Diffusion<S: Simd> {
    /// y at the node.
    pub(super) y: F64x8<S>,
    /// Derivative of y with respect to the thickness, 1/cm.
    pub(super) slope_per_cm: F64x8<S>,
    /// y at `step_cm` before the node.
    pub(super) before: F64x8<S>,
    /// Distance to the thinner node, cm.
    pub(super) step_cm: f64,
}

/// ln(1 + x); minus infinity for x = -1. Accurate for small x, as ln u / (u - 1) hardly depends on
/// the rounding of u = 1 + x.
#[inline(always)]
fn ln_1p<S: Simd>(x: F64x8<S>) -> F64x8<S> {
    let one = F64x8::ONE;
    let u = one + x;
    let difference = u - one;
    let exact = difference.equals(F64x8::ZERO);
    let ratio = x / exact.select(one, difference);
    exact.select(x, ln_or_none(u) * ratio)
}

/// ln x; minus infinity where x is not positive.
#[inline(always)]
fn ln_or_none<S: Simd>(x: F64x8<S>) -> F64x8<S> {
    let least = F64x8::splat(f64::MIN_POSITIVE);
    let none = F64x8::splat(f64::NEG_INFINITY);
    x.ge(least).select(ln(x.max(least)), none)
}

/// ln(r / r0) at `h_cm` from the node, where r0 is r at the node; positive `h_cm` is thicker. A
/// task, as it has several callers.
struct Growth<S: Simd> {
    slope_per_cm: F64x8<S>,
    k: F64x8<S>,
    h_cm: f64,
}

impl<S: Simd> Task for Growth<S> {
    type Output = F64x8<S>;

    #[inline(always)]
    fn perform(self) -> F64x8<S> {
        let Self {
            slope_per_cm: s,
            k,
            h_cm,
        } = self;
        let one = F64x8::ONE;
        let along = k * F64x8::splat(h_cm.abs());
        let straight = along.lt(F64x8::splat(STRAIGHT));
        let mut growth = F64x8::ZERO;
        if straight.any() {
            growth = ln_1p((s * F64x8::splat(h_cm)).max(-one));
        }
        if (!straight).any() {
            // ln(cosh kh + s/k sinh kh), without overflow
            let half = F64x8::splat(0.5);
            let (rising, falling) = (half * (one + s / k), half * (one - s / k));
            let decay = F64x8::new((along + along).to_array().map(exp_neg));
            let sum = match h_cm > 0.0 {
                true => rising + falling * decay,
                false => rising * decay + falling,
            };
            growth = straight.select(growth, along + ln_or_none(sum));
        }
        growth
    }
}

/// The decay constant k, 1/cm, from y at the thinner node: a bisection. A task, as it has several
/// callers.
struct DecayConstant<S: Simd>(Diffusion<S>);

impl<S: Simd> Task for DecayConstant<S> {
    type Output = F64x8<S>;

    #[inline(always)]
    fn perform(self) -> F64x8<S> {
        let Self(node) = self;
        let (one, half) = (F64x8::ONE, F64x8::splat(0.5));
        let step = F64x8::splat(node.step_cm);
        // r at the thinner node, relative to the node
        let rise = (node.y - node.before).max(F64x8::ZERO);
        let ratio = F64x8::new(rise.to_array().map(exp_neg));
        let straight_ratio = one - node.slope_per_cm * step;
        let (mut low, mut high) = (F64x8::ZERO, node.slope_per_cm.max(F64x8::ZERO));
        for _ in 0..HALVINGS {
            let k = half * (low + high);
            let along = k * step;
            let decay = F64x8::new(along.to_array().map(exp_neg));
            let part = node.slope_per_cm / k;
            // cosh kh - s/k sinh kh, times exp(-kh) on both sides
            let found = half * ((one + part) * decay * decay + (one - part));
            let straight = along.lt(F64x8::splat(STRAIGHT));
            // a larger k curves more and gives a larger r at the thinner node
            let too_large = straight
                .select(straight_ratio, found)
                .gt(straight.select(ratio, ratio * decay));
            high = too_large.select(k, high);
            low = too_large.select(low, k);
        }
        high
    }
}

impl<S: Simd> Diffusion<S> {
    #[inline(always)]
    fn growth(&self, k: F64x8<S>, h_cm: f64) -> F64x8<S> {
        S::outlined(Growth {
            slope_per_cm: self.slope_per_cm,
            k,
            h_cm,
        })
    }

    /// y at `h_cm` (0 or more) beyond the node.
    #[inline(always)]
    pub(super) fn deeper(&self, h_cm: f64) -> F64x8<S> {
        self.y
            + self
                .growth(S::outlined(DecayConstant(*self)), h_cm)
                .max(F64x8::ZERO)
    }

    /// y at `parts` (0 to 1) of the way from the thinner node to the node.
    #[inline(always)]
    pub(super) fn thinner<const N: usize>(&self, parts: [f64; N]) -> [F64x8<S>; N] {
        let k = S::outlined(DecayConstant(*self));
        let whole = self.growth(k, -self.step_cm);
        let leads_there = whole.lt(F64x8::ZERO);
        let rise = self.y - self.before;
        let stretch = rise / leads_there.select(whole, F64x8::ONE);
        let mut found = [F64x8::ZERO; N];
        for (found, part) in found.iter_mut().zip(parts) {
            let growth = self.growth(k, (part - 1.0) * self.step_cm);
            let line = self.before + rise * F64x8::splat(part);
            *found = leads_there.select(self.y - stretch * growth, line);
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use splitsnow_spectra::simd::Portable;

    use super::*;

    /// y = ln(sinh(k (h + z)) / sinh(k z)) and its slope, at 30 cm and before.
    fn end(k: f64, z: f64) -> (Diffusion<Portable>, impl Fn(f64) -> f64) {
        let y = move |h: f64| match k {
            0.0 => ((h + z) / z).ln(),
            k => ((k * (h + z)).sinh() / (k * z).sinh()).ln(),
        };
        let slope_per_cm = match k {
            0.0 => 1.0 / (30.0 + z),
            k => k / (k * (30.0 + z)).tanh(),
        };
        let end = Diffusion {
            y: F64x8::splat(y(30.0)),
            slope_per_cm: F64x8::splat(slope_per_cm),
            before: F64x8::splat(y(20.0)),
            step_cm: 10.0,
        };
        (end, y)
    }

    fn lane(values: F64x8<Portable>) -> f64 {
        values.to_array()[5]
    }

    #[test]
    fn extrapolation_follows_diffusion() {
        for k in [0.0, 0.01, 0.1, 0.5] {
            let (end, y) = end(k, 0.7);
            let near = |found: f64, h: f64| {
                let expected = y(h);
                assert!(
                    (found - expected).abs() < 1e-3 * expected,
                    "{k} {h}: {found} {expected}"
                );
            };
            for h in [0.0, 1.0, 20.0, 100.0] {
                near(lane(end.deeper(h)), 30.0 + h);
            }
            // a node says little about values many decay lengths before it
            if k <= 0.1 {
                let before = F64x8::ZERO;
                let whole = Diffusion {
                    before,
                    step_cm: 30.0,
                    ..end
                };
                let found = whole.thinner([0.1, 0.5, 1.0]);
                for (h, found) in [3.0, 15.0, 30.0].into_iter().zip(found) {
                    near(lane(found), h);
                }
            }
        }
    }

    #[test]
    fn y_grows_for_any_node_values() {
        for slope_per_cm in [0.0, 1e-9, 0.3, 50.0] {
            for before in [-1e9, 0.0, 4.999, 5.0, 6.0] {
                let end = Diffusion::<Portable> {
                    y: F64x8::splat(5.0),
                    slope_per_cm: F64x8::splat(slope_per_cm),
                    before: F64x8::splat(before),
                    step_cm: 3.0,
                };
                let mut last = 5.0;
                for h in [0.0, 1e-6, 1.0, 100.0, 1e6, 1e30] {
                    let y = lane(end.deeper(h));
                    assert!(y >= last && y.is_finite(), "{end:?} {h}: {y}");
                    last = y;
                }
                let before = before.clamp(0.0, 5.0);
                let end = Diffusion {
                    before: F64x8::splat(before),
                    ..end
                };
                let [zero, part, more, one] = end.thinner([0.0, 0.1, 0.7, 1.0]).map(lane);
                assert!((zero - before).abs() < 1e-9 && (one - 5.0).abs() < 1e-9);
                assert!(zero <= part && part <= more && more <= one, "{end:?}");
            }
        }
    }
}
