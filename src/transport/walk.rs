//! Walks from grain to grain through a homogeneous slab (docs/methods.md;
//! Varsa 2025, section 4.1), eight side by side.
//!
//! The slab's planes reflect nothing; a grain that would stick out of the slab
//! is rejected and its flight drawn anew. A ray never meets a grain twice.
//!
//! **Absorption.** A trial with survival exp(-alpha d) on every path (eqs. 4.5
//! and 4.7) ends a walk after an exponentially distributed optical depth, so
//! one variate per ray decides at which depth it is absorbed: the same law.
//! [`Absorption`] may defer this, and [`Absorption::weight`] then makes up for it.
//!
//! **Several thicknesses.** The thickness acts on a walk only through the
//! slab's lower plane: up to the first flight that ends beyond it, or whose
//! grain would stick out of it, the walks in all thicker slabs are the same.
//! From exactly that flight and grain on, the walk is resumed for the next
//! thickness. Each thickness sees walks of the exact law; the errors of
//! different thicknesses are correlated.
use crate::grain::{Events, Surface, half_height};
use crate::math::Vec3;
use crate::optics::Index;
use crate::rng::Stream;
use crate::transport::proposal::{Proposal, Proposals, contact};
use crate::transport::{Absorption, End, Entry, Illumination, Path, Sink, Snow, diffuse_cosine};

/// Grain events after which a ray counts as lost.
pub const EVENT_LIMIT: u64 = 10_000_000;
/// Rejected grains in a row that prove a slab too thin for its grains.
pub const REJECTION_LIMIT: u32 = 10_000;
/// Steps after which the sink is asked whether to go on, well under a millisecond.
const STEPS_BETWEEN_CHECKS: u64 = 1024;
/// Vectors of eight lanes stepped in turn: while one waits for its square
/// roots and divisions the processor works on the other.
const GROUPS: usize = 2;
const LANES: usize = 8 * GROUPS;

/// Why walks were given up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum WalkError {
    /// 10,000 grains in a row did not fit between the planes of a slab.
    TooThin {
        /// Thickness of the slab, m.
        thickness_m: f64,
    },
    /// [`Sink::stop`] asked for it.
    Stopped,
}

/// A way to walk rays through a slab.
pub trait Walk: Sync {
    /// Walks `rays` rays to their ends in slabs of all `thicknesses_m`
    /// (increasing) and gives the number of grain events.
    ///
    /// # Errors
    /// [`WalkError`].
    fn walk(
        &self,
        thicknesses_m: &[f64],
        illumination: Illumination,
        rays: u64,
        rng: Stream,
        sink: &mut impl Sink,
    ) -> Result<u64, WalkError>;
}

/// Snow made ready for walks at one pair of refractive indices.
#[derive(Debug, Clone, Copy)]
pub struct Walker {
    snow: Snow,
    entry: Entry,
    mean_free_distance_m: f64,
    /// Grain surfaces in air and in water.
    surfaces: [Surface; 2],
    absorption: Absorption,
}

/// A ray between two grains.
#[derive(Debug, Clone, Copy)]
struct Ray {
    z_m: f64,
    direction: Vec3,
    path: Path,
    /// Grain events so far.
    events: u64,
}

/// One lane: the ray it walks and the slab it walks it in.
#[derive(Debug, Clone, Copy)]
struct Lane {
    ray: Ray,
    /// Optical depth at which the ray is absorbed.
    budget: f64,
    /// Position of the slab in the list of thicknesses.
    slab: usize,
    /// Where the ray is to be resumed for the next slab.
    touch: Option<(Ray, Proposal)>,
    /// Depth of the centre of the grain the ray is in, m.
    centre_m: f64,
}

/// Walks under way: what the driver and its helpers share.
struct Walks<'a, S> {
    walker: &'a Walker,
    thicknesses_m: &'a [f64],
    illumination: Illumination,
    rng: Stream,
    proposals: Proposals<'a>,
    events: [Events; GROUPS],
    lanes: [Lane; LANES],
    /// Rays not started yet.
    waiting: u64,
    sink: &'a mut S,
}

impl Walker {
    /// `ice` and `water` at the wavelength (or node) walked.
    #[must_use]
    pub fn new(
        snow: &Snow,
        entry: Entry,
        (ice, water): (Index, Index),
        absorption: Absorption,
    ) -> Self {
        Self {
            snow: *snow,
            entry,
            mean_free_distance_m: snow.mean_free_distance_m(),
            surfaces: Surface::in_air_and_water(ice, water, snow.water_saturation > 0.0),
            absorption,
        }
    }
}

