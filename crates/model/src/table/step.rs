//! One step of eight rays: a flight and the grain event or plane at its end.
use splitsnow_spectra::elementary::exp_neg_single;
use splitsnow_spectra::simd::{F64x8, Simd};

use crate::math::set_lanes;
use crate::table::rays::{Ray, Rays, Variates};
use crate::table::snowpack::TableSnowpack;
use crate::transport::{EVENT_LIMIT, REJECTION_LIMIT};

/// Eight rays walking through a snowpack.
#[derive(Debug)]
pub(super) struct Steps<'a, S: Simd> {
    pub(super) snowpack: &'a TableSnowpack<'a>,
    /// Whether snow continues above and below, so that grains may cross the ends.
    open: [bool; 2],
    pub(super) rays: Rays<S>,
    /// Depth of the lower end, m.
    pub(super) depth_m: F64x8<S>,
    /// Length added to the next flight, m.
    pub(super) flown_m: F64x8<S>,
    events: F64x8<S>,
    rejections: F64x8<S>,
    /// For the lanes set in `cut`: the rays at the start of flights that have crossed planes
    /// between layers, and the first variate of the medium.
    origin: Rays<S>,
    medium: F64x8<S>,
    cut: F64x8<S>,
    /// Whether to set the next two.
    pub(super) follows: bool,
    /// Depths at which the last flights ended, m.
    pub(super) contact_m: F64x8<S>,
    /// Distances from there to where the rays would leave the grains met, m.
    pub(super) chord_m: F64x8<S>,
}

/// The lanes in which something happened, one bit each.
#[derive(Debug, Clone, Copy)]
pub(super) struct StepMasks {
    /// A grain was met.
    pub(super) met: u32,
    /// The ray left upward.
    pub(super) above: u32,
    /// The ray left downward, past the lower end.
    pub(super) below: u32,
    /// The walk will not end.
    pub(super) lost: u32,
    /// The grain did not fit, and the ray is where its flight began.
    pub(super) rejected: u32,
}

/// What the next flights of eight rays may do.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leaving<S: Simd> {
    /// Chances that they leave the snowpack; 0 where a plane between layers comes first.
    pub(super) chance: F64x8<S>,
    /// The lanes whose rays go down.
    pub(super) down: u32,
    /// Distances to the planes ahead, m.
    pub(super) length_m: F64x8<S>,
}

/// A lane whose grains do not fit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stuck(pub(super) usize);

impl<'a, S: Simd> Steps<'a, S> {
    pub(super) fn new(snowpack: &'a TableSnowpack<'a>, open: [bool; 2]) -> Self {
        Self {
            snowpack,
            open,
            rays: Rays::default(),
            depth_m: F64x8::ZERO,
            flown_m: F64x8::ZERO,
            events: F64x8::ZERO,
            rejections: F64x8::ZERO,
            origin: Rays::default(),
            medium: F64x8::ZERO,
            cut: F64x8::ZERO,
            follows: false,
            contact_m: F64x8::ZERO,
            chord_m: F64x8::ZERO,
        }
    }

    /// Puts `ray` on `lane` at the start of a flight, in a snowpack `depth_m` deep.
    #[inline(always)]
    pub(super) fn start(&mut self, lane: usize, ray: &Ray, depth_m: f64) {
        self.resume(lane, ray, depth_m);
        self.events.as_mut_array()[lane] = 0.0;
    }

    /// The same for a ray that has had grain events. Its layer follows from its depth.
    #[inline(always)]
    pub(super) fn resume(&mut self, lane: usize, ray: &Ray, depth_m: f64) {
        self.rays.set(lane, ray);
        self.depth_m.as_mut_array()[lane] = depth_m;
        self.rays.layer[lane] = self.layer_of(lane);
        self.rejections.as_mut_array()[lane] = 0.0;
        self.cut.as_mut_array()[lane] = 0.0;
    }

    /// Forgets what happened to the rays that were in the lanes before.
    #[inline(always)]
    pub(super) fn forget(&mut self) {
        self.cut = F64x8::ZERO;
        self.rejections = F64x8::ZERO;
        self.events = F64x8::ZERO;
    }

    /// The flight of the ray of `lane` began at `origin` and has been cut; `medium` is the variate
    /// of its medium.
    #[inline(always)]
    pub(super) fn cut_at(&mut self, lane: usize, origin: &Ray, medium: f64) {
        self.cut.as_mut_array()[lane] = F64x8::<S>::mask(true);
        self.origin.set(lane, origin);
        self.medium.as_mut_array()[lane] = medium;
    }

