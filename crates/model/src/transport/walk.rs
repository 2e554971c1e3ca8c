//! Walks from grain to grain through a snowpack of layers, sixteen side by side
//! (docs/methods.md; Varsa 2025, section 4.1).
//!
//! The outer planes of the snowpack reflect nothing. A grain that would protrude from
//! the snowpack is rejected and its flight is drawn again. A ray never meets a grain
//! twice.
//!
//! **Layers.** A flight that reaches the plane between two layers is cut there, and its
//! remainder is drawn from the distribution of the next layer. Its medium follows from
//! the same uniform variate. A grain belongs to the layer in which it is met and may
//! extend into the next layer, so cutting a layer in two changes nothing.
//!
//! **Particles** in the pores that scatter are points: they turn a ray and need no room.
//!
//! **Absorption.** A trial with survival exp(-alpha d) on every path (eqs. 4.5 and 4.7)
//! ends a walk after an exponentially distributed optical depth. One variate per ray
//! gives the depth at which it is absorbed, which is the same distribution.
//! [`Absorption`] may defer absorption; [`Absorption::weight`] compensates for that.
//!
//! **Several thicknesses.** The thicknesses are those of the surface layer. They affect
//! a walk only through its lower plane. The walks in all thicker snowpacks are the same
//! up to the first flight that ends beyond this plane or whose grain would protrude from
//! the snowpack, and up to the first grain that carries the ray across the plane. From
//! this branch point the walk is resumed for the next thickness. Each thickness sees
//! walks of the exact distribution; the errors of different thicknesses are correlated.
use splitsnow_spectra::simd::{Simd, SimdKernel, Task, dispatch};

use crate::grain::{Events, Facets, Stepped, Surface, Upright};
use crate::math::Vec3;
use crate::optics::Index;
use crate::rng::Stream;
use crate::transport::proposal::{Met, Proposal, Proposals, contact};
use crate::transport::{
    Absorption, End, Entry, Illumination, Leg, Model, Path, Sink, Snow, Snowpack, TRACERS, Tracers,
    diffuse_cosine,
};

/// Grain events after which a ray counts as lost.
pub const EVENT_LIMIT: u64 = 10_000_000;
/// Consecutive rejected grains after which a slab counts as too thin for its grains.
pub const REJECTION_LIMIT: u32 = 10_000;
/// Steps between calls of [`Sink::stop`], well under a millisecond.
const STEPS_BETWEEN_CHECKS: u64 = 1024;
/// Vectors of eight lanes, stepped in turn: while one waits for its square roots and
/// divisions, the processor works on the other.
const GROUPS: usize = 2;
const LANES: usize = 8 * GROUPS;

/// Why the walks stopped early.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum WalkError {
    /// 10,000 consecutive grains did not fit between the planes of a slab.
    TooThin {
        /// Thickness of the slab, m.
        thickness_m: f64,
    },
    /// [`Sink::stop`] returned true.
    Stopped,
}

/// A method of walking rays through a snowpack.
pub trait Walk: Sync {
    /// Walks `rays` rays to their ends in snowpacks of all `thicknesses_m` (increasing)
    /// and returns the number of grain events.
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

/// Probabilities for a ray that reaches the substrate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounce {
    /// It is reflected, into a direction weighted by its cosine.
    pub reflected: f64,
    /// It counts as transmitted. Otherwise the substrate absorbs it.
    pub transmitted: f64,
}

impl Bounce {
    /// Everything is transmitted.
    pub const NONE: Self = Self {
        reflected: 0.0,
        transmitted: 1.0,
    };
}

/// A snowpack prepared for walks at one pair of refractive indices.
#[derive(Debug, Clone)]
pub struct Walker {
    entry: Entry,
    facets: Facets,
    /// From the surface down, at least one.
    layers: Vec<WalkerLayer>,
    wet: bool,
    /// Grain surfaces in air and in water.
    surfaces: [Surface; 2],
    absorption: Absorption,
    bounce: Bounce,
}

/// A layer prepared for walks.
#[derive(Debug, Clone)]
struct WalkerLayer {
    snow: Snow,
    mean_free_distance_m: f64,
    longest_grain_m: f64,
    /// Height of its lower plane above the base of the snowpack, m.
    base_m: f64,
    /// What a metre in it adds to the sums over impurities.
    in_ice: [f64; TRACERS],
    in_pores: [f64; TRACERS],
    has_sooty_pores: bool,
}

