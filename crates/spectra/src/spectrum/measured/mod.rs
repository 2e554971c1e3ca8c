//! A liberal reader of spectra as instruments, libraries and spreadsheets write them
//! (docs/formats.md, "Measured spectra: what is read"): bytes become text
//! (`decode`), a table is found in it (`layout`), its columns are told apart
//! (`columns`), its rows are cleaned (`clean`), and a [`Report`] says what was done.
//!
//! Nothing is made up: a row without a usable value is left out and counted, and what
//! cannot be a spectrum is refused. Guesses are told, and the caller can overrule each.
mod between;
mod clean;
mod columns;
mod decode;
mod error;
mod layout;
mod report;

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::str::FromStr;

use serde::Serialize;

pub use between::{Gap, MAX_BRIDGE_NM};
pub use error::{Problem, SpectrumError};
pub use report::{By, Encoding, Format, MaskReason, Masked, Order, Report};

/// Longest file read, bytes: several hundred thousand rows.
pub const MAX_BYTES: u64 = 1 << 24;

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Content {
    /// Share of the light that comes back, or a reflectance factor.
    Reflectance,
    /// Share of the light that goes through.
    Transmittance,
    /// Relative spectral power of a light.
    Power,
}

impl Content {
    /// Its name, for people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Reflectance => "reflectance",
            Self::Transmittance => "transmittance",
            Self::Power => "relative power",
        }
    }
}

/// Unit of wavelengths in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Unit {
    /// Nanometres.
    Nm,
    /// Micrometres.
    Um,
}

impl Unit {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Nm, Self::Um];

    /// Its name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nm => "nm",
            Self::Um => "um",
        }
    }
}

/// Scale of reflectance or transmittance in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// All light is 1.
    Fraction,
    /// All light is 100.
    Percent,
}

impl Scale {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Fraction, Self::Percent];

    /// Its name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fraction => "fraction",
            Self::Percent => "percent",
        }
    }
}

/// A column by its name, by part of its name, or by its number from 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column(pub String);

impl FromStr for Column {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.trim() {
            "" => Err("it must be the name or the number of a column".into()),
            text => Ok(Self(text.to_owned())),
        }
    }
}

/// What is asked of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// What the values are; where it is not said, what their name says, else
    /// reflectance.
    pub content: Option<Content>,
    /// Which column; where it is not said, the first that fits by its name, else the
    /// first.
    pub column: Option<Column>,
    /// Unit of the wavelengths, whatever the file says.
    pub unit: Option<Unit>,
    /// Scale of the values, whatever the file says.
    pub scale: Option<Scale>,
    /// Wavelengths that are used, nm, both included.
    pub range_nm: (f64, f64),
    /// Values that are possible, as shares, both included; others are masked.
    pub possible: (f64, f64),
    /// Bands in nm, both ends included, in which any number is taken and nothing is
    /// missed.
    pub excluded_nm: Vec<(f64, f64)>,
}

impl Request {
    /// Any positive wavelength and any value from `possible`.
    #[must_use]
    pub fn of(content: Option<Content>, possible: (f64, f64)) -> Self {
        Self {
            content,
            column: None,
            unit: None,
            scale: None,
            range_nm: (0.0, f64::INFINITY),
            possible,
            excluded_nm: Vec::new(),
        }
    }

    fn excluded(&self, nm: f64) -> bool {
        let mut bands = self.excluded_nm.iter();
        bands.any(|(from, to)| (*from..=*to).contains(&nm))
    }
}

/// A value at a wavelength.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Wavelength, nm.
    pub nm: f64,
    /// Share of the light, or relative power.
    pub value: f64,
    /// Its standard uncertainty, if the file states it.
    pub uncertainty: Option<f64>,
}

/// A spectrum as read.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// By wavelength, strictly increasing; at least one.
    pub samples: Vec<Sample>,
    /// What was found and done.
    pub report: Report,
}

/// Reads the file at `path`.
///
/// # Errors
/// See [`Problem`].
pub fn read(path: &Path, request: &Request) -> Result<Curve, SpectrumError> {
    let name = path.display().to_string();
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|error| SpectrumError {
            file: name.clone(),
            line: None,
            problem: Box::new(Problem::Read(error.to_string())),
        })?;
    parse(&name, &bytes, request)
}

/// The same from the `bytes` of a file; `file` is its name in messages.
///
/// # Errors
/// See [`Problem`].
pub fn parse(file: &str, bytes: &[u8], request: &Request) -> Result<Curve, SpectrumError> {
    let read = || {
        if bytes.len() as u64 > MAX_BYTES {
            return Err((None, Problem::Length));
        }
        let whole = |problem| (None, problem);
        let (text, encoding) = decode::decode(bytes).map_err(whole)?;
        let lines = decode::lines(&text);
        let layout = layout::layout(&lines).map_err(whole)?;
        clean::curve(&lines, &layout, encoding, request)
    };
    read().map_err(|(line, problem)| SpectrumError {
        file: file.to_owned(),
        line,
        problem: Box::new(problem),
    })
}
