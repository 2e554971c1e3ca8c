//! Spectra and their colours: tabulated functions of wavelength, measured spectra in the
//! formats of instruments and spectral libraries, bands of sensors, CIELAB. The base crate of SPLITSnow.
#[cfg(feature = "colour")]
pub mod colour;
pub mod elementary;
mod quantity;
#[cfg(feature = "colour")]
pub mod sensor;
pub mod simd;
#[cfg(feature = "colour")]
pub mod spectrum;
pub mod units;

pub use quantity::Quantity;
