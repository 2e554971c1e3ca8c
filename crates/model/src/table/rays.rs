//! Eight rays side by side between grains drawn from tables: their depths and
//! the cosines of their directions. In a horizontal snowpack nothing else matters.
use wide::f64x8;

use crate::grain::Bodies;
use crate::math::ln;
use crate::rng::{Stream, azimuth};
use crate::table::snowpack::{TableLayer, TableSnowpack};
use crate::table::{Table, lanes};
use crate::transport::{EXPONENTS, Path};

/// Eight rays between two grains.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Rays {
    /// Depth, m.
    pub(super) z_m: f64x8,
    /// Cosine of the angle from straight down.
    pub(super) mu: f64x8,
    /// Paths in ice, m.
    pub(super) ice_m: f64x8,
    /// Paths in water, m.
    pub(super) water_m: f64x8,
    /// See [`Path::impurities`].
    pub(super) impurities: [f64x8; EXPONENTS],
    /// Layers, counted from the surface.
    pub(super) stratum: [usize; 8],
}

/// One of them.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Ray {
    pub(super) z_m: f64,
    pub(super) mu: f64,
    pub(super) path: Path,
    pub(super) stratum: usize,
}

impl Rays {
    /// The ray of `lane`.
    pub(super) fn get(&self, lane: usize) -> Ray {
        let of = |v: &f64x8| v.as_array()[lane];
        Ray {
            z_m: of(&self.z_m),
            mu: of(&self.mu),
            path: Path {
                ice_m: of(&self.ice_m),
                water_m: of(&self.water_m),
                impurities: self.impurities.each_ref().map(of),
                ..Path::default()
            },
            stratum: self.stratum[lane],
        }
    }

    /// Puts `ray` on `lane`.
    pub(super) fn set(&mut self, lane: usize, ray: &Ray) {
        self.z_m.as_mut_array()[lane] = ray.z_m;
        self.mu.as_mut_array()[lane] = ray.mu;
        self.ice_m.as_mut_array()[lane] = ray.path.ice_m;
        self.water_m.as_mut_array()[lane] = ray.path.water_m;
        for (all, depth) in self.impurities.iter_mut().zip(ray.path.impurities) {
            all.as_mut_array()[lane] = depth;
        }
        self.stratum[lane] = ray.stratum;
    }
}

/// Uniform variates of a flight and the grain at its end.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Variates {
    pub(super) flight: f64x8,
    /// Chooses the type of grain, with what remains the outcome, and with what
    /// remains of that the size.
    pub(super) outcome: f64x8,
    pub(super) azimuth: f64x8,
    pub(super) medium: f64x8,
}

impl Variates {
    #[inline(always)]
    pub(super) fn draw(wet: bool, rng: &mut Stream) -> Self {
        Self {
            flight: rng.uniform(),
            outcome: rng.uniform(),
            azimuth: rng.uniform(),
            medium: if wet { rng.uniform() } else { f64x8::ONE },
        }
    }

    /// Its vectors, in the order of [`Variates::get`].
    #[inline(always)]
    pub(super) fn all_mut(&mut self) -> [&mut f64x8; 4] {
        [
            &mut self.flight,
            &mut self.outcome,
            &mut self.azimuth,
            &mut self.medium,
        ]
    }

    /// The variates of one ray.
    pub(super) fn get(&self, lane: usize) -> [f64; 4] {
        [self.flight, self.outcome, self.azimuth, self.medium].map(|v| v.as_array()[lane])
    }

    /// Sets these.
    pub(super) fn set(&mut self, lane: usize, [flight, outcome, azimuth, medium]: [f64; 4]) {
        self.flight.as_mut_array()[lane] = flight;
        self.outcome.as_mut_array()[lane] = outcome;
        self.azimuth.as_mut_array()[lane] = azimuth;
        self.medium.as_mut_array()[lane] = medium;
    }
}

/// A flight, not yet ended by a grain.
#[derive(Debug, Clone, Copy)]
pub(super) struct Flight {
    pub(super) length_m: f64x8,
    /// Depth of its end, m.
    pub(super) end_m: f64x8,
    /// All ones where it passes through water.
    pub(super) wet: f64x8,
    /// Positions of the types of grain in their layers.
    kinds: [usize; 8],
    outcomes: [u32; 8],
    pub(super) size_m: f64x8,
    sin: f64x8,
    cos: f64x8,
    /// Sine of the ray's angle from the vertical.
    across: f64x8,
}

