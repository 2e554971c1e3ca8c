//! Config files: strict TOML. Errors name file, line, key, value and the allowed range.
//!
//! The private modules `keys`, `axis_keys`, `scene_keys` and `study_keys` list every key
//! with its type, limits and description. The JSON Schemas are generated from them, and
//! each document is checked against its schema before it is read, so that an editor and
//! the program report the same errors. Limits that involve several keys are checked in
//! [`sample`], [`grid`], [`scene`] and [`study`].
//!
//! Parsing never panics, and its time and memory are bounded by the length of the text
//! (at most 1 MiB).
use std::path::Path;

pub(crate) mod absorber;
mod axis_keys;
mod canonical;
mod change;
mod check;
mod document;
mod error;
mod former;
pub mod grid;
mod keys;
mod layer;
pub mod sample;
pub mod scene;
mod scene_keys;
pub mod schema;
mod shared;
mod snow;
pub mod study;
mod study_keys;
pub mod water;

pub use error::{ConfigError, Problem};

/// The directory of the config file `name`: paths in the file are relative to it.
fn directory_of(name: &str) -> &Path {
    Path::new(name).parent().unwrap_or(Path::new(""))
}
