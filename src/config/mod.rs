//! Config files: strict TOML, refused with file, line, key, value and what is
//! allowed.
//!
//! The private modules `keys`, `scene_keys` and `study_keys` list every key with its type, limits and meaning;
//! the JSON Schemas are generated from it, and each document is checked against
//! its schema before it is read, so that an editor and the program refuse the
//! same. Limits that involve several keys follow in [`sample`], [`grid`],
//! [`scene`] and [`study`].
//!
//! Parsing never panics, and its time and memory are bounded by the length of
//! the text (at most 1 MiB).
use std::path::Path;

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

/// The directory that paths inside the config file `name` are relative to.
fn directory_of(name: &str) -> &Path {
    Path::new(name).parent().unwrap_or(Path::new(""))
}
