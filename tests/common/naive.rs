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
use splitsnow::grain::{Facets, Shape};

type V = Vector3<f64>;

/// A truncated normal distribution: minimum, maximum, mean, standard deviation.
pub(crate) type Law = [f64; 4];

/// One type of grain of a layer.
#[derive(Clone)]
pub(crate) struct Grain {
    pub(crate) size_m: [f64; 2],
    pub(crate) facetness: Law,
    pub(crate) shape: Shape,
    /// Sphericity or aspect ratio.
    pub(crate) proportion: Law,
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
    /// Whether entry points are uniform over the projected area of the grain, by which its
    /// attitudes are weighted too.
    pub(crate) projected: bool,
    pub(crate) facets: Facets,
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
    /// Contact point relative to the centre of the grain, in units of half its size.
    x: V,
    /// Half of the size, m.
    semi_axis_m: f64,
    body: Body,
    facetness: f64,
    wet: bool,
}

/// A body in its random attitude, in units of half its size.
enum Body {
    /// The axis, and the semi-axes along and across it.
    Spheroid(V, f64, f64),
    /// Normals of the faces, their distances from the centre, and the corners.
    Prism(Vec<(V, f64)>, Vec<V>),
}

impl Body {
    fn random(shape: Shape, proportion: f64, rng: &mut SmallRng) -> Self {
        let axis = random_direction(rng);
        let minor = proportion * proportion;
        if shape == Shape::Spheroid {
            return Self::Spheroid(axis, 1.0, minor);
        }
        if shape == Shape::Oblate {
            return Self::Spheroid(axis, minor, 1.0);
        }
        let side = if axis.x.abs() < 0.5 { V::x() } else { V::y() };
        let first = axis.cross(&side).normalize();
        let second = axis.cross(&first);
        let start = rng.random_range(0.0..std::f64::consts::TAU);
        let radial = |sixth: f64| {
            let (sin, cos) = (start + sixth * std::f64::consts::FRAC_PI_3).sin_cos();
            first * cos + second * sin
        };
        let radius = 1.0 / (1.0 + proportion * proportion).sqrt();
        let half = proportion * radius;
        let mut faces = vec![(axis, half), (-axis, half)];
        let mut corners = Vec::new();
        for number in 0..6 {
            faces.push((radial(f64::from(number)), 0.75_f64.sqrt() * radius));
            let corner = radial(f64::from(number) + 0.5) * radius;
            corners.extend([corner + axis * half, corner - axis * half]);
        }
        Self::Prism(faces, corners)
    }

    /// The outward normal, not normalised.
    fn normal(&self, x: V) -> V {
        match self {
            Self::Spheroid(axis, along, across) => {
                let u = axis * x.dot(axis);
                u / (along * along) + (x - u) / (across * across)
            }
            Self::Prism(faces, _) => {
                let beyond = |(n, distance): &(V, f64)| x.dot(n) / distance;
                let by = |a: &&(V, f64), b: &&(V, f64)| beyond(a).total_cmp(&beyond(b));
                faces.iter().max_by(by).unwrap().0
            }
        }
    }

    /// The distance from `x` on the surface along `d` to the far side.
    fn chord(&self, x: V, d: V) -> f64 {
        match self {
            Self::Spheroid(..) => {
                let g = self.normal(d);
                (-2.0 * x.dot(&g) / d.dot(&g)).max(0.0)
            }
            Self::Prism(faces, _) => {
                let ahead = faces.iter().filter(|(n, _)| n.dot(&d) > 1e-12);
                let lengths = ahead.map(|(n, distance)| (distance - x.dot(n)) / n.dot(&d));
                lengths.fold(f64::INFINITY, f64::min).max(0.0)
            }
        }
    }

    /// Half of the vertical extent.
    fn reach(&self) -> f64 {
        match self {
            Self::Spheroid(axis, along, across) => {
                let up = axis.z * axis.z;
                (along * along * up + across * across * (1.0 - up)).sqrt()
            }
            Self::Prism(_, corners) => corners.iter().map(|c| c.z).fold(0.0, f64::max),
        }
    }

