//! A scene: which snow a renderer will ask for, and how good the answers must be.
use crate::colour::Viewing;
use crate::grid::{Fixed, Spread};
use crate::measurement::Quantity;
use crate::parameter::Region;

/// What is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Largest colour difference allowed, of everything between a converged
    /// simulation and the spectrum a renderer gets.
    pub max_delta_e: f64,
    /// Quantities asked for, each once.
    pub quantities: Vec<Quantity>,
    /// How colours are compared.
    pub viewing: Viewing,
    /// Largest compact file allowed, bytes.
    pub max_bytes: Option<u64>,
    /// Longest time allowed to make it, seconds.
    pub max_seconds: Option<f64>,
    /// A box of each snow, at least one; all have the same parameters, and the same
    /// thicknesses and angles.
    pub regions: Vec<Region>,
    /// Widths of the laws around the means of a snow.
    pub spread: Spread,
    /// Wavelengths, nm, strictly increasing; their spectra have a colour.
    pub wavelengths_nm: Vec<f64>,
    /// What all snows have in common.
    pub fixed: Fixed,
    /// Seed of the random streams.
    pub seed: u64,
}
