//! Measured spectra and unknowns: residuals, which are differences of reflectance or
//! transmittance in units of their errors, and their derivatives by finite differences. Unknowns
//! are places, 0 to 1 of their range; beyond it there is no spectrum.
use nalgebra::DMatrix;
use splitsnow_lookup::Point;

use crate::{Emulator, Unknown, Whitening};

/// Half the step of derivatives, as a place.
const STEP: f64 = 0.004;

/// A measured spectrum, or a part of one.
#[derive(Debug, Clone)]
pub struct Observation<'a> {
    emulator: &'a Emulator,
    whitening: &'a Whitening,
    /// Indices of the wavelengths of the emulator.
    indices: &'a [usize],
    /// Values that are known for this spectrum.
    fixed: Point,
    measured: Vec<f64>,
    /// `measured`, whitened without the level.
    whitened: Vec<f64>,
    level_part: f64,
}

impl<'a> Observation<'a> {
    /// The values `measured` at the wavelengths `indices` of `emulator`. `fixed` holds the values
    /// that are known for this spectrum.
    ///
    /// # Panics
    /// If `measured`, `indices` and `whitening` have different lengths.
    #[must_use]
    pub fn new(
        emulator: &'a Emulator,
        whitening: &'a Whitening,
        indices: &'a [usize],
        fixed: Point,
        measured: Vec<f64>,
    ) -> Self {
        assert_eq!(measured.len(), indices.len(), "one value per wavelength");
        let mut whitened = vec![0.0; whitening.len()];
        whitening.apply(&measured, &mut whitened);
        assert_eq!(whitened.len(), measured.len(), "one error per value");
        Self {
            level_part: whitening.level_part(&whitened),
            emulator,
            whitening,
            indices,
            fixed,
            measured,
            whitened,
        }
    }

    /// The measured values.
    #[must_use]
    pub fn measured(&self) -> &[f64] {
        &self.measured
    }

    /// The indices of the wavelengths of the emulator.
    #[must_use]
    pub fn indices(&self) -> &[usize] {
        self.indices
    }

    /// The emulator.
    #[must_use]
    pub fn emulator(&self) -> &'a Emulator {
        self.emulator
    }

    /// The known values.
    #[must_use]
    pub fn fixed(&self) -> Point {
        self.fixed
    }

    /// Writes the whitened difference of `modelled` and the measured values to `out`. The level
    /// belongs to the measured values.
    pub fn whiten(&self, modelled: &[f64], out: &mut [f64]) {
        self.whitening.apply(modelled, out);
        let pairs = out.iter_mut().zip(&self.whitened);
        pairs.for_each(|(value, measured)| *value -= measured);
        if self.level_part > 0.0 {
            let along: f64 = out.iter().zip(&self.whitened).map(|(r, y)| r * y).sum();
            let factor = self.level_part * along;
            let pairs = out.iter_mut().zip(&self.whitened);
            pairs.for_each(|(value, measured)| *value -= factor * measured);
        }
    }
}

/// Working memory of one thread.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    single: Vec<f32>,
    spectrum: Vec<f64>,
    selected: Vec<f64>,
}

/// Unknowns and the spectra that depend on them.
#[derive(Debug, Clone)]
pub struct Inverse<'a> {
    unknowns: &'a [Unknown],
    observations: Vec<Observation<'a>>,
}

impl<'a> Inverse<'a> {
    /// The problem of finding `unknowns` (at least one) from `observations`.
    #[must_use]
    pub fn new(unknowns: &'a [Unknown], observations: Vec<Observation<'a>>) -> Self {
        Self {
            unknowns,
            observations,
        }
    }

