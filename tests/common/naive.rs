//! A straightforward implementation of the walk of docs/methods.md.
//!
//! It traces one ray at a time, uses the standard mathematical functions and a
//! different random number generator, and decides every absorption and
//! reflection by an analog trial. It shares no physics code with the library.
//! Both must agree within statistical errors.
use nalgebra::{Complex, Vector3};
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};

type V = Vector3<f64>;

/// A truncated normal distribution: minimum, maximum, mean, standard deviation.
pub(crate) type Law = [f64; 4];

/// One type of grain of a layer.
#[derive(Clone)]
pub(crate) struct Grain {
    pub(crate) size_m: [f64; 2],
    pub(crate) facetness: Law,
    pub(crate) sphericity: Law,
    /// Mean free path to grains of this type, m.
    pub(crate) distance_m: f64,
}

#[derive(Clone)]
pub(crate) struct Layer {
    pub(crate) grains: Vec<Grain>,
    pub(crate) saturation: f64,
    pub(crate) thickness_m: f64,
    /// Absorption coefficients of soot in the ice and in the pores, 1/m.
    pub(crate) soot_per_m: [f64; 2],
}

#[derive(Clone)]
pub(crate) struct Naive {
    /// Ordered from the surface down.
    pub(crate) layers: Vec<Layer>,
    pub(crate) ice: Complex<f64>,
    pub(crate) water: Complex<f64>,
    pub(crate) wavelength_m: f64,
    /// Incidence angle, rad. `None` is diffuse light.
    pub(crate) angle: Option<f64>,
    /// Whether entry points are uniform over the projected area of the grain.
    pub(crate) projected: bool,
    /// Lambertian reflectance of the substrate.
    pub(crate) substrate: f64,
}

/// Numbers of reflected, transmitted and lost rays.
pub(crate) type Counts = [u64; 3];

/// The outcome of a ray's interaction with a grain.
enum Event {
    /// The ray leaves the grain at this point, in this direction.
    Out(V, V),
    Absorbed,
    Lost,
}

/// The outcome of a flight.
enum Flight {
    /// The grain does not fit into the slab: the flight is repeated.
    Rejected,
    Absorbed,
    Up,
    Down,
    Hit(Hit),
}

/// The grain that a ray hits.
struct Hit {
    layer: usize,
    /// Depth of the contact, m.
    contact: f64,
    /// Contact point relative to the centre of the grain, in units of the major semi-axis.
    x: V,
    /// Major semi-axis, m.
    semi_axis_m: f64,
    axis: V,
    /// Ratio of the minor to the major semi-axis.
    c: f64,
    facetness: f64,
    wet: bool,
}

/// A random number of this distribution.
fn sample_truncated(law: Law, rng: &mut SmallRng) -> f64 {
    let [min, max, mean, sd] = law;
    if sd == 0.0 || min == max {
        return mean;
    }
    let normal = Normal::new(mean, sd).unwrap();
    loop {
        let x = normal.sample(rng);
        if (min..=max).contains(&x) {
            return x;
        }
    }
}

/// A uniformly distributed direction.
fn random_direction(rng: &mut SmallRng) -> V {
    loop {
        let v = V::from_fn(|_, _| rng.random_range(-1.0..1.0));
        if (1e-6..1.0).contains(&v.norm_squared()) {
            return v.normalize();
        }
    }
}

/// Fresnel reflectance and cosine of the refraction angle for complex refractive indices.
fn interface(from: Complex<f64>, to: Complex<f64>, c: f64) -> (f64, f64) {
    let eta2 = (to / from) * (to / from);
    let s2 = 1.0 - c * c;
    let q = (eta2 - s2).sqrt();
    let rs = (Complex::from(c) - q) / (q + c);
    let rp = (eta2 * c - q) / (eta2 * c + q);
    let reflectance = 0.5 * (rs.norm_sqr() + rp.norm_sqr());
    // Varsa 2025, eqs. A.7-A.9, with the corrections of docs/methods.md
    let (n, k) = (to.re / from.re, to.im / to.re);
    let scale = n * n * (1.0 + k * k).powi(2);
    let a = 1.0 - (1.0 - k * k) / scale * s2;
    let b = 2.0 * k / scale * s2;
    let q = (a * a + b * b).powf(0.25);
    let psi = 0.5 * (2.0 * k * s2).atan2(scale - (1.0 - k * k) * s2);
    let m = n * q * (psi.cos() - k * psi.sin());
    (reflectance, m / (s2 + m * m).sqrt())
}

