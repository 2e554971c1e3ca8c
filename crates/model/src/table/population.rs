//! Walks of many rays next to a boundary, generation by generation: the scores of
//! [`BoundaryRegion::walk`], with less variance than walks one by one.
//!
//! Two methods of variance reduction leave the mean as it is:
//!
//! - **Forced collisions.** A ray scores the probability p that its next flight leaves the region, and
//!   collides inside with 1 - p of its weight. Russian roulette by systematic sampling
//!   replaces rays of little weight by fewer with the same total weight.
//! - **Sorted rays.** Each generation is sorted by direction and depth. The variates of
//!   neighbours are successive points of a lattice, so rays in similar states have variates that are
//!   spread evenly (array-RQMC: L'Ecuyer, Lecot and Tuffin, Oper. Res. 56(4), 2008).
//!
//! Lengths are in metres. A weight is a number of rays: the weights of the rays that leave, with
//! those lost in grains, sum to the number of rays, to rounding. Rays of one walk depend on each
//! other, so standard errors need independent walks. Light is not counted at planes inside the
//! region; [`super::boundary`] does that.
use splitsnow_spectra::simd::{F64x8, Simd, SimdKernel, U64x8};

use super::boundary::{BoundaryRegion, Edge, Scores, Source};
use crate::math::{DEGREES, legendre_lanes, set_lanes};
use crate::rng::Stream;
use crate::table::lattice::Lattice;
use crate::table::rays::{Ray, Rays, Variates};
use crate::table::step::{Leaving, Steps, Stuck};
use crate::table::{Histogram, TableSnowpack};
use crate::transport::{REJECTION_LIMIT, WalkError};

/// Rays of less weight, relative to that at the start, undergo Russian roulette.
const ROULETTE_WEIGHT: f64 = 0.5;
/// So few rays walk on without forced collisions, so that they leave.
const FEW: usize = 8;
/// Collisions are not forced where leaving is less probable: that costs more than it gains.
const LEAST_CHANCE: f64 = 0.05;
/// Binary logarithm of the largest number of classes of directions, and of depths.
const MOST_CLASS_BITS: u32 = 7;

/// Rays at the starts of their flights, one column for each quantity.
#[derive(Debug)]
struct Population {
    len: usize,
    z_m: Vec<f64>,
    mu: Vec<f64>,
    weight: Vec<f64>,
    ice_m: Vec<f64>,
    /// Places in the order of the next generation.
    class: Vec<u32>,
    /// In wet snow, else empty.
    water_m: Vec<f64>,
    /// One column for each sum over impurities.
    impurities: Vec<Vec<f64>>,
    /// In snow of several layers, else empty.
    layered: Vec<Layered>,
}

/// What else a ray carries in snow of several layers.
#[derive(Debug, Clone, Copy, Default)]
struct Layered {
    layer: usize,
    /// The ray at the start of its flight and the variate of its medium, if the flight has been cut
    /// at a plane between layers.
    cut: Option<(Ray, f64)>,
}

impl Population {
    /// No rays, and space for `rays`.
    fn new(snowpack: &TableSnowpack, rays: usize) -> Self {
        // vectors of eight are read and written beyond the last ray
        let space = rays + 8;
        let column = || vec![0.0; space];
        let only_if = |is: bool| if is { space } else { 0 };
        Self {
            len: 0,
            z_m: column(),
            mu: column(),
            weight: column(),
            ice_m: column(),
            class: vec![0; space],
            water_m: vec![0.0; only_if(snowpack.wet)],
            impurities: vec![column(); snowpack.tracers],
            layered: vec![Layered::default(); only_if(snowpack.layers.len() > 1)],
        }
    }

    /// Puts eight rays from number `first` on into the lanes of `steps`, and returns their weights.
    #[inline(always)]
    fn load<S: Simd>(&self, first: usize, steps: &mut Steps<S>) -> F64x8<S> {
        let rays = &mut steps.rays;
        rays.z_m = eight(&self.z_m, first);
        rays.mu = eight(&self.mu, first);
        rays.ice_m = eight(&self.ice_m, first);
        if !self.water_m.is_empty() {
            rays.water_m = eight(&self.water_m, first);
        }
        for (lanes, column) in rays.impurities.iter_mut().zip(&self.impurities) {
            *lanes = eight(column, first);
        }
        steps.forget();
        if !self.layered.is_empty() {
            for (lane, state) in self.layered[first..first + 8].iter().enumerate() {
                steps.rays.layer[lane] = state.layer;
                if let Some((origin, medium)) = &state.cut {
                    steps.cut_at(lane, origin, *medium);
                }
            }
        }
        eight(&self.weight, first)
    }

