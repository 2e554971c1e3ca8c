//! Engines: one physics, several schedulers, all tested against `reference`.
mod auto;
mod batches;
mod cache;
pub mod envelope;
pub mod exits;
mod hybrid;
pub mod identity;
mod nodes;
mod reference;
mod spectral;
mod substrate;
mod tables;
mod units;

use std::sync::atomic::{AtomicBool, AtomicU64};

use thiserror::Error;

pub use auto::MaxError;
pub use batches::BATCH;
pub use cache::Cache;
pub use units::{UnitStore, Units};

use crate::measurement::Spectrum;
use crate::optics::{Index, OpticsError};
use crate::slab::SlabError;
use crate::transport::{
    Coefficients, EXPONENTS, Illumination, Model, REJECTION_LIMIT, Snowpack, WalkError,
};

/// Which engine runs a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Engine {
    /// The model of docs/methods.md to the letter: one wavelength at a time, analog absorption.
    Reference,
    /// One walk serves all wavelengths and thicknesses.
    Spectral,
    /// As `spectral`, with grain events drawn from tables.
    Tabulated,
    /// Deterministic transport in the bulk, walks next to the surfaces.
    Hybrid,
    /// The cheapest of these that holds the error allowed.
    Auto,
}

/// How finely the engines that use tables of grain events resolve them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Resolution {
    /// Grain events to draw from, at least 8.
    pub table: u32,
    /// Grain events averaged for the scattering kernel; the table is chosen from these.
    pub grains: u32,
    /// Directions per hemisphere in `hybrid`, 2 to 31.
    pub streams: usize,
}

impl Default for Resolution {
    fn default() -> Self {
        Self {
            table: 1 << 17,
            grains: 1 << 21,
            streams: 8,
        }
    }
}

impl Resolution {
    /// No finer than what so many walks can tell: a table as large and a kernel
    /// of twice as many grain events, within the limits of the engines and the
    /// default. Of those, eight instead of two changed the error of no wavelength
    /// of a snowpack of three layers (docs/performance.md), and took most of the time.
    #[must_use]
    pub fn of_rays(rays: u64) -> Self {
        let most = Self::default();
        let at_most = |n: u64, most: u32| n.next_power_of_two().min(u64::from(most)) as u32;
        Self {
            table: at_most(rays.clamp(1 << 14, 1 << 32), most.table),
            grains: at_most(rays.saturating_mul(2).clamp(1 << 17, 1 << 32), most.grains),
            ..most
        }
    }
}

/// What an engine is asked for: all thicknesses of one snow under all lights.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// The snow.
    pub snowpack: &'a Snowpack,
    /// Thicknesses of the whole snowpack, m, strictly increasing.
    pub thicknesses_m: &'a [f64],
    /// The light: one or several incidences.
    pub illuminations: &'a [Illumination],
    /// Wavelengths, nm, strictly increasing.
    pub wavelengths_nm: &'a [f64],
    /// Choices within the model.
    pub model: &'a Model,
    /// Walks per wavelength and thickness in `reference`; per index node in
    /// `spectral` and `tabulated`; per light and index node in `hybrid` and,
    /// should it choose that, `auto`.
    pub rays: u64,
    /// What `auto` is to hold.
    pub max_error: MaxError,
    /// Resolution of the engines that use tables.
    pub resolution: Resolution,
    /// Seed of the whole database or measurement.
    pub seed: u64,
    /// What node or nodes of a database these are ([`identity`]); 0 for a single
    /// measurement.
    pub cell: u64,
}

/// How a running engine talks to its caller.
#[derive(Debug, Clone, Copy)]
pub struct Control<'a> {
    /// Use all threads of the current rayon pool for this one request.
    pub parallel: bool,
    /// Stop soon with [`EngineError::Cancelled`] once this is set.
    pub cancel: &'a AtomicBool,
    /// Incremented by the walks finished (see [`Engine::walks`]).
    pub rays_done: &'a AtomicU64,
    /// What was made for earlier requests.
    pub cache: &'a Cache,
}

