//! A medium and the operators of its slabs.
use super::matrix::weighted_product;
use super::modes::Modes;
use super::{Matrix, SlabError, Streams};
use crate::math::exp_neg;

/// Relative excess of |chi_l| over chi_0 that is accepted as rounding.
const ROUNDING: f64 = 1e-12;

/// A homogeneous medium between index-matched planes, prepared for slabs of any thickness.
#[derive(Debug, Clone)]
pub struct Medium<'a> {
    pub(super) streams: &'a Streams,
    /// Moments used in the solution.
    pub(super) chi: Vec<f64>,
    /// Optical depth in the solution per given optical depth.
    scale: f64,
    /// `None` if nothing scatters.
    pub(super) modes: Option<Modes>,
}

/// The operators of a slab on the light in each stream. Illumination from below has the
/// same operators.
#[derive(Debug, Clone, PartialEq)]
pub struct Operators {
    /// `[n, n]`: column j holds the fluxes that leave on the illuminated side per unit flux
    /// incident along stream j.
    pub reflection: Matrix,
    /// `[n, n]`: the same for the far side, including unscattered light.
    pub transmission: Matrix,
}

impl<'a> Medium<'a> {
    /// The medium with these Legendre moments of single-scattering albedo times phase
    /// function: chi_l = albedo <P_l(cos Theta)>, so chi_0 is the albedo. The first 2 n
    /// moments are used; missing ones are 0.
    ///
    /// # Errors
    /// [`SlabError::Moment`] unless chi_0 is in [0, 1] and no other moment exceeds it;
    /// [`SlabError::Peaked`].
    pub fn new(streams: &'a Streams, chi: &[f64]) -> Result<Self, SlabError> {
        let albedo = checked_albedo(chi)?;
        let used = &chi[..chi.len().min(2 * streams.count())];
        Self::scaled(streams, used.to_vec(), 1.0 - albedo, 1.0)
    }

    /// The same medium after delta-M scaling (Wiscombe 1977): the forward peak that the
    /// streams cannot resolve, a fraction chi_2n of the extinction, counts as unscattered
    /// light. Thicknesses still refer to the full extinction.
    ///
    /// # Errors
    /// The errors of [`Self::new`].
    pub fn delta_m(streams: &'a Streams, chi: &[f64]) -> Result<Self, SlabError> {
        let albedo = checked_albedo(chi)?;
        let count = 2 * streams.count();
        let peak = chi.get(count).copied().unwrap_or(0.0);
        let scale = 1.0 - peak;
        if scale <= 0.0 {
            return Self::scaled(streams, Vec::new(), 1.0, 0.0);
        }
        let moments = chi.iter().take(count).map(|x| (x - peak) / scale);
        Self::scaled(streams, moments.collect(), (1.0 - albedo) / scale, scale)
    }

    fn scaled(
        streams: &'a Streams,
        chi: Vec<f64>,
        absorption: f64,
        scale: f64,
    ) -> Result<Self, SlabError> {
        let modes = if chi.iter().all(|&x| x == 0.0) {
            None
        } else {
            Some(Modes::new(streams, &chi, absorption)?)
        };
        Ok(Self {
            streams,
            chi,
            scale,
            modes,
        })
    }

