//! The table of a look-up: y and its slope along the thickness at every node, from the curves of a
//! database. y and the variables of the interpolation are those of [`super`].
use splitsnow_spectra::Quantity;
use splitsnow_spectra::elementary::ln;
use splitsnow_spectra::simd::{F32x8, F64x8, Simd, SimdKernel, dispatch};

use super::{DARKEST, LANES, Lookup, THICKNESS, THIN, wide};
use crate::diffusion::Diffusion;
use crate::monotone::{secants, shares, slopes};
use crate::parameter::thickness_slope;

/// y of transmittances or reflectances.
struct DepthsKernel<'a> {
    quantity: Quantity,
    values: &'a [f32],
    y: &'a mut [f32],
}

impl SimdKernel for DepthsKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let (darkest, one) = (F64x8::splat(f64::from(libm::expf(-DARKEST))), F64x8::ONE);
        for (values, y) in self.values.chunks(8).zip(self.y.chunks_mut(8)) {
            let linear: F64x8<S> = match self.quantity {
                Quantity::Transmittance => wide(values),
                Quantity::Reflectance => one - wide(values),
            };
            let logarithm = ln(linear.max(darkest).min(one)).to_array();
            for (y, logarithm) in y.iter_mut().zip(logarithm) {
                *y = -(logarithm as f32);
            }
        }
    }
}

/// Spectra of y at the extra nodes below the first thickness.
struct ThinKernel<'a> {
    first_cm: f32,
    /// y at the first thickness, per wavelength.
    y: &'a [f32],
    /// Derivative of y there, 1/cm.
    slopes_per_cm: &'a [f32],
    /// Receives the spectra.
    spectra: &'a mut [Vec<f32>; THIN.len()],
}

impl SimdKernel for ThinKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let chunks = self.y.chunks(8).zip(self.slopes_per_cm.chunks(8));
        for (chunk, (y, slopes)) in chunks.enumerate() {
            let node = Diffusion::<S> {
                y: wide(y),
                slope_per_cm: wide(slopes),
                before: F64x8::ZERO,
                step_cm: f64::from(self.first_cm),
            };
            let thinner = node.thinner(THIN.map(f64::from));
            for (spectrum, thinner) in self.spectra.iter_mut().zip(thinner) {
                let pairs = spectrum[8 * chunk..].iter_mut().zip(thinner.to_array());
                pairs.for_each(|(to, y)| *to = y as f32);
            }
        }
    }
}

impl Lookup {
    /// The table of the snow with this number, column by column.
    pub(super) fn filled(&self, snow: usize) -> Box<[F32x8]> {
        let [_, n_g, n_d, n_h, n_a] = self.values.each_ref().map(Vec::len);
        let thin = self.thin_count();
        let rows = thin + n_h;
        let angles = self.angles();
        let mut table = vec![F32x8::ZERO; rows * angles * self.width];
        let depth = match self.components {
            0 => self.wavelengths,
            components => components,
        };
        let mut y = vec![vec![0.0; depth]; rows];
        let [mut slopes, mut lines] = [y.clone(), y.clone()];
        let mut curve = vec![0.0; depth];
        let mut values = vec![0.0; depth];
        let absent = self.absent.get(snow / n_d % n_g).copied();
        let absent = absent.unwrap_or_default();
        for angle in 0..n_a {
            for h in 0..n_h {
                let row = (snow * n_h + h) * n_a + angle;
                let (before, here) = y.split_at_mut(thin + h);
                if h < absent {
                    here[0].fill(0.0);
                    continue;
                }
                if self.components == 0 {
                    curve.fill(0.0);
                    self.factors.add_row(row, &mut curve);
                    for (value, sum) in values.iter_mut().zip(&curve) {
                        *value = *sum as f32;
                    }
                    dispatch(DepthsKernel {
                        quantity: self.quantity,
                        values: &values,
                        y: &mut here[0],
                    });
                    // Noise must not make a slab transmit more, or reflect less, than a
                    // thinner slab. Over a substrate, more snow may reflect less.
                    if let Some(least) = before.last().filter(|_| h > 0 && thin > 0) {
                        for (y, least) in here[0].iter_mut().zip(least) {
                            *y = y.max(*least);
                        }
                    }
                } else {
                    let coefficients = self.factors.coefficients.row(row);
                    let pairs = here[0].iter_mut().zip(coefficients);
                    pairs.for_each(|(y, c)| *y = *c);
                }
            }
            // slopes use existing nodes only
            let begin = if absent > 0 { thin + absent } else { 0 };
            y[..begin].iter_mut().for_each(|y| y.fill(0.0));
            if thin > 0 && begin == 0 {
                self.fill_thin(&mut y);
            }
            slopes[..begin]
                .iter_mut()
                .for_each(|slopes| slopes.fill(0.0));
            self.slopes(&y[begin..], &mut slopes[begin..], &mut lines);
            for h in 0..rows {
                let node = (h * angles + angle) * self.width;
                let vectors = table[node..node + self.width].iter_mut();
                let pairs = y[h].chunks(LANES).zip(slopes[h].chunks(LANES));
                for (vector, (y, slopes)) in vectors.zip(pairs) {
                    let (values, slopes_to) = vector.as_mut_array().split_at_mut(LANES);
                    values[..y.len()].copy_from_slice(y);
                    for (to, slope) in slopes_to.iter_mut().zip(slopes) {
                        // numbers from a malicious file may overflow
                        *to = if slope.is_finite() { *slope } else { 0.0 };
                    }
                }
                if n_a == 1 {
                    table.copy_within(node..node + self.width, node + self.width);
                }
            }
        }
        table.into_boxed_slice()
    }

