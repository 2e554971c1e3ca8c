//! The solver of homogeneous slabs against another code, against theory and
//! against itself.
#![allow(clippy::unwrap_used)]
mod another_code;
mod consistency;
mod limits;
mod theory;

use splitsnow::slab::{Light, Matrix, Operators};

use crate::quoted;

/// The page that quotes what the checks find.
const PAGE: &str = "docs/methods.md";

/// Asserts that rounding errors are as large as the page says, or somewhat smaller: another
/// compiler may add in another order.
fn assert_rounding_says<const N: usize>(name: &str, found: [f64; N]) {
    let said = quoted::numbers::<N>(PAGE, name);
    for (found, said) in found.iter().zip(said) {
        let share = found / said;
        assert!(
            (0.2..1.5).contains(&share),
            "{name}: {found:e} is not {said:e}"
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

/// Two slabs of one medium, one on the other.
fn stacked(upper: &Operators, lower: &Operators) -> Operators {
    let one = Matrix::identity(upper.reflection.rows());
    let between = &one - &(&upper.reflection * &lower.reflection);
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
