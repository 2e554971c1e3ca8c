//! Walks next to planes: the surface, where grains must fit under it, and those
//! between layers, across which grains carry light.
//!
//! Rays enter a region from outside or from the snow beyond it, and leave it
//! through a plane of the snowpack or, going away, through an open side, where they
//! are handed over with the Legendre moments of their direction. Grains that would
//! cross a plane of the snowpack are rejected as in any walk; an open side is no plane
//! of the snow and rejects none. A slab too thin to have an inside is walked from
//! plane to plane.
//!
//! The first grain events of a ray use points of a lattice instead of random
//! numbers (a Kronecker sequence after Roberts 2018, shifted at random), which
//! cover the unit cube evenly and so leave less to chance.
use serde::{Deserialize, Serialize};
use splitsnow_spectra::simd::{F64x8, Kernel, Simd, dispatch};

use crate::math::legendre;
use crate::rng::Stream;
use crate::table::rays::{Ray, Variates};
use crate::table::step::{Steps, Stuck};
use crate::table::{Histogram, TableSnowpack, lanes};
use crate::transport::WalkError;

/// Grain events that draw on the lattice.
const LATTICE_EVENTS: usize = 5;

/// How a region ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Edge {
    /// Snow goes on.
    Open,
    /// The snowpack ends: grains must not cross, and rays leave.
    Plane,
}

/// Where rays come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Source {
    /// Outside, at this cosine from the normal.
    Above(f64),
    /// Outside, isotropic radiance.
    Diffuse,
    /// The snow below the region, at this cosine from straight up.
    Below(f64),
    /// The snow over the region, at this cosine from straight down.
    Over(f64),
}

/// The snow next to planes.
#[derive(Debug, Clone)]
pub struct Region<'a> {
    /// The snow.
    pub snowpack: TableSnowpack<'a>,
    /// Thickness, m.
    pub thickness_m: f64,
    /// How it ends above and below.
    pub edges: [Edge; 2],
}

/// Where rays went.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Scores {
    /// Rays that left above: P_l(2 mu - 1) for l = 0, 1, ..., with mu the cosine from
    /// straight up; where the snowpack ends, l = 0 only.
    pub out: Histogram,
    /// Rays that left below: the same, with mu the cosine from straight down.
    pub through: Histogram,
    /// Rays started.
    pub rays: u64,
}

impl Scores {
    /// Bytes on the heap.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.out.bytes() + self.through.bytes()
    }

    /// Gives back the memory that more rays would have needed.
    pub fn shrink(&mut self) {
        self.out.shrink();
        self.through.shrink();
    }

    /// Adds those of other rays from the same source.
    pub fn merge(&mut self, other: &Self) {
        self.out.merge(&other.out);
        self.through.merge(&other.through);
        self.rays += other.rays;
    }
}

/// Steps of the lattice: powers of 1/phi with phi the root of x^(d+1) = x + 1,
/// in units of 2^-64.
fn steps(dimensions: usize) -> Vec<u64> {
    let d = dimensions as f64;
    let mut phi = 1.5_f64;
    for _ in 0..64 {
        phi = libm::pow(1.0 + phi, 1.0 / (d + 1.0));
    }
    let step = |j| (libm::pow(phi, -f64::from(j)) % 1.0 * 18_446_744_073_709_551_616.0) as u64;
    (1..=dimensions as u32).map(step).collect()
}

/// Points of the shifted lattice, one after another.
struct Lattice {
    step: Vec<u64>,
    point: Vec<u64>,
}

impl Lattice {
    fn new<S: Simd>(dimensions: usize, rng: &mut Stream<S>) -> Self {
        let random = |_| (rng.uniform().as_array()[0] * 18_446_744_073_709_551_616.0) as u64;
        Self {
            step: steps(dimensions),
            point: (0..dimensions).map(random).collect(),
        }
    }

    /// The coordinates of the next point, in [0, 1).
    #[inline(always)]
    fn next(&mut self) -> impl Iterator<Item = f64> {
        let steps = self.point.iter_mut().zip(&self.step);
        steps.map(|(point, step)| {
            *point = point.wrapping_add(*step);
            f64::from_bits(*point >> 12 | 0x3ff0_0000_0000_0000) - 1.0
        })
    }
}

impl Region<'_> {
    /// Walks `rays` rays from `source` until they leave and scores `moments`
    /// moments of those that leave below, and through an open side above.
    ///
    /// # Errors
    /// [`WalkError::TooThin`] if grains do not fit.
    pub fn walk(
        &self,
        source: Source,
        rays: u64,
        moments: usize,
        rng: Stream,
    ) -> Result<Scores, WalkError> {
        dispatch(Walks {
            region: self,
            source,
            rays,
            moments,
            rng,
        })
    }
}

