//! Bands that are excluded from the statistics of a comparison.
use std::fmt;
use std::str::FromStr;

use super::measured::RANGE_NM;

/// A range of wavelengths, both ends included, in which residuals are printed but not counted
/// in the statistics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exclusion {
    /// First wavelength, nm.
    pub from_nm: f64,
    /// Last wavelength, nm.
    pub to_nm: f64,
}

impl Exclusion {
    /// Bands in which water vapour leaves too little sunlight for field measurements.
    pub const FIELD: [Self; 2] = [
        Self {
            from_nm: 1750.0,
            to_nm: 2000.0,
        },
        Self {
            from_nm: 2350.0,
            to_nm: RANGE_NM.1,
        },
    ];

    /// As [`Self::FIELD`], for spectra that go beyond 2500 nm. Of the sunlight at 2350-3350 nm 19 %
    /// arrive at the ground (ASTM G173-03, global over extraterrestrial), at 1750-2000 nm 23 %.
    /// Carbon dioxide absorbs near 4260 nm.
    pub const FIELD_BEYOND: [Self; 3] = [
        Self::FIELD[0],
        Self {
            from_nm: 2350.0,
            to_nm: 3350.0,
        },
        Self {
            from_nm: 4150.0,
            to_nm: 4500.0,
        },
    ];

    /// The bands that are excluded by default from spectra that are used up to `longest_nm`.
    #[must_use]
    pub fn field(longest_nm: f64) -> &'static [Self] {
        match longest_nm > RANGE_NM.1 {
            true => &Self::FIELD_BEYOND,
            false => &Self::FIELD,
        }
    }
}

/// Whether one of `exclusions` contains the wavelength `nm`.
#[must_use]
pub fn excluded(exclusions: &[Exclusion], nm: f64) -> bool {
    exclusions
        .iter()
        .any(|band| (band.from_nm..=band.to_nm).contains(&nm))
}

impl fmt::Display for Exclusion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.from_nm, self.to_nm)
    }
}

impl FromStr for Exclusion {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let ends = text.split_once('-');
        let ends = ends.and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
        match ends {
            Some((from_nm, to_nm))
                if 0.0 <= from_nm && from_nm < to_nm && to_nm < f64::INFINITY =>
            {
                Ok(Self { from_nm, to_nm })
            }
            _ => Err(
                "the band must be two wavelengths in nm, the shorter first, such as 1750-2000"
                    .into(),
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ends_are_included() {
        let held = |nm| excluded(&Exclusion::FIELD, nm);
        assert!(
            [1750.0, 1900.0, 2000.0, 2350.0, 2500.0]
                .into_iter()
                .all(held)
        );
        assert!(![1749.9, 2000.1, 2349.9].into_iter().any(held));
        assert!(!excluded(&[], 1800.0));
    }

    #[test]
    fn text_is_parsed_and_printed_alike() {
        for text in ["1750-2000", "2350.5-2500"] {
            assert_eq!(
                text.parse().map(|band: Exclusion| band.to_string()),
                Ok(text.into())
            );
        }
        for wrong in [
            "",
            "-",
            "1750",
            "2000-1750",
            "1-1",
            "a-b",
            "1-inf",
            "nan-2",
            "-5-10",
            "none",
        ] {
            assert!(wrong.parse::<Exclusion>().is_err(), "{wrong}");
        }
    }
}
