//! Fresnel reflectance and refraction at a smooth interface between two media
//! with complex refractive indices (docs/methods.md; Varsa 2025, eqs. A.1-A.9),
//! for eight rays at once.
//!
//! Light is unpolarised. If the imaginary indices of both media are at most
//! [`Interface::DIELECTRIC_K`], the formulas for real indices are accurate enough; a
//! test bounds their difference from the complex ones.
use splitsnow_spectra::simd::{F64x8, Portable, Simd};

use crate::math::Vec3x8;
use crate::optics::Index;

/// The interface between the medium that a ray leaves and the medium that it enters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interface {
    /// Squared relative real index (n_to / n_from)^2.
    eta_squared: f64,
    inverse_eta: f64,
    absorbing: Option<Absorbing>,
}

/// Quantities that the complex formulas use in addition to the real relative index.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Absorbing {
    /// Real and imaginary part of the squared relative complex index.
    squared: (f64, f64),
    /// K = k / n of the medium that the ray enters.
    kappa: f64,
}

/// The interfaces at eight rays, either all dielectric or all absorbing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interfaces<S: Simd = Portable> {
    eta_squared: F64x8<S>,
    inverse_eta: F64x8<S>,
    /// Squared relative complex index (real, imaginary) and K.
    absorbing: Option<[F64x8<S>; 3]>,
}

/// Reflectance and refraction of eight rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Incidences<S: Simd = Portable> {
    /// Unpolarised Fresnel reflectances, [0, 1].
    pub reflectance: F64x8<S>,
    /// Cosines of the angles of refraction, >= 0; 0 in total reflection.
    pub cos_refracted: F64x8<S>,
}

impl Interface {
    /// Largest imaginary index of a medium that is treated as dielectric.
    pub const DIELECTRIC_K: f64 = 1e-6;

    /// The interface met by a ray going from `from` into `to`, with both
    /// imaginary indices neglected.
    #[must_use]
    pub fn dielectric(from: Index, to: Index) -> Self {
        let eta = to.n / from.n;
        Self {
            eta_squared: eta * eta,
            inverse_eta: 1.0 / eta,
            absorbing: None,
        }
    }

    /// The interface with the complex formulas, for any imaginary indices.
    #[must_use]
    pub fn absorbing(from: Index, to: Index) -> Self {
        // (to.n + i to.k) / (from.n + i from.k), squared
        let norm = from.n * from.n + from.k * from.k;
        let re = (to.n * from.n + to.k * from.k) / norm;
        let im = (to.k * from.n - to.n * from.k) / norm;
        let squared = (re * re - im * im, 2.0 * re * im);
        let absorbing = Some(Absorbing {
            squared,
            kappa: to.k / to.n,
        });
        Self {
            absorbing,
            ..Self::dielectric(from, to)
        }
    }

    /// The same interface for eight rays.
    #[inline(always)]
    #[must_use]
    pub fn splat<S: Simd>(&self) -> Interfaces<S> {
        Interfaces {
            eta_squared: F64x8::splat(self.eta_squared),
            inverse_eta: F64x8::splat(self.inverse_eta),
            absorbing: self
                .absorbing
                .map(|a| [a.squared.0, a.squared.1, a.kappa].map(F64x8::splat)),
        }
    }
}

/// sqrt(x / 2), or 0 for negative `x`.
#[inline(always)]
fn root_of_half<S: Simd>(x: F64x8<S>) -> F64x8<S> {
    (F64x8::splat(0.5) * x).max(F64x8::ZERO).sqrt()
}

/// 1 - c^2, or 0 if that is negative.
#[inline(always)]
fn sin_squared<S: Simd>(c: F64x8<S>) -> F64x8<S> {
    (F64x8::ONE - c * c).max(F64x8::ZERO)
}

/// Squared modulus of the complex number `re + i im`.
#[inline(always)]
fn square<S: Simd>(re: F64x8<S>, im: F64x8<S>) -> F64x8<S> {
    re * re + im * im
}

