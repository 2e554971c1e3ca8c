//! Every sampler compared with its distribution: chi-square tests of binned counts, and tests
//! for the absence of correlations.
//!
//! | subject | comparisons |
//! |---|---|
//! | uniform, exponential, normal, azimuth, direction | 9 |
//! | neighbouring draws, lanes, streams | 46 |
//! | truncated normals, size, independence of a grain's properties | 12 |
//! | points on spheroids, uniform and projected, and axes | 10 |
//! | facets | 10 |
//! | flights, media, entry, illumination of a walk, ice met | 12 |
//!
//! Seeds are fixed. A p-value below [`ALPHA`] / [`COMPARISONS`] fails (Bonferroni correction).
//! So all tests together fail by chance for 1 in 10^6 seeds.
#![allow(clippy::unwrap_used, clippy::print_stdout)]
mod grains;
mod streams;
mod walks;

use statrs::function::gamma::gamma_ur;

/// Probability that any comparison fails although all samplers are correct.
const ALPHA: f64 = 1e-6;
/// Number of comparisons of this tier, from the table above.
const COMPARISONS: usize = 99;

/// Chi-square test of `counts` against `probabilities` (which sum to 1). The expected count in
/// each cell must be above 20, so that the chi-square distribution applies.
fn assert_distributed(label: &str, counts: &[u64], probabilities: &[f64]) {
    assert_eq!(counts.len(), probabilities.len());
    let total = counts.iter().sum::<u64>() as f64;
    let sum: f64 = probabilities.iter().sum();
    assert!(
        (sum - 1.0).abs() < 1e-6,
        "{label}: probabilities sum to {sum}"
    );
    let mut chi = 0.0;
    for (count, p) in counts.iter().zip(probabilities) {
        let expected = total * p;
        assert!(expected > 20.0, "{label}: a cell expects {expected}");
        chi += (*count as f64 - expected).powi(2) / expected;
    }
    let p = gamma_ur((counts.len() - 1) as f64 / 2.0, chi / 2.0);
    println!(
        "{label}: chi2 = {chi:.1} in {} cells, p = {p:.3}",
        counts.len()
    );
    assert!(p > ALPHA / COMPARISONS as f64, "{label}: p = {p:e}");
}

/// [`assert_distributed`] with equal probabilities.
fn assert_uniform(label: &str, counts: &[u64]) {
    let p = 1.0 / counts.len() as f64;
    assert_distributed(label, counts, &vec![p; counts.len()]);
}

/// Index of the cell that contains `x` in [0, 1], for `cells` equal cells.
fn cell(x: f64, cells: usize) -> usize {
    ((x * cells as f64) as usize).min(cells - 1)
}

/// Probabilities of `cells` equal steps of [0, 1] under a cumulative distribution.
fn steps(cells: usize, cumulative: impl Fn(f64) -> f64) -> Vec<f64> {
    let edge = |i: usize| cumulative(i as f64 / cells as f64);
    (0..cells).map(|i| edge(i + 1) - edge(i)).collect()
}