    /// The operators of a slab of this optical thickness, 0 to infinity.
    ///
    /// # Errors
    /// [`SlabError::Thickness`].
    pub fn operators(&self, thickness: f64) -> Result<Operators, SlabError> {
        let thickness = self.solved_thickness(thickness)?;
        let streams = self.streams;
        let n = streams.count();
        let modes = match &self.modes {
            Some(modes) if thickness > 0.0 => modes,
            _ => {
                let direct = streams.cosines.iter();
                let direct: Vec<f64> = direct.map(|mu| exp_neg(thickness / mu)).collect();
                return Ok(Operators {
                    reflection: Matrix::zeros(n, n),
                    transmission: Matrix::diagonal(&direct),
                });
            }
        };
        let shapes = Shapes::new(&modes.rates, 0.5 * thickness);
        let even = shapes.even_solution(modes, modes.z.clone())?;
        let odd = shapes.odd_solution(modes, modes.y.clone())?;
        let mut transmission = weighted_product(&even, &shapes.sech_square, &odd);
        // R + T = 2 / (1 + P) - 1
        let mut reflection = weighted_product(&modes.z, &vec![2.0; n], &even);
        reflection.add_diagonal(&vec![-1.0; n]);
        reflection = &reflection - &transmission;
        transmission.scale_entries(&streams.flux_ratio);
        reflection.scale_entries(&streams.flux_ratio);
        Ok(Operators {
            reflection,
            transmission,
        })
    }

    pub(super) fn solved_thickness(&self, thickness: f64) -> Result<f64, SlabError> {
        if thickness.is_nan() || thickness < 0.0 {
            return Err(SlabError::Thickness { value: thickness });
        }
        Ok(if self.scale > 0.0 {
            thickness * self.scale
        } else {
            0.0
        })
    }
}

/// Returns chi_0 if the moments are those of a phase function.
fn checked_albedo(chi: &[f64]) -> Result<f64, SlabError> {
    let albedo = chi.first().copied().unwrap_or(0.0);
    for (l, &value) in chi.iter().enumerate() {
        let largest = if l == 0 {
            1.0
        } else {
            albedo * (1.0 + ROUNDING)
        };
        let least = if l == 0 { 0.0 } else { -largest };
        if value.is_nan() || value > largest || value < least {
            return Err(SlabError::Moment { l, value });
        }
    }
    Ok(albedo)
}

/// Functions of the decay rates k of the modes in a slab of half thickness h.
pub(super) struct Shapes {
    pub(super) half: f64,
    /// tanh(k h).
    pub(super) tanh: Vec<f64>,
    /// tanh(k h) / k.
    pub(super) tanh_over_rate: Vec<f64>,
    /// 1 / cosh(k h)^2; 0 if below 1e-303.
    pub(super) sech_square: Vec<f64>,
    /// k tanh(k h).
    rate_tanh: Vec<f64>,
}

impl Shapes {
    pub(super) fn new(rates: &[f64], half: f64) -> Self {
        let tanh: Vec<f64> = rates.iter().map(|k| tanh(k * half)).collect();
        Self {
            half,
            tanh_over_rate: tanh.iter().zip(rates).map(|(t, k)| t / k).collect(),
            sech_square: rates.iter().map(|k| sech_square(k * half)).collect(),
            rate_tanh: tanh.iter().zip(rates).map(|(t, k)| t * k).collect(),
            tanh,
        }
    }

    /// (Z^T Z + diag(k tanh(k h)))^-1 `right`.
    pub(super) fn even_solution(&self, modes: &Modes, right: Matrix) -> Result<Matrix, SlabError> {
        let mut left = modes.z_gram.clone();
        left.add_diagonal(&self.rate_tanh);
        left.solve_definite(right)
    }

    /// (Y^T Y + diag(tanh(k h) / k))^-1 `right`.
    pub(super) fn odd_solution(&self, modes: &Modes, right: Matrix) -> Result<Matrix, SlabError> {
        let mut left = modes.y_gram.clone();
        left.add_diagonal(&self.tanh_over_rate);
        left.solve_definite(right)
    }
}

/// tanh(x) for x >= 0, accurate to rounding also for small x.
pub(super) fn tanh(x: f64) -> f64 {
    if x > 20.0 {
        return 1.0;
    }
    let e = libm::expm1(-2.0 * x);
    -e / (2.0 + e)
}

/// 1 / cosh(x)^2 for x >= 0, with a relative error of about 4e-16 max(1, 2 x).
pub(super) fn sech_square(x: f64) -> f64 {
    let e = exp_neg(2.0 * x);
    4.0 * e / ((1.0 + e) * (1.0 + e))
}
