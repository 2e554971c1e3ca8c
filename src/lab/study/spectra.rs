//! The spectra of the variants of a study.
use crate::config::study::{Against, DrawSpectra, StudyFile, StudyVariant, VISIBLE_NM};
use crate::measurement::{Measured, Spectrum};

/// A study with the spectrum of each of its variants.
#[derive(Debug, Clone)]
pub struct Spectra<'a> {
    /// The study file.
    pub study: &'a StudyFile,
    /// How the spectra are drawn.
    pub draw: DrawSpectra,
    /// The simulated spectra, in the order of the variants.
    pub spectra: Vec<Spectrum>,
}

impl Spectra<'_> {
    /// The variants with their wavelengths (nm) and values.
    pub fn curves(&self) -> impl Iterator<Item = (&StudyVariant, &[f64], &[Measured])> {
        let variants = self.study.variants.iter().zip(&self.spectra);
        variants.map(|(variant, spectrum)| {
            let values = spectrum.of(self.draw.quantity);
            (variant, variant.sample.wavelengths_nm.as_slice(), values)
        })
    }

    /// The value of variant number `index` at `nm`; `None` if that wavelength is not simulated.
    #[must_use]
    pub fn at(&self, index: usize, nm: f64) -> Option<Measured> {
        let (_, wavelengths_nm, values) = self.curves().nth(index)?;
        let position = wavelengths_nm.iter().position(|other| *other == nm)?;
        values.get(position).copied()
    }

    /// The points of a study against thickness: each variant with its thickness (m) and its
    /// mean over 400-700 nm.
    #[must_use]
    pub fn against_thickness(&self) -> Vec<(&StudyVariant, f64, Measured)> {
        let curves = self.curves();
        let visible = curves.filter_map(|(variant, nm, values)| {
            let mean = mean(nm, values, |nm| VISIBLE_NM.contains(&nm))?;
            Some((variant, variant.sample.thickness_m, mean))
        });
        visible.collect()
    }

    /// Whether the study draws spectra, rather than means against thickness.
    #[must_use]
    pub fn is_spectral(&self) -> bool {
        self.draw.against == Against::Wavelength
    }
}

/// The mean over the wavelengths for which `is_included` holds; `None` if there are none. The
/// wavelengths share their walks, so the standard error assumes fully correlated errors and is
/// an upper bound.
#[must_use]
pub fn mean(
    wavelengths_nm: &[f64],
    values: &[Measured],
    is_included: impl Fn(f64) -> bool,
) -> Option<Measured> {
    let mut sum = Measured::default();
    let mut count = 0.0;
    for (nm, value) in wavelengths_nm.iter().zip(values) {
        if is_included(*nm) {
            sum.value += value.value;
            sum.se += value.se;
            count += 1.0;
        }
    }
    (count > 0.0).then(|| Measured {
        value: sum.value / count,
        se: sum.se / count,
    })
}