    /// Appends the rays of the lanes set in `mask`.
    #[inline(always)]
    fn append<S: Simd>(&mut self, steps: &Steps<S>, weight: F64x8<S>, class: U64x8<S>, mask: u32) {
        let rays = &steps.rays;
        let first = self.len;
        let mut kept = [0_usize; 8];
        for (lane, place) in kept.iter_mut().enumerate() {
            *place = self.len;
            self.len += (mask >> lane & 1) as usize;
        }
        // a lane that is not set is written over
        for (place, class) in kept.iter().zip(class.as_array()) {
            self.class[*place] = *class as u32;
        }
        for (column, lanes) in [
            (&mut self.z_m, rays.z_m),
            (&mut self.mu, rays.mu),
            (&mut self.weight, weight),
            (&mut self.ice_m, rays.ice_m),
        ] {
            scatter(&mut column[first..first + 8], lanes, &kept, first);
        }
        if !self.water_m.is_empty() {
            scatter(
                &mut self.water_m[first..first + 8],
                rays.water_m,
                &kept,
                first,
            );
        }
        for (column, lanes) in self.impurities.iter_mut().zip(rays.impurities) {
            scatter(&mut column[first..first + 8], lanes, &kept, first);
        }
        if !self.layered.is_empty() {
            for lane in set_lanes(mask) {
                self.layered[kept[lane]] = Layered {
                    layer: rays.layer[lane],
                    cut: steps.cut_of(lane),
                };
            }
        }
    }

    /// Becomes the rays of `other` in this order.
    fn reorder(&mut self, other: &Self, order: &[u32]) {
        self.len = order.len();
        let ours = [
            &mut self.z_m,
            &mut self.mu,
            &mut self.weight,
            &mut self.ice_m,
        ];
        let theirs = [&other.z_m, &other.mu, &other.weight, &other.ice_m];
        let few = ours.into_iter().zip(theirs);
        let impurities = self.impurities.iter_mut().zip(&other.impurities);
        for (ours, theirs) in few.chain(impurities) {
            take(ours, theirs, order);
        }
        if !self.water_m.is_empty() {
            take(&mut self.water_m, &other.water_m, order);
        }
        if !self.layered.is_empty() {
            take(&mut self.layered, &other.layered, order);
        }
    }
}

/// Copies `values` in this order.
#[inline(always)]
fn take<T: Copy>(to: &mut [T], values: &[T], order: &[u32]) {
    for (to, i) in to.iter_mut().zip(order) {
        *to = values[*i as usize];
    }
}

/// Eight numbers of `column` from number `first` on.
#[inline(always)]
fn eight<S: Simd>(column: &[f64], first: usize) -> F64x8<S> {
    let mut lanes = [0.0; 8];
    lanes.copy_from_slice(&column[first..first + 8]);
    F64x8::new(lanes)
}

/// Writes `lanes` to the places `kept`, less `first`.
#[inline(always)]
fn scatter<S: Simd>(column: &mut [f64], lanes: F64x8<S>, kept: &[usize; 8], first: usize) {
    for (place, value) in kept.iter().zip(lanes.as_array()) {
        column[(place - first) & 7] = *value;
    }
}

/// The order of the rays of a generation.
#[derive(Debug, Default)]
struct Sorter {
    /// Binary logarithm of the numbers of classes.
    class_bits: u32,
    /// Per class, the place of the next ray.
    places: Vec<u32>,
    order: Vec<u32>,
}

impl Sorter {
    /// Prepares for about `rays` rays: as many classes, half of them by direction, half by depth.
    fn start(&mut self, rays: usize) {
        self.class_bits = ((rays.max(1).ilog2()).div_ceil(2)).clamp(1, MOST_CLASS_BITS);
    }

