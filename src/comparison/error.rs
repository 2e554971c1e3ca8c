//! Why a measured spectrum is refused.
use thiserror::Error;

use super::measured::{MAX_BYTES, MAX_GAP_NM, RANGE_NM, VALUES};

/// A measured spectrum that cannot be compared with, and what to do about it.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{file}{}: {problem}", .line.map_or(String::new(), |line| format!(":{line}")))]
pub struct MeasuredError {
    /// The file as it was named by the caller.
    pub file: String,
    /// Line to blame, from 1; `None` where none is.
    pub line: Option<usize>,
    /// What is wrong.
    pub problem: Problem,
}

/// The kinds of refusal. Text of the file is quoted short.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Problem {
    /// The file cannot be read.
    #[error("cannot be read: {0}\n  help: give the path of a CSV file")]
    Read(String),
    /// Too much to be a spectrum.
    #[error("longer than {MAX_BYTES} bytes\n  help: this is no table of one spectrum")]
    Length,
    /// Not text.
    #[error("not UTF-8\n  help: save the table as CSV in UTF-8")]
    Encoding,
    /// Another header, or none.
    #[error(
        "the header is `{0}`, allowed `wavelength_nm,reflectance`, `wavelength_nm,transmittance` and `wavelength_nm,value`, and a third column `uncertainty`\n  help: name the columns so, separated by commas; lines starting with # are comments"
    )]
    Header(String),
    /// `value` of what?
    #[error(
        "the column `value` does not say of what\n  help: say --quantity reflectance or --quantity transmittance"
    )]
    Unnamed,
    /// The file holds another quantity than the one asked for.
    #[error("the column is {found}, asked for is {asked}\n  help: leave --quantity {asked} out")]
    OtherQuantity {
        /// That of the file.
        found: &'static str,
        /// The other.
        asked: &'static str,
    },
    /// A row of another length than the header.
    #[error(
        "{found} columns where the header has {expected}\n  help: give one number per column, separated by commas, with decimal points"
    )]
    Columns {
        /// Columns of the row.
        found: usize,
        /// Those of the header.
        expected: usize,
    },
    /// Not a finite number.
    #[error(
        "`{0}` is not a finite number\n  help: leave out rows without a measurement; no value is made up across gaps wider than {MAX_GAP_NM} nm"
    )]
    Number(String),
    /// Not above the wavelength before it.
    #[error(
        "wavelength {0} nm is not above the one before it\n  help: sort the rows, and give each wavelength once"
    )]
    Order(f64),
    /// No reflectance or transmittance.
    #[error(
        "{0} is out of range: allowed {low} to {high}\n  help: give shares, not percents; only in excluded bands (--exclude) any number is taken", low = VALUES.0, high = VALUES.1
    )]
    Value(f64),
    /// No uncertainty.
    #[error(
        "uncertainty {0} is out of range: allowed 0 to 1\n  help: give the standard uncertainty in the units of the value"
    )]
    Uncertainty(f64),
    /// No row that is used.
    #[error(
        "none of its {rows} rows lies within {low} to {high} nm\n  help: give wavelengths in nm", low = RANGE_NM.0, high = RANGE_NM.1
    )]
    Empty {
        /// How many there are.
        rows: usize,
    },
    /// Too little in common with the simulation.
    #[error(
        "only {common} wavelengths of the sample ({} to {} nm) can be compared with the file ({} to {} nm), at least 2 are needed; excluded: {excluded}\n  help: change [wavelengths] of the sample or --exclude; values are interpolated between rows at most {MAX_GAP_NM} nm apart, not beyond them", .sample_nm.0, .sample_nm.1, .file_nm.0, .file_nm.1
    )]
    Overlap {
        /// Wavelengths that count.
        common: usize,
        /// First and last of the simulation.
        sample_nm: (f64, f64),
        /// First and last of the file.
        file_nm: (f64, f64),
        /// The bands left out, as text.
        excluded: String,
    },
}
