//! Viewing conditions for comparing colours: illuminants and difference formula.
use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use palette::color_difference::Ciede2000;
use serde::{Deserialize, Serialize};

use super::{IlluminantError, Lab, PowerTable, delta_e};
use crate::spectrum::{Table, TableError};

/// An illuminant: one tabulated in CIE 015:2018, or a user's table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(into = "IlluminantSpec", try_from = "IlluminantSpec")]
pub enum Illuminant {
    /// Mid-morning daylight, 5503 K.
    D55,
    /// Average daylight, 6504 K.
    D65,
    /// The same power at every wavelength.
    E,
    /// Fluorescent lamp simulating daylight, 6508 K.
    Fl3_15,
    /// Phosphor-converted blue LED, 6598 K.
    LedB5,
    /// Incandescent lamp, 2856 K.
    A,
    /// Daylight at low sun, 5003 K.
    D50,
    /// A user's table.
    Table(Arc<PowerTable>),
}

/// The serialised form of an illuminant: a name, or a table with its numbers.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(untagged)]
pub enum IlluminantSpec {
    /// Name of one of [`Illuminant::ALL`].
    Name(String),
    /// A user's table.
    Table {
        /// Name of the table.
        name: String,
        /// Wavelengths, nm.
        wavelength_nm: Vec<f64>,
        /// Relative power at each wavelength.
        power: Vec<f64>,
    },
}

impl Illuminant {
    /// The built-in illuminants.
    pub const ALL: [Self; 7] = [
        Self::D55,
        Self::D65,
        Self::E,
        Self::Fl3_15,
        Self::LedB5,
        Self::A,
        Self::D50,
    ];
    /// Names of the built-in illuminants.
    pub const NAMES: [&'static str; 7] = ["D55", "D65", "E", "FL3.15", "LED-B5", "A", "D50"];

    /// Name in files and on the command line; for a user's table, its file name.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::D55 => "D55",
            Self::D65 => "D65",
            Self::E => "E",
            Self::Fl3_15 => "FL3.15",
            Self::LedB5 => "LED-B5",
            Self::A => "A",
            Self::D50 => "D50",
            Self::Table(table) => table.name(),
        }
    }

    /// Relative spectral power over wavelength.
    pub(super) fn table(&self) -> Result<Cow<'_, Table>, TableError> {
        let csv = match self {
            Self::D55 => include_str!("../../data/illuminant_d55.csv"),
            Self::D65 => include_str!("../../data/illuminant_d65.csv"),
            Self::E => include_str!("../../data/illuminant_e.csv"),
            Self::Fl3_15 => include_str!("../../data/illuminant_fl3_15.csv"),
            Self::LedB5 => include_str!("../../data/illuminant_led_b5.csv"),
            Self::A => include_str!("../../data/illuminant_a.csv"),
            Self::D50 => include_str!("../../data/illuminant_d50.csv"),
            Self::Table(table) => return Ok(Cow::Borrowed(table.table())),
        };
        let table = Table::parse(self.name(), csv, &["wavelength_nm", "spd"])?;
        Ok(Cow::Owned(table))
    }

    /// Checks that the illuminant can be used for spectra at `wavelengths_nm` (nm,
    /// increasing): a user's table must cover those within 380-780 nm.
    ///
    /// # Errors
    /// [`IlluminantError::Short`] if it does not.
    pub fn covers(&self, wavelengths_nm: &[f64]) -> Result<(), IlluminantError> {
        match self {
            Self::Table(table) => table.covers(wavelengths_nm),
            _ => Ok(()),
        }
    }
}

/// `D65`, or `lamp.csv (table 1f0c2d3e)` with the fingerprint of the content.
impl fmt::Display for Illuminant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        match self {
            Self::Table(table) => write!(f, " (table {})", table.fingerprint()),
            _ => Ok(()),
        }
    }
}

impl FromStr for Illuminant {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|value| value.name() == name);
        found.ok_or_else(|| {
            let names = Self::NAMES.join(", ");
            format!("no illuminant is named `{name}`; use one of {names}")
        })
    }
}

impl From<Illuminant> for IlluminantSpec {
    fn from(illuminant: Illuminant) -> Self {
        match illuminant {
            Illuminant::Table(table) => Self::Table {
                name: table.name().to_owned(),
                wavelength_nm: table.wavelengths_nm().to_vec(),
                power: table.power().to_vec(),
            },
            named => Self::Name(named.name().to_owned()),
        }
    }
}

impl TryFrom<IlluminantSpec> for Illuminant {
    type Error = String;

    fn try_from(stated: IlluminantSpec) -> Result<Self, String> {
        match stated {
            IlluminantSpec::Name(name) => name.parse(),
            IlluminantSpec::Table {
                name,
                wavelength_nm,
                power,
            } => {
                let table = PowerTable::new(&name, &wavelength_nm, &power);
                let table = table.map_err(|error| error.to_string())?;
                Ok(Self::Table(Arc::new(table)))
            }
        }
    }
}

