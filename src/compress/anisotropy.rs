//! Anisotropy factors, from the factors toward views and the reflectance or transmittance.
//!
//! Where few walks leave on a side of the snow, the factors there are noise. Two steps keep this
//! noise from the components:
//!
//! - a factor whose standard error is above [`LARGEST_ERROR`] of it counts as unknown. It is
//!   replaced by that of the nearest wavelength at which it is known, or by 1 (Lambertian light);
//! - the components and their number come from the curves with ordinary noise: at most
//!   [`ORDINARY`] times the median in each band. Each of the others is replaced by its projection
//!   onto these components. The bounds follow from the median noise.
use ndarray::{Array2, ArrayView1, ArrayView2, Axis};

use super::{
    Bands, Choice, CompactVariant, CompressError, Compressed, Decomposition, compress, svd,
};
use crate::accuracy::rms;
use crate::colour::Colorimeter;
use crate::lookup::Basis;
use crate::measurement::Quantity;

/// Largest relative standard error of a factor that counts as known.
const LARGEST_ERROR: f64 = 0.25;
/// Largest noise of an ordinary curve, in units of the median.
const ORDINARY: f64 = 2.0;

/// Anisotropy factors with their standard errors, both `[s, l]`.
#[derive(Debug, Clone, PartialEq)]
pub struct AnisotropyFactors {
    /// The factors.
    pub values: Array2<f64>,
    /// Their standard errors, 0 where a factor is unknown.
    pub errors: Array2<f32>,
}

impl AnisotropyFactors {
    /// The anisotropy factors of `factors`, the reflectance or transmittance factors toward
    /// views, with their standard `errors`, both `[s, l]`. `totals` are the reflectances or
    /// transmittances; curve j belongs to row `j % n` of its n rows.
    ///
    /// ```
    /// use ndarray::array;
    /// use splitsnow::compress::AnisotropyFactors;
    ///
    /// let (brf, errors) = (array![[0.9_f32, 0.02]], array![[0.009_f32, 0.01]]);
    /// let found = AnisotropyFactors::new(brf.view(), errors.view(), array![[0.9_f32, 0.01]].view());
    /// // the second one is unknown
    /// assert!((&found.values - 1.0).iter().all(|difference| difference.abs() < 1e-6));
    /// assert_eq!(found.errors[[0, 1]], 0.0);
    /// ```
    #[must_use]
    pub fn new(factors: ArrayView2<f32>, errors: ArrayView2<f32>, totals: ArrayView2<f32>) -> Self {
        let mut values = Array2::from_elem(factors.dim(), f64::NAN);
        let mut relative = Array2::zeros(factors.dim());
        for ((row, l), factor) in factors.indexed_iter() {
            let (factor, error) = (f64::from(*factor), f64::from(errors[[row, l]]));
            let total = f64::from(totals[[row % totals.nrows(), l]]);
            if total > 0.0 && error < LARGEST_ERROR * factor {
                values[[row, l]] = factor / total;
                relative[[row, l]] = (error / total) as f32;
            }
        }
        for mut curve in values.rows_mut() {
            let known: Vec<usize> = (0..curve.len()).filter(|l| curve[*l].is_finite()).collect();
            for l in 0..curve.len() {
                let nearest = known.iter().min_by_key(|other| other.abs_diff(l));
                curve[l] = nearest.map_or(1.0, |nearest| curve[*nearest]);
            }
        }
        Self {
            values,
            errors: relative,
        }
    }

    /// Compresses the factors of the curves with the numbers `rows`; see [`compress`].
    ///
    /// # Errors
    /// See [`CompressError`].
    pub fn compress(
        &self,
        rows: &[usize],
        quantity: Quantity,
        colour: Option<&Colorimeter>,
        bands: &Bands,
        choice: Choice,
        variant: CompactVariant,
    ) -> Result<Compressed, CompressError> {
        let variant = CompactVariant {
            basis: Basis::Linear,
            ..variant
        };
        let errors = self.errors.select(Axis(0), rows);
        let mut values = self.values.select(Axis(0), rows);
        let medians = median_noise(errors.view(), bands);
        let (ordinary, noisy): (Vec<_>, Vec<_>) = (0..errors.nrows()).partition(|row| {
            let noise = noise(errors.row(*row), bands);
            noise
                .zip(&medians)
                .all(|(noise, median)| noise <= ORDINARY * median)
        });
        let parts = bands.parts().iter().zip(&medians);
        let columns = parts.flat_map(|(part, median)| part.columns.clone().map(|_| *median as f32));
        let median_curve = Array2::from_shape_vec((1, errors.ncols()), columns.collect());
        let bands = match median_curve {
            Ok(noise) => bands.clone().with_noise(noise.view()),
            // without bands nothing bounds the errors
            Err(_) => bands.clone(),
        };
        let bands = match choice {
            Choice::Bounds(bounds) => bands.bounded(bounds.max_rmse),
            Choice::Components(_) => bands,
        };
        if !noisy.is_empty() {
            let good = values.select(Axis(0), &ordinary);
            svd::check_values(values.view(), 0)?;
            let found = compress(good.view(), quantity, colour, &bands, choice, variant)?;
            let components = Decomposition::new(good.view())?.basis;
            let components = components.view().split_at(Axis(1), found.components()).0;
            for row in noisy {
                let projected = components.dot(&components.t().dot(&values.row(row)));
                values.row_mut(row).assign(&projected);
            }
        }
        compress(values.view(), quantity, colour, &bands, choice, variant)
    }
}

