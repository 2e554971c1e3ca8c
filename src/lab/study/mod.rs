//! Runs study files: a spectrum or a BRDF for each variant of one sample.
mod brdf;
mod spectra;

use crate::config::study::{Draw, StudyFile, StudyVariant};
use crate::engine::exits::goniometer;
use crate::engine::{Control, Engine, EngineError, MaxError, Request};
use crate::measurement::Sensors;

pub use brdf::{Brdfs, Features, incidence_deg};
pub use spectra::{Spectra, mean};

/// A study with the results of its variants.
#[derive(Debug, Clone)]
pub enum Studied<'a> {
    /// Results of a study that draws spectra.
    Spectra(Spectra<'a>),
    /// Results of a study that draws BRDFs.
    Brdfs(Brdfs<'a>),
}

/// The settings of a study. Each variant runs as in `simulate`.
#[derive(Debug, Clone, Copy)]
pub struct StudySettings {
    /// The engine that simulates the variants.
    pub engine: Engine,
    /// Rays, see [`Request::rays`]; a BRDF takes [`BRDF_WALKS`] times as many.
    pub rays: u64,
    /// Seed of the random numbers.
    pub seed: u64,
}

/// Number of walks of a BRDF relative to a spectrum; higher because few rays leave in any one
/// direction.
pub const BRDF_WALKS: u64 = 2;

/// Runs all variants of `study` and calls `next` before each of them.
///
/// # Errors
/// [`EngineError`] if the engine refuses a variant, fails, or is cancelled.
pub fn run<'a>(
    study: &'a StudyFile,
    settings: StudySettings,
    control: &Control<'_>,
    next: impl Fn(&StudyVariant),
) -> Result<Studied<'a>, EngineError> {
    match study.draw {
        Draw::Spectra(draw) => {
            let spectra = each(study, settings, next, &|request: &Request| {
                settings.engine.run(request, control)
            })?;
            Ok(Studied::Spectra(Spectra {
                study,
                draw,
                spectra,
            }))
        }
        Draw::Brdf(draw) => {
            let sensors = Sensors::new(draw.sensors);
            let settings = StudySettings {
                rays: settings.rays.saturating_mul(BRDF_WALKS),
                ..settings
            };
            let exits = each(study, settings, next, &|request: &Request| {
                goniometer(settings.engine, request, &sensors, control)
            })?;
            Ok(Studied::Brdfs(Brdfs {
                study,
                draw,
                sensors,
                exits,
            }))
        }
    }
}

/// The result of `measure` for every variant. A variant has one thickness and one
/// illumination, so `measure` returns a list with one element.
fn each<T: Default>(
    study: &StudyFile,
    settings: StudySettings,
    next: impl Fn(&StudyVariant),
    measure: &dyn Fn(&Request) -> Result<Vec<T>, EngineError>,
) -> Result<Vec<T>, EngineError> {
    let measure_variant = |variant: &StudyVariant| {
        next(variant);
        let sample = &variant.sample;
        let results = measure(&Request {
            snowpack: &sample.snowpack,
            thicknesses_m: &[sample.thickness_m],
            illuminations: &[sample.illumination],
            resolution: settings.engine.resolution(settings.rays),
            wavelengths_nm: &sample.wavelengths_nm,
            model: &sample.model,
            rays: settings.rays,
            max_error: MaxError::default_for(&sample.wavelengths_nm),
            seed: settings.seed,
            cell: 0,
        })?;
        Ok(results.into_iter().next().unwrap_or_default())
    };
    study.variants.iter().map(measure_variant).collect()
}
