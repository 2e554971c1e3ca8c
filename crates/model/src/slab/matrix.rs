//! Small dense matrices. Rows are stored as blocks of four lanes, the last padded with
//! zeros.
//!
//! Every inner loop runs along rows, four f64 at a time for any matrix size. No operation
//! is fused and every sum has a fixed order, so results are bitwise identical on all
//! machines.
use std::ops::{Add, Index, IndexMut, Mul, Sub};

use splitsnow_spectra::simd::{F64x4, Simd, SimdKernel, dispatch};

/// Entries per block.
pub(super) const LANES: usize = 4;

/// Adjacent entries of a row.
pub(super) type Block = [f64; LANES];

/// A dense matrix of f64, rows by columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Matrix {
    rows: usize,
    columns: usize,
    /// Blocks per row.
    blocks: usize,
    data: Vec<Block>,
}

impl Matrix {
    /// A matrix of zeros.
    #[must_use]
    pub fn zeros(rows: usize, columns: usize) -> Self {
        let blocks = columns.div_ceil(LANES);
        Self {
            rows,
            columns,
            blocks,
            data: vec![[0.0; LANES]; rows * blocks],
        }
    }

    /// The matrix with the entries `entry(row, column)`.
    #[must_use]
    pub fn from_fn(
        rows: usize,
        columns: usize,
        mut entry: impl FnMut(usize, usize) -> f64,
    ) -> Self {
        let mut matrix = Self::zeros(rows, columns);
        for i in 0..rows {
            for (j, value) in matrix.row_mut(i).iter_mut().enumerate() {
                *value = entry(i, j);
            }
        }
        matrix
    }

    /// The identity matrix.
    #[must_use]
    pub fn identity(n: usize) -> Self {
        Self::diagonal(&vec![1.0; n])
    }

    /// A square matrix with `entries` on the diagonal.
    #[must_use]
    pub fn diagonal(entries: &[f64]) -> Self {
        let mut matrix = Self::zeros(entries.len(), entries.len());
        matrix.add_diagonal(entries);
        matrix
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    #[must_use]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// A row, without padding.
    #[inline]
    #[must_use]
    pub fn row(&self, i: usize) -> &[f64] {
        &self.wide_row(i).as_flattened()[..self.columns]
    }

    /// A mutable row, without padding.
    #[inline]
    pub fn row_mut(&mut self, i: usize) -> &mut [f64] {
        let columns = self.columns;
        &mut self.wide_row_mut(i).as_flattened_mut()[..columns]
    }

    /// The transposed matrix.
    #[must_use]
    pub fn transposed(&self) -> Self {
        Self::from_fn(self.columns, self.rows, |i, j| self[(j, i)])
    }

    fn entrywise(&self, other: &Self, f: impl Fn(f64, f64) -> f64) -> Self {
        assert!(
            (self.rows, self.columns) == (other.rows, other.columns),
            "matrices of different shape"
        );
        let data = self.data.iter().zip(&other.data);
        Self {
            data: data
                .map(|(a, b)| std::array::from_fn(|lane| f(a[lane], b[lane])))
                .collect(),
            ..*self
        }
    }

    pub(super) fn swap_rows(&mut self, i: usize, j: usize) {
        if i != j {
            for block in 0..self.blocks {
                self.data
                    .swap(i * self.blocks + block, j * self.blocks + block);
            }
        }
    }

    pub(super) fn add_diagonal(&mut self, entries: &[f64]) {
        for (i, entry) in entries.iter().enumerate() {
            self[(i, i)] += entry;
        }
    }

    /// Multiplies each entry by the entry of `other`.
    pub(super) fn scale_entries(&mut self, other: &Self) {
        let entries = self.data.as_flattened_mut().iter_mut();
        for (a, b) in entries.zip(other.data.as_flattened()) {
            *a *= b;
        }
    }

    #[inline(always)]
    pub(super) fn wide_row(&self, i: usize) -> &[Block] {
        &self.data[i * self.blocks..(i + 1) * self.blocks]
    }

    #[inline(always)]
    pub(super) fn wide_row_mut(&mut self, i: usize) -> &mut [Block] {
        &mut self.data[i * self.blocks..(i + 1) * self.blocks]
    }

    /// Mutable rows i < j.
    #[inline(always)]
    pub(super) fn wide_rows_mut(&mut self, i: usize, j: usize) -> (&mut [Block], &mut [Block]) {
        let (upper, lower) = self.data.split_at_mut(j * self.blocks);
        (
            &mut upper[i * self.blocks..(i + 1) * self.blocks],
            &mut lower[..self.blocks],
        )
    }
}

/// `row += factor * other`.
#[inline(always)]
pub(super) fn add_scaled<S: Simd>(row: &mut [Block], factor: f64, other: &[Block]) {
    let factor = F64x4::<S>::splat(factor);
    for (a, &b) in row.iter_mut().zip(other) {
        *a = (F64x4::new(*a) + factor * F64x4::new(b)).to_array();
    }
}

/// `row *= factor`.
#[inline(always)]
pub(super) fn scale<S: Simd>(row: &mut [Block], factor: f64) {
    let factor = F64x4::<S>::splat(factor);
    for block in row {
        *block = (F64x4::new(*block) * factor).to_array();
    }
}

/// Scalar product.
#[inline(always)]
pub(super) fn dot<S: Simd>(a: &[Block], b: &[Block]) -> f64 {
    let mut sum = F64x4::<S>::ZERO;
    for (&a, &b) in a.iter().zip(b) {
        sum += F64x4::new(a) * F64x4::new(b);
    }
    let [a, b, c, d] = sum.to_array();
    (a + b) + (c + d)
}

/// A^T diag(d) B. A and B have as many rows as d has entries.
pub(super) fn weighted_product(a: &Matrix, d: &[f64], b: &Matrix) -> Matrix {
    dispatch(WeightedProduct { a, d, b })
}

struct WeightedProduct<'a> {
    a: &'a Matrix,
    d: &'a [f64],
    b: &'a Matrix,
}

