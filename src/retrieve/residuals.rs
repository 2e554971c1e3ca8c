//! Measured and fitted values, and their differences by band.
use splitsnow_retrieval::{Inverse, Posterior, Scratch};

use super::setup::Setup;
use crate::measurement::Quantity;
use crate::spectrum::Band;

/// Number of draws from which the spread of the fitted spectra is computed.
const DRAWS: usize = 200;

/// One wavelength of a fitted spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FittedValue {
    /// The wavelength, nm.
    pub nm: f64,
    /// The measured value.
    pub measured: f64,
    /// The value of the most probable snow.
    pub fitted: f64,
    /// Standard deviation of the fitted value over the credible snows.
    pub fitted_sd: f64,
    /// Standard deviation of the measured value, from all stated errors.
    pub sigma: f64,
}

impl FittedValue {
    /// Fitted minus measured, in units of `sigma`.
    #[must_use]
    pub fn residual(&self) -> f64 {
        (self.fitted - self.measured) / self.sigma
    }
}

/// A measured spectrum and its fit.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedSpectrum {
    /// Name of the measured spectrum.
    pub name: String,
    /// What was measured.
    pub quantity: Quantity,
    /// What is known of this spectrum alone, as text.
    pub known: String,
    /// One per wavelength.
    pub values: Vec<FittedValue>,
}

/// Differences in one band.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BandResiduals {
    /// The band.
    pub band: Band,
    /// Number of wavelengths.
    pub values: usize,
    /// Mean of fitted minus measured.
    pub bias: f64,
    /// Root mean square of fitted minus measured.
    pub rmse: f64,
    /// The same in units of the stated errors.
    pub in_sigma: f64,
}

impl FittedSpectrum {
    /// The differences in each band with wavelengths.
    #[must_use]
    pub fn bands(&self) -> Vec<BandResiduals> {
        let of = |band: Band| {
            let inside = || {
                self.values
                    .iter()
                    .filter(move |v| Band::containing(v.nm) == band)
            };
            let count = inside().count();
            let mean = |part: &dyn Fn(&FittedValue) -> f64| -> f64 {
                inside().map(part).sum::<f64>() / count as f64
            };
            (count > 0).then(|| BandResiduals {
                band,
                values: count,
                bias: mean(&|v| v.fitted - v.measured),
                rmse: mean(&|v| (v.fitted - v.measured).powi(2)).sqrt(),
                in_sigma: mean(&|v| v.residual().powi(2)).sqrt(),
            })
        };
        Band::ALL.into_iter().filter_map(of).collect()
    }
}

/// The fitted spectra at the places `u`; `offsets` are added to the modelled values.
pub(super) fn fitted(
    setup: &Setup,
    inverse: &Inverse<'_>,
    u: &[f64],
    posterior: &Posterior,
    offsets: &[f64],
) -> Vec<FittedSpectrum> {
    let mut scratch = Scratch::default();
    let n = setup.values();
    let (mut best, mut drawn) = (vec![0.0; n], vec![0.0; n]);
    inverse.model(u, &mut scratch, &mut best);
    let (mut sum, mut squares, mut count) = (vec![0.0; n], vec![0.0; n], 0.0);
    for i in posterior.draws(DRAWS) {
        if inverse.model(&posterior.points[i], &mut scratch, &mut drawn) {
            count += 1.0;
            for (i, value) in drawn.iter().enumerate() {
                let away = value - best[i];
                sum[i] += away;
                squares[i] += away * away;
            }
        }
    }
    let sd = |i: usize| {
        let mean: f64 = sum[i] / count;
        (squares[i] / count - mean * mean).max(0.0).sqrt()
    };
    let sigma = setup.sigmas();
    let nm = setup.wavelengths_nm();
    let mut at = 0;
    let mut spectra = Vec::new();
    for input in setup.inputs() {
        let value = |(k, index): (usize, &usize)| FittedValue {
            nm: nm[*index],
            measured: input.values[k],
            fitted: best[at + k] + offsets[at + k],
            fitted_sd: sd(at + k),
            sigma: sigma[at + k],
        };
        let known: Vec<String> = input
            .fixed
            .iter()
            .map(|fixed| format!("{} = {}", fixed.named.name(), fixed.value))
            .collect();
        spectra.push(FittedSpectrum {
            name: input.name.clone(),
            quantity: input.quantity,
            known: known.join(", "),
            values: input.indices.iter().enumerate().map(value).collect(),
        });
        at += input.values.len();
    }
    spectra
}
