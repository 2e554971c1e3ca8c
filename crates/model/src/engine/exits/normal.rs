//! Normalises sensors to R and T of `hybrid`, which are more precise than the sums of
//! the sensors.
//!
//! A sensor's value is its share of the total score of all sensors on its side, times
//! R or T of `hybrid`. The errors of the share and of R or T are independent, so their
//! relative errors add in quadrature. For a sensor with score V and a total S, the
//! error of the share follows from the scatter of V - (V / S) S over independent parts
//! with V / S held constant (the ratio estimator, Cochran 1977, chapter 6).
use super::Exits;
use crate::engine::{Control, Engine, EngineError, MaxError, Request, Resolution};
use crate::measurement::{Measured, Spectrum};

/// The request to `hybrid`: `request` with a resolution no finer than its number of
/// walks needs.
pub(super) fn hybrid_request<'a>(request: &Request<'a>) -> Request<'a> {
    let (resolution, enough) = (request.resolution, Resolution::for_rays(request.rays));
    Request {
        resolution: Resolution {
            table: resolution.table.min(enough.table),
            grains: resolution.grains.min(enough.grains),
            ..resolution
        },
        ..request.clone()
    }
}

/// Whether `hybrid` is valid for `request` with the default error allowed, that is,
/// whether `auto` would choose it.
pub(super) fn is_valid(request: &Request) -> bool {
    let default = Request {
        max_error: MaxError::default_for(request.wavelengths_nm),
        ..hybrid_request(request)
    };
    Engine::Auto.resolve(&default) == Engine::Hybrid
}

/// Reflectance and transmittance by `hybrid`; `None` if `hybrid` is not valid.
pub(super) fn spectra(
    request: &Request,
    control: &Control,
) -> Result<Option<Vec<Spectrum>>, EngineError> {
    let run = || Engine::Hybrid.run(&hybrid_request(request), control);
    is_valid(request).then(run).transpose()
}

impl Exits {
    /// Scales the bins, whose errors are those of their shares, so that they add up to
    /// `reflectance` and `transmittance`. A side without scores is not changed.
    pub(super) fn normalise(&mut self, reflectance: Measured, transmittance: Measured) {
        let sides = [
            (&mut self.reflected, &mut self.reflectance, reflectance),
            (
                &mut self.transmitted,
                &mut self.transmittance,
                transmittance,
            ),
        ];
        for (bins, sum, target) in sides {
            if sum.value <= 0.0 {
                continue;
            }
            let scale = target.value / sum.value;
            for bin in bins {
                let share = bin.value / sum.value;
                let (share_se, sum_se) = (scale * bin.se, share * target.se);
                *bin = Measured {
                    value: share * target.value,
                    se: (share_se * share_se + sum_se * sum_se).sqrt(),
                };
            }
            *sum = target;
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
        // nothing scored on the other side
        assert_eq!(exits.transmitted, [measured(0.0, 0.01)]);
    }
}
