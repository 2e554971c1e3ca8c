//! Samplers of grains: distributions of size and shape, points on spheroids, facets.
use splitsnow::grain::{
    Body, Events, Facets, Grain, GrainType, Grains, Shape, SizeRange, Spheroid, Surface,
    TruncatedNormal,
};
use splitsnow::math::Vec3;
use splitsnow::optics::{Index, Interface};
use splitsnow::rng::Stream;
use splitsnow::transport::{Entry, contact, meets};
use statrs::function::erf::erf;
use std::f64::consts::SQRT_2;

use super::streams::turn;
use super::{assert_distributed, assert_uniform, cell, steps};
use crate::snow::{AIR, stream};

fn law(min: f64, max: f64, mean: f64, sd: f64) -> TruncatedNormal {
    TruncatedNormal::new(min, max, mean, sd).unwrap()
}

/// Calls `each` with `count` random grains.
pub(super) fn draw(law: &GrainType, count: u32, number: u64, mut each: impl FnMut(&Grain)) {
    let mut rng = stream(number);
    let mut grains = Grains::default();
    let mut left = count;
    while left > 0 {
        let mut kept = grains.draw(law, &mut rng);
        while kept != 0 && left > 0 {
            each(&grains.get(kept.trailing_zeros() as usize));
            kept &= kept - 1;
            left -= 1;
        }
    }
}

/// Cumulative distribution of a truncated normal, with [min, max] scaled to [0, 1].
fn truncated_cdf(law: &TruncatedNormal) -> impl Fn(f64) -> f64 {
    let (min, max, mean, sd) = (law.min(), law.max(), law.mean(), law.sd());
    let phi = move |x: f64| erf((x - mean) / (sd * SQRT_2));
    move |t| (phi(min + t * (max - min)) - phi(min)) / (phi(max) - phi(min))
}

/// Truncated normals as used for grains. Some are wide (proposed from the normal distribution),
/// some narrow (proposed from the uniform one; bounds closer than 2.5 standard deviations). The
/// mean is in the middle, off-centre or at a bound. The test also covers sizes and the
/// independence of the three properties. Some sphericities are low, so that a sampler of points
/// that favours round grains would fail.
#[test]
fn sizes_and_shapes_follow_their_distributions() {
    let samples = [
        // representative
        (law(0.6, 0.95, 0.798, 0.064), law(0.2, 0.4, 0.3, 0.072)),
        // surface layer: both narrow
        (law(0.3, 0.9, 0.5, 0.5), law(0.8, 0.99, 0.9, 0.5)),
        // mean at a bound: wide, then narrow
        (law(0.2, 1.0, 1.0, 0.2), law(0.0, 0.1, 0.0, 0.05)),
    ];
    for (number, (sphericity, facetness)) in samples.into_iter().enumerate() {
        let law = GrainType {
            size: SizeRange::new(300e-6, 750e-6).unwrap(),
            facetness,
            shape: Shape::Spheroid,
            proportion: sphericity,
        };
        let scale = |law: &TruncatedNormal, x: f64| (x - law.min()) / (law.max() - law.min());
        let (psi_cdf, facet_cdf) = (truncated_cdf(&sphericity), truncated_cdf(&facetness));
        let [mut psi, mut facet, mut size] = [const { [0u64; 20] }; 3];
        let mut joint = [0u64; 8 * 8 * 8];
        draw(&law, 400_000, 20 + number as u64, |grain| {
            let (_, flattening) = Spheroid::parts(&grain.body.numbers);
            let p = scale(&sphericity, (1.0 + flattening).sqrt().sqrt());
            let f = scale(&facetness, grain.facetness);
            let s = (grain.size_m - 300e-6) / 450e-6;
            for (counts, x) in [(&mut psi, p), (&mut facet, f), (&mut size, s)] {
                assert!((-1e-9..=1.0 + 1e-9).contains(&x), "outside its bounds");
                counts[cell(x, 20)] += 1;
            }
            let ranks = [psi_cdf(p), facet_cdf(f), s].map(|rank| cell(rank, 8));
            joint[ranks[0] * 64 + ranks[1] * 8 + ranks[2]] += 1;
        });
        assert_distributed("sphericity", &psi, &steps(20, &psi_cdf));
        assert_distributed("facetness", &facet, &steps(20, &facet_cdf));
        assert_uniform("size", &size);
        assert_uniform("size and shape are independent", &joint);
    }
}

/// Grains of a single shape.
fn with_sphericity(psi: f64) -> GrainType {
    GrainType {
        size: SizeRange::new(1e-3, 1e-3).unwrap(),
        facetness: law(0.0, 0.0, 0.0, 0.0),
        shape: Shape::Spheroid,
        proportion: law(psi, psi, psi, 0.0),
    }
}

