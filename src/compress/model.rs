//! Curves and the basis computed for them: the errors for every number of components
//! and every precision of the coefficients.
use ndarray::{Array2, ArrayView1, Axis};

use super::errors::{Reconstruction, TableTally};
use super::precision::{Rounding, narrow_components};
use super::weight::WeightedBlocks;
use super::{
    Bands, Basis, Bounds, CompressError, CurveBlocks, Decomposition, ErrorRow, ErrorTable,
    Precision, StoredCoefficients, blocks, choose,
};
use crate::colour::Colorimeter;
use crate::measurement::Quantity;

/// Curves, `[s, l]`, of one quantity, with their basis. They are read anew for each result.
pub struct CurveModel<'a> {
    curves: Box<dyn CurveBlocks + 'a>,
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
        curves: impl CurveBlocks + 'a,
        quantity: Quantity,
        colour: Option<&'a Colorimeter>,
        bands: &'a Bands,
        kind: Basis,
    ) -> Result<Self, CompressError> {
        let decomposition = match kind {
            Basis::Linear => Decomposition::new(&curves)?,
            Basis::Log => {
                // The logarithm would clamp NaN and infinities, so they are refused first.
                blocks::largest(&curves)?;
                let curves = &curves;
                Decomposition::new(WeightedBlocks { quantity, curves })?
            }
        };
        Ok(Self {
            curves: Box::new(curves),
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
    ///
    /// # Errors
    /// [`CompressError::Read`].
    pub fn coefficients(
        &self,
        components: usize,
        precision: Precision,
    ) -> Result<StoredCoefficients, CompressError> {
        Ok(StoredCoefficients::new(self.exact(components)?, precision))
    }

    /// The errors with 1, 2, ... and `components` components, whose coefficients are rounded to
    /// `precision`. They are not kept.
    ///
    /// # Errors
    /// [`CompressError::Read`].
    pub fn table(
        &self,
        components: usize,
        precision: Precision,
    ) -> Result<ErrorTable, CompressError> {
        let components = components.min(self.rank_limit());
        let rounding = self.rounding(components, precision)?;
        let mut tally = TableTally::new(self.reconstruction(), 1, components);
        self.curves.visit(&mut |block| {
            tally.add(block, |row| {
                let exact = self.projections(block.row(row), components).into_iter();
                let rounded = exact.enumerate();
                rounded.map(|(j, exact)| rounding.apply(j, exact)).collect()
            });
            Ok(())
        })?;
        Ok(tally.finish())
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
    /// Those of [`choose`], if even 16 bits do not keep the bounds; [`CompressError::Read`].
    pub fn quantised_to_bounds(
        &self,
        components: usize,
        bounds: &Bounds,
    ) -> Result<(StoredCoefficients, ErrorRow), CompressError> {
        let exact = self.exact(components)?;
        let error_row = |candidate: &StoredCoefficients| {
            let table = self.last_row(candidate, exact.ncols())?;
            choose(&table, bounds, self.bands, Precision::Quantised).map(|_| table.rows[0])
        };
        let wide = StoredCoefficients::new(exact.clone(), Precision::Quantised);
        let mut row = error_row(&wide)?;
        let stored = narrow_components(exact.view(), wide, |candidate| {
            error_row(candidate).map(|accepted| row = accepted).is_ok()
        });
        Ok((stored, row))
    }

    /// Projections of the curves on the basis, `[s, components]`.
    fn exact(&self, components: usize) -> Result<Array2<f32>, CompressError> {
        let components = components.min(self.rank_limit());
        let rows = self.curves.shape().0;
        let mut exact = Vec::with_capacity(rows * components);
        self.curves.visit(&mut |block| {
            for curve in block.rows() {
                exact.extend(self.projections(curve, components));
            }
            Ok(())
        })?;
        Array2::from_shape_vec((rows, components), exact)
            .map_err(|error| CompressError::Read(error.to_string()))
    }

    /// Projections of a curve on the first `components`, summed in wavelength order.
    fn projections(&self, curve: ArrayView1<f64>, components: usize) -> Vec<f32> {
        let projected = curve.iter();
        let projected = projected.map(|value| self.kind.projected(self.quantity, *value));
        let projected: Vec<f64> = projected.collect();
        let vectors = self.decomposition.basis.columns().into_iter();
        let sum = |vector: ArrayView1<f64>| {
            let products = projected.iter().zip(vector).map(|(m, v)| m * v);
            products.sum::<f64>() as f32
        };
        vectors.take(components).map(sum).collect()
    }

    /// How coefficients of `components` are rounded.
    fn rounding(&self, components: usize, precision: Precision) -> Result<Rounding, CompressError> {
        let mut ranges = vec![[f32::INFINITY, f32::NEG_INFINITY]; components];
        if precision == Precision::Quantised {
            self.curves.visit(&mut |block| {
                for curve in block.rows() {
                    let exact = self.projections(curve, components);
                    for ([least, most], exact) in ranges.iter_mut().zip(exact) {
                        (*least, *most) = (least.min(exact), most.max(exact));
                    }
                }
                Ok(())
            })?;
        }
        Ok(Rounding::new(precision, &ranges))
    }

    /// Errors with all `components` of `stored`.
    fn last_row(
        &self,
        stored: &StoredCoefficients,
        components: usize,
    ) -> Result<ErrorTable, CompressError> {
        let mut tally = TableTally::new(self.reconstruction(), components, components);
        let mut first = 0;
        self.curves.visit(&mut |block| {
            tally.add(block, |row| stored.decoded_row(first + row));
            first += block.nrows();
            Ok(())
        })?;
        Ok(tally.finish())
    }

    fn reconstruction(&self) -> Reconstruction<'_> {
        Reconstruction {
            kind: self.kind,
            quantity: self.quantity,
            basis: self.basis.view(),
            colour: self.colour,
            bands: self.bands,
        }
    }
}
