//! Errors in reading a measured spectrum.
use thiserror::Error;

use super::MAX_BYTES;

/// A spectrum that cannot be read. The message includes help.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{file}{}: {problem}", .line.map_or(String::new(), |line| format!(":{line}")))]
pub struct SpectrumError {
    /// The file, as named by the caller.
    pub file: String,
    /// Line of the problem, from 1; `None` if it is not in one line.
    pub line: Option<usize>,
    /// The problem.
    pub problem: Box<ReadProblem>,
}

impl SpectrumError {
    /// The message, with help for callers that cannot choose the column, scale or unit.
    #[must_use]
    pub fn without_choices(&self) -> String {
        let text = self.to_string();
        match (&*self.problem, text.split_once("\n  help: ")) {
            (
                ReadProblem::OtherContent { .. }
                | ReadProblem::Impossible { .. }
                | ReadProblem::Empty { .. },
                Some((message, _)),
            ) => format!(
                "{message}\n  help: correct the file, or give one whose first matching columns are wavelength and value"
            ),
            _ => text,
        }
    }
}

/// The kinds of problem. Text of the file is quoted in shortened form.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ReadProblem {
    /// The file cannot be read.
    #[error("cannot be read: {0}\n  help: give the path of a text file with a spectrum")]
    Read(String),
    /// The file is longer than [`MAX_BYTES`].
    #[error("longer than {MAX_BYTES} bytes\n  help: give a text file with one spectrum")]
    Length,
    /// The file is not text; holds the offending character.
    #[error(
        "not a text file: it contains the character U+{0:04X}\n  help: export the spectrum as text (CSV, .sed, .sig); for binary files (.asd, .xlsx) use the program that wrote them"
    )]
    NoText(u32),
    /// The file has no row of numbers; holds its first line.
    #[error(
        "no row with a wavelength and a value; the file begins with `{0}`\n  help: give rows of at least two numbers, the wavelength and the value, separated by tabs, semicolons, commas, bars or spaces"
    )]
    NoTable(String),
    /// A row with more cells than the header or the first row.
    #[error(
        "the row `{row}` has {found} cells; expected {expected}, as in the header or the rows before\n  help: if commas are decimal signs, separate the columns by semicolons or tabs"
    )]
    Cells {
        /// Number of cells of the row.
        found: usize,
        /// Number of cells of the header, or of the first row.
        expected: usize,
        /// The row.
        row: String,
    },
    /// Text where a number is expected.
    #[error(
        "`{text}` where a number is expected ({quantity})\n  help: leave a cell without a measurement empty, or write NaN"
    )]
    Number {
        /// The text.
        text: String,
        /// The wavelength, the value or the uncertainty.
        quantity: &'static str,
    },
    /// Mixed decimal points and commas; holds the number.
    #[error(
        "`{0}` has another decimal sign than the rows before\n  help: write all numbers with decimal points, or all with commas, and none with thousands separators"
    )]
    Decimal(String),
    /// A wavelength that is 0 or negative.
    #[error(
        "wavelength {0} is not above 0\n  help: give the wavelength as the first number of a row, in nm or um"
    )]
    Wavelength(f64),
    /// Wavenumbers instead of wavelengths; holds the name of the column.
    #[error(
        "the column `{0}` has wavenumbers; expected wavelengths in nm or um\n  help: convert them: wavelength in um = 10000 / wavenumber in 1/cm"
    )]
    Wavenumber(String),
    /// No column has the requested name or number.
    #[error(
        "no column `{requested}`; the columns are {names}\n  help: name one of these, or give its number"
    )]
    NoColumn {
        /// The requested column.
        requested: String,
        /// Numbers and names of the columns in the file.
        names: String,
    },
    /// The column holds another quantity than requested.
    #[error(
        "the column `{column}` holds {found}, but {requested} is requested\n  help: request {found}, or name another column"
    )]
    OtherContent {
        /// Name of the column.
        column: String,
        /// The quantity according to its name.
        found: &'static str,
        /// The requested quantity.
        requested: &'static str,
    },
    /// A column that is named after another quantity.
    #[error(
        "the column `{0}` is neither reflectance nor transmittance by its name\n  help: name another column; or, if it is one of them, say which as the quantity"
    )]
    NeitherQuantity(String),
    /// Too many impossible values.
    #[error(
    "{value} at {nm} nm is not a valid {quantity}: allowed {low} to {high}{}, and {impossible} of {rows} rows are outside\n  help: choose another column, or give the scale of the values (fraction or percent){}", if *percent { " percent" } else { "" }, if excludable.is_empty() { "" } else { "; rows in excluded bands are not checked" }
    )]
    Impossible {
        /// The first impossible value, in the scale of the file.
        value: f64,
        /// Its wavelength, nm.
        nm: f64,
        /// The expected quantity.
        quantity: &'static str,
        /// Smallest value allowed, in the scale of the file.
        low: f64,
        /// Largest value allowed, in the scale of the file.
        high: f64,
        /// Whether the file is taken to hold percent.
        percent: bool,
        /// Number of impossible values.
        impossible: usize,
        /// Number of rows with a value.
        rows: usize,
        /// Not empty if the caller excludes bands.
        excludable: &'static str,
    },
    /// Too many rows with the same wavelength.
    #[error(
        "wavelength {nm} nm has {times} rows; the file seems to hold several spectra one below the other\n  help: give one spectrum, or one column per spectrum"
    )]
    Stacked {
        /// The wavelength, nm.
        nm: f64,
        /// Number of rows with this wavelength.
        times: usize,
    },
    /// No usable row.
    #[error(
        "none of its {rows} rows has a value within {low} to {high} nm (wavelengths are taken as {unit}){}\n  help: give the unit of the wavelengths (nm or um), or choose another column",
        outside_nm.map_or(String::new(), |(shortest, longest)| format!("; they go from {shortest} to {longest} nm"))
    )]
    Empty {
        /// Number of rows.
        rows: usize,
        /// Smallest wavelength used, nm.
        low: f64,
        /// Largest wavelength used, nm.
        high: f64,
        /// Assumed unit of the wavelengths.
        unit: &'static str,
        /// Shortest and longest wavelength of the rows outside this range, nm.
        outside_nm: Option<(f64, f64)>,
    },
}

/// Longest quotation of the file in a message, characters.
const MAX_QUOTED: usize = 60;

/// `text` shortened for a message, with control characters escaped.
pub(super) fn quoted(text: &str) -> String {
    let text = text.trim();
    let characters = text.chars().take(MAX_QUOTED);
    characters.flat_map(char::escape_debug).collect()
}
