//! Errors of the comparison with a measured spectrum.
use thiserror::Error;

use super::measured::MAX_GAP_NM;
use crate::spectrum::measured::SpectrumError;

/// The reason why a measured spectrum cannot be compared, and what to do about it.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MeasuredError {
    /// The file cannot be read.
    #[error(transparent)]
    Spectrum(#[from] SpectrumError),
    /// Fewer than two wavelengths of the simulation have a measured value.
    #[error(
        "{file}: only {common} wavelengths of the sample ({} to {} nm) can be compared with the file ({} to {} nm), at least 2 are needed; excluded: {excluded}\n  help: change [wavelengths] of the sample or --exclude; values are interpolated between rows at most {MAX_GAP_NM} nm apart, and are not extrapolated", .sample_nm.0, .sample_nm.1, .file_nm.0, .file_nm.1
    )]
    Overlap {
        /// The path as the caller gave it.
        file: String,
        /// Number of wavelengths that can be compared.
        common: usize,
        /// First and last wavelength of the simulation, nm.
        sample_nm: (f64, f64),
        /// First and last wavelength of the file, nm.
        file_nm: (f64, f64),
        /// The excluded bands, as text.
        excluded: String,
    },
}
