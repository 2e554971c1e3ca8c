//! One ray and one grain: closed forms of the sphere, and values of independent prototypes for
//! the representative sample.
use std::f64::consts::PI;

use splitsnow::grain::{
    Events, Facets, GrainType, Grains, Shape, SizeLaw, Surface, TruncatedNormal, shape_factor,
};
use splitsnow::math::Vec3;
use splitsnow::measurement::Measured;
use splitsnow::optics::{Index, Interface};
use splitsnow::transport::{Entry, contact, meets};

use super::{assert_close, mean};
use crate::quoted::numbers;
use crate::snow::{AIR, dry, spheres, stream};

/// Unpolarised reflectance of a dielectric of relative index `n` at the cosine `c`.
pub(crate) fn fresnel(c: f64, n: f64) -> f64 {
    let q = (n * n - 1.0 + c * c).sqrt();
    let (rs, rp) = ((c - q) / (c + q), (n * n * c - q) / (n * n * c + q));
    0.5 * (rs * rs + rp * rp)
}

/// Result of one grain event.
struct Outcome {
    /// Cosine of the deflection.
    cos: f64,
    /// Path in ice, m.
    ice_m: f64,
    /// Number of steps until the ray was outside again: 1 is a reflection at entry.
    steps: u32,
}

/// Lets `count` rays meet one grain each. Rays trapped in a grain (a few in smooth spheroids)
/// are not reported.
fn events(
    law: &GrainType,
    (entry, facets): (Entry, Facets),
    n: f64,
    count: u32,
    cell: u64,
    mut each: impl FnMut(Outcome),
) {
    let ice = Index { n, k: 0.0 };
    let surface = Surface {
        enter: Interface::dielectric(AIR, ice),
        leave: Interface::dielectric(ice, AIR),
    };
    let mut rng = stream(cell);
    let mut events = Events::new(&[surface; 2], false, facets);
    let (mut grains, mut kept) = (Grains::default(), 0u32);
    let d = Vec3::new(0.0, 0.0, 1.0);
    let (mut started, mut steps, mut busy) = (0, [0; 8], 0u32);
    loop {
        for (lane, steps) in steps.iter_mut().enumerate() {
            if busy & (1 << lane) != 0 || started == count {
                continue;
            }
            let grain = loop {
                while kept == 0 {
                    kept = grains.draw(law, &mut rng);
                }
                let grain = grains.get(kept.trailing_zeros() as usize);
                kept &= kept - 1;
                if meets(&grain, entry, rng.uniform().to_array()[0], d) {
                    break grain;
                }
            };
            let (point, normal) = contact(&grain, d);
            events.ice_m.as_mut_array()[lane] = 0.0;
            events.ice_limit_m.as_mut_array()[lane] = f64::INFINITY;
            events.direction.set(lane, d);
            events.start(lane, &grain, point, normal, false);
            started += 1;
            *steps = 0;
            busy |= 1 << lane;
        }
        if busy == 0 {
            return;
        }
        let step = events.step(&mut rng);
        busy &= !step.lost;
        for (lane, steps) in steps.iter_mut().enumerate() {
            *steps += 1;
            if step.left & busy & (1 << lane) != 0 {
                busy ^= 1 << lane;
                each(Outcome {
                    cos: events.direction.get(lane).z,
                    ice_m: events.ice_m.to_array()[lane],
                    steps: *steps,
                });
            }
        }
    }
}

/// Running sums for a mean and its standard error.
struct Mean {
    n: f64,
    sum: f64,
    squares: f64,
}

impl Mean {
    const fn new() -> Self {
        Self {
            n: 0.0,
            sum: 0.0,
            squares: 0.0,
        }
    }

    fn add(&mut self, x: f64) {
        self.n += 1.0;
        self.sum += x;
        self.squares += x * x;
    }

    fn measured(&self) -> Measured {
        let value = self.sum / self.n;
        Measured {
            value,
            se: ((self.squares / self.n - value * value) / (self.n - 1.0)).sqrt(),
        }
    }
}

