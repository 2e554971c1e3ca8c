//! The division of a grid into jobs. A job is a block of the grid at all wavelengths, and
//! one chunk of the store.
use std::ops::Range;

use super::GridError;
use crate::engine::Engine;
use crate::parameter::{Axes, Parameter, Role};

/// The jobs of a grid, numbered in storage order of their blocks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Jobs {
    parameters: Vec<Parameter>,
    /// Lengths of the axes.
    shape: Vec<u64>,
    /// Number of curves of one job along each axis.
    block: Vec<u64>,
    /// Number of jobs along each axis.
    blocks: Vec<u64>,
    wavelengths: u64,
}

/// Number of nodes that one job of `engine` simulates along the axis of `parameter`, which
/// has `length` nodes.
fn block(engine: Engine, parameter: Parameter, length: u64) -> u64 {
    let shared = match parameter.record().role {
        Role::Snow => false,
        Role::View => true,
        Role::Thickness => engine.shares_thicknesses(),
        Role::Incidence => engine.shares_angles(),
    };
    if shared { length } else { 1 }
}

impl Jobs {
    /// The jobs of a grid with these `axes` and `wavelengths` wavelengths.
    ///
    /// # Errors
    /// [`GridError::Empty`] if an axis has no values; [`GridError::TooMany`] if the size of
    /// the grid at 8 bytes per value does not fit into 64 bits.
    pub fn new(engine: Engine, axes: &Axes, wavelengths: u64) -> Result<Self, GridError> {
        let lengths = axes
            .iter()
            .map(|(p, values)| (p.key(), values.len() as u64));
        let mut lengths = lengths.chain([("wavelength_nm", wavelengths)]);
        if let Some((axis, _)) = lengths.find(|(_, n)| *n == 0) {
            return Err(GridError::Empty { axis });
        }
        let shape = axes.shape();
        let full_shape = [&shape[..], &[wavelengths]].concat();
        if full_shape
            .iter()
            .try_fold(8_u64, |n, length| n.checked_mul(*length))
            .is_none()
        {
            return Err(GridError::TooMany { shape: full_shape });
        }
        let parameters: Vec<_> = axes.iter().map(|(parameter, _)| parameter).collect();
        let block: Vec<u64> = parameters
            .iter()
            .zip(&shape)
            .map(|(parameter, length)| block(engine, *parameter, *length))
            .collect();
        Ok(Self {
            blocks: shape
                .iter()
                .zip(&block)
                .map(|(n, b)| n.div_ceil(*b))
                .collect(),
            parameters,
            shape,
            block,
            wavelengths,
        })
    }

    /// Number of jobs.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.blocks.iter().product()
    }

    /// Number of curves (spectra) of the grid.
    #[must_use]
    pub fn curves(&self) -> u64 {
        self.shape.iter().product()
    }

    /// Number of curves of one job.
    #[must_use]
    pub fn curves_per_job(&self) -> u64 {
        self.block.iter().product()
    }

    /// Lengths of the axes, slowest first.
    #[must_use]
    pub fn shape(&self) -> &[u64] {
        &self.shape
    }

    /// Number of jobs along each axis, slowest first.
    #[must_use]
    pub fn blocks(&self) -> &[u64] {
        &self.blocks
    }

    /// Number of curves of one job along each axis, slowest first.
    #[must_use]
    pub fn block(&self) -> &[u64] {
        &self.block
    }

    /// Number of nodes of one job along an axis; 1 if the axis is not in the grid.
    #[must_use]
    pub fn block_along(&self, parameter: Parameter) -> usize {
        let mut axes = self.parameters.iter().zip(&self.block);
        let axis = axes.find(|(other, _)| **other == parameter);
        axis.map_or(1, |(_, block)| *block as usize)
    }

    /// Number of wavelengths.
    #[must_use]
    pub fn wavelengths(&self) -> u64 {
        self.wavelengths
    }

    /// Index of the block of `job` along each axis, in blocks.
    ///
    /// # Errors
    /// [`GridError::NoSuchJob`] if `job` is out of range.
    pub fn chunk(&self, job: u64) -> Result<Vec<u64>, GridError> {
        multi_index(job, &self.blocks).ok_or(GridError::NoSuchJob {
            job,
            jobs: self.count(),
        })
    }

    /// Index of the first curve of `job` along each axis.
    ///
    /// # Errors
    /// [`GridError::NoSuchJob`] if `job` is out of range.
    pub fn origin(&self, job: u64) -> Result<Vec<u64>, GridError> {
        let mut origin = self.chunk(job)?;
        for (index, block) in origin.iter_mut().zip(&self.block) {
            *index *= block;
        }
        Ok(origin)
    }

    /// Indices of the nodes of `job` along an axis; 0..1 if the axis is not in the grid.
    ///
    /// # Errors
    /// [`GridError::NoSuchJob`] if `job` is out of range.
    pub fn nodes(&self, job: u64, parameter: Parameter) -> Result<Range<usize>, GridError> {
        let origin = self.origin(job)?;
        let mut axes = self.parameters.iter().zip(origin);
        let axis = axes.find(|(other, _)| **other == parameter);
        let first = axis.map_or(0, |(_, index)| index as usize);
        Ok(first..first + self.block_along(parameter))
    }
}

