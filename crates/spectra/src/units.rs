//! Unit conversions. Configs and output use um, cm, nm and degrees. The library uses SI
//! units and radians internally, except that wavelengths are in nm throughout (names end in
//! `_nm`).

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

/// Thickness that represents a half-space, m: more than 100 times the depth in which light
/// in the clearest snow falls to 1/e, so that no light reaches the bottom.
pub const HALF_SPACE_M: f64 = 1e4;

/// [`HALF_SPACE_M`] in centimetres, the unit of files.
pub const HALF_SPACE_CM: f64 = 1e6;

/// A thickness in cm as text; a half space is `inf`.
#[must_use]
pub fn cm_text(cm: f64) -> String {
    match cm {
        HALF_SPACE_CM.. => "inf".to_owned(),
        cm => cm.to_string(),
    }
}

/// Nanometres to metres.
#[must_use]
pub fn nm_to_m(nm: f64) -> f64 {
    nm * 1e-9
}

/// Metres to centimetres: the round number that [`cm_to_m`] converts to exactly `m`, if
/// there is one.
#[must_use]
pub fn m_to_cm(m: f64) -> f64 {
    round_inverse(m, m * 1e2, cm_to_m)
}

/// Metres to micrometres, as [`m_to_cm`].
#[must_use]
pub fn m_to_um(m: f64) -> f64 {
    round_inverse(m, m * 1e6, um_to_m)
}

fn round_inverse(m: f64, value: f64, to_m: fn(f64) -> f64) -> f64 {
    let round = format!("{value:.12e}").parse().unwrap_or(value);
    if to_m(round) == m { round } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_round_trip() {
        for cm in [0.1, 0.3, 1.1, 7.0, 15.0, 29.3, 80.0] {
            assert_eq!(m_to_cm(cm_to_m(cm)), cm);
        }
        for um in [50.0, 95.5, 299.9, 750.0, 3000.0] {
            assert_eq!(m_to_um(um_to_m(um)), um);
        }
    }
}