/// Closed forms of a smooth sphere of unit diameter. Let c be the cosine of the incidence
/// angle, c' the cosine inside and F the reflectance, which is the same at every hit:
/// - at entry the ray is reflected with probability F;
/// - the expected path is (1 - F) c' / (1 - F) = c';
/// - rays leave after p chords with probability (1-F)^2 F^(p-1), deflected by
///   2 (i - r) + (p - 1)(pi - 2 r). The cosine summed over p is the real part of
///   (1-F)^2 exp(2j(i-r)) / (1 - F exp(j(pi - 2r))), minus F cos 2i for entry.
///
/// For entry uniform over the surface, c is uniform on (0, 1); for entry uniform over the
/// projected area, c^2 is.
#[test]
fn smooth_spheres_match_closed_forms() {
    let count = 1_000_000;
    let cases = [
        (Entry::Uniform, (|_| 1.0) as fn(f64) -> f64),
        (Entry::Projected, |c| 2.0 * c),
    ];
    for (cell, (entry, weight)) in cases.into_iter().enumerate() {
        for n in [1.31, 1.5] {
            let [mut entered, mut path, mut first, mut cosine] = [const { Mean::new() }; 4];
            events(
                &spheres(1e6, 300.0).grains[0].grain,
                (entry, Facets::default()),
                n,
                count,
                100 + cell as u64,
                |o| {
                    entered.add(f64::from(u8::from(o.steps > 1)));
                    path.add(o.ice_m);
                    cosine.add(o.cos);
                    if o.steps == 2 {
                        first.add(o.ice_m);
                    }
                },
            );
            let inside = |c: f64| (1.0 - (1.0 - c * c) / (n * n)).sqrt();
            let deflection = |c: f64| {
                let (f, i, r) = (fresnel(c, n), c.acos(), inside(c).acos());
                let (turn, hop) = (2.0 * (i - r), PI - 2.0 * r);
                // (cos turn + j sin turn) / (1 - F cos hop - j F sin hop)
                let (re, im) = (1.0 - f * hop.cos(), -f * hop.sin());
                let leaves = (turn.cos() * re + turn.sin() * im) / (re * re + im * im);
                (1.0 - f).powi(2) * leaves - f * (2.0 * i).cos()
            };
            let weighted_mean = |f: &dyn Fn(f64) -> f64| mean(|c| weight(c) * f(c));
            // rays that leave at the first internal hit: (1 - F)^2 of all rays
            let direct = |c: f64| (1.0 - fresnel(c, n)).powi(2);
            let expected = [
                (
                    "entering",
                    &entered,
                    weighted_mean(&|c| 1.0 - fresnel(c, n)),
                ),
                ("path", &path, weighted_mean(&inside)),
                (
                    "first chord",
                    &first,
                    weighted_mean(&|c| direct(c) * inside(c)) / weighted_mean(&direct),
                ),
                ("g", &cosine, weighted_mean(&deflection)),
            ];
            for (name, found, expected) in expected {
                let m = found.measured();
                assert_close(&format!("{entry:?} n={n} {name}"), m.value, m.se, expected);
            }
        }
    }
}

/// docs/methods.md: g = 0.422 and 0.430, mean path in ice 0.475 and 0.465 mm, at n = 1.3194
/// and 1.3069. The tolerance is half a unit of the last printed digit plus 4 standard errors.
/// A mean sphericity 0.002 too high would fail.
#[test]
fn representative_grains_scatter_as_published() {
    for (cell, n, g, path_mm) in [(110, 1.3194, 0.422, 0.475), (111, 1.3069, 0.430, 0.465)] {
        let [mut cosine, mut path] = [const { Mean::new() }; 2];
        events(
            &dry().grains[0].grain,
            (Entry::Uniform, Facets::Varsa2025),
            n,
            12_000_000,
            cell,
            |o| {
                cosine.add(o.cos);
                path.add(o.ice_m * 1e3);
            },
        );
        for (name, found, published) in [("g", cosine, g), ("path, mm", path, path_mm)] {
            let m = found.measured();
            println!("n = {n}: {name} {:.5} +- {:.5}", m.value, m.se);
            let difference = (m.value - published).abs();
            assert!(difference < 5e-4 + 4.0 * m.se, "{name} {m:?}");
        }
    }
}

