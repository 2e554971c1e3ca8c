//! A scene: the snow that a renderer needs, and the accuracy that it needs.
use crate::colour::Viewing;
use crate::grid::{Fixed, Spread};
use crate::measurement::Quantity;
use crate::parameter::Region;

/// The requirements of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Largest allowed colour difference between a converged simulation and the spectrum
    /// that a renderer looks up.
    pub max_delta_e: f64,
    /// Quantities that the renderer needs, without duplicates.
    pub quantities: Vec<Quantity>,
    /// How colours are compared.
    pub viewing: Viewing,
    /// Largest allowed size of the compact file, bytes; `None` if unlimited.
    pub max_bytes: Option<u64>,
    /// Longest allowed time for making the compact file, seconds; `None` if unlimited.
    pub max_seconds: Option<f64>,
    /// A box in parameter space for each kind of snow, at least one. All have the same
    /// parameters, and the same thicknesses and incidence angles.
    pub regions: Vec<Region>,
    /// Widths of the distributions around the means of a kind of snow.
    pub spread: Spread,
    /// Wavelengths, nm, strictly increasing; they cover enough of the visible range for
    /// colours to be computed.
    pub wavelengths_nm: Vec<f64>,
    /// Properties that all kinds of snow share.
    pub fixed: Fixed,
    /// Seed of the random streams.
    pub seed: u64,
}
