//! Why a spectrum is refused.
use thiserror::Error;

use super::MAX_BYTES;

/// A spectrum that cannot be read, and what to do about it.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{file}{}: {problem}", .line.map_or(String::new(), |line| format!(":{line}")))]
pub struct SpectrumError {
    /// The file as it was named by the caller.
    pub file: String,
    /// Line to blame, from 1; `None` where none is.
    pub line: Option<usize>,
    /// What is wrong.
    pub problem: Box<Problem>,
}

impl SpectrumError {
    /// The message, with help for who cannot say which column to read and in what it is.
    #[must_use]
    pub fn without_choices(&self) -> String {
        let text = self.to_string();
        match (&*self.problem, text.split_once("\n  help: ")) {
            (
                Problem::OtherContent { .. } | Problem::Impossible { .. } | Problem::Empty { .. },
                Some((message, _)),
            ) => format!(
                "{message}\n  help: mend the file, or give one in which the first fitting columns are wavelength and value"
            ),
            _ => text,
        }
    }
}

/// The kinds of refusal. Text of the file is quoted short.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Problem {
    /// The file cannot be read.
    #[error("cannot be read: {0}\n  help: give the path of a text file with a spectrum")]
    Read(String),
    /// Too much to be a spectrum.
    #[error("longer than {MAX_BYTES} bytes\n  help: this is no table of one spectrum")]
    Length,
    /// Not text.
    #[error(
        "no text: it has the character U+{0:04X}\n  help: export the spectrum as text (CSV, .sed, .sig), from binary files (.asd, .xlsx) with the program that wrote them"
    )]
    NoText(u32),
    /// No row of numbers.
    #[error(
        "no row with a wavelength and a value, and it begins with `{0}`\n  help: give rows of at least two numbers, the wavelength and the value, separated by tabs, semicolons, commas, bars or spaces"
    )]
    NoTable(String),
    /// A row of another length than the header, or than most rows.
    #[error(
        "{found} cells (`{row}`) where {expected} are expected, as in the header or the rows before\n  help: if commas are decimal signs, separate the columns by semicolons or tabs"
    )]
    Cells {
        /// Cells of the row.
        found: usize,
        /// Those of the header, or of the first row.
        expected: usize,
        /// The row.
        row: String,
    },
    /// Text where a number is expected.
    #[error(
        "`{text}` where a number is expected ({what})\n  help: leave a cell without a measurement empty, or write NaN"
    )]
    Number {
        /// The text.
        text: String,
        /// Whether it is the wavelength or the value.
        what: &'static str,
    },
    /// Decimal points and commas.
    #[error(
        "`{0}` has another decimal sign than the rows before\n  help: write all numbers with points, or all with commas, and none with separators of thousands"
    )]
    Decimal(String),
    /// No wavelength.
    #[error(
        "wavelength {0} is not above 0\n  help: the wavelength comes first in a row, in nm or um"
    )]
    Wavelength(f64),
    /// Numbers of waves per length.
    #[error(
        "the column `{0}` has wavenumbers, expected are wavelengths in nm or um\n  help: convert them: wavelength in um = 10000 / wavenumber in 1/cm"
    )]
    Wavenumber(String),
    /// No column of the name or number that was asked for.
    #[error(
        "no column `{asked}`; there are {names}\n  help: name one of these, or give its number"
    )]
    NoColumn {
        /// What was asked for.
        asked: String,
        /// Numbers and names of those there are.
        names: String,
    },
    /// The file holds another quantity than the one asked for.
    #[error(
        "the column `{column}` is {found}, asked for is {asked}\n  help: ask for {found}, or name another column"
    )]
    OtherContent {
        /// The column.
        column: String,
        /// What it says that it is.
        found: &'static str,
        /// What was asked for.
        asked: &'static str,
    },
    /// Too many values that cannot be.
    #[error(
        "{value} at {nm} nm is no {what}: allowed {low} to {high}{}, and {impossible} of {rows} rows are such\n  help: choose another column, or say in what the values are (fraction or percent){}", if *percent { " percent" } else { "" }, if excludable.is_empty() { "" } else { "; rows in excluded bands are not judged" }
    )]
    Impossible {
        /// The first of them, as the file has it.
        value: f64,
        /// Where, nm.
        nm: f64,
        /// What it should be.
        what: &'static str,
        /// Least value allowed, in the scale of the file.
        low: f64,
        /// Largest value allowed, in the scale of the file.
        high: f64,
        /// Whether the file is taken to hold percent.
        percent: bool,
        /// How many there are.
        impossible: usize,
        /// Of how many rows with a value.
        rows: usize,
        /// Not empty where the caller has bands to exclude.
        excludable: &'static str,
    },
    /// One wavelength again and again.
    #[error(
        "wavelength {nm} nm has {times} rows: several spectra one below the other?\n  help: give one spectrum, or one column for each"
    )]
    Stacked {
        /// The wavelength, nm.
        nm: f64,
        /// How often it is there.
        times: usize,
    },
    /// No row that is used.
    #[error(
        "none of its {rows} rows has a value within {low} to {high} nm (wavelengths are taken as {unit})\n  help: say in what the wavelengths are (nm or um), or choose another column"
    )]
    Empty {
        /// How many rows there are.
        rows: usize,
        /// First wavelength that is used, nm.
        low: f64,
        /// Last wavelength that is used, nm.
        high: f64,
        /// Unit of the wavelengths.
        unit: &'static str,
    },
}

/// Longest text of the file quoted in a message, characters.
const MAX_QUOTED: usize = 60;

/// `text` short, without control characters.
pub(super) fn quoted(text: &str) -> String {
    let text = text.trim();
    let characters = text.chars().take(MAX_QUOTED);
    characters.flat_map(char::escape_debug).collect()
}
