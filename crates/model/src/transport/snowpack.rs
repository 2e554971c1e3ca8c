//! A snowpack: layers of snow on a substrate.
use super::{Model, Snow};
#[cfg(doc)]
use crate::optics::IMPURITY_NM;
use splitsnow_spectra::spectrum::Table;

/// Different Angstrom exponents that the impurities of one snowpack may have.
pub const EXPONENTS: usize = 4;

/// A layer of known thickness.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// Its snow.
    pub snow: Snow,
    /// Its thickness, m.
    pub thickness_m: f64,
}

/// What lies below a snowpack: a Lambertian reflector.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Substrate {
    /// Reflects nothing.
    #[default]
    Black,
    /// Reflects this share at all wavelengths, [0, 1].
    Grey(f64),
    /// Reflects what the first column says over wavelength in nm.
    Spectrum {
        /// The table.
        table: Table,
    },
}

impl Substrate {
    /// Reflectance; `None` where its table does not reach.
    #[must_use]
    pub fn reflectance(&self, wavelength_nm: f64) -> Option<f64> {
        match self {
            Self::Black => Some(0.0),
            Self::Grey(reflectance) => Some(*reflectance),
            Self::Spectrum { table, .. } => table.linear(0, wavelength_nm),
        }
    }
}

/// How the layers of a snowpack are joined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Joining {
    /// Walks go on from layer to layer; only the outer planes reject grains.
    #[default]
    Continuous,
    /// Each layer is a slab of its own over a Lambertian substrate that has the
    /// reflectance of all below it at normal incidence (Varsa 2025, section 4.4).
    Cascade,
}

impl Joining {
    /// The name used in configs and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Continuous => "continuous",
            Self::Cascade => "cascade",
        }
    }
}

/// What impurities of each of the `exponents` absorb in the ice and in the pores
/// of `snow`, 1/m at [`IMPURITY_NM`].
#[must_use]
pub fn impurities_per_m(snow: &Snow, model: &Model, exponents: &[f64]) -> [[f64; EXPONENTS]; 2] {
    let mut sums = [[0.0; EXPONENTS]; 2];
    for impurity in snow.impurities(model) {
        let same = |exponent: &f64| *exponent == impurity.angstrom_exponent;
        let place = exponents.iter().take(EXPONENTS).position(same);
        if let Some(i) = place {
            sums[0][i] += impurity.ice_per_m;
            sums[1][i] += impurity.pores_per_m;
        }
    }
    sums
}

/// A snowpack but for its thickness, which is that of all layers together: the
/// surface layer is what the others leave.
#[derive(Debug, Clone, PartialEq)]
pub struct Snowpack {
    /// The layer that light falls on.
    pub surface: Snow,
    /// The layers under it, downward.
    pub below: Vec<Layer>,
    /// What they lie on.
    pub substrate: Substrate,
}

impl From<Snow> for Snowpack {
    /// A single layer on black substrate.
    fn from(surface: Snow) -> Self {
        Self {
            surface,
            below: Vec::new(),
            substrate: Substrate::Black,
        }
    }
}

impl Snowpack {
    /// The snows from the surface down.
    pub fn snows(&self) -> impl Iterator<Item = &Snow> {
        let below = self.below.iter().map(|layer| &layer.snow);
        std::iter::once(&self.surface).chain(below)
    }

    /// Thickness of all layers but the surface, m.
    #[must_use]
    pub fn below_m(&self) -> f64 {
        self.below.iter().map(|layer| layer.thickness_m).sum()
    }

    /// The layers from the surface down, of a snowpack `thickness_m` thick.
    #[must_use]
    pub fn layers(&self, thickness_m: f64) -> Vec<Layer> {
        let surface = Layer {
            snow: self.surface.clone(),
            thickness_m: thickness_m - self.below_m(),
        };
        std::iter::once(surface)
            .chain(self.below.iter().cloned())
            .collect()
    }

    /// A snowpack of `layers` (from the surface down, at least one) on `substrate`, and
    /// its thickness in m.
    #[must_use]
    pub fn of(layers: &[Layer], substrate: Substrate) -> Option<(Self, f64)> {
        let (surface, below) = layers.split_first()?;
        let thickness_m = layers.iter().map(|layer| layer.thickness_m).sum();
        let snowpack = Self {
            surface: surface.snow.clone(),
            below: below.to_vec(),
            substrate,
        };
        Some((snowpack, thickness_m))
    }

    /// Whether there is water in any layer.
    #[must_use]
    pub fn is_wet(&self) -> bool {
        self.snows().any(|snow| snow.water_saturation > 0.0)
    }

    /// Length of the largest grain, m.
    #[must_use]
    pub fn longest_grain_m(&self) -> f64 {
        self.snows().map(|s| s.sizes_m()[1]).fold(0.0, f64::max)
    }

    /// The different Angstrom exponents of the carbon in it, increasing.
    #[must_use]
    pub fn exponents(&self) -> Vec<f64> {
        let all = self.snows().flat_map(Snow::carbon);
        let mut exponents: Vec<f64> = all.map(|carbon| carbon.angstrom_exponent).collect();
        exponents.sort_by(f64::total_cmp);
        exponents.dedup();
        exponents
    }
}
