//! Curves and the basis found for them: what every number of components and
//! every precision of coefficients costs.
use ndarray::{Array2, ArrayView2, Axis};

use super::errors::{Rebuilding, error_table};
use super::precision::narrowed;
use super::{
    Bands, Basis, Bounds, Coefficients, CompressError, Decomposition, ErrorRow, ErrorTable,
    Precision, choose, svd, weight,
};
use crate::colour::Colorimeter;
use crate::measurement::Quantity;

/// Curves, `[s, l]`, of one quantity, and their basis.
#[derive(Debug)]
pub struct Model<'a> {
    curves: ArrayView2<'a, f64>,
    quantity: Quantity,
    colour: Option<&'a Colorimeter>,
    bands: &'a Bands,
    kind: Basis,
    decomposition: Decomposition,
    /// Its basis as files hold it.
    basis: Array2<f32>,
}

impl<'a> Model<'a> {
    /// Finds the basis of this kind for `curves`, `[s, l]`, of `quantity`;
    /// `colour` and `bands` are of the same l wavelengths, or there are none.
    ///
    /// # Errors
    /// As [`Decomposition::new`].
    ///
    /// # Panics
    /// If `colour` is of another number of wavelengths.
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
                // What is not a number has no place in a logarithm's limits.
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

    /// The most components there are: min(s, l).
    #[must_use]
    pub fn rank_limit(&self) -> usize {
        self.decomposition.rank_limit()
    }

    /// The first `components` (at most [`Model::rank_limit`]) of the basis as
    /// files hold it, `[l, components]`.
    #[must_use]
    pub fn basis(&self, components: usize) -> Array2<f32> {
        let components = components.min(self.rank_limit());
        self.basis.view().split_at(Axis(1), components).0.to_owned()
    }

    /// Coefficients of the first `components` (at most [`Model::rank_limit`]) in
    /// a precision; integers have 16 bits.
    #[must_use]
    pub fn coefficients(&self, components: usize, precision: Precision) -> Coefficients {
        Coefficients::new(self.exact(components), precision)
    }

    /// The errors of 1 to all of the components of `stored`, which are of this
    /// model.
    ///
    /// # Panics
    /// If they are not.
    #[must_use]
    pub fn table(&self, stored: &Coefficients) -> ErrorTable {
        self.errors(stored, 1)
    }

    /// A value of a spectrum from the sum of its components.
    #[cfg(feature = "charts")]
    pub(crate) fn value(&self, sum: f64) -> f64 {
        self.kind.value(self.quantity, sum)
    }

    /// The first `components` quantised in as few bits as keep `bounds` and those of
    /// the bands, and their errors.
    ///
    /// # Errors
    /// See [`choose`]: 16 bits do not keep them.
    pub fn narrowed(
        &self,
        components: usize,
        bounds: &Bounds,
    ) -> Result<(Coefficients, ErrorRow), CompressError> {
        let exact = self.exact(components);
        let row = |tried: &Coefficients| {
            let table = self.errors(tried, exact.ncols());
            choose(&table, bounds, self.bands, Precision::Quantised).map(|_| table.rows[0])
        };
        let wide = Coefficients::new(exact.clone(), Precision::Quantised);
        let mut kept = row(&wide)?;
        let stored = narrowed(exact.view(), wide, |tried| {
            row(tried).map(|row| kept = row).is_ok()
        });
        Ok((stored, kept))
    }

    /// Projections of the curves on the basis, summed in wavelength order.
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

    /// Errors of `first` to all of the components of `stored`.
    fn errors(&self, stored: &Coefficients, first: usize) -> ErrorTable {
        let coefficients = stored.decoded();
        let by = Rebuilding {
            kind: self.kind,
            quantity: self.quantity,
            coefficients: coefficients.view(),
            basis: self.basis.view(),
        };
        error_table(self.curves, &by, self.colour, self.bands, first)
    }
}
