//! Laws that hold for any snow: conservation, limits with closed forms, monotony, and the
//! deviations of the model from reciprocity.
//!
//! Seeds are fixed. Tolerances in standard errors are chosen so that all comparisons of this
//! tier together exceed them with probability [`ALPHA`] (Bonferroni correction for
//! [`COMPARISONS`]).
#![allow(clippy::unwrap_used, clippy::print_stdout)]
mod absorption;
mod case;
mod exchange;
mod grain;
mod slab;
mod snowpack;
mod substrate;

/// Probability that any comparison of this tier fails although the model is correct.
const ALPHA: f64 = 1e-6;
/// Upper bound of the number of comparisons with a standard error.
const COMPARISONS: usize = 440;

/// Asserts that `value` is `expected` within its standard error (and rounding).
fn assert_close(label: &str, value: f64, se: f64, expected: f64) {
    let z = (value - expected) / se;
    println!("{label}: {value:.6} +- {se:.6}, expected {expected:.6}, z = {z:.2}");
    let limit = crate::snow::z_limit(ALPHA, COMPARISONS) * se + 1e-12;
    assert!(
        (value - expected).abs() <= limit,
        "{label}: {value} is not {expected} (z = {z:.1})"
    );
}

/// Midpoint rule over (0, 1).
fn mean(f: impl Fn(f64) -> f64) -> f64 {
    const N: u32 = 200_000;
    (0..N)
        .map(|i| f((f64::from(i) + 0.5) / f64::from(N)))
        .sum::<f64>()
        / f64::from(N)
}
