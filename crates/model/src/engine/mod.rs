//! Engines: different ways of computing the same physical model. All are tested
//! against `reference`.
mod auto;
mod batches;
mod cache;
mod divided;
pub mod envelope;
pub mod exits;
mod hybrid;
pub mod identity;
mod nodes;
pub mod profile;
mod reference;
mod spectral;
mod substrate;
mod table_store;
mod tables;
mod units;

use std::sync::atomic::{AtomicBool, AtomicU64};

use thiserror::Error;

pub use auto::{MaxError, NEAR_INFRARED_NM};
pub use batches::BATCH;
pub use cache::{Cache, TableCounts};
pub use table_store::TableStore;
pub use units::{UnitStore, Units};

use crate::measurement::Spectrum;
use crate::optics::{Index, OpticsError};
use crate::slab::SlabError;
use crate::transport::{
    Coefficients, Illumination, Model, REJECTION_LIMIT, Snowpack, Tracers, WalkError,
};

/// The engine that runs a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Engine {
    /// The model exactly as in docs/methods.md: one wavelength at a time, analog absorption.
    Reference,
    /// Each walk is scored at all wavelengths and thicknesses.
    Spectral,
    /// As `spectral`, with grain events drawn from tables.
    Tabulated,
    /// Deterministic transport in the bulk; walks near the surfaces.
    Hybrid,
    /// The cheapest of these engines that meets the error allowed.
    Auto,
}

/// Resolution of the engines that use tables of grain events.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Resolution {
    /// Entries of the table of grain events, at least 8.
    pub table: u32,
    /// Grain events averaged for the scattering kernel. The table entries are a
    /// subset of these.
    pub grains: u32,
    /// Discrete directions (streams) per hemisphere in `hybrid`, 2 to 31.
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
    /// The resolution that suits `rays` walks one by one, between the engines' minima and the
    /// defaults: about `rays` table entries, and kernel events that err less than the walks: 2 `rays`,
    /// or 4 `rays` up to 2^17. More do not reduce the error (docs/performance.md).
    #[must_use]
    pub fn for_rays(rays: u64) -> Self {
        let few = rays.saturating_mul(4).min(1 << 17);
        Self::of(rays, rays.saturating_mul(2).max(few))
    }

    /// The resolution that suits `rays` walks of `hybrid`, which have less noise: four times as
    /// many table entries, and 8 `rays` kernel events.
    #[must_use]
    pub fn for_hybrid(rays: u64) -> Self {
        Self::of(rays.saturating_mul(4), rays.saturating_mul(8))
    }

    /// Powers of two of at least these numbers, between 2^14 and the defaults.
    fn of(table: u64, grains: u64) -> Self {
        let default = Self::default();
        let power_of_two = |n: u64, largest: u32| {
            let clamped = n.clamp(1 << 14, u64::from(largest));
            clamped.next_power_of_two() as u32
        };
        Self {
            table: power_of_two(table, default.table),
            grains: power_of_two(grains, default.grains),
            ..default
        }
    }
}

/// Input of an engine: one snowpack at all thicknesses under all illuminations.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// The snowpack: layers and substrate.
    pub snowpack: &'a Snowpack,
    /// Thicknesses of the whole snowpack, m, strictly increasing.
    pub thicknesses_m: &'a [f64],
    /// Illuminations, one or more.
    pub illuminations: &'a [Illumination],
    /// Wavelengths, nm, strictly increasing.
    pub wavelengths_nm: &'a [f64],
    /// Model options.
    pub model: &'a Model,
    /// Number of walks: per wavelength and thickness in `reference`; per index
    /// node in `spectral` and `tabulated`; per illumination and index node in
    /// `hybrid`, also where `auto` chooses `hybrid`.
    pub rays: u64,
    /// Error allowed, from which `auto` chooses the engine.
    pub max_error: MaxError,
    /// Resolution of the engines that use tables.
    pub resolution: Resolution,
    /// Seed of the whole database or measurement.
    pub seed: u64,
    /// Identity of the database node or nodes ([`identity`]); 0 for a single
    /// measurement.
    pub cell: u64,
}

