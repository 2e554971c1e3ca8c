//! Grids and boxes in parameter space.
use std::collections::BTreeMap;

use super::{Parameter, Point};

/// The nodes of a database: strictly increasing values of some parameters. Combinations
/// of nodes are numbered in storage order, the last parameter fastest.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Axes(BTreeMap<Parameter, Vec<f64>>);

impl Axes {
    /// Values of an axis; empty if the axis does not exist.
    #[must_use]
    pub fn values(&self, parameter: Parameter) -> &[f64] {
        self.0.get(&parameter).map_or(&[], Vec::as_slice)
    }

    /// Mutable values of an axis; creates an empty axis if it does not exist.
    pub fn values_mut(&mut self, parameter: Parameter) -> &mut Vec<f64> {
        self.0.entry(parameter).or_default()
    }

    /// Sets the values of an axis and returns its previous values, if it existed.
    pub fn set(&mut self, parameter: Parameter, values: Vec<f64>) -> Option<Vec<f64>> {
        self.0.insert(parameter, values)
    }

    /// These axes with the values of one axis set.
    #[must_use]
    pub fn with(mut self, parameter: Parameter, values: Vec<f64>) -> Self {
        self.set(parameter, values);
        self
    }

    /// Whether the axis exists.
    #[must_use]
    pub fn has(&self, parameter: Parameter) -> bool {
        self.0.contains_key(&parameter)
    }

    /// All axes in storage order, slowest first.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = (Parameter, &[f64])> + Clone {
        self.0
            .iter()
            .map(|(parameter, values)| (*parameter, values.as_slice()))
    }

    /// Number of axes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there are no axes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The optional axes that describe the snow and its substrate.
    #[must_use]
    pub fn optional(&self) -> Self {
        let optional = self.iter().filter(|(p, _)| p.is_optional() && !p.is_view());
        optional.map(|(p, values)| (p, values.to_vec())).collect()
    }

    /// The axes of the direction of view only.
    #[must_use]
    pub fn views(&self) -> Self {
        let views = self.iter().filter(|(parameter, _)| parameter.is_view());
        views.map(|(p, values)| (p, values.to_vec())).collect()
    }

    /// All other axes.
    #[must_use]
    pub fn without_views(&self) -> Self {
        let others = self.iter().filter(|(parameter, _)| !parameter.is_view());
        others.map(|(p, values)| (p, values.to_vec())).collect()
    }

    /// Values of the axes of [`Parameter::CORE`].
    #[must_use]
    pub fn core(&self) -> [&[f64]; 5] {
        Parameter::CORE.map(|parameter| self.values(parameter))
    }

    /// Lengths of the axes of [`Parameter::CORE`].
    #[must_use]
    pub fn core_shape(&self) -> [usize; 5] {
        Parameter::CORE.map(|parameter| self.values(parameter).len())
    }

    /// Lengths of all axes in storage order.
    #[must_use]
    pub fn shape(&self) -> Vec<u64> {
        self.0.values().map(|values| values.len() as u64).collect()
    }

    /// Number of combinations of values, at most `u64::MAX`; 1 without axes.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.shape().into_iter().fold(1, u64::saturating_mul)
    }

    /// Position along each axis of combination `number`, modulo their count.
    #[must_use]
    pub fn positions(&self, mut number: u64) -> Vec<u64> {
        let mut positions = self.shape();
        for position in positions.iter_mut().rev() {
            let length = (*position).max(1);
            *position = number % length;
            number /= length;
        }
        positions
    }

    /// The values of combination `number`, modulo their count.
    #[must_use]
    pub fn point(&self, number: u64) -> Point {
        let positions = self.positions(number);
        let values = self.0.iter().zip(positions);
        values
            .filter_map(|((parameter, values), i)| Some((*parameter, *values.get(i as usize)?)))
            .collect()
    }

    /// The number of the combination at these positions along the axes.
    #[must_use]
    pub fn number(&self, positions: &[u64]) -> u64 {
        let lengths = self.0.values().map(|values| values.len() as u64);
        lengths
            .zip(positions)
            .fold(0, |number, (length, i)| number * length + i)
    }

    /// The box from the first to the last node of each axis.
    #[must_use]
    pub fn region(&self) -> Region {
        let ends = |values: &[f64]| Some([*values.first()?, *values.last()?]);
        self.iter()
            .filter_map(|(p, values)| Some((p, ends(values)?)))
            .collect()
    }
}

impl<const N: usize> From<[(Parameter, Vec<f64>); N]> for Axes {
    fn from(values: [(Parameter, Vec<f64>); N]) -> Self {
        values.into_iter().collect()
    }
}

impl FromIterator<(Parameter, Vec<f64>)> for Axes {
    fn from_iter<I: IntoIterator<Item = (Parameter, Vec<f64>)>>(values: I) -> Self {
        Self(values.into_iter().collect())
    }
}

/// A box in parameter space: smallest and largest value of some parameters.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Region(BTreeMap<Parameter, [f64; 2]>);

impl Region {
    /// Smallest and largest value of a parameter; `None` if the box does not limit it.
    #[must_use]
    pub fn get(&self, parameter: Parameter) -> Option<[f64; 2]> {
        self.0.get(&parameter).copied()
    }

    /// The limited parameters and their smallest and largest values, in storage order.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = (Parameter, [f64; 2])> {
        self.0.iter().map(|(parameter, ends)| (*parameter, *ends))
    }

    /// Whether `point` is inside the box, ends included, in every limited parameter.
    #[must_use]
    pub fn contains(&self, point: &Point) -> bool {
        let mut ends = self.0.iter();
        ends.all(|(parameter, [min, max])| (*min..=*max).contains(&point[*parameter]))
    }
}

impl<const N: usize> From<[(Parameter, [f64; 2]); N]> for Region {
    fn from(ends: [(Parameter, [f64; 2]); N]) -> Self {
        ends.into_iter().collect()
    }
}

impl FromIterator<(Parameter, [f64; 2])> for Region {
    fn from_iter<I: IntoIterator<Item = (Parameter, [f64; 2])>>(ends: I) -> Self {
        Self(ends.into_iter().collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_axis_runs_fastest() {
        let axes = Axes::from([
            (Parameter::Thickness, vec![1.0, 2.0, 5.0]),
            (Parameter::Temperature, vec![-10.0, 0.0]),
        ]);
        assert_eq!((axes.shape(), axes.count()), (vec![2, 3], 6));
        assert_eq!(axes.point(4)[Parameter::Thickness], 2.0);
        assert_eq!(axes.point(4)[Parameter::Temperature], 0.0);
        for number in 0..6 {
            assert_eq!(axes.number(&axes.positions(number)), number);
        }
        assert_eq!(axes.optional().count(), 2);
        let region = axes.region();
        assert_eq!(region.get(Parameter::Thickness), Some([1.0, 5.0]));
        assert!(region.contains(&axes.point(5)) && !region.contains(&Point::default()));
        assert_eq!(Axes::default().count(), 1);
    }
}
