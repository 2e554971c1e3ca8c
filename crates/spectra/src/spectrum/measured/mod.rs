//! A tolerant reader of measured spectra in the formats of instruments, spectral libraries
//! and spreadsheets (docs/formats.md, "Measured spectra: what is read"). `decode` converts
//! bytes to text, `layout` finds the table, `columns` identifies its columns, `clean`
//! converts its rows, and a [`ReadReport`] describes what was done.
//!
//! No values are invented: a row without a usable value is masked and counted, and a file
//! that cannot be a spectrum is refused. The report states every guess, and the caller can
//! override each.
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

pub use between::{CoverageGap, MAX_BRIDGE_NM};
pub use error::{ReadProblem, SpectrumError};
pub use report::{Encoding, Format, KnownFrom, MaskReason, Masked, Order, ReadReport};

/// Longest file read, bytes: several hundred thousand rows.
pub const MAX_BYTES: u64 = 1 << 24;

/// The quantity in a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Content {
    /// Reflectance, or a reflectance factor.
    Reflectance,
    /// Transmittance.
    Transmittance,
    /// Relative spectral power of an illuminant.
    Power,
}

impl Content {
    /// Name in messages.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Reflectance => "reflectance",
            Self::Transmittance => "transmittance",
            Self::Power => "relative power",
        }
    }
}

/// Unit of the wavelengths in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Unit {
    /// Nanometres.
    Nm,
    /// Micrometres.
    Um,
}

impl Unit {
    /// All variants.
    pub const ALL: [Self; 2] = [Self::Nm, Self::Um];

    /// Name on the command line.
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
pub enum ValueScale {
    /// All light is 1.
    Fraction,
    /// All light is 100.
    Percent,
}

impl ValueScale {
    /// All variants.
    pub const ALL: [Self; 2] = [Self::Fraction, Self::Percent];

    /// Name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fraction => "fraction",
            Self::Percent => "percent",
        }
    }
}

/// A column, given by its name, a part of its name, or its number from 1 (`2`, or `#2` where a
/// column has the name `2`).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column(pub String);

impl FromStr for Column {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.trim() {
            "" => Err("give the name or the number of a column".into()),
            text => Ok(Self(text.to_owned())),
        }
    }
}

/// What to read from a file, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadOptions {
    /// Quantity of the values; by default taken from the column name, else reflectance.
    pub content: Option<Content>,
    /// Column of the values; by default the first with a matching name, else the first.
    pub column: Option<Column>,
    /// Unit of the wavelengths; overrides the file.
    pub unit: Option<Unit>,
    /// Scale of the values; overrides the file.
    pub scale: Option<ValueScale>,
    /// Range of wavelengths used, nm, ends included.
    pub range_nm: (f64, f64),
    /// Range of possible values, as fractions, ends included; others are masked.
    pub possible: (f64, f64),
    /// Bands, nm, ends included, in which any value is accepted and missing values are not
    /// reported.
    pub excluded_nm: Vec<(f64, f64)>,
}

impl ReadOptions {
    /// A request for any positive wavelength and values within `possible`.
    #[must_use]
    pub fn new(content: Option<Content>, possible: (f64, f64)) -> Self {
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

/// The value at a wavelength.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredValue {
    /// Wavelength, nm.
    pub nm: f64,
    /// Reflectance or transmittance as a fraction, or relative power.
    pub value: f64,
    /// Standard uncertainty of the value, if the file states it.
    pub uncertainty: Option<f64>,
}

/// A spectrum read from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Samples by strictly increasing wavelength; at least one.
    pub samples: Vec<MeasuredValue>,
    /// How the file was read.
    pub report: ReadReport,
}

/// Reads the file at `path`.
///
/// # Errors
/// A [`SpectrumError`] with the [`ReadProblem`] if the file cannot be read.
pub fn read(path: &Path, request: &ReadOptions) -> Result<Curve, SpectrumError> {
    let name = path.display().to_string();
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|error| SpectrumError {
            file: name.clone(),
            line: None,
            problem: Box::new(ReadProblem::Read(error.to_string())),
        })?;
    parse(&name, &bytes, request)
}

/// As [`read`], from the `bytes` of a file; `file` is its name in messages.
///
/// # Errors
/// A [`SpectrumError`] with the [`ReadProblem`] if the bytes cannot be read as a spectrum.
pub fn parse(file: &str, bytes: &[u8], request: &ReadOptions) -> Result<Curve, SpectrumError> {
    with_layout(file, bytes, |lines, layout, encoding| {
        clean::curve(lines, layout, encoding, request)
    })
}

/// The curves of all columns of numbers but the wavelength and uncertainties, from the `bytes` of
/// a file; see [`parse`]. `request.column` does not count.
///
/// # Errors
/// A [`SpectrumError`] with the [`ReadProblem`] of the first column that cannot be read.
pub fn parse_all(
    file: &str,
    bytes: &[u8],
    request: &ReadOptions,
) -> Result<Vec<Curve>, SpectrumError> {
    with_layout(file, bytes, |lines, layout, encoding| {
        let curve = |column: Option<usize>| {
            let column = column.map(|column| Column(format!("#{column}")));
            let request = ReadOptions {
                column,
                ..request.clone()
            };
            clean::curve(lines, layout, encoding, &request)
        };
        let wavelengths = curve(None)?.report.wavelength_column;
        let is_used = |column: &usize| {
            let name = layout
                .header
                .as_ref()
                .and_then(|(_, names)| names.get(*column - 1));
            *column != wavelengths
                && layout.numeric[*column - 1] > 0.0
                && !name.is_some_and(|name| columns::is_uncertainty(name))
        };
        let used = (1..=layout.numeric.len()).filter(is_used);
        used.map(|column| curve(Some(column))).collect()
    })
}

/// Calls `read` with the lines, the layout and the encoding of the `bytes` of a file.
fn with_layout<T>(
    file: &str,
    bytes: &[u8],
    read: impl FnOnce(&[&str], &layout::TextLayout, Encoding) -> Result<T, clean::RowRefusal>,
) -> Result<T, SpectrumError> {
    let laid_out = || {
        if bytes.len() as u64 > MAX_BYTES {
            return Err((None, ReadProblem::Length));
        }
        let no_line = |problem| (None, problem);
        let (text, encoding) = decode::decode(bytes).map_err(no_line)?;
        let lines = decode::lines(&text);
        let layout = layout::layout(&lines).map_err(no_line)?;
        read(&lines, &layout, encoding)
    };
    laid_out().map_err(|(line, problem)| SpectrumError {
        file: file.to_owned(),
        line,
        problem: Box::new(problem),
    })
}
