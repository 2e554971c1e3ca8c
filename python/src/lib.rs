//! The compiled part of the Python package `splitsnow`. The Python part, with the
//! documentation for users, is in `python/splitsnow`.
mod bands;
mod cache;
mod colour;
mod database;
mod directions;
mod points;
mod pool;
mod retrieval;
mod simulation;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Returns the instruction set in use: that of `SPLITSNOW_SIMD`, or else the best one that
/// this processor supports.
#[pyfunction]
fn simd() -> PyResult<&'static str> {
    let level = splitsnow::simd::requested();
    let level = level.map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(level.name())
}

/// The compiled part of `splitsnow`.
#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::bands::bands;
    #[pymodule_export]
    use crate::colour::{colours, illuminant};
    #[pymodule_export]
    use crate::database::Database;
    #[pymodule_export]
    use crate::directions::Directions;
    #[pymodule_export]
    use crate::retrieval::retrieve;
    #[pymodule_export]
    use crate::simulation::{profile, simulate};

    #[pymodule_export]
    use crate::database::parameters;

    #[pymodule_export]
    use crate::simd;

    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
}
