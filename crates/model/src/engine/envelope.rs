//! Where engines hold, and their refusal elsewhere. Every limit is where
//! `examples/stability` saw an engine fail; docs/stability.md says how and why,
//! tests/stability.rs tries both sides.
use crate::engine::{Engine, EngineError, Request};
pub use crate::transport::FIRST_FLIGHT;
use crate::transport::{EXPONENTS, Illumination, Snow};

/// Fewest entries of a table of grain events: with N of them R and T are off
/// by some 0.1 / sqrt(N).
pub const TABLE: u32 = 4096;
/// Fewest entries of a table whose grains fit where grazing light first meets
/// them: the others are never drawn there, and what so few have in common is
/// taken for a law of nature.
pub const FITTING: f64 = 200.0;

/// A range an engine takes.
struct Limit {
    what: &'static str,
    value: f64,
    lowest: f64,
    instead: Option<Engine>,
}

/// Shortest axis of any grain, m.
fn slimmest_m(snow: &Snow) -> f64 {
    let grains = snow.grains.iter().map(|component| component.grain);
    let axes = grains.map(|grain| grain.size.min_m() * grain.sphericity.min().powi(2));
    axes.fold(f64::INFINITY, f64::min)
}

impl Engine {
    /// Whether the engine holds, within its stated error, for `request`.
    ///
    /// # Errors
    /// [`EngineError::Outside`] for the first limit that is broken.
    pub fn check(self, request: &Request) -> Result<(), EngineError> {
        let snowpack = request.snowpack;
        let found = snowpack.exponents().len();
        if found > EXPONENTS {
            return Err(EngineError::Exponents { found });
        }
        let thinnest_m = request.thicknesses_m.iter().copied();
        let thinnest_m = thinnest_m.fold(f64::INFINITY, f64::min);
        if thinnest_m <= snowpack.below_m() && !snowpack.below.is_empty() {
            return Err(EngineError::NoSurface {
                thickness_m: thinnest_m,
                below_m: snowpack.below_m(),
            });
        }
        let slimmest_m = snowpack.snows().map(slimmest_m).fold(0.0, f64::max);
        let mut limits = vec![Limit {
            what: "thickness in axes of the slimmest grain",
            value: thinnest_m / slimmest_m,
            lowest: 1.0,
            instead: None,
        }];
        let flight = snowpack.surface.mean_free_distance_m() / snowpack.surface.sizes_m()[1];
        for light in request.illuminations {
            if let Illumination::Collimated { polar_angle_rad } = light {
                limits.push(Limit {
                    what: "cosine of the polar angle times mean free distance over largest grain",
                    value: libm::cos(*polar_angle_rad) * flight,
                    lowest: FIRST_FLIGHT,
                    instead: None,
                });
                if matches!(self, Self::Tabulated | Self::Hybrid) {
                    let table = f64::from(request.resolution.table);
                    limits.push(Limit {
                        what: "number of grain events per table that fit where grazing light first meets grains",
                        value: 2.0 * libm::cos(*polar_angle_rad) * flight * table,
                        lowest: FITTING,
                        instead: Some(Self::Spectral),
                    });
                }
            }
        }
        if matches!(self, Self::Tabulated | Self::Hybrid) {
            limits.push(Limit {
                what: "number of grain events per table",
                value: f64::from(request.resolution.table),
                lowest: f64::from(TABLE),
                instead: Some(Self::Spectral),
            });
        }
        let broken = |limit: &Limit| limit.value.is_nan() || limit.value < limit.lowest;
        match limits.into_iter().find(broken) {
            None => Ok(()),
            Some(limit) => Err(EngineError::Outside {
                engine: self,
                what: limit.what,
                value: limit.value,
                lowest: limit.lowest,
                instead: limit.instead,
            }),
        }
    }
}
