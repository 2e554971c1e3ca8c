//! Curves that are compressed block by block, so that memory does not grow with their number.
use ndarray::ArrayView2;

use super::{CompressError, svd};

/// Curves in blocks of consecutive rows. Every visit gives the same blocks.
pub trait CurveBlocks: Sync {
    /// Number of curves and number of wavelengths.
    fn shape(&self) -> (usize, usize);

    /// Calls `visit` with each block, `[n, l]`, in the order of rows, and ends at its first error.
    ///
    /// # Errors
    /// [`CompressError::Read`] if a block cannot be read; the error of `visit`.
    fn visit(
        &self,
        visit: &mut dyn FnMut(ArrayView2<f64>) -> Result<(), CompressError>,
    ) -> Result<(), CompressError>;
}

impl<T: CurveBlocks + ?Sized> CurveBlocks for &T {
    fn shape(&self) -> (usize, usize) {
        (**self).shape()
    }

    fn visit(
        &self,
        visit: &mut dyn FnMut(ArrayView2<f64>) -> Result<(), CompressError>,
    ) -> Result<(), CompressError> {
        (**self).visit(visit)
    }
}

/// A matrix is one block.
impl CurveBlocks for ArrayView2<'_, f64> {
    fn shape(&self) -> (usize, usize) {
        self.dim()
    }

    fn visit(
        &self,
        visit: &mut dyn FnMut(ArrayView2<f64>) -> Result<(), CompressError>,
    ) -> Result<(), CompressError> {
        visit(self.view())
    }
}

/// The largest magnitude of the values.
///
/// # Errors
/// [`CompressError::Empty`] without values; [`CompressError::Value`] for one that is not finite or
/// above 1e6 in magnitude; those of reading.
pub(super) fn largest(curves: &dyn CurveBlocks) -> Result<f64, CompressError> {
    let (rows, columns) = curves.shape();
    if rows == 0 || columns == 0 {
        return Err(CompressError::Empty { rows, columns });
    }
    let (mut first, mut largest) = (0, 0.0_f64);
    curves.visit(&mut |block| {
        svd::check_values(block, first)?;
        first += block.nrows();
        largest = block.iter().fold(largest, |a, b| a.max(b.abs()));
        Ok(())
    })?;
    Ok(largest)
}
