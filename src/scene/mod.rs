//! A scene: which snow a renderer will ask for, and how good the answers must be.
use crate::colour::Viewing;
use crate::grid::{ExtraAxis, Fixed, Spread};
use crate::measurement::Quantity;

/// All values between two ends, both included; a single one where they are equal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Least value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
}

/// One kind of snow, or a box of kinds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneSnow {
    /// Mean facetness, within [0, 1].
    pub facetness: Range,
    /// Mean grain size, um.
    pub grain_size_um: Range,
    /// Dry density, kg/m3.
    pub density_kg_m3: Range,
    /// On the axes beyond the five, in the order of [`ExtraAxis::ALL`]; `None`: as
    /// fixed. All snows of a scene have the same ones.
    pub extra: [Option<Range>; 5],
}

impl SceneSnow {
    /// The axes beyond the five that it gives.
    pub fn beyond(&self) -> impl Iterator<Item = (ExtraAxis, Range)> {
        let all = ExtraAxis::ALL.into_iter().zip(self.extra);
        all.filter_map(|(axis, range)| Some((axis, range?)))
    }
}

/// What is asked for: every snow, at every thickness and angle.
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
    /// Slab thickness, cm.
    pub thickness_cm: Range,
    /// Polar angle of incidence, degrees from the normal, within [0, 90).
    pub angle_deg: Range,
    /// The snows, at least one.
    pub snow: Vec<SceneSnow>,
    /// Widths of the laws around the means of a snow.
    pub spread: Spread,
    /// Wavelengths, nm, strictly increasing; their spectra have a colour.
    pub wavelengths_nm: Vec<f64>,
    /// What all snows have in common.
    pub fixed: Fixed,
    /// Seed of the random streams.
    pub seed: u64,
}
