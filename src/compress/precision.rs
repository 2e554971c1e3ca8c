//! The number formats in which coefficients are stored.
use half::f16;
use ndarray::{Array2, ArrayView1, ArrayView2, ShapeBuilder};

use crate::lookup::{Precision, dequantised};

/// Coefficients as a file holds them.
#[derive(Debug, Clone, PartialEq)]
pub enum StoredCoefficients {
    /// 32-bit floats, `[s, l']`.
    F32(Array2<f32>),
    /// 16-bit floats, `[s, l']`.
    F16(Array2<f16>),
    /// Integers with a scale, one set per component.
    Quantised(Vec<Quantised>),
}

/// The coefficients of one component, as integers.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantised {
    /// The coefficient that integer 0 represents.
    pub offset: f32,
    /// The difference between the coefficients of consecutive integers.
    pub step: f32,
    /// One integer per curve.
    pub integers: Integers,
}

/// Integers of one width.
#[derive(Debug, Clone, PartialEq)]
pub enum Integers {
    /// 8 bits.
    U8(Vec<u8>),
    /// 16 bits.
    U16(Vec<u16>),
}

impl StoredCoefficients {
    /// `exact` (`[s, l']`) in the given precision; integers have 16 bits.
    pub(super) fn new(exact: Array2<f32>, precision: Precision) -> Self {
        match precision {
            Precision::F32 => Self::F32(exact),
            Precision::F16 => Self::F16(exact.mapv(half)),
            Precision::Quantised => {
                let columns = exact.columns().into_iter();
                Self::Quantised(columns.map(Quantised::wide).collect())
            }
        }
    }

    /// The precision.
    #[must_use]
    pub fn precision(&self) -> Precision {
        match self {
            Self::F32(_) => Precision::F32,
            Self::F16(_) => Precision::F16,
            Self::Quantised(_) => Precision::Quantised,
        }
    }

    /// The values that a reader gets, `[s, l']`.
    #[must_use]
    pub fn decoded(&self) -> Array2<f32> {
        match self {
            Self::F32(values) => values.clone(),
            Self::F16(values) => values.mapv(f16::to_f32),
            Self::Quantised(components) => {
                let curves = components.first().map_or(0, |c| c.decoded().len());
                let values: Vec<f32> = components.iter().flat_map(Quantised::decoded).collect();
                let shape = (curves, components.len());
                // Components of unequal lengths give an empty matrix.
                Array2::from_shape_vec(shape.f(), values).unwrap_or_default()
            }
        }
    }

    /// The values of curve `row` that a reader gets, `[l']`.
    pub(super) fn decoded_row(&self, row: usize) -> Vec<f32> {
        match self {
            Self::F32(values) => values.row(row).to_vec(),
            Self::F16(values) => values.row(row).iter().map(|value| value.to_f32()).collect(),
            Self::Quantised(components) => {
                let values = components.iter();
                values.map(|component| component.value(row)).collect()
            }
        }
    }

    /// Bits of a coefficient, one entry per component.
    #[must_use]
    pub fn bits(&self) -> Vec<u32> {
        match self {
            Self::F32(values) => vec![32; values.ncols()],
            Self::F16(values) => vec![16; values.ncols()],
            Self::Quantised(components) => components.iter().map(|c| c.integers.bits()).collect(),
        }
    }

    /// Size of the coefficients in a file, bytes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let bytes = match self {
            Self::F32(values) => size_of::<f32>() * values.len(),
            Self::F16(values) => size_of::<f16>() * values.len(),
            Self::Quantised(components) => {
                let scale = 2 * size_of::<f32>();
                components.iter().map(|c| c.integers.bytes() + scale).sum()
            }
        };
        bytes as u64
    }
}

impl Quantised {
    /// `exact` as 16-bit integers.
    fn wide(exact: ArrayView1<f32>) -> Self {
        let (offset, step, integers) = quantise(exact, u16::MAX);
        Self {
            offset,
            step,
            integers: Integers::U16(integers),
        }
    }

