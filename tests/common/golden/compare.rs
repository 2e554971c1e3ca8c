//! Errors of an engine relative to the golden data.
use splitsnow::colour::{Colorimeter, delta_e};
use splitsnow::measurement::{Measured, Spectrum};

use super::Case;
use super::plan::BANDS;

/// Largest errors of one case. Each has the standard error of the golden data
/// at the same wavelength. An exact engine shows errors of that order. The
/// largest of many errors is a few times larger.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Errors {
    /// Largest absolute difference of reflectance over 400-700 nm.
    pub(crate) visible_r: Measured,
    /// Largest absolute difference of transmittance over 400-700 nm.
    pub(crate) visible_t: Measured,
    /// Largest absolute difference of reflectance over 800-1400 nm.
    pub(crate) infrared_r: Measured,
    /// Largest absolute difference of transmittance over 800-1400 nm.
    pub(crate) infrared_t: Measured,
    /// CIE 1976 Delta-E*ab under D65 of the visible transmittance; its standard
    /// error is an estimate (see [`colour`]).
    pub(crate) delta_e: Measured,
}

/// The errors of `spectrum`. Its wavelengths must be those of `case`.
pub(crate) fn compare(case: &Case, spectrum: &Spectrum) -> Errors {
    let (r, t) = (&spectrum.reflectance, &spectrum.transmittance);
    let (golden_r, golden_t) = (&case.reflectance, &case.transmittance);
    assert_eq!((r.len(), t.len()), (golden_r.len(), golden_t.len()));
    let visible = BANDS[0].len();
    Errors {
        visible_r: largest(&golden_r[..visible], &r[..visible]),
        visible_t: largest(&golden_t[..visible], &t[..visible]),
        infrared_r: largest(&golden_r[visible..], &r[visible..]),
        infrared_t: largest(&golden_t[visible..], &t[visible..]),
        delta_e: colour(&golden_t[..visible], &t[..visible]),
    }
}

/// The largest absolute difference, with the standard error of `golden` at that wavelength.
fn largest(golden: &[Measured], other: &[Measured]) -> Measured {
    let pairs = golden.iter().zip(other);
    let differences = pairs.map(|(a, b)| Measured {
        value: (a.value - b.value).abs(),
        se: a.se,
    });
    differences
        .max_by(|a, b| a.value.total_cmp(&b.value))
        .unwrap()
}

/// Delta-E*ab of two spectra in [`BANDS`]`[0]`.
///
/// The golden data in this range come from the walks at two index nodes, one
/// beyond each end of the range. The errors at all wavelengths are therefore
/// mixtures of about two independent errors, weighted by the position of the
/// wavelength between the two ends. Each of the two causes some Delta-E. The
/// standard error is the root of the sum of their squares.
fn colour(golden: &[Measured], other: &[Measured]) -> Measured {
    let colorimeter = Colorimeter::new(BANDS[0]).unwrap().unwrap();
    let values = |spectrum: &[Measured]| spectrum.iter().map(|m| m.value).collect::<Vec<_>>();
    let lab = colorimeter.lab(&values(golden));
    let last = (golden.len() - 1) as f64;
    let delta_e_of_error = |weight: fn(f64) -> f64| {
        let shifted = golden.iter().enumerate().map(|(l, m)| {
            let position = l as f64 / last;
            m.value + m.se * weight(position) / position.hypot(1.0 - position)
        });
        delta_e(lab, colorimeter.lab(&shifted.collect::<Vec<_>>()))
    };
    Measured {
        value: delta_e(lab, colorimeter.lab(&values(other))),
        se: delta_e_of_error(|position| position)
            .hypot(delta_e_of_error(|position| 1.0 - position)),
    }
}
