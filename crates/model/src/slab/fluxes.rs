//! Hemispherical fluxes of a slab illuminated by a collimated beam or by isotropic light.
use super::medium::{Shapes, sech_square, tanh};
use super::modes::Modes;
use super::streams::legendre;
use super::{Matrix, Medium, SlabError};
use splitsnow_spectra::simd::Portable;

use crate::math::exp_neg;

/// Illumination of a slab, from above.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Light {
    /// A collimated beam.
    Collimated {
        /// Cosine of its incidence angle, in (0, 1].
        cosine: f64,
    },
    /// Isotropic radiance.
    Diffuse,
}

/// Light that leaves a slab, as fractions of the incident flux.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fluxes {
    /// Flux leaving on the illuminated side.
    pub reflectance: f64,
    /// Flux leaving on the far side, including unscattered light.
    pub transmittance: f64,
}

impl Medium<'_> {
    /// Fluxes of a slab of this optical thickness, 0 to infinity.
    ///
    /// # Errors
    /// [`SlabError::Thickness`], [`SlabError::Cosine`].
    pub fn fluxes(&self, thickness: f64, light: Light) -> Result<Fluxes, SlabError> {
        match light {
            Light::Collimated { cosine } => self.beam(thickness, cosine),
            Light::Diffuse => self.diffuse(thickness),
        }
    }

    fn diffuse(&self, thickness: f64) -> Result<Fluxes, SlabError> {
        let operators = self.operators(thickness)?;
        let flux = &self.streams.flux;
        let total = |operator: &Matrix| {
            let rows = (0..flux.len()).map(|i| {
                let row = operator.row(i).iter().zip(flux);
                row.map(|(x, c)| 2.0 * c * c * x).sum::<f64>()
            });
            rows.sum()
        };
        Ok(Fluxes {
            reflectance: total(&operators.reflection),
            transmittance: total(&operators.transmission),
        })
    }

    fn beam(&self, thickness: f64, cosine: f64) -> Result<Fluxes, SlabError> {
        if cosine.is_nan() || cosine <= 0.0 || cosine > 1.0 {
            return Err(SlabError::Cosine { value: cosine });
        }
        let thickness = self.solved_thickness(thickness)?;
        let rate = 1.0 / cosine;
        let direct = exp_neg(thickness * rate);
        let modes = match &self.modes {
            Some(modes) if thickness > 0.0 => modes,
            _ => {
                return Ok(Fluxes {
                    reflectance: 0.0,
                    transmittance: direct,
                });
            }
        };
        let shapes = Shapes::new(&modes.rates, 0.5 * thickness);
        let Beam { both, far } = Beam::new(self, modes, &shapes, cosine)?;
        let flux = column(&self.streams.flux);
        let out = &modes.z * &flux;
        let leaving = |amplitudes: &Matrix| -> f64 {
            (0..out.rows())
                .map(|m| out[(m, 0)] * amplitudes[(m, 0)])
                .sum()
        };
        let transmitted = leaving(&far);
        Ok(Fluxes {
            reflectance: 2.0 * leaving(&both) - transmitted,
            transmittance: transmitted + direct,
        })
    }
}

/// Amplitudes, by mode, of the light scattered out of a beam of unit flux. Their product
/// with Z gives the symmetrised intensities.
struct Beam {
    /// Half the sum over both sides.
    both: Matrix,
    /// The far side.
    far: Matrix,
}

impl Beam {
    /// The last column of the operators with an additional stream of weight 0 along the
    /// beam (see Beams in the module documentation).
    fn new(
        medium: &Medium,
        modes: &Modes,
        shapes: &Shapes,
        cosine: f64,
    ) -> Result<Self, SlabError> {
        let kappa = 1.0 / cosine;
        let (even, odd) = medium.beam_sources(cosine);
        let z_even = &modes.z * &even;
        let y_even = &modes.y * &even;
        let y_odd = &modes.y * &odd;
        let beam_tanh = tanh(kappa * shapes.half);
        let beam_sech_square = sech_square(kappa * shapes.half);

        let n = modes.rates.len();
        let mut p = Matrix::zeros(n, 1);
        let mut q = Matrix::zeros(n, 1);
        let mut rest = Matrix::zeros(n, 1);
        for (m, &k) in modes.rates.iter().enumerate() {
            let (a, b) = (z_even[(m, 0)], y_odd[(m, 0)]);
            let slope = tanh_slope(k, kappa, shapes.half);
            let sum = k + kappa;
            // divided differences over k^2 of tanh(k h) k, tanh(k h) / k, 1 / cosh^2
            let u = (k * slope + beam_tanh) / sum;
            let v = (shapes.tanh_over_rate[m] - slope) / sum;
            let g = -(shapes.tanh[m] + beam_tanh) * slope / sum;
            p[(m, 0)] = u * a - k * k * v * b;
            q[(m, 0)] = u * b + (slope + shapes.tanh[m] / kappa) / sum * a + y_even[(m, 0)] / kappa;
            rest[(m, 0)] = -(k * k * g + beam_sech_square) * a / kappa - g * k * k * b;
        }
        let odd = shapes.odd_solution(modes, q)?;
        let share = 1.0 / (1.0 + beam_tanh);
        let mut far = Matrix::zeros(n, 1);
        for m in 0..n {
            let source = shapes.sech_square[m] * odd[(m, 0)]
                + rest[(m, 0)]
                + p[(m, 0)] * beam_sech_square * share;
            far[(m, 0)] = source * share;
            p[(m, 0)] *= share;
        }
        Ok(Self {
            both: shapes.even_solution(modes, p)?,
            far: shapes.even_solution(modes, far)?,
        })
    }
}

