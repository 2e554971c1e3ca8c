//! The report of how a file was read, which prints as one line.
use std::fmt::{self, Write};

use serde::Serialize;

use super::{Content, Unit, ValueScale};

/// Text encoding of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Encoding {
    /// UTF-8, with or without a byte order mark.
    Utf8,
    /// UTF-16, little-endian.
    Utf16Le,
    /// UTF-16, big-endian.
    Utf16Be,
    /// ISO 8859-1, if it is none of the others.
    Latin1,
}

/// Format of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// Any table.
    Table,
    /// Text format of the ASTER and ECOSTRESS spectral libraries.
    Ecostress,
    /// Spectra Vista `.sig`.
    Svc,
    /// Spectral Evolution `.sed`.
    SpectralEvolution,
}

impl Format {
    fn name(self) -> &'static str {
        match self {
            Self::Table => "a table",
            Self::Ecostress => "ECOSTRESS text",
            Self::Svc => "an SVC .sig file",
            Self::SpectralEvolution => "a Spectral Evolution .sed file",
        }
    }
}

/// How a property of the file was determined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum KnownFrom {
    /// Given by the caller.
    Asked,
    /// Stated by a name or a line of the file.
    Name,
    /// Guessed from the position.
    Place,
    /// Guessed from the numbers.
    Values,
    /// Assumed by default.
    Default,
}

impl KnownFrom {
    fn name(self) -> &'static str {
        match self {
            Self::Asked => "as requested",
            Self::Name => "as the file states",
            Self::Place => "the first",
            Self::Values => "guessed from the values",
            Self::Default => "assumed",
        }
    }
}

/// Order of the wavelengths in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// Each wavelength is above or equal to the one before.
    Ascending,
    /// Each wavelength is below or equal to the one before.
    Descending,
    /// Neither, for example where detectors overlap.
    Mixed,
}

/// Why a row is masked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MaskReason {
    /// Empty, NaN or a fill value such as -999.
    Missing,
    /// Outside the possible range.
    Impossible,
}

/// A row without a usable value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Masked {
    /// Line in the file, from 1.
    pub line: usize,
    /// Wavelength, nm, if the row has one.
    pub wavelength_nm: Option<f64>,
    /// Value, if the row has one.
    pub value: Option<f64>,
    /// Reason.
    pub why: MaskReason,
}

/// How a file was read.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReadReport {
    /// Text encoding.
    pub encoding: Encoding,
    /// Format of the file.
    pub format: Format,
    /// Separator of the columns: `tabs`, `semicolons`, `commas`, `bars` or `spaces`.
    pub separated_by: &'static str,
    /// Number of columns.
    pub columns: usize,
    /// Number of the column of wavelengths, from 1.
    pub wavelength_column: usize,
    /// Number of the column of values, from 1.
    pub column: usize,
    /// Name of the column of values; empty if it has none.
    pub name: String,
    /// How the column of values was chosen.
    pub column_by: KnownFrom,
    /// Number of further columns that could have been chosen.
    pub other_columns: usize,
    /// Number of the column of standard uncertainties, from 1, if there is one.
    pub uncertainty_column: Option<usize>,
    /// Quantity measured.
    pub content: Content,
    /// How the quantity was determined.
    pub content_by: KnownFrom,
    /// Unit of the wavelengths in the file.
    pub unit: Unit,
    /// How the unit was determined.
    pub unit_by: KnownFrom,
    /// Scale of the values in the file; `None` for power.
    pub scale: Option<ValueScale>,
    /// How the scale was determined.
    pub scale_by: KnownFrom,
    /// Order of the wavelengths in the file.
    pub order: Order,
    /// Number of rows of the table.
    pub rows: usize,
    /// Number of wavelengths with a used value.
    pub used: usize,
    /// Number of rows outside the range of wavelengths used.
    pub outside: usize,
    /// Shortest and longest wavelength of these rows, nm.
    #[serde(skip)]
    pub outside_nm: Option<(f64, f64)>,
    /// Number of rows averaged with others of the same wavelength.
    pub merged: usize,
    /// Rows without a usable value, by line.
    pub masked: Vec<Masked>,
    /// Number of uncertainties that are missing or negative.
    pub bad_uncertainties: usize,
    /// Number of lines after the table.
    pub footer_lines: usize,
}