impl TableSnowpack<'_> {
    /// Flights of the rays, all through the layers they begin in, and the
    /// grains that wait at their ends.
    #[inline(always)]
    pub(super) fn fly(&self, rays: &Rays, variates: &Variates) -> Flight {
        let first = &self.strata[0];
        let [mut distance_m, mut saturation] =
            [first.mean_free_distance_m, first.water_saturation].map(f64x8::splat);
        let [min, max] = first.kinds[0].size_m;
        let (mut smallest_m, mut range_m) = (f64x8::splat(min), f64x8::splat(max - min));
        let mut entries = f64x8::splat(first.kinds[0].tables[0].len() as f64);
        let mut kinds = [0; 8];
        let mut choice = variates.outcome;
        if !self.is_plain() {
            for (lane, chosen) in kinds.iter_mut().enumerate() {
                let stratum = &self.strata[rays.stratum[lane]];
                distance_m.as_mut_array()[lane] = stratum.mean_free_distance_m;
                saturation.as_mut_array()[lane] = stratum.water_saturation;
                let u = choice.as_array()[lane];
                let others = &stratum.kinds[1..];
                *chosen = others.partition_point(|kind| kind.chance[0] <= u);
                let kind = &stratum.kinds[*chosen];
                let [before, share] = kind.chance;
                // what is left of the variate, kept below 1 against rounding
                let rest = ((u - before) / share).clamp(0.0, 1.0 - f64::EPSILON);
                choice.as_mut_array()[lane] = rest;
                let [min, max] = kind.size_m;
                smallest_m.as_mut_array()[lane] = min;
                range_m.as_mut_array()[lane] = max - min;
                entries.as_mut_array()[lane] = kind.tables[0].len() as f64;
            }
        }
        let length_m = -ln(f64x8::ONE - variates.flight) * distance_m;
        let wet = variates.medium.simd_lt(saturation);
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
            size_m: f64x8::new(rest) * range_m + smallest_m,
            sin,
            cos,
            across: (f64x8::ONE - rays.mu * rays.mu)
                .fast_max(f64x8::ZERO)
                .sqrt(),
        }
    }

    /// The first `N` columns of the outcomes waiting, of `rows` in air and in water.
    #[inline(always)]
    fn gather<const N: usize>(
        &self,
        rays: &Rays,
        flight: &Flight,
        rows: impl Fn(&Table) -> &[[f32; 8]],
    ) -> [f64x8; N] {
        let mut columns = [[0.0; 8]; N];
        let plain = self.is_plain();
        let first = &self.strata[0].kinds[0].tables;
        let [air, water] = first.map(&rows);
        let wet = if self.wet { flight.wet.to_bitmask() } else { 0 };
        for lane in 0..8 {
            let in_water = wet >> lane & 1 == 1;
            let rows = if plain {
                if in_water { water } else { air }
            } else {
                let kind = &self.strata[rays.stratum[lane]].kinds[flight.kinds[lane]];
                rows(kind.tables[usize::from(in_water)])
            };
            let row = &rows[flight.outcomes[lane] as usize];
            for (column, value) in columns.iter_mut().zip(row) {
                column[lane] = f64::from(*value);
            }
        }
        columns.map(f64x8::new)
    }

    /// Depths of the highest and lowest points of the grains waiting, m.
    #[inline(always)]
    pub(super) fn extent_m(&self, rays: &Rays, flight: &Flight) -> [f64x8; 2] {
        let [x, y, along, numbers @ ..] = self.gather::<8>(rays, flight, |table| &table.bodies);
        let mut forms = [self.strata[0].kinds[0].tables[0].form; 8];
        if !self.is_plain() {
            for (lane, form) in forms.iter_mut().enumerate() {
                let stratum = &self.strata[rays.stratum[lane]];
                *form = stratum.kinds[flight.kinds[lane]].tables[0].form;
            }
        }
        let down = |[x, y, along]: [f64x8; 3]| flight.vertical(rays.mu, along, x, y);
        let centre = down([x, y, along]);
        let half = f64x8::splat(0.5) * Bodies::new(forms, numbers).half_height(down);
        [centre - half, centre + half].map(|v| flight.end_m + flight.size_m * v)
    }

    /// The grain events of the lanes set in `met`.
    #[inline(always)]
    pub(super) fn scatter(&self, rays: &mut Rays, flight: &Flight, met: f64x8) {
        let [c, s, along, x, y, ice] = self.gather(rays, flight, |table| &table.motions);
        let moved = flight.vertical(rays.mu, along, x, y);
        let turned = flight.vertical(rays.mu, c, s, f64x8::ZERO);
        rays.z_m = met.select(flight.end_m + flight.size_m * moved, rays.z_m);
        rays.mu = met.select(turned.fast_max(-f64x8::ONE).fast_min(f64x8::ONE), rays.mu);
        let ice_m = (flight.size_m * ice) & met;
        rays.ice_m += ice_m;
        if self.sooty {
            self.collect(rays, ice_m, |stratum| &stratum.in_ice);
        }
    }

    /// Goes `length_m` on through the pores, where that is not 0.
    #[inline(always)]
    pub(super) fn pass(&self, rays: &mut Rays, flight: &Flight, length_m: f64x8) {
        if self.wet {
            rays.water_m += length_m & flight.wet;
        }
        if self.sooty {
            self.collect(rays, length_m, |stratum| &stratum.in_pores);
        }
    }

    #[inline(always)]
    fn collect(
        &self,
        rays: &mut Rays,
        length_m: f64x8,
        of: for<'s> fn(&'s TableLayer) -> &'s [f64; EXPONENTS],
    ) {
        for lane in lanes(0xff) {
            let per_m = of(&self.strata[rays.stratum[lane]]);
            let length_m = length_m.as_array()[lane];
            // a ray lost in a grain has no end of path
            if length_m > 0.0 && length_m.is_finite() {
                for (all, per_m) in rays.impurities.iter_mut().zip(per_m) {
                    all.as_mut_array()[lane] += per_m * length_m;
                }
            }
        }
    }
}

impl Flight {
    /// Downward component of a vector given along the ray and across it.
    #[inline(always)]
    fn vertical(&self, mu: f64x8, along: f64x8, x: f64x8, y: f64x8) -> f64x8 {
        mu * along + self.across * (self.cos * x + self.sin * y)
    }
}