/// A formula for the difference of two CIELAB colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(into = "&'static str", try_from = "String")]
pub enum ColourDifference {
    /// Delta-E*ab, the Euclidean distance.
    Cie1976,
    /// Delta-E 00 with all factors 1 (Sharma, Wu and Dalal 2005).
    Cie2000,
}

impl ColourDifference {
    /// All variants.
    pub const ALL: [Self; 2] = [Self::Cie1976, Self::Cie2000];

    /// The name used in files and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cie1976 => "cie1976",
            Self::Cie2000 => "cie2000",
        }
    }

    /// The difference of two colours.
    #[must_use]
    pub fn between(self, first: Lab, second: Lab) -> f64 {
        match self {
            Self::Cie1976 => delta_e(first, second),
            Self::Cie2000 => first.difference(second),
        }
    }
}

/// The illuminants and the formula used to compare the colours of two spectra. With several
/// illuminants the largest difference counts. The default is D65 and CIE 1976, as in Varsa
/// 2025.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Viewing {
    /// Illuminants, at least one.
    pub illuminants: Vec<Illuminant>,
    /// Formula of the colour difference.
    #[serde(rename = "delta_e")]
    pub difference: ColourDifference,
}

impl Default for Viewing {
    fn default() -> Self {
        Self {
            illuminants: vec![Illuminant::D65],
            difference: ColourDifference::Cie1976,
        }
    }
}

/// For example `cie2000, the worst of D65, E`.
impl fmt::Display for Viewing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<_> = self.illuminants.iter().map(Illuminant::to_string).collect();
        let worst = if names.len() > 1 { "the worst of " } else { "" };
        write!(f, "{}, {worst}{}", self.difference.name(), names.join(", "))
    }
}

impl From<ColourDifference> for &'static str {
    fn from(value: ColourDifference) -> Self {
        value.name()
    }
}

impl TryFrom<String> for ColourDifference {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        name.parse()
    }
}

impl FromStr for ColourDifference {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|value| value.name() == name);
        found.ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            format!("no colour difference is named `{name}`; use one of {names}")
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Pairs 1, 4, 7, 9, 15, 16, 17, 21, 25, 33 and 34 of table 1 of Sharma, Wu
    /// and Dalal, "The CIEDE2000 color-difference formula: implementation notes,
    /// supplementary test data, and mathematical observations", Color Res.
    /// Appl. 30, 2005.
    #[test]
    #[rustfmt::skip]
    fn ciede2000_is_the_published_one() {
        let pairs = [
            ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
            ([50.0, -1.3802, -84.2814], [50.0, 0.0, -82.7485], 1.0000),
            ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
            ([50.0, 2.49, -0.001], [50.0, -2.49, 0.0009], 7.1792),
            ([50.0, -0.001, 2.49], [50.0, 0.0011, -2.49], 4.7461),
            ([50.0, 2.5, 0.0], [50.0, 0.0, -2.5], 4.3065),
            ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
            ([50.0, 2.5, 0.0], [50.0, 3.1736, 0.5854], 1.0000),
            ([60.2574, -34.0099, 36.2677], [60.4626, -34.1751, 39.4387], 1.2644),
            ([6.7747, -0.2908, -2.4247], [5.8714, -0.0985, -2.2286], 0.6377),
            ([2.0776, 0.0795, -1.1350], [0.9033, -0.0636, -0.5514], 0.9082),
        ];
        for ([l, a, b], [other_l, other_a, other_b], expected) in pairs {
            let (first, second) = (Lab::new(l, a, b), Lab::new(other_l, other_a, other_b));
            for (one, other) in [(first, second), (second, first)] {
                let found = ColourDifference::Cie2000.between(one, other);
                assert!((found - expected).abs() < 5e-5, "{one:?} {other:?}: {found}");
            }
        }
    }

    #[test]
    fn names_are_read_back() {
        assert_eq!(
            Illuminant::ALL.each_ref().map(Illuminant::name),
            Illuminant::NAMES
        );
        for illuminant in Illuminant::ALL {
            assert_eq!(illuminant.name().parse(), Ok(illuminant));
        }
        for difference in ColourDifference::ALL {
            assert_eq!(difference.name().parse(), Ok(difference));
        }
        assert_eq!(
            "D60".parse::<Illuminant>().unwrap_err(),
            "no illuminant is named `D60`; use one of D55, D65, E, FL3.15, LED-B5, A, D50"
        );
        let viewing = Viewing {
            illuminants: vec![Illuminant::E, Illuminant::LedB5],
            difference: ColourDifference::Cie2000,
        };
        let json = serde_json::to_string(&viewing).unwrap();
        assert_eq!(
            json,
            r#"{"illuminants":["E","LED-B5"],"delta_e":"cie2000"}"#
        );
        assert_eq!(serde_json::from_str::<Viewing>(&json).unwrap(), viewing);
        assert_eq!(
            serde_json::from_str::<Viewing>("{}").unwrap(),
            Viewing::default()
        );
    }
}
