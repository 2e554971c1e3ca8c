//! The look-up of Varsa 2025, section 5.3, to the letter: nodes only in
//! facetness, grain size and density, a natural cubic spline in thickness, a
//! straight line in the angle between two nodes.
//!
//! The spline's knots are the thicknesses of the database and two more:
//! transmittance is 1 at 0 cm and 0 at 100 cm, and 0 beyond. (Where the database
//! itself reaches 100 cm its last node is the last knot.) Angles beyond the last
//! node give no light. For reflectance, of which the thesis says only that the
//! thickness may be dropped, it is 0 at 0 cm and stays beyond the last node.
//!
//! The spline rings between its knots and can leave [0, 1]: nothing is mended.
use ndarray::Array2;
use splitsnow_spectra::Quantity;

use crate::{Database, Gap, LookupError, Parameter, Point, absent, nodes};

/// Where nothing is transmitted any more, cm.
const BLACK_CM: f64 = 100.0;

/// One quantity of a database, ready for look-ups.
#[derive(Debug, Clone)]
pub struct Varsa2025<'a> {
    database: &'a Database,
    quantity: Quantity,
    /// Thicknesses of the knots, cm; the first is 0.
    knots_cm: Vec<f64>,
    /// Second derivatives at the knots per value at the knots.
    bending: Array2<f64>,
}

impl<'a> Varsa2025<'a> {
    /// Prepares `quantity` of `database`.
    ///
    /// # Errors
    /// [`LookupError::NoQuantity`]; [`LookupError::Condition`] for a file that
    /// [`Database::at`] must cut first.
    pub fn new(database: &'a Database, quantity: Quantity) -> Result<Self, LookupError> {
        database.require(quantity)?;
        database.single()?;
        let mut knots_cm = vec![0.0];
        knots_cm.extend(database.axes().values(Parameter::Thickness));
        let thickest = knots_cm[knots_cm.len() - 1];
        if quantity == Quantity::Transmittance && thickest < BLACK_CM {
            knots_cm.push(BLACK_CM);
        }
        let bending = bending(&knots_cm);
        Ok(Self {
            database,
            quantity,
            knots_cm,
            bending,
        })
    }

    /// The spectrum at `point`, `[l]`.
    ///
    /// # Errors
    /// [`LookupError::BetweenNodes`] for snow that is no node, [`LookupError::Outside`],
    /// and [`LookupError::Absent`] for snow of which a thickness does not exist.
    pub fn spectrum(&self, point: Point) -> Result<Vec<f32>, LookupError> {
        let axes = self.database.axes();
        let mut snow = 0;
        for parameter in [
            Parameter::Facetness,
            Parameter::GrainSize,
            Parameter::Density,
        ] {
            let nodes = axes.values(parameter);
            let node = nodes::find(parameter.key(), nodes, point[parameter])?;
            snow = snow * nodes.len() + node;
        }
        let [_, sizes, densities, ..] = axes.core_shape();
        let size = snow / densities % sizes;
        // the spline passes through all thicknesses
        if self.database.absent().get(size).is_some_and(|n| *n > 0) {
            return Err(absent(Gap::of(size, self.database.absent(), axes), point));
        }
        let outside = |parameter: Parameter, first, last| LookupError::Outside {
            axis: parameter.key(),
            value: point[parameter],
            first,
            last,
        };
        let (h, angle) = (point[Parameter::Thickness], point[Parameter::Incidence]);
        let thinnest = match self.database.has_black_substrate() {
            true => 0.0,
            false => axes.values(Parameter::Thickness)[0],
        };
        if !(thinnest..=f64::MAX).contains(&h) {
            return Err(outside(Parameter::Thickness, thinnest, f64::INFINITY));
        }
        let angles = axes.values(Parameter::Incidence);
        if !(angles[0]..90.0).contains(&angle) {
            return Err(outside(Parameter::Incidence, angles[0], 90.0));
        }
        let mut spectrum = vec![0.0; self.database.wavelengths_nm().len()];
        let last = self.knots_cm[self.knots_cm.len() - 1];
        let dark = h >= last && self.quantity == Quantity::Transmittance;
        let above = angles.partition_point(|node| *node <= angle);
        let ends = angles[angles.len() - 1];
        if dark || angle > ends {
            return Ok(vec![0.0; spectrum.len()]);
        }
        let weights = self.weights(h.min(last));
        let (lower, upper) = (above - 1, above.min(angles.len() - 1));
        let step = angles[upper] - angles[lower];
        let share = if step > 0.0 {
            (angle - angles[lower]) / step
        } else {
            0.0
        };
        for (node, share) in [(lower, 1.0 - share), (upper, share)] {
            for (knot, weight) in weights.iter().enumerate() {
                for (sum, value) in spectrum.iter_mut().zip(self.knot(snow, knot, node)) {
                    *sum += share * weight * f64::from(value);
                }
            }
        }
        Ok(spectrum.into_iter().map(|v| v as f32).collect())
    }

