//! Which curves one job computes. A job is a block of the grid: one chunk of
//! the store, all wavelengths.
use super::GridError;
use crate::engine::Engine;

/// Axis lengths, or one index per axis, in storage order (slowest first):
/// facetness, grain size, density, thickness, angle.
pub type Shape = [u64; 5];

/// Positions of thickness and angle in a [`Shape`].
const THICKNESS: usize = 3;
const ANGLE: usize = 4;

/// The block of curves that one job of `engine` computes, of a grid of `shape`.
#[must_use]
pub fn job_shape(engine: Engine, shape: Shape) -> Shape {
    let mut block = [1; 5];
    if engine.shares_thicknesses() {
        block[THICKNESS] = shape[THICKNESS];
    }
    if engine.shares_angles() {
        block[ANGLE] = shape[ANGLE];
    }
    block
}

/// The jobs of a grid, numbered in storage order of their blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Jobs {
    shape: Shape,
    block: Shape,
    blocks: Shape,
    wavelengths: u64,
    /// Of the axes beyond the five.
    combinations: u64,
}

impl Jobs {
    /// # Errors
    /// All lengths must be at least 1, and their product (with 8 bytes per
    /// value) must fit 64 bits.
    pub fn new(engine: Engine, shape: Shape, wavelengths: u64) -> Result<Self, GridError> {
        let [f, s, d, h, a] = shape;
        let all = [f, s, d, h, a, wavelengths];
        if let Some((axis, _)) = super::Axes::NAMES
            .into_iter()
            .chain(["wavelength_nm"])
            .zip(all)
            .find(|(_, n)| *n == 0)
        {
            return Err(GridError::Empty { axis });
        }
        all.into_iter()
            .try_fold(8_u64, u64::checked_mul)
            .ok_or(GridError::TooMany { shape: all.into() })?;
        let block = job_shape(engine, shape);
        let mut blocks = shape;
        for (n, b) in blocks.iter_mut().zip(block) {
            *n = n.div_ceil(b);
        }
        Ok(Self {
            shape,
            block,
            blocks,
            wavelengths,
            combinations: 1,
        })
    }

    /// These jobs once for each of `combinations` of the axes beyond the five,
    /// which run slower.
    ///
    /// # Errors
    /// There must be at least one, and not more values than can be counted.
    pub fn repeated(self, combinations: u64) -> Result<Self, GridError> {
        let shape = [&[combinations], &self.shape[..], &[self.wavelengths]].concat();
        let mut lengths = shape.iter().copied();
        match lengths.try_fold(8_u64, u64::checked_mul) {
            Some(1..) => Ok(Self {
                combinations,
                ..self
            }),
            _ => Err(GridError::TooMany { shape }),
        }
    }

    /// Number of jobs.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.combinations * self.jobs_each()
    }

    /// Lengths of the five axes in blocks.
    #[must_use]
    pub fn blocks(&self) -> Shape {
        self.blocks
    }

    /// Number of jobs of one combination of the axes beyond the five.
    #[must_use]
    pub fn jobs_each(&self) -> u64 {
        self.blocks.iter().product()
    }

    /// Number of curves (spectra) of the grid.
    #[must_use]
    pub fn curves(&self) -> u64 {
        self.combinations * self.curves_each()
    }

    /// Number of curves of one combination of the axes beyond the five.
    #[must_use]
    pub fn curves_each(&self) -> u64 {
        self.shape.iter().product()
    }

    /// The combination of the axes beyond the five that `job` is of.
    #[must_use]
    pub fn combination(&self, job: u64) -> u64 {
        job / self.jobs_each()
    }

    /// Number of curves of one job.
    #[must_use]
    pub fn curves_per_job(&self) -> u64 {
        self.block.iter().product()
    }

    /// Lengths of the five axes.
    #[must_use]
    pub fn shape(&self) -> Shape {
        self.shape
    }

    /// Block of one job.
    #[must_use]
    pub fn block(&self) -> Shape {
        self.block
    }

    /// Number of wavelengths.
    #[must_use]
    pub fn wavelengths(&self) -> u64 {
        self.wavelengths
    }

    /// Position of `job`'s block in the grid of blocks of the five axes.
    ///
    /// # Errors
    /// There is no such job.
    pub fn chunk(&self, job: u64) -> Result<Shape, GridError> {
        let there = Some(job).filter(|job| *job < self.count());
        let index = there.and_then(|job| multi_index(job % self.jobs_each(), self.blocks));
        index.ok_or(GridError::NoSuchJob {
            job,
            jobs: self.count(),
        })
    }

    /// Index of the first curve of `job` along each of the five axes.
    ///
    /// # Errors
    /// There is no such job.
    pub fn origin(&self, job: u64) -> Result<Shape, GridError> {
        let mut origin = self.chunk(job)?;
        for (index, block) in origin.iter_mut().zip(self.block) {
            *index *= block;
        }
        Ok(origin)
    }
}

