//! The inputs of a database in addition to its grid.
use std::collections::BTreeMap;

use sha2::{Digest, Sha256};

use crate::grid::Grid;
use crate::optics::{OpticsError, data_files};

/// The SHA-256 hashes of the data files that the spectra of `grid` depend on, by name. They
/// are part of the identity of a database.
///
/// # Errors
/// [`OpticsError`] if a table of the user cannot be read.
pub fn data_hashes(grid: &Grid) -> Result<BTreeMap<String, String>, OpticsError> {
    let model = &grid.fixed.model;
    let water = grid.is_wet().then_some(&model.water);
    let longest_nm = grid.wavelengths_nm.last().copied().unwrap_or_default();
    let files = data_files(model.ice, water, longest_nm)?;
    let hash = |bytes: &[u8]| -> String {
        let digest = Sha256::digest(bytes);
        digest.iter().map(|byte| format!("{byte:02x}")).collect()
    };
    Ok(files
        .into_iter()
        .map(|file| (format!("data.{}", file.name), hash(&file.bytes)))
        .collect())
}