    /// The unknowns.
    #[must_use]
    pub fn unknowns(&self) -> &'a [Unknown] {
        self.unknowns
    }

    /// The observations.
    #[must_use]
    pub fn observations(&self) -> &[Observation<'a>] {
        &self.observations
    }

    /// Number of measured values.
    #[must_use]
    pub fn values(&self) -> usize {
        self.observations.iter().map(|o| o.measured.len()).sum()
    }

    /// The point at the places `u` with the known values of `observation`.
    #[must_use]
    pub fn point(&self, observation: &Observation<'_>, u: &[f64]) -> Point {
        let pairs = self.unknowns.iter().zip(u);
        let mut point = observation.fixed;
        pairs.for_each(|(unknown, u)| point.set(unknown.parameter(), unknown.value(*u)));
        point
    }

    /// Writes the modelled values of all observations to `out`; false if a look-up fails, because
    /// grains do not fit into a slab.
    pub fn model(&self, u: &[f64], scratch: &mut Scratch, out: &mut [f64]) -> bool {
        let mut at = 0;
        for observation in &self.observations {
            let (single, spectrum) = (&mut scratch.single, &mut scratch.spectrum);
            let point = self.point(observation, u);
            if observation
                .emulator
                .spectrum(point, single, spectrum)
                .is_err()
            {
                return false;
            }
            for (to, index) in out[at..].iter_mut().zip(observation.indices) {
                *to = spectrum[*index];
            }
            at += observation.indices.len();
        }
        true
    }

    /// Writes the whitened residuals to `out`, `[values]`. Returns their sum of squares and that
    /// of the prior; infinite where the model has no spectrum.
    pub fn residuals(&self, u: &[f64], scratch: &mut Scratch, out: &mut [f64]) -> [f64; 2] {
        let mut modelled = std::mem::take(&mut scratch.selected);
        modelled.resize(out.len(), 0.0);
        let exists = self.model(u, scratch, &mut modelled);
        if exists {
            let mut at = 0;
            for observation in &self.observations {
                let range = at..at + observation.measured.len();
                observation.whiten(&modelled[range.clone()], &mut out[range.clone()]);
                at = range.end;
            }
        }
        scratch.selected = modelled;
        match exists {
            true => [out.iter().map(|r| r * r).sum(), self.prior_square(u)],
            false => [f64::INFINITY; 2],
        }
    }

    /// -2 times the logarithm of the prior, without a constant.
    fn prior_square(&self, u: &[f64]) -> f64 {
        let gaussians = self.unknowns.iter().zip(u);
        let squares = gaussians.filter_map(|(unknown, u)| {
            let [mean, sd] = unknown.gaussian()?;
            Some(((u - mean) / sd).powi(2))
        });
        squares.sum()
    }

    /// Minus twice the logarithm of the posterior density of the places, without a constant.
    pub fn cost(&self, u: &[f64], scratch: &mut Scratch, out: &mut [f64]) -> f64 {
        self.residuals(u, scratch, out).iter().sum()
    }

    /// Derivatives of the whitened residuals with the places, `[values, unknowns]`, by differences
    /// about `u`; `None` where the model has no spectrum.
    pub fn jacobian(&self, u: &[f64], scratch: &mut Scratch) -> Option<DMatrix<f64>> {
        self.differences(u, |inverse, u, out| {
            inverse.cost(u, scratch, out).is_finite()
        })
    }

    /// Derivatives of the modelled values with the values of the unknowns, `[values, unknowns]`;
    /// `None` where the model has no spectrum.
    pub fn sensitivity(&self, u: &[f64], scratch: &mut Scratch) -> Option<DMatrix<f64>> {
        let mut found = self.differences(u, |inverse, u, out| inverse.model(u, scratch, out))?;
        for (i, unknown) in self.unknowns.iter().enumerate() {
            let slope = unknown.slope(u[i]);
            found.column_mut(i).iter_mut().for_each(|d| *d /= slope);
        }
        Some(found)
    }

    fn differences(
        &self,
        u: &[f64],
        mut evaluate: impl FnMut(&Self, &[f64], &mut [f64]) -> bool,
    ) -> Option<DMatrix<f64>> {
        let n = self.values();
        let mut found = DMatrix::zeros(n, u.len());
        let mut low = vec![0.0; n];
        let mut here = u.to_vec();
        for i in 0..u.len() {
            let mut ends = [(u[i] - STEP).max(0.0), (u[i] + STEP).min(1.0)];
            let column = &mut found.as_mut_slice()[i * n..(i + 1) * n];
            here[i] = ends[1];
            if !evaluate(self, &here, column) {
                ends[1] = u[i];
                here[i] = ends[1];
                if !evaluate(self, &here, column) {
                    return None;
                }
            }
            here[i] = ends[0];
            if !evaluate(self, &here, &mut low) {
                ends[0] = u[i];
                here[i] = ends[0];
                if !evaluate(self, &here, &mut low) {
                    return None;
                }
            }
            here[i] = u[i];
            let step = ends[1] - ends[0];
            if step == 0.0 {
                return None;
            }
            let pairs = column.iter_mut().zip(&low);
            pairs.for_each(|(high, low)| *high = (*high - low) / step);
        }
        Some(found)
    }
}