/// Directions are continuous at facetness 0: g is that of the smooth surface at F = 1e-4. There the
/// mean squared tilt of a facet is at most 2 E|xi| = 0.8 F (published law). Tilts to opposite sides
/// cancel, so g changes by about that much at each of a few hits: 10 F allows for twelve. Mean
/// paths are not continuous (docs/stability.md): whatever scatters light into the directions that
/// are totally reflected for ever in a smooth spheroid lets it stay there for long.
#[test]
fn directions_are_continuous_at_facetness_0() {
    let at = |facets, facetness, cell| {
        let law = GrainType {
            facetness: TruncatedNormal::new(facetness, facetness, facetness, 0.0).unwrap(),
            ..dry().grains[0].grain
        };
        let [mut cosine, mut path] = [const { Mean::new() }; 2];
        events(&law, (Entry::Projected, facets), 1.31, 200_000, cell, |o| {
            cosine.add(o.cos);
            path.add(o.ice_m * 1e3);
        });
        let [g, path] = [cosine, path].map(|mean| mean.measured());
        println!(
            "{facets:?} F = {facetness}: g {:.4} +- {:.4}, path {:.4} +- {:.4} mm",
            g.value, g.se, path.value, path.se
        );
        g
    };
    let smooth = at(Facets::VGroove, 0.0, 130);
    for (facets, facetness, cell) in [
        (Facets::Varsa2025, 0.0, 131),
        (Facets::Varsa2025, 1e-4, 132),
        (Facets::Visible, 1e-4, 133),
        (Facets::VGroove, 1e-4, 134),
    ] {
        let rough = at(facets, facetness, cell);
        let (jump, se) = (
            (rough.value - smooth.value).abs(),
            rough.se.hypot(smooth.se),
        );
        let limit = 10.0 * facetness + 4.0 * se;
        assert!(jump < limit, "{facets:?} {facetness}: {jump}");
    }
}

/// In equilibrium with isotropic light, the radiance in ice is n^2 times that outside. The mean
/// path in ice per ray that meets a convex grain is then n^2 4 volume / surface, if every
/// direction inside is reached: facets scatter. Only grooves conserve etendue; docs/methods.md
/// says how far the other laws are from it.
#[test]
fn grooves_conserve_etendue() {
    let grains = dry().grains[0].grain;
    let deep = GrainType {
        facetness: TruncatedNormal::new(0.8, 1.0, 0.9, 0.05).unwrap(),
        ..grains
    };
    let shaped = |shape, proportion| GrainType {
        shape,
        proportion: TruncatedNormal::new(proportion, proportion, proportion, 0.0).unwrap(),
        ..grains
    };
    let grooves = (Facets::VGroove, None);
    for (cell, n, law, (facets, quoted)) in [
        (120, 1.31, grains, grooves),
        (121, 1.31, deep, grooves),
        (122, 1.6, deep, grooves),
        (123, 1.31, shaped(Shape::Oblate, 0.6), grooves),
        (124, 1.31, shaped(Shape::Hexagonal, 0.3), grooves),
        (125, 1.31, shaped(Shape::Hexagonal, 2.0), grooves),
        (
            126,
            1.31,
            grains,
            (Facets::Varsa2025, Some("etendue, varsa2025")),
        ),
        (
            127,
            1.31,
            grains,
            (Facets::Visible, Some("etendue, visible")),
        ),
    ] {
        let mut path = Mean::new();
        events(&law, (Entry::Projected, facets), n, 1_000_000, cell, |o| {
            path.add(o.ice_m);
        });
        let m = path.measured();
        let mean_size_m = 0.5 * (law.size.min_m() + law.size.max_m());
        let shape = shape_factor(law.shape, &law.proportion, SizeLaw::Consistent);
        let conserved = n * n * mean_size_m / shape;
        let (ratio, se) = (m.value / conserved, m.se / conserved);
        let label = format!("{} {facets:?}, n = {n}", law.shape.name());
        println!("{label}: {ratio:.4} +- {se:.4} of n^2 4 V / S");
        match quoted {
            None => assert_close(&label, ratio, se, 1.0),
            Some(name) => {
                let [quoted] = numbers::<1>("docs/methods.md", name);
                assert_close(&label, ratio, se.hypot(0.001), quoted);
            }
        }
    }
}
