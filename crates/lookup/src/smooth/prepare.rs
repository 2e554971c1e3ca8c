//! The table of a look-up: y and its slope along the thickness at every node, from the curves of a
//! database. y and the variables of the interpolation are those of [`super`].
use splitsnow_spectra::Quantity;
use splitsnow_spectra::elementary::ln;
use splitsnow_spectra::simd::{F32x8, F64x8, Simd, SimdKernel};

use super::{DARKEST, LANES, Lookup, THICKNESS, THIN, wide};
use crate::Database;
use crate::diffusion::Diffusion;
use crate::monotone::{secants, shares, slopes};
use crate::parameter::thickness_slope;

/// The table of a look-up, made with the best instruction set.
pub(super) struct FillKernel<'a> {
    pub(super) lookup: &'a Lookup,
    pub(super) database: &'a Database,
    /// Number of components, or of wavelengths.
    pub(super) depth: usize,
}

impl SimdKernel for FillKernel<'_> {
    type Output = Vec<F32x8>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        self.lookup.filled::<S>(self.database, self.depth)
    }
}

impl Lookup {
    /// The table of a database, column by column, with `depth` components.
    #[inline(always)]
    fn filled<S: Simd>(&self, database: &Database, depth: usize) -> Vec<F32x8> {
        let [n_f, n_g, n_d, n_h, n_a] = self.values.each_ref().map(Vec::len);
        let thin = self.thin_count();
        let rows = thin + n_h;
        let mut table = vec![F32x8::ZERO; n_f * n_g * n_d * rows * n_a * self.width];
        let mut y = vec![vec![0.0; depth]; rows];
        let [mut slopes, mut lines] = [y.clone(), y.clone()];
        for (snow, angle) in (0..n_f * n_g * n_d).flat_map(|s| (0..n_a).map(move |a| (s, a))) {
            let absent = self
                .absent
                .get(snow / n_d % n_g)
                .copied()
                .unwrap_or_default();
            for h in 0..n_h {
                let row = (snow * n_h + h) * n_a + angle;
                let (before, here) = y.split_at_mut(thin + h);
                if h < absent {
                    here[0].fill(0.0);
                    continue;
                }
                if self.components == 0 {
                    let curve = database.curve(row, self.quantity).unwrap_or_default();
                    self.depths_of::<S>(&curve, &mut here[0]);
                    // Noise must not make a slab transmit more, or reflect less, than a
                    // thinner slab. Over a substrate, more snow may reflect less.
                    if let Some(least) = before.last().filter(|_| h > 0 && thin > 0) {
                        for (y, least) in here[0].iter_mut().zip(least) {
                            *y = y.max(*least);
                        }
                    }
                } else {
                    let coefficients = database.coefficients(self.quantity);
                    let pairs = here[0].iter_mut().zip(coefficients.row(row));
                    pairs.for_each(|(y, c)| *y = *c);
                }
            }
            // slopes use existing nodes only
            let begin = if absent > 0 { thin + absent } else { 0 };
            y[..begin].iter_mut().for_each(|y| y.fill(0.0));
            if thin > 0 && begin == 0 {
                self.fill_thin::<S>(&mut y);
            }
            slopes[..begin]
                .iter_mut()
                .for_each(|slopes| slopes.fill(0.0));
            self.slopes::<S>(&y[begin..], &mut slopes[begin..], &mut lines);
            for h in 0..rows {
                let node = ((snow * rows + h) * n_a + angle) * self.width;
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
            }
        }
        table
    }

    /// Fills the extra nodes below the first thickness of a column.
    #[inline(always)]
    fn fill_thin<S: Simd>(&self, y: &mut [Vec<f32>]) {
        let first_cm = self.values[THICKNESS][0];
        let (thin, nodes) = y.split_at_mut(THIN.len());
        let x = &self.places[THICKNESS][THIN.len()..];
        thin.iter_mut().for_each(|y| y.fill(0.0));
        // a parabola through three nodes
        let count = nodes.len().min(3);
        let spectra: Vec<Vec<f32>> = nodes[..count]
            .iter()
            .map(|y| self.spectral::<S>(y))
            .collect();
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
        for (chunk, (y, slopes)) in spectra[0].chunks(8).zip(at_first.chunks(8)).enumerate() {
            let node = Diffusion::<S> {
                y: wide(y),
                slope_per_cm: wide(slopes),
                before: F64x8::ZERO,
                step_cm: f64::from(first_cm),
            };
            for (thin, y) in thin.iter_mut().zip(node.thinner(THIN.map(f64::from))) {
                let y = y.to_array().map(|y| y as f32);
                let l = 8 * chunk..(8 * chunk + 8).min(spectra[0].len());
                if self.components == 0 {
                    let count = l.len();
                    thin[l].copy_from_slice(&y[..count]);
                    continue;
                }
                let vectors = &self.basis[chunk * self.components..];
                for (i, y) in y[..l.len()].iter().enumerate() {
                    for (c, vector) in thin.iter_mut().zip(vectors) {
                        *c += y * vector.as_array()[i];
                    }
                }
            }
        }
    }

    /// Writes y of transmittances or reflectances to `y`.
    #[inline(always)]
    fn depths_of<S: Simd>(&self, values: &[f32], y: &mut [f32]) {
        let (darkest, one) = (F64x8::splat(f64::from(libm::expf(-DARKEST))), F64x8::ONE);
        for (values, y) in values.chunks(8).zip(y.chunks_mut(8)) {
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

    /// Writes limited slopes of a column or of its last nodes, `[h][component]`. `lines` is working
    /// memory of the size of a column.
    #[inline(always)]
    fn slopes<S: Simd>(&self, y: &[Vec<f32>], limited: &mut [Vec<f32>], lines: &mut [Vec<f32>]) {
        let places = &self.places[THICKNESS];
        let x = &places[places.len() - y.len()..];
        if x.len() < 2 {
            return limited.iter_mut().for_each(|slopes| slopes.fill(0.0));
        }
        // one share for all wavelengths, so that the spectrum stays one of the basis
        let common = match self.components {
            0 => Vec::new(),
            _ => self.common_shares::<S>(x, y),
        };
        secants(x, y, lines);
        let mut share = vec![0.0; limited[0].len()];
        for (h, limited) in limited.iter_mut().enumerate() {
            slopes(x, lines, h, limited);
            match common.get(h) {
                Some(common) => share.fill(*common),
                None => shares((h, x.len()), lines, limited, &mut share),
            }
            for (slope, share) in limited.iter_mut().zip(&share) {
                *slope *= share;
            }
        }
    }

    /// For each node of a column, the smallest share of the slopes over the wavelengths.
    #[inline(always)]
    fn common_shares<S: Simd>(&self, x: &[f32], y: &[Vec<f32>]) -> Vec<f32> {
        let spectra: Vec<Vec<f32>> = y.iter().map(|y| self.spectral::<S>(y)).collect();
        let mut lines = spectra.clone();
        secants(x, &spectra, &mut lines);
        let [mut slope, mut share] = [spectra[0].clone(), spectra[0].clone()];
        let mut common = Vec::with_capacity(x.len());
        for h in 0..x.len() {
            slopes(x, &lines, h, &mut slope);
            shares((h, x.len()), &lines, &slope, &mut share);
            common.push(share.iter().copied().fold(1.0, f32::min));
        }
        common
    }
}