/// Length of a flight in a layer, m.
#[inline(always)]
fn flight_m<S: Simd>(snowpack: &TableSnowpack, stratum: usize, rng: &mut Stream<S>) -> f64 {
    snowpack.strata[stratum].mean_free_distance_m * rng.exponential().as_array()[0]
}

/// The walks of [`Region::walk`].
struct Walks<'a> {
    region: &'a Region<'a>,
    source: Source,
    rays: u64,
    moments: usize,
    rng: Stream,
}

impl Kernel for Walks<'_> {
    type Output = Result<Scores, WalkError>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let Self {
            region,
            source,
            rays,
            moments,
            rng,
        } = self;
        let mut rng: Stream<S> = rng.on();
        let Region {
            snowpack,
            thickness_m,
            edges,
        } = region;
        let (thickness_m, open) = (*thickness_m, edges.map(|edge| edge == Edge::Open));
        let [open_above, open_below] = open;
        let above = if open_above { moments } else { 1 };
        let per_event = if snowpack.wet { 4 } else { 3 };
        let mut lattice = Lattice::new(per_event * LATTICE_EVENTS, &mut rng);
        let scale_m = snowpack.longest_m();
        let mut scores = Scores {
            out: Histogram::new(scale_m, snowpack.exponents, above),
            through: Histogram::new(scale_m, snowpack.exponents, moments),
            rays,
        };
        let (one, zero) = (F64x8::<S>::ONE, F64x8::ZERO);
        let last = snowpack.strata.len() - 1;
        let mut steps = Steps::new(snowpack, open);
        let mut queue: [[F64x8<S>; LATTICE_EVENTS]; 4] = [[zero; LATTICE_EVENTS]; 4];
        let mut queued = zero;
        let mut started = 0;
        let mut scored = vec![0.0; moments];
        let mut walking = 0xff;
        let mut ended = 0xff;
        loop {
            for lane in lanes(ended) {
                if started == rays {
                    walking &= !(1 << lane);
                    continue;
                }
                let places = queue.iter_mut().take(per_event).flatten();
                for (place, coordinate) in places.zip(lattice.next()) {
                    place.as_mut_array()[lane] = coordinate;
                }
                queued.as_mut_array()[lane] = LATTICE_EVENTS as f64;
                // A ray from beyond is on a flight that began there: where it comes
                // back to if its grain does not fit. Its path in the pores counts
                // from there: what crosses pores that absorb is the less likely to
                // have arrived.
                let mut behind_m = 0.0;
                let (z_m, mu) = match source {
                    Source::Above(mu) => (0.0, mu),
                    Source::Diffuse => {
                        let u = (started as f64 + rng.uniform().as_array()[0]) / rays as f64;
                        (0.0, snowpack.diffuse_cosine(u))
                    }
                    Source::Below(mu) => {
                        behind_m = flight_m(snowpack, last, &mut rng);
                        (thickness_m + mu * behind_m, -mu)
                    }
                    Source::Over(mu) => {
                        behind_m = flight_m(snowpack, 0, &mut rng);
                        (-mu * behind_m, mu)
                    }
                };
                let ray = Ray {
                    z_m,
                    mu,
                    ..Ray::default()
                };
                steps.start(lane, &ray, thickness_m);
                steps.flown_m.as_mut_array()[lane] = behind_m;
                started += 1;
            }
            if walking == 0 {
                return Ok(scores);
            }
            let mut variates = Variates::draw(snowpack.wet, &mut rng);
            let on_lattice = queued.gt(zero);
            if on_lattice.any() {
                for (variate, queue) in variates
                    .all_mut()
                    .into_iter()
                    .zip(&mut queue)
                    .take(per_event)
                {
                    *variate = on_lattice.select(queue[0], *variate);
                    queue.rotate_left(1);
                }
                queued -= one & on_lattice;
            }
            let stepped = steps
                .step(&mut variates, walking, |_, _, _| {})
                .map_err(|Stuck(_)| WalkError::TooThin { thickness_m })?;
            let (mut up, mut down) = (stepped.above, stepped.below);
            let rays = &steps.rays;
            if open_above {
                let over = rays.z_m.lt(zero) & rays.mu.lt(zero);
                up |= over.to_bitmask() & stepped.met;
            }
            if open_below {
                let under = rays.z_m.gt(F64x8::splat(thickness_m)) & rays.mu.gt(zero);
                down |= under.to_bitmask() & stepped.met;
            }
            ended = (up | down | stepped.lost) & walking;
            for lane in lanes(ended & !stepped.lost) {
                let Ray { mu, path, .. } = steps.rays.get(lane);
                let (to, moments) = match up >> lane & 1 {
                    1 => (&mut scores.out, above),
                    _ => (&mut scores.through, moments),
                };
                legendre(2.0 * mu.abs() - 1.0, &mut scored[..moments]);
                to.add(&path, &scored[..moments]);
            }
        }
    }
}
