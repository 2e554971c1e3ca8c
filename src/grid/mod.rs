//! The grid of a spectral database: its axes, its cells and its jobs
//! (MODEL section 8).
use crate::engine::Engine;
use crate::grain::TruncatedNormal;
use crate::transport::Model;

/// The five axes, each strictly increasing and not empty. Storage order,
/// slowest first: facetness, grain size, density, thickness, angle.
#[derive(Debug, Clone, PartialEq)]
pub struct Axes {
    /// Mean facetness, [0, 1].
    pub facetness: Vec<f64>,
    /// Mean grain size, um.
    pub grain_size_um: Vec<f64>,
    /// Dry density, kg/m3.
    pub density_kg_m3: Vec<f64>,
    /// Slab thickness, cm.
    pub thickness_cm: Vec<f64>,
    /// Polar angle of incidence, degrees from the normal, [0, 90).
    pub angle_deg: Vec<f64>,
}

/// Widths of the laws around an axis value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Facetness is cut to mean -+ this (and to [0, 1]).
    pub facetness_half_width: f64,
    /// Standard deviation of facetness.
    pub facetness_sd: f64,
    /// Grain size is uniform in mean -+ this, um.
    pub grain_size_half_width_um: f64,
}

/// What every cell of the grid has in common.
#[derive(Debug, Clone, PartialEq)]
pub struct Fixed {
    /// Sphericity law of the grains.
    pub sphericity: TruncatedNormal,
    /// Temperature, Celsius.
    pub temperature_c: f64,
    /// Water saturation of the pore space.
    pub water_saturation: f64,
    /// Choices within the model.
    pub model: Model,
}

/// How the jobs are run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Run {
    /// Which engine.
    pub engine: Engine,
    /// Seed of the database.
    pub seed: u64,
    /// Walks per curve (see [`crate::engine::Request::rays`]).
    pub rays: u64,
}

/// Bounds that choose the number of components.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compression {
    /// Largest Delta-E*ab allowed on any curve (default 2.3).
    pub max_delta_e: f64,
    /// Largest RMSE allowed on any curve.
    pub max_rmse: Option<f64>,
}

/// A whole database, as a config describes it.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// The five axes.
    pub axes: Axes,
    /// Widths of the laws around an axis value.
    pub spread: Spread,
    /// Wavelengths, nm, strictly increasing.
    pub wavelengths_nm: Vec<f64>,
    /// What all cells share.
    pub fixed: Fixed,
    /// Engine, seed, rays.
    pub run: Run,
    /// Bounds of the compression.
    pub compression: Compression,
}
