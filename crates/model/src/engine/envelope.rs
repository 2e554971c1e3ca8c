//! The ranges in which engines are valid. Engines refuse requests outside them. Every
//! limit is where an engine failed in `examples/stability`; docs/stability.md says how
//! and why, and tests/stability.rs tests both sides of the limits.
use crate::engine::{Engine, EngineError, Request};
pub use crate::transport::FIRST_FLIGHT;
use crate::transport::{Illumination, Snow};

/// Smallest number of entries of a table of grain events. With N entries, the error of
/// R and T is about 0.1 / sqrt(N).
pub const MIN_TABLE_ENTRIES: u32 = 4096;
/// Smallest number of table entries whose grains fit under the surface where grazing
/// light first meets grains. The other entries are never drawn there, and results from
/// fewer entries depend on the particular grains in the table.
pub const MIN_FITTING_ENTRIES: f64 = 200.0;

/// A lower limit of a quantity.
struct Limit {
    /// Name of the quantity, for the message.
    quantity: &'static str,
    /// Value in the request.
    value: f64,
    /// Smallest value that the engine accepts.
    lowest: f64,
    /// Engine to use below the limit.
    instead: Option<Engine>,
    /// Largest incidence angle within the limit, degrees, if the angle is what is limited.
    most_deg: Option<f64>,
}

/// The angle, degrees, rounded down to a hundredth, whose cosine is `lowest` if that of the angle
/// `rad` is `value`.
pub(crate) fn most_deg(rad: f64, value: f64, lowest: f64) -> Option<f64> {
    let cosine = libm::cos(rad) * lowest / value;
    let degrees = (libm::acos(cosine).to_degrees() * 100.0).floor() / 100.0;
    degrees.is_finite().then_some(degrees)
}

/// Smallest diameter of a sphere inscribed in a grain of `snow`, m.
fn slimmest_m(snow: &Snow) -> f64 {
    let grains = snow.grains.iter().map(|component| component.grain);
    let diameters = grains.map(|grain| {
        let proportions = [grain.proportion.min(), grain.proportion.max()];
        let radii = proportions.map(|proportion| grain.shape.inscribed(proportion));
        grain.size.min_m() * radii[0].min(radii[1])
    });
    diameters.fold(f64::INFINITY, f64::min)
}

impl Engine {
    /// Checks that the engine is valid for `request`, within its stated error.
    ///
    /// # Errors
    /// [`EngineError::Outside`] for the first limit that is violated;
    /// [`EngineError::Absorber`] if the absorption of an absorber is not known at a wavelength;
    /// [`EngineError::NoSurface`] if there is no room for the surface layer.
    pub fn check(self, request: &Request) -> Result<(), EngineError> {
        let snowpack = request.snowpack;
        for absorber in snowpack.snows().flat_map(Snow::absorbers) {
            let (min_nm, max_nm) = absorber.range_nm();
            let outside = |nm: &&f64| !(min_nm..=max_nm).contains(*nm);
            if let Some(nm) = request.wavelengths_nm.iter().find(outside) {
                return Err(EngineError::Absorber {
                    name: absorber.name.clone(),
                    wavelength_nm: *nm,
                    min_nm,
                    max_nm,
                });
            }
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
            quantity: "thickness in axes of the slimmest grain",
            value: thinnest_m / slimmest_m,
            lowest: 1.0,
            instead: None,
            most_deg: None,
        }];
        let flight = snowpack.surface.mean_free_distance_m() / snowpack.surface.sizes_m()[1];
        for light in request.illuminations {
            if let Illumination::Collimated { polar_angle_rad } = light {
                let value = libm::cos(*polar_angle_rad) * flight;
                limits.push(Limit {
                    quantity: "cosine of the polar angle times mean free distance over largest grain",
                    value,
                    lowest: FIRST_FLIGHT,
                    instead: None,
                    most_deg: most_deg(*polar_angle_rad, value, FIRST_FLIGHT),
                });
                if matches!(self, Self::Tabulated | Self::Hybrid) {
                    let entries = 2.0 * value * f64::from(request.resolution.table);
                    limits.push(Limit {
                        quantity: "number of table entries whose grains fit under the surface at grazing incidence",
                        value: entries,
                        lowest: MIN_FITTING_ENTRIES,
                        instead: Some(Self::Spectral),
                        most_deg: most_deg(*polar_angle_rad, entries, MIN_FITTING_ENTRIES),
                    });
                }
            }
        }
        if matches!(self, Self::Tabulated | Self::Hybrid) {
            limits.push(Limit {
                quantity: "number of entries per table of grain events",
                value: f64::from(request.resolution.table),
                lowest: f64::from(MIN_TABLE_ENTRIES),
                instead: Some(Self::Spectral),
                most_deg: None,
            });
        }
        let is_violated = |limit: &Limit| limit.value.is_nan() || limit.value < limit.lowest;
        match limits.into_iter().find(is_violated) {
            None => Ok(()),
            Some(limit) => Err(EngineError::Outside {
                engine: self,
                quantity: limit.quantity,
                value: limit.value,
                lowest: limit.lowest,
                instead: limit.instead,
                most_deg: limit.most_deg,
            }),
        }
    }
}