    /// The inverse of [`Self::cut_at`], if the flight has been cut.
    #[inline(always)]
    pub(super) fn cut_of(&self, lane: usize) -> Option<(Ray, f64)> {
        let is_cut = self.cut.to_bitmask() >> lane & 1 == 1;
        is_cut.then(|| (self.origin.get(lane), self.medium.as_array()[lane]))
    }

    /// What the next flights may do.
    #[inline(always)]
    pub(super) fn leaving(&self) -> Leaving<S> {
        let layers = &self.snowpack.layers;
        let [top_m, bottom_m] = self.planes();
        let is_down = self.rays.mu.gt(F64x8::ZERO);
        let length_m = (is_down.select(bottom_m, top_m) - self.rays.z_m) / self.rays.mu;
        let down = is_down.to_bitmask();
        let mut distance_m = F64x8::splat(layers[0].mean_free_distance_m);
        let mut is_outermost = F64x8::ALL;
        if layers.len() > 1 {
            for (lane, layer) in self.rays.layer.iter().enumerate() {
                distance_m.as_mut_array()[lane] = layers[*layer].mean_free_distance_m;
                let outermost = match down >> lane & 1 {
                    1 => layers.len() - 1,
                    _ => 0,
                };
                is_outermost.as_mut_array()[lane] = F64x8::<S>::mask(*layer == outermost);
            }
        }
        let flights = (length_m - self.flown_m) / distance_m;
        let mut chance = [0.0; 8];
        for (chance, flights) in chance.iter_mut().zip(flights.as_array()) {
            *chance = f64::from(exp_neg_single(*flights as f32));
        }
        Leaving {
            chance: F64x8::new(chance) & is_outermost,
            down,
            length_m,
        }
    }

    /// Moves `rays`, which are in its lanes, by `length_m` through the pores.
    #[inline(always)]
    pub(super) fn pass_pores(
        &self,
        rays: &mut Rays<S>,
        variates: &Variates<S>,
        length_m: F64x8<S>,
    ) {
        let layers = &self.snowpack.layers;
        let mut saturation = F64x8::splat(layers[0].water_saturation);
        let mut medium = variates.medium;
        if layers.len() > 1 {
            medium = self.cut.select(self.medium, medium);
            for (lane, layer) in rays.layer.iter().enumerate() {
                saturation.as_mut_array()[lane] = layers[*layer].water_saturation;
            }
        }
        self.snowpack.pass(rays, medium.lt(saturation), length_m);
    }

    /// The layer at the depth of the ray of `lane`.
    #[inline(always)]
    fn layer_of(&self, lane: usize) -> usize {
        let above_base_m = self.depth_m.as_array()[lane] - self.rays.z_m.as_array()[lane];
        let layers = &self.snowpack.layers[..self.snowpack.layers.len() - 1];
        layers.partition_point(|layer| layer.base_m > above_base_m)
    }

    /// The ray of `lane` at the start of its flight.
    #[inline(always)]
    pub(super) fn origin(&self, lane: usize) -> Ray {
        if self.cut.to_bitmask() >> lane & 1 == 1 {
            self.origin.get(lane)
        } else {
            self.rays.get(lane)
        }
    }

    /// Depths of the planes of the rays' layers, m.
    #[inline(always)]
    fn planes(&self) -> [F64x8<S>; 2] {
        let layers = &self.snowpack.layers;
        let (mut top_m, mut bottom_m) = (F64x8::ZERO, self.depth_m);
        if layers.len() > 1 {
            for (lane, layer) in self.rays.layer.iter().enumerate() {
                let depth_m = self.depth_m.as_array()[lane];
                if *layer > 0 {
                    top_m.as_mut_array()[lane] = depth_m - layers[layer - 1].base_m;
                }
                bottom_m.as_mut_array()[lane] = depth_m - layers[*layer].base_m;
            }
        }
        [top_m, bottom_m]
    }

