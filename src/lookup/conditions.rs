//! Between the values of axes beyond the five.
//!
//! What is interpolated is y = -ln T, and -ln(1 - R) for reflectance, as along the
//! five axes: linear in a coordinate of each axis in which y is close to a straight
//! line (docs/methods.md). Where the file's basis is one of y, that is a mean of its
//! coefficients.
use std::collections::BTreeMap;

use ndarray::{Array2, Axis, Slice};

use super::{Database, Factors, LookupError, nodes};
use crate::compress::Basis;
use crate::grid::{Conditions, ExtraAxis, combination};
use crate::measurement::Quantity;

/// What absorbs in clean snow, as carbon, ng/g.
const CARBON_NG_G: f64 = 20.0;
/// Reflectance of the snow above a substrate.
const SNOW: f64 = 0.95;
/// Largest y, as in [`super::smooth`].
const DARKEST: f64 = 16.0;
/// Most bytes of spectra made of a `linear` file.
const MOST_BYTES: u128 = 1 << 30;

/// The coordinate of a value.
fn place(axis: ExtraAxis, value: f64) -> f64 {
    match axis {
        ExtraAxis::BlackCarbon => (value + CARBON_NG_G).sqrt(),
        ExtraAxis::WaterSaturation => -libm::log(1.0 - value),
        ExtraAxis::Temperature => value,
        ExtraAxis::Sphericity => libm::log(value),
        ExtraAxis::SubstrateReflectance => -libm::log(1.0 - SNOW * value),
    }
}

/// [`place`] inverted.
fn value_at(axis: ExtraAxis, place: f64) -> f64 {
    match axis {
        ExtraAxis::BlackCarbon => place * place - CARBON_NG_G,
        ExtraAxis::WaterSaturation => 1.0 - libm::exp(-place),
        ExtraAxis::Temperature => place,
        ExtraAxis::Sphericity => libm::exp(place),
        ExtraAxis::SubstrateReflectance => (1.0 - libm::exp(-place)) / SNOW,
    }
}

/// Values of the axis from `first` to `last`, evenly spaced in its coordinate.
pub(crate) fn spread_beyond(axis: ExtraAxis, [first, last]: [f64; 2], n: usize) -> Vec<f64> {
    let ends = [place(axis, first), place(axis, last)];
    let value = |i: usize| {
        let value = value_at(
            axis,
            ends[0] + (ends[1] - ends[0]) * i as f64 / (n.max(2) - 1) as f64,
        );
        let rounded = format!("{value:.3e}").parse().unwrap_or(value);
        f64::clamp(rounded, first, last)
    };
    let mut values: Vec<f64> = (0..n).map(value).collect();
    if let [begin, .., end] = values.as_mut_slice() {
        (*begin, *end) = (first, last);
    }
    values
}

impl Database {
    /// Axes beyond the five, usually none; curves run slower along them.
    #[must_use]
    pub fn extra(&self) -> &BTreeMap<ExtraAxis, Vec<f32>> {
        &self.extra
    }

    /// The values of curve `row` on the axes beyond the five.
    #[must_use]
    pub fn conditions(&self, row: usize) -> Conditions {
        let number = row / self.curves_each().max(1);
        let values = combination(&self.extra, number as u64).into_iter();
        values.map(|(axis, value)| (axis, exact(value))).collect()
    }

    /// Number of curves of one combination of the axes beyond the five.
    pub(super) fn curves_each(&self) -> usize {
        self.axes.iter().map(Vec::len).product()
    }

    /// [`LookupError::Condition`] if there is more than one such combination.
    pub(super) fn single(&self) -> Result<(), LookupError> {
        match self.extra.iter().find(|(_, values)| values.len() > 1) {
            None => Ok(()),
            Some((axis, values)) => Err(untold(*axis, values)),
        }
    }

    /// The five-axis database at one value of each axis beyond the five; those of
    /// a single value may be left out.
    ///
    /// On a node it is that part of the file as it stands, between nodes a mean of
    /// the parts around.
    ///
    /// # Errors
    /// [`LookupError::Condition`] for a value that is missing,
    /// [`LookupError::NoAxis`] for one of an axis that the file has not,
    /// [`LookupError::Outside`]; [`LookupError::TooLarge`] for a `linear` file whose
    /// spectra would not fit 1 GB.
    pub fn at(&self, conditions: &Conditions) -> Result<Self, LookupError> {
        if let Some(axis) = conditions
            .keys()
            .find(|axis| !self.extra.contains_key(axis))
        {
            return Err(LookupError::NoAxis { axis: axis.name() });
        }
        let mut corners = vec![(0, 1.0)];
        for (&axis, values) in &self.extra {
            let asked = conditions.get(&axis).copied();
            let (below, share) = match asked {
                Some(value) => cell(axis, values, value)?,
                None if values.len() == 1 => (0, 0.0),
                None => return Err(untold(axis, values)),
            };
            let both = [(below, 1.0 - share), (below + 1, share)];
            let there = both.into_iter().filter(|(_, weight)| *weight > 0.0);
            let there: Vec<_> = there.collect();
            let split = |(block, weight): (usize, f64)| {
                let all = there.iter();
                all.map(move |(i, share)| (block * values.len() + i, weight * share))
            };
            corners = corners.into_iter().flat_map(split).collect();
        }
        if corners.len() > 1 && self.kind == Basis::Linear {
            let values = self.curves_each() as u128 * self.wavelengths_nm.len() as u128;
            let bytes = values * size_of::<f32>() as u128;
            if bytes > MOST_BYTES {
                return Err(LookupError::TooLarge { bytes });
            }
        }
        Ok(Self {
            axes: self.axes.clone(),
            absent: self.absent.clone(),
            extra: BTreeMap::new(),
            wavelengths_nm: self.wavelengths_nm.clone(),
            curves: self.curves_each(),
            kind: self.kind,
            precision: self.precision,
            transmittance: self.mixed(Quantity::Transmittance, &corners),
            reflectance: self.mixed(Quantity::Reflectance, &corners),
            stands_free: self.stands_free,
            metadata: self.metadata.clone(),
        })
    }