/// Principal square root of the complex number `re + i im`. The magnitudes of the two
/// parts depend on |im| only; the imaginary part has the sign of `im`.
#[inline(always)]
fn complex_sqrt<S: Simd>(re: F64x8<S>, im: F64x8<S>) -> (F64x8<S>, F64x8<S>) {
    let modulus = (re * re + im * im).sqrt();
    let sign = im & F64x8::splat(-0.0);
    (
        root_of_half(modulus + re),
        root_of_half(modulus - re) | sign,
    )
}

impl<S: Simd> Interfaces<S> {
    /// Selects `a` where `mask` is set, else `b`.
    #[inline(always)]
    #[must_use]
    pub fn select(mask: F64x8<S>, a: &Self, b: &Self) -> Self {
        Self {
            eta_squared: mask.select(a.eta_squared, b.eta_squared),
            inverse_eta: mask.select(a.inverse_eta, b.inverse_eta),
            absorbing: match (&a.absorbing, &b.absorbing) {
                (Some(a), Some(b)) => Some([
                    mask.select(a[0], b[0]),
                    mask.select(a[1], b[1]),
                    mask.select(a[2], b[2]),
                ]),
                _ => None,
            },
        }
    }

    /// Reflectance and refraction at angles of incidence with cosines `c` in (0, 1].
    #[inline(always)]
    #[must_use]
    pub fn incidences(&self, c: F64x8<S>) -> Incidences<S> {
        let sin_squared = F64x8::ONE - c * c;
        if let Some([re, im, kappa]) = self.absorbing {
            return Incidences {
                reflectance: absorbing_reflectance(re, im, c, sin_squared),
                cos_refracted: self.absorbing_refraction(kappa, sin_squared),
            };
        }
        let q_squared = self.eta_squared - sin_squared;
        let q = q_squared.max(F64x8::ZERO).sqrt();
        let e = self.eta_squared * c;
        // r_s = (c - q)/(c + q), r_p = (e - q)/(e + q) over one denominator
        let (s, p) = (c + q, e + q);
        let r = F64x8::ONE / (s * p);
        let (rs, rp) = ((c - q) * p * r, (e - q) * s * r);
        let reflectance = F64x8::splat(0.5) * (rs * rs + rp * rp);
        let total = q_squared.le(F64x8::ZERO);
        Incidences {
            reflectance: total.select(F64x8::ONE, reflectance),
            cos_refracted: q * self.inverse_eta,
        }
    }

    /// Cosine of the angle of refraction into an absorbing medium (eqs. A.7-A.9, with
    /// the misprints listed in docs/methods.md corrected). The half angle psi and the
    /// fourth root q' come from one complex square root.
    #[inline(always)]
    fn absorbing_refraction(&self, kappa: F64x8<S>, sin_squared: F64x8<S>) -> F64x8<S> {
        let one = F64x8::ONE;
        let k2 = kappa * kappa;
        let scale = self.eta_squared * (one + k2) * (one + k2);
        // n (1 + K^2) q' times cos(psi) and sin(psi)
        let (q_cos, q_sin) = complex_sqrt(
            scale - (one - k2) * sin_squared,
            F64x8::splat(2.0) * kappa * sin_squared,
        );
        let m = (q_cos - kappa * q_sin).max(F64x8::ZERO) / (one + k2);
        m / (sin_squared + m * m).sqrt()
    }

    /// Directions of refracted rays. `d` are the incident directions, `m` the unit
    /// normals on their side, and `c = -d.m`. In total reflection the result is
    /// meaningless.
    #[inline(always)]
    #[must_use]
    pub fn refract(
        &self,
        d: Vec3x8<S>,
        m: Vec3x8<S>,
        c: F64x8<S>,
        incidences: &Incidences<S>,
    ) -> Vec3x8<S> {
        let cos = incidences.cos_refracted;
        let ratio = if self.absorbing.is_some() {
            sine_ratio(cos, c)
        } else {
            self.inverse_eta
        };
        (d * ratio).plus(ratio * c - cos, m)
    }

