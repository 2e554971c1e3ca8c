//! Spectra and their colours: tabulated functions of wavelength, measured spectra as
//! instruments and libraries write them, CIELAB. The lowest crate of SPLITSnow.
#[cfg(feature = "colour")]
pub mod colour;
pub mod elementary;
mod quantity;
#[cfg(feature = "colour")]
pub mod spectrum;
pub mod units;

pub use quantity::Quantity;
