//! Sensors of equal solid angle on a hemisphere.
//!
//! The layout is a cap about the normal and rings around it. Each ring is divided into
//! sensors of equal azimuth that are about as wide as high. Every ring but the last has
//! an even number of sensors; on either side of the normal, one of them is centred on
//! the plane of incidence. The last ring takes the rest of the requested number. If
//! that is odd, two of its sensors meet in the plane of incidence at azimuth pi. The
//! layout is its own mirror image in the plane of incidence.
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use splitsnow_spectra::simd::{F64x8, Portable, Simd};

use crate::math::{Vec3, Vec3x8, set_lanes};

/// Largest number of sensors per hemisphere.
pub const MOST_SENSORS: usize = 100_000;

/// Sensors at the same angle from the normal.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Ring {
    /// Number of the first sensor.
    first: usize,
    /// Number of sensors.
    count: usize,
}

/// A layout of sensors.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensors {
    rings: Vec<Ring>,
    /// Number of the ring of each sensor.
    ring_of: Vec<u32>,
}

/// Angles of (x, |y|) from the x axis, in [0, pi]; absolute error below 1e-9.
#[inline(always)]
fn half_turns<S: Simd>(x: F64x8<S>, y: F64x8<S>) -> F64x8<S> {
    const TAN_PI_8: f64 = 0.414_213_562_373_095_03;
    let (a, b) = (x.abs(), y.abs());
    let (low, high) = (a.min(b), a.max(b).max(F64x8::splat(f64::MIN_POSITIVE)));
    // low / high, turned back by 45 degrees if it is larger than tan 22.5 degrees
    let turned = low.gt(F64x8::splat(TAN_PI_8) * high);
    let t = turned.select(low - high, low) / turned.select(low + high, high);
    let u = t * t;
    let mut p = F64x8::splat(-1.0 / 19.0);
    for (k, odd) in [17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0]
        .into_iter()
        .enumerate()
    {
        let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
        p = p * u + F64x8::splat(sign / odd);
    }
    let angle = p * t + turned.select(F64x8::splat(FRAC_PI_4), F64x8::ZERO);
    let angle = b.gt(a).select(F64x8::splat(FRAC_PI_2) - angle, angle);
    x.lt(F64x8::ZERO).select(F64x8::splat(PI) - angle, angle)
}

impl Sensors {
    /// A layout of `count` sensors; `count` is clamped to [1, [`MOST_SENSORS`]].
    #[must_use]
    pub fn new(count: usize) -> Self {
        let count = count.clamp(1, MOST_SENSORS);
        let n = count as f64;
        let cap = libm::acos(1.0 - 1.0 / n);
        let heights = ((FRAC_PI_2 - cap) / (TAU / n).sqrt()).round().max(1.0);
        let mut rings = vec![Ring { first: 0, count: 1 }];
        let mut first = 1;
        for ring in 1..=heights as u32 {
            let lower = cap + (FRAC_PI_2 - cap) * f64::from(ring) / heights;
            let remaining = count - first;
            let ideal = n * (1.0 - libm::cos(lower)) - first as f64;
            let even = 2 * (0.5 * ideal).round().max(1.0) as usize;
            let is_last = ring == heights as u32;
            let count = if is_last {
                remaining
            } else {
                even.min(remaining)
            };
            if count > 0 {
                rings.push(Ring { first, count });
            }
            first += count;
        }
        let repeated =
            |(number, ring): (usize, &Ring)| std::iter::repeat_n(number as u32, ring.count);
        let ring_of = rings.iter().enumerate().flat_map(repeated).collect();
        Self { rings, ring_of }
    }