/// Why an engine gave no spectrum.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum EngineError {
    /// The caller asked it to stop.
    #[error("cancelled")]
    Cancelled,
    /// Nothing to walk.
    #[error("rays = 0 must be at least 1")]
    NoRays,
    /// The threads could not be started.
    #[error("cannot start the threads: {0}; ask for fewer")]
    Threads(String),
    /// Grains do not fit between the slab's planes.
    #[error(
        "the slab of {} cm is too thin for grains up to {} um long: {REJECTION_LIMIT} grains in a row did not fit; use a thickness of at least 10 grain lengths",
        thickness_m * 100.0, size_max_m * 1e6
    )]
    SlabTooThin {
        /// Slab thickness, m.
        thickness_m: f64,
        /// Longest grain, m.
        size_max_m: f64,
    },
    /// The engine does not hold there (docs/stability.md).
    #[error(
        "`{}` does not hold where the {what} is {value:.3e}: it must be {lowest} or more; {}",
        engine.name(),
        instead.map_or("no engine holds there".to_owned(), |other| format!("use the engine `{}`", other.name()))
    )]
    Outside {
        /// The engine that refuses.
        engine: Engine,
        /// What is out of its range.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The least the engine takes.
        lowest: f64,
        /// An engine that holds there, if there is one.
        instead: Option<Engine>,
    },
    /// The engine does not compute what is asked.
    #[error("`{}` does not compute {what}; use the engine `{}`", engine.name(), instead.name())]
    Unable {
        /// The engine that refuses.
        engine: Engine,
        /// What it cannot do.
        what: &'static str,
        /// One that can.
        instead: Engine,
    },
    /// The carbon in a snowpack has too many different exponents.
    #[error(
        "the carbon in the snowpack has {found} different Angstrom exponents; at most {EXPONENTS} are allowed"
    )]
    Exponents {
        /// How many there are.
        found: usize,
    },
    /// The reflectance of the substrate is not known at a wavelength.
    #[error(
        "the reflectance of the substrate is given for {min_nm} to {max_nm} nm, not {wavelength_nm} nm"
    )]
    Substrate {
        /// The wavelength.
        wavelength_nm: f64,
        /// First of its table.
        min_nm: f64,
        /// Last of its table.
        max_nm: f64,
    },
    /// The lower layers leave nothing for the surface layer.
    #[error(
        "a snowpack of {} cm has no room for a surface layer: the layers under it take {} cm",
        thickness_m * 100.0, below_m * 100.0
    )]
    NoSurface {
        /// Thickness of the snowpack, m.
        thickness_m: f64,
        /// That of the layers under the surface, m.
        below_m: f64,
    },
    /// The transport equation could not be solved.
    #[error(transparent)]
    Slab(#[from] SlabError),
    /// An optical table does not cover a wavelength, or cannot be read.
    #[error(transparent)]
    Optics(#[from] OpticsError),
}

impl Engine {
    /// All engines.
    pub const ALL: [Self; 5] = [
        Self::Reference,
        Self::Spectral,
        Self::Tabulated,
        Self::Hybrid,
        Self::Auto,
    ];

    /// The name used on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Reference => "reference",
            Self::Spectral => "spectral",
            Self::Tabulated => "tabulated",
            Self::Hybrid => "hybrid",
            Self::Auto => "auto",
        }
    }

    /// Former names, still understood.
    pub const ALIASES: [(&str, Self); 1] = [("doubling", Self::Hybrid)];

    /// The engine of this name, or of this other name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let mut all = Self::ALL.into_iter().map(|engine| (engine.name(), engine));
        let found = all.find(|(own, _)| *own == name);
        let alias = || Self::ALIASES.into_iter().find(|(other, _)| *other == name);
        Some(found.or_else(alias)?.1)
    }

    /// Whether one job of this engine serves all thicknesses at once.
    #[must_use]
    pub fn shares_thicknesses(self) -> bool {
        self != Self::Reference
    }

    /// Whether one job of this engine serves all illuminations at once.
    #[must_use]
    pub fn shares_angles(self) -> bool {
        matches!(self, Self::Hybrid | Self::Auto)
    }

    /// Whether this engine makes tables of grain events, once per shape of grain.
    #[must_use]
    pub fn uses_tables(self) -> bool {
        matches!(self, Self::Tabulated | Self::Hybrid | Self::Auto)
    }

    /// The engine that does the work of `request` under the first of its lights:
    /// itself, or what `auto` chooses.
    #[must_use]
    pub fn resolve(self, request: &Request) -> Self {
        match (self, request.illuminations.first()) {
            (Self::Auto, Some(light)) => auto::choose(request, light).0,
            (engine, _) => engine,
        }
    }

    /// The same with the rays that it does, as in [`Request::rays`].
    #[must_use]
    pub fn resolve_rays(self, request: &Request) -> (Self, u64) {
        match (self, request.illuminations.first()) {
            (Self::Auto, Some(light)) => auto::choose(request, light),
            (engine, _) => (engine, request.rays),
        }
    }

    /// Whether a spectrum does not depend on what other thicknesses are asked for
    /// beside its own: not in engines whose walks are resumed from one to the next.
    #[must_use]
    pub fn keeps_thicknesses_apart(self) -> bool {
        matches!(self, Self::Reference | Self::Hybrid)
    }

    /// How many walks [`Engine::run`] does for `request`; a walk that serves
    /// several thicknesses counts once.
    ///
    /// # Errors
    /// [`EngineError::Optics`].
    pub fn walks(self, request: &Request) -> Result<u64, EngineError> {
        match self {
            Self::Auto => auto::walks(request),
            engine => substrate::walks(engine, request),
        }
    }

    /// The same of a snowpack without cascades on black substrate.
    fn walks_bare(self, request: &Request) -> Result<u64, EngineError> {
        let per_ray = match self {
            Self::Auto | Self::Hybrid => return hybrid::walks(request),
            Self::Reference => request.wavelengths_nm.len() * request.thicknesses_m.len(),
            Self::Spectral | Self::Tabulated => {
                nodes::nodes(&indices(request)?, request.snowpack.is_wet()).len()
            }
        };
        let per_ray = per_ray * request.illuminations.len();
        Ok(request.rays.saturating_mul(per_ray as u64))
    }

    /// Reflectance and transmittance per thickness and illumination of
    /// `request`, the latter running fastest.
    ///
    /// The result is a function of the request alone: never of threads,
    /// schedule or `control`.
    ///
    /// # Errors
    /// See [`EngineError`]; [`EngineError::Outside`] where this engine does not hold.
    pub fn run(self, request: &Request, control: &Control) -> Result<Vec<Spectrum>, EngineError> {
        self.check(request)?;
        self.run_unchecked(request, control)
    }

    /// The same where the engine may not hold: for finding out how far it does.
    ///
    /// # Errors
    /// See [`EngineError`].
    pub fn run_unchecked(
        self,
        request: &Request,
        control: &Control,
    ) -> Result<Vec<Spectrum>, EngineError> {
        match self {
            Self::Auto => auto::run(request, control),
            engine => substrate::run(engine, request, control),
        }
    }
}

