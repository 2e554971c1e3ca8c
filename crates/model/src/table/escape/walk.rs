//! The walks of [`EscapeWalker`], one after another.
use splitsnow_spectra::elementary::exp_neg_single;
use splitsnow_spectra::simd::{F64x8, Simd, Task};

use crate::grain::{Bodies, Down};
use crate::math::{Real, Vec3x8, exp_neg, set_lanes};
use crate::table::PackedTable;
use crate::transport::{EVENT_LIMIT, Path, REJECTION_LIMIT, WalkError, diffuse_cosine};

use super::layer::{EscapeKind, EscapeLayer};
use super::outcomes::EscapeTable;
use super::supply::Supply;
use super::{EscapeSink, EscapeWalker};

/// Number of outcomes without a path in ice, and of all others, of eight azimuths each, drawn
/// besides that of the walk in an event next to a plane; at optical depth tau below it,
/// exp(-tau) times as many. A few cost little compared with the walk; above these numbers, more
/// rays are the better investment.
const OUTCOMES_AT_PLANE: [f64; 2] = [8.0, 24.0];
/// Factor of these numbers for a ray that has not been in ice. It is bright at all wavelengths,
/// and at the most absorbed ones hardly any other light leaves.
const FRESH_FACTOR: f64 = 4.0;
/// Number of events after which half of the walks end, and the others count double. Light that was
/// scattered so often leaves in nearly the same way whatever the walk, so that fewer walks do.
const FIRST_ROULETTE: u64 = 100;
/// Ratio of the numbers of events at which this happens again.
const ROULETTES_APART: u64 = 4;
/// sin and cos of the multiples of 45 degrees.
const EIGHTH_TURNS: [[f64; 8]; 2] = {
    const H: f64 = std::f64::consts::FRAC_1_SQRT_2;
    [
        [0.0, H, 1.0, H, 0.0, -H, -1.0, -H],
        [1.0, H, 0.0, -H, -1.0, -H, 0.0, H],
    ]
};

/// A ray between two grains.
#[derive(Debug, Clone, Copy)]
struct Ray {
    z_m: f64,
    /// Cosine and sine of its angle from straight down.
    mu: f64,
    across: f64,
    /// Horizontal unit vector along the ray.
    heading: [f64; 2],
    path: Path,
    layer: usize,
}

/// A series of walks.
pub(super) struct EscapeWalk<'w, S: Simd, C> {
    pub(super) walker: &'w EscapeWalker<'w>,
    pub(super) random: Supply<S>,
    /// Weight of the ray in each band at its last grain, in groups of eight bands.
    pub(super) base: Vec<F64x8<S>>,
    /// Number of walks that this one stands for.
    pub(super) copies: f64,
    /// Weight of a scored ray in each band.
    pub(super) weights: Vec<F64x8<S>>,
    /// The same on one lane, less what the pores absorb.
    pub(super) left: Vec<F64x8<S>>,
    /// Path of the last flight in each layer.
    pub(super) crossed_m: Vec<F64x8<S>>,
    pub(super) sink: &'w mut C,
}

/// A candidate grain: its outcome, size and rotation about the ray.
struct CandidateGrain {
    row: usize,
    size_m: f64,
    sin: f64,
    cos: f64,
}

impl CandidateGrain {
    /// Downward component of a vector given along the ray and across it.
    #[inline(always)]
    fn vertical(&self, ray: &Ray, along: f64, x: f64, y: f64) -> f64 {
        ray.mu * along + ray.across * (self.cos * x + self.sin * y)
    }
}

/// The frame of outcomes, rotated about a ray: the vertical components of unit vectors
/// along the ray and across it, and the rotation.
#[derive(Clone, Copy)]
pub(super) struct RayFrame<R> {
    pub(super) along: R,
    pub(super) across: R,
    pub(super) cos: R,
    pub(super) sin: R,
}

impl<R: Real> Down<R> for RayFrame<R> {
    #[inline(always)]
    fn down(&self, [x, y, along]: [R; 3]) -> R {
        self.along * along + self.across * (self.cos * x + self.sin * y)
    }
}

/// Optical depth from which on [`exp`] counts as 0.
const DARK: f64 = 87.0;

