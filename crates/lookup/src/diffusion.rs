//! Curves outside the nodes of the thickness.
//!
//! In snow light diffuses: 1/T, call it r, solves r'' = k^2 r along the
//! thickness, so that r grows like sinh(k (h + z)), a straight line without
//! absorption (k = 0) and an exponential with much of it. From a node on, y = ln r
//! goes with the value and slope it has there; k is the one that leads to
//! another node before, within 0 and the slope, between which all snow lies.
//!
//! - **Deeper** than the last node: on from there, with the node before it.
//! - **Thinner** than the first: back from there to y = 0 at 0 cm, stretched where
//!   no k leads there. The same for -ln(1 - R), which is y without absorption.
//!   Transport begins otherwise, within a few grains; but snow so thin is not
//!   what the model is of.

/// Halvings of the range of k.
const HALVINGS: u32 = 24;

/// y and its slope at a node, and y some way before.
#[derive(Debug, Clone, Copy)]
pub(super) struct Diffusion {
    pub(super) y: f64,
    pub(super) slope_per_cm: f64,
    pub(super) before: f64,
    pub(super) step_cm: f64,
}

impl Diffusion {
    /// ln(r/r0) after `h_cm`, growing from the end for positive ones.
    fn growth(&self, k: f64, h_cm: f64) -> f64 {
        let s = self.slope_per_cm;
        if k * h_cm.abs() < 1e-6 {
            return libm::log1p((s * h_cm).max(-1.0));
        }
        // ln(cosh kh + s/k sinh kh), without overflow
        let (rising, falling) = (0.5 * (1.0 + s / k), 0.5 * (1.0 - s / k));
        let sum = match h_cm > 0.0 {
            true => rising + falling * libm::exp(-2.0 * k * h_cm),
            false => rising * libm::exp(2.0 * k * h_cm) + falling,
        };
        if sum <= 0.0 {
            return f64::NEG_INFINITY;
        }
        k * h_cm.abs() + libm::log(sum)
    }

    /// k, from y before the node.
    fn bending(&self) -> f64 {
        let mut range = [0.0, self.slope_per_cm.max(0.0)];
        for _ in 0..HALVINGS {
            let k = 0.5 * (range[0] + range[1]);
            // a larger k bends more, and so begins higher up
            let too_large = self.y + self.growth(k, -self.step_cm) > self.before;
            range[usize::from(too_large)] = k;
        }
        range[1]
    }

    /// y at `h_cm` past the node.
    pub(super) fn deeper(&self, h_cm: f64) -> f64 {
        self.y + self.growth(self.bending(), h_cm).max(0.0)
    }

    /// y at these `parts` of the way from `step_cm` before the node to it.
    pub(super) fn thinner<const N: usize>(&self, parts: [f64; N]) -> [f64; N] {
        let k = self.bending();
        let whole = self.growth(k, -self.step_cm);
        if whole >= 0.0 {
            return parts.map(|part| self.before + (self.y - self.before) * part);
        }
        let stretch = (self.y - self.before) / whole;
        parts.map(|part| self.y - stretch * self.growth(k, (part - 1.0) * self.step_cm))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y = ln(sinh(k (h + z)) / sinh(k z)) and its slope, at 30 cm and before.
    fn end(k: f64, z: f64) -> (Diffusion, impl Fn(f64) -> f64) {
        let y = move |h: f64| match k {
            0.0 => ((h + z) / z).ln(),
            k => ((k * (h + z)).sinh() / (k * z).sinh()).ln(),
        };
        let slope_per_cm = match k {
            0.0 => 1.0 / (30.0 + z),
            k => k / (k * (30.0 + z)).tanh(),
        };
        let end = Diffusion {
            y: y(30.0),
            slope_per_cm,
            before: y(20.0),
            step_cm: 10.0,
        };
        (end, y)
    }

    #[test]
    fn diffusion_goes_on() {
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
                near(end.deeper(h), 30.0 + h);
            }
            // a node tells little of what is before many decay lengths
            if k <= 0.1 {
                let before = 0.0;
                let whole = Diffusion {
                    before,
                    step_cm: 30.0,
                    ..end
                };
                let found = whole.thinner([0.1, 0.5, 1.0]);
                for (h, found) in [3.0, 15.0, 30.0].into_iter().zip(found) {
                    near(found, h);
                }
            }
        }
    }

    #[test]
    fn grows_whatever_the_nodes_say() {
        for slope_per_cm in [0.0, 1e-9, 0.3, 50.0] {
            for before in [-1e9, 0.0, 4.999, 5.0, 6.0] {
                let end = Diffusion {
                    y: 5.0,
                    slope_per_cm,
                    before,
                    step_cm: 3.0,
                };
                let mut last = 5.0;
                for h in [0.0, 1e-6, 1.0, 100.0, 1e6, 1e30] {
                    let y = end.deeper(h);
                    assert!(y >= last && y.is_finite(), "{end:?} {h}: {y}");
                    last = y;
                }
                let before = before.clamp(0.0, 5.0);
                let end = Diffusion { before, ..end };
                let [zero, part, more, one] = end.thinner([0.0, 0.1, 0.7, 1.0]);
                assert!((zero - before).abs() < 1e-9 && (one - 5.0).abs() < 1e-9);
                assert!(zero <= part && part <= more && more <= one, "{end:?}");
            }
        }
    }
}
