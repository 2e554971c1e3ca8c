//! Colour of a spectrum: CIELAB, colour differences, sRGB.
//!
//! A reflectance or transmittance spectrum is seen under one or several illuminants by the
//! CIE 1931 2-degree observer. Tristimulus values are trapezoidal sums over the wavelengths
//! of the spectrum, to which the tables of observer and illuminant are interpolated
//! linearly. White is a spectrum of 1 everywhere, computed with the same sums. By default
//! the illuminant is D65 and the difference is Delta-E*ab of CIE 1976, the measure of Varsa
//! 2025, section 6.5 (the observer is our assumption; the thesis names none).
//!
//! Neglected: wavelengths outside 360-780 nm, where the two tables overlap (380-780 nm for
//! FL3.15 and LED-B5; the range of the table for a user's illuminant). Beyond, the values of
//! the observer are below 5e-5, and their share of white under D65 is below 1e-5.
mod observer;
mod power;
mod viewing;

use palette::color_difference::DeltaE;
use palette::convert::FromColorUnclamped;
use palette::white_point::{Any, D65, WhitePoint};
use palette::{Clamp, LinSrgb, Srgb, Xyz};
use thiserror::Error;

use crate::spectrum::{Resampling, TableError};

pub use power::{IlluminantError, PowerTable};
pub use viewing::{ColourDifference, Illuminant, IlluminantSpec, Viewing};

/// White point of tristimulus values relative to white: (1, 1, 1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnitWhite;

impl WhitePoint<f64> for UnitWhite {
    fn get_xyz() -> Xyz<Any, f64> {
        Xyz::new(1.0, 1.0, 1.0)
    }
}

/// A CIELAB colour `l`, `a`, `b`; `l` is in [0, 100] for spectra in [0, 1].
pub type Lab = palette::Lab<UnitWhite, f64>;

