//! Curves and the basis computed for them: the errors for every number of components
//! and every precision of the coefficients.
use ndarray::{Array2, ArrayView2, Axis};

use super::errors::{Reconstruction, error_table};
use super::precision::narrow_components;
use super::{
    Bands, Basis, Bounds, CompressError, Decomposition, ErrorRow, ErrorTable, Precision,
    StoredCoefficients, choose, svd, weight,
};
use crate::colour::Colorimeter;
use crate::measurement::Quantity;

/// Curves, `[s, l]`, of one quantity, with their basis.
#[derive(Debug)]
pub struct CurveModel<'a> {
    curves: ArrayView2<'a, f64>,
    quantity: Quantity,
    colour: Option<&'a Colorimeter>,
    bands: &'a Bands,
    kind: Basis,
    decomposition: Decomposition,
    /// The basis rounded to f32, as files hold it.
    basis: Array2<f32>,
}

impl<'a> CurveModel<'a> {
    /// Computes the basis of this kind for `curves`, `[s, l]`, of `quantity`.
    /// `colour` and `bands` have the same l wavelengths; `bands` may be empty.
    ///
    /// # Errors
    /// Those of [`Decomposition::new`].
    ///
    /// # Panics
    /// If `colour` has another number of wavelengths.
    pub fn new(
        curves: ArrayView2<'a, f64>,
        quantity: Quantity,
        colour: Option<&'a Colorimeter>,
        bands: &'a Bands,
        kind: Basis,
    ) -> Result<Self, CompressError> {
        let decomposition = match kind {
            Basis::Linear => Decomposition::new(curves)?,
            Basis::Log => {
                // The logarithm would clamp NaN and infinities, so they are refused first.
                svd::check_values(curves)?;
                Decomposition::new(weight::weighted(quantity, curves).view())?
            }
        };
        Ok(Self {
            curves,
            quantity,
            colour,
            bands,
            kind,
            basis: decomposition.basis.mapv(|v| v as f32),
            decomposition,
        })
    }

    /// The largest number of components, min(s, l).
    #[must_use]
    pub fn rank_limit(&self) -> usize {
        self.decomposition.rank_limit()
    }

    /// The first `components` (at most [`CurveModel::rank_limit`]) basis vectors as files
    /// hold them, `[l, components]`.
    #[must_use]
    pub fn basis(&self, components: usize) -> Array2<f32> {
        let components = components.min(self.rank_limit());
        self.basis.view().split_at(Axis(1), components).0.to_owned()
    }

    /// Coefficients of the first `components` (at most [`CurveModel::rank_limit`]) in the
    /// given precision; integers have 16 bits.
    #[must_use]
    pub fn coefficients(&self, components: usize, precision: Precision) -> StoredCoefficients {
        StoredCoefficients::new(self.exact(components), precision)
    }

    /// The errors with 1, 2, ... and all components of `stored`, which must be
    /// coefficients of this model.
    ///
    /// # Panics
    /// If `stored` has more components or fewer curves than the model.
    #[must_use]
    pub fn table(&self, stored: &StoredCoefficients) -> ErrorTable {
        self.errors(stored, 1)
    }

    /// The value of a spectrum whose components sum to `sum`.
    #[cfg(feature = "charts")]
    pub(crate) fn value(&self, sum: f64) -> f64 {
        self.kind.value(self.quantity, sum)
    }

    /// Quantises the first `components` in as few bits as keep `bounds` and the bounds of
    /// the bands. Returns the coefficients and their errors.
    ///
    /// # Errors
    /// Those of [`choose`], if even 16 bits do not keep the bounds.
    pub fn quantised_to_bounds(
        &self,
        components: usize,
        bounds: &Bounds,
    ) -> Result<(StoredCoefficients, ErrorRow), CompressError> {
        let exact = self.exact(components);
        let error_row = |candidate: &StoredCoefficients| {
            let table = self.errors(candidate, exact.ncols());
            choose(&table, bounds, self.bands, Precision::Quantised).map(|_| table.rows[0])
        };
        let wide = StoredCoefficients::new(exact.clone(), Precision::Quantised);
        let mut row = error_row(&wide)?;
        let stored = narrow_components(exact.view(), wide, |candidate| {
            error_row(candidate).map(|accepted| row = accepted).is_ok()
        });
        Ok((stored, row))
    }

    /// Projections of the curves on the basis, `[s, components]`, summed in wavelength order.
    fn exact(&self, components: usize) -> Array2<f32> {
        let components = components.min(self.rank_limit());
        let mut exact = Array2::zeros((self.curves.nrows(), components));
        let mut projected = vec![0.0; self.curves.ncols()];
        for (curve, mut row) in self.curves.rows().into_iter().zip(exact.rows_mut()) {
            for (to, &value) in projected.iter_mut().zip(curve) {
                *to = self.kind.projected(self.quantity, value);
            }
            for (to, vector) in row.iter_mut().zip(self.decomposition.basis.columns()) {
                let products = projected.iter().zip(vector).map(|(m, v)| m * v);
                *to = products.sum::<f64>() as f32;
            }
        }
        exact
    }

    /// Errors with `first`, ... and all components of `stored`.
    fn errors(&self, stored: &StoredCoefficients, first: usize) -> ErrorTable {
        let coefficients = stored.decoded();
        let reconstruction = Reconstruction {
            kind: self.kind,
            quantity: self.quantity,
            coefficients: coefficients.view(),
            basis: self.basis.view(),
        };
        error_table(self.curves, &reconstruction, self.colour, self.bands, first)
    }
}