    /// Fills the extra nodes below the first thickness of a column.
    fn fill_thin(&self, y: &mut [Vec<f32>]) {
        let first_cm = self.values[THICKNESS][0];
        let (thin, nodes) = y.split_at_mut(THIN.len());
        let x = &self.places[THICKNESS][THIN.len()..];
        thin.iter_mut().for_each(|y| y.fill(0.0));
        // a parabola through three nodes
        let count = nodes.len().min(3);
        let spectra: Vec<Vec<f32>> = nodes[..count].iter().map(|y| self.spectral(y)).collect();
        let scale = thickness_slope(first_cm);
        let mut at_first = spectra[0].clone();
        if count > 1 {
            let mut lines = spectra.clone();
            secants(&x[..count], &spectra, &mut lines);
            slopes(&x[..count], &lines, 0, &mut at_first);
        }
        for slope in &mut at_first {
            *slope = scale
                * match count {
                    1 => *slope / x[0].max(f32::MIN_POSITIVE),
                    _ => slope.max(0.0),
                };
        }
        let mut found = THIN.map(|_| vec![0.0; self.wavelengths]);
        dispatch(ThinKernel {
            first_cm,
            y: &spectra[0],
            slopes_per_cm: &at_first,
            spectra: &mut found,
        });
        for (thin, spectrum) in thin.iter_mut().zip(&found) {
            if self.components == 0 {
                thin.copy_from_slice(spectrum);
                continue;
            }
            self.add_nearest(spectrum, thin);
        }
    }

    /// Adds to `components` the coefficients of the spectrum of the basis nearest to `spectrum`.
    fn add_nearest(&self, spectrum: &[f32], components: &mut [f32]) {
        let chunks = spectrum
            .chunks(8)
            .zip(self.basis.chunks(self.width * LANES));
        for (y, vectors) in chunks {
            for (i, y) in y.iter().enumerate() {
                for (c, vector) in components.iter_mut().zip(vectors) {
                    *c += y * vector.as_array()[i];
                }
            }
        }
    }

    /// Writes limited slopes of a column or of its last nodes, `[h][component]`. `lines` is working
    /// memory of the size of a column.
    fn slopes(&self, y: &[Vec<f32>], limited: &mut [Vec<f32>], lines: &mut [Vec<f32>]) {
        let places = &self.places[THICKNESS];
        let x = &places[places.len() - y.len()..];
        if x.len() < 2 {
            return limited.iter_mut().for_each(|slopes| slopes.fill(0.0));
        }
        secants(x, y, lines);
        for (h, limited) in limited.iter_mut().enumerate() {
            slopes(x, lines, h, limited);
        }
        if self.components > 0 {
            return self.limit_spectra(x, y, limited);
        }
        let mut share = vec![0.0; limited[0].len()];
        for (h, limited) in limited.iter_mut().enumerate() {
            shares((h, x.len()), lines, limited, &mut share);
            for (slope, share) in limited.iter_mut().zip(&share) {
                *slope *= share;
            }
        }
    }

    /// Limits slopes of coefficients, `[h][component]`: takes from them what the limit takes from
    /// the slopes of the wavelengths, as nearly as the basis has it. A wavelength darker than
    /// [`DARKEST`] is left as it is, since its overshoot is invisible.
    fn limit_spectra(&self, x: &[f32], y: &[Vec<f32>], slopes_of_components: &mut [Vec<f32>]) {
        let spectra: Vec<Vec<f32>> = y.iter().map(|y| self.spectral(y)).collect();
        let mut lines = spectra.clone();
        secants(x, &spectra, &mut lines);
        let [mut slope, mut share] = [spectra[0].clone(), spectra[0].clone()];
        for (h, to) in slopes_of_components.iter_mut().enumerate() {
            slopes(x, &lines, h, &mut slope);
            shares((h, x.len()), &lines, &slope, &mut share);
            let mut change = false;
            for ((slope, share), y) in slope.iter_mut().zip(&share).zip(&spectra[h]) {
                *slope = match *y < DARKEST {
                    true => (share - 1.0) * *slope,
                    false => 0.0,
                };
                change |= *slope != 0.0;
            }
            if change {
                self.add_nearest(&slope, to);
            }
        }
    }
}
