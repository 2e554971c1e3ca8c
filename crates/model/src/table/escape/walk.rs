//! One such walk after another.
use splitsnow_spectra::simd::{F64x8, Simd, Task};

use crate::grain::{Bodies, Down};
use crate::math::{Real, Vec3x8, exp_neg};
use crate::table::{Table, lanes as each_of};
use crate::transport::{EVENT_LIMIT, Path, REJECTION_LIMIT, WalkError, diffuse_cosine};

use super::stratum::{Kind, Stratum};
use super::supply::Supply;
use super::{EscapeSink, EscapeWalker};

/// Outcomes, of eight azimuths each, drawn beside the walk's own in an event
/// next to a plane, and exp(-tau) of that at optical depth tau below it: few cost
/// little beside the walk, and from here on more give less than more rays.
const SPREAD: f64 = 32.0;
/// Flights drawn in place of a scored one are looked for with this times the
/// chance that it leaves.
const TRIED: f64 = 8.0;
/// sin and cos of eighths of a turn.
const TURNS: [[f64; 8]; 2] = {
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
    /// Horizontal unit vector along it.
    heading: [f64; 2],
    path: Path,
    stratum: usize,
}

/// One walk after another.
pub(super) struct Walk<'w, S: Simd, C> {
    pub(super) walker: &'w EscapeWalker<'w>,
    pub(super) random: Supply<S>,
    /// Weight of the ray in each band on its last grain.
    pub(super) base: Vec<f64>,
    pub(super) weights: Vec<F64x8<S>>,
    pub(super) catch: &'w mut C,
}

/// A grain in the way of a ray: which outcome, how large and how turned.
struct Waiting {
    row: usize,
    size_m: f64,
    sin: f64,
    cos: f64,
}

impl Waiting {
    /// Downward component of a vector given along the ray and across it.
    #[inline(always)]
    fn vertical(&self, ray: &Ray, along: f64, x: f64, y: f64) -> f64 {
        ray.mu * along + ray.across * (self.cos * x + self.sin * y)
    }
}

/// The frame of outcomes, turned about a ray: what a unit along it and one across it
/// have of the vertical, and the turn.
struct Turned<R> {
    along: R,
    across: R,
    cos: R,
    sin: R,
}

impl<R: Real> Down<R> for Turned<R> {
    #[inline(always)]
    fn down(&self, [x, y, along]: [R; 3]) -> R {
        self.along * along + self.across * (self.cos * x + self.sin * y)
    }
}

/// exp(-x) for x >= 0.
#[inline(always)]
fn exp<S: Simd>(x: F64x8<S>) -> F64x8<S> {
    let mut values = x.to_array();
    for value in &mut values {
        *value = exp_neg(*value);
    }
    F64x8::new(values)
}

/// The end of a flight, where grains wait.
struct Meeting<'a> {
    ray: Ray,
    stratum: &'a Stratum<'a>,
    size_m: [f64; 2],
    table: &'a Table,
    /// Least optical depth of the ray when it was last absorbed or not.
    survived: f64,
}

