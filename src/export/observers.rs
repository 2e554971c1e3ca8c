//! Colours of spectra under several illuminants, computed from 31 or from three wavelengths.
use crate::colour::{Colorimeter, Illuminant, Viewing};
use crate::spectrum::Resampling;

use super::ExportError;

/// The illuminants of Varsa 2025, section 8.6, in the order of its rows. FL3.15 is our
/// interpretation of a name that CIE 015 does not list.
pub const LIGHTS: [Illuminant; 5] = [
    Illuminant::E,
    Illuminant::D55,
    Illuminant::D65,
    Illuminant::LedB5,
    Illuminant::Fl3_15,
];
/// Luminance, relative to white, to which the brightest spectrum of a column is exposed. Light
/// that has passed through more than about 20 cm of snow is bluer than sRGB can show at any
/// luminance.
pub const LUMINANCE: f64 = 0.3;

/// The wavelengths from which a colour is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sampling {
    /// 31 wavelengths, 400 to 700 nm in steps of 10 nm.
    Many,
    /// Three wavelengths: 455, 551 and 608 nm.
    Three,
}

impl Sampling {
    /// All samplings.
    pub const ALL: [Self; 2] = [Self::Many, Self::Three];

    /// Description for people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Many => "31 wavelengths, 400-700 nm",
            Self::Three => "3 wavelengths, 455, 551, 608 nm",
        }
    }

    /// The wavelengths, nm.
    #[must_use]
    pub fn wavelengths_nm(self) -> Vec<f64> {
        match self {
            Self::Many => (40..=70).map(|nm| 10.0 * f64::from(nm)).collect(),
            Self::Three => vec![455.0, 551.0, 608.0],
        }
    }
}

/// Computes the colours of spectra at fixed wavelengths, under each of [`LIGHTS`] and with
/// each [`Sampling`]. Spectra are interpolated linearly to the wavelengths of the sampling;
/// the tristimulus values are the sums of [`crate::colour`] over them, normalised so that
/// white is the same for all.
#[derive(Debug, Clone)]
pub struct Observers {
    /// For each sampling: the resampling to its wavelengths, and the colorimeters by illuminant.
    samplings: [(Resampling, Vec<Colorimeter>); 2],
}

impl Observers {
    /// The observers for spectra at `wavelengths_nm`, nm, strictly increasing.
    ///
    /// # Errors
    /// [`ExportError::NoColour`] unless the wavelengths cover 400 to 700 nm;
    /// [`ExportError::Colour`] if a colorimeter cannot be set up.
    pub fn new(wavelengths_nm: &[f64]) -> Result<Self, ExportError> {
        let ends = (wavelengths_nm.first(), wavelengths_nm.last());
        let (&first, &last) = match ends {
            (Some(first), Some(last)) => (first, last),
            _ => (&f64::NAN, &f64::NAN),
        };
        let no_colour = || ExportError::NoColour { first, last };
        if !(first <= 400.0 && last >= 700.0) {
            return Err(no_colour());
        }
        let observers = |sampling: Sampling| -> Result<_, ExportError> {
            let nm = sampling.wavelengths_nm();
            let mut lights = Vec::new();
            for light in LIGHTS {
                let viewing = Viewing {
                    illuminants: vec![light],
                    ..Viewing::default()
                };
                lights.push(Colorimeter::viewing(&nm, &viewing)?.ok_or_else(no_colour)?);
            }
            Ok((Resampling::new(wavelengths_nm, &nm), lights))
        };
        let [many, three] = Sampling::ALL.map(observers);
        Ok(Self {
            samplings: [many?, three?],
        })
    }

    /// The resampling and the colorimeters of a sampling.
    fn of(&self, sampling: Sampling) -> &(Resampling, Vec<Colorimeter>) {
        let [many, three] = &self.samplings;
        match sampling {
            Sampling::Many => many,
            Sampling::Three => three,
        }
    }

    /// The gamma-encoded sRGB colour of `spectrum` under illuminant number `light` of
    /// [`LIGHTS`], brightened by the factor `exposure`. The illuminant itself is white.
    ///
    /// # Panics
    /// If `light` is out of range, or the spectrum does not have one value per wavelength.
    #[must_use]
    pub fn srgb(
        &self,
        sampling: Sampling,
        light: usize,
        spectrum: &[f64],
        exposure: f64,
    ) -> [u8; 3] {
        let (resampling, lights) = self.of(sampling);
        lights[light].srgb(&exposed(&resampling.apply(spectrum), exposure))
    }