    /// Number of sensors.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ring_of.len()
    }

    /// Always false: there is at least one sensor.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ring_of.is_empty()
    }

    /// Solid angle of each sensor, sr.
    #[must_use]
    pub fn solid_angle_sr(&self) -> f64 {
        TAU / self.len() as f64
    }

    /// Solid angle of a sensor projected on the surface, sr.
    #[must_use]
    pub fn projected_sr(&self, sensor: usize) -> f64 {
        self.solid_angle_sr() * self.mean_cosine(self.ring(sensor))
    }

    fn ring(&self, sensor: usize) -> Ring {
        self.rings[self.ring_of[sensor] as usize]
    }

    /// Mean cosine of the angle from the normal over a ring. The angle with this cosine
    /// divides the ring into halves of equal solid angle.
    fn mean_cosine(&self, ring: Ring) -> f64 {
        1.0 - (ring.first as f64 + 0.5 * ring.count as f64) / self.len() as f64
    }

    /// The sensor hit by light that leaves along the unit vector `direction`, above or
    /// below the surface. Azimuth 0 is along x.
    #[must_use]
    pub fn index(&self, direction: Vec3) -> usize {
        let sensor = self.folded(direction);
        if direction.y < 0.0 {
            self.mirrored(sensor)
        } else {
            sensor
        }
    }

    /// Like [`Sensors::index`], for the direction or its mirror image in the plane of
    /// incidence, whichever has y >= 0.
    #[inline(always)]
    pub(crate) fn folded(&self, direction: Vec3) -> usize {
        let [x, y, z] = [direction.x, direction.y, direction.z].map(F64x8::<Portable>::splat);
        self.folded_lanes(&Vec3x8 { x, y, z }, 1)[0]
    }

    /// [`Sensors::folded`] of those of eight directions whose bits are set in `lanes`.
    #[inline(always)]
    pub(crate) fn folded_lanes<S: Simd>(&self, direction: &Vec3x8<S>, lanes: u32) -> [usize; 8] {
        let turns = half_turns(direction.x, direction.y) * F64x8::splat(1.0 / TAU);
        let positions = (F64x8::ONE - direction.z.abs()) * F64x8::splat(self.len() as f64);
        let mut sensors = [0; 8];
        for lane in set_lanes(lanes) {
            let position = positions.as_array()[lane] as usize;
            let ring = self.ring_of[position.min(self.len() - 1)];
            let Ring { first, count } = self.rings[ring as usize];
            let cell = (turns.as_array()[lane] * count as f64 + 0.5) as usize;
            sensors[lane] = first + cell.min(count / 2);
        }
        sensors
    }

    /// The mirror image of `sensor` in the plane of incidence.
    #[must_use]
    pub fn mirrored(&self, sensor: usize) -> usize {
        let Ring { first, count } = self.ring(sensor);
        first + (count - (sensor - first)) % count
    }

    /// The centre of a sensor: angle from the normal and azimuth in [0, 2 pi), rad.
    #[must_use]
    pub fn centre_rad(&self, sensor: usize) -> [f64; 2] {
        let ring = self.ring(sensor);
        if ring.first == 0 {
            return [0.0; 2];
        }
        let azimuth = TAU * (sensor - ring.first) as f64 / ring.count as f64;
        [libm::acos(self.mean_cosine(ring)), azimuth]
    }

    /// The bounds of a sensor, rad: smallest and largest angle from the normal, and
    /// smallest and largest azimuth, which lie on either side of that of its centre.
    #[must_use]
    pub fn cell_rad(&self, sensor: usize) -> [[f64; 2]; 2] {
        let ring = self.ring(sensor);
        let bound = |cells: usize| libm::acos(1.0 - cells as f64 / self.len() as f64);
        let polar = [bound(ring.first), bound(ring.first + ring.count)];
        let [_, azimuth] = self.centre_rad(sensor);
        let half = PI / ring.count as f64;
        [polar, [azimuth - half, azimuth + half]]
    }

    /// The sensors cut by the plane of incidence, from the horizon on the side of the
    /// light (azimuth pi) over the normal to the other horizon, with their angles from
    /// the normal and azimuths 0 or pi, rad. Of two sensors that meet in the plane, the
    /// one with azimuth below pi is returned.
    #[must_use]
    pub fn principal_plane(&self) -> Vec<(usize, [f64; 2])> {
        let rings = || self.rings[1..].iter();
        let polar = |ring: &Ring| libm::acos(self.mean_cosine(*ring));
        let back = rings()
            .rev()
            .map(|ring| (ring.first + ring.count / 2, [polar(ring), PI]));
        let forward = rings().map(|ring| (ring.first, [polar(ring), 0.0]));
        back.chain([(0, [0.0; 2])]).chain(forward).collect()
    }

    /// Averages `sums` (rows of `width`, one per sensor) over the sensors that are
    /// equivalent by symmetry: a sensor and its mirror image, or, if the light is
    /// symmetric about the normal (`axial`), all sensors of a ring.
    pub(crate) fn symmetrise(&self, axial: bool, sums: &mut [f64], width: usize) {
        for ring in &self.rings {
            let rows = &mut sums[ring.first * width..(ring.first + ring.count) * width];
            for column in 0..width {
                let index = |cell: usize| cell * width + column;
                if axial {
                    let sum: f64 = (0..ring.count).map(|cell| rows[index(cell)]).sum();
                    (0..ring.count).for_each(|cell| rows[index(cell)] = sum / ring.count as f64);
                    continue;
                }
                for cell in 1..ring.count.div_ceil(2) {
                    let image = ring.count - cell;
                    let mean = 0.5 * (rows[index(cell)] + rows[index(image)]);
                    (rows[index(cell)], rows[index(image)]) = (mean, mean);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_of_equal_solid_angle_about_their_centres() {
        let sensors = Sensors::new(321);
        for sensor in 0..sensors.len() {
            let [polar, azimuth] = sensors.cell_rad(sensor);
            let solid = (libm::cos(polar[0]) - libm::cos(polar[1])) * (azimuth[1] - azimuth[0]);
            assert!((solid - sensors.solid_angle_sr()).abs() < 1e-9, "{sensor}");
            let centre = sensors.centre_rad(sensor);
            assert!(polar[0] <= centre[0] && centre[0] < polar[1], "{sensor}");
            assert!((0.5 * (azimuth[0] + azimuth[1]) - centre[1]).abs() < 1e-9);
        }
    }

    #[test]
    fn half_turns_are_angles() {
        for i in 0..=20_000 {
            let angle = PI * f64::from(i) / 20_000.0;
            for y in [libm::sin(angle), -libm::sin(angle)] {
                let [cos, y] = [libm::cos(angle), y].map(F64x8::<Portable>::splat);
                let [ours, ..] = half_turns(cos, y).to_array();
                assert!((ours - angle).abs() < 1e-8, "{angle} {ours}");
            }
        }
        let zero = F64x8::<Portable>::ZERO;
        assert_eq!(half_turns(zero, zero), zero);
    }
}
