//! Walks through a pack that score, at every grain event, the light that would
//! leave from there in all directions (the local estimate of neutron transport,
//! for grains that take up room).
//!
//! Where a flight ends, several outcomes of the grain event are drawn beside the
//! one with which the walk goes on, each turned to eight azimuths about the ray
//! (grain axes are isotropic, so every turn is as likely). From where such a
//! grain, if it fits between the planes, would send the ray, a flight leaves the
//! pack with probability exp(-tau): so much is scored in that direction. The sum
//! over the flights of a walk has the mean of a count of those that do leave.
//! Flights drawn anew, because a grain did not fit, are counted by a trial of
//! them at every score. No outcome is tilted, moved or replaced, so the estimate
//! has no error but that of the table of outcomes.
use wide::f64x8;

use crate::math::{Vec3x8, exp_neg, ln};
use crate::rng::Stream;
use crate::table::{Table, lanes as each_of};
use crate::transport::{
    Absorption, Coefficients, EVENT_LIMIT, EXPONENTS, Entry, Illumination, Layer, Model, Path,
    REJECTION_LIMIT, WalkError, diffuse_cosine, impurities_per_m,
};

/// Outcomes, of eight azimuths each, drawn beside the walk's own in an event
/// next to a plane, and exp(-tau) of that at optical depth tau below it: few cost
/// little beside the walk, and from here on more give less than more rays.
const SPREAD: f64 = 32.0;
/// Flights drawn in place of a scored one are looked for with this times the
/// chance that it leaves.
const TRIED: f64 = 8.0;
/// Rays after which the caller is asked whether to go on.
const RAYS_BETWEEN_CHECKS: u64 = 64;
/// sin and cos of eighths of a turn.
const TURNS: [[f64; 8]; 2] = {
    const H: f64 = std::f64::consts::FRAC_1_SQRT_2;
    [
        [0.0, H, 1.0, H, 0.0, -H, -1.0, -H],
        [1.0, H, 0.0, -H, -1.0, -H, 0.0, H],
    ]
};

/// What escaping light is reported to.
pub trait Catch {
    /// Light leaves on the lanes of the mask along unit vectors `direction`
    /// (upward where z < 0), with these weights per wavelength.
    fn catch(&mut self, lanes: u32, direction: &Vec3x8, weights: &[f64x8]);

    /// A ray hit an event limit.
    fn lost(&mut self);

    /// Asked now and then: whether to give up.
    fn stop(&self) -> bool;
}

/// Light at one wavelength.
#[derive(Debug, Clone, Copy)]
pub struct Band {
    /// Its absorption.
    pub coefficients: Coefficients,
    /// Share of the light arriving at the ground that comes back.
    pub reflected: f64,
    /// Share that counts as transmitted.
    pub transmitted: f64,
}

/// A pack ready for such walks.
#[derive(Debug)]
pub struct EscapeWalker<'a> {
    /// From the surface down.
    strata: Vec<Stratum<'a>>,
    thickness_m: f64,
    wet: bool,
    absorbing_pores: bool,
    absorption: Absorption,
    bands: &'a [Band],
    entry: Entry,
    /// Chance to survive the ground.
    bounce: f64,
}

/// Grains of one type, with outcomes in air and in water.
#[derive(Debug)]
struct Kind<'a> {
    /// Probability that a grain met is of this type or one before it.
    up_to: f64,
    size_m: [f64; 2],
    tables: [&'a Table; 2],
}

#[derive(Debug)]
struct Stratum<'a> {
    kinds: Vec<Kind<'a>>,
    /// Depths of its planes, m.
    top_m: f64,
    base_m: f64,
    mean_free_distance_m: f64,
    longest_grain_m: f64,
    water_saturation: f64,
    in_ice: [f64; EXPONENTS],
    in_pores: [f64; EXPONENTS],
    /// Absorption of its ice per band, 1/m.
    ice_per_m: Vec<f64>,
    /// Absorption of its pores per band, filled with air and with water, 1/m.
    pores_per_m: [Vec<f64>; 2],
}

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

/// Random numbers one at a time.
struct Supply {
    rng: Stream,
    uniforms: [f64; 8],
    exponentials: [f64; 8],
    azimuths: [[f64; 8]; 2],
    left: [usize; 3],
}

