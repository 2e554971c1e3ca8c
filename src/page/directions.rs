//! `directions`: light by direction.
use std::sync::atomic::AtomicU64;

use crate::engine::exits::{self, Exits};
use crate::engine::{Control, Engine, Units};
use crate::measurement::{Measured, Views};
use crate::simulation::Simulation;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::PageEngine;
use super::limits::check;
use super::refused::Refused;
use super::sample::{Files, read};
use super::simulate::{errors, values};

#[derive(Debug, Deserialize)]
pub(super) struct DirectionsRequest {
    sample: Value,
    #[serde(default)]
    files: Files,
    rays: u64,
    seed: u64,
    wavelength_nm: f64,
    view_deg: Vec<f64>,
    relative_azimuth_deg: Vec<f64>,
}

/// Arrays are `[view][azimuth]`.
#[derive(Debug, Serialize)]
pub(super) struct DirectionsAnswer {
    wavelength_nm: f64,
    view_deg: Vec<f64>,
    relative_azimuth_deg: Vec<f64>,
    brf: Vec<Vec<f64>>,
    brf_se: Vec<Vec<f64>>,
    btf: Vec<Vec<f64>>,
    btf_se: Vec<Vec<f64>>,
    reflectance: f64,
    reflectance_se: f64,
    transmittance: f64,
    transmittance_se: f64,
    engine: &'static str,
    rays: u64,
}

impl DirectionsRequest {
    pub(super) fn answer(mut self, engine: &PageEngine) -> Result<DirectionsAnswer, Refused> {
        check("walks", self.rays, engine.limits.rays)?;
        let (views, azimuths) = (&self.view_deg, &self.relative_azimuth_deg);
        let count = views.len().saturating_mul(azimuths.len());
        check("views", count as u64, engine.limits.views as u64)?;
        let at = |view: &f64| azimuths.iter().map(|azimuth| [*view, *azimuth]).collect();
        let angles: Vec<Vec<[f64; 2]>> = views.iter().map(at).collect();
        let angles = Views::new(&angles.concat()).map_err(Refused::new)?;
        if let Some(sample) = self.sample.as_object_mut() {
            sample.insert(
                "wavelengths".to_owned(),
                json!({ "values_nm": [self.wavelength_nm] }),
            );
        }
        let (file, _) = read(&self.sample, &self.files, &engine.limits)?;
        let simulation = Simulation::of(&file).rays(self.rays).seed(self.seed);
        let request = simulation.detailed_request();
        let used = exits::goniometer_engine(Engine::Auto, &request);
        let cache = engine.cache.with(Units::default());
        let control = Control {
            parallel: engine.threads > 1,
            cancel: &engine.cancel,
            rays_done: &AtomicU64::new(0),
            cache: &cache,
        };
        let found = exits::views(used, &request, &angles, &control)?;
        // one thickness, one illumination and one wavelength
        let exits = found.into_iter().next().unwrap_or_default();
        Ok(self.of(&exits, used))
    }

    fn of(self, exits: &Exits, engine: Engine) -> DirectionsAnswer {
        let columns = self.relative_azimuth_deg.len().max(1);
        let rows = |factors: &[Measured], part: fn(&[Measured]) -> Vec<f64>| {
            factors.chunks(columns).map(part).collect()
        };
        let (brf, btf) = (exits.reflectance_factors(), exits.transmittance_factors());
        DirectionsAnswer {
            brf: rows(&brf, values),
            brf_se: rows(&brf, errors),
            btf: rows(&btf, values),
            btf_se: rows(&btf, errors),
            reflectance: exits.reflectance.value,
            reflectance_se: exits.reflectance.se,
            transmittance: exits.transmittance.value,
            transmittance_se: exits.transmittance.se,
            engine: engine.name(),
            rays: self.rays,
            wavelength_nm: self.wavelength_nm,
            view_deg: self.view_deg,
            relative_azimuth_deg: self.relative_azimuth_deg,
        }
    }
}
