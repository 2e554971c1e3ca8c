//! Normalises sensors to R and T of `hybrid`, which are more precise than the sums of
//! the sensors.
//!
//! A sensor's value is its share of the total score of all sensors on its side, times
//! R or T of `hybrid`. The errors of the share and of R or T are independent, so their
//! relative errors add in quadrature. For a sensor with score V and a total S, the
//! error of the share follows from the scatter of V - (V / S) S over independent parts
//! with V / S held constant (the ratio estimator, Cochran 1977, chapter 6).
//!
//! The shares are unknown if the total is the score of a few walks, or far below R or T: most of
//! the light is then that of walks too rare to be in the sample. Such a side counts as Lambertian,
//! with a standard error of its value.
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

/// Largest relative standard error of a total whose shares are known.
const LARGEST_ERROR: f64 = 0.5;
/// Smallest share of R or T that a total reaches whose shares are known.
const SMALLEST_SHARE: f64 = 0.1;

/// Whether the scores with this total tell directions apart.
fn is_known(total: &Measured, target: Measured) -> bool {
    total.se < LARGEST_ERROR * total.value && total.value > SMALLEST_SHARE * target.value
}

impl Exits {
    /// Scales the bins, whose errors are those of their shares, so that they add up to
    /// `reflectance` and `transmittance`. `lambertian` gives each bin for a Lambertian side of
    /// unit power.
    pub(super) fn normalise(
        &mut self,
        reflectance: Measured,
        transmittance: Measured,
        lambertian: impl Fn(usize) -> f64,
    ) {
        let sides = [
            (&mut self.reflected, &mut self.reflectance, reflectance),
            (
                &mut self.transmitted,
                &mut self.transmittance,
                transmittance,
            ),
        ];
        for (bins, sum, target) in sides {
            if !is_known(sum, target) {
                for (number, bin) in bins.iter_mut().enumerate() {
                    let value = lambertian(number) * target.value;
                    *bin = Measured { value, se: value };
                }
                *sum = target;
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
        exits.normalise(measured(0.4, 0.04), measured(1e-9, 0.0), |_| 0.25);
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
        assert_eq!(exits.transmitted, [measured(2.5e-10, 2.5e-10)]);
        // nor do scores far below the target count, whose squares are 0
        for (value, se) in [(1e-160, 0.0), (0.02, 0.001), (0.5, 0.3)] {
            let mut rare = Exits {
                reflected: vec![measured(value, 1.0)],
                reflectance: measured(value, se),
                ..Exits::default()
            };
            rare.normalise(measured(0.4, 0.04), measured(0.0, 0.0), |_| 1.0);
            assert_eq!(rare.reflected, [measured(0.4, 0.4)]);
        }
    }
}
