//! Tabulated functions of one variable (strict CSV reading and interpolation), resampling of
//! spectra, measured spectra in foreign formats, and wavelength bands.
mod band;
pub mod measured;
mod resampling;
mod table;

pub use band::Band;
pub use resampling::Resampling;
pub use table::{Table, TableError};