    /// The classes of rays, whose depths are given in units of that of the region.
    #[inline(always)]
    fn classes<S: Simd>(&self, depth: F64x8<S>, mu: F64x8<S>) -> U64x8<S> {
        let bits = self.class_bits;
        let most = F64x8::splat(f64::from((1_u32 << bits) - 1));
        // added to this, a number is rounded to an integer
        let integers = F64x8::splat(4_503_599_627_370_496.0);
        let last = U64x8::splat((1 << bits) - 1);
        let half = F64x8::splat(0.5);
        let depth = depth.max(F64x8::ZERO).min(F64x8::ONE) * most;
        let strip = (mu * half + half) * most;
        let depth = (depth + integers).to_bits() & last;
        let strip = (strip + integers).to_bits() & last;
        // back and forth, so that neighbours in the order are neighbours in depth
        let back = (U64x8::ZERO - (strip & U64x8::ONE)) & last;
        (strip << bits) | (depth ^ back)
    }

    /// Sorts the rays by their classes.
    fn sort(&mut self, classes: &[u32]) {
        let Self {
            class_bits,
            places,
            order,
        } = self;
        places.clear();
        places.resize((1 << (2 * *class_bits)) + 1, 0);
        for class in classes {
            places[*class as usize + 1] += 1;
        }
        let mut sum = 0;
        for place in places.iter_mut() {
            sum += *place;
            *place = sum;
        }
        order.clear();
        order.resize(classes.len(), 0);
        for (i, class) in (0..).zip(classes) {
            let place = &mut places[*class as usize];
            order[*place as usize] = i;
            *place += 1;
        }
    }

    /// Russian roulette: replaces rays of little weight by fewer of the same total weight.
    fn thin<S: Simd>(&mut self, weights: &mut [f64], rng: &mut Stream<S>) {
        let (mut count, mut total) = (0_usize, 0.0);
        for weight in weights.iter().filter(|weight| **weight < ROULETTE_WEIGHT) {
            count += 1;
            total += weight;
        }
        if count == 0 {
            return;
        }
        let mut left = (total.round() as usize).clamp(1, count);
        let each = total / left as f64;
        let per_weight = 1.0 / each;
        let mut passed = rng.uniform().as_array()[0];
        self.order.retain(|i| {
            let weight = &mut weights[*i as usize];
            if *weight >= ROULETTE_WEIGHT {
                return true;
            }
            passed += *weight * per_weight;
            // despite rounding, as many are kept as there are to be
            let keep = left > 0 && (passed >= 1.0 || left == count);
            count -= 1;
            if keep {
                passed -= 1.0;
                left -= 1;
                *weight = each;
            }
            keep
        });
    }
}

/// Scores of the rays that leave upward and downward.
struct Ends<S: Simd> {
    sides: [Histogram; 2],
    moments: [usize; 2],
    basis: [F64x8<S>; DEGREES],
}

impl<S: Simd> Ends<S> {
    /// Scores the rays of the lanes set in `mask`, which leave downward where `down` is set.
    #[inline(always)]
    fn score(&mut self, rays: &Rays<S>, weight: F64x8<S>, mask: u32, down: u32) {
        let [up_moments, down_moments] = self.moments;
        let moments = if mask & down == 0 {
            up_moments
        } else {
            down_moments
        };
        let x = F64x8::splat(2.0) * rays.mu.abs() - F64x8::ONE;
        legendre_lanes(x, &mut self.basis[..moments]);
        let mut scores = [0.0; DEGREES];
        for lane in set_lanes(mask) {
            let side = (down >> lane & 1) as usize;
            let scores = &mut scores[..self.moments[side]];
            for (score, p) in scores.iter_mut().zip(&self.basis) {
                *score = p.as_array()[lane];
            }
            let Ray { path, .. } = rays.get(lane);
            self.sides[side].add_weighted(&path, weight.as_array()[lane], scores);
        }
    }
}

/// The walks of [`BoundaryRegion::walk`] as a SIMD kernel.
pub(super) struct Generations<'a> {
    pub(super) region: &'a BoundaryRegion<'a>,
    pub(super) source: Source,
    pub(super) rays: u64,
    pub(super) moments: usize,
    pub(super) rng: Stream,
}

