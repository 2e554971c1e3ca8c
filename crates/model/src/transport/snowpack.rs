//! A snowpack: layers of snow on a substrate.
use super::Snow;
use splitsnow_spectra::spectrum::Table;

/// A layer of given thickness.
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
    /// Reflectance 0.
    #[default]
    Black,
    /// The same reflectance at all wavelengths, in [0, 1].
    Grey(f64),
    /// Reflectance from the first column of a table, over wavelength in nm.
    Spectrum {
        /// Wavelengths and reflectances.
        table: Table,
    },
}

impl Substrate {
    /// Reflectance; `None` outside the range of the table.
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
    /// A walk continues from layer to layer; only the outer planes reject grains.
    #[default]
    Continuous,
    /// Each layer is a separate slab over a Lambertian substrate whose reflectance is
    /// that of everything below it at normal incidence (Varsa 2025, section 4.4).
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

/// A snowpack without its total thickness. The surface layer fills what the other
/// layers leave of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Snowpack {
    /// The surface layer.
    pub surface: Snow,
    /// The layers below it, from top to bottom.
    pub below: Vec<Layer>,
    /// The substrate.
    pub substrate: Substrate,
}

impl From<Snow> for Snowpack {
    /// A single layer over a black substrate.
    fn from(surface: Snow) -> Self {
        Self {
            surface,
            below: Vec::new(),
            substrate: Substrate::Black,
        }
    }
}

impl Snowpack {
    /// The snow of each layer, from the surface down.
    pub fn snows(&self) -> impl Iterator<Item = &Snow> {
        let below = self.below.iter().map(|layer| &layer.snow);
        std::iter::once(&self.surface).chain(below)
    }

    /// Total thickness of all layers except the surface layer, m.
    #[must_use]
    pub fn below_m(&self) -> f64 {
        self.below.iter().map(|layer| layer.thickness_m).sum()
    }

    /// The layers, from the surface down, of a snowpack `thickness_m` thick.
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
    /// its thickness in m. `None` without layers.
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

    /// Whether any layer contains water.
    #[must_use]
    pub fn is_wet(&self) -> bool {
        self.snows().any(|snow| snow.water_saturation > 0.0)
    }

    /// Length of the largest grain, m.
    #[must_use]
    pub fn longest_grain_m(&self) -> f64 {
        self.snows().map(|s| s.sizes_m()[1]).fold(0.0, f64::max)
    }
}