impl Medium<'_> {
    /// The source vectors a and b of a beam of unit flux, in the equations of the
    /// differences and of the sums.
    fn beam_sources(&self, cosine: f64) -> (Matrix, Matrix) {
        let streams = self.streams;
        let n = streams.count();
        let terms = legendre(self.chi.len(), cosine);
        let [mut even, mut odd] = [Matrix::zeros(1, n), Matrix::zeros(1, n)];
        for (l, (chi, p)) in self.chi.iter().zip(terms).enumerate() {
            let term = chi * (2.0 * l as f64 + 1.0) * p;
            let source = if l % 2 == 0 { &mut even } else { &mut odd };
            let (row, moment) = (source.wide_row_mut(0), streams.legendre.wide_row(l));
            super::matrix::add_scaled::<Portable>(row, term, moment);
        }
        for (i, (w, mu)) in streams.weights.iter().zip(&streams.cosines).enumerate() {
            let factor = (w / mu).sqrt() / cosine;
            even[(0, i)] *= factor;
            odd[(0, i)] *= factor;
        }
        (even.transposed(), odd.transposed())
    }
}

/// (tanh(a h) - tanh(b h)) / (a - b) for a, b > 0, accurate also if a and b are equal or
/// both tanh round to 1.
fn tanh_slope(a: f64, b: f64, half: f64) -> f64 {
    let (a, b) = if a < b { (a, b) } else { (b, a) };
    let decay = exp_neg(2.0 * a * half);
    if decay == 0.0 {
        return 0.0;
    }
    let gap = b - a;
    let rise = if gap > 0.0 {
        -libm::expm1(-2.0 * gap * half) / gap
    } else {
        2.0 * half
    };
    2.0 * decay * rise / ((1.0 + decay) * (1.0 + exp_neg(2.0 * b * half)))
}

/// A matrix with one column.
fn column(entries: &[f64]) -> Matrix {
    Matrix::from_fn(entries.len(), 1, |i, _| entries[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn divided_difference_of_tanh_is_accurate() {
        for half in [1e-9, 0.3, 2.0] {
            for (a, b) in [(1.0, 2.5), (1e-100, 1.7), (0.2, 3.0)] {
                let direct = (libm::tanh(b * half) - libm::tanh(a * half)) / (b - a);
                for slope in [tanh_slope(a, b, half), tanh_slope(b, a, half)] {
                    // the direct form has the rounding errors of two tanh
                    assert!((slope / direct - 1.0).abs() < 4e-15, "{a} {b} {half}");
                }
            }
            let derivative = half * sech_square(1.3 * half);
            for b in [1.3, 1.3 + 1e-15, 1.3 + 1e-12] {
                let slope = tanh_slope(1.3, b, half);
                assert!((slope / derivative - 1.0).abs() < 1e-11, "{b} {half}");
            }
        }
        assert_eq!(tanh_slope(1.0, 1.0, f64::INFINITY), 0.0);
        assert_eq!(tanh_slope(1e-100, 2.0, 1e8), (1.0 - 1e-100 * 1e8) / 2.0);
    }

    #[test]
    fn hyperbolic_functions_match_libm() {
        for x in [0.0, 1e-200, 1e-9, 0.1, 1.0, 5.0, 19.9, 20.1, 300.0] {
            assert!((tanh(x) - libm::tanh(x)).abs() <= 4e-16 * x.min(1.0));
            let exact = 1.0 / libm::cosh(x).powi(2);
            assert!((sech_square(x) / exact - 1.0).abs() < 1e-15 * x.max(1.0));
        }
        assert_eq!(
            (tanh(f64::INFINITY), sech_square(f64::INFINITY)),
            (1.0, 0.0)
        );
    }
}
