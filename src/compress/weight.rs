//! Weights of curves by how visible a change of y is (docs/methods.md).
use ndarray::{Array2, ArrayView1, ArrayView2};

use super::{CompressError, CurveBlocks};
use crate::lookup::Basis;
use crate::measurement::Quantity;

/// Relative luminance below which CIELAB lightness is linear in luminance (CIE 15).
const DARK: f64 = 216.0 / 24389.0;

/// Curves with each row of y weighted, see [`weighted`].
pub(super) struct WeightedBlocks<'a> {
    pub(super) quantity: Quantity,
    pub(super) curves: &'a dyn CurveBlocks,
}

impl CurveBlocks for WeightedBlocks<'_> {
    fn shape(&self) -> (usize, usize) {
        self.curves.shape()
    }

    fn visit(
        &self,
        visit: &mut dyn FnMut(ArrayView2<f64>) -> Result<(), CompressError>,
    ) -> Result<(), CompressError> {
        self.curves
            .visit(&mut |block| visit(weighted(self.quantity, block).view()))
    }
}

/// The y of `curves`, with each row weighted by how visible a change dy is. Lightness is
/// the cube root of luminance Y and changes by Y^(-2/3) dY, and dY is T dy for
/// transmittance or (1 - R) dy for reflectance. The basis of the `log` kind holds the
/// singular vectors of this matrix.
fn weighted(quantity: Quantity, curves: ArrayView2<f64>) -> Array2<f64> {
    let mut matrix = curves.mapv(|value| Basis::Log.projected(quantity, value));
    for mut row in matrix.rows_mut() {
        let weight = weight(quantity, row.view());
        row *= weight;
    }
    matrix
}

/// The weight of a row of y, from its mean luminance.
fn weight(quantity: Quantity, row: ArrayView1<f64>) -> f64 {
    let transparency = row.iter().map(|y| libm::exp(-y)).sum::<f64>() / row.len() as f64;
    let luminance = match quantity {
        Quantity::Transmittance => transparency,
        Quantity::Reflectance => 1.0 - transparency,
    };
    transparency / libm::cbrt(luminance.max(DARK)).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    /// The weight of a grey row is the derivative of lightness in y, up to the factor 116 / 3.
    #[test]
    fn weights_are_changes_of_lightness() {
        let lightness = |y: f64| {
            if y > DARK {
                116.0 * y.cbrt() - 16.0
            } else {
                y / DARK * 8.0
            }
        };
        for quantity in Quantity::ALL {
            for value in [0.001, 0.1, 0.5, 0.95] {
                let y = Basis::Log.projected(quantity, value);
                let lightness_at = |y| lightness(Basis::Log.value(quantity, y));
                let slope = (lightness_at(y + 1e-6) - lightness_at(y - 1e-6)).abs() / 2e-6;
                let scaled = weight(quantity, array![y, y].view()) * 116.0 / 3.0;
                assert!((scaled / slope - 1.0).abs() < 0.01, "{scaled} {slope}");
            }
        }
    }
}
