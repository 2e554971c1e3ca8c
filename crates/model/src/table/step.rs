//! One step of eight rays: a flight, and the grain event or the plane at its end.
use wide::f64x8;

use crate::table::lanes;
use crate::table::rays::{Ray, Rays, Variates};
use crate::table::snowpack::TableSnowpack;
use crate::transport::{EVENT_LIMIT, REJECTION_LIMIT};

/// Eight rays on their way through a snowpack.
#[derive(Debug)]
pub(super) struct Steps<'a> {
    pub(super) snowpack: &'a TableSnowpack<'a>,
    /// Whether snow goes on above and below, so that grains may cross the ends.
    open: [bool; 2],
    pub(super) rays: Rays,
    /// Depth of the lower end, m.
    pub(super) depth_m: f64x8,
    /// Length by which the next flight is longer than drawn, m.
    pub(super) flown_m: f64x8,
    events: f64x8,
    rejections: f64x8,
    /// Where flights began that have crossed planes between layers, and their
    /// first variate of the medium, for the lanes set in `cut`.
    origin: Rays,
    medium: f64x8,
    cut: f64x8,
}

/// Lanes to which something happened, a bit each.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stepped {
    /// A grain was met.
    pub(super) met: u32,
    /// Left upward.
    pub(super) above: u32,
    /// Left downward, past the lower end.
    pub(super) below: u32,
    /// Never comes to an end.
    pub(super) lost: u32,
}

/// A lane whose grains do not fit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stuck(pub(super) usize);

impl<'a> Steps<'a> {
    pub(super) fn new(snowpack: &'a TableSnowpack<'a>, open: [bool; 2]) -> Self {
        Self {
            snowpack,
            open,
            rays: Rays::default(),
            depth_m: f64x8::ZERO,
            flown_m: f64x8::ZERO,
            events: f64x8::ZERO,
            rejections: f64x8::ZERO,
            origin: Rays::default(),
            medium: f64x8::ZERO,
            cut: f64x8::ZERO,
        }
    }

    /// Puts `ray` on `lane`, at the beginning of a flight, in a snowpack
    /// `depth_m` deep.
    pub(super) fn start(&mut self, lane: usize, ray: &Ray, depth_m: f64) {
        self.resume(lane, ray, depth_m);
        self.events.as_mut_array()[lane] = 0.0;
    }

    /// The same for a ray that has events behind it. Its layer is found by its
    /// depth.
    pub(super) fn resume(&mut self, lane: usize, ray: &Ray, depth_m: f64) {
        self.rays.set(lane, ray);
        self.depth_m.as_mut_array()[lane] = depth_m;
        self.rays.stratum[lane] = self.stratum(lane);
        self.rejections.as_mut_array()[lane] = 0.0;
        self.cut.as_mut_array()[lane] = 0.0;
    }

    /// The layer at the depth of the ray of `lane`.
    fn stratum(&self, lane: usize) -> usize {
        let above_base_m = self.depth_m.as_array()[lane] - self.rays.z_m.as_array()[lane];
        let strata = &self.snowpack.strata[..self.snowpack.strata.len() - 1];
        strata.partition_point(|stratum| stratum.base_m > above_base_m)
    }

    /// Where the flight of `lane` began.
    pub(super) fn origin(&self, lane: usize) -> Ray {
        if self.cut.to_bitmask() >> lane & 1 == 1 {
            self.origin.get(lane)
        } else {
            self.rays.get(lane)
        }
    }

    /// Depths of the planes of the rays' layers, m.
    #[inline(always)]
    fn planes(&self) -> [f64x8; 2] {
        let strata = &self.snowpack.strata;
        let (mut top_m, mut bottom_m) = (f64x8::ZERO, self.depth_m);
        if strata.len() > 1 {
            for (lane, stratum) in self.rays.stratum.iter().enumerate() {
                let depth_m = self.depth_m.as_array()[lane];
                if *stratum > 0 {
                    top_m.as_mut_array()[lane] = depth_m - strata[stratum - 1].base_m;
                }
                bottom_m.as_mut_array()[lane] = depth_m - strata[*stratum].base_m;
            }
        }
        [top_m, bottom_m]
    }

