//! Walks through a slab from one tabulated grain to the next.
//!
//! The same walk as [`crate::transport::Walker`]'s, planes and rejected grains
//! and all, but for where outcomes of grain events come from, and that the
//! azimuth of a ray is not followed. One walk serves several thicknesses in
//! the same way.
use wide::f64x8;

use crate::math::Vec3;
use crate::rng::Stream;
use crate::table::rays::{Rays, Variates};
use crate::table::{TableSnow, lanes};
use crate::transport::{
    Absorption, EVENT_LIMIT, End, Illumination, Path, REJECTION_LIMIT, Sink, Walk, WalkError,
};

/// Steps after which the sink is asked whether to go on.
const STEPS_BETWEEN_CHECKS: u64 = 1024;

/// Walks in snow whose grains are drawn from tables.
#[derive(Debug, Clone, Copy)]
pub struct TableWalker<'a> {
    /// The snow.
    pub snow: TableSnow<'a>,
    /// How walks end by absorption.
    pub absorption: Absorption,
}

/// What one lane holds besides its ray.
#[derive(Debug, Clone, Copy, Default)]
struct Lane {
    /// Position of the slab in the list of thicknesses.
    slab: usize,
    /// Where the ray is to be resumed for the next slab.
    touch: Option<Resume>,
    /// What the next flight must be.
    forced: Option<[f64; 4]>,
}

/// A ray before a flight, and that flight.
#[derive(Debug, Clone, Copy)]
struct Resume {
    z_m: f64,
    mu: f64,
    ice_m: f64,
    water_m: f64,
    variates: [f64; 4],
}

/// Walks under way on eight lanes.
struct Walks<'a, S> {
    walker: &'a TableWalker<'a>,
    thicknesses_m: &'a [f64],
    illumination: Illumination,
    rng: Stream,
    rays: Rays,
    /// Optical depths at which the rays are absorbed.
    budget: f64x8,
    /// Thicknesses of the lanes' slabs, m.
    thickness_m: f64x8,
    events: f64x8,
    rejections: f64x8,
    lanes: [Lane; 8],
    /// Lanes with a flight forced on them.
    forced: u32,
    /// Rays not started yet.
    waiting: u64,
    sink: &'a mut S,
}

impl Walk for TableWalker<'_> {
    fn walk(
        &self,
        thicknesses_m: &[f64],
        illumination: Illumination,
        rays: u64,
        rng: Stream,
        sink: &mut impl Sink,
    ) -> Result<u64, WalkError> {
        Walks {
            walker: self,
            thicknesses_m,
            illumination,
            rng,
            rays: Rays::default(),
            budget: f64x8::ZERO,
            thickness_m: f64x8::ZERO,
            events: f64x8::ZERO,
            rejections: f64x8::ZERO,
            lanes: [Lane::default(); 8],
            forced: 0,
            waiting: rays,
            sink,
        }
        .run()
    }
}

