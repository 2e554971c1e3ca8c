//! Judges an engine's answer to a case.
use splitsnow::engine::{Engine, EngineError};
use splitsnow::measurement::{Measured, Spectrum};
use splitsnow::transport::Substrate;

use super::cases::{Case, z};

/// Differences of up to this many standard errors are attributed to chance; larger ones
/// occur by chance once in 1.5 million.
pub(crate) const Z: f64 = 5.0;
/// Allowance for rounding in sums of fluxes.
const ROUNDING: f64 = 1e-9;

/// Quality of an engine's answer, best first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Verdict {
    /// Physically possible, and within the stated error of `spectral`.
    Holds,
    /// The engine returned an error.
    Refused,
    /// Physically possible, but outside the stated error.
    Inexact,
    /// Not finite, outside [0, 1], more light than the incident light, or not monotone.
    Impossible,
}

impl Verdict {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Refused => "refused",
            Self::Inexact => "inexact",
            Self::Impossible => "impossible",
        }
    }
}

/// One engine's answer to one case.
pub(crate) struct Answer {
    pub(crate) engine: Engine,
    pub(crate) verdict: Verdict,
    /// Reason for the verdict: the error message or the worst discrepancy; empty if there
    /// is none.
    pub(crate) why: String,
    /// Largest difference from `spectral` in R or T.
    pub(crate) largest: Option<f64>,
    pub(crate) spectra: Vec<Spectrum>,
}

/// Stated systematic error of an engine in R and in T (docs/stability.md).
pub(crate) fn stated(engine: Engine) -> f64 {
    match engine {
        Engine::Reference | Engine::Spectral => 0.0,
        Engine::Tabulated => 0.0025,
        Engine::Hybrid | Engine::Auto => 0.007,
    }
}

/// Judges the `result` of `engine` for `case` by comparison with the spectra of
/// `spectral`.
pub(crate) fn judge(
    case: &Case,
    engine: Engine,
    result: Result<Vec<Spectrum>, EngineError>,
    spectral: &[Spectrum],
) -> Answer {
    let answer = |verdict, why, largest, spectra| Answer {
        engine,
        verdict,
        why,
        largest,
        spectra,
    };
    let spectra = match result {
        Err(error) => return answer(Verdict::Refused, error.to_string(), None, vec![]),
        Ok(spectra) => spectra,
    };
    // R may fall with thickness if snow lies over brighter snow or a brighter substrate. It
    // may also fall if the pores are black: in a slab a few grains thick, rays meet more
    // short grains because long ones do not fit; `spectral` gives R = 0.0694 at 2.4 grains
    // and 0.0660 at 5.
    let black_pores = case
        .snowpack
        .surface
        .carbon()
        .any(|carbon| carbon.sedimentation < 1.0);
    let brightens = case.snowpack.below.is_empty()
        && case.snowpack.substrate == Substrate::Black
        && !black_pores;
    if let Some(why) = impossible(&spectra, brightens) {
        return answer(Verdict::Impossible, why, None, spectra);
    }
    let (mut largest, mut worst, mut why): (f64, f64, _) = (0.0, 0.0, String::new());
    for (h, (a, b)) in spectra.iter().zip(spectral).enumerate() {
        for l in 0..a.reflectance.len() {
            let pairs = [
                ("R", a.reflectance[l], b.reflectance[l]),
                ("T", a.transmittance[l], b.transmittance[l]),
            ];
            for (letter, x, y) in pairs {
                let difference = (x.value - y.value).abs();
                largest = largest.max(difference);
                let excess = excess(engine, x, y);
                if excess > worst {
                    worst = excess;
                    why = format!(
                        "{letter} {:.4} not {:.4} ({:+.1} se) at {} nm, {:.3} mean free distances",
                        x.value,
                        y.value,
                        z(x, y),
                        case.wavelengths_nm[l],
                        case.depth(case.thicknesses_m[h]),
                    );
                }
            }
        }
    }
    let verdict = if worst > 0.0 {
        Verdict::Inexact
    } else {
        Verdict::Holds
    };
    answer(verdict, why, Some(largest), spectra)
}

/// Amount by which the difference of two values exceeds the stated error plus [`Z`]
/// standard errors; negative if it does not.
pub(crate) fn excess(engine: Engine, x: Measured, y: Measured) -> f64 {
    (x.value - y.value).abs() - stated(engine) - Z * x.se.hypot(y.se)
}

/// Describes what is physically impossible in spectra of one snowpack at increasing
/// thickness; `None` if they are possible. `brightens` says that R must not fall with
/// thickness.
pub(crate) fn impossible(spectra: &[Spectrum], brightens: bool) -> Option<String> {
    for spectrum in spectra {
        let pairs = spectrum.reflectance.iter().zip(&spectrum.transmittance);
        for ((r, t), lost) in pairs.zip(&spectrum.lost) {
            if ![r.value, t.value, r.se, t.se].iter().all(|x| x.is_finite()) {
                return Some(format!(
                    "R {} +- {}, T {} +- {}",
                    r.value, r.se, t.value, t.se
                ));
            }
            let possible = -ROUNDING..=1.0 + ROUNDING;
            if ![r.value, t.value, r.value + t.value + lost]
                .iter()
                .all(|x| possible.contains(x))
            {
                return Some(format!(
                    "R {:.3e}, T {:.3e}, sum {}",
                    r.value,
                    t.value,
                    r.value + t.value
                ));
            }
        }
    }
    for pair in spectra.windows(2) {
        for l in 0..pair[0].reflectance.len() {
            let rises = z(pair[1].transmittance[l], pair[0].transmittance[l]);
            let falls = z(pair[0].reflectance[l], pair[1].reflectance[l]);
            if rises > Z || (brightens && falls > Z) {
                let largest = rises.max(falls);
                return Some(format!(
                    "T rises or R falls with thickness, {largest:.1} se"
                ));
            }
        }
    }
    None
}
