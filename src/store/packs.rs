//! The division of jobs into packs. The jobs of a pack share one file of each array: a Zarr
//! shard, in which each job is a chunk.
use std::ops::Range;

use crate::grid::{Jobs, multi_index};

/// Largest size of a pack, bytes: a process holds a whole pack in memory.
pub(super) const MAX_BYTES: u64 = 32 << 20;
/// Largest number of jobs of a pack: until it is packed, each job is a file.
const MAX_JOBS: u64 = 1024;

/// The packs of a database, numbered in storage order. A pack is a block of the grid of jobs
/// that has consecutive job numbers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Packs {
    /// Number of jobs of one pack along each axis.
    block: Vec<u64>,
    /// Number of packs along each axis.
    along: Vec<u64>,
    /// Number of all jobs.
    jobs: u64,
}

impl Packs {
    /// Packs of one job each.
    pub(super) fn of_one_job(jobs: &Jobs) -> Self {
        let along = jobs.blocks().to_vec();
        Self {
            block: vec![1; along.len()],
            along,
            jobs: jobs.count(),
        }
    }

    /// Packs of jobs that have `job_bytes` each.
    pub(super) fn new(jobs: &Jobs, job_bytes: u64) -> Self {
        let blocks = jobs.blocks();
        let mut left = (MAX_BYTES / job_bytes.max(1)).clamp(1, MAX_JOBS);
        let mut block = vec![1; blocks.len()];
        for axis in (0..blocks.len()).rev() {
            let is_first = blocks[..axis].iter().all(|n| *n == 1);
            block[axis] = share(blocks[axis], left, is_first);
            left /= block[axis];
            if block[axis] < blocks[axis] {
                break;
            }
        }
        let along = blocks.iter().zip(&block).map(|(n, b)| n.div_ceil(*b));
        Self {
            along: along.collect(),
            block,
            jobs: jobs.count(),
        }
    }

    /// Number of packs.
    pub(super) fn count(&self) -> u64 {
        self.along.iter().product()
    }

    /// Number of jobs of a pack. The last one may have fewer.
    pub(super) fn jobs(&self) -> u64 {
        self.block.iter().product()
    }

    /// Number of jobs of a pack along each axis, slowest first.
    pub(super) fn block(&self) -> &[u64] {
        &self.block
    }

    /// The pack of `job`.
    pub(super) fn of(&self, job: u64) -> u64 {
        job / self.jobs()
    }

    /// Numbers of the jobs of `pack`.
    pub(super) fn range(&self, pack: u64) -> Range<u64> {
        let first = pack * self.jobs();
        first..(first + self.jobs()).min(self.jobs)
    }

    /// Index of `pack` along each axis, in packs.
    pub(super) fn index(&self, pack: u64) -> Vec<u64> {
        multi_index(pack, &self.along).unwrap_or_default()
    }
}

/// How many of the `n` blocks along an axis a pack takes, at most `limit`. Unless it is the
/// first axis, all packs must have the same number, so that their job numbers are consecutive.
fn share(n: u64, limit: u64, is_first: bool) -> u64 {
    let most = limit.min(n).max(1);
    if is_first {
        return most;
    }
    (1..=most).rev().find(|k| n.is_multiple_of(*k)).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use proptest::prelude::*;

    use super::*;
    use crate::engine::Engine;
    use crate::parameter::{Axes, Parameter};

    fn jobs(lengths: [u64; 5]) -> Jobs {
        let values = |n: u64| (0..n).map(|i| i as f64).collect();
        let axes: Axes = Parameter::CORE
            .into_iter()
            .zip(lengths)
            .map(|(parameter, n)| (parameter, values(n)))
            .collect();
        Jobs::new(Engine::Reference, &axes, 3).unwrap()
    }

    proptest! {
        /// Packs partition the jobs into consecutive ones, and each is the block of the grid that
        /// its index names.
        #[test]
        fn packs_are_blocks(lengths in prop::array::uniform5(1_u64..8), limit in 1_u64..200) {
            let jobs = jobs(lengths);
            let packs = Packs::new(&jobs, MAX_BYTES / limit);
            prop_assert!(packs.jobs() <= MAX_BYTES / (MAX_BYTES / limit));
            prop_assert!((0..packs.count()).flat_map(|p| packs.range(p)).eq(0..jobs.count()));
            for job in 0..jobs.count() {
                let pack = packs.of(job);
                prop_assert!(packs.range(pack).contains(&job));
                let block = jobs.chunk(job).unwrap();
                let index = block.iter().zip(packs.block()).map(|(i, b)| i / b);
                prop_assert_eq!(index.collect::<Vec<_>>(), packs.index(pack));
            }
        }
    }

    #[test]
    fn packs_are_large_and_few() {
        let packs = |lengths, bytes| Packs::new(&jobs(lengths), bytes);
        // the thesis: 225 jobs of 55 kB
        assert_eq!(packs([9, 5, 5, 1, 1], 55_000).count(), 1);
        // a million jobs of 500 bytes
        assert_eq!(packs([100, 10, 10, 10, 10], 500).jobs(), 1000);
        // 7 of 12 blocks would fit, but do not divide 12
        assert_eq!(packs([100, 12, 12, 12, 1], 500).jobs(), 6 * 144);
        // a first axis is divided anywhere
        assert_eq!(packs([10_007, 1, 1, 1, 1], 500).count(), 10);
        assert_eq!(packs([7, 5, 1, 1, 1], MAX_BYTES).count(), 35);
    }
}
