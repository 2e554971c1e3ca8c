//! SPLITSnow: generates and compresses spectral databases of snow.
//!
//! A first-principles Monte Carlo model (Varsa, PhD thesis, University of
//! Waterloo, 2025) walks light from one stochastic ice grain to the next; a
//! batch runner expands a grid of snow parameters into jobs, stores their
//! spectra, and compresses them into a small file that renderers evaluate.
//!
//! Modules, lower ones first; a lower one never uses a higher one:
//!
//! | module | what lives there |
//! |---|---|
//! | [`math`], [`rng`], [`units`], [`threads`], [`budget`] | vectors, deterministic elementary functions, random streams, conversions; how many threads, and for how long |
//! | `atomic`, `host` | files that are written as a whole; which process has a file |
//! | [`parameter`], [`lookup`] | the axes of a database; reading its compact file and interpolating in it |
//! | [`spectrum`], [`optics`], [`colour`] | tabulated functions of wavelength; refractive indices; Fresnel and Snell; CIELAB |
//! | [`grain`] | laws of grain size and shape, the event on one grain, mean free distance |
//! | [`transport`] | the snow sample and the walk of one ray through it |
//! | [`table`] | outcomes of grain events drawn once; walks that take them from there |
//! | [`slab`] | transport between points in homogeneous slabs, solved by discrete ordinates |
//! | [`measurement`] | directional-hemispherical reflectance and transmittance with standard errors; sensors and radii |
//! | [`engine`] | schedulers of the same physics: `reference`, `spectral`, `tabulated`, `doubling`, `auto` |
//! | [`comparison`] | a simulated spectrum against a measured one |
//! | [`grid`], [`scene`], [`config`] | the axes of a database; what a renderer asks for; sample, grid, scene and study files |
//! | [`store`], [`batch`] | the Zarr store that is checkpoint and result; the job runner |
//! | [`simulation`] | the spectrum of a sample as one call |
//! | [`compress`] | SVD and the compact file |
//! | [`build`](mod@build), [`plan`](mod@plan) | from a grid to its database and compact file; what that will take |
//! | [`certificate`], [`fit`] | how far its answers are off; the smallest file for a scene |
//! | [`verify`] | re-checking a finished database |
//! | `lab` | speed against accuracy of the engines, studies of a sample; charts and tables |
//! | [`export`] | databases, compact files and their colours in the formats of others |
//! | `cli` | the command line |
//!
//! Features, all of them default: `charts` has `lab`, and exports as pictures; `netcdf` and
//! `npz` have exports in these formats; `cli` has `cli`, and the program `splitsnow`. A
//! format or command of a feature that is left out is not offered.
mod atomic;
pub mod batch;
pub mod budget;
pub mod build;
pub mod certificate;
#[cfg(feature = "cli")]
pub mod cli;
pub mod comparison;
pub mod compress;
pub mod config;
pub mod export;
pub mod fit;
pub mod grid;
mod host;
#[cfg(feature = "charts")]
pub mod lab;
pub mod plan;
pub mod scene;
pub mod simulation;
pub mod store;
pub mod threads;
pub mod verify;

pub use build::build;
pub use plan::plan;
pub use simulation::Simulation;
pub use splitsnow_lookup::{
    self as lookup, Database, Lookup, Parameter, Point, Quantity, parameter,
};
pub use splitsnow_model::{engine, grain, math, measurement, optics, rng, slab, table, transport};
pub use splitsnow_spectra::{colour, elementary, spectrum, units};
