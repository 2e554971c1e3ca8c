//! Tests of the physical model, its engines, and the published results.
//!
//! All tests are in one binary, so that the library is linked only once. `cargo test --release
//! --test physics engines::` runs one module.
#![allow(clippy::unwrap_used, clippy::print_stdout)]
mod engines;
mod errors;
mod golden;
mod goniometer;
mod half_space;
mod physics_laws;
mod published;
mod slab;
mod stability;
mod statistics;
mod studies;
mod tradeoff;

#[path = "common/naive.rs"]
mod naive;
#[path = "common/quoted.rs"]
#[allow(dead_code)]
mod quoted;
#[path = "common/snow.rs"]
#[allow(dead_code)]
mod snow;
