//! Small dense matrices: rows of four-lane blocks, the last padded with zeros.
//!
//! Every inner loop runs along rows, so four f64 go at a time whatever the
//! size. No operation is fused and every sum has a fixed order: results are the
//! same to the bit on every machine.
use std::ops::{Add, Index, IndexMut, Mul, Sub};

use wide::bytemuck::{cast_slice, cast_slice_mut};
use wide::f64x4;

/// Entries per block.
pub(super) const LANES: usize = 4;

/// A dense matrix of f64, rows by columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Matrix {
    rows: usize,
    columns: usize,
    /// Blocks per row.
    blocks: usize,
    data: Vec<f64x4>,
}

impl Matrix {
    /// All zero.
    #[must_use]
    pub fn zeros(rows: usize, columns: usize) -> Self {
        let blocks = columns.div_ceil(LANES);
        Self {
            rows,
            columns,
            blocks,
            data: vec![f64x4::ZERO; rows * blocks],
        }
    }

    /// The matrix of `entry(row, column)`.
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

    /// Ones on the diagonal of a square.
    #[must_use]
    pub fn identity(n: usize) -> Self {
        Self::diagonal(&vec![1.0; n])
    }

    /// `entries` on the diagonal of a square.
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

    /// One row, as long as there are columns.
    #[must_use]
    pub fn row(&self, i: usize) -> &[f64] {
        &cast_slice(self.wide_row(i))[..self.columns]
    }

    /// One row, to be changed.
    pub fn row_mut(&mut self, i: usize) -> &mut [f64] {
        let columns = self.columns;
        &mut cast_slice_mut(self.wide_row_mut(i))[..columns]
    }

    /// Rows become columns.
    #[must_use]
    pub fn transposed(&self) -> Self {
        Self::from_fn(self.columns, self.rows, |i, j| self[(j, i)])
    }

    fn entrywise(&self, other: &Self, f: impl Fn(f64x4, f64x4) -> f64x4) -> Self {
        assert!(
            (self.rows, self.columns) == (other.rows, other.columns),
            "matrices of different shape"
        );
        let data = self.data.iter().zip(&other.data);
        Self {
            data: data.map(|(&a, &b)| f(a, b)).collect(),
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

    /// Each entry times that of `other`.
    pub(super) fn scale_entries(&mut self, other: &Self) {
        for (a, &b) in self.data.iter_mut().zip(&other.data) {
            *a *= b;
        }
    }

    #[inline(always)]
    pub(super) fn wide_row(&self, i: usize) -> &[f64x4] {
        &self.data[i * self.blocks..(i + 1) * self.blocks]
    }

    #[inline(always)]
    pub(super) fn wide_row_mut(&mut self, i: usize) -> &mut [f64x4] {
        &mut self.data[i * self.blocks..(i + 1) * self.blocks]
    }

    /// Rows i < j, to be changed together.
    #[inline(always)]
    pub(super) fn wide_rows_mut(&mut self, i: usize, j: usize) -> (&mut [f64x4], &mut [f64x4]) {
        let (upper, lower) = self.data.split_at_mut(j * self.blocks);
        (
            &mut upper[i * self.blocks..(i + 1) * self.blocks],
            &mut lower[..self.blocks],
        )
    }
}

/// `row += factor * other`.
#[inline(always)]
pub(super) fn add_scaled(row: &mut [f64x4], factor: f64, other: &[f64x4]) {
    let factor = f64x4::splat(factor);
    for (a, &b) in row.iter_mut().zip(other) {
        *a += factor * b;
    }
}

/// Scalar product.
#[inline(always)]
pub(super) fn dot(a: &[f64x4], b: &[f64x4]) -> f64 {
    let mut sum = f64x4::ZERO;
    for (&a, &b) in a.iter().zip(b) {
        sum += a * b;
    }
    let [a, b, c, d] = sum.to_array();
    (a + b) + (c + d)
}

/// A^T diag(d) B; A and B have as many rows as d has entries.
pub(super) fn weighted_product(a: &Matrix, d: &[f64], b: &Matrix) -> Matrix {
    let mut product = Matrix::zeros(a.columns, b.columns);
    for (m, &weight) in d.iter().enumerate() {
        if weight != 0.0 {
            for (i, entry) in a.row(m).iter().enumerate() {
                add_scaled(product.wide_row_mut(i), entry * weight, b.wide_row(m));
            }
        }
    }
    product
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
    /// If the left has not as many columns as the right has rows.
    fn mul(self, right: &Matrix) -> Matrix {
        assert!(
            self.columns == right.rows,
            "product: {} columns, {} rows",
            self.columns,
            right.rows
        );
        let mut product = Matrix::zeros(self.rows, right.columns);
        for i in 0..self.rows {
            let row = product.wide_row_mut(i);
            for (k, &entry) in self.row(i).iter().enumerate() {
                add_scaled(row, entry, right.wide_row(k));
            }
        }
        product
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
    use super::*;

    #[test]
    fn products_by_hand() {
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
        assert_eq!(dot(a.wide_row(0), a.wide_row(1)), 14.0);
    }
}