/// Index along each axis of the flat index `flat`; `None` if it is outside `shape`.
pub(crate) fn multi_index(mut flat: u64, shape: &[u64]) -> Option<Vec<u64>> {
    let mut index = shape.to_vec();
    for i in index.iter_mut().rev() {
        let n = *i;
        *i = flat.checked_rem(n)?;
        flat /= n;
    }
    (flat == 0).then_some(index)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;
    use crate::grid::Shard;

    /// Horner's rule: the inverse of `multi_index`, written independently.
    fn flat_index(index: &[u64], shape: &[u64]) -> u64 {
        index.iter().zip(shape).fold(0, |flat, (i, n)| flat * n + i)
    }

    /// Axes of these lengths: those that every database has, and one more.
    fn axes(lengths: [u64; 6]) -> Axes {
        let [temperature, core @ ..] = lengths;
        let values = |n: u64| (0..n).map(|i| i as f64).collect();
        let core = Parameter::CORE.into_iter().zip(core);
        let all = [(Parameter::Temperature, temperature)]
            .into_iter()
            .chain(core);
        all.map(|(parameter, n)| (parameter, values(n))).collect()
    }

    fn any_jobs() -> impl Strategy<Value = Jobs> {
        (prop::array::uniform6(1_u64..5), 0..Engine::ALL.len())
            .prop_map(|(lengths, e)| Jobs::new(Engine::ALL[e], &axes(lengths), 3).unwrap())
    }

    proptest! {
        #[test]
        fn index_and_multi_index_are_inverse(shape in prop::array::uniform5(1_u64..6), raw: u64) {
            let count: u64 = shape.iter().product();
            let flat = raw % count;
            let index = multi_index(flat, &shape).unwrap();
            prop_assert!(index.iter().zip(shape).all(|(i, n)| *i < n));
            prop_assert_eq!(flat_index(&index, &shape), flat);
            prop_assert_eq!(multi_index(count, &shape), None);
        }

        #[test]
        fn jobs_partition_the_curves(jobs in any_jobs()) {
            let mut seen = BTreeSet::new();
            for job in 0..jobs.count() {
                let origin = jobs.origin(job).unwrap();
                for (parameter, first) in jobs.parameters.iter().zip(&origin) {
                    prop_assert_eq!(jobs.nodes(job, *parameter).unwrap().start as u64, *first);
                }
                for within in 0..jobs.curves_per_job() {
                    let mut index = multi_index(within, jobs.block()).unwrap();
                    for (i, o) in index.iter_mut().zip(&origin) {
                        *i += o;
                    }
                    prop_assert!(seen.insert(flat_index(&index, jobs.shape())));
                }
            }
            prop_assert_eq!(seen.len() as u64, jobs.curves());
            prop_assert!(seen.iter().copied().eq(0..jobs.curves()));
            prop_assert!(jobs.chunk(jobs.count()).is_err());
        }

        #[test]
        fn shards_partition_the_jobs(jobs in any_jobs(), count in 1_u64..70) {
            let ranges = (0..count).map(|i| Shard::new(i, count).unwrap().range(&jobs));
            let lengths: Vec<u64> = ranges.clone().map(|range| range.end - range.start).collect();
            prop_assert!(ranges.flatten().eq(0..jobs.count()));
            // the largest share is at most a quarter, or one job, above an even one
            let even = jobs.count() as f64 / count as f64;
            let largest = lengths.into_iter().max().unwrap() as f64;
            prop_assert!(largest < (1.25 * even).max(even + 1.0) + 1e-9, "{largest} of {even}");
        }
    }

    #[test]
    fn shards_take_whole_blocks_of_the_slowest_axes() {
        // 9 values of facetness, 45 jobs each
        let jobs = Jobs::new(Engine::Hybrid, &axes([1, 9, 5, 9, 4, 3]), 3).unwrap();
        assert_eq!(jobs.count(), 9 * 45);
        let first = |count| Shard::new(0, count).unwrap().range(&jobs).end;
        // shards, and where the first of them ends: with a facetness, or with a grain size
        for (count, end) in [(1, 405), (2, 180), (3, 135), (9, 45), (10, 36), (405, 1)] {
            assert_eq!(first(count), end, "{count}");
        }
    }

    #[test]
    fn absurd_grids_are_refused_by_count() {
        // lengths are enough: 2^60 curves
        let values = vec![0.0; 1 << 10];
        let all = Parameter::ALL.into_iter().take(6);
        let axes = all.map(|parameter| (parameter, values.clone())).collect();
        let error = Jobs::new(Engine::Spectral, &axes, 31).unwrap_err();
        assert!(error.to_string().starts_with("1024 x 1024 x"), "{error}");
    }

    #[test]
    fn spectral_jobs_hold_all_thicknesses() {
        let count = |engine| {
            Jobs::new(engine, &axes([1, 5, 9, 5, 11, 10]), 31)
                .unwrap()
                .count()
        };
        assert_eq!(count(Engine::Spectral), 2250);
        assert_eq!(count(Engine::Reference), 24_750);
        assert_eq!(count(Engine::Hybrid), 225);
    }
}