impl Supply {
    fn new(rng: Stream) -> Self {
        Self {
            rng,
            uniforms: [0.0; 8],
            exponentials: [0.0; 8],
            azimuths: [[0.0; 8]; 2],
            left: [0; 3],
        }
    }

    #[inline(always)]
    fn uniform(&mut self) -> f64 {
        if self.left[0] == 0 {
            (self.uniforms, self.left[0]) = (self.rng.uniform().to_array(), 8);
        }
        self.left[0] -= 1;
        self.uniforms[self.left[0]]
    }

    #[inline(always)]
    fn exponential(&mut self) -> f64 {
        if self.left[1] == 0 {
            let u = self.rng.uniform();
            (self.exponentials, self.left[1]) = ((-ln(f64x8::ONE - u)).to_array(), 8);
        }
        self.left[1] -= 1;
        self.exponentials[self.left[1]]
    }

    /// (sin, cos) of a uniform angle.
    #[inline(always)]
    fn azimuth(&mut self) -> (f64, f64) {
        if self.left[2] == 0 {
            let (sin, cos) = self.rng.azimuth();
            (self.azimuths, self.left[2]) = ([sin.to_array(), cos.to_array()], 8);
        }
        self.left[2] -= 1;
        let [sin, cos] = &self.azimuths;
        (sin[self.left[2]], cos[self.left[2]])
    }
}

impl<'a> Stratum<'a> {
    fn new(
        layer: &Layer,
        top_m: f64,
        tables: &'a [[Table; 2]],
        bands: &[Band],
        (exponents, model): (&[f64], &Model),
    ) -> Self {
        let snow = &layer.snow;
        let [in_ice, in_pores] = impurities_per_m(snow, model, exponents);
        let carbon = |band: &Band, per_m: &[f64; EXPONENTS]| -> f64 {
            let factors = band.coefficients.impurities.iter();
            factors
                .zip(per_m)
                .map(|(factor, per_m)| factor * per_m)
                .sum()
        };
        let per_band = |f: &dyn Fn(&Band) -> f64| bands.iter().map(f).collect();
        let mut up_to = 0.0;
        let grains = snow
            .meeting_shares()
            .into_iter()
            .zip(&snow.grains)
            .zip(tables);
        let kinds = grains.map(|((share, component), [air, water])| {
            up_to += share;
            let size = component.grain.size;
            Kind {
                up_to,
                size_m: [size.min_m(), size.max_m()],
                tables: [air, water],
            }
        });
        Self {
            kinds: kinds.collect(),
            top_m,
            base_m: top_m + layer.thickness_m,
            mean_free_distance_m: snow.mean_free_distance_m(),
            longest_grain_m: snow.sizes_m()[1],
            water_saturation: snow.water_saturation,
            in_ice,
            in_pores,
            ice_per_m: per_band(&|b| b.coefficients.ice_per_m + carbon(b, &in_ice)),
            pores_per_m: [
                per_band(&|b| carbon(b, &in_pores)),
                per_band(&|b| b.coefficients.water_per_m + carbon(b, &in_pores)),
            ],
        }
    }
}

impl<'a> EscapeWalker<'a> {
    /// `layers` from the surface down (at least one), with outcomes per type of
    /// grain in each. `absorption` is the least of all `bands`.
    #[must_use]
    pub fn new(
        layers: &[Layer],
        tables: &'a [Vec<[Table; 2]>],
        (exponents, model): (&[f64], &Model),
        bands: &'a [Band],
        absorption: Absorption,
    ) -> Self {
        let mut top_m = 0.0;
        let strata = layers.iter().zip(tables).map(|(layer, tables)| {
            let stratum = Stratum::new(layer, top_m, tables, bands, (exponents, model));
            top_m = stratum.base_m;
            stratum
        });
        let strata: Vec<_> = strata.collect();
        let sooty = strata.iter().any(|s| s.in_pores != [0.0; EXPONENTS]);
        let wet = strata.iter().any(|s| s.water_saturation > 0.0);
        let bounce = bands.iter().map(|band| band.reflected).fold(0.0, f64::max);
        Self {
            thickness_m: top_m,
            wet,
            absorbing_pores: wet || sooty,
            strata,
            absorption,
            bands,
            entry: model.entry,
            bounce,
        }
    }