    /// Means of the parts numbered and weighted in `corners`.
    fn mixed(&self, quantity: Quantity, corners: &[(usize, f64)]) -> Factors {
        let all = self.factors(quantity);
        let (n, l) = (self.curves_each(), self.wavelengths_nm.len());
        if !self.has(quantity) {
            return Factors::default();
        }
        let part = |block: usize| {
            let rows = Slice::from(block * n..(block + 1) * n);
            all.coefficients.slice_axis(Axis(0), rows)
        };
        if let [(block, _)] = corners {
            return Factors {
                coefficients: part(*block).to_owned(),
                basis: all.basis.clone(),
            };
        }
        if self.kind == Basis::Log {
            let mut coefficients = Array2::zeros((n, all.coefficients.ncols()));
            for (block, weight) in corners {
                coefficients.scaled_add(*weight as f32, &part(*block));
            }
            return Factors {
                coefficients,
                basis: all.basis.clone(),
            };
        }
        let mut curves = Array2::zeros((n, l));
        for (row, mut mean) in curves.rows_mut().into_iter().enumerate() {
            if !self.exists(row) {
                continue;
            }
            let mut sum = vec![0.0; l];
            for (block, weight) in corners {
                let curve = self.curve(block * n + row, quantity).unwrap_or_default();
                for (sum, value) in sum.iter_mut().zip(curve) {
                    let y = Basis::Log.projected(quantity, f64::from(value));
                    *sum += weight * y.min(DARKEST);
                }
            }
            for (value, y) in mean.iter_mut().zip(sum) {
                *value = Basis::Log.value(quantity, y) as f32;
            }
        }
        Factors {
            coefficients: curves,
            basis: Array2::eye(l),
        }
    }
}

fn untold(axis: ExtraAxis, values: &[f32]) -> LookupError {
    LookupError::Condition {
        axis: axis.name(),
        first: values.first().copied().unwrap_or(f32::NAN),
        last: values.last().copied().unwrap_or(f32::NAN),
    }
}

/// The node below `value` and how far it is from there to the next, in the
/// coordinate of the axis.
fn cell(axis: ExtraAxis, values: &[f32], value: f64) -> Result<(usize, f64), LookupError> {
    match nodes::find(axis.name(), values, value) {
        Ok(node) => Ok((node, 0.0)),
        Err(LookupError::BetweenNodes { below, above, .. }) => {
            let [from, to] = [below, above].map(|node| place(axis, exact(node)));
            let node = values.iter().position(|node| *node == below);
            Ok((
                node.unwrap_or_default(),
                (place(axis, value) - from) / (to - from),
            ))
        }
        Err(outside) => Err(outside),
    }
}

/// The decimal that an f32 stands for.
pub(crate) fn exact(value: f32) -> f64 {
    let decimal = value.to_string().parse();
    decimal.unwrap_or(f64::from(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_grow_and_come_back() {
        let ends = [
            [0.0, 1e9],
            [0.0, 0.5],
            [-40.0, 0.0],
            [0.01, 1.0],
            [0.0, 1.0],
        ];
        for (axis, [first, last]) in ExtraAxis::ALL.into_iter().zip(ends) {
            let mut before = f64::NEG_INFINITY;
            for i in 0..=100 {
                let value = first + (last - first) * f64::from(i) / 100.0;
                let here = place(axis, value);
                assert!(
                    here > before
                        && (value_at(axis, here) - value).abs() <= 1e-9 * last.abs().max(40.0)
                );
                before = here;
            }
            let values = spread_beyond(axis, [first, last], 6);
            assert_eq!((values[0], values[5], values.len()), (first, last, 6));
            assert!(
                values.windows(2).all(|pair| pair[0] < pair[1]),
                "{values:?}"
            );
        }
        let carbon = spread_beyond(ExtraAxis::BlackCarbon, [0.0, 400.0], 3);
        let halfway = (0.5 * (20_f64.sqrt() + 420_f64.sqrt())).powi(2) - 20.0;
        assert!((carbon[1] - halfway).abs() < 0.1, "{carbon:?}");
    }
}