    /// One step of the lanes set in `walking`. `touch` is told, before rays
    /// move, which lanes the lower plane has a say in.
    #[inline(always)]
    pub(super) fn step(
        &mut self,
        variates: &mut Variates,
        walking: u32,
        mut touch: impl FnMut(&Self, usize, &Variates),
    ) -> Result<Stepped, Stuck> {
        let (one, zero) = (f64x8::ONE, f64x8::ZERO);
        let layered = self.snowpack.strata.len() > 1;
        if layered {
            // the medium of a flight cut at a plane follows from the same variate
            variates.medium = self.cut.select(self.medium, variates.medium);
        }
        let mut flight = self.snowpack.fly(&self.rays, variates);
        flight.length_m += self.flown_m;
        flight.end_m += self.flown_m * self.rays.mu;
        self.flown_m = zero;

        // planes
        let [top_m, bottom_m] = self.planes();
        let up = flight.end_m.simd_lt(top_m) & self.rays.mu.simd_lt(zero);
        let down = flight.end_m.simd_gt(bottom_m) & self.rays.mu.simd_gt(zero);
        let (mut above, mut below, mut crossed) = (up, down, zero);
        let mut touched = down;
        if layered {
            let (mut first, mut last) = (zero, zero);
            let end = self.snowpack.strata.len() - 1;
            let all = f64::from_bits(u64::MAX);
            for (lane, stratum) in self.rays.stratum.iter().enumerate() {
                first.as_mut_array()[lane] = if *stratum == 0 { all } else { 0.0 };
                last.as_mut_array()[lane] = if *stratum == end { all } else { 0.0 };
            }
            above = up & first;
            below = down & last;
            crossed = (up & !first) | (down & !last);
            touched = down & (first | last);
        }
        let out = above | below;

        // grains that would cross the outer ones
        let mut rejected = zero;
        let ends = !(out | crossed);
        let [open_above, open_below] = self.open;
        let mut near = zero;
        if !open_above {
            near |= ends & flight.end_m.simd_lt(flight.size_m);
        }
        if !open_below {
            near |= ends & flight.end_m.simd_gt(self.depth_m - flight.size_m);
        }
        if near.to_bitmask() & walking != 0 {
            let [highest_m, lowest_m] = self.snowpack.extent_m(&self.rays, &flight);
            if !open_above {
                rejected = near & highest_m.simd_lt(zero);
            }
            if !open_below {
                let under = near & lowest_m.simd_gt(self.depth_m);
                touched |= under;
                rejected |= under;
            }
            let counts = rejected | crossed;
            self.rejections = counts.select(self.rejections + (one & rejected), zero);
            let limit = f64x8::splat(f64::from(REJECTION_LIMIT));
            let stuck = self.rejections.simd_ge(limit).to_bitmask() & walking;
            if let Some(lane) = lanes(stuck).next() {
                return Err(Stuck(lane));
            }
        } else {
            self.rejections = crossed.select(self.rejections, zero);
        }
        let touched = touched.to_bitmask() & walking;
        for lane in lanes(touched) {
            touch(self, lane, variates);
        }

        let met = !(out | crossed | rejected);
        if layered {
            self.keep_origins(crossed, variates);
        }
        if self.snowpack.wet || self.snowpack.sooty {
            let plane_m = down.select(bottom_m, top_m);
            let to_plane_m = (plane_m - self.rays.z_m) / self.rays.mu;
            let length_m = met.select(flight.length_m, to_plane_m & (out | crossed));
            self.snowpack.pass(&mut self.rays, &flight, length_m);
        }
        self.snowpack.scatter(&mut self.rays, &flight, met);
        self.events += one & met;
        if layered {
            self.change_layers([up & crossed, down & crossed], [top_m, bottom_m], met);
            for lane in lanes((rejected & self.cut).to_bitmask()) {
                let origin = self.origin.get(lane);
                self.rays.set(lane, &origin);
            }
            self.cut = crossed;
        }
        let lost = self.rays.ice_m.simd_eq(f64x8::splat(f64::INFINITY))
            | self.events.simd_ge(f64x8::splat(EVENT_LIMIT as f64));
        Ok(Stepped {
            met: met.to_bitmask(),
            above: above.to_bitmask(),
            below: below.to_bitmask(),
            lost: lost.to_bitmask(),
        })
    }

    /// Takes note of where flights that are cut for the first time began.
    fn keep_origins(&mut self, crossed: f64x8, variates: &Variates) {
        for lane in lanes((crossed & !self.cut).to_bitmask()) {
            let ray = self.rays.get(lane);
            self.origin.set(lane, &ray);
            self.medium.as_mut_array()[lane] = variates.medium.as_array()[lane];
        }
    }

    /// Puts rays that crossed planes `up` and `down` onto them, and those that
    /// grains carried elsewhere into their layers.
    fn change_layers(&mut self, [up, down]: [f64x8; 2], [top_m, bottom_m]: [f64x8; 2], met: f64x8) {
        self.rays.z_m = up.select(top_m, down.select(bottom_m, self.rays.z_m));
        let [up, down, met] = [up, down, met].map(f64x8::to_bitmask);
        lanes(up).for_each(|lane| self.rays.stratum[lane] -= 1);
        lanes(down).for_each(|lane| self.rays.stratum[lane] += 1);
        lanes(met).for_each(|lane| self.rays.stratum[lane] = self.stratum(lane));
    }
}
