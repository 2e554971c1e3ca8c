//! Candidates for the next flight of a walk and the grain at its end, drawn
//! eight at a time and handed out one by one.
use wide::f64x8;

use crate::grain::{Grain, GrainType, Grains};
use crate::math::Vec3;
use crate::rng::Stream;
use crate::transport::{Component, Entry, Snow};

/// A flight and the grain at its end, not yet accepted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Proposal {
    pub(super) flight_m: f64,
    /// Uniform variate: in water if it is below the saturation.
    pub(super) medium: f64,
    pub(super) grain: Grain,
    /// Uniform variate and azimuth for [`Entry::Projected`].
    pub(super) projected: (f64, (f64, f64)),
}

/// Where a ray of unit `direction` meets `grain`, in units of half
/// its size from its centre, and the unit outward normal there; `projected`
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
            let (point, normal) = grain.body.projected_point(direction, u, azimuth);
            (point, normal * (1.0 / normal.dot(normal).sqrt()))
        }
    }
}

/// Proposals of one type of grain, drawn eight at a time.
struct Supply {
    grain: GrainType,
    flights: f64x8,
    media: f64x8,
    grains: Grains,
    projected: [f64x8; 3],
    kept: u32,
}

/// Proposals in one layer.
pub(super) struct Proposals {
    entry: Entry,
    mean_free_distance_m: f64,
    /// Whether the medium of a flight is drawn.
    wet: bool,
    /// Probabilities that a grain met is of one of the types up to each.
    types: Vec<f64>,
    supplies: Vec<Supply>,
    /// Which types come next, as uniform variates.
    choices: f64x8,
    chosen: usize,
}

impl Proposals {
    /// None drawn yet; `wet` if any layer is.
    pub(super) fn new(snow: &Snow, entry: Entry, wet: bool) -> Self {
        let supply = |component: &Component| Supply {
            grain: component.grain,
            flights: f64x8::ZERO,
            media: f64x8::ONE,
            grains: Grains::default(),
            projected: [f64x8::ZERO; 3],
            kept: 0,
        };
        let mut sum = 0.0;
        let shares = snow.meeting_shares().into_iter();
        let types = shares.map(|share| {
            sum += share;
            sum
        });
        Self {
            entry,
            mean_free_distance_m: snow.mean_free_distance_m(),
            wet,
            types: types.collect(),
            supplies: snow.grains.iter().map(supply).collect(),
            choices: f64x8::ZERO,
            chosen: 8,
        }
    }

    /// The next one. The nearest of candidates of all types, each at a distance
    /// of its own, is of a type drawn with the meeting shares, at a distance
    /// that does not depend on it.
    pub(super) fn next(&mut self, rng: &mut Stream) -> Proposal {
        let last = self.types.len() - 1;
        let kind = if last == 0 {
            0
        } else {
            if self.chosen == 8 {
                (self.choices, self.chosen) = (rng.uniform(), 0);
            }
            let u = self.choices.as_array()[self.chosen];
            self.chosen += 1;
            self.types[..last].partition_point(|up_to| *up_to <= u)
        };
        let supply = &mut self.supplies[kind];
        while supply.kept == 0 {
            supply.flights = rng.exponential();
            if self.wet {
                supply.media = rng.uniform();
            }
            if self.entry == Entry::Projected {
                let (sin, cos) = rng.azimuth();
                supply.projected = [rng.uniform(), sin, cos];
            }
            (supply.grains, supply.kept) = Grains::draw(&supply.grain, rng);
        }
        let lane = supply.kept.trailing_zeros() as usize;
        supply.kept &= supply.kept - 1;
        let [u, sin, cos] = supply.projected.each_ref().map(|v| v.as_array()[lane]);
        Proposal {
            flight_m: self.mean_free_distance_m * supply.flights.as_array()[lane],
            medium: supply.media.as_array()[lane],
            grain: supply.grains.get(lane),
            projected: (u, (sin, cos)),
        }
    }
}