/// Root mean square of the `errors` of a curve in each band.
fn noise(errors: ArrayView1<'_, f32>, bands: &Bands) -> impl Iterator<Item = f64> {
    bands.parts().iter().map(move |part| {
        let errors = errors.iter().skip(part.columns.start);
        rms(errors
            .take(part.columns.len())
            .map(|error| f64::from(*error)))
    })
}

/// The median of [`noise`] over the curves, for each band.
fn median_noise(errors: ArrayView2<'_, f32>, bands: &Bands) -> Vec<f64> {
    let curves = errors.rows().into_iter();
    let noise: Vec<Vec<f64>> = curves.map(|row| noise(row, bands).collect()).collect();
    let median = |band: usize| {
        let mut sorted: Vec<f64> = noise.iter().map(|noise| noise[band]).collect();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied().unwrap_or_default()
    };
    (0..bands.parts().len()).map(median).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::grid::Compression;
    use crate::measurement::Measured;

    /// Curves of two components at 24 wavelengths, the last of which has much noise.
    fn curves() -> (Array2<f32>, Array2<f32>, Array2<f32>) {
        let value = |row: usize, l: usize| {
            let slope = 0.5 * (row as f64 / 40.0 - 0.5);
            1.0 + slope * libm::sin(0.3 * l as f64)
        };
        let noise = |row: usize, l: usize| match row {
            39 => 0.2 * libm::cos(2.5 * l as f64),
            _ => 0.001 * libm::cos((row * l) as f64),
        };
        let totals = Array2::from_shape_fn((4, 24), |(row, l)| {
            (0.9 - 0.03 * l as f64) as f32 * (1.0 - 0.1 * row as f32)
        });
        let total = |row: usize, l: usize| f64::from(totals[[row % 4, l]]);
        let factors = Array2::from_shape_fn((40, 24), |(row, l)| {
            (total(row, l) * (value(row, l) + noise(row, l))) as f32
        });
        let errors = Array2::from_shape_fn((40, 24), |(row, l)| {
            let se = if row == 39 { 0.15 } else { 0.001 };
            (total(row, l) * se) as f32
        });
        (factors, errors, totals)
    }

    #[test]
    fn a_noisy_curve_costs_no_component_and_loosens_no_bound() {
        let (factors, errors, totals) = curves();
        let factors = AnisotropyFactors::new(factors.view(), errors.view(), totals.view());
        let nm: Vec<f64> = (0..24).map(|l| 450.0 + 10.0 * f64::from(l)).collect();
        let rows: Vec<usize> = (0..40).collect();
        let bounds = Choice::Bounds(Compression {
            max_delta_e: 2.3,
            max_rmse: None,
        });
        let found = factors.compress(
            &rows,
            Quantity::Reflectance,
            None,
            &Bands::new(&nm),
            bounds,
            CompactVariant::default(),
        );
        let found = found.unwrap();
        assert_eq!(found.components(), 2);
        assert_eq!(found.bands.parts()[0].max_rmse, Some(0.002));
        let rebuilt = found.coefficients.decoded().dot(&found.basis.t());
        // the noisy curve too is near its truth: its noise is orthogonal to the components
        for l in 0..24 {
            let truth = 1.0 + 0.5 * (39.0 / 40.0 - 0.5) * libm::sin(0.3 * l as f64);
            let error = f64::from(rebuilt[[39, l]]) - truth;
            assert!(error.abs() < 0.07, "{l}: {error}");
        }
    }

    #[test]
    fn unknown_factors_are_those_of_the_nearest_wavelength() {
        let measured = |value, se| Measured { value, se };
        let row = [
            measured(0.1, 0.09),
            measured(0.2, 0.01),
            measured(0.0, 1e-4),
            measured(0.3, 0.01),
        ];
        let part =
            |of: fn(&Measured) -> f64| Array2::from_shape_fn((1, 4), |(_, l)| of(&row[l]) as f32);
        let totals = Array2::from_elem((1, 4), 0.2_f32);
        let found = AnisotropyFactors::new(
            part(|m| m.value).view(),
            part(|m| m.se).view(),
            totals.view(),
        );
        let expected = [1.0, 1.0, 1.0, 1.5];
        for (found, expected) in found.values.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6, "{found}");
        }
        assert_eq!(found.errors[[0, 0]], 0.0);
        let dark = Array2::zeros((1, 4));
        let found = AnisotropyFactors::new(dark.view(), dark.view(), dark.view());
        assert_eq!(found.values, Array2::<f64>::ones((1, 4)));
    }
}
