//! The walk of docs/methods.md written as plainly as possible: one ray at a
//! time, the platform's functions, analog trials on every path, another random
//! number generator. It shares no physics code with the library, which must
//! agree with it within statistics.
use nalgebra::{Complex, Vector3};
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};

type V = Vector3<f64>;

/// Minimum, maximum, mean, standard deviation.
pub(crate) type Law = [f64; 4];

/// One type of grain of a layer.
#[derive(Clone)]
pub(crate) struct Grain {
    pub(crate) size_m: [f64; 2],
    pub(crate) facetness: Law,
    pub(crate) sphericity: Law,
    /// Mean free distance to grains of this type, m.
    pub(crate) distance_m: f64,
}

#[derive(Clone)]
pub(crate) struct Layer {
    pub(crate) grains: Vec<Grain>,
    pub(crate) saturation: f64,
    pub(crate) thickness_m: f64,
    /// What soot absorbs in ice and in the pores, 1/m.
    pub(crate) soot_per_m: [f64; 2],
}

#[derive(Clone)]
pub(crate) struct Naive {
    /// From the surface down.
    pub(crate) layers: Vec<Layer>,
    pub(crate) ice: Complex<f64>,
    pub(crate) water: Complex<f64>,
    pub(crate) wavelength_m: f64,
    /// `None`: diffuse.
    pub(crate) angle: Option<f64>,
    /// Entry points uniform over the projected area.
    pub(crate) projected: bool,
    /// Lambertian reflectance of the substrate.
    pub(crate) substrate: f64,
}

/// Reflected, transmitted and lost rays.
pub(crate) type Counts = [u64; 3];

enum Event {
    Out(V, V),
    Absorbed,
    Lost,
}

/// What a flight came to.
enum Flight {
    /// The grain did not fit: fly again.
    Rejected,
    Absorbed,
    Up,
    Down,
    Met(Met),
}

/// A grain met.
struct Met {
    layer: usize,
    /// Depth of the contact, m.
    contact: f64,
    /// Contact in major semi-axes from the grain's centre.
    x: V,
    half: f64,
    axis: V,
    /// Minor semi-axis over major.
    c: f64,
    facetness: f64,
    wet: bool,
}

fn truncated(law: Law, rng: &mut SmallRng) -> f64 {
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

fn sphere(rng: &mut SmallRng) -> V {
    loop {
        let v = V::from_fn(|_, _| rng.random_range(-1.0..1.0));
        if (1e-6..1.0).contains(&v.norm_squared()) {
            return v.normalize();
        }
    }
}

/// Fresnel reflectance and cosine of refraction from complex indices.
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

fn refract(d: V, m: V, c: f64, cos: f64) -> V {
    let along = d + m * c;
    if along.norm() < 1e-12 {
        return -m;
    }
    along.normalize() * (1.0 - cos * cos).max(0.0).sqrt() - m * cos
}

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

    /// Absorption coefficient of a medium with this index, 1/m.
    fn alpha(&self, index: Complex<f64>) -> f64 {
        4.0 * std::f64::consts::PI * index.im / self.wavelength_m
    }

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
                    (z, layer) = (self.plane(self.layers.len()), self.layers.len() - 1);
                }
                Flight::Down => return Some(1),
                Flight::Met(met) => match self.event(&met, d, rng) {
                    Event::Out(end, direction) => {
                        z = met.contact + met.half * (end.z - met.x.z);
                        d = direction;
                        layer = 0;
                        while layer + 1 < self.layers.len() && z > self.plane(layer + 1) {
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

    /// Depth of the plane over a layer, m.
    fn plane(&self, layer: usize) -> f64 {
        self.layers[..layer]
            .iter()
            .map(|layer| layer.thickness_m)
            .sum()
    }

    /// One flight from depth `z` in a layer.
    fn fly(&self, mut z: f64, mut layer: usize, d: V, rng: &mut SmallRng) -> Flight {
        let u = rng.random::<f64>();
        let mut depth = 0.0;
        loop {
            let here = &self.layers[layer];
            let wet = u < here.saturation;
            let alpha = here.soot_per_m[1] + if wet { self.alpha(self.water) } else { 0.0 };
            // one candidate of each type: the nearest is met
            let mut flight = f64::INFINITY;
            let mut grain = &here.grains[0];
            for candidate in &here.grains {
                let distance = -candidate.distance_m * (1.0 - rng.random::<f64>()).ln();
                if distance < flight {
                    (flight, grain) = (distance, candidate);
                }
            }
            let contact = z + flight * d.z;
            if !(self.plane(layer)..=self.plane(layer + 1)).contains(&contact) {
                let down = d.z > 0.0;
                let plane = self.plane(if down { layer + 1 } else { layer });
                depth += alpha * (plane - z) / d.z;
                let last = if down { self.layers.len() - 1 } else { 0 };
                if layer == last {
                    return match (rng.random::<f64>() < (-depth).exp(), down) {
                        (false, _) => Flight::Absorbed,
                        (true, true) => Flight::Down,
                        (true, false) => Flight::Up,
                    };
                }
                z = plane;
                layer = if down { layer + 1 } else { layer - 1 };
                continue;
            }
            depth += alpha * flight;
            let half = 0.5 * rng.random_range(grain.size_m[0]..=grain.size_m[1]);
            let psi = truncated(grain.sphericity, rng);
            let axis = sphere(rng);
            let x = self.point(d, axis, psi * psi, rng);
            let up = axis.z.abs();
            let reach = half * (up * up + psi.powi(4) * (1.0 - up * up)).sqrt();
            let centre = contact - half * x.z;
            if centre - reach < 0.0 || centre + reach > self.plane(self.layers.len()) {
                return Flight::Rejected;
            }
            if rng.random::<f64>() >= (-depth).exp() {
                return Flight::Absorbed;
            }
            let (c, facetness) = (psi * psi, truncated(grain.facetness, rng));
            return Flight::Met(Met {
                layer,
                contact,
                x,
                half,
                axis,
                c,
                facetness,
                wet,
            });
        }
    }

    /// Point of entry on the spheroid with semi-axes 1 (along `axis`) and `c`.
    fn point(&self, d: V, axis: V, c: f64, rng: &mut SmallRng) -> V {
        let stretch = |v: V| axis * v.dot(&axis) + (v - axis * v.dot(&axis)) * c;
        let shrink = |v: V| axis * v.dot(&axis) + (v - axis * v.dot(&axis)) / c;
        loop {
            let p = sphere(rng);
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

    fn event(&self, met: &Met, d: V, rng: &mut SmallRng) -> Event {
        let &Met {
            x,
            half,
            axis,
            c,
            facetness,
            ..
        } = met;
        let outside = if met.wet {
            self.water
        } else {
            Complex::new(1.0, 0.0)
        };
        let alpha = self.alpha(self.ice) + self.layers[met.layer].soot_per_m[0];
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
        let mut at = x;
        for _ in 0..10_000 {
            // |x + s t|^2 in the metric of the spheroid is 1 again
            let g = gradient(t);
            let length = (-2.0 * at.dot(&g) / t.dot(&g)).max(0.0);
            if rng.random::<f64>() >= (-alpha * length * half).exp() {
                return Event::Absorbed;
            }
            at += t * length;
            let inward = -gradient(at).normalize();
            let m = facet(inward, t, facetness, rng);
            let cos = (-m.dot(&t)).max(1e-12);
            let (reflectance, cos_t) = interface(self.ice, outside, cos);
            if rng.random::<f64>() >= reflectance {
                return Event::Out(at, refract(t, m, cos, cos_t).normalize());
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