    /// Walks `rays` rays.
    ///
    /// # Errors
    /// [`WalkError`].
    pub fn walk(
        &self,
        illumination: Illumination,
        rays: u64,
        rng: Stream,
        catch: &mut impl Catch,
    ) -> Result<(), WalkError> {
        let zero = f64x8::ZERO;
        let mut walk = Walk {
            walker: self,
            random: Supply::new(rng),
            base: vec![0.0; self.bands.len()],
            weights: vec![zero; self.bands.len()],
            catch,
        };
        for ray in 0..rays {
            if ray % RAYS_BETWEEN_CHECKS == 0 && walk.catch.stop() {
                return Err(WalkError::Stopped);
            }
            let mu = match illumination {
                Illumination::Collimated { polar_angle_rad } => libm::cos(polar_angle_rad),
                Illumination::Diffuse => walk.diffuse_cosine(0),
            };
            walk.ray(mu)?;
        }
        Ok(())
    }

    /// The layer at a depth.
    #[inline(always)]
    fn stratum(&self, z_m: f64) -> usize {
        let above_last = self.strata[..self.strata.len() - 1].iter();
        above_last
            .take_while(|stratum| stratum.base_m < z_m)
            .count()
    }

    /// Optical thicknesses of the snow between depths `z_m` and the upper plane,
    /// and where `down` the lower one, for vertical light and absorption per
    /// length `per_m` in each layer.
    #[inline(always)]
    fn vertical(&self, z_m: f64x8, down: f64x8, per_m: impl Fn(&Stratum) -> f64) -> f64x8 {
        let zero = f64x8::ZERO;
        let mut sum = zero;
        for stratum in &self.strata {
            let [top, base] = [stratum.top_m, stratum.base_m].map(f64x8::splat);
            let part = down.select(base - z_m, z_m - top);
            let part = part.fast_max(zero).fast_min(base - top);
            sum += part * f64x8::splat(per_m(stratum));
        }
        sum
    }
}

/// One walk after another.
struct Walk<'w, C> {
    walker: &'w EscapeWalker<'w>,
    random: Supply,
    /// Weight of the ray in each band on its last grain.
    base: Vec<f64>,
    weights: Vec<f64x8>,
    catch: &'w mut C,
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

/// The end of a flight, where grains wait.
struct Meeting<'a> {
    ray: Ray,
    stratum: &'a Stratum<'a>,
    size_m: [f64; 2],
    table: &'a Table,
    /// Least optical depth of the ray when it was last absorbed or not.
    survived: f64,
}

impl<'w, C: Catch> Walk<'w, C> {
    fn diffuse_cosine(&mut self, stratum: usize) -> f64 {
        let stratum = &self.walker.strata[stratum];
        let u = self.random.uniform();
        let (distance_m, longest_m) = (stratum.mean_free_distance_m, stratum.longest_grain_m);
        diffuse_cosine(u, self.walker.entry, distance_m, longest_m)
    }

    /// Least optical depth so far.
    fn depth(&self, path: &Path) -> f64 {
        self.walker.absorption.coefficients.depth(path)
    }