/// exp(-x) for x >= 0 in single precision, which is far below the noise of scores.
#[inline(always)]
pub(super) fn exp<S: Simd>(x: F64x8<S>) -> F64x8<S> {
    let mut values = x.to_array();
    for value in &mut values {
        *value = f64::from(exp_neg_single(*value as f32));
    }
    F64x8::new(values)
}

/// The end of a flight, where candidate grains are drawn.
struct Encounter<'a> {
    ray: Ray,
    layer: &'a EscapeLayer<'a>,
    size_m: [f64; 2],
    table: &'a EscapeTable,
    /// Smallest optical depth of the ray at its last absorption test.
    survived: f64,
}

/// [`EscapeWalk::fly`] as a SIMD task.
struct FlyTask<'a, 'w, S: Simd, C>(&'a mut EscapeWalk<'w, S, C>, &'a mut Ray, f64, f64);

impl<S: Simd, C: EscapeSink> Task for FlyTask<'_, '_, S, C> {
    type Output = bool;

    #[inline(always)]
    fn perform(self) -> bool {
        self.0.fly_inlined(self.1, self.2, self.3)
    }
}

impl<'w, S: Simd, C: EscapeSink> EscapeWalk<'w, S, C> {
    #[inline(always)]
    pub(super) fn diffuse_cosine(&mut self, layer: usize) -> f64 {
        let layer = &self.walker.layers[layer];
        let u = self.random.uniform();
        let (distance_m, longest_m) = (layer.mean_free_distance_m, layer.longest_grain_m);
        diffuse_cosine(u, self.walker.entry, distance_m, longest_m)
    }

    /// Smallest optical depth of the path over all bands.
    #[inline(always)]
    fn depth(&self, path: &Path) -> f64 {
        self.walker.absorption.coefficients.depth(path)
    }

    /// Walks a ray that enters at cosine `mu` to its end. Its first flight is over an optical
    /// depth of `tau`.
    #[inline(always)]
    pub(super) fn ray(&mut self, mu: f64, mut tau: f64) -> Result<(), WalkError> {
        let walker = self.walker;
        let thickness_m = walker.thickness_m;
        let last = walker.layers.len() - 1;
        let budget = walker.absorption.deferred + self.random.exponential();
        let mut ray = Ray {
            z_m: 0.0,
            mu,
            across: (1.0 - mu * mu).sqrt(),
            heading: [1.0, 0.0],
            path: Path::default(),
            layer: 0,
        };
        // whether the escape of this flight was scored when the ray was scattered
        let mut scored = false;
        let (mut rejections, mut events) = (0, 0);
        let mut roulette = FIRST_ROULETTE;
        self.copies = 1.0;
        loop {
            let medium = if walker.wet {
                self.random.uniform()
            } else {
                1.0
            };
            let survived = self.depth(&ray.path);
            if !scored {
                self.leave(&ray, medium, survived);
            }
            let start = ray;
            let flown = self.fly(&mut ray, medium, tau);
            tau = self.random.exponential();
            if !flown {
                let down = ray.mu > 0.0;
                if !down || self.depth(&ray.path) >= budget {
                    return Ok(());
                }
                if walker.bounce == 0.0 || self.random.uniform() >= walker.bounce {
                    return Ok(());
                }
                let (sin, cos) = self.random.azimuth();
                let mu = -self.diffuse_cosine(last);
                ray.mu = mu;
                ray.across = (1.0 - mu * mu).sqrt();
                ray.heading = [cos, sin];
                ray.path.bounces += 1;
                rejections = 0;
                scored = false;
                continue;
            }
            let layer = &walker.layers[ray.layer];
            let kind = self.kind(ray.layer);
            let in_water = medium < layer.water_saturation;
            let encounter = Encounter {
                ray,
                layer,
                size_m: kind.size_m,
                table: kind.tables[usize::from(in_water)],
                survived,
            };
            self.spread(&encounter);
            if !self.scatter(&encounter, &mut ray) {
                rejections += 1;
                if rejections == REJECTION_LIMIT {
                    return Err(WalkError::TooThin { thickness_m });
                }
                ray = start;
                continue;
            }
            rejections = 0;
            events += 1;
            if ray.path.ice_m == f64::INFINITY || events >= EVENT_LIMIT {
                self.sink.lost();
                return Ok(());
            }
            if self.depth(&ray.path) >= budget {
                return Ok(());
            }
            if events == roulette {
                if self.random.uniform() < 0.5 {
                    return Ok(());
                }
                self.copies *= 2.0;
                roulette *= ROULETTES_APART;
            }
            ray.layer = walker.layer_at(ray.z_m);
            scored = true;
        }
    }

    /// Flies over an optical depth of `tau`; false if the flight leaves the snowpack.
    #[inline(always)]
    fn fly(&mut self, ray: &mut Ray, medium: f64, tau: f64) -> bool {
        S::outlined(FlyTask(self, ray, medium, tau))
    }

    #[inline(always)]
    fn fly_inlined(&mut self, ray: &mut Ray, medium: f64, mut tau: f64) -> bool {
        loop {
            let layer = &self.walker.layers[ray.layer];
            let flight_m = layer.mean_free_distance_m * tau;
            let z_m = ray.z_m + flight_m * ray.mu;
            let inside = layer.top_m <= z_m && z_m <= layer.base_m;
            let down = ray.mu > 0.0;
            let plane_m = if down { layer.base_m } else { layer.top_m };
            let length_m = if inside {
                flight_m
            } else {
                (plane_m - ray.z_m) / ray.mu
            };
            if self.walker.absorbing_pores {
                if medium < layer.water_saturation {
                    ray.path.water_m += length_m;
                }
                let depths = ray.path.impurities.iter_mut().zip(&layer.in_pores);
                depths.for_each(|(depth, per_m)| *depth += per_m * length_m);
            }
            ray.z_m = if inside { z_m } else { plane_m };
            if inside {
                return true;
            }
            let last = if down {
                self.walker.layers.len() - 1
            } else {
                0
            };
            if ray.layer == last {
                return false;
            }
            ray.layer = if down { ray.layer + 1 } else { ray.layer - 1 };
            tau -= length_m / layer.mean_free_distance_m;
        }
    }

    /// Draws a grain at the end of a flight; `None` if it does not fit.
    #[inline(always)]
    fn grain(
        &mut self,
        ray: &Ray,
        table: &EscapeTable,
        [min, max]: [f64; 2],
    ) -> Option<CandidateGrain> {
        let thickness_m = self.walker.thickness_m;
        let scaled = self.random.uniform() * table.len() as f64;
        let row = scaled as usize;
        let size_m = min + (max - min) * (scaled - row as f64);
        let (sin, cos) = self.random.azimuth();
        let grain = CandidateGrain {
            row,
            size_m,
            sin,
            cos,
        };
        if ray.z_m < size_m || ray.z_m > thickness_m - size_m {
            let (centre, body) = table.grain(row);
            let down = RayFrame {
                along: ray.mu,
                across: ray.across,
                cos: grain.cos,
                sin: grain.sin,
            };
            let (centre, half) = (down.down(centre), 0.5 * body.half_height(&down));
            let top_m = ray.z_m + size_m * (centre - half);
            let base_m = ray.z_m + size_m * (centre + half);
            if top_m < 0.0 || base_m > thickness_m {
                return None;
            }
        }
        Some(grain)
    }

    /// Draws the type of the next grain in a layer.
    #[inline(always)]
    fn kind(&mut self, layer: usize) -> &'w EscapeKind<'w> {
        match self.walker.layers[layer].kinds.as_slice() {
            [kind] => kind,
            kinds => {
                let u = self.random.uniform();
                let chosen = kinds.partition_point(|kind| kind.cumulative <= u);
                &kinds[chosen.min(kinds.len() - 1)]
            }
        }
    }

    /// The grain event with which the walk continues; false if the grain does not fit.
    #[inline(always)]
    fn scatter(&mut self, encounter: &Encounter, ray: &mut Ray) -> bool {
        let Encounter { table, layer, .. } = *encounter;
        let Some(grain) = self.grain(ray, table, encounter.size_m) else {
            return false;
        };
        let CandidateGrain {
            row,
            size_m,
            sin,
            cos,
        } = grain;
        let (mu, across) = (ray.mu, ray.across);
        let [c, s, along, x, y, ice, ..] = table.motions[row].map(f64::from);
        ray.z_m += size_m * grain.vertical(ray, along, x, y);
        let ice_m = size_m * ice;
        ray.path.ice_m += ice_m;
        let depths = ray.path.impurities.iter_mut().zip(&layer.in_ice);
        depths.for_each(|(depth, per_m)| *depth += per_m * ice_m);
        let [hx, hy] = ray.heading;
        let (p, q) = (c * across - s * mu * cos, s * sin);
        let turned = (p * p + q * q).sqrt();
        ray.mu = (c * mu + s * across * cos).clamp(-1.0, 1.0);
        ray.across = turned.min(1.0);
        if turned > 1e-12 {
            ray.heading = [(p * hx - q * hy) / turned, (p * hy + q * hx) / turned];
        }
        true
    }

    /// Scores the light that would leave after scattering by candidate grains.
    #[inline(always)]
    fn spread(&mut self, encounter: &Encounter) {
        let Encounter {
            ray,
            table,
            survived,
            ..
        } = encounter;
        let (walker, zero) = (self.walker, F64x8::<S>::ZERO);
        let down = F64x8::new([0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).gt(zero);
        let tau = walker.vertical(F64x8::splat(ray.z_m), down, |s| {
            1.0 / s.mean_free_distance_m
        });
        let [up, down, ..] = tau.to_array();
        let near = exp_neg(up) + exp_neg(down);
        let fresh = if ray.path.ice_m == 0.0 {
            FRESH_FACTOR
        } else {
            1.0
        };
        let mut is_weighed = false;
        for ((table, rows, chance), at_plane) in table.groups().into_iter().zip(OUTCOMES_AT_PLANE) {
            if rows.is_empty() {
                continue;
            }
            let wanted = at_plane * fresh * near;
            let (count, expected) = if wanted >= 1.0 {
                (wanted.round(), wanted.round())
            } else if self.random.uniform() < wanted {
                (1.0, wanted)
            } else {
                continue;
            };
            // the probability of these outcomes, over the expected number of rays
            let share = chance / (8.0 * expected);
            if !is_weighed {
                self.base(&ray.path, *survived);
                is_weighed = true;
            }
            let first = self.random.uniform();
            for i in 0..count as u32 {
                let place = (f64::from(i) + first) / count * rows.len() as f64;
                let row = rows.start + (place as usize).min(rows.len() - 1);
                self.outcome(encounter, table, row, share);
            }
        }
    }

    /// Scores `share` of the light that would leave after one outcome, at eight azimuths.
    #[inline(always)]
    fn outcome(&mut self, encounter: &Encounter, table: &PackedTable, row: usize, share: f64) {
        let Encounter {
            ray,
            layer,
            size_m: [min, max],
            ..
        } = encounter;
        let (walker, zero, one) = (self.walker, F64x8::<S>::ZERO, F64x8::ONE);
        let [mu, across] = [ray.mu, ray.across].map(F64x8::splat);
        let [hx, hy] = ray.heading.map(F64x8::splat);
        let thickness = F64x8::splat(walker.thickness_m);
        let size_m = min + (max - min) * self.random.uniform();
        let size = F64x8::splat(size_m);
        let (sin, cos) = self.random.azimuth();
        let [sin, cos] = [sin, cos].map(F64x8::splat);
        let [s, c]: [F64x8<S>; 2] = EIGHTH_TURNS.map(F64x8::new);
        let (sin, cos) = (sin * c + cos * s, cos * c - sin * s);
        let down = RayFrame {
            along: mu,
            across,
            cos,
            sin,
        };
        let mut fits = one.gt(zero);
        if ray.z_m < size_m || ray.z_m > walker.thickness_m - size_m {
            let (centre, body) = table.grain(row);
            let half = F64x8::splat(0.5) * Bodies::<S>::splat(&body).half_height(&down);
            let [centre, z] = [down.down(centre.map(F64x8::splat)), F64x8::splat(ray.z_m)];
            fits =
                (z + size * (centre - half)).ge(zero) & (z + size * (centre + half)).le(thickness);
        }
        let [c, s, along, x, y, ice, ..] = table.motions[row].map(f64::from);
        if ice == f64::INFINITY || fits.to_bitmask() == 0 {
            return;
        }
        let z_m = F64x8::splat(ray.z_m) + size * down.down([x, y, along].map(F64x8::splat));
        let [c, s] = [c, s].map(F64x8::splat);
        let (p, q) = (c * across - s * mu * cos, s * sin);
        let direction = Vec3x8 {
            x: p * hx - q * hy,
            y: p * hy + q * hx,
            z: c * mu + s * across * cos,
        };
        let medium = if walker.wet {
            self.random.uniform()
        } else {
            1.0
        };
        let ice_m = size_m * ice;
        for (weight, (base, per_m)) in self
            .weights
            .iter_mut()
            .zip(self.base.iter().zip(&layer.ice_per_m))
        {
            *weight = *base * exp(per_m.on() * F64x8::splat(ice_m));
        }
        self.escape(fits, z_m, &direction, medium, Some(share));
    }

    /// Scores the probability that the current flight leaves the snowpack.
    #[inline(always)]
    fn leave(&mut self, ray: &Ray, medium: f64, survived: f64) {
        self.base(&ray.path, survived);
        self.weights.copy_from_slice(&self.base);
        let first_lane = F64x8::new([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).gt(F64x8::ZERO);
        let [hx, hy] = ray.heading;
        let direction = Vec3x8 {
            x: F64x8::splat(ray.across * hx),
            y: F64x8::splat(ray.across * hy),
            z: F64x8::splat(ray.mu),
        };
        self.escape(first_lane, F64x8::splat(ray.z_m), &direction, medium, None);
    }

    /// Weights of a ray that met its grain after `path` and was not absorbed up to the smallest
    /// optical depth `survived`.
    #[inline(always)]
    fn base(&mut self, path: &Path, survived: f64) {
        let walker = self.walker;
        let compensated = (survived - walker.absorption.deferred).max(0.0);
        let [copies, compensated] = [self.copies, compensated].map(F64x8::splat);
        for (base, bands) in self.base.iter_mut().zip(&walker.bands) {
            *base = copies * exp(bands.depth(path) - compensated);
            for _ in 0..path.bounces {
                *base *= bands.kept.on();
            }
        }
    }

    /// Scores `weights` times the probability of leaving from depths `z_m` along `direction`
    /// on the given lanes: the probability of the next flight or, with the `share` of one outcome
    /// in all of them, of the next flight and all flights drawn in its place.
    #[inline(always)]
    fn escape(
        &mut self,
        lanes: F64x8<S>,
        z_m: F64x8<S>,
        direction: &Vec3x8<S>,
        medium: f64,
        share: Option<f64>,
    ) {
        let walker = self.walker;
        let down = direction.z.gt(F64x8::ZERO);
        let secant = F64x8::ONE / direction.z.abs().max(F64x8::splat(1e-12));
        let tau = walker.vertical(z_m, down, |s| 1.0 / s.mean_free_distance_m);
        let depth = secant * tau;
        let mut chance = exp(depth);
        let lanes = (lanes & depth.lt(F64x8::splat(DARK))).to_bitmask();
        if let Some(share) = share {
            let again = walker.rejections.chance(z_m, direction.z, tau, lanes);
            chance = chance * F64x8::splat(share) / (F64x8::ONE - again);
        }
        if walker.absorbing_pores {
            for (crossed_m, layer) in self.crossed_m.iter_mut().zip(&walker.layers) {
                *crossed_m = secant * layer.part_m(z_m, down);
            }
        }
        let bins = self.sink.bins(direction, lanes);
        for lane in set_lanes(lanes) {
            let (bin, chance) = (bins[lane], chance.as_array()[lane]);
            let down = direction.z.as_array()[lane] > 0.0;
            if !down && !walker.absorbing_pores {
                self.sink.catch(bin, chance, &self.weights);
                continue;
            }
            self.left.copy_from_slice(&self.weights);
            if down {
                for (weight, bands) in self.left.iter_mut().zip(&walker.bands) {
                    *weight *= bands.transmitted.on();
                }
            }
            if walker.absorbing_pores {
                self.fade(lane, medium);
            }
            self.sink.catch(bin, chance, &self.left);
        }
    }

    /// Reduces the weights that are left by what the pores along the flight of a lane absorb.
    #[inline(always)]
    fn fade(&mut self, lane: usize, medium: f64) {
        for (group, weight) in self.left.iter_mut().enumerate() {
            let mut depth = F64x8::ZERO;
            for (crossed_m, layer) in self.crossed_m.iter().zip(&self.walker.layers) {
                let per_m = &layer.pores_per_m[usize::from(medium < layer.water_saturation)];
                depth += F64x8::splat(crossed_m.as_array()[lane]) * per_m[group].on();
            }
            *weight *= exp(depth);
        }
    }
}