    /// Like [`Interfaces::refract`], but in total reflection the direction is along the
    /// surface, as in eq. A.7.
    #[inline(always)]
    #[must_use]
    pub fn refract_or_graze(
        &self,
        d: Vec3x8<S>,
        m: Vec3x8<S>,
        c: F64x8<S>,
        incidences: &Incidences<S>,
    ) -> Vec3x8<S> {
        let cos = incidences.cos_refracted;
        let ratio = sine_ratio(cos, c);
        (d * ratio).plus(ratio * c - cos, m)
    }
}

/// sin(theta_t) / sin(theta_i). It equals 1 / eta without absorption and total
/// reflection.
#[inline(always)]
fn sine_ratio<S: Simd>(cos_to: F64x8<S>, cos_from: F64x8<S>) -> F64x8<S> {
    (sin_squared(cos_to) / sin_squared(cos_from).max(F64x8::splat(1e-300))).sqrt()
}

/// Unpolarised reflectance from the moduli of the complex amplitudes (eqs. A.1-A.2);
/// `re + i im` is the squared relative index.
#[inline(always)]
fn absorbing_reflectance<S: Simd>(
    re: F64x8<S>,
    im: F64x8<S>,
    c: F64x8<S>,
    sin_squared: F64x8<S>,
) -> F64x8<S> {
    let (qr, qi) = complex_sqrt(re - sin_squared, im);
    let s = square(c - qr, qi) / square(c + qr, qi);
    let p = square(re * c - qr, im * c - qi) / square(re * c + qr, im * c + qi);
    (F64x8::splat(0.5) * (s + p)).min(F64x8::ONE)
}

/// Directions of reflected rays. `d` are the incident directions, `m` the unit normals
/// on their side, and `c = -d.m`.
#[inline(always)]
#[must_use]
pub fn reflect<S: Simd>(d: Vec3x8<S>, m: Vec3x8<S>, c: F64x8<S>) -> Vec3x8<S> {
    d.plus(c + c, m)
}

#[cfg(test)]
mod tests {
    use super::*;

    const AIR: Index = Index { n: 1.0, k: 0.0 };
    const ICE: Index = Index { n: 1.31, k: 0.0 };

    impl Interface {
        /// Reflectance and cosine of refraction of one ray.
        fn one(&self, c: f64) -> (f64, f64) {
            let at = self.splat().incidences(F64x8::<Portable>::splat(c));
            (at.reflectance.to_array()[0], at.cos_refracted.to_array()[0])
        }
    }

    fn cosines() -> impl Iterator<Item = f64> {
        (1..=2000).map(|i| f64::from(i) / 2000.0)
    }

    #[test]
    fn closed_forms() {
        let enter = Interface::dielectric(AIR, ICE);
        let normal = (0.31f64 / 2.31).powi(2);
        assert!((enter.one(1.0).0 - normal).abs() < 1e-15);
        assert!((Interface::dielectric(ICE, AIR).one(1.0).0 - normal).abs() < 1e-15);
        // Brewster's angle, tan = n: r_p = 0 and r_s = (1 - n^2)/(1 + n^2)
        let brewster = (1.0 / (1.0 + 1.31f64 * 1.31)).sqrt();
        let rs = (1.0 - 1.31f64 * 1.31) / (1.0 + 1.31 * 1.31);
        assert!((enter.one(brewster).0 - 0.5 * rs * rs).abs() < 1e-15);
        // normal incidence on an absorber: ((n-1)^2 + k^2)/((n+1)^2 + k^2)
        let absorber = Interface::absorbing(AIR, Index { n: 1.5, k: 0.8 });
        let expected = (0.25 + 0.64) / (6.25 + 0.64);
        assert!((absorber.one(1.0).0 - expected).abs() < 1e-15);
        assert!((enter.one(1e-12).0 - 1.0).abs() < 1e-10);
    }

    #[test]
    fn total_reflection_beyond_the_critical_angle() {
        let leave = Interface::dielectric(ICE, AIR);
        let critical = (1.0 - 1.0 / (1.31f64 * 1.31)).sqrt();
        assert_eq!(leave.one(critical - 1e-9).0, 1.0);
        assert!(leave.one(critical + 1e-3).0 < 0.8);
    }