    /// Walks a ray that enters at cosine `mu` to its end.
    fn ray(&mut self, mu: f64) -> Result<(), WalkError> {
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

    /// Flies to the next grain; false if the flight leaves the pack.
    fn fly(&mut self, ray: &mut Ray, medium: f64) -> bool {
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
            let [x, y, along, ax, ay, az, flattening, _] = table.bodies[row].map(f64::from);
            let axis = grain.vertical(ray, az, ax, ay);
            let half = 0.5 * (1.0 + flattening * (1.0 - axis * axis)).max(0.0).sqrt();
            let centre = grain.vertical(ray, along, x, y);
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
    fn rejections(&mut self, start: &Ray) -> f64 {
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
    fn spread(&mut self, meeting: &Meeting) {
        let Meeting {
            ray,
            stratum,
            size_m: [min, max],
            table,
            survived,
        } = meeting;
        let (walker, zero, one) = (self.walker, f64x8::ZERO, f64x8::ONE);
        let down = f64x8::new([0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).simd_gt(zero);
        let tau = walker.vertical(f64x8::splat(ray.z_m), down, |s| {
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
        let [mu, across] = [ray.mu, ray.across].map(f64x8::splat);
        let [hx, hy] = ray.heading.map(f64x8::splat);
        let thickness = f64x8::splat(walker.thickness_m);
        for i in 0..count as u32 {
            let row = ((f64::from(i) + first) / count * table.len() as f64) as usize;
            let row = row.min(table.len() - 1);
            let size_m = min + (max - min) * self.random.uniform();
            let size = f64x8::splat(size_m);
            let (sin, cos) = self.random.azimuth();
            let [sin, cos] = [sin, cos].map(f64x8::splat);
            let [s, c] = TURNS.map(f64x8::new);
            let (sin, cos) = (sin * c + cos * s, cos * c - sin * s);
            let vertical = |along: f64, x: f64, y: f64| {
                mu * f64x8::splat(along) + across * (cos * f64x8::splat(x) + sin * f64x8::splat(y))
            };
            let mut fits = one.simd_gt(zero);
            if ray.z_m < size_m || ray.z_m > walker.thickness_m - size_m {
                let [x, y, along, ax, ay, az, flattening, _] = table.bodies[row].map(f64::from);
                let axis = vertical(az, ax, ay);
                let square = one + f64x8::splat(flattening) * (one - axis * axis);
                let half = f64x8::splat(0.5) * square.fast_max(zero).sqrt();
                let [centre, z] = [vertical(along, x, y), f64x8::splat(ray.z_m)];
                fits = (z + size * (centre - half)).simd_ge(zero)
                    & (z + size * (centre + half)).simd_le(thickness);
            }
            let [c, s, along, x, y, ice, ..] = table.motions[row].map(f64::from);
            if ice == f64::INFINITY || fits.to_bitmask() == 0 {
                continue;
            }
            let z_m = f64x8::splat(ray.z_m) + size * vertical(along, x, y);
            let [c, s] = [c, s].map(f64x8::splat);
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
                *weight = f64x8::splat(base * exp_neg(per_m * ice_m));
            }
            self.escape(fits, z_m, &direction, medium, true);
        }
    }

    /// Scores the chance that the flight begun leaves the pack.
    fn leave(&mut self, ray: &Ray, medium: f64, survived: f64) {
        self.base(&ray.path, survived, 1.0);
        let weights = self.weights.iter_mut().zip(&self.base);
        weights.for_each(|(weight, base)| *weight = f64x8::splat(*base));
        let one = f64x8::new([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).simd_gt(f64x8::ZERO);
        let [hx, hy] = ray.heading;
        let direction = Vec3x8 {
            x: f64x8::splat(ray.across * hx),
            y: f64x8::splat(ray.across * hy),
            z: f64x8::splat(ray.mu),
        };
        self.escape(one, f64x8::splat(ray.z_m), &direction, medium, false);
    }

    /// Weights, times `share`, of a ray that met its grain after `path`; it was
    /// not absorbed up to the least optical depth `survived`.
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
    fn escape(&mut self, lanes: f64x8, z_m: f64x8, direction: &Vec3x8, medium: f64, in_all: bool) {
        let walker = self.walker;
        let down = direction.z.simd_gt(f64x8::ZERO);
        let secant = f64x8::ONE / direction.z.abs().fast_max(f64x8::splat(1e-12));
        let tau = secant * walker.vertical(z_m, down, |s| 1.0 / s.mean_free_distance_m);
        let exp = |x: f64x8| f64x8::new(x.to_array().map(exp_neg));
        let mut chance = exp(tau);
        let lanes = (lanes & chance.simd_gt(f64x8::ZERO)).to_bitmask();
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
            *weight *= chance * down.select(f64x8::splat(band.transmitted), f64x8::ONE);
            if walker.absorbing_pores {
                let per_m =
                    |s: &Stratum| s.pores_per_m[usize::from(medium < s.water_saturation)][l];
                *weight *= exp(secant * walker.vertical(z_m, down, per_m));
            }
        }
        self.catch.catch(lanes, direction, &self.weights);
    }
}