impl Walk for Walker {
    fn walk(
        &self,
        thicknesses_m: &[f64],
        illumination: Illumination,
        rays: u64,
        rng: Stream,
        sink: &mut impl Sink,
    ) -> Result<u64, WalkError> {
        let ray = Ray {
            z_m: 0.0,
            direction: Vec3::default(),
            path: Path::default(),
            events: 0,
        };
        let lane = Lane {
            ray,
            budget: 0.0,
            slab: 0,
            touch: None,
            centre_m: 0.0,
        };
        let mut walks = Walks {
            walker: self,
            thicknesses_m,
            illumination,
            rng,
            proposals: Proposals::new(&self.snow, self.entry, self.mean_free_distance_m),
            events: std::array::from_fn(|_| {
                Events::new(&self.surfaces, self.snow.water_saturation > 0.0)
            }),
            lanes: [lane; LANES],
            waiting: rays,
            sink,
        };
        walks.run()
    }
}

/// The positions of the bits set in a mask.
fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = mask.trailing_zeros() as usize;
        mask &= mask.wrapping_sub(1);
        (bit < 8).then_some(bit)
    })
}

impl<S: Sink> Walks<'_, S> {
    fn run(&mut self) -> Result<u64, WalkError> {
        let mut total = 0;
        let mut walking = 0;
        for lane in 0..LANES {
            if self.start(lane)? {
                walking |= 1 << lane;
            }
        }
        for steps in 0u64.. {
            if walking == 0 {
                break;
            }
            if steps % STEPS_BETWEEN_CHECKS == 0 && self.sink.stop() {
                return Err(WalkError::Stopped);
            }
            let rng = &mut self.rng;
            let steps = self.events.each_mut().map(|events| events.step(rng));
            for (group, step) in steps.iter().enumerate() {
                // a lane without a ray idles in its last grain
                let ours = walking >> (8 * group) & 0xff;
                let ended = (step.absorbed | step.lost) & ours;
                for bit in bits((step.left | ended) & ours) {
                    total += 1;
                    let lane = 8 * group + bit;
                    let goes_on = if ended & (1 << bit) == 0 {
                        self.leave_grain(lane)?
                    } else {
                        let lost = step.absorbed & (1 << bit) == 0;
                        self.lanes[lane].ray.path.ice_m = self.ice_m(lane);
                        self.end(lane, if lost { End::Lost } else { End::Absorbed })?
                    };
                    if !goes_on {
                        walking &= !(1u32 << lane);
                    }
                }
            }
        }
        Ok(total)
    }

    /// Starts the next ray on `lane`; false if there is none left.
    fn start(&mut self, lane: usize) -> Result<bool, WalkError> {
        while self.waiting > 0 {
            self.waiting -= 1;
            // cheap next to a walk, so the other seven variates go unused
            let cos = match self.illumination {
                Illumination::Collimated { polar_angle_rad } => libm::cos(polar_angle_rad),
                Illumination::Diffuse => diffuse_cosine(
                    self.rng.uniform().as_array()[0],
                    self.walker.mean_free_distance_m,
                    self.walker.snow.grain.size.max_m(),
                ),
            };
            let direction = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            let ray = Ray {
                z_m: 0.0,
                direction,
                path: Path::default(),
                events: 0,
            };
            let budget = self.walker.absorption.deferred + self.rng.exponential().as_array()[0];
            self.lanes[lane] = Lane {
                ray,
                budget,
                slab: 0,
                touch: None,
                centre_m: 0.0,
            };
            if self.fly(lane, None)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn ice_m(&self, lane: usize) -> f64 {
        self.events[lane / 8].ice_m.as_array()[lane % 8]
    }

    /// Takes the ray of `lane` out of its grain and on to the next.
    fn leave_grain(&mut self, lane: usize) -> Result<bool, WalkError> {
        let (events, bit) = (&self.events[lane / 8], lane % 8);
        let Lane { ray, centre_m, .. } = &mut self.lanes[lane];
        ray.path.ice_m = events.ice_m.as_array()[bit];
        ray.direction = events.direction.get(bit);
        ray.z_m = *centre_m + events.depth_in_grain_m(bit);
        ray.events += 1;
        if ray.events >= EVENT_LIMIT {
            return self.end(lane, End::Lost);
        }
        Ok(self.fly(lane, None)? || self.start(lane)?)
    }

    /// Ends the walk of `lane`, resumes it in the next slab or starts another
    /// ray; false if there is none left.
    fn end(&mut self, lane: usize, end: End) -> Result<bool, WalkError> {
        Ok(self.end_and_resume(lane, end)? || self.start(lane)?)
    }

    /// Reports the end of the walk of `lane` and resumes it in the next slab;
    /// false if it has ended in all.
    fn end_and_resume(&mut self, lane: usize, end: End) -> Result<bool, WalkError> {
        let Lane {
            slab, touch, ray, ..
        } = &mut self.lanes[lane];
        let slabs = self.thicknesses_m.len();
        let Some((before, proposal)) = touch.take() else {
            // the lower plane had no say: the walk is the same in all thicker slabs
            self.sink.end(*slab..slabs, end, &ray.path, ray.direction);
            return Ok(false);
        };
        self.sink
            .end(*slab..*slab + 1, end, &ray.path, ray.direction);
        *slab += 1;
        *ray = before;
        self.fly(lane, Some(proposal))
    }

    /// Flies the ray of `lane` to a grain that fits into the slab; false if
    /// the walk has ended, in this slab and all thicker ones.
    fn fly(&mut self, lane: usize, mut resumed: Option<Proposal>) -> Result<bool, WalkError> {
        let mut rejections = 0;
        loop {
            let proposal = match resumed.take() {
                Some(proposal) => proposal,
                None => self.proposals.next(&mut self.rng),
            };
            let Lane {
                ray,
                slab,
                touch,
                budget,
                ..
            } = &mut self.lanes[lane];
            let thickness_m = self.thicknesses_m[*slab];
            let may_resume = touch.is_none() && *slab + 1 < self.thicknesses_m.len();
            let absorption = &self.walker.absorption;
            let depth = |path: &Path| {
                absorption.ice_per_m * path.ice_m + absorption.water_per_m * path.water_m
            };
            let z_m = ray.z_m + proposal.flight_m * ray.direction.z;
            if !(0.0 <= z_m && z_m <= thickness_m) {
                let down = ray.direction.z > 0.0;
                if down && may_resume {
                    *touch = Some((*ray, proposal));
                }
                if proposal.in_water {
                    let boundary_m = if down { thickness_m } else { 0.0 };
                    ray.path.water_m += (boundary_m - ray.z_m) / ray.direction.z;
                }
                let absorbed = proposal.in_water && depth(&ray.path) >= *budget;
                let end = match (absorbed, down) {
                    (true, _) => End::Absorbed,
                    (false, true) => End::Transmitted,
                    (false, false) => End::Reflected,
                };
                return self.end_and_resume(lane, end);
            }
            let grain = &proposal.grain;
            let (point, normal) = contact(
                &proposal.grain,
                self.walker.entry,
                proposal.projected,
                ray.direction,
            );
            let scale_m = 0.5 * grain.size_m;
            let centre_m = z_m - point.z * scale_m;
            // the contact lies on the grain, so only near a plane can it stick out
            if z_m < grain.size_m || z_m > thickness_m - grain.size_m {
                let half_m = half_height(grain.flattening, grain.axis) * scale_m;
                let sticks_out_below = centre_m + half_m > thickness_m;
                if sticks_out_below && may_resume {
                    *touch = Some((*ray, proposal));
                }
                if sticks_out_below || centre_m - half_m < 0.0 {
                    rejections += 1;
                    if rejections == REJECTION_LIMIT {
                        return Err(WalkError::TooThin { thickness_m });
                    }
                    continue;
                }
            }
            if proposal.in_water {
                ray.path.water_m += proposal.flight_m;
                if depth(&ray.path) >= *budget {
                    return self.end_and_resume(lane, End::Absorbed);
                }
            }
            let left = *budget - absorption.water_per_m * ray.path.water_m;
            let (events, bit) = (&mut self.events[lane / 8], lane % 8);
            events.ice_m.as_mut_array()[bit] = ray.path.ice_m;
            events.ice_limit_m.as_mut_array()[bit] = if absorption.ice_per_m > 0.0 {
                left / absorption.ice_per_m
            } else {
                f64::INFINITY
            };
            events.direction.set(bit, ray.direction);
            events.start(bit, grain, point, normal, proposal.in_water);
            self.lanes[lane].centre_m = centre_m;
            return Ok(true);
        }
    }
}
