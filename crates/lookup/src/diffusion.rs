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

/// Number of bisection steps for k.
const HALVINGS: u32 = 24;

/// y and its slope at a node, and y at a thinner node.
#[derive(Debug, Clone, Copy)]
pub(super) struct Diffusion {
    /// y at the node.
    pub(super) y: f64,
    /// Derivative of y with respect to the thickness, 1/cm.
    pub(super) slope_per_cm: f64,
    /// y at `step_cm` before the node.
    pub(super) before: f64,
    /// Distance to the thinner node, cm.
    pub(super) step_cm: f64,
}

impl Diffusion {
    /// ln(r / r0) at `h_cm` from the node, where r0 is r at the node; positive `h_cm` is
    /// thicker.
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

    /// The decay constant k, 1/cm, from y at the thinner node.
    fn decay_constant(&self) -> f64 {
        let mut range = [0.0, self.slope_per_cm.max(0.0)];
        for _ in 0..HALVINGS {
            let k = 0.5 * (range[0] + range[1]);
            // a larger k curves more and gives a larger y at the thinner node
            let too_large = self.y + self.growth(k, -self.step_cm) > self.before;
            range[usize::from(too_large)] = k;
        }
        range[1]
    }

    /// y at `h_cm` (0 or more) beyond the node.
    pub(super) fn deeper(&self, h_cm: f64) -> f64 {
        self.y + self.growth(self.decay_constant(), h_cm).max(0.0)
    }

    /// y at `parts` (0 to 1) of the way from the thinner node to the node.
    pub(super) fn thinner<const N: usize>(&self, parts: [f64; N]) -> [f64; N] {
        let k = self.decay_constant();
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
                near(end.deeper(h), 30.0 + h);
            }
            // a node says little about values many decay lengths before it
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
    fn y_grows_for_any_node_values() {
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
