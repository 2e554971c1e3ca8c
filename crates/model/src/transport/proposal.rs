//! Candidates for the next flight of a walk and the grain at its end, drawn
//! eight at a time and handed out one by one.
use splitsnow_spectra::simd::{F64x8, Simd, Task};

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
struct Supply<S: Simd> {
    grain: GrainType,
    flights: F64x8<S>,
    media: F64x8<S>,
    grains: Grains<S>,
    projected: [F64x8<S>; 3],
    kept: u32,
}

impl<S: Simd> Supply<S> {
    /// Draws until at least one grain is kept.
    #[inline(always)]
    fn refill(&mut self, entry: Entry, wet: bool, rng: &mut Stream<S>) {
        while self.kept == 0 {
            self.flights = rng.exponential();
            if wet {
                self.media = rng.uniform();
            }
            if entry == Entry::Projected {
                let (sin, cos) = rng.azimuth();
                self.projected = [rng.uniform(), sin, cos];
            }
            (self.grains, self.kept) = Grains::draw(&self.grain, rng);
        }
    }
}

/// The call of [`Supply::refill`].
struct Refill<'a, S: Simd>(&'a mut Supply<S>, Entry, bool, &'a mut Stream<S>);

impl<S: Simd> Task for Refill<'_, S> {
    type Output = ();

    #[inline(always)]
    fn perform(self) {
        self.0.refill(self.1, self.2, self.3);
    }
}

/// Proposals in one layer.
pub(super) struct Proposals<S: Simd> {
    entry: Entry,
    mean_free_distance_m: f64,
    /// Whether the medium of a flight is drawn.
    wet: bool,
    /// Probabilities that a grain met is of one of the types up to each.
    types: Vec<f64>,
    supplies: Vec<Supply<S>>,
    /// Which types come next, as uniform variates.
    choices: F64x8<S>,
    chosen: usize,
}

impl<S: Simd> Proposals<S> {
    /// None drawn yet; `wet` if any layer is.
    pub(super) fn new(snow: &Snow, entry: Entry, wet: bool) -> Self {
        let supply = |component: &Component| Supply {
            grain: component.grain,
            flights: F64x8::ZERO,
            media: F64x8::ONE,
            grains: Grains::default(),
            projected: [F64x8::ZERO; 3],
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
            choices: F64x8::ZERO,
            chosen: 8,
        }
    }

    /// The next one. The nearest of candidates of all types, each at a distance
    /// of its own, is of a type drawn with the meeting shares, at a distance
    /// that does not depend on it.
    // It only copies numbers from lanes, so it needs no instruction set of its own.
    #[inline(never)]
    pub(super) fn next(&mut self, rng: &mut Stream<S>) -> Proposal {
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
        if supply.kept == 0 {
            S::outlined(Refill(&mut *supply, self.entry, self.wet, rng));
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
