//! Eight rays side by side between grains drawn from tables: their depths and
//! the cosines of their directions. In a horizontal slab nothing else matters.
use wide::f64x8;

use crate::math::ln;
use crate::rng::{Stream, azimuth};
use crate::table::Table;
use crate::transport::{Snow, diffuse_cosine};

/// Snow whose grains are drawn from tables.
#[derive(Debug, Clone, Copy)]
pub struct TableSnow<'a> {
    /// Outcomes of grains in air and (in wet snow) in water.
    pub tables: [&'a Table; 2],
    /// Mean free distance between grains, m.
    pub mean_free_distance_m: f64,
    /// Fraction of the pore space that is water.
    pub water_saturation: f64,
    /// Smallest and largest grain, m.
    pub size_m: [f64; 2],
}

impl<'a> TableSnow<'a> {
    /// `snow` with the outcomes of its grains in air and in water.
    #[must_use]
    pub fn new(snow: &Snow, tables: [&'a Table; 2]) -> Self {
        Self {
            tables,
            mean_free_distance_m: snow.mean_free_distance_m(),
            water_saturation: snow.water_saturation,
            size_m: snow.sizes_m(),
        }
    }

    /// See [`diffuse_cosine`].
    pub(super) fn diffuse_cosine(&self, u: f64) -> f64 {
        diffuse_cosine(u, self.mean_free_distance_m, self.size_m[1])
    }
}

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
}

impl Rays {
    /// Depth, cosine, paths in ice and in water of one ray.
    pub(super) fn get(&self, lane: usize) -> [f64; 4] {
        [self.z_m, self.mu, self.ice_m, self.water_m].map(|v| v.as_array()[lane])
    }

    /// Sets these.
    pub(super) fn set(&mut self, lane: usize, [z_m, mu, ice_m, water_m]: [f64; 4]) {
        self.z_m.as_mut_array()[lane] = z_m;
        self.mu.as_mut_array()[lane] = mu;
        self.ice_m.as_mut_array()[lane] = ice_m;
        self.water_m.as_mut_array()[lane] = water_m;
    }
}

/// Uniform variates of a flight and the grain at its end.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Variates {
    pub(super) flight: f64x8,
    /// Chooses the outcome, and what remains of it the size.
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
}

impl Variates {
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
    outcomes: [u32; 8],
    pub(super) size_m: f64x8,
    sin: f64x8,
    cos: f64x8,
    /// Sine of the ray's angle from the vertical.
    across: f64x8,
}

impl TableSnow<'_> {
    /// Flights of the rays and the grains that wait at their ends.
    #[inline(always)]
    pub(super) fn fly(&self, rays: &Rays, variates: &Variates) -> Flight {
        let length_m = -ln(f64x8::ONE - variates.flight) * f64x8::splat(self.mean_free_distance_m);
        let wet = variates.medium.simd_lt(f64x8::splat(self.water_saturation));
        let mut outcomes = [0; 8];
        let mut rest = [0.0; 8];
        let scaled = variates.outcome * f64x8::splat(self.tables[0].len() as f64);
        for (lane, scaled) in scaled.as_array().iter().enumerate() {
            outcomes[lane] = *scaled as u32;
            rest[lane] = scaled - f64::from(outcomes[lane]);
        }
        let [min, max] = self.size_m;
        let (sin, cos) = azimuth(variates.azimuth);
        Flight {
            length_m,
            end_m: rays.z_m + length_m * rays.mu,
            wet,
            outcomes,
            size_m: f64x8::new(rest) * f64x8::splat(max - min) + f64x8::splat(min),
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
        flight: &Flight,
        rows: impl Fn(&Table) -> &[[f32; 8]],
    ) -> [f64x8; N] {
        let mut columns = [[0.0; 8]; N];
        let [air, water] = self.tables.map(rows);
        let wet = if self.water_saturation > 0.0 {
            flight.wet.to_bitmask()
        } else {
            0
        };
        for lane in 0..8 {
            let rows = if wet >> lane & 1 == 1 { water } else { air };
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
        let [x, y, along, ax, ay, az, flattening] = self.gather(flight, |table| &table.bodies);
        let centre = flight.vertical(rays.mu, along, x, y);
        let axis = flight.vertical(rays.mu, az, ax, ay);
        let square = f64x8::ONE + flattening * (f64x8::ONE - axis * axis);
        let half = f64x8::splat(0.5) * square.fast_max(f64x8::ZERO).sqrt();
        [centre - half, centre + half].map(|v| flight.end_m + flight.size_m * v)
    }

    /// The grain events of the lanes set in `lanes`.
    #[inline(always)]
    pub(super) fn scatter(&self, rays: &mut Rays, flight: &Flight, lanes: f64x8) {
        let [c, s, along, x, y, ice] = self.gather(flight, |table| &table.motions);
        let moved = flight.vertical(rays.mu, along, x, y);
        let turned = flight.vertical(rays.mu, c, s, f64x8::ZERO);
        rays.z_m = lanes.select(flight.end_m + flight.size_m * moved, rays.z_m);
        rays.mu = lanes.select(turned.fast_max(-f64x8::ONE).fast_min(f64x8::ONE), rays.mu);
        rays.ice_m += (flight.size_m * ice) & lanes;
        rays.water_m += flight.length_m & (lanes & flight.wet);
    }
}

impl Flight {
    /// Downward component of a vector given along the ray and across it.
    #[inline(always)]
    fn vertical(&self, mu: f64x8, along: f64x8, x: f64x8, y: f64x8) -> f64x8 {
        mu * along + self.across * (self.cos * x + self.sin * y)
    }
}
