//! Databases and compact files in the formats of others (docs/formats.md, "Exports").
//!
//! [`Table`] is what a database or a compact file holds, at its nodes; `netcdf`,
//! [`csv()`] and `npz` are the bytes of a file that holds the same, `crtm` that of
//! a table of reflectance for satellite codes. [`spd()`] is one
//! spectrum as renderers read it, [`Observers`] are what sees spectra as colours, and
//! `thicknesses` is a picture of these. Features of the crate decide which there are:
//! `netcdf` has `netcdf` and `crtm`, `npz` has `npz`, `charts` has `thicknesses`.
#[cfg(feature = "netcdf")]
mod crtm;
mod csv;
#[cfg(feature = "netcdf")]
mod netcdf;
#[cfg(feature = "npz")]
mod npz;
mod observers;
mod spd;
#[cfg(feature = "charts")]
mod swatches;
mod table;

use std::path::PathBuf;

use thiserror::Error;

use crate::colour::ColourError;
#[cfg(feature = "charts")]
use crate::lab::report::ReportError;
use crate::lookup::LookupError;
use crate::store::StoreError;

#[cfg(feature = "netcdf")]
pub use crtm::crtm;
pub use csv::csv;
#[cfg(feature = "netcdf")]
pub use netcdf::netcdf;
#[cfg(feature = "npz")]
pub use npz::npz;
pub use observers::{LIGHTS, LUMINANCE, Observers, Sampling};
pub use spd::{RANGE_NM, spd};
#[cfg(feature = "charts")]
pub use swatches::thicknesses;
pub use table::{Layout, Table};

/// Why there is no export.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExportError {
    /// A database that is still being made.
    #[error(
        "{missing} of {jobs} jobs of {} are not done; finish it with `splitsnow build`", path.display()
    )]
    Unfinished {
        /// Jobs not done.
        missing: usize,
        /// All jobs.
        jobs: u64,
        /// The database.
        path: PathBuf,
    },
    /// The database cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The compact file has no spectrum there.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// More than the format holds.
    #[error(
        "the array {name} takes {bytes} bytes, and NetCDF in its classic format holds at most {limit} in one; read the database itself (Zarr), or export to npz"
    )]
    TooLarge {
        /// The array.
        name: String,
        /// Its size.
        bytes: u64,
        /// The most there may be.
        limit: u64,
    },
    /// A table for which the loader of CRTM has no place.
    #[error("no table for CRTM: {reason}")]
    Crtm {
        /// What does not fit.
        reason: String,
    },
    /// A value that no node has.
    #[error(
        "{axis} = {value} is none of the nodes {}", nodes.iter().map(f64::to_string).collect::<Vec<_>>().join(", ")
    )]
    NoNode {
        /// The axis.
        axis: String,
        /// The value.
        value: f64,
        /// Its nodes; none if there is no such axis.
        nodes: Vec<f64>,
    },
    /// Spectra that have no colour.
    #[error("spectra from {first} to {last} nm have no colour here: they must cover 400 to 700 nm")]
    NoColour {
        /// First wavelength.
        first: f64,
        /// Last wavelength.
        last: f64,
    },
    /// The observer cannot be set up.
    #[error(transparent)]
    Colour(#[from] ColourError),
    /// The picture cannot be drawn.
    #[cfg(feature = "charts")]
    #[error(transparent)]
    Report(#[from] ReportError),
    /// A library refused what should be valid.
    #[error("cannot make the {format} file: {reason}")]
    Encoding {
        /// The format.
        format: &'static str,
        /// What the library said.
        reason: String,
    },
}

impl ExportError {
    /// For `map_err` on what a library does for `format`.
    fn encoding<E: std::fmt::Debug>(format: &'static str) -> impl Fn(E) -> Self {
        move |error| Self::Encoding {
            format,
            reason: format!("{error:?}"),
        }
    }
}
