//! The virtual spectrophotometer: simulates the spectrum of a sample in one call.
//!
//! ```
//! use splitsnow::{Simulation, config, engine::Engine};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let sample = config::sample::read("configs/samples/representative.toml".as_ref())?;
//! let spectrum = Simulation::of(&sample)
//!     .engine(Engine::Spectral)
//!     .rays(16)
//!     .run()?;
//! for (nm, reflectance) in sample.wavelengths_nm.iter().zip(&spectrum.reflectance) {
//!     println!("{nm} nm: {} +- {}", reflectance.value, reflectance.se);
//! }
//! # Ok(())
//! # }
//! ```
use std::sync::atomic::{AtomicBool, AtomicU64};

use crate::config::sample::SampleFile;
use crate::engine::profile::{self, Profile};
use crate::engine::{Cache, Control, Engine, EngineError, MaxError, Request, Resolution};
use crate::measurement::Spectrum;
use crate::transport::{Illumination, Model, Snowpack};

/// Default number of walks of the engines that follow one ray after the other, of profiles and of
/// light toward views.
pub const RAYS: u64 = 131_072;

/// Default number of walks of [`Simulation::run`]: a quarter of [`RAYS`] in `hybrid`, which `auto`
/// prefers, since its walks have less noise (docs/performance.md), and [`RAYS`] in other engines.
#[must_use]
pub const fn default_rays(engine: Engine) -> u64 {
    match engine {
        Engine::Auto | Engine::Hybrid => RAYS / 4,
        Engine::Reference | Engine::Spectral | Engine::Tabulated => RAYS,
    }
}
/// Number of walks of the first run of [`Simulation::run_to_error`], and steps of those after it.
const FIRST_RAYS: u64 = 4096;
/// Most walks of [`Simulation::run_to_error`].
const MOST_RAYS: u64 = 1 << 26;
/// Factor of the number of walks expected, since standard errors have errors themselves.
const MARGIN: f64 = 1.1;

/// A simulation of the reflectance and transmittance of one snowpack under one illumination.
///
/// The result depends on the snowpack, illumination, wavelengths, model, engine, number of
/// walks, seed and largest error alone: never on the threads.
#[derive(Debug, Clone)]
#[must_use = "a simulation does nothing before `run`"]
pub struct Simulation<'a> {
    snowpack: &'a Snowpack,
    thickness_m: [f64; 1],
    illumination: [Illumination; 1],
    wavelengths_nm: &'a [f64],
    model: &'a Model,
    engine: Engine,
    rays: Option<u64>,
    max_error: MaxError,
    seed: u64,
    threads: usize,
    cancel: Option<&'a AtomicBool>,
}

impl<'a> Simulation<'a> {
    /// A simulation of the sample of a sample file, with the engine `auto`, the seed 1 and
    /// [`default_rays`] walks.
    pub fn of(sample: &'a SampleFile) -> Self {
        Self::new(
            &sample.snowpack,
            sample.thickness_m,
            sample.illumination,
            &sample.wavelengths_nm,
            &sample.model,
        )
    }

    /// A simulation of a `snowpack` with the total thickness `thickness_m`, m, at
    /// `wavelengths_nm`, nm, strictly increasing. Defaults are those of [`of`](Self::of).
    pub fn new(
        snowpack: &'a Snowpack,
        thickness_m: f64,
        illumination: Illumination,
        wavelengths_nm: &'a [f64],
        model: &'a Model,
    ) -> Self {
        Self {
            snowpack,
            thickness_m: [thickness_m],
            illumination: [illumination],
            wavelengths_nm,
            model,
            engine: Engine::Auto,
            rays: None,
            max_error: MaxError::default_for(wavelengths_nm),
            seed: 1,
            threads: 0,
            cancel: None,
        }
    }

    /// Sets the engine.
    pub fn engine(self, engine: Engine) -> Self {
        Self { engine, ..self }
    }

    /// Sets the number of walks, at least 1: see [`Request::rays`].
    pub fn rays(self, rays: u64) -> Self {
        Self {
            rays: Some(rays),
            ..self
        }
    }

    /// Sets the largest error that the engine `auto`, and [`run_to_error`](Self::run_to_error), may leave.
    pub fn max_error(self, max_error: MaxError) -> Self {
        Self { max_error, ..self }
    }