/// A ray between two grains.
#[derive(Debug, Clone, Copy)]
struct Ray {
    z_m: f64,
    direction: Vec3,
    path: Path,
    /// Its layer, counted from the surface.
    layer: usize,
    /// Number of grain events so far.
    events: u64,
}

/// One lane: a ray and the slab in which it walks.
#[derive(Debug, Clone, Copy)]
struct Lane {
    ray: Ray,
    /// Optical depth at which the ray is absorbed.
    budget: f64,
    /// Index of the slab in the list of thicknesses.
    slab: usize,
    /// The ray as it must be resumed for the next slab, and its flight if one is already
    /// drawn.
    branch_point: Option<(Ray, Option<Proposal>)>,
    /// Centre of the grain that the ray is in, m: depth, and offsets as in
    /// [`Path::offset_m`].
    centre_m: Vec3,
}

/// Walks in progress: the state that the main loop and its helpers share.
struct Walks<'a, S: Simd> {
    walker: &'a Walker,
    thicknesses_m: &'a [f64],
    illumination: Illumination,
    rng: Stream<S>,
    /// One per layer.
    proposals: Vec<Proposals<S>>,
    events: [Events<S>; GROUPS],
    lanes: [Lane; LANES],
    /// Number of rays not started yet.
    waiting: u64,
    /// Whether the sink receives the legs of the rays.
    follows: bool,
    /// The ray whose leg through a grain is to be reported, where it entered.
    entered: Ray,
    /// Depths and paths of a flight at its start, at the planes between layers and at its end.
    flight: Vec<(f64, Path)>,
    sink: &'a mut dyn Sink,
}

impl WalkerLayer {
    fn new(snow: &Snow, base_m: f64, tracers: &Tracers, model: &Model) -> Self {
        let [in_ice, in_pores] = tracers.per_m(snow, model);
        Self {
            snow: snow.clone(),
            mean_free_distance_m: snow.mean_free_distance_m(),
            longest_grain_m: snow.sizes_m()[1],
            base_m,
            in_ice,
            in_pores,
            has_sooty_pores: in_pores != [0.0; TRACERS],
        }
    }
}

impl Path {
    /// Adds a path of `length_m` through a medium with these `impurities`.
    #[inline(always)]
    fn collect(&mut self, impurities: &[f64; TRACERS], length_m: f64) {
        let depths = self.impurities.iter_mut().zip(impurities);
        depths.for_each(|(depth, per_m)| *depth += per_m * length_m);
    }
}

impl Walker {
    /// Uses the indices of `ice` and `water` at the wavelength (or node) walked. The
    /// substrate is black. The sums over impurities are those for any list of wavelengths.
    #[must_use]
    pub fn new(
        snowpack: &Snowpack,
        model: &Model,
        indices: (Index, Index),
        absorption: Absorption,
    ) -> Self {
        let tracers = Tracers::of(snowpack, model, &[]);
        Self::with_tracers((snowpack, model), &tracers, indices, absorption)
    }

    /// As [`Walker::new`], with these sums over impurities.
    pub(crate) fn with_tracers(
        (snowpack, model): (&Snowpack, &Model),
        tracers: &Tracers,
        (ice, water): (Index, Index),
        absorption: Absorption,
    ) -> Self {
        let mut base_m = snowpack.below_m();
        let mut layers = vec![WalkerLayer::new(&snowpack.surface, base_m, tracers, model)];
        for layer in &snowpack.below {
            base_m -= layer.thickness_m;
            layers.push(WalkerLayer::new(&layer.snow, base_m, tracers, model));
        }
        if let Some(last) = layers.last_mut() {
            last.base_m = 0.0;
        }
        let wet = snowpack.is_wet();
        Self {
            entry: model.entry,
            facets: model.facets,
            layers,
            wet,
            surfaces: Surface::in_air_and_water(ice, water, wet),
            absorption,
            bounce: Bounce::NONE,
        }
    }

    /// The same snowpack over another substrate.
    #[must_use]
    pub fn over(self, bounce: Bounce) -> Self {
        Self { bounce, ..self }
    }
}

impl<W: Walk> Walk for &W {
    fn walk(
        &self,
        thicknesses_m: &[f64],
        illumination: Illumination,
        rays: u64,
        rng: Stream,
        sink: &mut impl Sink,
    ) -> Result<u64, WalkError> {
        (*self).walk(thicknesses_m, illumination, rays, rng, sink)
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
        dispatch(Walking {
            walker: self,
            thicknesses_m,
            illumination,
            rays,
            rng,
            sink,
        })
    }
}