/// An error in building a colorimeter.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ColourError {
    /// A wavelength that is not finite or not above the one before.
    #[error(
        "wavelength number {number} is {value} nm; wavelengths must be finite and strictly increasing"
    )]
    Wavelengths {
        /// Position in the list, from 1.
        number: usize,
        /// The wavelength, nm.
        value: f64,
    },
    /// The list of illuminants is empty.
    #[error("no illuminant is given; name at least one")]
    NoIlluminant,
    /// A user's illuminant that does not cover the wavelengths.
    #[error(transparent)]
    Illuminant(#[from] IlluminantError),
    /// A built-in table cannot be read.
    #[error(transparent)]
    Table(#[from] TableError),
}

/// Converts spectra at fixed wavelengths to colours: one weighted sum per tristimulus
/// value and illuminant.
#[derive(Debug, Clone, PartialEq)]
pub struct Colorimeter {
    /// Weights per illuminant; at least one illuminant.
    lights: Vec<IlluminantWeights>,
    difference: ColourDifference,
}

/// Weights of the tristimulus sums under one illuminant.
#[derive(Debug, Clone, PartialEq)]
struct IlluminantWeights {
    /// `[3][l]`: contribution of each wavelength to X, Y and Z, relative to white.
    weights: [Vec<f64>; 3],
    /// Tristimulus values of white, Y = 1.
    white: [f64; 3],
}

impl IlluminantWeights {
    /// `None` if spectra at these wavelengths have no colour.
    fn new(wavelengths_nm: &[f64], illuminant: &Illuminant) -> Result<Option<Self>, TableError> {
        let mut weights = observer::weights(wavelengths_nm, illuminant.table()?.as_ref())?;
        let white = [0, 1, 2].map(|c: usize| weights[c].iter().sum::<f64>());
        let seen = weights[1].iter().filter(|&&w| w > 0.0).count();
        if seen < 3 || white.iter().any(|&w| w <= 0.0) {
            return Ok(None);
        }
        for (column, white) in weights.iter_mut().zip(white) {
            column.iter_mut().for_each(|w| *w /= white);
        }
        let white = white.map(|w| w / white[1]);
        Ok(Some(Self { weights, white }))
    }

    /// X/Xn, Y/Yn and Z/Zn of `spectrum`.
    fn relative(&self, spectrum: &[f64]) -> [f64; 3] {
        assert_eq!(
            spectrum.len(),
            self.weights[1].len(),
            "the spectrum must have one value per wavelength of the colorimeter"
        );
        let sum = |weights: &[f64]| weights.iter().zip(spectrum).map(|(w, s)| w * s).sum();
        let [x, y, z] = &self.weights;
        [sum(x), sum(y), sum(z)]
    }

    fn lab(&self, spectrum: &[f64]) -> Lab {
        relative_lab(self.relative(spectrum))
    }
}

impl Colorimeter {
    /// A colorimeter for the default [`Viewing`]: see [`Colorimeter::viewing`].
    ///
    /// # Errors
    /// [`ColourError::Wavelengths`] if the list is not finite and strictly increasing.
    pub fn new(wavelengths_nm: &[f64]) -> Result<Option<Self>, ColourError> {
        Self::viewing(wavelengths_nm, &Viewing::default())
    }

    /// A colorimeter for spectra sampled at `wavelengths_nm` (nm, strictly increasing).
    /// `None` if such spectra have no colour under one of the illuminants: fewer than 3
    /// wavelengths are in the tables of observer and illuminant, or the observer sees blue
    /// at none of them.
    ///
    /// # Errors
    /// [`ColourError::Wavelengths`] if the list is not finite and strictly increasing,
    /// [`ColourError::NoIlluminant`] if there is no illuminant, [`ColourError::Illuminant`]
    /// if a user's table does not cover the wavelengths.
    pub fn viewing(wavelengths_nm: &[f64], viewing: &Viewing) -> Result<Option<Self>, ColourError> {
        check_increasing(wavelengths_nm)?;
        if viewing.illuminants.is_empty() {
            return Err(ColourError::NoIlluminant);
        }
        let mut lights = Vec::new();
        for illuminant in &viewing.illuminants {
            illuminant.covers(wavelengths_nm)?;
            let Some(light) = IlluminantWeights::new(wavelengths_nm, illuminant)? else {
                return Ok(None);
            };
            lights.push(light);
        }
        Ok(Some(Self {
            lights,
            difference: viewing.difference,
        }))
    }

    /// As [`Colorimeter::viewing`], for spectra that are piecewise linear between
    /// `wavelengths_nm`, of which there may be few: the spectra are resampled every 5 nm,
    /// the spacing of the table of the observer.
    ///
    /// # Errors
    /// As [`Colorimeter::viewing`].
    pub fn piecewise_linear(
        wavelengths_nm: &[f64],
        viewing: &Viewing,
    ) -> Result<Option<Self>, ColourError> {
        check_increasing(wavelengths_nm)?;
        let (Some(&first), Some(&last)) = (wavelengths_nm.first(), wavelengths_nm.last()) else {
            return Ok(None);
        };
        let mut fine = observer::every_5_nm();
        fine.retain(|nm| *nm > first && *nm < last);
        fine.extend(wavelengths_nm);
        fine.sort_by(f64::total_cmp);
        fine.dedup();
        let resampling = Resampling::new(wavelengths_nm, &fine);
        let colorimeter = Self::viewing(&fine, viewing)?;
        Ok(colorimeter.map(|colorimeter| colorimeter.resampled(&resampling)))
    }

    /// Tristimulus values X, Y, Z of white under the first illuminant, sampled at these
    /// wavelengths and scaled to Y = 1.
    #[must_use]
    pub fn white(&self) -> [f64; 3] {
        self.lights[0].white
    }

    /// Tristimulus values X, Y, Z of `spectrum` (`[l]`, dimensionless) under the first
    /// illuminant, on the scale of [`Colorimeter::white`].
    ///
    /// # Panics
    /// If `spectrum` does not have one value per wavelength.
    #[must_use]
    pub fn xyz(&self, spectrum: &[f64]) -> [f64; 3] {
        let ([x, y, z], white) = (self.lights[0].relative(spectrum), self.white());
        [x * white[0], y * white[1], z * white[2]]
    }

    /// Tristimulus values of `spectrum` (`[l]`) under the first illuminant, each relative to
    /// that of white.
    ///
    /// # Panics
    /// If `spectrum` does not have one value per wavelength.
    #[must_use]
    pub fn relative_xyz(&self, spectrum: &[f64]) -> [f64; 3] {
        self.lights[0].relative(spectrum)
    }

    /// CIELAB of `spectrum` (`[l]`, dimensionless) under the first illuminant.
    ///
    /// # Panics
    /// If `spectrum` does not have one value per wavelength.
    #[must_use]
    pub fn lab(&self, spectrum: &[f64]) -> Lab {
        self.lights[0].lab(spectrum)
    }

    /// Luminance of `spectrum` (`[l]`) under the first illuminant, relative to white.
    ///
    /// # Panics
    /// If `spectrum` does not have one value per wavelength.
    #[must_use]
    pub fn luminance(&self, spectrum: &[f64]) -> f64 {
        self.lights[0].relative(spectrum)[1]
    }

    /// A colorimeter for spectra at the input wavelengths of `resampling`. It gives the
    /// colours that this colorimeter gives for the resampled spectra.
    ///
    /// # Panics
    /// If the number of output wavelengths of `resampling` is not that of this colorimeter.
    #[must_use]
    pub fn resampled(&self, resampling: &Resampling) -> Self {
        let lights = self.lights.iter().map(|light| IlluminantWeights {
            weights: light
                .weights
                .each_ref()
                .map(|weights| resampling.folded(weights)),
            white: light.white,
        });
        Self {
            lights: lights.collect(),
            difference: self.difference,
        }
    }

    /// Whether any colour depends on the value at the wavelength with this index.
    #[must_use]
    pub fn sees(&self, wavelength: usize) -> bool {
        let weights = self.lights.iter().flat_map(|light| &light.weights);
        let mut here = weights.filter_map(|weights| weights.get(wavelength));
        here.any(|weight| *weight != 0.0)
    }

    /// The colour difference of two spectra (`[l]`): the largest over the illuminants, or
    /// NaN if any of them gives NaN.
    ///
    /// # Panics
    /// If one of the spectra does not have one value per wavelength.
    #[must_use]
    pub fn difference(&self, first: &[f64], second: &[f64]) -> f64 {
        self.difference_across(first, self, second)
    }

    /// The colour difference of `first`, seen by this colorimeter, and `second`, seen by
    /// `other`, which was [resampled](Self::resampled) from this one.
    ///
    /// # Panics
    /// If one of the spectra does not have one value per wavelength of its colorimeter.
    #[must_use]
    pub fn difference_across(&self, first: &[f64], other: &Self, second: &[f64]) -> f64 {
        let lights = self.lights.iter().zip(&other.lights);
        let differences =
            lights.map(|(own, other)| self.difference.between(own.lab(first), other.lab(second)));
        differences.fold(0.0, |worst, e| {
            if e <= worst || worst.is_nan() {
                worst
            } else {
                e
            }
        })
    }

    /// Gamma-encoded sRGB of `spectrum` (`[l]`) under the first illuminant. A spectrum of
    /// 1 is white (255, 255, 255). Colours out of gamut are clipped in linear sRGB.
    ///
    /// # Panics
    /// If `spectrum` does not have one value per wavelength.
    #[must_use]
    pub fn srgb(&self, spectrum: &[f64]) -> [u8; 3] {
        let linear = LinSrgb::from(self.linear_srgb(spectrum)).clamp();
        Srgb::<f64>::from_linear(linear).into_format::<u8>().into()
    }

    /// Linear sRGB of `spectrum` (`[l]`) under the first illuminant, not clipped. A
    /// spectrum of 1 is (1, 1, 1) under any illuminant: X, Y and Z are scaled from the
    /// white of the illuminant to D65, the white of sRGB.
    ///
    /// # Panics
    /// If `spectrum` does not have one value per wavelength.
    #[must_use]
    pub fn linear_srgb(&self, spectrum: &[f64]) -> [f64; 3] {
        let [x, y, z] = self.lights[0].relative(spectrum);
        let white: Xyz<Any, f64> = D65::get_xyz();
        let xyz = Xyz::<D65, f64>::new(x * white.x, y * white.y, z * white.z);
        LinSrgb::from_color_unclamped(xyz).into()
    }
}

/// Gamma-encoded sRGB (IEC 61966-2-1) from linear sRGB; both in [0, 1].
#[must_use]
pub fn encoded_srgb(linear: [f64; 3]) -> [f64; 3] {
    Srgb::<f64>::from_linear(LinSrgb::from(linear)).into()
}

/// [`ColourError::Wavelengths`] if the list is not finite and strictly increasing.
fn check_increasing(wavelengths_nm: &[f64]) -> Result<(), ColourError> {
    let mut before = f64::NEG_INFINITY;
    for (index, &value) in wavelengths_nm.iter().enumerate() {
        if !(value.is_finite() && value > before) {
            let number = index + 1;
            return Err(ColourError::Wavelengths { number, value });
        }
        before = value;
    }
    Ok(())
}

/// CIELAB of tristimulus values, each relative to that of white.
#[must_use]
pub fn relative_lab([x, y, z]: [f64; 3]) -> Lab {
    Lab::from_color_unclamped(Xyz::<UnitWhite, f64>::new(x, y, z))
}

/// Delta-E*ab (CIE 1976): the Euclidean distance of two CIELAB colours. About 2.3 is
/// just noticeable.
#[must_use]
pub fn delta_e(first: Lab, second: Lab) -> f64 {
    first.delta_e(second)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn visible() -> Vec<f64> {
        (40..=70).map(|i| f64::from(i) * 10.0).collect()
    }

    fn every_5_nm() -> Colorimeter {
        let grid: Vec<f64> = (72..=156).map(|i| f64::from(i) * 5.0).collect();
        Colorimeter::new(&grid).unwrap().unwrap()
    }

    #[test]
    fn white_is_100_0_0_and_255() {
        let colorimeter = Colorimeter::new(&visible()).unwrap().unwrap();
        let white = colorimeter.lab(&[1.0; 31]);
        assert!((white.l - 100.0).abs() < 1e-9, "{white:?}");
        assert!(white.a.abs() < 1e-9 && white.b.abs() < 1e-9, "{white:?}");
        assert_eq!(colorimeter.srgb(&[1.0; 31]), [255; 3]);
        assert_eq!(colorimeter.srgb(&[0.0; 31]), [0; 3]);
    }

    /// CIE 015:2018 tabulates x = 0.31270, y = 0.32900 (1 nm sums); the 5 nm
    /// trapezoid is within 1e-4 of it.
    #[test]
    fn d65_chromaticity_is_the_published_one() {
        let [x, y, z] = every_5_nm().white();
        let sum = x + y + z;
        assert!((x / sum - 0.3127).abs() < 1e-4, "{}", x / sum);
        assert!((y / sum - 0.3290).abs() < 1e-4, "{}", y / sum);
    }

    /// White of every illuminant, against x and y as CIE 015:2018 tabulates them.
    #[test]
    fn illuminants_have_the_published_chromaticity() {
        let nm: Vec<f64> = (72..=156).map(|i| f64::from(i) * 5.0).collect();
        for (illuminant, x, y) in [
            (Illuminant::A, 0.447_58, 0.407_45),
            (Illuminant::D50, 0.345_67, 0.358_51),
            (Illuminant::D55, 0.332_43, 0.347_44),
            (Illuminant::D65, 0.312_70, 0.329_00),
            (Illuminant::E, 0.333_33, 0.333_33),
            (Illuminant::Fl3_15, 0.312_70, 0.328_80),
            (Illuminant::LedB5, 0.311_80, 0.323_60),
        ] {
            let white = seen(
                &nm,
                std::slice::from_ref(&illuminant),
                ColourDifference::Cie1976,
            )
            .white();
            let sum: f64 = white.iter().sum();
            let found = (white[0] / sum, white[1] / sum);
            assert!((found.0 - x).abs() < 2e-4, "{illuminant:?}: {found:?}");
            assert!((found.1 - y).abs() < 2e-4, "{illuminant:?}: {found:?}");
        }
    }

    /// CIE 015: 100 (560 / l)^5 (exp(c2 / (T 560)) - 1) / (exp(c2 / (T l)) - 1) with
    /// c2 / T = 1.435e7 nm K / 2848 K; the table has six digits.
    #[test]
    fn illuminant_a_follows_its_formula() {
        let table = Illuminant::A.table().unwrap();
        let power = |nm: f64| (560.0 / nm).powi(5) / (1.435e7 / (2848.0 * nm)).exp_m1();
        for (nm, found) in table.abscissae().iter().zip(table.column(0)) {
            let expected = 100.0 * power(*nm) / power(560.0);
            assert!((found / expected - 1.0).abs() < 5e-6, "{nm} nm: {found}");
        }
        assert_eq!(table.range(), (300.0, 780.0));
    }

    fn seen(nm: &[f64], illuminants: &[Illuminant], difference: ColourDifference) -> Colorimeter {
        let illuminants = illuminants.to_vec();
        let viewing = Viewing {
            illuminants,
            difference,
        };
        Colorimeter::viewing(nm, &viewing).unwrap().unwrap()
    }

    #[test]
    fn the_worst_illuminant_counts() {
        // One bump where the LED is strong, one where daylight is stronger.
        let bump = |centre: f64| -> Vec<f64> {
            let at = |w: &f64| 0.5 + 0.1 * (-((w - centre) / 15.0).powi(2)).exp();
            visible().iter().map(at).collect()
        };
        let flat = vec![0.5; 31];
        for difference in ColourDifference::ALL {
            let of = |illuminants: &[Illuminant], spectrum: &[f64]| {
                seen(&visible(), illuminants, difference).difference(&flat, spectrum)
            };
            let (led, day) = (|| Illuminant::LedB5, || Illuminant::D65);
            let [blue, cyan] = [bump(450.0), bump(490.0)];
            assert!(of(&[led()], &blue) > 1.02 * of(&[day()], &blue));
            assert!(of(&[day()], &cyan) > 1.02 * of(&[led()], &cyan));
            for spectrum in [&blue, &cyan] {
                let worst = of(&[led()], spectrum).max(of(&[day()], spectrum));
                assert_eq!(of(&[led(), day()], spectrum), worst);
                assert_eq!(of(&[day(), led()], spectrum), worst);
            }
            assert!(of(&[led(), day()], &[f64::NAN; 31]).is_nan());
        }
    }

    #[test]
    fn the_default_difference_is_the_distance_in_lab_under_d65() {
        let colorimeter = every_5_nm();
        let (a, b) = ([0.3; 85], [0.31; 85]);
        let expected = delta_e(colorimeter.lab(&a), colorimeter.lab(&b));
        assert_eq!(colorimeter.difference(&a, &b), expected);
        assert_eq!(colorimeter.difference(&a, &a), 0.0);
        let nobody = Viewing {
            illuminants: Vec::new(),
            ..Viewing::default()
        };
        let refused = Colorimeter::viewing(&visible(), &nobody);
        assert_eq!(refused, Err(ColourError::NoIlluminant));
    }

    /// L* of a grey of 18.418 65 % is 50 (CIE 15, eq. 8.3: 116 Y^(1/3) - 16).
    #[test]
    fn middle_grey_has_lightness_50() {
        let grey = every_5_nm().lab(&[0.184_186_5; 85]);
        assert!((grey.l - 50.0).abs() < 1e-4, "{grey:?}");
        // sRGB (IEC 61966-2-1) encodes the same grey as 118.9.
        assert_eq!(every_5_nm().srgb(&[0.184_186_5; 85]), [119; 3]);
    }

    /// Below Y = 216/24389 CIELAB is linear: L* = 24389/27 Y.
    #[test]
    fn near_black_is_linear_and_finite() {
        let colorimeter = every_5_nm();
        let black = colorimeter.lab(&[0.0; 85]);
        assert!(black.l.abs() < 1e-12, "{black:?}");
        let dark = colorimeter.lab(&[1e-4; 85]);
        let expected = 24389.0 / 27.0 * 1e-4;
        assert!((delta_e(black, dark) - expected).abs() < 1e-9);
        assert!(delta_e(black, colorimeter.lab(&[-1e-6; 85])).is_finite());
        assert_eq!(delta_e(dark, dark), 0.0);
    }

    #[test]
    fn blue_and_red_light_have_the_right_signs() {
        let colorimeter = Colorimeter::new(&visible()).unwrap().unwrap();
        let part = |low: f64, high: f64| -> Vec<f64> {
            let inside = |w: &f64| if (low..=high).contains(w) { 0.5 } else { 0.0 };
            visible().iter().map(inside).collect()
        };
        assert!(colorimeter.lab(&part(400.0, 480.0)).b < -50.0);
        assert!(colorimeter.lab(&part(600.0, 700.0)).a > 50.0);
        let [r, g, b] = colorimeter.srgb(&part(600.0, 700.0));
        assert!(r > 150 && g == 0 && b == 0, "{r} {g} {b}");
    }

    #[test]
    fn near_infrared_has_no_colour() {
        let nir: Vec<f64> = (80..=250).map(|i| f64::from(i) * 10.0).collect();
        assert_eq!(Colorimeter::new(&nir).unwrap(), None);
        assert_eq!(Colorimeter::new(&[400.0, 500.0]).unwrap(), None);
        // The observer sees no blue above 650 nm: there is no white to divide by.
        assert_eq!(Colorimeter::new(&[660.0, 680.0, 700.0]).unwrap(), None);
        assert_eq!(Colorimeter::new(&[]).unwrap(), None);
    }

    #[test]
    fn a_resampled_colorimeter_sees_the_lines_between() {
        let sparse = [400.0, 430.0, 480.0, 550.0, 610.0, 700.0];
        let by = Resampling::new(&sparse, &visible());
        let values = [0.31, 0.5, 0.2, 0.7, 0.4, 0.05];
        let lines = by.apply(&values);
        for lights in [
            &[Illuminant::D65][..],
            &[Illuminant::LedB5, Illuminant::D55],
        ] {
            let all = seen(&visible(), lights, ColourDifference::Cie1976);
            let few = all.resampled(&by);
            assert!(delta_e(all.lab(&lines), few.lab(&values)) < 1e-12);
            assert!(all.difference_across(&lines, &few, &values) < 1e-12);
            // unlike the spectrum sampled at these wavelengths only
            let bare: Vec<f64> = sparse.map(f64::from).to_vec();
            let bare = seen(&bare, lights, ColourDifference::Cie1976);
            assert!(delta_e(all.lab(&lines), bare.lab(&values)) > 1.0);
            let other = [0.3, 0.51, 0.19, 0.72, 0.41, 0.02];
            let expected = all.difference(&lines, &by.apply(&other));
            assert!((few.difference(&values, &other) - expected).abs() < 1e-12);
            assert_eq!(few.white(), all.white());
        }
    }

    #[test]
    fn few_wavelengths_are_seen_as_lines() {
        // one of them is not a multiple of 5 nm
        let sparse = [400.0, 431.5, 480.0, 550.0, 610.0, 700.0];
        let values = [0.31, 0.5, 0.2, 0.7, 0.4, 0.05];
        let mut fine: Vec<f64> = (80..=140).map(|i| f64::from(i) * 5.0).collect();
        fine.insert(7, 431.5);
        let lines = Resampling::new(&sparse, &fine).apply(&values);
        let daylight = Viewing::default();
        let few = Colorimeter::piecewise_linear(&sparse, &daylight)
            .unwrap()
            .unwrap();
        let all = Colorimeter::new(&fine).unwrap().unwrap();
        assert!(delta_e(few.lab(&values), all.lab(&lines)) < 1e-9);
        // no extrapolation beyond the ends; two wavelengths are enough
        let two = Colorimeter::piecewise_linear(&[400.0, 700.0], &daylight)
            .unwrap()
            .unwrap();
        assert!(two.lab(&[0.5, 0.5]).a.abs() < 1e-12);
        for none in [&[][..], &[500.0], &[900.0, 1000.0]] {
            assert_eq!(Colorimeter::piecewise_linear(none, &daylight), Ok(None));
        }
        assert!(Colorimeter::piecewise_linear(&[500.0, 400.0], &daylight).is_err());
    }

    #[test]
    fn tristimulus_values_and_linear_srgb_agree_with_white() {
        for illuminant in Illuminant::ALL {
            let seen = seen(&visible(), &[illuminant], ColourDifference::Cie1976);
            for value in [1.0, 0.25] {
                let xyz = seen.xyz(&[value; 31]);
                let pairs = xyz.iter().zip(seen.white());
                assert!(
                    pairs
                        .into_iter()
                        .all(|(c, w)| (c - value * w).abs() < 1e-12)
                );
                let rgb = seen.linear_srgb(&[value; 31]);
                // the matrix of sRGB is published to four decimals
                assert!(rgb.iter().all(|c| (c - value).abs() < 2e-4), "{rgb:?}");
            }
        }
        // out of gamut: not clipped
        let blue: Vec<f64> = visible().iter().map(|w| f64::from(*w < 480.0)).collect();
        let [_, green, _] =
            seen(&visible(), &[Illuminant::E], ColourDifference::Cie1976).linear_srgb(&blue);
        assert!(green < 0.0, "{green}");
        let [low, middle, high] = encoded_srgb([0.002, 0.184_186_5, 1.0]);
        assert!((low - 12.92 * 0.002).abs() < 1e-12);
        assert!((middle - (1.055 * 0.184_186_5_f64.powf(1.0 / 2.4) - 0.055)).abs() < 1e-12);
        assert!((high - 1.0).abs() < 1e-12);
    }

    #[test]
    fn only_visible_wavelengths_count() {
        let nm = [350.0, 400.0, 500.0, 600.0, 780.0, 790.0];
        let colorimeter = Colorimeter::new(&nm).unwrap().unwrap();
        let seen: Vec<bool> = (0..7).map(|i| colorimeter.sees(i)).collect();
        assert_eq!(seen, [false, true, true, true, true, false, false]);
    }

    #[test]
    fn wavelengths_out_of_order_are_refused() {
        for bad in [[400.0, 400.0], [500.0, 400.0], [400.0, f64::NAN]] {
            let error = Colorimeter::new(&bad).unwrap_err();
            assert!(matches!(error, ColourError::Wavelengths { number: 2, .. }));
        }
    }

    #[test]
    fn wavelengths_beyond_the_tables_change_nothing() {
        let mut longer = visible();
        longer.extend([900.0, 1000.0]);
        let mut spectrum = vec![0.3; 31];
        let short = Colorimeter::new(&visible()).unwrap().unwrap();
        let expected = short.lab(&spectrum);
        spectrum.extend([0.9, 0.1]);
        let long = Colorimeter::new(&longer).unwrap().unwrap();
        assert_eq!(long.lab(&spectrum), expected);
    }
}