/// Points are uniform over the surface of a spheroid. With eccentricity e, the area below a
/// height u along the axis varies as e u sqrt(1 - e^2 u^2) + asin(e u).
#[test]
fn points_are_uniform_over_the_surface() {
    for (number, psi) in [1.0, 0.9, 0.6, 0.3].into_iter().enumerate() {
        let e = (1.0 - f64::powi(psi, 4)).sqrt();
        let area = |u: f64| match e {
            0.0 => u,
            _ => e * u * (1.0 - e * e * u * u).sqrt() + (e * u).asin(),
        };
        let mut counts = [0u64; 20 * 8];
        let mut axes = [0u64; 20 * 8];
        draw(
            &with_sphericity(psi),
            400_000,
            30 + number as u64,
            |grain| {
                let (axis, _) = Spheroid::parts(&grain.body.numbers);
                let (t1, t2) = axis.frame();
                let u = grain.point.dot(axis);
                let around = turn(grain.point.dot(t1), grain.point.dot(t2));
                counts[8 * cell(0.5 + 0.5 * u, 20) + cell(around, 8)] += 1;
                let around = turn(axis.x, axis.y);
                axes[8 * cell(0.5 + 0.5 * axis.z, 20) + cell(around, 8)] += 1;
            },
        );
        let bands = steps(20, |t| area(2.0 * t - 1.0) / (2.0 * area(1.0)));
        let expected: Vec<f64> = bands.iter().flat_map(|p| [p / 8.0; 8]).collect();
        assert_distributed(&format!("points, psi = {psi}"), &counts, &expected);
        if psi == 0.3 {
            assert_uniform("axes", &axes);
        }
    }
}

/// Grains met by projected area: their points uniformly fill the ellipse that the ray sees, with
/// the semi-axes c across the axis of the spheroid and, along it, the projected half extent. The
/// attitudes have the weight of the area of this ellipse.
#[test]
fn grains_are_met_in_proportion_to_their_projected_area() {
    let d = Vec3::new(0.48, 0.6, 0.64);
    let mut rng = stream(40);
    for (number, psi) in [1.0f64, 0.8, 0.4].into_iter().enumerate() {
        let c = psi * psi;
        let half = |cos: f64| (c * c + (1.0 - c * c) * (1.0 - cos * cos)).sqrt();
        let (mut points, mut attitudes) = ([0u64; 16 * 16], [0u64; 20]);
        let law = with_sphericity(psi);
        draw(&law, 800_000, 41 + number as u64, |grain| {
            if !meets(grain, Entry::Projected, rng.uniform().to_array()[0], d) {
                return;
            }
            let (p, normal) = contact(grain, d);
            assert!(normal.dot(d) <= 0.0, "on the far side");
            let (axis, _) = Spheroid::parts(&grain.body.numbers);
            let cos = axis.dot(d);
            let along = axis - d * cos;
            let along = along * (1.0 / along.dot(along).sqrt());
            let across = Vec3::new(
                d.y * along.z - d.z * along.y,
                d.z * along.x - d.x * along.z,
                d.x * along.y - d.y * along.x,
            );
            let (x, y) = (p.dot(across) / c, p.dot(along) / half(cos));
            points[16 * cell(x * x + y * y, 16) + cell(turn(y, x), 16)] += 1;
            attitudes[cell(cos.abs(), 20)] += 1;
        });
        assert_uniform(&format!("shadow, psi = {psi}"), &points);
        if psi < 1.0 {
            let area = |cos: f64| {
                // the integral of the half extent from 0 to `cos`, by midpoints
                let middles = (0..1000).map(|i| (f64::from(i) + 0.5) / 1000.0);
                middles.map(|t| half(cos * t) * cos / 1000.0).sum::<f64>()
            };
            let shares = steps(20, |t| area(t) / area(1.0));
            assert_distributed(&format!("attitudes, psi = {psi}"), &attitudes, &shares);
        }
    }
}