impl std::str::FromStr for Engine {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        Self::named(name)
            .ok_or_else(|| {
                format!("no engine is named `{name}`; the engines are reference, spectral, tabulated, hybrid and auto")
            })
    }
}

/// Ice and water at each wavelength. Dry snow needs no water: vacuum stands in.
fn indices(request: &Request) -> Result<Vec<(Index, Index)>, OpticsError> {
    let water = if request.snowpack.is_wet() {
        Some(request.model.water.load()?)
    } else {
        None
    };
    let index = |&wavelength_nm: &f64| {
        let ice = request.model.ice.at(wavelength_nm)?;
        let water = water
            .as_ref()
            .map_or(Ok(Index { n: 1.0, k: 0.0 }), |w| w.at(wavelength_nm))?;
        Ok((ice, water))
    };
    request.wavelengths_nm.iter().map(index).collect()
}

/// Absorption of everything in the snow at each wavelength.
fn coefficients(request: &Request, indices: &[(Index, Index)]) -> Vec<Coefficients> {
    let exponents = request.snowpack.exponents();
    let wavelengths = request.wavelengths_nm.iter().zip(indices);
    wavelengths
        .map(|(nm, indices)| Coefficients::at(*nm, *indices, &exponents))
        .collect()
}

/// A walk's error as the engine's.
fn engine_error(request: &Request, error: WalkError) -> EngineError {
    match error {
        WalkError::TooThin { thickness_m } => EngineError::SlabTooThin {
            thickness_m,
            size_max_m: request.snowpack.longest_grain_m(),
        },
        WalkError::Stopped => EngineError::Cancelled,
    }
}