/// Index along each axis of flat index `flat`; `None` outside `shape`.
fn multi_index(mut flat: u64, shape: Shape) -> Option<Shape> {
    let mut index = [0; 5];
    for (i, n) in index.iter_mut().zip(shape).rev() {
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
    fn flat_index(index: Shape, shape: Shape) -> u64 {
        index.iter().zip(shape).fold(0, |flat, (i, n)| flat * n + i)
    }

    fn any_jobs() -> impl Strategy<Value = Jobs> {
        (prop::array::uniform5(1_u64..5), 0..Engine::ALL.len())
            .prop_map(|(shape, e)| Jobs::new(Engine::ALL[e], shape, 3).unwrap())
    }

    proptest! {
        #[test]
        fn index_and_multi_index_are_inverse(shape in prop::array::uniform5(1_u64..6), raw: u64) {
            let count: u64 = shape.iter().product();
            let flat = raw % count;
            let index = multi_index(flat, shape).unwrap();
            prop_assert!(index.iter().zip(shape).all(|(i, n)| *i < n));
            prop_assert_eq!(flat_index(index, shape), flat);
            prop_assert_eq!(multi_index(count, shape), None);
        }

        #[test]
        fn jobs_partition_the_curves(jobs in any_jobs()) {
            let mut seen = BTreeSet::new();
            for job in 0..jobs.count() {
                let origin = jobs.origin(job).unwrap();
                for within in 0..jobs.curves_per_job() {
                    let mut index = multi_index(within, jobs.block()).unwrap();
                    for (i, o) in index.iter_mut().zip(origin) {
                        *i += o;
                    }
                    prop_assert!(seen.insert(flat_index(index, jobs.shape())));
                }
            }
            prop_assert_eq!(seen.len() as u64, jobs.curves());
            prop_assert!(seen.iter().copied().eq(0..jobs.curves()));
            prop_assert!(jobs.chunk(jobs.count()).is_err());
        }

        #[test]
        fn shards_partition_the_jobs(jobs in any_jobs(), count in 1_u64..7) {
            for job in 0..jobs.count() {
                let owners = (0..count)
                    .filter(|i| Shard::new(*i, count).unwrap().owns(job))
                    .count();
                prop_assert_eq!(owners, 1);
            }
        }
    }

    #[test]
    fn absurd_grids_are_refused_by_count() {
        let shape = [1 << 20, 1 << 20, 1 << 20, 1, 1];
        let error = Jobs::new(Engine::Spectral, shape, 31).unwrap_err();
        assert!(
            error.to_string().starts_with("1048576 x 1048576 x"),
            "{error}"
        );
    }

    #[test]
    fn spectral_jobs_hold_all_thicknesses() {
        let shape = [5, 9, 5, 11, 10];
        assert_eq!(
            Jobs::new(Engine::Spectral, shape, 31).unwrap().count(),
            2250
        );
        assert_eq!(
            Jobs::new(Engine::Reference, shape, 31).unwrap().count(),
            24_750
        );
    }
}