    /// A random point on the side that faces a ray of direction `d`, uniform over the surface.
    fn surface_point(&self, d: V, rng: &mut SmallRng) -> V {
        let point = loop {
            match self {
                Self::Spheroid(axis, along, across) => {
                    let p = random_direction(rng);
                    let u = axis * p.dot(axis);
                    let normal = u / *along + (p - u) / *across;
                    // area per unit-sphere area is proportional to |normal|
                    if rng.random::<f64>() < normal.norm() * along.min(*across) {
                        break u * *along + (p - u) * *across;
                    }
                }
                // random lines meet every part of a convex surface equally often
                Self::Prism(..) => {
                    let line = random_direction(rng);
                    if let Some(point) = self.random_hit(line, rng) {
                        break point;
                    }
                }
            }
        };
        match self.normal(point).dot(&d) > 0.0 {
            true => -point,
            false => point,
        }
    }

    /// Where a ray of direction `d` through a uniform point of the disc of radius 1 meets the
    /// body, if it does.
    fn random_hit(&self, d: V, rng: &mut SmallRng) -> Option<V> {
        let side = if d.x.abs() < 0.5 { V::x() } else { V::y() };
        let first = d.cross(&side).normalize();
        let azimuth = rng.random_range(0.0..std::f64::consts::TAU);
        let start = (first * azimuth.cos() + d.cross(&first) * azimuth.sin())
            * rng.random::<f64>().sqrt()
            - d * 2.0;
        let (mut enters, mut leaves) = (0.0, f64::INFINITY);
        match self {
            Self::Spheroid(..) => {
                let (a, b) = (d.dot(&self.normal(d)), start.dot(&self.normal(d)));
                let c = start.dot(&self.normal(start)) - 1.0;
                let root = b * b - a * c;
                if root < 0.0 {
                    return None;
                }
                enters = (-b - root.sqrt()) / a;
            }
            Self::Prism(faces, _) => {
                for (n, distance) in faces {
                    let (slope, gap) = (n.dot(&d), distance - start.dot(n));
                    if slope < 0.0 {
                        enters = f64::max(enters, gap / slope);
                    } else {
                        leaves = f64::min(leaves, gap / slope);
                    }
                }
            }
        }
        (enters < leaves).then(|| start + d * enters)
    }
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

/// A random facet: 1 - |xi|, the cosine of its tilt as published, and the unit vector toward
/// which it is tilted.
fn tilt(n: V, facetness: f64, rng: &mut SmallRng) -> (f64, V) {
    let xi: f64 = Normal::new(0.0, facetness / 2.0).unwrap().sample(rng);
    let azimuth = rng.random_range(0.0..std::f64::consts::TAU);
    let side = if n.x.abs() < 0.5 { V::x() } else { V::y() };
    let t = n.cross(&side).normalize();
    let across = t * azimuth.cos() + n.cross(&t) * azimuth.sin();
    (1.0 - xi.abs(), across)
}

/// The normal of a random facet that faces the ray. If `visible`, facets have the weight of
/// the area that the ray sees.
fn facet(n: V, d: V, facetness: f64, visible: bool, rng: &mut SmallRng) -> V {
    for _ in 0..if visible { 2000 } else { 64 } {
        let (cos, across) = tilt(n, facetness, rng);
        let m = n * cos + across * (1.0 - cos * cos).max(0.0).sqrt();
        let seen = -m.dot(&d);
        if cos > 0.0 && seen > if visible { rng.random::<f64>() } else { 0.0 } {
            return m;
        }
    }
    n
}

/// Reflects or refracts a ray at a surface with the normal `m` by chance. Returns whether it is
/// refracted, and its direction.
fn cross(d: V, m: V, from: Complex<f64>, to: Complex<f64>, rng: &mut SmallRng) -> (bool, V) {
    let c = (-m.dot(&d)).max(1e-12);
    let (reflectance, cos_t) = interface(from, to, c);
    if rng.random::<f64>() < reflectance {
        return (false, d + m * (2.0 * c));
    }
    (true, refract(d, m, c, cos_t).normalize())
}

/// A hit on a surface of V-grooves with the normal `n`: ridges and bottoms alternate at integer
/// distances `x` across. Follows the ray until it meets no facet any more.
fn cross_groove(
    (n, d): (V, V),
    facetness: f64,
    from: Complex<f64>,
    to: Complex<f64>,
    rng: &mut SmallRng,
) -> (bool, V) {
    let (rest, across) = tilt(n, facetness, rng);
    let ridge = 1.0 - rest;
    let angle = ridge.atan();
    let (sin, cos) = angle.sin_cos();
    if ridge < 1e-9 {
        return cross(d, n, from, to, rng);
    }
    let (mut x, mut z): (f64, f64) = (rng.random_range(-1.0..1.0), ridge);
    let (mut d, mut above) = (d, true);
    loop {
        let (dx, dz) = (d.dot(&across), d.dot(&n));
        let mut nearest = (f64::INFINITY, 0.0);
        for number in -3..3 {
            let left = f64::from(number);
            let (start, slope) = match number % 2 == 0 {
                true => (0.0, ridge),
                false => (ridge, -ridge),
            };
            let length = (start + slope * (x - left) - z) / (dz - slope * dx);
            let hit = x + length * dx;
            if length > 1e-9 && length < nearest.0 && hit >= left && hit <= left + 1.0 {
                nearest = (length, slope);
            }
        }
        let (length, slope) = nearest;
        if length == f64::INFINITY {
            return (!above, d);
        }
        x += length * dx;
        z += length * dz;
        x -= 2.0 * ((x + 1.0) / 2.0).floor();
        let m = n * cos - across * (sin * slope.signum());
        let (refracted, next) = match above {
            true => cross(d, m, from, to, rng),
            false => cross(d, -m, to, from, rng),
        };
        d = next.normalize();
        above ^= refracted;
    }
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
            let proportion = sample_truncated(grain.proportion, rng);
            let (body, x) = self.meet(grain.shape, proportion, d, rng);
            let reach = semi_axis_m * body.reach();
            let centre = contact - semi_axis_m * x.z;
            if centre - reach < 0.0 || centre + reach > self.top_m(self.layers.len()) {
                return Flight::Rejected;
            }
            if rng.random::<f64>() >= (-optical_depth).exp() {
                return Flight::Absorbed;
            }
            let facetness = sample_truncated(grain.facetness, rng);
            return Flight::Hit(Hit {
                layer,
                contact,
                x,
                semi_axis_m,
                body,
                facetness,
                wet,
            });
        }
    }

    /// A random body, and the point where the ray meets it.
    fn meet(&self, shape: Shape, proportion: f64, d: V, rng: &mut SmallRng) -> (Body, V) {
        loop {
            let body = Body::random(shape, proportion, rng);
            if !self.projected {
                let point = body.surface_point(d, rng);
                return (body, point);
            }
            if let Some(point) = body.random_hit(d, rng) {
                return (body, point);
            }
        }
    }

    /// A hit of a ray on the surface with the normal `n` that faces it. Returns whether it is
    /// refracted, and its direction. In ice it stays inside the body or leaves it.
    fn hit(
        &self,
        (n, d): (V, V),
        facetness: f64,
        [from, to]: [Complex<f64>; 2],
        in_ice: bool,
        rng: &mut SmallRng,
    ) -> (bool, V) {
        if self.facets == Facets::VGroove {
            return cross_groove((n, d), facetness, from, to, rng);
        }
        let visible = self.facets == Facets::Visible;
        let m = facet(n, d, facetness, visible, rng);
        let (refracted, next) = cross(d, m, from, to, rng);
        // a ray that enters the ice or stays there must go into the body
        let goes_in = next.dot(&n) * if refracted { -1.0 } else { 1.0 } > 0.0;
        if goes_in || refracted == in_ice {
            return (refracted, next);
        }
        let c = -n.dot(&d);
        match refracted {
            true => (true, refract(d, n, c, interface(from, to, c).1)),
            false => (false, d + n * (2.0 * c)),
        }
    }

    fn event(&self, hit: &Hit, d: V, rng: &mut SmallRng) -> Event {
        let &Hit {
            x,
            semi_axis_m,
            facetness,
            ..
        } = hit;
        let body = &hit.body;
        let outside = if hit.wet {
            self.water
        } else {
            Complex::new(1.0, 0.0)
        };
        let alpha = self.alpha(self.ice) + self.layers[hit.layer].soot_per_m[0];
        let n = body.normal(x).normalize();
        let (enters, mut t) = self.hit((n, d), facetness, [outside, self.ice], false, rng);
        if !enters {
            return Event::Out(x, t);
        }
        let mut position = x;
        for _ in 0..10_000 {
            let length = body.chord(position, t);
            if rng.random::<f64>() >= (-alpha * length * semi_axis_m).exp() {
                return Event::Absorbed;
            }
            position += t * length;
            let inward = -body.normal(position).normalize();
            let (leaves, next) = self.hit((inward, t), facetness, [self.ice, outside], true, rng);
            if leaves {
                return Event::Out(position, next);
            }
            t = next;
        }
        Event::Lost
    }
}
