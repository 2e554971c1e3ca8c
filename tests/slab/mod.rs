//! The solver of homogeneous slabs against another code, against theory and
//! against itself.
#![allow(clippy::unwrap_used)]
mod another_code;
mod consistency;
mod limits;
mod theory;

use splitsnow::slab::{Light, Matrix, Operators};

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
