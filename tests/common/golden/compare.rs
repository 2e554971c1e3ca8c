//! How far an engine is from the golden data.
use splitsnow::colour::{Colorimeter, delta_e};
use splitsnow::measurement::{Measured, Spectrum};

use super::Case;
use super::plan::BANDS;

/// Largest errors of one case. Each comes with the standard error that the
/// golden data itself has there: an exact engine shows errors of that order,
/// and the largest of many is some times as large.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Errors {
    /// Largest |difference| of reflectance over 400-700 nm.
    pub(crate) visible_r: Measured,
    /// The same of transmittance.
    pub(crate) visible_t: Measured,
    /// Largest |difference| of reflectance over 800-1400 nm.
    pub(crate) infrared_r: Measured,
    /// The same of transmittance.
    pub(crate) infrared_t: Measured,
    /// CIE 1976 Delta-E*ab under D65 of the visible transmittance; its standard
    /// error is an estimate (see [`colour`]).
    pub(crate) delta_e: Measured,
}

/// The errors of `spectrum`, which has the wavelengths of `case`.
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

/// The largest |difference|, with the standard error of `golden` there.
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
/// Errors over wavelengths come from the walks at two index nodes, beyond the
/// two ends of the range: about one independent error for each end, of which
/// each wavelength has a share by its place. The standard error given is the
/// root of the sum of squares of the Delta-E that each of the two makes.
fn colour(golden: &[Measured], other: &[Measured]) -> Measured {
    let colorimeter = Colorimeter::new(BANDS[0]).unwrap().unwrap();
    let values = |spectrum: &[Measured]| spectrum.iter().map(|m| m.value).collect::<Vec<_>>();
    let lab = colorimeter.lab(&values(golden));
    let last = (golden.len() - 1) as f64;
    let moved = |share: fn(f64) -> f64| {
        let each = golden.iter().enumerate().map(|(l, m)| {
            let place = l as f64 / last;
            m.value + m.se * share(place) / place.hypot(1.0 - place)
        });
        delta_e(lab, colorimeter.lab(&each.collect::<Vec<_>>()))
    };
    Measured {
        value: delta_e(lab, colorimeter.lab(&values(other))),
        se: moved(|place| place).hypot(moved(|place| 1.0 - place)),
    }
}