    /// The curve at a knot.
    fn knot(&self, snow: usize, knot: usize, angle: usize) -> Vec<f32> {
        let [.., n_h, n_a] = self.database.axes().core_shape();
        let row = (snow * n_h + knot.max(1) - 1) * n_a + angle;
        let edge = match self.quantity {
            Quantity::Transmittance => 1.0,
            Quantity::Reflectance => 0.0,
        };
        let all = |value| vec![value; self.database.wavelengths_nm().len()];
        match knot {
            0 => all(edge),
            knot if knot > n_h => all(0.0),
            _ => self.database.curve(row, self.quantity).unwrap_or_default(),
        }
    }

    /// Weights of the knots at a thickness of `h` cm, within them.
    fn weights(&self, h: f64) -> Vec<f64> {
        let x = &self.knots_cm;
        let cell = x.partition_point(|knot| *knot <= h).clamp(1, x.len() - 1) - 1;
        let step = x[cell + 1] - x[cell];
        let (a, b) = ((x[cell + 1] - h) / step, (h - x[cell]) / step);
        let bend = |t: f64| (t * t * t - t) * step * step / 6.0;
        let weight = |knot: usize| {
            let line = a * f64::from(knot == cell) + b * f64::from(knot == cell + 1);
            line + bend(a) * self.bending[[cell, knot]] + bend(b) * self.bending[[cell + 1, knot]]
        };
        (0..x.len()).map(weight).collect()
    }
}

/// Second derivatives of the natural spline through knots at `x`: a matrix that
/// takes the values at the knots to them.
fn bending(x: &[f64]) -> Array2<f64> {
    let n = x.len();
    // rows of a tridiagonal system, which is diagonally dominant, eliminated downward
    let (mut over, mut right) = (vec![0.0; n], Array2::zeros((n, n)));
    for i in 1..n - 1 {
        let (before, after) = (x[i] - x[i - 1], x[i + 1] - x[i]);
        right[[i, i - 1]] = 1.0 / before;
        right[[i, i]] = -1.0 / before - 1.0 / after;
        right[[i, i + 1]] = 1.0 / after;
        let pivot = (before + after) / 3.0 - before / 6.0 * over[i - 1];
        over[i] = after / 6.0 / pivot;
        for j in 0..n {
            right[[i, j]] = (right[[i, j]] - before / 6.0 * right[[i - 1, j]]) / pivot;
        }
    }
    for i in (1..n - 1).rev() {
        for j in 0..n {
            right[[i, j]] -= over[i] * right[[i + 1, j]];
        }
    }
    right
}

#[cfg(test)]
mod tests {
    use ndarray::Array1;

    use super::*;

    #[test]
    fn natural_spline_by_hand() {
        // Knots 0, 1, 2 with values 0, 1, 0: second derivatives 0, -3, 0.
        let second = bending(&[0.0, 1.0, 2.0]).dot(&Array1::from(vec![0.0, 1.0, 0.0]));
        assert!((second[1] + 3.0).abs() < 1e-12 && second[0] == 0.0 && second[2] == 0.0);
        // A straight line does not bend.
        let x = [0.0, 1.0, 1.5, 7.0, 100.0];
        let line = bending(&x).dot(&Array1::from_iter(x.iter().map(|x| 2.0 - x)));
        assert!(line.iter().all(|bend| bend.abs() < 1e-12), "{line}");
        // The equations of the spline hold at the inner knots.
        let y = Array1::from(vec![0.3, -1.0, 2.0, 0.5, 4.0]);
        let m = bending(&x).dot(&y);
        for i in 1..4 {
            let (before, after) = (x[i] - x[i - 1], x[i + 1] - x[i]);
            let left =
                before / 6.0 * m[i - 1] + (before + after) / 3.0 * m[i] + after / 6.0 * m[i + 1];
            let right = (y[i + 1] - y[i]) / after - (y[i] - y[i - 1]) / before;
            assert!((left - right).abs() < 1e-12, "{left} {right}");
        }
    }
}
