//! The two bands of wavelengths for which errors are stated.
use crate::colour::{Colorimeter, ColourError};

/// A band of wavelengths with its own runs, costs and errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum SpectralDomain {
    /// 400-700 nm in steps of 10 nm: 31 wavelengths, with a colour.
    Visible,
    /// 700-1400 nm in steps of 50 nm: 15 wavelengths, without a colour.
    NearInfrared,
}

impl SpectralDomain {
    /// All bands.
    pub const ALL: [Self; 2] = [Self::Visible, Self::NearInfrared];

    /// The name used in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Visible => "visible",
            Self::NearInfrared => "near_infrared",
        }
    }

    /// The wavelengths of the band, nm, increasing.
    #[must_use]
    pub fn wavelengths_nm(self) -> Vec<f64> {
        let (first, step, count) = match self {
            Self::Visible => (400.0, 10.0, 31),
            Self::NearInfrared => (700.0, 50.0, 15),
        };
        (0..count).map(|i| first + step * f64::from(i)).collect()
    }

    /// The colorimeter for the band; `None` if its spectra have no colour.
    ///
    /// # Errors
    /// Those of [`Colorimeter::new`].
    pub fn colorimeter(self) -> Result<Option<Colorimeter>, ColourError> {
        match self {
            Self::Visible => Colorimeter::new(&self.wavelengths_nm()),
            Self::NearInfrared => Ok(None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bands_meet_at_700_nm() {
        let ends = SpectralDomain::ALL.map(|band| {
            let nm = band.wavelengths_nm();
            (nm.first().copied(), nm.last().copied(), nm.len())
        });
        assert_eq!(ends[0], (Some(400.0), Some(700.0), 31));
        assert_eq!(ends[1], (Some(700.0), Some(1400.0), 15));
    }

    #[test]
    fn only_visible_light_has_a_colour() {
        let coloured =
            |band: SpectralDomain| band.colorimeter().is_ok_and(|colour| colour.is_some());
        assert_eq!(SpectralDomain::ALL.map(coloured), [true, false]);
    }
}
