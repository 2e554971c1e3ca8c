//! Exports of databases and compact files to other formats (docs/formats.md, "Exports").
//!
//! [`ExportTable`] holds the spectra of a database or a compact file at its nodes. `netcdf`,
//! [`csv()`] and `npz` convert a table to the bytes of a file, also of averages over the bands of a sensor
//! ([`ExportTable::over_bands`]); `crtm` writes a table of
//! reflectance for the satellite code CRTM. [`spd()`] writes one spectrum in the format of
//! renderers. `Lut` is a table of transmitted colours as an image, with the look-up in shading
//! languages. [`Observers`] compute the colours of spectra, and `thicknesses` draws them as
//! patches. Some functions need a feature of the crate: `netcdf` (`netcdf` and `crtm`), `npz`
//! (`npz`), `exr` (`Lut`), `charts` (`thicknesses`).
mod bands;
#[cfg(feature = "netcdf")]
mod crtm;
mod csv;
#[cfg(feature = "exr")]
mod lut;
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
use crate::sensor::SensorError;
use crate::store::StoreError;

#[cfg(feature = "netcdf")]
pub use crtm::crtm;
pub use csv::csv;
#[cfg(feature = "exr")]
pub use lut::{Lut, LutCertificate, LutClipping, LutError, LutOptions, Primaries};
#[cfg(feature = "netcdf")]
pub use netcdf::netcdf;
#[cfg(feature = "npz")]
pub use npz::npz;
pub use observers::{LIGHTS, LUMINANCE, Observers, Sampling};
pub use spd::{RANGE_NM, spd};
#[cfg(feature = "charts")]
pub use swatches::thicknesses;
pub use table::{ExportLayout, ExportTable, ExportVariable};

/// The reason why an export failed.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The database is not complete.
    #[error(
        "{missing} of {jobs} jobs of {} are not done; finish it with `splitsnow build`", path.display()
    )]
    Unfinished {
        /// Number of jobs that are not done.
        missing: usize,
        /// Number of all jobs.
        jobs: u64,
        /// Path of the database.
        path: PathBuf,
    },
    /// The database has no views.
    #[error(
        "{} has no views; build it from a grid file with axes.view_deg and axes.relative_azimuth_deg", path.display()
    )]
    NoViews {
        /// Path of the database.
        path: PathBuf,
    },
    /// The database cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The look-up in the compact file failed.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// An array exceeds the limit of the format.
    #[error(
        "the array {name} takes {bytes} bytes, and NetCDF in its classic format holds at most {limit} in one; read the database itself (Zarr), or export to npz"
    )]
    TooLarge {
        /// Name of the array.
        name: String,
        /// Its size, bytes.
        bytes: u64,
        /// The largest size allowed, bytes.
        limit: u64,
    },
    /// The table does not fit the CRTM loader.
    #[error("cannot make a table for CRTM: {reason}")]
    Crtm {
        /// What does not fit, and what to do about it.
        reason: String,
    },
    /// A look-up table for renderers cannot be made.
    #[error("cannot make a look-up table: {0}")]
    Lut(String),
    /// A value is not a node of its axis.
    #[error(
        "{axis} = {value} is not a node; give one of {}", nodes.iter().map(f64::to_string).collect::<Vec<_>>().join(", ")
    )]
    NoNode {
        /// Name of the axis.
        axis: String,
        /// The value requested.
        value: f64,
        /// Nodes of the axis; empty if the table has no such axis.
        nodes: Vec<f64>,
    },
    /// The wavelengths do not determine a colour.
    #[error(
        "spectra from {first} to {last} nm have no colour: they must cover 400 to 700 nm; build a database with these wavelengths"
    )]
    NoColour {
        /// First wavelength, nm.
        first: f64,
        /// Last wavelength, nm.
        last: f64,
    },
    /// The spectra cannot be averaged over the bands of a sensor.
    #[error(transparent)]
    Sensor(Box<SensorError>),
    /// Two bands cannot share a place on an axis.
    #[error(
        "{sensor}: the bands {} and {} have the same mean wavelength, {centre_nm} nm; choose bands without one of them: {sensor}:BAND,BAND", bands[0], bands[1]
    )]
    SameCentre {
        /// Name of the sensor.
        sensor: String,
        /// Names of the two bands.
        bands: [String; 2],
        /// Their mean wavelength, nm.
        centre_nm: f64,
    },
    /// The colorimeter cannot be set up.
    #[error(transparent)]
    Colour(#[from] ColourError),
    /// The picture cannot be drawn.
    #[cfg(feature = "charts")]
    #[error(transparent)]
    Report(#[from] ReportError),
    /// A library for the format failed.
    #[error("cannot make the {format} file: {reason}; choose another --format")]
    Encoding {
        /// Name of the format.
        format: &'static str,
        /// Error of the library.
        reason: String,
    },
}

impl ExportError {
    /// Converts an error of the library for `format`; for use in `map_err`.
    fn encoding<E: std::fmt::Debug>(format: &'static str) -> impl Fn(E) -> Self {
        move |error| Self::Encoding {
            format,
            reason: format!("{error:?}"),
        }
    }
}
