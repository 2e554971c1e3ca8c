//! Tests of what users hold: the program, its files, and the readers of them.
//!
//! One binary, so that the library is linked once. `cargo test --release --test pipeline
//! store::` runs one module.
#![allow(clippy::unwrap_used)]
mod against;
mod api;
mod axes;
mod c_header;
mod cli;
mod compact;
mod config;
mod corners;
#[cfg(unix)]
mod crash;
mod docs;
#[cfg(target_os = "linux")]
mod filesystems;
mod growth;
mod illuminants;
mod layers;
mod lookup;
mod optical;
mod pages;
mod simd;
mod simulate;
mod site;
#[cfg(unix)]
mod start;
mod store;
mod substrates;
#[cfg(unix)]
mod tailor;
mod units;
mod verify;

mod common;
mod config_errors;
#[path = "common/quoted.rs"]
#[allow(dead_code)]
mod quoted;
