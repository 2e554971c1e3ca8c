//! What was found in a file and done with it, in one line.
use std::fmt::{self, Write};

use serde::Serialize;

use super::{Content, Scale, Unit};

/// How the bytes were taken for text.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Encoding {
    /// UTF-8, with or without a byte order mark.
    Utf8,
    /// UTF-16, the low byte first.
    Utf16Le,
    /// UTF-16, the high byte first.
    Utf16Be,
    /// ISO 8859-1, where it is none of the others.
    Latin1,
}

/// A kind of file that is known by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// Any table.
    Table,
    /// Text of the ASTER and ECOSTRESS spectral libraries.
    Ecostress,
    /// Spectra Vista, `.sig`.
    Svc,
    /// Spectral Evolution, `.sed`.
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

/// How something is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum By {
    /// The caller said so.
    Asked,
    /// A name or a line of the file says so.
    Name,
    /// Guessed from where it stands.
    Place,
    /// Guessed from the numbers.
    Values,
    /// Nothing says anything else.
    Default,
}

impl By {
    fn name(self) -> &'static str {
        match self {
            Self::Asked => "as asked",
            Self::Name => "as the file says",
            Self::Place => "the first",
            Self::Values => "guessed from the values",
            Self::Default => "assumed",
        }
    }
}

/// The order of the wavelengths in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// Each above the one before, or equal to it.
    Ascending,
    /// Each below the one before, or equal to it.
    Descending,
    /// Neither, as where detectors overlap.
    Mixed,
}

/// Why a row has no value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MaskReason {
    /// Empty, NaN or a fill value such as -999.
    Missing,
    /// Outside what is possible.
    Impossible,
}

/// A row that is not used.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Masked {
    /// Its line in the file, from 1.
    pub line: usize,
    /// Its wavelength, nm, if it has one.
    pub wavelength_nm: Option<f64>,
    /// Its value, if it has one.
    pub value: Option<f64>,
    /// Why.
    pub why: MaskReason,
}

/// What was found and done.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// How the bytes were taken for text.
    pub encoding: Encoding,
    /// The kind of file.
    pub format: Format,
    /// What separates its columns: `tabs`, `semicolons`, `commas`, `bars` or `spaces`.
    pub separated_by: &'static str,
    /// How many columns it has.
    pub columns: usize,
    /// Number of the column of wavelengths, from 1.
    pub wavelength_column: usize,
    /// Number of the column of values, from 1.
    pub column: usize,
    /// Its name, empty where it has none.
    pub name: String,
    /// How it was chosen.
    pub column_by: By,
    /// Further columns that could have been chosen.
    pub other_columns: usize,
    /// Number of the column of standard uncertainties, from 1, if there is one.
    pub uncertainty_column: Option<usize>,
    /// What is measured.
    pub content: Content,
    /// How that is known.
    pub content_by: By,
    /// Unit of the wavelengths in the file.
    pub unit: Unit,
    /// How that is known.
    pub unit_by: By,
    /// Scale of the values in the file; none for power.
    pub scale: Option<Scale>,
    /// How that is known.
    pub scale_by: By,
    /// Order of the wavelengths in the file.
    pub order: Order,
    /// Rows of the table.
    pub rows: usize,
    /// Wavelengths with a value that is used.
    pub used: usize,
    /// Rows outside the range of wavelengths that is used.
    pub outside: usize,
    /// Rows that were averaged into another one of the same wavelength.
    pub merged: usize,
    /// Rows without a value that could be used, by line.
    pub masked: Vec<Masked>,
    /// Uncertainties that are none: empty or negative.
    pub bad_uncertainties: usize,
    /// Lines after the table.
    pub footer_lines: usize,
}

impl Report {
    fn masked(&self, why: MaskReason) -> Vec<&Masked> {
        self.masked.iter().filter(|row| row.why == why).collect()
    }
}

/// Most stretches of lines named.
const STRETCHES: usize = 8;

/// `lines 4-9 and 12`, and how many more.
fn lines(rows: &[&Masked]) -> String {
    let mut stretches: Vec<(usize, usize)> = Vec::new();
    for row in rows {
        match stretches.last_mut() {
            Some((_, last)) if *last + 1 == row.line => *last = row.line,
            _ => stretches.push((row.line, row.line)),
        }
    }
    let text = |(from, to): &(usize, usize)| match from == to {
        true => from.to_string(),
        false => format!("{from}-{to}"),
    };
    let shown: Vec<_> = stretches.iter().take(STRETCHES).map(text).collect();
    let plural = if rows.len() == 1 { "" } else { "s" };
    let mut out = format!("line{plural} {}", shown.join(", "));
    if stretches.len() > STRETCHES {
        out += ", ...";
    }
    out
}

/// One line.
impl fmt::Display for Report {
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
            write!(out, ", {} more like it", self.other_columns)?;
        }
        if self.content_by == By::Default {
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
            Order::Descending => out += ", descending: turned round",
            Order::Mixed => out += ", out of order: sorted",
        }
        write!(out, "; {} of {} rows used", self.used, self.rows)?;
        if self.outside > 0 {
            write!(out, ", {} outside the range", self.outside)?;
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
            (MaskReason::Impossible, "outside what is possible"),
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