impl ReadReport {
    fn masked(&self, why: MaskReason) -> Vec<&Masked> {
        self.masked.iter().filter(|row| row.why == why).collect()
    }
}

/// Largest number of line ranges printed.
const MAX_RANGES: usize = 8;

/// `lines 4-9, 12`, followed by `...` if there are more ranges.
fn lines(rows: &[&Masked]) -> String {
    let mut ranges: Vec<(usize, usize)> = Vec::new();
    for row in rows {
        match ranges.last_mut() {
            Some((_, last)) if *last + 1 == row.line => *last = row.line,
            _ => ranges.push((row.line, row.line)),
        }
    }
    let text = |(from, to): &(usize, usize)| match from == to {
        true => from.to_string(),
        false => format!("{from}-{to}"),
    };
    let shown: Vec<_> = ranges.iter().take(MAX_RANGES).map(text).collect();
    let plural = if rows.len() == 1 { "" } else { "s" };
    let mut out = format!("line{plural} {}", shown.join(", "));
    if ranges.len() > MAX_RANGES {
        out += ", ...";
    }
    out
}

/// Prints one line.
impl fmt::Display for ReadReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut out = self.format.name().to_owned();
        match self.encoding {
            Encoding::Utf8 => {}
            Encoding::Utf16Le | Encoding::Utf16Be => out += " in UTF-16",
            Encoding::Latin1 => out += " in Latin-1",
        }
        let name = match self.name.as_str() {
            "" => String::new(),
            name => format!(" `{name}`"),
        };
        write!(
            out,
            ", {} columns by {}; {} in column {}{name} ({}",
            self.columns,
            self.separated_by,
            self.content.name(),
            self.column,
            self.column_by.name(),
        )?;
        if self.other_columns > 0 {
            write!(out, ", {} more match", self.other_columns)?;
        }
        if self.content_by == KnownFrom::Default {
            write!(out, "; {} is assumed", self.content.name())?;
        }
        out += ")";
        if let Some(scale) = self.scale {
            write!(out, ", {} ({})", scale.name(), self.scale_by.name())?;
        }
        if let Some(column) = self.uncertainty_column {
            write!(out, ", its uncertainty in column {column}")?;
        }
        write!(
            out,
            "; wavelengths in column {}, {} ({})",
            self.wavelength_column,
            self.unit.name(),
            self.unit_by.name()
        )?;
        match self.order {
            Order::Ascending => {}
            Order::Descending => out += ", descending: reversed",
            Order::Mixed => out += ", out of order: sorted",
        }
        write!(out, "; {} of {} rows used", self.used, self.rows)?;
        if self.outside > 0 {
            write!(out, ", {} outside the range", self.outside)?;
            match self.outside_nm {
                Some((one, same)) if one == same => write!(out, " (at {one} nm)")?,
                Some((shortest, longest)) => write!(out, " (from {shortest} to {longest} nm)")?,
                None => {}
            }
        }
        if self.merged > 0 {
            write!(
                out,
                ", {} merged with others of the same wavelength",
                self.merged
            )?;
        }
        for (why, text) in [
            (MaskReason::Missing, "without a value"),
            (MaskReason::Impossible, "outside the possible range"),
        ] {
            let rows = self.masked(why);
            if !rows.is_empty() {
                write!(out, ", {} {text} ({})", rows.len(), lines(&rows))?;
            }
        }
        if self.bad_uncertainties > 0 {
            write!(out, ", {} uncertainties not used", self.bad_uncertainties)?;
        }
        if self.footer_lines > 0 {
            write!(
                out,
                ", {} lines after the table not read",
                self.footer_lines
            )?;
        }
        f.write_str(&out)
    }
}
