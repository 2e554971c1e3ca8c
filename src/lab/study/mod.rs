//! Runs study files: one sample, a spectrum or a BRDF for each of its variants.
mod brdf;
mod spectra;

use crate::config::study::{Draw, StudyFile, Variant};
use crate::engine::exits::goniometer;
use crate::engine::{Control, Engine, EngineError, MaxError, Request, Resolution};
use crate::measurement::Sensors;

pub use brdf::{Brdfs, Features, incidence_deg};
pub use spectra::{Spectra, mean};

/// A study with what came out for each of its variants.
#[derive(Debug, Clone)]
pub enum Studied<'a> {
    /// Of a study that draws spectra.
    Spectra(Spectra<'a>),
    /// Of a study that draws the BRDF.
    Brdfs(Brdfs<'a>),
}

/// How a study is run: as `simulate` would run each of its variants.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// The engine.
    pub engine: Engine,
    /// Walks, see [`Request::rays`]; for a BRDF [`BRDF_WALKS`] times as many.
    pub rays: u64,
    /// Seed of the random numbers.
    pub seed: u64,
}

/// How many times as many walks a BRDF takes as a spectrum: few leave in any one
/// direction.
pub const BRDF_WALKS: u64 = 2;

/// Runs all variants of `study`, calling `next` before each of them.
///
/// # Errors
/// See [`EngineError`].
pub fn run<'a>(
    study: &'a StudyFile,
    settings: Settings,
    control: &Control<'_>,
    next: impl Fn(&Variant),
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
            let settings = Settings {
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

/// What `simulate` gives for every variant: of one thickness under one light it is a
/// list of one.
fn each<T: Default>(
    study: &StudyFile,
    settings: Settings,
    next: impl Fn(&Variant),
    measure: &dyn Fn(&Request) -> Result<Vec<T>, EngineError>,
) -> Result<Vec<T>, EngineError> {
    let one = |variant: &Variant| {
        next(variant);
        let sample = &variant.sample;
        let all = measure(&Request {
            snowpack: &sample.snowpack,
            thicknesses_m: &[sample.thickness_m],
            illuminations: &[sample.illumination],
            resolution: Resolution::of_rays(settings.rays),
            wavelengths_nm: &sample.wavelengths_nm,
            model: &sample.model,
            rays: settings.rays,
            max_error: MaxError::usual(&sample.wavelengths_nm),
            seed: settings.seed,
            cell: 0,
        })?;
        Ok(all.into_iter().next().unwrap_or_default())
    };
    study.variants.iter().map(one).collect()
}