impl<S: Sink> Walks<'_, S> {
    fn run(&mut self) -> Result<u64, WalkError> {
        let TableWalker { snow, absorption } = self.walker;
        let wet = snow.water_saturation > 0.0;
        let coefficients = absorption.coefficients;
        let [ice_per_m, water_per_m] =
            [coefficients.ice_per_m, coefficients.water_per_m].map(f64x8::splat);
        let (one, limit) = (f64x8::ONE, f64x8::splat(f64::from(REJECTION_LIMIT)));
        let mut walking = lanes(0xff).fold(0, |walking, lane| {
            walking | u32::from(self.start(lane)) << lane
        });
        let mut total = 0;
        for steps in 0_u64.. {
            if walking == 0 {
                break;
            }
            if steps % STEPS_BETWEEN_CHECKS == 0 && self.sink.stop() {
                return Err(WalkError::Stopped);
            }
            let mut variates = Variates::draw(wet, &mut self.rng);
            for lane in lanes(self.forced) {
                if let Some(forced) = self.lanes[lane].forced.take() {
                    variates.set(lane, forced);
                }
            }
            self.forced = 0;
            let flight = snow.fly(&self.rays, &variates);

            // planes, and grains that would cross them
            let above = flight.end_m.simd_lt(f64x8::ZERO);
            let below = flight.end_m.simd_gt(self.thickness_m);
            let out = above | below;
            let mut touches = below;
            let mut rejected = f64x8::ZERO;
            let near = !out
                & (flight.end_m.simd_lt(flight.size_m)
                    | flight.end_m.simd_gt(self.thickness_m - flight.size_m));
            if near.to_bitmask() & walking != 0 {
                let [top_m, bottom_m] = snow.extent_m(&self.rays, &flight);
                let under = near & bottom_m.simd_gt(self.thickness_m);
                touches |= under;
                rejected = under | (near & top_m.simd_lt(f64x8::ZERO));
                self.rejections = rejected.select(self.rejections + one, f64x8::ZERO);
                let stuck = self.rejections.simd_ge(limit).to_bitmask() & walking;
                if let Some(lane) = lanes(stuck).next() {
                    let thickness_m = self.thickness_m.as_array()[lane];
                    return Err(WalkError::TooThin { thickness_m });
                }
            } else {
                self.rejections = f64x8::ZERO;
            }
            for lane in lanes(touches.to_bitmask() & walking) {
                self.touch(lane, &variates);
            }

            let met = !(out | rejected);
            snow.scatter(&mut self.rays, &flight, met);
            self.events += one & met;
            total += u64::from((met.to_bitmask() & walking).count_ones());
            if wet {
                let plane_m = below.select(self.thickness_m, f64x8::ZERO);
                let flown_m = (plane_m - self.rays.z_m) / self.rays.mu;
                self.rays.water_m += flown_m & (out & flight.wet);
            }
            let depth = ice_per_m * self.rays.ice_m + water_per_m * self.rays.water_m;
            let lost = self.rays.ice_m.simd_eq(f64x8::splat(f64::INFINITY))
                | self.events.simd_ge(f64x8::splat(EVENT_LIMIT as f64));
            let absorbed = depth.simd_ge(self.budget) & (met | (out & flight.wet));
            let [lost, absorbed, below, out] = [lost, absorbed, below, out].map(f64x8::to_bitmask);
            for lane in lanes((lost | absorbed | out) & walking) {
                let end = match [lost, absorbed, below].map(|mask| mask >> lane & 1 == 1) {
                    [true, ..] => End::Lost,
                    [_, true, _] => End::Absorbed,
                    [.., true] => End::Transmitted,
                    _ => End::Reflected,
                };
                if !(self.end(lane, end) || self.start(lane)) {
                    walking &= !(1 << lane);
                }
            }
        }
        Ok(total)
    }

    /// Starts the next ray on `lane`; false if there is none left.
    fn start(&mut self, lane: usize) -> bool {
        if self.waiting == 0 {
            return false;
        }
        self.waiting -= 1;
        let mu = match self.illumination {
            Illumination::Collimated { polar_angle_rad } => libm::cos(polar_angle_rad),
            Illumination::Diffuse => self
                .walker
                .snow
                .diffuse_cosine(self.rng.uniform().as_array()[0]),
        };
        self.rays.set(lane, [0.0, mu, 0.0, 0.0]);
        let budget = self.walker.absorption.deferred + self.rng.exponential().as_array()[0];
        self.budget.as_mut_array()[lane] = budget;
        self.events.as_mut_array()[lane] = 0.0;
        self.rejections.as_mut_array()[lane] = 0.0;
        self.thickness_m.as_mut_array()[lane] = self.thicknesses_m[0];
        self.lanes[lane] = Lane::default();
        true
    }

    /// The lower plane has a say: notes where to resume for the next slab.
    fn touch(&mut self, lane: usize, variates: &Variates) {
        let Lane { slab, touch, .. } = &mut self.lanes[lane];
        if touch.is_none() && *slab + 1 < self.thicknesses_m.len() {
            let [z_m, mu, ice_m, water_m] = self.rays.get(lane);
            let variates = variates.get(lane);
            *touch = Some(Resume {
                z_m,
                mu,
                ice_m,
                water_m,
                variates,
            });
        }
    }

    /// Reports the end of the walk of `lane` and resumes it in the next slab;
    /// false if it has ended in all.
    fn end(&mut self, lane: usize, end: End) -> bool {
        let [_, mu, ice_m, water_m] = self.rays.get(lane);
        let path = Path {
            ice_m,
            water_m,
            ..Path::default()
        };
        let across = (1.0 - mu * mu).max(0.0).sqrt();
        let direction = Vec3::new(across, 0.0, mu);
        let Lane {
            slab,
            touch,
            forced,
        } = &mut self.lanes[lane];
        let Some(resume) = touch.take() else {
            // the lower plane had no say: the walk is the same in all thicker slabs
            self.sink
                .end(*slab..self.thicknesses_m.len(), end, &path, direction);
            return false;
        };
        self.sink.end(*slab..*slab + 1, end, &path, direction);
        *slab += 1;
        *forced = Some(resume.variates);
        self.forced |= 1 << lane;
        self.thickness_m.as_mut_array()[lane] = self.thicknesses_m[*slab];
        let Resume {
            z_m,
            mu,
            ice_m,
            water_m,
            ..
        } = resume;
        self.rays.set(lane, [z_m, mu, ice_m, water_m]);
        true
    }
}
