//! The solver of homogeneous slabs compared with another code, with theory and with itself.
#![allow(clippy::unwrap_used)]
mod another_code;
mod consistency;
mod limits;
mod theory;

use splitsnow::slab::{Light, Matrix, Operators};

use crate::quoted;

/// The page that quotes the results of these checks.
const PAGE: &str = "docs/methods.md";

/// Asserts that rounding errors are those in the page or somewhat smaller; another compiler may
/// sum in another order.
fn assert_rounding_says<const N: usize>(name: &str, found: [f64; N]) {
    let quoted = quoted::numbers::<N>(PAGE, name);
    for (found, quoted) in found.iter().zip(quoted) {
        let ratio = found / quoted;
        assert!(
            (0.2..1.5).contains(&ratio),
            "{name}: {found:e} is not {quoted:e}"
        );
    }
}

/// Moments of the Henyey-Greenstein phase function.
fn henyey_greenstein(albedo: f64, g: f64, count: usize) -> Vec<f64> {
    (0..count as i32).map(|l| albedo * g.powi(l)).collect()
}

fn collimated(cosine: f64) -> Light {
    Light::Collimated { cosine }
}

/// The operators of two slabs of a medium, one on the other.
fn stacked(upper: &Operators, lower: &Operators) -> Operators {
    let identity = Matrix::identity(upper.reflection.rows());
    let between = &identity - &(&upper.reflection * &lower.reflection);
    let down = between.solve(upper.transmission.clone()).unwrap();
    let up = &lower.reflection * &down;
    Operators {
        reflection: &upper.reflection + &(&upper.transmission * &up),
        transmission: &lower.transmission * &down,
    }
}

fn entries(matrix: &Matrix) -> impl Iterator<Item = f64> {
    (0..matrix.rows()).flat_map(|i| matrix.row(i).iter().copied())
}

fn largest_difference(a: &Matrix, b: &Matrix) -> f64 {
    let pairs = entries(a).zip(entries(b));
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}
