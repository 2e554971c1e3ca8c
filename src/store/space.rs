//! Check that a database fits on the disk, before anything is simulated.
use std::path::Path;

use super::StoreError;
use super::packs::{self, Packs};
use crate::grid::Jobs;

/// Smallest disk space of a file, bytes.
const BLOCK: u64 = 4096;

/// Estimated size of `count` jobs with `views` views per curve in the arrays, bytes.
#[must_use]
pub fn estimated_bytes(jobs: &Jobs, views: u64, count: u64) -> u64 {
    let values = jobs.curves_per_job().saturating_mul(jobs.wavelengths());
    let values = values.saturating_mul(4 * (1 + views));
    // 4 bytes each; with each of four or eight chunks, a checksum and a place in an index; the
    // share of lost rays and the commit mark
    let arrays = if views == 0 { 4 } else { 8 };
    let job = values.saturating_mul(4).saturating_add(arrays * 20 + 16);
    job.saturating_mul(count)
        .saturating_add((arrays + 2) * BLOCK)
}

/// Number of files of a finished database with these `jobs`, `views` views per curve and, if
/// `has_diffuse`, curves under diffuse light; without the few of metadata and coordinates.
#[must_use]
pub fn estimated_files(jobs: &Jobs, views: u64, has_diffuse: bool) -> u64 {
    let arrays = if views == 0 { 4 } else { 8 } * (1 + u64::from(has_diffuse));
    let job = estimated_bytes(jobs, views, 1).saturating_sub((arrays + 2) * BLOCK);
    Packs::new(jobs, job).count() * (arrays + 2)
}

/// Refuses `count` jobs if they do not fit on the disk of the database in `dir`.
pub(super) fn check(dir: &Path, jobs: &Jobs, views: u64, count: u64) -> Result<(), StoreError> {
    // The database may be a link to another disk.
    let root = dir.join(super::DATABASE);
    let disk = if root.exists() { &root } else { dir };
    let available = fs4::available_space(disk).map_err(StoreError::io("measure", disk))?;
    // As many bytes again while the jobs of a pack are moved into the arrays.
    let arrays = match count {
        0 => 0,
        _ => estimated_bytes(jobs, views, count),
    };
    let needed = arrays.saturating_add(arrays.min(packs::MAX_BYTES));
    if needed > available {
        return Err(StoreError::TooLarge {
            path: dir.into(),
            needed,
            available,
        });
    }
    Ok(())
}