    /// `exact` as 8-bit integers.
    pub(super) fn narrow(exact: ArrayView1<f32>) -> Self {
        let (offset, step, integers) = quantise(exact, u8::MAX.into());
        // All integers fit into a u8.
        let integers = integers.into_iter().map(|i| i as u8).collect();
        Self {
            offset,
            step,
            integers: Integers::U8(integers),
        }
    }

    /// The values that a reader gets, `[s]`.
    #[must_use]
    pub fn decoded(&self) -> Vec<f32> {
        (0..self.integers.len())
            .map(|row| self.value(row))
            .collect()
    }

    /// The value that a reader gets for curve `row`.
    fn value(&self, row: usize) -> f32 {
        let integer = match &self.integers {
            Integers::U8(integers) => integers[row].into(),
            Integers::U16(integers) => integers[row],
        };
        dequantised(self.offset, self.step, integer)
    }
}

impl Integers {
    /// Width of an integer, bits: 8 or 16.
    #[must_use]
    pub fn bits(&self) -> u32 {
        match self {
            Self::U8(_) => u8::BITS,
            Self::U16(_) => u16::BITS,
        }
    }

    /// Number of integers.
    fn len(&self) -> usize {
        match self {
            Self::U8(integers) => integers.len(),
            Self::U16(integers) => integers.len(),
        }
    }

    /// Size of the integers in a file, bytes.
    fn bytes(&self) -> usize {
        match self {
            Self::U8(integers) => integers.len(),
            Self::U16(integers) => 2 * integers.len(),
        }
    }
}

/// `value` as f16. Beyond the largest f16 it is clamped, so that its error shows; infinity would
/// hide it.
fn half(value: f32) -> f16 {
    let limit = f16::MAX.to_f32();
    f16::from_f32(value.clamp(-limit, limit))
}

/// The rounding of coefficients to the numbers that files hold; integers have 16 bits.
#[derive(Debug)]
pub(super) enum Rounding {
    F32,
    F16,
    /// The scale of each component.
    Quantised(Vec<IntegerScale>),
}

impl Rounding {
    /// Coefficients whose components have these `ranges`, least and most, are rounded to
    /// `precision`.
    pub(super) fn new(precision: Precision, ranges: &[[f32; 2]]) -> Self {
        match precision {
            Precision::F32 => Self::F32,
            Precision::F16 => Self::F16,
            Precision::Quantised => {
                let scales = ranges
                    .iter()
                    .map(|range| IntegerScale::new(*range, u16::MAX));
                Self::Quantised(scales.collect())
            }
        }
    }

    /// The value that a reader gets of the coefficient `exact` of a component.
    pub(super) fn apply(&self, component: usize, exact: f32) -> f32 {
        match self {
            Self::F32 => exact,
            Self::F16 => half(exact).to_f32(),
            Self::Quantised(scales) => {
                let scale = scales[component];
                dequantised(scale.offset, scale.step, scale.integer(exact))
            }
        }
    }
}

/// Integers from 0 to a largest one, spread evenly over a range.
#[derive(Debug, Clone, Copy)]
pub(super) struct IntegerScale {
    offset: f32,
    step: f32,
    largest: f64,
}

impl IntegerScale {
    fn new([least, most]: [f32; 2], largest: u16) -> Self {
        let largest = f64::from(largest);
        Self {
            offset: least,
            step: ((f64::from(most) - f64::from(least)) / largest) as f32,
            largest,
        }
    }

    /// The integer nearest to `value`.
    fn integer(self, value: f32) -> u16 {
        // Equal coefficients give a step of 0 and NaN here, which converts to integer 0.
        let steps = (f64::from(value) - f64::from(self.offset)) / f64::from(self.step);
        steps.round().clamp(0.0, self.largest) as u16
    }
}

