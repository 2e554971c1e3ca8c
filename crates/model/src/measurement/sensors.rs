//! Sensors of equal solid angle on a hemisphere.
//!
//! A cap about the normal and rings around it, each cut into cells of equal
//! azimuth that are about as wide as high. Every ring but the last has an even
//! number of cells, with one centred on the plane of incidence on either side
//! of the normal; the last takes what is left of the number asked for, and with
//! an odd number two of its cells meet in that plane, away from azimuth 0. The
//! layout is its own mirror image in the plane of incidence.
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use crate::math::Vec3;

/// Most sensors of a hemisphere.
pub const MOST_SENSORS: usize = 100_000;

/// Sensors at the same angle from the normal.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Ring {
    first: usize,
    count: usize,
}

/// A layout of sensors.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensors {
    rings: Vec<Ring>,
    /// Ring of each sensor.
    ring_of: Vec<u32>,
}

/// Angle of (x, |y|) from the x axis, in [0, pi]; absolute error below 1e-9.
#[inline(always)]
fn half_turn(x: f64, y: f64) -> f64 {
    const TAN_PI_8: f64 = 0.414_213_562_373_095_03;
    let (a, b) = (x.abs(), y.abs());
    let (low, high) = (a.min(b), a.max(b).max(f64::MIN_POSITIVE));
    let t = low / high;
    let (t, base) = if t > TAN_PI_8 {
        ((low - high) / (low + high), FRAC_PI_4)
    } else {
        (t, 0.0)
    };
    let u = t * t;
    let mut p = -1.0 / 19.0;
    for (k, odd) in [17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0]
        .into_iter()
        .enumerate()
    {
        let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
        p = p * u + sign / odd;
    }
    let angle = base + p * t;
    let angle = if b > a { FRAC_PI_2 - angle } else { angle };
    if x < 0.0 { PI - angle } else { angle }
}

impl Sensors {
    /// `count` sensors, within [1, [`MOST_SENSORS`]].
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
            let left = count - first;
            let ideal = n * (1.0 - libm::cos(lower)) - first as f64;
            let even = 2 * (0.5 * ideal).round().max(1.0) as usize;
            let last = ring == heights as u32;
            let count = if last { left } else { even.min(left) };
            if count > 0 {
                rings.push(Ring { first, count });
            }
            first += count;
        }
        let of = |(number, ring): (usize, &Ring)| std::iter::repeat_n(number as u32, ring.count);
        let ring_of = rings.iter().enumerate().flat_map(of).collect();
        Self { rings, ring_of }
    }

    /// Number of sensors.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ring_of.len()
    }

    /// Never: there is one at least.
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

    /// Mean cosine from the normal over a ring, which halves its solid angle.
    fn mean_cosine(&self, ring: Ring) -> f64 {
        1.0 - (ring.first as f64 + 0.5 * ring.count as f64) / self.len() as f64
    }

    /// The sensor that light leaving along the unit vector `direction` meets,
    /// above the surface or below, whichever side it leaves on: azimuth 0 along x.
    #[must_use]
    pub fn index(&self, direction: Vec3) -> usize {
        let sensor = self.folded(direction);
        if direction.y < 0.0 {
            self.mirrored(sensor)
        } else {
            sensor
        }
    }

    /// The same of the direction or its mirror image in the plane of incidence,
    /// whichever has y >= 0.
    #[inline(always)]
    pub(crate) fn folded(&self, direction: Vec3) -> usize {
        let place = (1.0 - direction.z.abs()) * self.len() as f64;
        let ring = self.ring_of[(place as usize).min(self.len() - 1)];
        let Ring { first, count } = self.rings[ring as usize];
        let turns = half_turn(direction.x, direction.y) * (1.0 / TAU);
        let cell = (turns * count as f64 + 0.5) as usize;
        first + cell.min(count / 2)
    }

    /// Its mirror image in the plane of incidence.
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

    /// The cell of a sensor: least and largest angle from the normal, and least and
    /// largest azimuth about that of its centre, rad.
    #[must_use]
    pub fn cell_rad(&self, sensor: usize) -> [[f64; 2]; 2] {
        let ring = self.ring(sensor);
        let bound = |cells: usize| libm::acos(1.0 - cells as f64 / self.len() as f64);
        let polar = [bound(ring.first), bound(ring.first + ring.count)];
        let [_, azimuth] = self.centre_rad(sensor);
        let half = PI / ring.count as f64;
        [polar, [azimuth - half, azimuth + half]]
    }

    /// The sensors that the plane of incidence cuts, from the horizon on the
    /// side of the light (azimuth pi) over the normal to the other horizon, with
    /// their angles from the normal and azimuths 0 or pi. Of two that meet in the
    /// plane the one at azimuth below pi is given.
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

    /// Gives every sensor the mean of `sums` (rows of `width`, one per sensor)
    /// over those that a symmetry of the light makes equal: the mirror image, or
    /// with light symmetric about the normal the ring.
    pub(crate) fn symmetrise(&self, axial: bool, sums: &mut [f64], width: usize) {
        for ring in &self.rings {
            let rows = &mut sums[ring.first * width..(ring.first + ring.count) * width];
            for column in 0..width {
                let at = |cell: usize| cell * width + column;
                if axial {
                    let sum: f64 = (0..ring.count).map(|cell| rows[at(cell)]).sum();
                    (0..ring.count).for_each(|cell| rows[at(cell)] = sum / ring.count as f64);
                    continue;
                }
                for cell in 1..ring.count.div_ceil(2) {
                    let image = ring.count - cell;
                    let mean = 0.5 * (rows[at(cell)] + rows[at(image)]);
                    (rows[at(cell)], rows[at(image)]) = (mean, mean);
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
    fn half_turn_is_the_angle() {
        for i in 0..=20_000 {
            let angle = PI * f64::from(i) / 20_000.0;
            for y in [libm::sin(angle), -libm::sin(angle)] {
                let ours = half_turn(libm::cos(angle), y);
                assert!((ours - angle).abs() < 1e-8, "{angle} {ours}");
            }
        }
        assert_eq!(half_turn(0.0, 0.0), 0.0);
    }
}
