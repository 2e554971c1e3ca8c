//! Engines: one physics, several schedulers.
use std::sync::atomic::{AtomicBool, AtomicU64};

use thiserror::Error;

use crate::measurement::Spectrum;
use crate::optics::OpticsError;
use crate::transport::{Illumination, Model, Snow};

/// Which engine runs a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Engine {
    /// MODEL section 2 to the letter: one wavelength at a time, analog absorption.
    Reference,
    /// One walk serves all wavelengths and thicknesses.
    Spectral,
}

/// What an engine is asked for: all thicknesses of one snow under one light.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// The snow.
    pub snow: &'a Snow,
    /// Slab thicknesses, m, strictly increasing.
    pub thicknesses_m: &'a [f64],
    /// The light.
    pub illumination: Illumination,
    /// Wavelengths, nm, strictly increasing.
    pub wavelengths_nm: &'a [f64],
    /// Choices within the model.
    pub model: &'a Model,
    /// Walks per thickness: per wavelength in `reference`, in all in `spectral`.
    pub rays: u64,
    /// Seed of the whole database or measurement.
    pub seed: u64,
    /// Which cell of a database this is (0 for a single measurement).
    pub cell: u64,
}

/// How a running engine talks to its caller.
#[derive(Debug, Clone, Copy)]
pub struct Control<'a> {
    /// Use all threads of the current rayon pool for this one request.
    pub parallel: bool,
    /// Stop soon with [`EngineError::Cancelled`] once this is set.
    pub cancel: &'a AtomicBool,
    /// Incremented by the rays finished.
    pub rays_done: &'a AtomicU64,
}

/// Why an engine gave no spectrum.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum EngineError {
    /// The caller asked it to stop.
    #[error("cancelled")]
    Cancelled,
    /// Grains do not fit between the slab's planes.
    #[error(
        "the slab of {thickness_m} m is too thin for grains up to {size_max_m} m long: {rejections} grains in a row did not fit; use a thickness of at least 10 grain lengths"
    )]
    SlabTooThin {
        /// Slab thickness, m.
        thickness_m: f64,
        /// Longest grain, m.
        size_max_m: f64,
        /// Rejections in a row.
        rejections: u32,
    },
    /// An optical table does not cover a wavelength, or cannot be read.
    #[error(transparent)]
    Optics(#[from] OpticsError),
}

impl Engine {
    /// The name used on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Reference => "reference",
            Self::Spectral => "spectral",
        }
    }

    /// All engines.
    pub const ALL: [Self; 2] = [Self::Reference, Self::Spectral];

    /// Whether one job of this engine serves all thicknesses at once.
    #[must_use]
    pub fn shares_thicknesses(self) -> bool {
        matches!(self, Self::Spectral)
    }

    /// Reflectance and transmittance per thickness of `request`.
    ///
    /// The result is a function of the request alone: never of threads,
    /// schedule or `control`.
    ///
    /// # Errors
    /// See [`EngineError`].
    pub fn run(self, request: &Request, control: &Control) -> Result<Vec<Spectrum>, EngineError> {
        let _ = (request, control);
        Err(EngineError::Cancelled)
    }
}
