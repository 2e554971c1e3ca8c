//! Why a measured spectrum cannot be compared with.
use thiserror::Error;

use super::measured::MAX_GAP_NM;
use crate::spectrum::measured::SpectrumError;

/// A measured spectrum that cannot be compared with, and what to do about it.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MeasuredError {
    /// It cannot be read.
    #[error(transparent)]
    Spectrum(#[from] SpectrumError),
    /// Too little in common with the simulation.
    #[error(
        "{file}: only {common} wavelengths of the sample ({} to {} nm) can be compared with the file ({} to {} nm), at least 2 are needed; excluded: {excluded}\n  help: change [wavelengths] of the sample or --exclude; values are interpolated between rows at most {MAX_GAP_NM} nm apart, not beyond them", .sample_nm.0, .sample_nm.1, .file_nm.0, .file_nm.1
    )]
    Overlap {
        /// The file as it was named by the caller.
        file: String,
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