/// Quantises `exact` evenly between its extremes: offset, step, and the nearest integers
/// from 0 to `largest`.
fn quantise(exact: ArrayView1<f32>, largest: u16) -> (f32, f32, Vec<u16>) {
    let least = exact.iter().copied().fold(f32::INFINITY, f32::min);
    let most = exact.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let scale = IntegerScale::new([least, most], largest);
    let integers = exact.iter().map(|value| scale.integer(*value));
    (scale.offset, scale.step, integers.collect())
}

/// The quantised coefficients `stored` of `exact` (`[s, l']`), with each component narrowed
/// to 8 bits where `accepts` allows it. Later components, which matter least, are tried first.
pub(super) fn narrow_components(
    exact: ArrayView2<f32>,
    mut stored: StoredCoefficients,
    mut accepts: impl FnMut(&StoredCoefficients) -> bool,
) -> StoredCoefficients {
    for (component, exact) in exact.columns().into_iter().enumerate().rev() {
        let mut candidate = stored.clone();
        if let StoredCoefficients::Quantised(components) = &mut candidate {
            components[component] = Quantised::narrow(exact);
        }
        if accepts(&candidate) {
            stored = candidate;
        }
    }
    stored
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array1, array};

    #[test]
    fn integers_are_within_half_a_step() {
        let exact = Array1::from_shape_fn(1000, |i| (i as f32 * 0.7).sin() * 40.0 - 3.0);
        for (stored, steps) in [
            (Quantised::wide(exact.view()), 65535.0),
            (Quantised::narrow(exact.view()), 255.0),
        ] {
            let span = 80.0 / steps;
            assert!((stored.step / span - 1.0).abs() < 1e-3, "{}", stored.step);
            for (found, exact) in stored.decoded().iter().zip(&exact) {
                assert!((found - exact).abs() <= 0.5001 * stored.step + 4e-6);
            }
        }
    }

    #[test]
    fn equal_and_tiny_coefficients_are_kept() {
        for exact in [array![0.3_f32, 0.3], array![0.0, 0.0], array![1e-45, 0.0]] {
            let exact = exact.view();
            for stored in [Quantised::wide(exact), Quantised::narrow(exact)] {
                let decoded = stored.decoded();
                assert!(
                    decoded
                        .iter()
                        .zip(exact)
                        .all(|(a, b)| (a - b).abs() < 1e-40)
                );
            }
        }
    }

    #[test]
    fn bytes_and_shapes() {
        let exact = Array2::from_shape_fn((10, 3), |(i, j)| (i * j) as f32);
        for (precision, bytes) in Precision::ALL.into_iter().zip([120, 60, 60 + 24]) {
            let stored = StoredCoefficients::new(exact.clone(), precision);
            assert_eq!((stored.precision(), stored.bytes()), (precision, bytes));
            let difference = &stored.decoded() - &exact;
            assert!(difference.iter().all(|d| d.abs() < 1e-3));
            let first: Vec<f32> = exact.row(3).to_vec();
            let row = stored.decoded_row(3);
            assert!(row.iter().zip(first).all(|(a, b)| (a - b).abs() < 1e-3));
        }
        let huge = StoredCoefficients::new(array![[1e6, -1e6]], Precision::F16);
        assert_eq!(huge.decoded(), array![[65504.0, -65504.0]]);
    }

    #[test]
    fn later_components_are_narrowed_first() {
        let exact = Array2::from_shape_fn((10, 3), |(i, j)| (i * j) as f32);
        let wide = StoredCoefficients::new(exact.clone(), Precision::Quantised);
        let at_least = |bytes| move |candidate: &StoredCoefficients| candidate.bytes() >= bytes;
        let bits = |bytes| narrow_components(exact.view(), wide.clone(), at_least(bytes)).bits();
        assert_eq!(bits(0), [8, 8, 8]);
        assert_eq!(bits(24 + 50), [16, 16, 8]);
        assert_eq!(bits(24 + 60), [16, 16, 16]);
    }
}
