//! Virtual spectrophotometer and goniophotometer (docs/methods.md):
//! directional-hemispherical reflectance and transmittance with standard errors, and
//! the bins for light that leaves by direction (sensors) and by distance (radii).
mod estimate;
mod radii;
mod sensors;
mod views;

use serde::{Deserialize, Serialize};

pub use estimate::Estimate;
pub use radii::Radii;
pub use sensors::{MOST_SENSORS, Sensors};
pub use splitsnow_spectra::Quantity;
pub use views::{MAX_VIEW_DEG, ViewError, Views};

/// A Monte Carlo result: a mean and the standard error of that mean.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Measured {
    /// Estimate of the quantity, dimensionless.
    pub value: f64,
    /// Standard error of the estimate.
    pub se: f64,
}

impl Measured {
    /// Linear interpolation, with weights `1 - t` and `t`, between `self` and an
    /// independent `other`.
    #[must_use]
    pub fn mix(self, other: Self, t: f64) -> Self {
        let (a, b) = (1.0 - t, t);
        Self {
            value: a * self.value + b * other.value,
            se: (a * a * self.se * self.se + b * b * other.se * other.se).sqrt(),
        }
    }
}

/// Reflectance and transmittance of one slab under one illumination, per
/// wavelength; all vectors have the length of the wavelength list.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Spectrum {
    /// Directional-hemispherical (or bi-hemispherical) reflectance, [0, 1].
    pub reflectance: Vec<Measured>,
    /// Directional-hemispherical (or bi-hemispherical) transmittance, [0, 1].
    pub transmittance: Vec<Measured>,
    /// Share of the rays that hit an event limit; they count in neither R nor T.
    pub lost: Vec<f64>,
}

impl Spectrum {
    /// Root mean square over the wavelengths of the standard error: the larger of those of
    /// reflectance and transmittance; 0 without wavelengths.
    #[must_use]
    pub fn rms_se(&self) -> f64 {
        let rms = |values: &[Measured]| {
            let squares: f64 = values.iter().map(|value| value.se * value.se).sum();
            (squares / values.len().max(1) as f64).sqrt()
        };
        rms(&self.reflectance).max(rms(&self.transmittance))
    }

    /// A spectrum at so many wavelengths of which nothing is known: all values are NaN.
    pub(crate) fn unknown(wavelengths: usize) -> Self {
        let unknown = Measured {
            value: f64::NAN,
            se: f64::NAN,
        };
        Self {
            reflectance: vec![unknown; wavelengths],
            transmittance: vec![unknown; wavelengths],
            lost: vec![0.0; wavelengths],
        }
    }

    /// Appends the values at further wavelengths.
    pub(crate) fn extend(&mut self, further: Self) {
        self.reflectance.extend(further.reflectance);
        self.transmittance.extend(further.transmittance);
        self.lost.extend(further.lost);
    }

    /// The values of one quantity, per wavelength.
    #[must_use]
    pub fn of(&self, quantity: Quantity) -> &[Measured] {
        match quantity {
            Quantity::Transmittance => &self.transmittance,
            Quantity::Reflectance => &self.reflectance,
        }
    }
}

/// Light of one slab under one illumination toward views: `[view][wavelength]`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ViewFactors {
    /// Reflectance factors (BRF; HDRF under diffuse light).
    pub reflected: Vec<Measured>,
    /// Transmittance factors: the same of light that leaves into the substrate.
    pub transmitted: Vec<Measured>,
}

impl ViewFactors {
    /// The factors on the side of one quantity, `[view][wavelength]`.
    #[must_use]
    pub fn of(&self, quantity: Quantity) -> &[Measured] {
        match quantity {
            Quantity::Transmittance => &self.transmitted,
            Quantity::Reflectance => &self.reflected,
        }
    }
}
