//! Samplers of [`splitsnow::rng::Stream`].
use std::f64::consts::{PI, SQRT_2};

use splitsnow::rng::{Key, Stream};
use statrs::function::erf::erf;

use super::{ALPHA, COMPARISONS, assert_uniform, cell};
use crate::snow::{stream, z_limit};

const DRAWS: usize = 250_000;

fn normal_cdf(x: f64) -> f64 {
    0.5 * (1.0 + erf(x / SQRT_2))
}

/// The angle with this sin and cos, as a fraction of a turn.
pub(crate) fn turn(sin: f64, cos: f64) -> f64 {
    (sin.atan2(cos) / (2.0 * PI)).rem_euclid(1.0)
}

/// Histogram of `DRAWS` times eight values in [0, 1).
fn histogram(number: u64, cells: usize, mut draw: impl FnMut(&mut Stream) -> [f64; 8]) -> Vec<u64> {
    let mut rng = stream(number);
    let mut counts = vec![0; cells];
    for _ in 0..DRAWS {
        for x in draw(&mut rng) {
            counts[cell(x, cells)] += 1;
        }
    }
    counts
}

#[test]
fn variates_follow_their_distributions() {
    let uniform = histogram(1, 256, |r| r.uniform().to_array());
    assert_uniform("uniform", &uniform);
    let low_bits = histogram(2, 256, |r| {
        r.uniform().to_array().map(|u| (u * 2f64.powi(40)).fract())
    });
    assert_uniform("uniform, low bits", &low_bits);
    let exponential = histogram(3, 200, |r| r.exponential().to_array().map(|x| (-x).exp()));
    assert_uniform("exponential", &exponential);
    let normal = histogram(4, 200, |r| r.normal().to_array().map(normal_cdf));
    assert_uniform("normal", &normal);
    // tails: the outermost cells begin at 3.1 standard deviations
    let tails = histogram(5, 1000, |r| r.normal().to_array().map(normal_cdf));
    assert_uniform("normal, tails", &tails);
    let azimuth = histogram(6, 360, |r| {
        let (sin, cos) = r.azimuth();
        std::array::from_fn(|i| turn(sin.to_array()[i], cos.to_array()[i]))
    });
    assert_uniform("azimuth", &azimuth);
    let axes = [(7, 0), (8, 1), (9, 2)];
    for (number, along) in axes {
        // height and azimuth about each coordinate axis in turn
        let direction = histogram(number, 400, |r| {
            let d = r.direction();
            std::array::from_fn(|i| {
                let v = d.get(i);
                let v = [v.x, v.y, v.z];
                let (a, b, c) = (v[along], v[(along + 1) % 3], v[(along + 2) % 3]);
                (cell(0.5 + 0.5 * a, 20) as f64 + turn(b, c)) / 20.0
            })
        });
        assert_uniform("direction on the sphere", &direction);
    }
}

/// Pairs of consecutive draws fill the unit square uniformly, including pairs of normal variates
/// that share their radius.
#[test]
fn consecutive_draws_are_independent() {
    let pair = |a: [f64; 8], b: [f64; 8]| -> [f64; 8] {
        std::array::from_fn(|i| (cell(a[i], 16) as f64 + b[i]) / 16.0)
    };
    let uniform = histogram(10, 256, |r| {
        let first = r.uniform().to_array();
        pair(first, r.uniform().to_array())
    });
    assert_uniform("pairs of uniforms", &uniform);
    let normal = histogram(11, 256, |r| {
        let first = r.normal().to_array().map(normal_cdf);
        pair(first, r.normal().to_array().map(normal_cdf))
    });
    assert_uniform("pairs of normals", &normal);
}

/// No correlation between lanes (28 pairs), between consecutive draws of a lane (8), or between
/// streams that differ in one part of the key (8). For N pairs of uniforms, 12 sqrt(N) times the
/// covariance is standard normal.
#[test]
fn lanes_and_streams_are_uncorrelated() {
    let limit = z_limit(ALPHA, COMPARISONS);
    let mut rng = stream(12);
    let [mut across, mut along] = [[[0f64; 8]; 8], [[0f64; 8]; 8]];
    let centred = |r: &mut Stream| r.uniform().to_array().map(|u| u - 0.5);
    let mut last = centred(&mut rng);
    for _ in 0..DRAWS {
        let next = centred(&mut rng);
        for i in 0..8 {
            for j in 0..i {
                across[i][j] += next[i] * next[j];
            }
            along[i][i] += last[i] * next[i];
        }
        last = next;
    }
    let key = Key {
        seed: 2025,
        cell: 0,
        purpose: [0, 0, 0],
        batch: 0,
    };
    let mut first = Stream::new(key);
    let mut second = Stream::new(Key { batch: 1, ..key });
    let mut between = [0f64; 8];
    for _ in 0..DRAWS {
        let (a, b) = (centred(&mut first), centred(&mut second));
        for lane in 0..8 {
            between[lane] += a[lane] * b[lane];
        }
    }
    let sums = across.iter().flatten().chain(along.iter().flatten());
    let mut worst: f64 = 0.0;
    for sum in sums.chain(&between) {
        let z = 12.0 * sum / (DRAWS as f64).sqrt();
        worst = worst.max(z.abs());
        assert!(z.abs() < limit, "correlated: z = {z}");
    }
    println!("lanes, draws and streams: largest |z| of 44 is {worst:.2}");
}