impl SimdKernel for Generations<'_> {
    type Output = Result<Scores, WalkError>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let mut rng: Stream<S> = self.rng.clone().on();
        let BoundaryRegion {
            snowpack,
            thickness_m,
            edges,
            ..
        } = self.region;
        let thickness_m = *thickness_m;
        let [open_above, open_below] = edges.map(|edge| edge == Edge::Open);
        let moments = [if open_above { self.moments } else { 1 }, self.moments];
        let scale_m = snowpack.longest_m();
        let mut ends = Ends {
            sides: moments.map(|n| Histogram::new(scale_m, snowpack.tracers, n)),
            moments,
            basis: [F64x8::ZERO; DEGREES],
        };
        let (mut rays, mut flown_m) = self.sources(&mut rng);
        let mut next = Population::new(snowpack, rays.len);
        let mut sorter = Sorter::default();
        let dimensions = if snowpack.wet { 4 } else { 3 };
        let mut lattice = Lattice::new(dimensions, &mut rng);
        let (one, zero) = (F64x8::<S>::ONE, F64x8::<S>::ZERO);
        let (depth_m, per_m) = (F64x8::splat(thickness_m), F64x8::splat(1.0 / thickness_m));
        let mut steps = Steps::new(snowpack, [open_above, open_below]);
        steps.depth_m = depth_m;
        let mut fruitless = 0;
        while rays.len > 0 {
            let forced = rays.len > FEW;
            let mut is_fruitful = false;
            next.len = 0;
            sorter.start(rays.len);
            lattice.shift(&mut rng);
            for first in (0..rays.len).step_by(8) {
                let walking = 0xff >> (8 - (rays.len - first).min(8));
                let mut weight = rays.load(first, &mut steps);
                if !flown_m.is_empty() {
                    steps.flown_m = eight(&flown_m, first);
                }
                let mut variates = Variates {
                    medium: one,
                    ..Variates::default()
                };
                let all = variates.all_mut().into_iter().take(dimensions);
                for (dimension, variate) in all.enumerate() {
                    *variate = lattice.eight(dimension, first);
                }
                if forced {
                    let Leaving {
                        chance,
                        down,
                        length_m,
                    } = steps.leaving();
                    let leaving = chance.ge(F64x8::splat(LEAST_CHANCE));
                    let chance = chance & leaving;
                    let mask = leaving.to_bitmask() & walking;
                    let left = weight * chance;
                    if mask != 0 {
                        let mut ended = steps.rays;
                        if snowpack.wet || snowpack.sooty {
                            steps.pass_pores(&mut ended, &variates, length_m & leaving);
                        }
                        ends.score(&ended, left, mask, down);
                    }
                    weight -= left;
                    variates.flight *= one - chance;
                }
                let stepped = steps
                    .step(&mut variates, walking, |_, _, _| {})
                    .map_err(|Stuck(_)| WalkError::TooThin { thickness_m })?;
                let (mut up, mut down) = (stepped.above, stepped.below);
                if open_above {
                    let over = steps.rays.z_m.lt(zero) & steps.rays.mu.lt(zero);
                    up |= over.to_bitmask() & stepped.met;
                }
                if open_below {
                    let under = steps.rays.z_m.gt(depth_m) & steps.rays.mu.gt(zero);
                    down |= under.to_bitmask() & stepped.met;
                }
                is_fruitful |= walking & !stepped.rejected != 0;
                let out = (up | down) & walking & !stepped.lost;
                if out != 0 {
                    ends.score(&steps.rays, weight, out, down);
                }
                let stay = walking & !(up | down | stepped.lost);
                let class = sorter.classes(steps.rays.z_m * per_m, steps.rays.mu);
                next.append(&steps, weight, class, stay);
            }
            flown_m.clear();
            fruitless = if is_fruitful { 0 } else { fruitless + 1 };
            if fruitless == REJECTION_LIMIT {
                return Err(WalkError::TooThin { thickness_m });
            }
            sorter.sort(&next.class[..next.len]);
            sorter.thin(&mut next.weight[..next.len], &mut rng);
            rays.reorder(&next, &sorter.order);
        }
        let [out, through] = ends.sides;
        Ok(Scores {
            out,
            through,
            crossings: Vec::new(),
            rays: self.rays,
        })
    }
}

