//! SPLITSnow: generates and compresses spectral databases of snow.
//!
//! A first-principles Monte Carlo model (Varsa, PhD thesis, University of
//! Waterloo, 2025) walks light from one stochastic ice grain to the next; a
//! batch runner expands a grid of snow parameters into jobs, stores their
//! spectra, and compresses them into a small file that renderers evaluate.
//!
//! # Look up
//!
//! A compact file answers anywhere in its box; [`lookup`] is a crate of its own,
//! `splitsnow-lookup`, for programs that need no more.
//!
//! ```
//! use splitsnow::{Database, Lookup, Parameter, Point, Quantity};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // or the directory of a build, such as out/quick
//! let database = Database::open("examples/mitsuba/snow.safetensors")?;
//! let lookup = Lookup::new(&database, Quantity::Transmittance)?;
//! let mut spectrum = vec![0.0; lookup.wavelengths()];
//! let snow = Point::from([
//!     (Parameter::Facetness, 0.3),
//!     (Parameter::GrainSize, 300.0),
//!     (Parameter::Density, 275.0),
//!     (Parameter::Thickness, 7.5),
//!     (Parameter::Incidence, 33.0),
//! ]);
//! lookup.spectrum(snow, &mut spectrum)?;
//! assert!(spectrum.iter().all(|share| (0.0..1.0).contains(share)));
//! # Ok(())
//! # }
//! ```
//!
//! # Simulate
//!
//! [`Simulation`] is the virtual spectrophotometer: reflectance and transmittance of one
//! sample, with standard errors.
//!
//! ```
//! use splitsnow::{Simulation, config};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let sample = config::sample::parse(
//!     "sample.toml",
//!     r#"
//!     version = 1
//!     [illumination]
//!     incidence_angle_deg = 30
//!     [wavelengths]
//!     values_nm = [450, 550, 650]
//!     [[layer]]
//!     thickness_cm = 5
//!     density_kg_m3 = 275
//!     [[layer.grain]]
//!     size_um = { min = 300, max = 750 }
//!     facetness = { min = 0.2, max = 0.4, mean = 0.3, sd = 0.072 }
//!     "#,
//! )?;
//! let spectrum = Simulation::of(&sample).rays(64).run()?;
//! let (r, t) = (spectrum.reflectance[1], spectrum.transmittance[1]);
//! assert!(r.value > t.value && r.se > 0.0);
//! # Ok(())
//! # }
//! ```
//!
//! # Build
//!
//! [`build()`] does what `splitsnow build` does, to the byte, and goes on where an earlier
//! one stopped; [`plan()`] says what it will take. Both modules have an example that runs.
//!
//! ```no_run
//! use splitsnow::{build, config, plan};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let file = config::grid::read("configs/quick.toml".as_ref())?;
//! let plan = splitsnow::plan(&file.grid, &plan::Options::default())?;
//! println!("{} jobs, {:.0} s", plan.jobs, plan.wall_seconds);
//!
//! let mut options = build::Options::default();
//! options.viewing = file.viewing;
//! let report = splitsnow::build(&file.grid, "out/quick", &options)?;
//! println!("{} of {} jobs run now", report.jobs_run, report.jobs);
//! # Ok(())
//! # }
//! ```
//!
//! # Export
//!
//! ```
//! use splitsnow::Database;
//! use splitsnow::export::{Table, csv};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let database = Database::open("examples/mitsuba/snow.safetensors")?;
//! let text = csv(&Table::of_compact(&database)?);
//! assert!(text.lines().count() > database.curves());
//! # Ok(())
//! # }
//! ```
//!
//! # Modules
//!
//! Lower ones first; a lower one never uses a higher one:
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
//! | [`engine`] | schedulers of the same physics: `reference`, `spectral`, `tabulated`, `hybrid`, `auto` |
//! | [`comparison`] | a simulated spectrum against a measured one |
//! | [`grid`], [`scene`], [`config`] | the axes of a database; what a renderer asks for; sample, grid, scene and study files |
//! | [`store`], [`batch`] | the Zarr store that is checkpoint and result; the job runner |
//! | [`simulation`] | the spectrum of a sample as one call |
//! | [`compress`] | SVD and the compact file |
//! | [`build`](mod@build), [`plan`](mod@plan) | from a grid to its database and compact file; what that will take |
//! | [`error_budget`], [`tailor`] | how far its answers are off; the smallest file for a scene |
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
#[cfg(feature = "cli")]
pub mod cli;
pub mod comparison;
pub mod compress;
pub mod config;
pub mod error_budget;
pub mod export;
pub mod grid;
mod host;
#[cfg(feature = "charts")]
pub mod lab;
pub mod plan;
pub mod scene;
pub mod simulation;
pub mod store;
pub mod tailor;
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

/// The examples of the README are compiled as those here are.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
