//! The look-up method of Varsa 2025, section 5.3, reproduced exactly: nodes only in
//! facetness, grain size and density, a natural cubic spline in thickness, linear
//! interpolation in the angle between two nodes.
//!
//! The knots of the spline are the thicknesses of the database and two more:
//! transmittance is 1 at 0 cm and 0 at 100 cm, and 0 beyond. (If the database reaches
//! 100 cm, its last node is the last knot.) At angles beyond the last node the result is
//! 0. For reflectance the thesis says only that the thickness may be dropped; here it is
//! 0 at 0 cm and constant beyond the last node.
//!
//! The spline oscillates between its knots and can leave [0, 1]; this is not corrected.
use ndarray::Array2;
use splitsnow_spectra::Quantity;

use crate::{Database, LookupError, MissingCurve, Parameter, Point, absent_error, nodes};

/// Thickness at which transmittance is set to 0, cm.
const BLACK_CM: f64 = 100.0;

/// One quantity of a database, prepared for look-ups.
#[derive(Debug, Clone)]
pub struct Varsa2025<'a> {
    database: &'a Database,
    quantity: Quantity,
    /// Thicknesses of the knots, cm; the first is 0.
    knots_cm: Vec<f64>,
    /// Matrix from the values at the knots to the second derivatives there.
    curvature: Array2<f64>,
}

impl<'a> Varsa2025<'a> {
    /// Prepares `quantity` of `database`.
    ///
    /// # Errors
    /// [`LookupError::Content`] if the file holds anisotropy factors;
    /// [`LookupError::NoQuantity`] if it does not hold `quantity`;
    /// [`LookupError::MissingCondition`] if an optional axis has several nodes and
    /// [`Database::at`] must be called first.
    pub fn new(database: &'a Database, quantity: Quantity) -> Result<Self, LookupError> {
        database.require_content(false)?;
        database.require(quantity)?;
        database.require_single_block()?;
        let mut knots_cm = vec![0.0];
        knots_cm.extend(database.axes().values(Parameter::Thickness));
        let thickest = knots_cm[knots_cm.len() - 1];
        if quantity == Quantity::Transmittance && thickest < BLACK_CM {
            knots_cm.push(BLACK_CM);
        }
        let curvature = curvature(&knots_cm);
        Ok(Self {
            database,
            quantity,
            knots_cm,
            curvature,
        })
    }

    /// The spectrum at `point`, `[l]`.
    ///
    /// # Errors
    /// [`LookupError::BetweenNodes`] if facetness, grain size or density is not on a node,
    /// [`LookupError::Outside`] if a coordinate is outside its axis, and
    /// [`LookupError::Absent`] if the snow has no curve at some thickness.
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
        // the spline needs all thicknesses
        if self.database.absent().get(size).is_some_and(|n| *n > 0) {
            let missing = MissingCurve::at_size(size, self.database.absent(), axes);
            return Err(absent_error(missing, point));
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
        let last_angle = angles[angles.len() - 1];
        if dark || angle > last_angle {
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
        let constant = |value| vec![value; self.database.wavelengths_nm().len()];
        match knot {
            0 => constant(edge),
            knot if knot > n_h => constant(0.0),
            _ => self.database.curve(row, self.quantity).unwrap_or_default(),
        }
    }

    /// Weights of the knots at thickness `h`, cm, which must be between the first and last.
    fn weights(&self, h: f64) -> Vec<f64> {
        let x = &self.knots_cm;
        let cell = x.partition_point(|knot| *knot <= h).clamp(1, x.len() - 1) - 1;
        let step = x[cell + 1] - x[cell];
        let (a, b) = ((x[cell + 1] - h) / step, (h - x[cell]) / step);
        let bend = |t: f64| (t * t * t - t) * step * step / 6.0;
        let weight = |knot: usize| {
            let line = a * f64::from(knot == cell) + b * f64::from(knot == cell + 1);
            line + bend(a) * self.curvature[[cell, knot]]
                + bend(b) * self.curvature[[cell + 1, knot]]
        };
        (0..x.len()).map(weight).collect()
    }
}

/// Matrix from the values at knots `x` to the second derivatives of the natural spline
/// through them.
fn curvature(x: &[f64]) -> Array2<f64> {
    let n = x.len();
    // forward elimination of a tridiagonal, diagonally dominant system
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
        let second = curvature(&[0.0, 1.0, 2.0]).dot(&Array1::from(vec![0.0, 1.0, 0.0]));
        assert!((second[1] + 3.0).abs() < 1e-12 && second[0] == 0.0 && second[2] == 0.0);
        // A straight line has no curvature.
        let x = [0.0, 1.0, 1.5, 7.0, 100.0];
        let line = curvature(&x).dot(&Array1::from_iter(x.iter().map(|x| 2.0 - x)));
        assert!(line.iter().all(|bend| bend.abs() < 1e-12), "{line}");
        // The equations of the spline hold at the inner knots.
        let y = Array1::from(vec![0.3, -1.0, 2.0, 0.5, 4.0]);
        let m = curvature(&x).dot(&y);
        for i in 1..4 {
            let (before, after) = (x[i] - x[i - 1], x[i + 1] - x[i]);
            let left =
                before / 6.0 * m[i - 1] + (before + after) / 3.0 * m[i] + after / 6.0 * m[i + 1];
            let right = (y[i + 1] - y[i]) / after - (y[i] - y[i - 1]) / before;
            assert!((left - right).abs() < 1e-12, "{left} {right}");
        }
    }
}