impl Request<'_> {
    /// The sums over impurities that its walks keep.
    fn tracers(&self) -> Tracers {
        Tracers::of(self.snowpack, self.model, self.wavelengths_nm)
    }
}

/// Execution controls of a running engine; none changes a result.
#[derive(Debug, Clone, Copy)]
pub struct Control<'a> {
    /// Use all threads of the current rayon pool for this one request.
    pub parallel: bool,
    /// When set, the engine soon stops with [`EngineError::Cancelled`].
    pub cancel: &'a AtomicBool,
    /// Progress: incremented by the number of walks finished (see [`Engine::walks`]).
    pub rays_done: &'a AtomicU64,
    /// Tables and walks kept from earlier requests.
    pub cache: &'a Cache,
}

/// Reason for which an engine returned no spectrum.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum EngineError {
    /// The caller cancelled the run.
    #[error("cancelled")]
    Cancelled,
    /// The number of rays is 0.
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
    /// The request is outside the engine's range of validity (docs/stability.md).
    #[error(
        "the engine `{}` is not valid here: the {quantity} is {value:.3e} and must be at least {lowest}; {}{}",
        engine.name(),
        instead.map_or("no engine is valid here".to_owned(), |other| format!("use the engine `{}`", other.name())),
        most_deg.map_or(String::new(), |most| format!("; light may come from up to {most} degrees from the normal"))
    )]
    Outside {
        /// The engine that refuses the request.
        engine: Engine,
        /// Name of the quantity that is out of range.
        quantity: &'static str,
        /// Value of the quantity.
        value: f64,
        /// Smallest value that the engine accepts.
        lowest: f64,
        /// An engine that accepts the request, if there is one.
        instead: Option<Engine>,
        /// The largest incidence angle that the engine accepts, degrees, if the angle is out of
        /// range.
        most_deg: Option<f64>,
    },
    /// The engine does not compute the requested quantity.
    #[error("the engine `{}` does not compute {quantity}; use the engine `{}`", engine.name(), instead.name())]
    Unable {
        /// The engine that refuses the request.
        engine: Engine,
        /// Name of the quantity.
        quantity: &'static str,
        /// An engine that computes the quantity.
        instead: Engine,
    },
    /// The systematic error of the engine is larger than the error allowed.
    #[error(
        "the systematic error of the engine `{}` here may be larger than a root mean square error of {} or a Delta-E of {}; allow larger errors, or use the engine `{}`",
        engine.name(), max_error.rmse, max_error.delta_e, instead.name()
    )]
    Inaccurate {
        /// The engine.
        engine: Engine,
        /// The error allowed.
        max_error: MaxError,
        /// An engine whose systematic error is smaller.
        instead: Engine,
    },
    /// The reflectance of the substrate is not known at a wavelength.
    #[error(
        "the reflectance of the substrate is given for {min_nm} to {max_nm} nm, not {wavelength_nm} nm"
    )]
    Substrate {
        /// The wavelength, nm.
        wavelength_nm: f64,
        /// First wavelength of the substrate's table, nm.
        min_nm: f64,
        /// Last wavelength of the substrate's table, nm.
        max_nm: f64,
    },
    /// The absorption of an absorber is not known at a wavelength.
    #[error(
        "the absorption of {name} is given for {min_nm} to {max_nm} nm, not {wavelength_nm} nm"
    )]
    Absorber {
        /// Name of the absorber.
        name: String,
        /// The wavelength, nm.
        wavelength_nm: f64,
        /// First wavelength of its table, nm.
        min_nm: f64,
        /// Last wavelength of its table, nm.
        max_nm: f64,
    },
    /// A depth at which light is wanted is not in the snowpack.
    #[error(
        "the depth {} cm is not in the snowpack; give depths from 0 to {} cm",
        depth_m * 100.0, thickness_m * 100.0
    )]
    Depth {
        /// The depth, m.
        depth_m: f64,
        /// Thickness of the snowpack, m.
        thickness_m: f64,
    },
    /// Light inside a cascade of layers is wanted.
    #[error(
        "there is no profile of light in a cascade, whose layers are separate slabs; use `layers = \"continuous\"` in [model]"
    )]
    CascadeProfile,
    /// The layers under the surface layer are as thick as the whole snowpack.
    #[error(
        "a snowpack of {} cm has no room for a surface layer: the layers under it take {} cm; make the snowpack thicker",
        thickness_m * 100.0, below_m * 100.0
    )]
    NoSurface {
        /// Thickness of the snowpack, m.
        thickness_m: f64,
        /// Thickness of the layers under the surface layer, m.
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

    /// Former names, which are still accepted.
    pub const ALIASES: [(&str, Self); 1] = [("doubling", Self::Hybrid)];

    /// The engine with this name or alias.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let mut names = Self::ALL.into_iter().map(|engine| (engine.name(), engine));
        let by_name = names.find(|(current, _)| *current == name);
        let by_alias = || Self::ALIASES.into_iter().find(|(alias, _)| *alias == name);
        Some(by_name.or_else(by_alias)?.1)
    }

    /// Whether one job of this engine computes all thicknesses at once.
    #[must_use]
    pub fn shares_thicknesses(self) -> bool {
        self != Self::Reference
    }

    /// Whether one job of this engine computes all illuminations at once.
    #[must_use]
    pub fn shares_angles(self) -> bool {
        matches!(self, Self::Hybrid | Self::Auto)
    }

    /// Whether this engine builds tables of grain events, once per grain shape.
    #[must_use]
    pub fn uses_tables(self) -> bool {
        matches!(self, Self::Tabulated | Self::Hybrid | Self::Auto)
    }

    /// The engine that computes `request` under its first illumination: this
    /// engine, or the one that `auto` chooses.
    #[must_use]
    pub fn resolve(self, request: &Request) -> Self {
        match (self, request.illuminations.first()) {
            (Self::Auto, Some(light)) => auto::choose(request, light).0,
            (engine, _) => engine,
        }
    }

    /// The resolution that suits `rays` walks of this engine; `auto` mostly takes `hybrid`.
    #[must_use]
    pub fn resolution(self, rays: u64) -> Resolution {
        match self {
            Self::Auto | Self::Hybrid => Resolution::for_hybrid(rays),
            Self::Reference | Self::Spectral | Self::Tabulated => Resolution::for_rays(rays),
        }
    }

    /// Like [`Engine::resolve`], with the number of rays that the engine walks (as
    /// in [`Request::rays`]).
    #[must_use]
    pub fn resolve_rays(self, request: &Request) -> (Self, u64) {
        match (self, request.illuminations.first()) {
            (Self::Auto, Some(light)) => auto::choose(request, light),
            (engine, _) => (engine, request.rays),
        }
    }

    /// Number of index nodes of `request`: the pairs of refractive indices at which `hybrid`
    /// walks. Workers that share a request ([`Units::of_share`]) divide these among them.
    ///
    /// # Errors
    /// [`EngineError::Optics`] if an optical table cannot be read or does not cover a
    /// wavelength.
    pub fn index_nodes(request: &Request) -> Result<usize, EngineError> {
        Ok(nodes::nodes(
            &indices(request)?,
            request.snowpack.is_wet(),
            nodes::Spacing::of_walks(request.rays),
        )
        .len())
    }

    /// Bounds of the systematic error of this engine for the snow of `request`, which its
    /// standard errors do not include: Delta-E, and root mean square error of reflectance and
    /// transmittance below and above 780 nm (docs/stability.md).
    #[must_use]
    pub fn systematic_error(self, request: &Request) -> [f64; 3] {
        auto::systematic_error_of(self.resolve(request), request)
    }

    /// Noise (root mean square over the wavelengths) that [`Request::max_error`] allows in addition
    /// to the systematic error of this engine.
    ///
    /// # Errors
    /// [`EngineError::Inaccurate`] if the systematic error alone may be larger.
    pub fn noise_allowed(self, request: &Request) -> Result<f64, EngineError> {
        auto::noise_allowed(self.resolve(request), request)
    }

    /// Whether a spectrum is independent of the other thicknesses in its request.
    /// False for engines that resume their walks from one thickness to the next.
    #[must_use]
    pub fn has_independent_thicknesses(self) -> bool {
        matches!(self, Self::Reference | Self::Hybrid)
    }

    /// Number of walks that [`Engine::run`] does for `request`. A walk that is
    /// scored at several thicknesses counts once.
    ///
    /// # Errors
    /// [`EngineError::Optics`] if an optical table cannot be read or does not cover
    /// a wavelength; [`EngineError::Substrate`] likewise for the substrate.
    pub fn walks(self, request: &Request) -> Result<u64, EngineError> {
        let walks = |request: &Request| match self {
            Self::Auto => auto::walks(request),
            engine => substrate::walks(engine, request),
        };
        match divided::parts(request) {
            None => walks(request),
            Some(parts) => parts.iter().map(walks).sum(),
        }
    }

    /// Like [`Engine::walks`], for a snowpack without cascades on a black substrate.
    fn walks_bare(self, request: &Request) -> Result<u64, EngineError> {
        let per_ray = match self {
            Self::Auto | Self::Hybrid => return hybrid::walks(request),
            Self::Reference => request.wavelengths_nm.len() * request.thicknesses_m.len(),
            Self::Spectral | Self::Tabulated => nodes::nodes(
                &indices(request)?,
                request.snowpack.is_wet(),
                nodes::Spacing::FINE,
            )
            .len(),
        };
        let per_ray = per_ray * request.illuminations.len();
        Ok(request.rays.saturating_mul(per_ray as u64))
    }

    /// Computes reflectance and transmittance per thickness and illumination of
    /// `request`, the illumination running fastest.
    ///
    /// The result depends on the request alone, not on threads, schedule or
    /// `control`.
    ///
    /// # Errors
    /// [`EngineError::Outside`] if the request is outside this engine's range of
    /// validity; see [`EngineError`] for all others.
    pub fn run(self, request: &Request, control: &Control) -> Result<Vec<Spectrum>, EngineError> {
        self.check(request)?;
        self.run_unchecked(request, control)
    }

    /// Like [`Engine::run`], without the check of the range of validity. Used to
    /// find the limits of that range.
    ///
    /// # Errors
    /// See [`EngineError`].
    pub fn run_unchecked(
        self,
        request: &Request,
        control: &Control,
    ) -> Result<Vec<Spectrum>, EngineError> {
        let whole = |request: &Request, control: &Control| match self {
            Self::Auto => auto::run(request, control),
            engine => substrate::run(engine, request, control),
        };
        let Some(parts) = divided::run(self.name(), request, control, whole)? else {
            return whole(request, control);
        };
        let curves = request.thicknesses_m.len() * request.illuminations.len();
        let mut spectra = vec![Spectrum::default(); curves];
        for part in parts {
            let pairs = spectra.iter_mut().zip(part);
            pairs.for_each(|(spectrum, part)| spectrum.extend(part));
        }
        Ok(spectra)
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

/// Refractive indices of ice and water at each wavelength. In dry snow the index
/// of water is replaced by that of vacuum.
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

/// Absorption coefficients of ice, water and impurities at each wavelength.
fn coefficients(request: &Request, indices: &[(Index, Index)]) -> Vec<Coefficients> {
    let tracers = request.tracers();
    let wavelengths = request.wavelengths_nm.iter().zip(indices);
    wavelengths
        .map(|(nm, indices)| Coefficients::at(*nm, *indices, &tracers))
        .collect()
}

/// Converts a walk's error into an engine error.
fn engine_error(request: &Request, error: WalkError) -> EngineError {
    match error {
        WalkError::TooThin { thickness_m } => EngineError::SlabTooThin {
            thickness_m,
            size_max_m: request.snowpack.longest_grain_m(),
        },
        WalkError::Stopped => EngineError::Cancelled,
    }
}