impl Generations<'_> {
    /// The rays at their starts, evenly spread, and the lengths that they have flown by then, m, if
    /// any.
    #[inline(always)]
    fn sources<S: Simd>(&self, rng: &mut Stream<S>) -> (Population, Vec<f64>) {
        let BoundaryRegion {
            snowpack,
            thickness_m,
            ..
        } = self.region;
        let count = self.rays as usize;
        let last = snowpack.layers.len() - 1;
        let mut rays = Population::new(snowpack, count);
        let mut flown_m = Vec::new();
        let offset = rng.uniform().as_array()[0];
        for i in 0..count {
            let u = (i as f64 + offset) / count as f64;
            // A ray from the adjoining snow is in flight from a point beyond the region, and
            // returns there if its grain does not fit. Its path in the pores counts from there,
            // because absorbing pores make a ray less likely to arrive.
            let mut behind_m = |layer: usize| {
                let distance_m = snowpack.layers[layer].mean_free_distance_m;
                flown_m.push(-libm::log(1.0 - u) * distance_m);
                flown_m[i]
            };
            (rays.z_m[i], rays.mu[i]) = match self.source {
                Source::Above(mu) => (0.0, mu),
                Source::Diffuse => (0.0, snowpack.diffuse_cosine(u)),
                Source::Below(mu) => (thickness_m + mu * behind_m(last), -mu),
                Source::Over(mu) => (-mu * behind_m(0), mu),
            };
        }
        if !flown_m.is_empty() {
            flown_m.resize(count + 8, 0.0);
        }
        rays.len = count;
        rays.weight[..count].fill(1.0);
        let from_below = matches!(self.source, Source::Below(_));
        for state in &mut rays.layered {
            state.layer = if from_below { last } else { 0 };
        }
        (rays, flown_m)
    }
}

#[cfg(test)]
mod tests {
    use splitsnow_spectra::simd::Portable;

    use super::*;
    use crate::rng::Key;

    #[test]
    fn sorted_rays_are_in_order_of_their_classes() {
        let mut sorter = Sorter::default();
        sorter.start(20);
        let classes = [9, 3, 3, 12, 0, 9, 3];
        sorter.sort(&classes);
        // rays of one class stay in their order
        assert_eq!(sorter.order, [4, 1, 2, 6, 0, 5, 3]);
    }

    #[test]
    fn neighbouring_classes_are_neighbours_in_depth() {
        let mut sorter = Sorter::default();
        sorter.start(16);
        assert_eq!(sorter.class_bits, 2);
        // the deepest ray of a strip of directions, and that of the next strip
        let depths = F64x8::<Portable>::new([0.0, 0.3, 0.7, 1.0, 1.0, 0.7, 0.3, 0.0]);
        let (up, less_up) = (-1.0, -1.0 / 3.0);
        let mu = F64x8::new([up, up, up, up, less_up, less_up, less_up, less_up]);
        let classes = sorter.classes(depths, mu);
        assert_eq!(classes.to_array(), [0, 1, 2, 3, 4, 5, 6, 7]);
        // beyond the region as at its planes
        let outside = F64x8::<Portable>::new([-2.0, 0.0, 3.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
        let classes = sorter.classes(outside, F64x8::splat(up));
        assert_eq!(classes.to_array()[..4], [0, 0, 3, 3]);
    }

    #[test]
    fn roulette_keeps_the_total_weight() {
        let mut rng = Stream::new(Key {
            seed: 1,
            cell: 0,
            purpose: [0; 3],
            batch: 0,
        });
        for count in [1_u32, 2, 7, 1000] {
            let start: Vec<f64> = (0..count)
                .map(|i| match i % 4 {
                    0 => 0.75,
                    n => 0.1 * f64::from(n),
                })
                .collect();
            let mut weights = start.clone();
            let mut sorter = Sorter {
                order: (0..count).collect(),
                ..Sorter::default()
            };
            sorter.thin(&mut weights, &mut rng);
            let kept = || sorter.order.iter().map(|i| weights[*i as usize]);
            let total: f64 = start.iter().sum();
            // each of `count` additions rounds by half a unit in the last place of the sum
            let rounding = f64::from(count) * total * f64::EPSILON;
            let difference = kept().sum::<f64>() - total;
            assert!(difference.abs() <= rounding, "{count}: {difference}");
            // a ray that was heavy enough keeps its weight
            let heavy = |i: &&u32| start[**i as usize] >= ROULETTE_WEIGHT;
            assert!(
                sorter
                    .order
                    .iter()
                    .filter(heavy)
                    .all(|i| weights[*i as usize] == 0.75)
            );
            assert_eq!(
                sorter.order.iter().filter(heavy).count(),
                count.div_ceil(4) as usize
            );
        }
    }
}
