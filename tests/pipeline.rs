//! Tests of the program, its files, and the readers of these files.
//!
//! All tests are in one binary, so that the library is linked only once. `cargo test --release
//! --test pipeline store::` runs one module.
#![allow(clippy::unwrap_used)]
mod absorbers;
mod against;
mod api;
mod axes;
mod bands;
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
mod install;
mod layers;
mod lookup;
mod lut;
mod optical;
mod page;
mod pages;
mod particles;
mod retrieve;
mod scale;
mod serve;
mod simd;
mod simulate;
mod site;
mod slopes;
#[cfg(unix)]
mod start;
#[cfg(unix)]
mod status;
mod store;
mod substrates;
mod tables;
#[cfg(unix)]
mod tailor;
mod units;
mod verify;
mod views;

mod common;
mod config_errors;
#[path = "common/quoted.rs"]
#[allow(dead_code)]
mod quoted;