    /// Sets the largest root mean square error over the wavelengths, see
    /// [`max_error`](Self::max_error).
    pub fn max_rmse(self, rmse: f64) -> Self {
        let max_error = MaxError {
            rmse,
            ..self.max_error
        };
        self.max_error(max_error)
    }

    /// Sets the seed of the random streams.
    pub fn seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// Sets the number of threads; 0 for the current rayon pool.
    pub fn threads(self, threads: usize) -> Self {
        Self { threads, ..self }
    }

    /// Sets a flag that stops the run when it becomes true.
    pub fn cancel(self, cancel: &'a AtomicBool) -> Self {
        Self {
            cancel: Some(cancel),
            ..self
        }
    }

    /// The request to an engine for this simulation.
    #[must_use]
    pub fn request(&self) -> Request<'_> {
        let rays = self.rays.unwrap_or_else(|| default_rays(self.engine));
        self.request_at(rays, self.engine.resolution(rays))
    }

    /// The request for light inside the snow and toward views. These need walks one by one, of
    /// which [`RAYS`] are the default.
    #[must_use]
    pub fn detailed_request(&self) -> Request<'_> {
        let rays = self.rays.unwrap_or(RAYS);
        self.request_at(rays, Resolution::for_rays(rays))
    }

    fn request_at(&self, rays: u64, resolution: Resolution) -> Request<'_> {
        Request {
            snowpack: self.snowpack,
            thicknesses_m: &self.thickness_m,
            illuminations: &self.illumination,
            resolution,
            wavelengths_nm: self.wavelengths_nm,
            model: self.model,
            rays,
            max_error: self.max_error,
            seed: self.seed,
            cell: 0,
        }
    }

    /// The engine that will run: for `auto`, the one that it selects.
    #[must_use]
    pub fn resolved(&self) -> Engine {
        self.engine.resolve(&self.request())
    }

    /// The number of walks of [`run`](Self::run).
    ///
    /// # Errors
    /// [`EngineError::Optics`] if the optical properties cannot be determined.
    pub fn walks(&self) -> Result<u64, EngineError> {
        self.engine.walks(&self.request())
    }

    /// Runs the simulation.
    ///
    /// # Errors
    /// [`EngineError`] if there are no rays, the engine refuses the request, the run is
    /// cancelled, or the threads cannot be started.
    pub fn run(&self) -> Result<Spectrum, EngineError> {
        self.on_threads(|control| self.run_with(control))
    }

    /// Simulates the light inside the snow at depths below the surface, m; see [`profile::run`].
    /// The request is [`detailed_request`](Self::detailed_request).
    ///
    /// # Errors
    /// As [`run`](Self::run), and [`EngineError::Depth`] for a depth that is not in the snow.
    pub fn profile(&self, depths_m: &[f64]) -> Result<Profile, EngineError> {
        let request = self.detailed_request();
        self.on_threads(|control| profile::run(self.engine, &request, depths_m, control))
    }

    /// Does `work` on the threads of the simulation.
    fn on_threads<T: Send>(
        &self,
        work: impl Fn(&Control<'_>) -> Result<T, EngineError> + Sync,
    ) -> Result<T, EngineError> {
        let never = AtomicBool::new(false);
        let control = Control {
            parallel: true,
            cancel: self.cancel.unwrap_or(&never),
            rays_done: &AtomicU64::new(0),
            cache: &Cache::default(),
        };
        if self.threads == 0 {
            return work(&control);
        }
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(self.threads)
            .build()
            .map_err(|error| EngineError::Threads(error.to_string()))?;
        pool.install(|| work(&control))
    }

    /// Runs the simulation on the current rayon pool with the given `control`.
    ///
    /// # Errors
    /// [`EngineError`] if there are no rays, the engine refuses the request, or the run is
    /// cancelled.
    pub fn run_with(&self, control: &Control<'_>) -> Result<Spectrum, EngineError> {
        if self.rays == Some(0) {
            return Err(EngineError::NoRays);
        }
        let mut spectra = self.engine.run(&self.request(), control)?;
        // One thickness and one illumination give one spectrum.
        Ok(spectra.pop().unwrap_or_default())
    }

    /// Runs the simulation with as many walks as [`max_error`](Self::max_error) needs, whatever
    /// [`rays`](Self::rays) says: first few walks, then as many as their standard errors ask for,
    /// until the noise of R and of T, root mean square over the wavelengths, is within what the
    /// systematic error of the engine leaves. Returns the simulation that ran last, with its number
    /// of walks (at most 2^26), and its spectrum.
    ///
    /// # Errors
    /// [`EngineError::Inaccurate`] if the systematic error alone may be larger; and as
    /// [`run`](Self::run).
    pub fn run_to_error(&self) -> Result<(Self, Spectrum), EngineError> {
        self.on_threads(|control| self.run_to_error_with(control))
    }

    /// [`run_to_error`](Self::run_to_error) on the current rayon pool with the given `control`.
    ///
    /// # Errors
    /// As [`run_to_error`](Self::run_to_error).
    pub fn run_to_error_with(
        &self,
        control: &Control<'_>,
    ) -> Result<(Self, Spectrum), EngineError> {
        let mut rays = FIRST_RAYS;
        let mut simulation = self.clone().engine(self.resolved()).rays(rays);
        let allowed = simulation.engine.noise_allowed(&simulation.request())?;
        loop {
            let spectrum = simulation.run_with(control)?;
            let excess = spectrum.rms_se() / allowed;
            if excess <= 1.0 || rays >= MOST_RAYS {
                return Ok((simulation, spectrum));
            }
            let steps = rays as f64 * MARGIN * excess * excess / FIRST_RAYS as f64;
            // floats, which do not overflow however small the error asked
            rays = (FIRST_RAYS as f64 * steps.ceil()).min(MOST_RAYS as f64) as u64;
            simulation = simulation.rays(rays);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::config::sample;

    #[test]
    fn threads_change_nothing_and_a_flag_stops_it() {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/configs/samples/representative.toml"
        );
        let sample = sample::read(path.as_ref()).unwrap();
        let simulation = Simulation::of(&sample).engine(Engine::Spectral).rays(64);
        let spectrum = simulation.run().unwrap();
        assert_eq!(spectrum.reflectance.len(), sample.wavelengths_nm.len());
        for threads in [1, 3] {
            let again = simulation.clone().threads(threads).run().unwrap();
            assert_eq!(spectrum, again);
        }
        assert_ne!(spectrum, simulation.clone().seed(2).run().unwrap());
        let stop = AtomicBool::new(true);
        let stopped = simulation.clone().cancel(&stop).run();
        assert_eq!(stopped, Err(EngineError::Cancelled));
        assert_eq!(simulation.rays(0).run(), Err(EngineError::NoRays));
    }

    #[test]
    fn walks_follow_from_the_error_asked() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/samples/basal.toml");
        let sample = sample::read(path.as_ref()).unwrap();
        let nm: Vec<f64> = (0..8).map(|i| 450.0 + 250.0 * f64::from(i)).collect();
        let simulation = Simulation::new(
            &sample.snowpack,
            sample.thickness_m,
            sample.illumination,
            &nm,
            &sample.model,
        );
        let (cancel, rays_done, cache) =
            (AtomicBool::new(false), AtomicU64::new(0), Cache::default());
        let control = Control {
            parallel: true,
            cancel: &cancel,
            rays_done: &rays_done,
            cache: &cache,
        };
        let within = |engine, rmse| {
            let max_error = MaxError { delta_e: 0.3, rmse };
            let simulation = simulation.clone().engine(engine).max_error(max_error);
            simulation.run_to_error_with(&control)
        };
        let (coarse, _) = within(Engine::Auto, 0.01).unwrap();
        let (fine, spectrum) = within(Engine::Auto, 0.0017).unwrap();
        assert_eq!([coarse.engine, fine.engine], [Engine::Hybrid; 2]);
        let [few, many] = [&coarse, &fine].map(|simulation| simulation.request().rays);
        assert!(few < many, "{few} {many}");
        // the systematic error of `hybrid` in the near infrared, and the noise
        let total = |spectrum: &Spectrum| spectrum.rms_se().hypot(0.0015);
        assert!(total(&spectrum) <= 0.0017, "{}", total(&spectrum));
        // a quarter of the walks would not have been enough
        let fewer = fine.clone().rays(many / 4).run().unwrap();
        assert!(total(&fewer) > 0.0017, "{many} {}", total(&fewer));
        // the result is that of a run with these walks
        assert_eq!(fine.run().unwrap(), spectrum);
        let refused = within(Engine::Hybrid, 0.001).unwrap_err().to_string();
        let expected = "the systematic error of the engine `hybrid` here may be larger than a root \
            mean square error of 0.001 or a Delta-E of 0.3; allow larger errors, or use the engine \
            `tabulated`";
        assert_eq!(refused, expected);
    }
}