/// The direction of the refracted ray.
fn refract(d: V, m: V, c: f64, cos: f64) -> V {
    let along = d + m * c;
    if along.norm() < 1e-12 {
        return -m;
    }
    along.normalize() * (1.0 - cos * cos).max(0.0).sqrt() - m * cos
}

/// The normal of a random facet that faces the ray.
fn facet(n: V, d: V, facetness: f64, rng: &mut SmallRng) -> V {
    for _ in 0..64 {
        let xi: f64 = Normal::new(0.0, facetness / 2.0).unwrap().sample(rng);
        let cos = 1.0 - xi.abs();
        let azimuth = rng.random_range(0.0..std::f64::consts::TAU);
        let side = if n.x.abs() < 0.5 { V::x() } else { V::y() };
        let t = n.cross(&side).normalize();
        let across = t * azimuth.cos() + n.cross(&t) * azimuth.sin();
        let m = n * cos + across * (1.0 - cos * cos).max(0.0).sqrt();
        if cos > 0.0 && m.dot(&d) < 0.0 {
            return m;
        }
    }
    n
}

impl Naive {
    pub(crate) fn run(&self, rays: u64, seed: u64) -> Counts {
        let mut rng = SmallRng::seed_from_u64(seed);
        let mut counts = [0; 3];
        for _ in 0..rays {
            if let Some(end) = self.walk(&mut rng) {
                counts[end] += 1;
            }
        }
        counts
    }

    /// Absorption coefficient of a medium with this refractive index, 1/m.
    fn alpha(&self, index: Complex<f64>) -> f64 {
        4.0 * std::f64::consts::PI * index.im / self.wavelength_m
    }

    /// Traces one ray. Returns the index into [`Counts`], or `None` if it is absorbed.
    fn walk(&self, rng: &mut SmallRng) -> Option<usize> {
        let cos = self
            .angle
            .map_or_else(|| rng.random::<f64>().sqrt(), f64::cos);
        let mut d = V::new((1.0 - cos * cos).sqrt(), 0.0, cos);
        let (mut z, mut layer) = (0.0, 0);
        for _ in 0..10_000_000 {
            let flight = loop {
                match self.fly(z, layer, d, rng) {
                    Flight::Rejected => {}
                    flight => break flight,
                }
            };
            match flight {
                Flight::Absorbed => return None,
                Flight::Down if rng.random::<f64>() < self.substrate => {
                    let cos = rng.random::<f64>().sqrt();
                    let azimuth = rng.random_range(0.0..std::f64::consts::TAU);
                    let sin = (1.0 - cos * cos).sqrt();
                    d = V::new(sin * azimuth.cos(), sin * azimuth.sin(), -cos);
                    (z, layer) = (self.top_m(self.layers.len()), self.layers.len() - 1);
                }
                Flight::Down => return Some(1),
                Flight::Hit(hit) => match self.event(&hit, d, rng) {
                    Event::Out(exit, direction) => {
                        z = hit.contact + hit.semi_axis_m * (exit.z - hit.x.z);
                        d = direction;
                        layer = 0;
                        while layer + 1 < self.layers.len() && z > self.top_m(layer + 1) {
                            layer += 1;
                        }
                    }
                    Event::Absorbed => return None,
                    Event::Lost => return Some(2),
                },
                _ => return Some(0),
            }
        }
        Some(2)
    }

    /// Depth of the top of a layer, m.
    fn top_m(&self, layer: usize) -> f64 {
        self.layers[..layer]
            .iter()
            .map(|layer| layer.thickness_m)
            .sum()
    }

