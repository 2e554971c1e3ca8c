//! Eight rays side by side between grains drawn from tables: depths and cosines of the
//! directions. In a plane-parallel snowpack the azimuth does not matter.
use splitsnow_spectra::simd::{F64x8, Simd};

use crate::grain::{Bodies, Down};
use crate::math::{ln, set_lanes};
use crate::rng::{Stream, azimuth};
use crate::table::PackedTable;
use crate::table::snowpack::{TableLayer, TableSnowpack};
use crate::transport::{Path, TRACERS};

/// Eight rays between two grains.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Rays<S: Simd> {
    /// Depth, m.
    pub(super) z_m: F64x8<S>,
    /// Cosine of the angle from straight down.
    pub(super) mu: F64x8<S>,
    /// Paths in ice, m.
    pub(super) ice_m: F64x8<S>,
    /// Paths in water, m.
    pub(super) water_m: F64x8<S>,
    /// See [`Path::impurities`].
    pub(super) impurities: [F64x8<S>; TRACERS],
    /// Layers, counted from the surface.
    pub(super) layer: [usize; 8],
}

/// One ray of [`Rays`].
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Ray {
    pub(super) z_m: f64,
    pub(super) mu: f64,
    pub(super) path: Path,
    pub(super) layer: usize,
}

impl<S: Simd> Rays<S> {
    /// The ray of `lane`.
    #[inline(always)]
    pub(super) fn get(&self, lane: usize) -> Ray {
        let lane_value = |v: &F64x8<S>| v.as_array()[lane];
        Ray {
            z_m: lane_value(&self.z_m),
            mu: lane_value(&self.mu),
            path: Path {
                ice_m: lane_value(&self.ice_m),
                water_m: lane_value(&self.water_m),
                impurities: self.impurities.each_ref().map(lane_value),
                ..Path::default()
            },
            layer: self.layer[lane],
        }
    }

    /// Puts `ray` on `lane`.
    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, ray: &Ray) {
        self.z_m.as_mut_array()[lane] = ray.z_m;
        self.mu.as_mut_array()[lane] = ray.mu;
        self.ice_m.as_mut_array()[lane] = ray.path.ice_m;
        self.water_m.as_mut_array()[lane] = ray.path.water_m;
        for (all, depth) in self.impurities.iter_mut().zip(ray.path.impurities) {
            all.as_mut_array()[lane] = depth;
        }
        self.layer[lane] = ray.layer;
    }
}

/// Uniform variates of a flight and of the grain at its end.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Variates<S: Simd> {
    pub(super) flight: F64x8<S>,
    /// Chooses the type of grain. Its remainder chooses the outcome, and the remainder of
    /// that the size.
    pub(super) outcome: F64x8<S>,
    pub(super) azimuth: F64x8<S>,
    pub(super) medium: F64x8<S>,
}

impl<S: Simd> Variates<S> {
    #[inline(always)]
    pub(super) fn draw(wet: bool, rng: &mut Stream<S>) -> Self {
        Self {
            flight: rng.uniform(),
            outcome: rng.uniform(),
            azimuth: rng.uniform(),
            medium: if wet { rng.uniform() } else { F64x8::ONE },
        }
    }

    /// Its vectors, in the order of [`Variates::get`].
    #[inline(always)]
    pub(super) fn all_mut(&mut self) -> [&mut F64x8<S>; 4] {
        [
            &mut self.flight,
            &mut self.outcome,
            &mut self.azimuth,
            &mut self.medium,
        ]
    }

    /// The variates of one lane.
    #[inline(always)]
    pub(super) fn get(&self, lane: usize) -> [f64; 4] {
        [self.flight, self.outcome, self.azimuth, self.medium].map(|v| v.as_array()[lane])
    }

    /// Sets the variates of one lane.
    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, [flight, outcome, azimuth, medium]: [f64; 4]) {
        self.flight.as_mut_array()[lane] = flight;
        self.outcome.as_mut_array()[lane] = outcome;
        self.azimuth.as_mut_array()[lane] = azimuth;
        self.medium.as_mut_array()[lane] = medium;
    }
}

