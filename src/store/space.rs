//! Check that a database fits on the disk, before anything is simulated.
use std::path::Path;

use super::StoreError;
use crate::grid::Jobs;

/// Smallest disk space of a file, bytes.
const BLOCK: u64 = 4096;

/// Estimated size of the chunks of `count` jobs on disk, bytes.
#[must_use]
pub fn estimated_bytes(jobs: &Jobs, count: u64) -> u64 {
    let chunk = jobs.curves_per_job() * jobs.wavelengths() * size_of::<f32>() as u64;
    // Four chunks of spectra; lost share and commit mark need a block each.
    let per_job = 4 * (chunk + 4).next_multiple_of(BLOCK) + 2 * BLOCK;
    per_job.saturating_mul(count)
}

/// Refuses `count` jobs if they do not fit on the disk of the database in `dir`.
pub(super) fn check(dir: &Path, jobs: &Jobs, count: u64) -> Result<(), StoreError> {
    // The database may be a link to another disk.
    let root = dir.join(super::DATABASE);
    let disk = if root.exists() { &root } else { dir };
    let available = fs4::available_space(disk).map_err(StoreError::io("measure", disk))?;
    let needed = estimated_bytes(jobs, count);
    if needed > available {
        return Err(StoreError::TooLarge {
            path: dir.into(),
            needed,
            available,
        });
    }
    Ok(())
}
