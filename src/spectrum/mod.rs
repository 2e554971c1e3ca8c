//! Tabulated functions of one variable: strict CSV reading and interpolation;
//! spectra at other wavelengths than their own.
mod resampling;
mod table;

pub use resampling::Resampling;
pub use table::{Table, TableError};