/// Samples facet normals. On a mirror grain (index near 0: total external reflection) the facet
/// normal m follows from d' - d, which is parallel to m.
fn facets(
    law: Facets,
    facetness: f64,
    incidence_deg: f64,
    count: u32,
    rng: &mut Stream,
) -> Vec<(f64, f64)> {
    let mirror = Interface::dielectric(AIR, Index { n: 1e-6, k: 0.0 });
    let surface = Surface {
        enter: mirror,
        leave: mirror,
    };
    let (sin, cos) = incidence_deg.to_radians().sin_cos();
    let (d, normal) = (Vec3::new(0.0, 0.0, 1.0), Vec3::new(sin, 0.0, -cos));
    let grain = Grain {
        size_m: 1.0,
        facetness,
        body: Body::default(),
        point: normal,
        normal,
    };
    // polar angle about the normal, azimuth from the plane of incidence
    let (side, up) = (Vec3::new(0.0, 1.0, 0.0), Vec3::new(cos, 0.0, sin));
    let mut events = Events::new(&[surface; 2], false, law);
    let (mut found, mut left) = (Vec::new(), 0xff);
    while found.len() < count as usize {
        for lane in (0..8).filter(|lane| left & (1 << lane) != 0) {
            events.direction.set(lane, d);
            events.start(lane, &grain, normal, normal, false);
        }
        left = events.step(rng).left;
        for lane in (0..8).filter(|lane| left & (1 << lane) != 0) {
            let m = events.direction.get(lane) - d;
            let m = m * (1.0 / m.dot(m).sqrt());
            found.push((m.dot(normal), turn(m.dot(side), m.dot(up))));
        }
    }
    found
}

/// Facets are tilted by cos = 1 - |xi|, where xi is normal with standard deviation F/2, at a
/// uniform azimuth. Both are drawn again until the cosine is positive and the facet faces the
/// ray (docs/methods.md). Cells of the tilt have equal probability at normal incidence. At other
/// angles the part of a cell that faces the ray is integrated: m faces the ray if
/// cos(i) cos(tilt) > -sin(i) sin(tilt) cos(azimuth). Visible facets have the difference of the
/// two sides as their weight.
#[test]
fn facets_follow_their_distribution() {
    let mut rng = stream(50);
    let (published, visible) = (Facets::Varsa2025, Facets::Visible);
    for (law, facetness, deg) in [
        (published, 0.1, 0.0),
        (published, 0.3, 0.0),
        (published, 1.0, 0.0),
        (published, 0.3, 60.0),
        (published, 1.0, 60.0),
        (published, 0.3, 85.0),
        (published, 1.0, 85.0),
        (visible, 1.0, 0.0),
        (visible, 0.3, 60.0),
        (visible, 1.0, 85.0),
    ] {
        let spread = facetness / 2.0 * SQRT_2;
        let whole = erf(1.0 / spread);
        let rank = |cos_tilt: f64| erf((1.0 - cos_tilt) / spread) / whole;
        let mut counts = [0u64; 16 * 16];
        for (cos_tilt, azimuth) in facets(law, facetness, deg, 400_000, &mut rng) {
            assert!(cos_tilt > 0.0);
            counts[16 * cell(rank(cos_tilt), 16) + cell(azimuth, 16)] += 1;
        }
        let (sin, cos) = f64::to_radians(deg).sin_cos();
        // midpoints of 2000 ranks, found by inverting the rank
        let fine = 2000;
        let mut shares = vec![0.0; 16 * 16];
        let mut t = 0.0;
        for i in 0..fine {
            let wanted = (f64::from(i) + 0.5) / f64::from(fine);
            let (mut low, mut high) = (t, 1.0);
            while high - low > 1e-9 {
                let middle = 0.5 * (low + high);
                if rank(1.0 - middle) < wanted {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            t = low;
            let (cos_tilt, sin_tilt) = (1.0 - t, (t * (2.0 - t)).sqrt());
            for j in 0..fine {
                let turn = (f64::from(j) + 0.5) / f64::from(fine);
                let facing = cos * cos_tilt - sin * sin_tilt * (std::f64::consts::TAU * turn).cos();
                if facing > 0.0 {
                    shares[16 * cell(wanted, 16) + cell(turn, 16)] += match law {
                        Facets::Visible => facing,
                        _ => 1.0,
                    };
                }
            }
        }
        let total: f64 = shares.iter().sum();
        // cells that rarely face the ray are pooled
        let least = 100.0 / 400_000.0;
        let (mut pooled_count, mut pooled_share) = (Vec::new(), Vec::new());
        let (mut rest, mut rest_share) = (0, 0.0);
        for (count, share) in counts.iter().zip(&shares) {
            let share = share / total;
            if share < least {
                rest += count;
                rest_share += share;
            } else {
                pooled_count.push(*count);
                pooled_share.push(share);
            }
        }
        if rest_share * 400_000.0 > 20.0 {
            pooled_count.push(rest);
            pooled_share.push(rest_share);
        }
        let sum: f64 = pooled_share.iter().sum();
        pooled_share.iter_mut().for_each(|share| *share /= sum);
        assert_distributed(
            &format!("{law:?} facets F = {facetness}, {deg} degrees"),
            &pooled_count,
            &pooled_share,
        );
    }
}
