//! Candidates for the next flight of a walk and the grain at its end, drawn
//! eight at a time and handed out one by one.
use wide::f64x8;

use crate::grain::{Grain, Grains, projected_point};
use crate::math::Vec3;
use crate::rng::Stream;
use crate::transport::{Entry, Snow};

/// A flight and the grain at its end, not yet accepted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Proposal {
    pub(super) flight_m: f64,
    pub(super) in_water: bool,
    pub(super) grain: Grain,
    /// Uniform variate and azimuth for [`Entry::Projected`].
    pub(super) projected: (f64, (f64, f64)),
}

/// Where a ray of unit `direction` meets `grain`, in units of its major
/// semi-axis from its centre, and the unit outward normal there; `projected`
/// holds the variates of [`Entry::Projected`].
#[inline(always)]
#[must_use]
pub fn contact(
    grain: &Grain,
    entry: Entry,
    projected: (f64, (f64, f64)),
    direction: Vec3,
) -> (Vec3, Vec3) {
    match entry {
        Entry::Uniform => {
            // the antipode of a point on the far side is on the near side
            let far = grain.normal.dot(direction) > 0.0;
            if far {
                (-grain.point, -grain.normal)
            } else {
                (grain.point, grain.normal)
            }
        }
        Entry::Projected => {
            let (u, azimuth) = projected;
            let (k, axis) = (grain.flattening, grain.axis);
            let point = projected_point(k, axis, direction, u, azimuth);
            let normal = point.plus(k * point.dot(axis), axis);
            (point, normal * (1.0 / normal.dot(normal).sqrt()))
        }
    }
}

/// Proposals drawn eight at a time.
pub(super) struct Proposals<'a> {
    snow: &'a Snow,
    entry: Entry,
    mean_free_distance_m: f64,
    flights: f64x8,
    media: f64x8,
    grains: Grains,
    projected: [f64x8; 3],
    kept: u32,
}

impl<'a> Proposals<'a> {
    /// None drawn yet.
    pub(super) fn new(snow: &'a Snow, entry: Entry, mean_free_distance_m: f64) -> Self {
        Self {
            snow,
            entry,
            mean_free_distance_m,
            flights: f64x8::ZERO,
            media: f64x8::ONE,
            grains: Grains::default(),
            projected: [f64x8::ZERO; 3],
            kept: 0,
        }
    }

    /// The next one, drawing eight more when there is none left.
    pub(super) fn next(&mut self, rng: &mut Stream) -> Proposal {
        while self.kept == 0 {
            self.flights = rng.exponential();
            if self.snow.water_saturation > 0.0 {
                self.media = rng.uniform();
            }
            if self.entry == Entry::Projected {
                let (sin, cos) = rng.azimuth();
                self.projected = [rng.uniform(), sin, cos];
            }
            (self.grains, self.kept) = Grains::draw(&self.snow.grain, rng);
        }
        let lane = self.kept.trailing_zeros() as usize;
        self.kept &= self.kept - 1;
        let [u, sin, cos] = self.projected.each_ref().map(|v| v.as_array()[lane]);
        Proposal {
            flight_m: self.mean_free_distance_m * self.flights.as_array()[lane],
            in_water: self.media.as_array()[lane] < self.snow.water_saturation,
            grain: self.grains.get(lane),
            projected: (u, (sin, cos)),
        }
    }
}
