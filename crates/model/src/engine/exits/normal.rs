//! Sums of sensors that are known better than by the sensors.
//!
//! A sensor's value is its share of what all sensors of its side scored, times R
//! or T of `hybrid`. Shares and R have independent errors: relative ones add in
//! quadrature. The share of S that scored V has the error of V - (V / S) S over
//! independent parts, V / S held (the ratio estimator, Cochran 1977, chapter 6).
use super::Exits;
use crate::engine::{Control, Engine, EngineError, MaxError, Request, Resolution};
use crate::measurement::{Measured, Spectrum};

/// What `hybrid` is asked: no finer tables than so many walks can tell.
pub(super) fn request<'a>(request: &Request<'a>) -> Request<'a> {
    let (own, enough) = (request.resolution, Resolution::of_rays(request.rays));
    Request {
        resolution: Resolution {
            table: own.table.min(enough.table),
            grains: own.grains.min(enough.grains),
            ..own
        },
        ..request.clone()
    }
}

/// Whether `hybrid` holds for it, by itself within what is allowed where nothing
/// is said: what `auto` would take.
pub(super) fn holds(of: &Request) -> bool {
    let usual = Request {
        max_error: MaxError::usual(of.wavelengths_nm),
        ..request(of)
    };
    Engine::Auto.resolve(&usual) == Engine::Hybrid
}

/// Reflectance and transmittance by `hybrid`, where it holds.
pub(super) fn spectra(
    of: &Request,
    control: &Control,
) -> Result<Option<Vec<Spectrum>>, EngineError> {
    let run = || Engine::Hybrid.run(&request(of), control);
    holds(of).then(run).transpose()
}

impl Exits {
    /// Scales bins, whose errors are those of their shares, to these sums. A side
    /// that nothing met stays as it is.
    pub(super) fn normalise(&mut self, reflectance: Measured, transmittance: Measured) {
        let sides = [
            (&mut self.reflected, &mut self.reflectance, reflectance),
            (
                &mut self.transmitted,
                &mut self.transmittance,
                transmittance,
            ),
        ];
        for (bins, sum, known) in sides {
            if sum.value <= 0.0 {
                continue;
            }
            let scale = known.value / sum.value;
            for bin in bins {
                let share = bin.value / sum.value;
                let (own, shared) = (scale * bin.se, share * known.se);
                *bin = Measured {
                    value: share * known.value,
                    se: (own * own + shared * shared).sqrt(),
                };
            }
            *sum = known;
        }
        self.normalised = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_and_sums_by_hand() {
        let measured = |value, se| Measured { value, se };
        let mut exits = Exits {
            reflected: vec![measured(0.6, 0.03), measured(0.2, 0.03)],
            reflectance: measured(0.8, 0.1),
            transmitted: vec![measured(0.0, 0.01)],
            ..Exits::default()
        };
        exits.normalise(measured(0.4, 0.04), measured(1e-9, 0.0));
        let expected = [
            measured(0.3, 0.015_f64.hypot(0.03)),
            measured(0.1, 0.015_f64.hypot(0.01)),
        ];
        for (ours, by_hand) in exits.reflected.iter().zip(expected) {
            assert!((ours.value - by_hand.value).abs() < 1e-15, "{ours:?}");
            assert!((ours.se - by_hand.se).abs() < 1e-15, "{ours:?}");
        }
        assert_eq!(exits.reflectance, measured(0.4, 0.04));
        // nothing met the other side
        assert_eq!(exits.transmitted, [measured(0.0, 0.01)]);
    }
}