/// A flight and the candidate grain at its end.
#[derive(Debug, Clone, Copy)]
pub(super) struct Flight<S: Simd> {
    pub(super) length_m: F64x8<S>,
    /// Depth of its end point, m.
    pub(super) end_m: F64x8<S>,
    /// All ones where it passes through water.
    pub(super) wet: F64x8<S>,
    /// Indices of the grain types in their layers.
    kinds: [usize; 8],
    outcomes: [u32; 8],
    pub(super) size_m: F64x8<S>,
    sin: F64x8<S>,
    cos: F64x8<S>,
    /// Sine of the ray's angle from the vertical.
    across: F64x8<S>,
}

impl TableSnowpack<'_> {
    /// Draws the flights of the rays, all within the layers they start in, and the
    /// candidate grains at their ends.
    #[inline(always)]
    pub(super) fn fly<S: Simd>(&self, rays: &Rays<S>, variates: &Variates<S>) -> Flight<S> {
        let first = &self.layers[0];
        let [mut distance_m, mut saturation] =
            [first.mean_free_distance_m, first.water_saturation].map(F64x8::splat);
        let [min, max] = first.kinds[0].size_m;
        let (mut smallest_m, mut range_m) = (F64x8::splat(min), F64x8::splat(max - min));
        let mut entries = F64x8::splat(first.kinds[0].tables[0].len() as f64);
        let mut kinds = [0; 8];
        let mut choice = variates.outcome;
        if !self.is_plain() {
            for (lane, chosen) in kinds.iter_mut().enumerate() {
                let layer = &self.layers[rays.layer[lane]];
                distance_m.as_mut_array()[lane] = layer.mean_free_distance_m;
                saturation.as_mut_array()[lane] = layer.water_saturation;
                let u = choice.as_array()[lane];
                let others = &layer.kinds[1..];
                *chosen = others.partition_point(|kind| kind.chance[0] <= u);
                let kind = &layer.kinds[*chosen];
                let [before, share] = kind.chance;
                // remainder of the variate, kept below 1 despite rounding
                let rest = ((u - before) / share).clamp(0.0, 1.0 - f64::EPSILON);
                choice.as_mut_array()[lane] = rest;
                let [min, max] = kind.size_m;
                smallest_m.as_mut_array()[lane] = min;
                range_m.as_mut_array()[lane] = max - min;
                entries.as_mut_array()[lane] = kind.tables[0].len() as f64;
            }
        }
        let length_m = -ln(F64x8::ONE - variates.flight) * distance_m;
        let wet = variates.medium.lt(saturation);
        let mut outcomes = [0; 8];
        let mut rest = [0.0; 8];
        let scaled = choice * entries;
        for (lane, scaled) in scaled.as_array().iter().enumerate() {
            outcomes[lane] = *scaled as u32;
            rest[lane] = scaled - f64::from(outcomes[lane]);
        }
        let (sin, cos) = azimuth(variates.azimuth);
        Flight {
            length_m,
            end_m: rays.z_m + length_m * rays.mu,
            wet,
            kinds,
            outcomes,
            size_m: F64x8::new(rest) * range_m + smallest_m,
            sin,
            cos,
            across: (F64x8::ONE - rays.mu * rays.mu).max(F64x8::ZERO).sqrt(),
        }
    }

    /// The first `N` columns of the candidates' outcomes, from `rows` of the table for air
    /// or water.
    #[inline(always)]
    fn gather<S: Simd, const N: usize>(
        &self,
        rays: &Rays<S>,
        flight: &Flight<S>,
        rows: impl Fn(&PackedTable) -> &[[f32; 8]],
    ) -> [F64x8<S>; N] {
        let plain = self.is_plain();
        let first = &self.layers[0].kinds[0].tables;
        let [air, water] = first.map(&rows);
        let wet = if self.wet { flight.wet.to_bitmask() } else { 0 };
        let row = |lane: usize| {
            let in_water = wet >> lane & 1 == 1;
            let rows = if plain {
                if in_water { water } else { air }
            } else {
                let kind = &self.layers[rays.layer[lane]].kinds[flight.kinds[lane]];
                rows(kind.tables[usize::from(in_water)])
            };
            &rows[flight.outcomes[lane] as usize]
        };
        let rows = [
            row(0),
            row(1),
            row(2),
            row(3),
            row(4),
            row(5),
            row(6),
            row(7),
        ];
        let columns = F64x8::columns(rows);
        std::array::from_fn(|column| columns[column])
    }

    /// Depths of the highest and lowest points of the candidate grains, m.
    #[inline(always)]
    pub(super) fn extent_m<S: Simd>(&self, rays: &Rays<S>, flight: &Flight<S>) -> [F64x8<S>; 2] {
        let [x, y, along, numbers @ ..] = self.gather::<S, 8>(rays, flight, |table| &table.bodies);
        let mut forms = [self.layers[0].kinds[0].tables[0].form; 8];
        if !self.is_plain() {
            for (lane, form) in forms.iter_mut().enumerate() {
                let layer = &self.layers[rays.layer[lane]];
                *form = layer.kinds[flight.kinds[lane]].tables[0].form;
            }
        }
        let down = flight.frame(rays.mu);
        let centre = down.down([x, y, along]);
        let half = F64x8::splat(0.5) * Bodies::new(forms, numbers).half_height(&down);
        [centre - half, centre + half].map(|v| flight.end_m + flight.size_m * v)
    }

    /// Applies the grain events to the lanes set in `met`.
    #[inline(always)]
    pub(super) fn scatter<S: Simd>(&self, rays: &mut Rays<S>, flight: &Flight<S>, met: F64x8<S>) {
        let [c, s, along, x, y, ice] = self.gather(rays, flight, |table| &table.motions);
        let frame = flight.frame(rays.mu);
        let moved = frame.down([x, y, along]);
        let turned = frame.down([s, F64x8::ZERO, c]);
        rays.z_m = met.select(flight.end_m + flight.size_m * moved, rays.z_m);
        rays.mu = met.select(turned.max(-F64x8::ONE).min(F64x8::ONE), rays.mu);
        let ice_m = (flight.size_m * ice) & met;
        rays.ice_m += ice_m;
        if self.sooty {
            self.collect(rays, ice_m, |layer| &layer.in_ice);
        }
    }

    /// Distances between the points where the rays would enter and leave the candidates, m.
    #[inline(always)]
    pub(super) fn chord_m<S: Simd>(&self, rays: &Rays<S>, flight: &Flight<S>) -> F64x8<S> {
        let [_, _, along, x, y] = self.gather(rays, flight, |table| &table.motions);
        flight.size_m * (x * x + y * y + along * along).sqrt()
    }

    /// Adds a path of `length_m` through the pores, which hold water where `wet` is set; lengths of 0
    /// add nothing.
    #[inline(always)]
    pub(super) fn pass<S: Simd>(&self, rays: &mut Rays<S>, wet: F64x8<S>, length_m: F64x8<S>) {
        if self.wet {
            rays.water_m += length_m & wet;
        }
        if self.sooty {
            self.collect(rays, length_m, |layer| &layer.in_pores);
        }
    }

    #[inline(always)]
    fn collect<S: Simd>(
        &self,
        rays: &mut Rays<S>,
        length_m: F64x8<S>,
        impurities: for<'s> fn(&'s TableLayer) -> &'s [f64; TRACERS],
    ) {
        for lane in set_lanes(0xff) {
            let per_m = impurities(&self.layers[rays.layer[lane]]);
            let length_m = length_m.as_array()[lane];
            // a ray lost in a grain has an infinite path
            if length_m > 0.0 && length_m.is_finite() {
                for (all, per_m) in rays.impurities.iter_mut().zip(per_m) {
                    all.as_mut_array()[lane] += per_m * length_m;
                }
            }
        }
    }
}

/// The frame of outcomes, rotated about a ray.
#[derive(Clone, Copy)]
struct RayFrame<S: Simd> {
    mu: F64x8<S>,
    across: F64x8<S>,
    cos: F64x8<S>,
    sin: F64x8<S>,
}

impl<S: Simd> Down<F64x8<S>> for RayFrame<S> {
    #[inline(always)]
    fn down(&self, [x, y, along]: [F64x8<S>; 3]) -> F64x8<S> {
        self.mu * along + self.across * (self.cos * x + self.sin * y)
    }
}

impl<S: Simd> Flight<S> {
    /// The frame of the outcome at its end, for a ray at the cosine `mu`.
    #[inline(always)]
    fn frame(&self, mu: F64x8<S>) -> RayFrame<S> {
        RayFrame {
            mu,
            across: self.across,
            cos: self.cos,
            sin: self.sin,
        }
    }
}
