//! Tabulated functions of one variable: strict CSV reading and interpolation;
//! spectra at other wavelengths than their own; measured spectra as others write them;
//! bands.
mod band;
pub mod measured;
mod resampling;
mod table;

pub use band::Band;
pub use resampling::Resampling;
pub use table::{Table, TableError};
