//! From measured spectra to the snow: which snow of a compact file has this spectrum, and how
//! well the spectrum determines it (docs/retrieval.md).
//!
//! A [`Setup`] joins measured spectra, a compact file, what is known of the snow and the errors
//! of the measurement. [`Setup::retrieve`] gives a [`Retrieval`]: the most probable snow, credible
//! intervals, and what the spectra determine at all. [`Cube`] does the same for thousands of
//! spectra, with the approximation of Laplace.
//!
//! The numbers are computed by the crate `splitsnow-retrieval`; this module knows about grains,
//! files and words.
mod bands;
mod cube;
mod default_box;
mod exact;
mod grains;
mod knowledge;
mod output;
mod report;
mod residuals;
mod setup;
mod uncertainty;

use thiserror::Error;

use crate::engine::EngineError;
use crate::lookup::LookupError;

pub use bands::MeasuredBands;
pub use cube::{Cube, CubeIntervals, CubeRequest, CubeResult, SpectrumRow};
pub use default_box::{BoxRequest, DefaultBox};
pub use exact::{ExactCheck, ExactOptions};
pub use grains::FileGrains;
pub use knowledge::{FreeParameter, KnownValue, Named};
pub use output::short;
pub use report::{Determined, GoodnessOfFit, Pair, PlaceScale, Retrieval, RetrievedQuantity};
pub use residuals::{BandResiduals, FittedSpectrum, FittedValue};
pub use setup::{MeasuredInput, Setup, SetupRequest};
pub use splitsnow_retrieval::{
    CredibleInterval, NoiseModel, Optimum, Posterior, PosteriorMethod, Prior,
};
pub use uncertainty::EmulatorError;

/// The reason why nothing can be retrieved, and what to do about it.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RetrieveError {
    /// A wrong statement about a parameter.
    #[error("{0}")]
    Knowledge(String),
    /// The compact file does not state which grains it holds.
    #[error(
        "the compact file does not state its grid, which {0} needs; give a file that `splitsnow build` wrote"
    )]
    NoGrains(&'static str),
    /// A look-up failed.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// The errors of the measurement do not give a covariance.
    #[error(
        "the stated errors leave values without any error of their own; give an error per value above 0"
    )]
    Noise,
    /// The model has no spectrum anywhere in the ranges.
    #[error(
        "the compact file has no spectrum in these ranges, because grains do not fit into the slab; use thicker snow or smaller grains"
    )]
    NoSpectrum,
    /// The engine failed at the optimum.
    #[error("the simulation at the optimum failed: {0}")]
    Engine(#[from] EngineError),
    /// The snow at the optimum cannot be simulated.
    #[error(transparent)]
    Grid(#[from] crate::grid::GridError),
}
