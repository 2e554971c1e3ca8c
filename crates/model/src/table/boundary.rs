//! Walks near planes: near the surface, below which grains must fit, and near the
//! planes between layers, across which grains carry light.
//!
//! Rays enter a region from outside or from the adjoining snow. They leave it through a
//! plane of the snowpack or through an open side; at an open side the Legendre moments
//! of their direction are scored. Grains that would cross a plane of the snowpack are
//! rejected as in any walk. An open side is not a plane of the snowpack and rejects no
//! grains. A slab too thin to have an interior is walked from plane to plane.
//!
//! Walks past planes at which light is counted go one ray after the other. Their first grain events
//! use points of a lattice instead of random numbers. All other walks go generation by generation
//! ([`super::population`]).
use serde::{Deserialize, Serialize};
use splitsnow_spectra::simd::{F64x8, Simd, SimdKernel, dispatch};

use crate::math::{legendre, set_lanes};
use crate::rng::Stream;
use crate::table::follow::Follower;
use crate::table::lattice::Lattice;
use crate::table::population::Generations;
use crate::table::rays::{Ray, Variates};
use crate::table::step::{Steps, Stuck};
use crate::table::{Histogram, TableSnowpack};
use crate::transport::{Planes, WalkError};

/// Number of grain events per ray that use the lattice.
const LATTICE_EVENTS: usize = 5;

/// What lies at the upper or lower end of a region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Edge {
    /// More snow.
    Open,
    /// A plane of the snowpack: grains must not cross it, and rays leave.
    Plane,
}

/// The source of the rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Source {
    /// From outside, at this cosine of the incidence angle.
    Above(f64),
    /// Isotropic radiance from outside.
    Diffuse,
    /// From the snow below the region, at this cosine from straight up.
    Below(f64),
    /// From the snow above the region, at this cosine from straight down.
    Over(f64),
}

/// A region of snow next to planes.
#[derive(Debug, Clone)]
pub struct BoundaryRegion<'a> {
    /// The snow.
    pub snowpack: TableSnowpack<'a>,
    /// Thickness, m.
    pub thickness_m: f64,
    /// Its upper and lower ends.
    pub edges: [Edge; 2],
    /// Planes at which light is counted; depths from its upper end.
    pub planes: Planes,
}

/// Scores of the rays that left a region.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Scores {
    /// Rays that left upward: P_l(2 mu - 1) for l = 0, 1, ..., where mu is the cosine from
    /// straight up. Only l = 0 if the snowpack ends there.
    pub out: Histogram,
    /// Rays that left downward: the same, with mu the cosine from straight down.
    pub through: Histogram,
    /// Crossings of each plane, downward and then upward: the number, and the actinic flux.
    pub crossings: Vec<Histogram>,
    /// Number of rays started.
    pub rays: u64,
}

impl Scores {
    /// Bytes on the heap.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let crossings = self.crossings.iter().map(Histogram::bytes);
        self.out.bytes() + self.through.bytes() + crossings.sum::<usize>()
    }

    /// Frees the memory reserved for more rays.
    pub fn shrink(&mut self) {
        self.out.shrink();
        self.through.shrink();
        self.crossings.iter_mut().for_each(Histogram::shrink);
    }

    /// Adds the scores of other rays from the same source.
    pub fn merge(&mut self, other: &Self) {
        self.out.merge(&other.out);
        self.through.merge(&other.through);
        let pairs = self.crossings.iter_mut().zip(&other.crossings);
        pairs.for_each(|(ours, theirs)| ours.merge(theirs));
        self.rays += other.rays;
    }
}

impl BoundaryRegion<'_> {
    /// Walks `rays` rays from `source` until they leave. Scores `moments` moments of the
    /// rays that leave downward, and of those that leave upward through an open side.
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
        if self.planes.is_empty() {
            return dispatch(Generations {
                region: self,
                source,
                rays,
                moments,
                rng,
            });
        }
        dispatch(FollowedWalks {
            region: self,
            source,
            rays,
            moments,
            rng,
        })
    }
}

/// Draws the length of a flight in a layer, m.
#[inline(always)]
fn flight_m<S: Simd>(snowpack: &TableSnowpack, layer: usize, rng: &mut Stream<S>) -> f64 {
    snowpack.layers[layer].mean_free_distance_m * rng.exponential().as_array()[0]
}

/// The walks of [`BoundaryRegion::walk`] past planes at which light is counted, one ray after the
/// other, as a SIMD kernel.
struct FollowedWalks<'a> {
    region: &'a BoundaryRegion<'a>,
    source: Source,
    rays: u64,
    moments: usize,
    rng: Stream,
}

impl SimdKernel for FollowedWalks<'_> {
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
        let BoundaryRegion {
            snowpack,
            thickness_m,
            edges,
            planes,
        } = region;
        let (thickness_m, open) = (*thickness_m, edges.map(|edge| edge == Edge::Open));
        let [open_above, open_below] = open;
        let above = if open_above { moments } else { 1 };
        let per_event = if snowpack.wet { 4 } else { 3 };
        let mut lattice = Lattice::new(per_event * LATTICE_EVENTS, &mut rng);
        let scale_m = snowpack.longest_m();
        let mut scores = Scores {
            out: Histogram::new(scale_m, snowpack.tracers, above),
            through: Histogram::new(scale_m, snowpack.tracers, moments),
            crossings: Vec::new(),
            rays,
        };
        let mut follower = Follower::new(planes, snowpack);
        let (one, zero) = (F64x8::<S>::ONE, F64x8::ZERO);
        let last = snowpack.layers.len() - 1;
        let mut steps = Steps::new(snowpack, open);
        steps.follows = true;
        let mut queue: [[F64x8<S>; LATTICE_EVENTS]; 4] = [[zero; LATTICE_EVENTS]; 4];
        let mut queued = zero;
        let mut started = 0;
        let mut scored = vec![0.0; moments];
        let mut walking = 0xff;
        let mut ended = 0xff;
        loop {
            for lane in set_lanes(ended) {
                if started == rays {
                    walking &= !(1 << lane);
                    continue;
                }
                let entries = queue.iter_mut().take(per_event).flatten();
                for (entry, coordinate) in entries.zip(lattice.next()) {
                    entry.as_mut_array()[lane] = coordinate;
                }
                queued.as_mut_array()[lane] = LATTICE_EVENTS as f64;
                // A ray from the adjoining snow is in flight from a point beyond the
                // region, and returns there if its grain does not fit. Its path in the
                // pores counts from there, because absorbing pores make a ray less
                // likely to arrive.
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
                follower.start(lane, source != Source::Diffuse);
                started += 1;
            }
            if walking == 0 {
                scores.crossings = follower.into_crossings();
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
            let before = steps.rays;
            let stepped = steps
                .step(&mut variates, walking, |_, _, _| {})
                .map_err(|Stuck(_)| WalkError::TooThin { thickness_m })?;
            follower.step(&before, &steps, &stepped, walking);
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
            for lane in set_lanes(ended & !stepped.lost) {
                let Ray { mu, path, .. } = steps.rays.get(lane);
                let (histogram, moments) = match up >> lane & 1 {
                    1 => (&mut scores.out, above),
                    _ => (&mut scores.through, moments),
                };
                legendre(2.0 * mu.abs() - 1.0, &mut scored[..moments]);
                histogram.add(&path, &scored[..moments]);
            }
        }
    }
}