impl SimdKernel for WeightedProduct<'_> {
    type Output = Matrix;

    #[inline(always)]
    fn run<S: Simd>(self) -> Matrix {
        let Self { a, d, b } = self;
        let mut product = Matrix::zeros(a.columns, b.columns);
        for (m, &weight) in d.iter().enumerate() {
            if weight != 0.0 {
                for (i, entry) in a.row(m).iter().enumerate() {
                    add_scaled::<S>(product.wide_row_mut(i), entry * weight, b.wide_row(m));
                }
            }
        }
        product
    }
}

/// A matrix product as a SIMD kernel.
struct Product<'a> {
    left: &'a Matrix,
    right: &'a Matrix,
}

impl SimdKernel for Product<'_> {
    type Output = Matrix;

    #[inline(always)]
    fn run<S: Simd>(self) -> Matrix {
        let Self { left, right } = self;
        let mut product = Matrix::zeros(left.rows, right.columns);
        for i in 0..left.rows {
            let row = product.wide_row_mut(i);
            for (k, &entry) in left.row(i).iter().enumerate() {
                add_scaled::<S>(row, entry, right.wide_row(k));
            }
        }
        product
    }
}

impl Index<(usize, usize)> for Matrix {
    type Output = f64;

    #[inline]
    fn index(&self, (i, j): (usize, usize)) -> &f64 {
        &self.row(i)[j]
    }
}

impl IndexMut<(usize, usize)> for Matrix {
    #[inline]
    fn index_mut(&mut self, (i, j): (usize, usize)) -> &mut f64 {
        &mut self.row_mut(i)[j]
    }
}

impl Mul for &Matrix {
    type Output = Matrix;

    /// # Panics
    /// If the number of columns on the left is not the number of rows on the right.
    fn mul(self, right: &Matrix) -> Matrix {
        assert!(
            self.columns == right.rows,
            "product: {} columns, {} rows",
            self.columns,
            right.rows
        );
        dispatch(Product { left: self, right })
    }
}

impl Add for &Matrix {
    type Output = Matrix;

    /// # Panics
    /// If the shapes differ.
    fn add(self, other: &Matrix) -> Matrix {
        self.entrywise(other, |a, b| a + b)
    }
}

impl Sub for &Matrix {
    type Output = Matrix;

    /// # Panics
    /// If the shapes differ.
    fn sub(self, other: &Matrix) -> Matrix {
        self.entrywise(other, |a, b| a - b)
    }
}

#[cfg(test)]
mod tests {
    use splitsnow_spectra::simd::Portable;

    use super::*;

    #[test]
    fn products_match_hand_computed_values() {
        let a = Matrix::from_fn(2, 3, |i, j| (3 * i + j) as f64);
        let product = &a * &a.transposed();
        assert_eq!(
            (product.row(0), product.row(1)),
            (&[5.0, 14.0][..], &[14.0, 50.0][..])
        );
        let weighted = weighted_product(&a, &[2.0, 0.0], &a);
        assert_eq!(weighted.row(2), &[0.0, 4.0, 8.0]);
        assert_eq!((&a - &a), Matrix::zeros(2, 3));
        assert_eq!((a.rows(), a.columns()), (2, 3));
        assert_eq!(dot::<Portable>(a.wide_row(0), a.wide_row(1)), 14.0);
    }
}