    /// One flight from depth `z` in a layer, in direction `d`.
    fn fly(&self, mut z: f64, mut layer: usize, d: V, rng: &mut SmallRng) -> Flight {
        let u = rng.random::<f64>();
        let mut optical_depth = 0.0;
        loop {
            let current = &self.layers[layer];
            let wet = u < current.saturation;
            let alpha = current.soot_per_m[1] + if wet { self.alpha(self.water) } else { 0.0 };
            // draw a distance to each type of grain; the nearest grain is hit
            let mut flight = f64::INFINITY;
            let mut grain = &current.grains[0];
            for candidate in &current.grains {
                let distance = -candidate.distance_m * (1.0 - rng.random::<f64>()).ln();
                if distance < flight {
                    (flight, grain) = (distance, candidate);
                }
            }
            let contact = z + flight * d.z;
            if !(self.top_m(layer)..=self.top_m(layer + 1)).contains(&contact) {
                let down = d.z > 0.0;
                let plane = self.top_m(if down { layer + 1 } else { layer });
                optical_depth += alpha * (plane - z) / d.z;
                let last = if down { self.layers.len() - 1 } else { 0 };
                if layer == last {
                    return match (rng.random::<f64>() < (-optical_depth).exp(), down) {
                        (false, _) => Flight::Absorbed,
                        (true, true) => Flight::Down,
                        (true, false) => Flight::Up,
                    };
                }
                z = plane;
                layer = if down { layer + 1 } else { layer - 1 };
                continue;
            }
            optical_depth += alpha * flight;
            let semi_axis_m = 0.5 * rng.random_range(grain.size_m[0]..=grain.size_m[1]);
            let psi = sample_truncated(grain.sphericity, rng);
            let axis = random_direction(rng);
            let x = self.entry_point(d, axis, psi * psi, rng);
            let up = axis.z.abs();
            let reach = semi_axis_m * (up * up + psi.powi(4) * (1.0 - up * up)).sqrt();
            let centre = contact - semi_axis_m * x.z;
            if centre - reach < 0.0 || centre + reach > self.top_m(self.layers.len()) {
                return Flight::Rejected;
            }
            if rng.random::<f64>() >= (-optical_depth).exp() {
                return Flight::Absorbed;
            }
            let (c, facetness) = (psi * psi, sample_truncated(grain.facetness, rng));
            return Flight::Hit(Hit {
                layer,
                contact,
                x,
                semi_axis_m,
                axis,
                c,
                facetness,
                wet,
            });
        }
    }

    /// A random entry point on the spheroid with semi-axes 1 (along `axis`) and `c`.
    fn entry_point(&self, d: V, axis: V, c: f64, rng: &mut SmallRng) -> V {
        let stretch = |v: V| axis * v.dot(&axis) + (v - axis * v.dot(&axis)) * c;
        let shrink = |v: V| axis * v.dot(&axis) + (v - axis * v.dot(&axis)) / c;
        loop {
            let p = random_direction(rng);
            let normal = shrink(p);
            // area per unit-sphere area is proportional to |normal|, at most 1/c
            let weight = if self.projected {
                normal.dot(&d).abs() * c
            } else {
                normal.norm() * c
            };
            if rng.random::<f64>() < weight {
                return stretch(if normal.dot(&d) > 0.0 { -p } else { p });
            }
        }
    }

    fn event(&self, hit: &Hit, d: V, rng: &mut SmallRng) -> Event {
        let &Hit {
            x,
            semi_axis_m,
            axis,
            c,
            facetness,
            ..
        } = hit;
        let outside = if hit.wet {
            self.water
        } else {
            Complex::new(1.0, 0.0)
        };
        let alpha = self.alpha(self.ice) + self.layers[hit.layer].soot_per_m[0];
        let gradient = |x: V| axis * x.dot(&axis) + (x - axis * x.dot(&axis)) / (c * c);
        let n = gradient(x).normalize();
        let m = facet(n, d, facetness, rng);
        let cos = -m.dot(&d);
        let (reflectance, cos_t) = interface(outside, self.ice, cos);
        if rng.random::<f64>() < reflectance {
            return Event::Out(x, d + m * (2.0 * cos));
        }
        let mut t = refract(d, m, cos, cos_t);
        if t.dot(&n) >= 0.0 {
            let cos = -n.dot(&d);
            t = refract(d, n, cos, interface(outside, self.ice, cos).1);
        }
        let mut position = x;
        for _ in 0..10_000 {
            // the distance to the surface along t: |position + length t|^2 = 1 in the metric of
            // the spheroid
            let g = gradient(t);
            let length = (-2.0 * position.dot(&g) / t.dot(&g)).max(0.0);
            if rng.random::<f64>() >= (-alpha * length * semi_axis_m).exp() {
                return Event::Absorbed;
            }
            position += t * length;
            let inward = -gradient(position).normalize();
            let m = facet(inward, t, facetness, rng);
            let cos = (-m.dot(&t)).max(1e-12);
            let (reflectance, cos_t) = interface(self.ice, outside, cos);
            if rng.random::<f64>() >= reflectance {
                return Event::Out(position, refract(t, m, cos, cos_t).normalize());
            }
            let mirrored = t + m * (2.0 * cos);
            t = if mirrored.dot(&inward) > 0.0 {
                mirrored
            } else {
                t - inward * (2.0 * inward.dot(&t))
            };
        }
        Event::Lost
    }
}