    /// Fresnel's amplitudes carry energy: transmittances computed from the
    /// amplitude t_s = 1 + r_s etc. and the beam's cross section add up to 1.
    #[test]
    fn energy_balance() {
        for (from, to) in [(AIR, ICE), (ICE, AIR), (ICE, Index { n: 1.33, k: 0.0 })] {
            let eta = to.n / from.n;
            for c in cosines() {
                let (reflectance, ct) = Interface::dielectric(from, to).one(c);
                if ct == 0.0 {
                    continue;
                }
                let ts = 2.0 * c / (c + eta * ct);
                let tp = 2.0 * c / (eta * c + ct);
                let transmitted = eta * ct / c * 0.5 * (ts * ts + tp * tp);
                assert!(
                    (reflectance + transmitted - 1.0).abs() < 1e-12,
                    "{from:?} {c}"
                );
            }
        }
    }

    #[test]
    fn refraction_is_snells_law_without_absorption() {
        for (from, to) in [(AIR, ICE), (ICE, AIR), (ICE, Index { n: 1.33, k: 0.0 })] {
            let (real, complex) = (
                Interface::dielectric(from, to),
                Interface::absorbing(from, to),
            );
            for c in cosines() {
                let sin_t = (1.0 - c * c).sqrt() * from.n / to.n;
                let expected = (1.0 - sin_t * sin_t).max(0.0).sqrt();
                assert!((real.one(c).1 - expected).abs() < 1e-7);
                assert!((complex.one(c).1 - expected).abs() < 1e-7);
                assert!((real.one(c).0 - complex.one(c).0).abs() < 1e-7);
            }
        }
    }

    #[test]
    fn directions_stay_unit_and_in_the_plane_of_incidence() {
        let splat = F64x8::splat;
        let m = Vec3x8::new(splat(0.2), splat(-0.3), splat(0.9)).unit();
        let water = Index { n: 1.3, k: 1e-3 };
        for (from, to) in [
            (AIR, ICE),
            (ICE, AIR),
            (water, ICE),
            (ICE, water),
            (AIR, water),
        ] {
            for interface in [
                Interface::dielectric(from, to),
                Interface::absorbing(from, to),
            ] {
                let interface = interface.splat();
                for cos in cosines() {
                    let c = splat(cos);
                    let zero = |x: F64x8| {
                        assert!(x.to_array()[0].abs() < 1e-7, "{from:?} {to:?} {cos}");
                    };
                    let d = (m.frame().0 * splat((1.0 - cos * cos).sqrt())).plus(-c, m);
                    let at = interface.incidences(c);
                    let refracted = interface.refract_or_graze(d, m, c, &at);
                    if cos > 0.9 {
                        let plain = interface.refract(d, m, c, &at);
                        zero((plain + refracted * -F64x8::ONE).dot(m.frame().0));
                    }
                    zero(refracted.dot(refracted) - F64x8::ONE);
                    zero(refracted.dot(m) + at.cos_refracted);
                    let mirrored = reflect(d, m, c);
                    zero(mirrored.dot(m) - c);
                    zero(mirrored.dot(mirrored) - F64x8::ONE);
                }
            }
        }
    }

    /// Error from neglecting the imaginary index, averaged over directions (the
    /// difference peaks in a narrow band at the critical angle).
    #[test]
    fn dielectric_formulas_hold_up_to_their_limit() {
        let ice = Index {
            n: 1.295,
            k: Interface::DIELECTRIC_K,
        };
        for (from, to) in [(AIR, ice), (ice, AIR)] {
            let (real, complex) = (
                Interface::dielectric(from, to),
                Interface::absorbing(from, to),
            );
            let n = 1_000_000;
            let mut difference = 0.0;
            let mut bend = 0.0;
            for i in 0..n {
                let c = ((f64::from(i) + 0.5) / f64::from(n)).sqrt(); // cosine-weighted
                let (a, b) = (real.one(c), complex.one(c));
                difference += (a.0 - b.0).abs() / f64::from(n);
                bend += (a.1 - b.1).abs() / f64::from(n);
            }
            // both grow linearly in k, by about 3.7 k and 2 k inside the ice
            assert!(difference < 4e-6, "reflectance {difference:e}");
            assert!(bend < 4e-6, "refraction {bend:e}");
        }
    }
}