/// A call of [`Walker::walk`] as a SIMD kernel. The sink is called once a ray, so a pointer to it
/// costs nothing, and one kernel serves all sinks.
struct Walking<'a> {
    walker: &'a Walker,
    thicknesses_m: &'a [f64],
    illumination: Illumination,
    rays: u64,
    rng: Stream,
    sink: &'a mut dyn Sink,
}

impl SimdKernel for Walking<'_> {
    type Output = Result<u64, WalkError>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let walker = self.walker;
        let ray = Ray {
            z_m: 0.0,
            direction: Vec3::default(),
            path: Path::default(),
            layer: 0,
            events: 0,
        };
        let lane = Lane {
            ray,
            budget: 0.0,
            slab: 0,
            branch_point: None,
            centre_m: Vec3::default(),
        };
        let proposals = walker.layers.iter();
        let proposals =
            proposals.map(|layer| Proposals::new(&layer.snow, walker.entry, walker.wet));
        let mut walks = Walks::<S> {
            walker,
            thicknesses_m: self.thicknesses_m,
            illumination: self.illumination,
            rng: self.rng.on(),
            proposals: proposals.collect(),
            events: std::array::from_fn(|_| {
                Events::new(&walker.surfaces, walker.wet, walker.facets)
            }),
            lanes: [lane; LANES],
            waiting: self.rays,
            follows: self.sink.follows(),
            entered: lane.ray,
            flight: Vec::new(),
            sink: self.sink,
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

/// [`Walks::start`] as a SIMD task.
struct StartTask<'w, 'a, S: Simd>(&'w mut Walks<'a, S>, usize);

impl<S: Simd> Task for StartTask<'_, '_, S> {
    type Output = Result<bool, WalkError>;

    #[inline(always)]
    fn perform(self) -> Result<bool, WalkError> {
        self.0.start_inlined(self.1)
    }
}

/// [`Walks::fly`] as a SIMD task.
struct FlyTask<'w, 'a, S: Simd>(&'w mut Walks<'a, S>, usize, Option<Proposal>);

impl<S: Simd> Task for FlyTask<'_, '_, S> {
    type Output = Result<bool, WalkError>;

    #[inline(always)]
    fn perform(self) -> Result<bool, WalkError> {
        self.0.fly_inlined(self.1, self.2)
    }
}

/// [`Walks::bounce`] as a SIMD task.
struct BounceTask<'w, 'a, S: Simd>(&'w mut Walks<'a, S>, usize, f64);

impl<S: Simd> Task for BounceTask<'_, '_, S> {
    type Output = bool;

    #[inline(always)]
    fn perform(self) -> bool {
        self.0.bounce_by_chance(self.1, self.2)
    }
}

impl<S: Simd> Walks<'_, S> {
    #[inline(always)]
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
            let mut steps = [Stepped::default(); GROUPS];
            for (step, events) in steps.iter_mut().zip(&mut self.events) {
                *step = events.step(&mut self.rng);
            }
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
                        self.collect_ice(lane);
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

    /// Starts the next ray on `lane`; false if none is left.
    #[inline(always)]
    fn start(&mut self, lane: usize) -> Result<bool, WalkError> {
        S::outlined(StartTask(self, lane))
    }

    #[inline(always)]
    fn start_inlined(&mut self, lane: usize) -> Result<bool, WalkError> {
        while self.waiting > 0 {
            self.waiting -= 1;
            // cheap compared with a walk, so the other seven variates go unused
            let cos = match self.illumination {
                Illumination::Collimated { polar_angle_rad } => libm::cos(polar_angle_rad),
                Illumination::Diffuse => self.diffuse_cosine(0),
            };
            let direction = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            let ray = Ray {
                z_m: 0.0,
                direction,
                path: Path::default(),
                layer: 0,
                events: 0,
            };
            let budget = self.walker.absorption.deferred + self.rng.exponential().as_array()[0];
            self.lanes[lane] = Lane {
                ray,
                budget,
                slab: 0,
                branch_point: None,
                centre_m: Vec3::default(),
            };
            if self.fly(lane, None)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Cosine of diffuse light incident on a layer.
    #[inline(always)]
    fn diffuse_cosine(&mut self, layer: usize) -> f64 {
        let WalkerLayer {
            mean_free_distance_m,
            longest_grain_m,
            ..
        } = self.walker.layers[layer];
        let u = self.rng.uniform().as_array()[0];
        let entry = self.walker.entry;
        diffuse_cosine(u, entry, mean_free_distance_m, longest_grain_m)
    }

    /// Adds the path of the ray of `lane` in its grain.
    fn collect_ice(&mut self, lane: usize) {
        let ice_m = self.events[lane / 8].ice_m.as_array()[lane % 8];
        let ray = &mut self.lanes[lane].ray;
        let length_m = ice_m - ray.path.ice_m;
        ray.path.ice_m = ice_m;
        ray.path
            .collect(&self.walker.layers[ray.layer].in_ice, length_m);
    }

    /// Takes the ray of `lane` out of its grain and flies it to the next.
    #[inline(always)]
    fn leave_grain(&mut self, lane: usize) -> Result<bool, WalkError> {
        if self.follows {
            self.enter_grain(lane);
        }
        self.collect_ice(lane);
        let (events, bit) = (&self.events[lane / 8], lane % 8);
        let Lane { ray, centre_m, .. } = &mut self.lanes[lane];
        ray.direction = events.direction.get(bit);
        let place = *centre_m + events.place_in_grain_m(bit);
        ray.z_m = place.z;
        ray.path.offset_m = [place.x, place.y];
        ray.events += 1;
        let is_lost = ray.events >= EVENT_LIMIT;
        if self.follows && self.cross_grain(lane) {
            return self.end(lane, End::Absorbed);
        }
        if is_lost {
            return self.end(lane, End::Lost);
        }
        self.find_layer(lane);
        Ok(self.fly(lane, None)? || self.start(lane)?)
    }

    /// Notes where the ray of `lane` enters its grain.
    #[cold]
    fn enter_grain(&mut self, lane: usize) {
        self.entered = self.lanes[lane].ray;
    }

    /// Reports the leg of the ray of `lane` through its grain; true if the ray is absorbed.
    #[cold]
    fn cross_grain(&mut self, lane: usize) -> bool {
        let (entered, Lane { ray, budget, .. }) = (&self.entered, &self.lanes[lane]);
        let place = |ray: &Ray| Vec3::new(ray.path.offset_m[0], ray.path.offset_m[1], ray.z_m);
        let moved = place(ray) - place(entered);
        if moved.z != 0.0 {
            let leg = Leg {
                z_m: [entered.z_m, ray.z_m],
                cosine: moved.z.abs() / moved.dot(moved).sqrt(),
                paths: [entered.path, ray.path],
                is_beam: false,
            };
            self.sink.leg(&leg, *budget);
        }
        self.walker.absorption.coefficients.depth(&ray.path) >= *budget
    }

    /// Notes a place on a flight.
    #[cold]
    fn pass(&mut self, z_m: f64, path: Path) {
        self.flight.push((z_m, path));
    }

    /// Reports the legs of the flight of `lane`, whose ray is still that of the start.
    #[cold]
    fn cross_pores(&mut self, lane: usize) {
        let Lane {
            ray: start, budget, ..
        } = &self.lanes[lane];
        let collimated = matches!(self.illumination, Illumination::Collimated { .. });
        for ends in self.flight.windows(2) {
            let leg = Leg {
                z_m: [ends[0].0, ends[1].0],
                cosine: start.direction.z.abs(),
                paths: [ends[0].1, ends[1].1],
                is_beam: collimated && start.events == 0 && start.path.bounces == 0,
            };
            self.sink.leg(&leg, *budget);
        }
    }

    /// Finds the layer of a ray that has left a grain. The grain may extend across
    /// planes.
    #[inline]
    fn find_layer(&mut self, lane: usize) {
        let Lane { ray, slab, .. } = &mut self.lanes[lane];
        let above_base_m = self.thicknesses_m[*slab] - ray.z_m;
        let layers = &self.walker.layers[..self.walker.layers.len() - 1];
        ray.layer = layers.partition_point(|layer| layer.base_m > above_base_m);
        if ray.layer > 0 {
            self.store_branch_point(lane, None);
        }
    }

    /// Ends the walk of `lane` and resumes it in the next slab or starts another ray;
    /// false if no ray is left.
    #[inline(always)]
    fn end(&mut self, lane: usize, end: End) -> Result<bool, WalkError> {
        Ok(self.end_and_resume(lane, end)? || self.start(lane)?)
    }

    /// Reports the end of the walk of `lane` and resumes it in the next slab; false if
    /// the walk has ended in all slabs.
    #[inline(always)]
    fn end_and_resume(&mut self, lane: usize, end: End) -> Result<bool, WalkError> {
        let Lane {
            slab,
            branch_point,
            ray,
            ..
        } = &mut self.lanes[lane];
        let slabs = self.thicknesses_m.len();
        let Some((before, proposal)) = branch_point.take() else {
            // the lower plane had no effect: the walk is the same in all thicker slabs
            self.sink.end(*slab..slabs, end, &ray.path, ray.direction);
            return Ok(false);
        };
        self.sink
            .end(*slab..*slab + 1, end, &ray.path, ray.direction);
        *slab += 1;
        *ray = before;
        if proposal.is_none() {
            self.find_layer(lane);
        }
        self.fly(lane, proposal)
    }

    /// Flies the ray of `lane` to a grain that fits into the snowpack; false if the
    /// walk has ended in this snowpack and all thicker ones.
    #[inline(always)]
    fn fly(&mut self, lane: usize, resumed: Option<Proposal>) -> Result<bool, WalkError> {
        S::outlined(FlyTask(self, lane, resumed))
    }

    #[inline(always)]
    fn fly_inlined(
        &mut self,
        lane: usize,
        mut resumed: Option<Proposal>,
    ) -> Result<bool, WalkError> {
        let mut rejections = 0;
        loop {
            let proposal = match resumed.take() {
                Some(proposal) => proposal,
                None => {
                    let Ray {
                        layer, direction, ..
                    } = self.lanes[lane].ray;
                    self.proposals[layer].next(direction, &mut self.rng)
                }
            };
            let thickness_m = self.thicknesses_m[self.lanes[lane].slab];
            // to a grain or out of the snowpack
            let (first, mut proposal, mut ray) = (proposal, proposal, self.lanes[lane].ray);
            if self.follows {
                self.flight.clear();
                self.pass(ray.z_m, ray.path);
            }
            let inside = loop {
                let layer = &self.walker.layers[ray.layer];
                let z_m = ray.z_m + proposal.flight_m * ray.direction.z;
                let top_m = match ray.layer.checked_sub(1) {
                    Some(above) => thickness_m - self.walker.layers[above].base_m,
                    None => 0.0,
                };
                let bottom_m = thickness_m - layer.base_m;
                let inside = top_m <= z_m && z_m <= bottom_m;
                let down = ray.direction.z > 0.0;
                let plane_m = if down { bottom_m } else { top_m };
                let length_m = if inside {
                    proposal.flight_m
                } else {
                    (plane_m - ray.z_m) / ray.direction.z
                };
                if first.medium < layer.snow.water_saturation {
                    ray.path.water_m += length_m;
                }
                if layer.has_sooty_pores {
                    ray.path.collect(&layer.in_pores, length_m);
                }
                ray.path.offset_m[0] += length_m * ray.direction.x;
                ray.path.offset_m[1] += length_m * ray.direction.y;
                ray.z_m = if inside { z_m } else { plane_m };
                if self.follows {
                    self.pass(ray.z_m, ray.path);
                }
                if inside {
                    break true;
                }
                if down && ray.layer == 0 {
                    self.store_branch_point(lane, Some(first));
                }
                let last = if down {
                    self.walker.layers.len() - 1
                } else {
                    0
                };
                if ray.layer == last {
                    break false;
                }
                ray.layer = if down { ray.layer + 1 } else { ray.layer - 1 };
                proposal = self.proposals[ray.layer].next(ray.direction, &mut self.rng);
            };
            let absorption = &self.walker.absorption;
            let budget = self.lanes[lane].budget;
            let depth = absorption.coefficients.depth(&ray.path);
            if !inside {
                if self.follows {
                    self.cross_pores(lane);
                }
                self.lanes[lane].ray = ray;
                let end = match (depth >= budget, ray.direction.z > 0.0) {
                    (true, _) => End::Absorbed,
                    (false, true) => {
                        if self.bounce(lane) {
                            rejections = 0;
                            continue;
                        }
                        self.end_at_substrate()
                    }
                    (false, false) => End::Reflected,
                };
                return self.end_and_resume(lane, end);
            }
            let grain = match &proposal.met {
                Met::Grain(grain) => grain,
                Met::Particle(turn) => {
                    if self.follows {
                        self.cross_pores(lane);
                    }
                    ray.direction = turn.applied(ray.direction);
                    ray.events += 1;
                    self.lanes[lane].ray = ray;
                    if depth >= budget {
                        return self.end_and_resume(lane, End::Absorbed);
                    }
                    if ray.events >= EVENT_LIMIT {
                        return self.end_and_resume(lane, End::Lost);
                    }
                    rejections = 0;
                    continue;
                }
            };
            let (point, normal) = contact(grain, ray.direction);
            let scale_m = 0.5 * grain.size_m;
            let [x_m, y_m] = ray.path.offset_m;
            let centre_m = Vec3::new(x_m, y_m, ray.z_m) + point * -scale_m;
            // the contact point lies on the grain, so it can protrude only near a plane
            if ray.z_m < grain.size_m || ray.z_m > thickness_m - grain.size_m {
                let half_m = grain.body.half_height(&Upright) * scale_m;
                let sticks_out_below = centre_m.z + half_m > thickness_m;
                if sticks_out_below {
                    self.store_branch_point(lane, Some(first));
                }
                if sticks_out_below || centre_m.z - half_m < 0.0 {
                    rejections += 1;
                    if rejections == REJECTION_LIMIT {
                        return Err(WalkError::TooThin { thickness_m });
                    }
                    continue;
                }
            }
            if self.follows {
                self.cross_pores(lane);
            }
            self.lanes[lane].ray = ray;
            if depth >= budget {
                return self.end_and_resume(lane, End::Absorbed);
            }
            let layer = &self.walker.layers[ray.layer];
            let in_ice = absorption.coefficients.impurities.iter().zip(&layer.in_ice);
            let in_ice: f64 = in_ice.map(|(factor, per_m)| factor * per_m).sum();
            let ice_per_m = absorption.coefficients.ice_per_m + in_ice;
            let (events, bit) = (&mut self.events[lane / 8], lane % 8);
            events.ice_m.as_mut_array()[bit] = ray.path.ice_m;
            events.ice_limit_m.as_mut_array()[bit] = if ice_per_m > 0.0 && !self.follows {
                ray.path.ice_m + (budget - depth) / ice_per_m
            } else {
                f64::INFINITY
            };
            events.direction.set(bit, ray.direction);
            let in_water = first.medium < layer.snow.water_saturation;
            events.start(bit, grain, point, normal, in_water);
            self.lanes[lane].centre_m = centre_m;
            return Ok(true);
        }
    }

    /// Stores the point from which to resume the ray in the next slab, because from here
    /// on the lower plane of the surface layer affects the walk. `proposal` is the flight
    /// that begins here, if it is drawn.
    fn store_branch_point(&mut self, lane: usize, proposal: Option<Proposal>) {
        let Lane {
            ray,
            slab,
            branch_point,
            ..
        } = &mut self.lanes[lane];
        if branch_point.is_none() && *slab + 1 < self.thicknesses_m.len() {
            *branch_point = Some((*ray, proposal));
        }
    }

    /// Whether the substrate sends the ray of `lane` back.
    #[inline(always)]
    fn bounce(&mut self, lane: usize) -> bool {
        let reflected = self.walker.bounce.reflected;
        reflected != 0.0 && S::outlined(BounceTask(self, lane, reflected))
    }

    #[inline(always)]
    fn bounce_by_chance(&mut self, lane: usize, reflected: f64) -> bool {
        if self.rng.uniform().as_array()[0] >= reflected {
            return false;
        }
        let last = self.walker.layers.len() - 1;
        let cos = self.diffuse_cosine(last);
        let (sin_azimuth, cos_azimuth) = self.rng.azimuth();
        let [y, x] = [sin_azimuth, cos_azimuth].map(|v| v.as_array()[0]);
        let sin = (1.0 - cos * cos).sqrt();
        let ray = &mut self.lanes[lane].ray;
        ray.direction = Vec3::new(sin * x, sin * y, -cos);
        ray.path.bounces += 1;
        true
    }

    /// The fate of a ray that the substrate does not reflect.
    #[inline(always)]
    fn end_at_substrate(&mut self) -> End {
        let Bounce {
            reflected,
            transmitted,
        } = self.walker.bounce;
        let absorbed = 1.0 - reflected - transmitted;
        if absorbed > 0.0 && self.rng.uniform().as_array()[0] * (1.0 - reflected) < absorbed {
            return End::Absorbed;
        }
        End::Transmitted
    }
}
