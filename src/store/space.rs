//! Check that a database fits on the disk, before anything is simulated.
use std::path::Path;

use super::StoreError;
use crate::grid::Jobs;

/// Smallest disk space of a file, bytes.
const BLOCK: u64 = 4096;

/// Estimated size of the chunks of `count` jobs with `views` views per curve on disk, bytes.
#[must_use]
pub fn estimated_bytes(jobs: &Jobs, views: u64, count: u64) -> u64 {
    let chunk = jobs.curves_per_job() * jobs.wavelengths() * size_of::<f32>() as u64;
    let on_disk = |bytes: u64| bytes.saturating_add(4).next_multiple_of(BLOCK);
    let views = match views {
        0 => 0,
        _ => on_disk(chunk.saturating_mul(views)),
    };
    // Four chunks each; lost share and commit mark need a block each.
    let per_job = 4 * (on_disk(chunk) + views) + 2 * BLOCK;
    per_job.saturating_mul(count)
}

/// Refuses `count` jobs if they do not fit on the disk of the database in `dir`.
pub(super) fn check(dir: &Path, jobs: &Jobs, views: u64, count: u64) -> Result<(), StoreError> {
    // The database may be a link to another disk.
    let root = dir.join(super::DATABASE);
    let disk = if root.exists() { &root } else { dir };
    let available = fs4::available_space(disk).map_err(StoreError::io("measure", disk))?;
    let needed = estimated_bytes(jobs, views, count);
    if needed > available {
        return Err(StoreError::TooLarge {
            path: dir.into(),
            needed,
            available,
        });
    }
    Ok(())
}