    /// The Delta-E*ab (CIE 1976) between two spectra, each with a sampling of its own, under
    /// illuminant number `light` of [`LIGHTS`]; both are brightened by the factor `exposure`.
    ///
    /// # Panics
    /// Under the conditions of [`Self::srgb`].
    #[must_use]
    pub fn difference(
        &self,
        light: usize,
        [(sampling, first), (other, second)]: [(Sampling, &[f64]); 2],
        exposure: f64,
    ) -> f64 {
        let sampled = |sampling, spectrum| {
            let (resampling, lights) = self.of(sampling);
            (
                &lights[light],
                exposed(&resampling.apply(spectrum), exposure),
            )
        };
        let (first_colorimeter, first) = sampled(sampling, first);
        let (second_colorimeter, second) = sampled(other, second);
        first_colorimeter.difference_across(&first, second_colorimeter, &second)
    }

    /// The factor, to two digits, that brightens the brightest of `spectra` to [`LUMINANCE`]
    /// under illuminant E; 1 if all spectra are black.
    ///
    /// # Panics
    /// Under the conditions of [`Self::srgb`].
    #[must_use]
    pub fn exposure(&self, spectra: &[&[f64]]) -> f64 {
        let (resampling, lights) = self.of(Sampling::Many);
        let luminance = |spectrum: &&[f64]| lights[0].luminance(&resampling.apply(spectrum));
        let largest = spectra.iter().map(luminance).fold(0.0, f64::max);
        let rounded = format!("{:.1e}", LUMINANCE / largest).parse();
        rounded
            .ok()
            .filter(|factor| f64::is_finite(*factor))
            .unwrap_or(1.0)
    }
}

/// `spectrum` brightened by the factor `exposure`.
fn exposed(spectrum: &[f64], exposure: f64) -> Vec<f64> {
    spectrum.iter().map(|value| value * exposure).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn observers() -> (Vec<f64>, Observers) {
        let nm: Vec<f64> = (0..=80).map(|i| 380.0 + 5.0 * f64::from(i)).collect();
        let observers = Observers::new(&nm).unwrap();
        (nm, observers)
    }

    #[test]
    fn greys_are_the_same_in_all_samplings() {
        let (nm, observers) = observers();
        let grey = vec![0.05; nm.len()];
        let exposure = observers.exposure(&[&grey]);
        assert_eq!(exposure, 6.0);
        for light in 0..LIGHTS.len() {
            for by in Sampling::ALL {
                // sRGB (IEC 61966-2-1) encodes 0.3 as 0.5838
                assert_eq!(observers.srgb(by, light, &grey, exposure), [149; 3]);
            }
            let pair = Sampling::ALL.map(|by| (by, grey.as_slice()));
            assert!(observers.difference(light, pair, 1.0) < 1e-9);
        }
    }

    #[test]
    fn three_wavelengths_ignore_all_others() {
        let (nm, observers) = observers();
        let dip = |centre: f64| -> Vec<f64> {
            let at = |w: &f64| if (w - centre).abs() < 1.0 { 0.1 } else { 0.5 };
            nm.iter().map(at).collect()
        };
        let flat = vec![0.5; nm.len()];
        let seen = |by, centre| observers.difference(2, [(by, &flat), (by, &dip(centre))], 1.0);
        assert!(seen(Sampling::Many, 500.0) > 1.0);
        assert_eq!(seen(Sampling::Three, 500.0), 0.0);
        assert!(seen(Sampling::Three, 455.0) > 1.0);
        // A larger exposure increases brightness and difference.
        let apart = |exposure| {
            observers.difference(
                2,
                [(Sampling::Many, &flat), (Sampling::Many, &dip(500.0))],
                exposure,
            )
        };
        assert!(apart(1.5) > apart(1.0));
    }

    #[test]
    fn spectra_outside_the_visible_have_no_colour() {
        let error = Observers::new(&[410.0, 500.0, 700.0]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "spectra from 410 to 700 nm have no colour: they must cover 400 to 700 nm; build a database with these wavelengths"
        );
        assert!(Observers::new(&[]).is_err());
    }
}
