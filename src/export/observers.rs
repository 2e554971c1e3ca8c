//! What spectra look like under several lights, seen by many wavelengths or by three.
use crate::colour::{Colorimeter, Illuminant, Viewing};
use crate::spectrum::Resampling;

use super::ExportError;

/// The lights of Varsa 2025, section 8.6, in the order of its rows; FL3.15 is our
/// reading of a name that CIE 015 has not.
pub const LIGHTS: [Illuminant; 5] = [
    Illuminant::E,
    Illuminant::D55,
    Illuminant::D65,
    Illuminant::LedB5,
    Illuminant::Fl3_15,
];
/// Luminance, of white, to which the brightest of a column is exposed. Light that has
/// come through more than some 20 cm is bluer than sRGB can show at any luminance.
pub const LUMINANCE: f64 = 0.3;

/// The wavelengths that a spectrum is reduced to before it is seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sampling {
    /// 31 wavelengths, 400 to 700 nm by 10.
    Many,
    /// 455, 551 and 608 nm.
    Three,
}

impl Sampling {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Many, Self::Three];

    /// What it is, for people.
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

/// Sees spectra of fixed wavelengths under every one of [`LIGHTS`] by either
/// [`Sampling`]: straight lines lead to its wavelengths, and tristimulus values are
/// the sums of [`crate::colour`] over them, the same for white.
#[derive(Debug, Clone)]
pub struct Observers {
    /// By sampling: how it gets there, and who looks, by light.
    samplings: [(Resampling, Vec<Colorimeter>); 2],
}

impl Observers {
    /// Those for spectra at `wavelengths_nm`, nm, strictly increasing.
    ///
    /// # Errors
    /// [`ExportError::NoColour`] unless these cover 400 to 700 nm;
    /// [`ExportError::Colour`].
    pub fn new(wavelengths_nm: &[f64]) -> Result<Self, ExportError> {
        let ends = (wavelengths_nm.first(), wavelengths_nm.last());
        let (&first, &last) = match ends {
            (Some(first), Some(last)) => (first, last),
            _ => (&f64::NAN, &f64::NAN),
        };
        let none = || ExportError::NoColour { first, last };
        if !(first <= 400.0 && last >= 700.0) {
            return Err(none());
        }
        let observers = |sampling: Sampling| -> Result<_, ExportError> {
            let nm = sampling.wavelengths_nm();
            let mut lights = Vec::new();
            for light in LIGHTS {
                let viewing = Viewing {
                    illuminants: vec![light],
                    ..Viewing::default()
                };
                lights.push(Colorimeter::viewing(&nm, &viewing)?.ok_or_else(none)?);
            }
            Ok((Resampling::new(wavelengths_nm, &nm), lights))
        };
        let [many, three] = Sampling::ALL.map(observers);
        Ok(Self {
            samplings: [many?, three?],
        })
    }

    fn of(&self, sampling: Sampling) -> &(Resampling, Vec<Colorimeter>) {
        let [many, three] = &self.samplings;
        match sampling {
            Sampling::Many => many,
            Sampling::Three => three,
        }
    }

    /// Gamma-encoded sRGB of `spectrum` under light number `light` of [`LIGHTS`],
    /// `exposure` times as bright as it is; the light itself is white.
    ///
    /// # Panics
    /// If there is no such light, or the spectrum has not one value per wavelength.
    #[must_use]
    pub fn srgb(&self, by: Sampling, light: usize, spectrum: &[f64], exposure: f64) -> [u8; 3] {
        let (resampling, lights) = self.of(by);
        lights[light].srgb(&exposed(&resampling.apply(spectrum), exposure))
    }

    /// Delta-E*ab (CIE 1976) under light number `light` of two spectra, each seen by
    /// a sampling of its own, both exposed alike.
    ///
    /// # Panics
    /// As [`Self::srgb`].
    #[must_use]
    pub fn difference(
        &self,
        light: usize,
        [(by, first), (other, second)]: [(Sampling, &[f64]); 2],
        exposure: f64,
    ) -> f64 {
        let seen = |by, spectrum| {
            let (resampling, lights) = self.of(by);
            (
                &lights[light],
                exposed(&resampling.apply(spectrum), exposure),
            )
        };
        let ((here, first), (there, second)) = (seen(by, first), seen(other, second));
        here.difference_across(&first, there, &second)
    }

    /// By what the brightest of `spectra` is exposed to [`LUMINANCE`] under light E,
    /// to two digits; 1 if all are black.
    ///
    /// # Panics
    /// As [`Self::srgb`].
    #[must_use]
    pub fn exposure(&self, spectra: &[&[f64]]) -> f64 {
        let (resampling, lights) = self.of(Sampling::Many);
        let luminance = |spectrum: &&[f64]| lights[0].luminance(&resampling.apply(spectrum));
        let most = spectra.iter().map(luminance).fold(0.0, f64::max);
        let rounded = format!("{:.1e}", LUMINANCE / most).parse();
        rounded.ok().filter(|by| f64::is_finite(*by)).unwrap_or(1.0)
    }
}

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
    fn greys_are_the_same_to_all_eyes() {
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
    fn three_wavelengths_see_nothing_else() {
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
        // exposure makes both brighter and farther apart
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
    fn what_is_not_visible_has_no_colour() {
        let error = Observers::new(&[410.0, 500.0, 700.0]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "spectra from 410 to 700 nm have no colour here: they must cover 400 to 700 nm"
        );
        assert!(Observers::new(&[]).is_err());
    }
}
