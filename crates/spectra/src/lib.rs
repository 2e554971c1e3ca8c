//! Spectra and their colours: tabulated functions of wavelength, measured spectra in the
//! formats of instruments and spectral libraries, CIELAB. The base crate of SPLITSnow.
#[cfg(feature = "colour")]
pub mod colour;
pub mod elementary;
mod quantity;
pub mod simd;
#[cfg(feature = "colour")]
pub mod spectrum;
pub mod units;

pub use quantity::Quantity;