    /// Takes one step on the lanes set in `walking`. Calls `on_lower_plane`, before any ray
    /// moves, for each lane that the lower plane affects.
    #[inline(always)]
    pub(super) fn step(
        &mut self,
        variates: &mut Variates<S>,
        walking: u32,
        mut on_lower_plane: impl FnMut(&Self, usize, &Variates<S>),
    ) -> Result<StepMasks, Stuck> {
        let (one, zero) = (F64x8::ONE, F64x8::ZERO);
        let layered = self.snowpack.layers.len() > 1;
        if layered {
            // the medium of a flight cut at a plane follows from the same variate
            variates.medium = self.cut.select(self.medium, variates.medium);
        }
        let mut flight = self.snowpack.fly(&self.rays, variates);
        flight.length_m += self.flown_m;
        flight.end_m += self.flown_m * self.rays.mu;
        self.flown_m = zero;

        // rays that reach planes
        let [top_m, bottom_m] = self.planes();
        let up = flight.end_m.lt(top_m) & self.rays.mu.lt(zero);
        let down = flight.end_m.gt(bottom_m) & self.rays.mu.gt(zero);
        let (mut above, mut below, mut crossed) = (up, down, zero);
        let mut touched = down;
        if layered {
            let (mut first, mut last) = (zero, zero);
            let end = self.snowpack.layers.len() - 1;
            let all_ones = f64::from_bits(u64::MAX);
            for (lane, layer) in self.rays.layer.iter().enumerate() {
                first.as_mut_array()[lane] = if *layer == 0 { all_ones } else { 0.0 };
                last.as_mut_array()[lane] = if *layer == end { all_ones } else { 0.0 };
            }
            above = up & first;
            below = down & last;
            crossed = (up & !first) | (down & !last);
            touched = down & (first | last);
        }
        let out = above | below;

        // candidate grains that would cross the outer planes
        let mut rejected = zero;
        let ends = !(out | crossed);
        let [open_above, open_below] = self.open;
        let mut near = zero;
        if !open_above {
            near |= ends & flight.end_m.lt(flight.size_m);
        }
        if !open_below {
            near |= ends & flight.end_m.gt(self.depth_m - flight.size_m);
        }
        if near.to_bitmask() & walking != 0 {
            let [highest_m, lowest_m] = self.snowpack.extent_m(&self.rays, &flight);
            if !open_above {
                rejected = near & highest_m.lt(zero);
            }
            if !open_below {
                let under = near & lowest_m.gt(self.depth_m);
                touched |= under;
                rejected |= under;
            }
            let counts = rejected | crossed;
            self.rejections = counts.select(self.rejections + (one & rejected), zero);
            let limit = F64x8::splat(f64::from(REJECTION_LIMIT));
            let stuck = self.rejections.ge(limit).to_bitmask() & walking;
            if let Some(lane) = set_lanes(stuck).next() {
                return Err(Stuck(lane));
            }
        } else {
            self.rejections = crossed.select(self.rejections, zero);
        }
        let touched = touched.to_bitmask() & walking;
        for lane in set_lanes(touched) {
            on_lower_plane(self, lane, variates);
        }

        let met = !(out | crossed | rejected);
        if layered {
            self.keep_origins(crossed, variates);
        }
        if self.snowpack.wet || self.snowpack.sooty {
            let plane_m = down.select(bottom_m, top_m);
            let to_plane_m = (plane_m - self.rays.z_m) / self.rays.mu;
            let length_m = met.select(flight.length_m, to_plane_m & (out | crossed));
            self.snowpack.pass(&mut self.rays, flight.wet, length_m);
        }
        if self.follows {
            self.contact_m = flight.end_m;
            self.chord_m = self.snowpack.chord_m(&self.rays, &flight);
        }
        self.snowpack.scatter(&mut self.rays, &flight, met);
        self.events += one & met;
        if layered {
            self.change_layers([up & crossed, down & crossed], [top_m, bottom_m], met);
            for lane in set_lanes((rejected & self.cut).to_bitmask()) {
                let origin = self.origin.get(lane);
                self.rays.set(lane, &origin);
            }
            self.cut = crossed;
        }
        let lost = self.rays.ice_m.equals(F64x8::splat(f64::INFINITY))
            | self.events.ge(F64x8::splat(EVENT_LIMIT as f64));
        Ok(StepMasks {
            met: met.to_bitmask(),
            above: above.to_bitmask(),
            below: below.to_bitmask(),
            lost: lost.to_bitmask(),
            rejected: rejected.to_bitmask(),
        })
    }

    /// Stores the starting points of flights that are cut for the first time.
    #[inline(always)]
    fn keep_origins(&mut self, crossed: F64x8<S>, variates: &Variates<S>) {
        for lane in set_lanes((crossed & !self.cut).to_bitmask()) {
            let ray = self.rays.get(lane);
            self.origin.set(lane, &ray);
            self.medium.as_mut_array()[lane] = variates.medium.as_array()[lane];
        }
    }

    /// Moves rays that crossed planes `up` and `down` onto these planes, and assigns the
    /// rays moved by grains to their layers.
    #[inline(always)]
    fn change_layers(
        &mut self,
        [up, down]: [F64x8<S>; 2],
        [top_m, bottom_m]: [F64x8<S>; 2],
        met: F64x8<S>,
    ) {
        self.rays.z_m = up.select(top_m, down.select(bottom_m, self.rays.z_m));
        let [up, down, met] = [up, down, met].map(F64x8::to_bitmask);
        set_lanes(up).for_each(|lane| self.rays.layer[lane] -= 1);
        set_lanes(down).for_each(|lane| self.rays.layer[lane] += 1);
        set_lanes(met).for_each(|lane| self.rays.layer[lane] = self.layer_of(lane));
    }
}
