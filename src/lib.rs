//! SPLITSnow: generates and compresses spectral databases of snow.
//!
//! A first-principles Monte Carlo model (Varsa, PhD thesis, University of
//! Waterloo, 2025) traces light from one stochastic ice grain to the next. A
//! batch runner expands a grid of snow parameters into jobs, stores their
//! spectra, and compresses them into a small file that renderers evaluate.
//!
//! # Look up
//!
//! [`Lookup`] interpolates the spectra of a compact file at any point within its axes.
//! [`lookup`] is a separate crate, `splitsnow-lookup`, for programs that need nothing else.
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
//! [`Simulation`] is the virtual spectrophotometer: it simulates the reflectance and
//! transmittance of one sample, with standard errors.
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
//! [`build()`] writes the same bytes as `splitsnow build`, and continues an interrupted build;
//! [`plan()`] estimates its time, size and errors. Both modules have a complete example.
//!
//! ```no_run
//! use splitsnow::{build, config, plan};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let file = config::grid::read("configs/quick.toml".as_ref())?;
//! let plan = splitsnow::plan(&file.grid, &plan::PlanOptions::default())?;
//! println!("{} jobs, {:.0} s", plan.jobs, plan.wall_seconds);
//!
//! let mut options = build::BuildOptions::default();
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
//! use splitsnow::export::{ExportTable, csv};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let database = Database::open("examples/mitsuba/snow.safetensors")?;
//! let text = csv(&ExportTable::of_compact(&database)?);
//! assert!(text.lines().count() > database.curves());
//! # Ok(())
//! # }
//! ```
//!
//! # Modules
//!
//! From the lowest to the highest; a module never uses a higher one:
//!
//! | module | contents |
//! |---|---|
//! | [`simd`], [`math`], [`rng`], [`units`], [`threads`], [`budget`] | instruction sets; vectors, deterministic elementary functions, random streams, unit conversions; number of threads; CPU time limits |
//! | `atomic`, `host` | atomic writing of files; identification of processes |
//! | `accuracy`, `sampling` | root mean squares and summaries of errors; random streams of checks |
//! | [`parameter`], [`lookup`] | the axes of a database; reading of compact files and interpolation |
//! | [`spectrum`], [`optics`], [`colour`], [`sensor`] | tabulated functions of wavelength; refractive indices; Fresnel and Snell; CIELAB; bands of sensors |
//! | [`grain`] | distributions of grain size and shape, interaction of a ray with a grain, mean free distance |
//! | [`transport`] | the snow sample and the walk of a ray through it |
//! | [`table`] | tables of sampled grain events; walks that draw events from them |
//! | [`slab`] | transport between points in homogeneous slabs, solved by discrete ordinates |
//! | [`measurement`] | directional-hemispherical reflectance and transmittance with standard errors; sensors and radii |
//! | [`engine`] | engines for the same physics: `reference`, `spectral`, `tabulated`, `hybrid`, `auto` |
//! | [`comparison`] | comparison of a simulated spectrum with a measured one |
//! | [`grid`], [`scene`], [`config`] | the grid of a database; the requirements of a renderer; sample, grid, scene and study files |
//! | [`store`], [`batch`] | the Zarr store, which is both checkpoint and result; the job runner |
//! | [`simulation`] | the spectrum of a sample in one call |
//! | [`retrieve`] | from measured spectra to the snow |
//! | [`page`] | the messages of the web page |
//! | [`compress`] | SVD and the compact file |
//! | [`build`](mod@build), [`plan`](mod@plan) | from a grid to its database and compact file; estimates of time, size and errors |
//! | [`error_budget`], [`tailor`] | the error budget of look-ups; the smallest file for a scene |
//! | [`verify`] | checks of a finished database |
//! | `lab` | speed and accuracy of the engines, studies of a sample; charts and tables |
//! | [`export`] | export of databases, compact files and their colours to other formats |
//! | `serve` | the web page with the engine of this machine |
//! | `cli` | the command line |
//!
//! Features, all enabled by default: `database` provides the modules from [`store`] to
//! [`export`], except [`simulation`] and [`retrieve`]; `charts` provides `lab` and export to images; `exr`
//! (look-up tables for renderers), `netcdf` and `npz` provide export to these formats; `cli`
//! provides `cli` and the program `splitsnow`; `serve` provides `serve`. Formats and commands of a disabled feature are not available.
#[cfg(feature = "database")]
mod accuracy;
#[cfg(feature = "database")]
mod atomic;
#[cfg(feature = "database")]
pub mod batch;
#[cfg(feature = "database")]
pub mod budget;
#[cfg(feature = "database")]
pub mod build;
#[cfg(feature = "cli")]
pub mod cli;
pub mod comparison;
#[cfg(feature = "database")]
pub mod compress;
pub mod config;
#[cfg(feature = "database")]
pub mod error_budget;
#[cfg(feature = "database")]
pub mod export;
pub mod grid;
#[cfg(feature = "database")]
mod host;
#[cfg(feature = "charts")]
pub mod lab;
pub mod page;
#[cfg(feature = "database")]
pub mod plan;
pub mod retrieve;
#[cfg(feature = "database")]
mod sampling;
pub mod scene;
#[cfg(feature = "serve")]
pub mod serve;
pub mod simulation;
#[cfg(feature = "database")]
pub mod store;
#[cfg(feature = "database")]
pub mod tailor;
pub mod threads;
#[cfg(feature = "database")]
pub mod verify;

#[cfg(feature = "database")]
pub use build::build;
#[cfg(feature = "database")]
pub use plan::plan;
pub use simulation::Simulation;
pub use splitsnow_lookup::{
    self as lookup, Database, Lookup, Parameter, Point, Quantity, parameter,
};
pub use splitsnow_model::{engine, grain, math, measurement, optics, rng, slab, table, transport};
pub use splitsnow_spectra::{colour, elementary, sensor, simd, spectrum, units};

/// Compiles and runs the examples of the README as documentation tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
