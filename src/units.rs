//! Unit conversions. Configs and output speak in um, cm, nm and degrees;
//! everything inside the library is in SI units and radians, except that
//! wavelengths are in nm throughout (names say so: `_nm`).

/// Micrometres to metres.
#[must_use]
pub fn um_to_m(um: f64) -> f64 {
    um * 1e-6
}

/// Centimetres to metres.
#[must_use]
pub fn cm_to_m(cm: f64) -> f64 {
    cm * 1e-2
}

/// Nanometres to metres.
#[must_use]
pub fn nm_to_m(nm: f64) -> f64 {
    nm * 1e-9
}