/// The call of [`Walk::fly`].
struct Fly<'a, 'w, S: Simd, C>(&'a mut Walk<'w, S, C>, &'a mut Ray, f64);

impl<S: Simd, C: EscapeSink> Task for Fly<'_, '_, S, C> {
    type Output = bool;

    #[inline(always)]
    fn perform(self) -> bool {
        self.0.fly_here(self.1, self.2)
    }
}

/// The call of [`Walk::rejections`].
struct Rejections<'a, 'w, S: Simd, C>(&'a mut Walk<'w, S, C>, &'a Ray);

impl<S: Simd, C: EscapeSink> Task for Rejections<'_, '_, S, C> {
    type Output = f64;

    #[inline(always)]
    fn perform(self) -> f64 {
        self.0.rejections_here(self.1)
    }
}

impl<'w, S: Simd, C: EscapeSink> Walk<'w, S, C> {
    #[inline(always)]
    pub(super) fn diffuse_cosine(&mut self, stratum: usize) -> f64 {
        let stratum = &self.walker.strata[stratum];
        let u = self.random.uniform();
        let (distance_m, longest_m) = (stratum.mean_free_distance_m, stratum.longest_grain_m);
        diffuse_cosine(u, self.walker.entry, distance_m, longest_m)
    }

    /// Least optical depth so far.
    #[inline(always)]
    fn depth(&self, path: &Path) -> f64 {
        self.walker.absorption.coefficients.depth(path)
    }

    /// Walks a ray that enters at cosine `mu` to its end.
    #[inline(always)]
    pub(super) fn ray(&mut self, mu: f64) -> Result<(), WalkError> {
        let walker = self.walker;
        let thickness_m = walker.thickness_m;
        let last = walker.strata.len() - 1;
        let budget = walker.absorption.deferred + self.random.exponential();
        let mut ray = Ray {
            z_m: 0.0,
            mu,
            across: (1.0 - mu * mu).sqrt(),
            heading: [1.0, 0.0],
            path: Path::default(),
            stratum: 0,
        };
        // whether its escape has been scored where it was scattered
        let mut scored = false;
        let (mut rejections, mut events) = (0, 0);
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
            if !self.fly(&mut ray, medium) {
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
            let stratum = &walker.strata[ray.stratum];
            let kind = self.kind(ray.stratum);
            let in_water = medium < stratum.water_saturation;
            let meeting = Meeting {
                ray,
                stratum,
                size_m: kind.size_m,
                table: kind.tables[usize::from(in_water)],
                survived,
            };
            self.spread(&meeting);
            if !self.scatter(&meeting, &mut ray) {
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
                self.catch.lost();
                return Ok(());
            }
            if self.depth(&ray.path) >= budget {
                return Ok(());
            }
            ray.stratum = walker.stratum(ray.z_m);
            scored = true;
        }
    }

    /// Flies to the next grain; false if the flight leaves the snowpack.
    #[inline(always)]
    fn fly(&mut self, ray: &mut Ray, medium: f64) -> bool {
        S::outlined(Fly(self, ray, medium))
    }

    #[inline(always)]
    fn fly_here(&mut self, ray: &mut Ray, medium: f64) -> bool {
        loop {
            let stratum = &self.walker.strata[ray.stratum];
            let flight_m = stratum.mean_free_distance_m * self.random.exponential();
            let z_m = ray.z_m + flight_m * ray.mu;
            let inside = stratum.top_m <= z_m && z_m <= stratum.base_m;
            let down = ray.mu > 0.0;
            let plane_m = if down { stratum.base_m } else { stratum.top_m };
            let length_m = if inside {
                flight_m
            } else {
                (plane_m - ray.z_m) / ray.mu
            };
            if self.walker.absorbing_pores {
                if medium < stratum.water_saturation {
                    ray.path.water_m += length_m;
                }
                let depths = ray.path.impurities.iter_mut().zip(&stratum.in_pores);
                depths.for_each(|(depth, per_m)| *depth += per_m * length_m);
            }
            ray.z_m = if inside { z_m } else { plane_m };
            if inside {
                return true;
            }
            let last = if down {
                self.walker.strata.len() - 1
            } else {
                0
            };
            if ray.stratum == last {
                return false;
            }
            ray.stratum = if down {
                ray.stratum + 1
            } else {
                ray.stratum - 1
            };
        }
    }

    /// A grain for a ray to meet where its flight ended; `None` if it does not fit.
    #[inline(always)]
    fn grain(&mut self, ray: &Ray, table: &Table, [min, max]: [f64; 2]) -> Option<Waiting> {
        let thickness_m = self.walker.thickness_m;
        let scaled = self.random.uniform() * table.len() as f64;
        let row = scaled as usize;
        let size_m = min + (max - min) * (scaled - row as f64);
        let (sin, cos) = self.random.azimuth();
        let grain = Waiting {
            row,
            size_m,
            sin,
            cos,
        };
        if ray.z_m < size_m || ray.z_m > thickness_m - size_m {
            let (centre, body) = table.grain(row);
            let down = Turned {
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

    /// How many flights in a row, begun as `start`, are drawn anew because their
    /// grains do not fit.
    #[inline(always)]
    fn rejections(&mut self, start: &Ray) -> f64 {
        S::outlined(Rejections(self, start))
    }

    #[inline(always)]
    fn rejections_here(&mut self, start: &Ray) -> f64 {
        for rejections in 0..REJECTION_LIMIT {
            let mut ray = *start;
            if !self.fly(&mut ray, 1.0) {
                return f64::from(rejections);
            }
            let kind = self.kind(ray.stratum);
            if self.grain(&ray, kind.tables[0], kind.size_m).is_some() {
                return f64::from(rejections);
            }
        }
        f64::from(REJECTION_LIMIT)
    }

    /// The type of the next grain in a layer.
    #[inline(always)]
    fn kind(&mut self, stratum: usize) -> &'w Kind<'w> {
        match self.walker.strata[stratum].kinds.as_slice() {
            [kind] => kind,
            kinds => {
                let u = self.random.uniform();
                let at = kinds.partition_point(|kind| kind.up_to <= u);
                &kinds[at.min(kinds.len() - 1)]
            }
        }
    }

    /// The ray's own grain event; false if the grain does not fit.
    #[inline(always)]
    fn scatter(&mut self, meeting: &Meeting, ray: &mut Ray) -> bool {
        let Meeting { table, stratum, .. } = *meeting;
        let Some(grain) = self.grain(ray, table, meeting.size_m) else {
            return false;
        };
        let Waiting {
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
        let depths = ray.path.impurities.iter_mut().zip(&stratum.in_ice);
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

    /// Scores the light that the grains waiting would let leave.
    #[inline(always)]
    fn spread(&mut self, meeting: &Meeting) {
        let Meeting {
            ray,
            stratum,
            size_m: [min, max],
            table,
            survived,
        } = meeting;
        let (walker, zero, one) = (self.walker, F64x8::<S>::ZERO, F64x8::ONE);
        let down = F64x8::new([0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).gt(zero);
        let tau = walker.vertical(F64x8::splat(ray.z_m), down, |s| {
            1.0 / s.mean_free_distance_m
        });
        let [up, down, ..] = tau.to_array();
        let wanted = SPREAD * (exp_neg(up) + exp_neg(down));
        let (count, share) = if wanted >= 1.0 {
            (wanted.round(), 1.0 / (8.0 * wanted.round()))
        } else if self.random.uniform() < wanted {
            (1.0, 1.0 / (8.0 * wanted))
        } else {
            return;
        };
        self.base(&ray.path, *survived, share);
        let first = self.random.uniform();
        let [mu, across] = [ray.mu, ray.across].map(F64x8::splat);
        let [hx, hy] = ray.heading.map(F64x8::splat);
        let thickness = F64x8::splat(walker.thickness_m);
        for i in 0..count as u32 {
            let row = ((f64::from(i) + first) / count * table.len() as f64) as usize;
            let row = row.min(table.len() - 1);
            let size_m = min + (max - min) * self.random.uniform();
            let size = F64x8::splat(size_m);
            let (sin, cos) = self.random.azimuth();
            let [sin, cos] = [sin, cos].map(F64x8::splat);
            let [s, c]: [F64x8<S>; 2] = TURNS.map(F64x8::new);
            let (sin, cos) = (sin * c + cos * s, cos * c - sin * s);
            let down = Turned {
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
                fits = (z + size * (centre - half)).ge(zero)
                    & (z + size * (centre + half)).le(thickness);
            }
            let [c, s, along, x, y, ice, ..] = table.motions[row].map(f64::from);
            if ice == f64::INFINITY || fits.to_bitmask() == 0 {
                continue;
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
                .zip(self.base.iter().zip(&stratum.ice_per_m))
            {
                *weight = F64x8::splat(base * exp_neg(per_m * ice_m));
            }
            self.escape(fits, z_m, &direction, medium, true);
        }
    }

    /// Scores the chance that the flight begun leaves the snowpack.
    #[inline(always)]
    fn leave(&mut self, ray: &Ray, medium: f64, survived: f64) {
        self.base(&ray.path, survived, 1.0);
        let weights = self.weights.iter_mut().zip(&self.base);
        weights.for_each(|(weight, base)| *weight = F64x8::splat(*base));
        let one = F64x8::new([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).gt(F64x8::ZERO);
        let [hx, hy] = ray.heading;
        let direction = Vec3x8 {
            x: F64x8::splat(ray.across * hx),
            y: F64x8::splat(ray.across * hy),
            z: F64x8::splat(ray.mu),
        };
        self.escape(one, F64x8::splat(ray.z_m), &direction, medium, false);
    }

    /// Weights, times `share`, of a ray that met its grain after `path`; it was
    /// not absorbed up to the least optical depth `survived`.
    #[inline(always)]
    fn base(&mut self, path: &Path, survived: f64, share: f64) {
        let walker = self.walker;
        let made_up_for = (survived - walker.absorption.deferred).max(0.0);
        for (base, band) in self.base.iter_mut().zip(walker.bands) {
            *base = share * exp_neg(band.coefficients.depth(path) - made_up_for);
            for _ in 0..path.bounces {
                *base *= band.reflected / walker.bounce;
            }
        }
    }

    /// Scores `weights` times the chance to leave from depths `z_m` along
    /// `direction`, on the lanes given: that of the next flight or, if `in_all`,
    /// of this and those drawn in its place.
    #[inline(always)]
    fn escape(
        &mut self,
        lanes: F64x8<S>,
        z_m: F64x8<S>,
        direction: &Vec3x8<S>,
        medium: f64,
        in_all: bool,
    ) {
        let walker = self.walker;
        let down = direction.z.gt(F64x8::ZERO);
        let secant = F64x8::ONE / direction.z.abs().max(F64x8::splat(1e-12));
        let tau = secant * walker.vertical(z_m, down, |s| 1.0 / s.mean_free_distance_m);
        let mut chance = exp(tau);
        let lanes = (lanes & chance.gt(F64x8::ZERO)).to_bitmask();
        if in_all {
            for lane in each_of(lanes) {
                // rarely where little leaves, and made up for
                let tried = (TRIED * chance.as_array()[lane]).min(1.0);
                if tried < 1.0 && self.random.uniform() >= tried {
                    continue;
                }
                let (z_m, mu) = (z_m.as_array()[lane], direction.z.as_array()[lane]);
                let start = Ray {
                    z_m,
                    mu,
                    across: (1.0 - mu * mu).max(0.0).sqrt(),
                    heading: [1.0, 0.0],
                    path: Path::default(),
                    stratum: walker.stratum(z_m),
                };
                chance.as_mut_array()[lane] *= 1.0 + self.rejections(&start) / tried;
            }
        }
        for (l, (weight, band)) in self.weights.iter_mut().zip(walker.bands).enumerate() {
            *weight *= chance * down.select(F64x8::splat(band.transmitted), F64x8::ONE);
            if walker.absorbing_pores {
                let per_m =
                    |s: &Stratum| s.pores_per_m[usize::from(medium < s.water_saturation)][l];
                *weight *= exp(secant * walker.vertical(z_m, down, per_m));
            }
        }
        self.catch.catch(lanes, direction, &self.weights);
    }
}
