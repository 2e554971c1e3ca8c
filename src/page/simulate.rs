//! `simulate`, `walk` and `wedge`: the spectrophotometer.
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, PoisonError};

use crate::engine::{Control, Engine, NEAR_INFRARED_NM, Request, UnitStore, Units};
use crate::grid::MIN_GRAIN_LENGTHS;
use crate::measurement::{Measured, Spectrum};
use crate::simulation::Simulation;
use crate::units::cm_to_m;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::PageEngine;
use super::limits::check;
use super::refused::{Refused, Reply};
use super::sample::{Files, read};

#[derive(Debug, Deserialize)]
pub(super) struct SimulateRequest {
    sample: Value,
    #[serde(default)]
    files: Files,
    rays: u64,
    seed: u64,
}

#[derive(Debug, Deserialize)]
pub(super) struct WalkRequest {
    #[serde(flatten)]
    simulation: SimulateRequest,
    worker: usize,
    workers: usize,
}

#[derive(Debug, Deserialize)]
pub(super) struct WedgeRequest {
    #[serde(flatten)]
    simulation: SimulateRequest,
    thicknesses_cm: Vec<f64>,
}

#[derive(Debug, Serialize)]
struct WalkAnswer {
    walks: u64,
}

#[derive(Debug, Serialize)]
pub(super) struct SpectrumAnswer {
    wavelengths_nm: Vec<f64>,
    reflectance: Vec<f64>,
    reflectance_se: Vec<f64>,
    transmittance: Vec<f64>,
    transmittance_se: Vec<f64>,
    absorptance: Vec<f64>,
    absorptance_se: Vec<f64>,
    lost_share: Vec<f64>,
    method_error: Vec<f64>,
    engine: &'static str,
    rays: u64,
    seed: u64,
    warnings: Vec<String>,
    notes: Vec<String>,
}

#[derive(Debug, Serialize)]
pub(super) struct WedgeAnswer {
    wavelengths_nm: Vec<f64>,
    thicknesses_cm: Vec<f64>,
    reflectance: Vec<Vec<f64>>,
    transmittance: Vec<Vec<f64>>,
}

pub(super) fn values(measured: &[Measured]) -> Vec<f64> {
    measured.iter().map(|measured| measured.value).collect()
}

pub(super) fn errors(measured: &[Measured]) -> Vec<f64> {
    measured.iter().map(|measured| measured.se).collect()
}

impl SimulateRequest {
    /// Calls `run` with the simulation, its warnings and the notes of its files.
    fn with<T>(
        &self,
        engine: &PageEngine,
        run: impl FnOnce(Simulation, Vec<String>, Vec<String>) -> Result<T, Refused>,
    ) -> Result<T, Refused> {
        check("walks", self.rays, engine.limits.rays)?;
        let (file, notes) = read(&self.sample, &self.files, &engine.limits)?;
        let simulation = Simulation::of(&file).rays(self.rays).seed(self.seed);
        // not `auto`, which takes 74 times as many walks where it does not choose `hybrid`
        let engine = simulation.resolved();
        let simulation = simulation.engine(engine);
        run(simulation, file.warnings.clone(), notes)
    }

    pub(super) fn answer(
        &self,
        engine: &PageEngine,
        walks: &[u8],
    ) -> Result<SpectrumAnswer, Refused> {
        self.with(engine, |simulation, warnings, notes| {
            let units = Units::new(Box::new(Saved::default()), &unpack(walks)?);
            let cache = engine.cache.with(units);
            let spectrum = simulation.run_with(&Control {
                parallel: engine.threads > 1,
                cancel: &engine.cancel,
                rays_done: &AtomicU64::new(0),
                cache: &cache,
            })?;
            let (r, t) = (&spectrum.reflectance, &spectrum.transmittance);
            let both = || r.iter().zip(t);
            Ok(SpectrumAnswer {
                reflectance: values(r),
                reflectance_se: errors(r),
                transmittance: values(t),
                transmittance_se: errors(t),
                absorptance: both().map(|(r, t)| 1.0 - r.value - t.value).collect(),
                // an upper bound: R and T may err together
                absorptance_se: both().map(|(r, t)| r.se + t.se).collect(),
                lost_share: spectrum.lost,
                method_error: method_error(simulation.resolved(), &simulation.request()),
                engine: simulation.resolved().name(),
                rays: self.rays,
                seed: self.seed,
                notes,
                warnings,
                wavelengths_nm: simulation.request().wavelengths_nm.to_vec(),
            })
        })
    }
}

impl WalkRequest {
    pub(super) fn answer(&self, engine: &PageEngine) -> Result<Reply, Refused> {
        if self.workers == 0 || self.worker >= self.workers {
            return Err(Refused::new(format!(
                "worker {} of {} does not exist; count workers from 0",
                self.worker, self.workers
            )));
        }
        self.simulation.with(engine, |simulation, _, _| {
            if simulation.resolved() != Engine::Hybrid {
                return Ok(Reply::of(&WalkAnswer { walks: 0 }));
            }
            let saved = Saved::default();
            let units = Units::new(Box::new(saved.clone()), &[]);
            let cache = engine.cache.with(units.of_share(self.worker, self.workers));
            let walks = AtomicU64::new(0);
            simulation.run_with(&Control {
                parallel: engine.threads > 1,
                cancel: &engine.cancel,
                rays_done: &walks,
                cache: &cache,
            })?;
            cache.save_units()?;
            let walks = WalkAnswer {
                walks: walks.into_inner(),
            };
            Ok(Reply {
                data: saved.packed(),
                ..Reply::of(&walks)
            })
        })
    }
}

impl WedgeRequest {
    pub(super) fn answer(&self, engine: &PageEngine) -> Result<WedgeAnswer, Refused> {
        check(
            "thicknesses",
            self.thicknesses_cm.len() as u64,
            engine.limits.thicknesses as u64,
        )?;
        let is_increasing = self.thicknesses_cm.is_sorted_by(|a, b| a < b);
        if !is_increasing || self.thicknesses_cm.iter().any(|cm| !cm.is_finite()) {
            return Err(Refused::new(
                "thicknesses_cm must be finite and strictly increasing",
            ));
        }
        self.simulation.with(engine, |simulation, _, _| {
            let request = simulation.request();
            let fits = |cm: &&f64| {
                let thickness_m = [cm_to_m(**cm)];
                let request = Request {
                    thicknesses_m: &thickness_m,
                    ..request.clone()
                };
                let snowpack = request.snowpack;
                // the surface layer grows, from a layer of grains
                let least_m = snowpack.below_m() + snowpack.surface.sizes_m()[1];
                let room_m = snowpack.longest_grain_m() * MIN_GRAIN_LENGTHS;
                thickness_m[0] >= least_m.max(room_m)
                    && simulation.resolved().check(&request).is_ok()
            };
            let thicknesses_cm: Vec<f64> = self.thicknesses_cm.iter().filter(fits).copied().collect();
            if thicknesses_cm.is_empty() {
                return Err(Refused::new(
                    "no thickness of the wedge can have this snow; choose thicker snow, smaller grains or a higher sun",
                ));
            }
            let thicknesses_m: Vec<f64> = thicknesses_cm.iter().copied().map(cm_to_m).collect();
            let request = Request {
                thicknesses_m: &thicknesses_m,
                ..request.clone()
            };
            let cache = engine.cache.with(Units::default());
            let spectra = simulation.resolved().run(
                &request,
                &Control {
                    parallel: engine.threads > 1,
                    cancel: &engine.cancel,
                    rays_done: &AtomicU64::new(0),
                    cache: &cache,
                },
            )?;
            let rows = |part: fn(&Spectrum) -> &[Measured]| {
                spectra.iter().map(|spectrum| values(part(spectrum))).collect()
            };
            Ok(WedgeAnswer {
                wavelengths_nm: request.wavelengths_nm.to_vec(),
                thicknesses_cm,
                reflectance: rows(|spectrum| &spectrum.reflectance),
                transmittance: rows(|spectrum| &spectrum.transmittance),
            })
        })
    }
}

/// The systematic error of `engine` at each wavelength, which its standard errors do not include.
fn method_error(engine: Engine, request: &Request) -> Vec<f64> {
    let [_, visible, infrared] = engine.systematic_error(request);
    let error = |nm: &f64| match *nm > NEAR_INFRARED_NM {
        true => infrared,
        false => visible,
    };
    request.wavelengths_nm.iter().map(error).collect()
}

/// Units kept in memory.
#[derive(Debug, Clone, Default)]
struct Saved(Arc<Mutex<Vec<u8>>>);

impl Saved {
    /// The units, each after its length in four bytes, so that those of several workers can be
    /// joined.
    fn packed(&self) -> Vec<u8> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl UnitStore for Saved {
    fn append(&self, units: &[u8]) -> bool {
        let Ok(length) = u32::try_from(units.len()) else {
            return false;
        };
        let mut packed = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        packed.extend(length.to_le_bytes());
        packed.extend(units);
        true
    }
}

/// The units that [`Saved::packed`] packed, of any number of workers.
fn unpack(mut packed: &[u8]) -> Result<Vec<Vec<u8>>, Refused> {
    let mut units = Vec::new();
    while let Some((length, rest)) = packed.split_first_chunk() {
        let length = u32::from_le_bytes(*length) as usize;
        let Some((unit, rest)) = rest.split_at_checked(length) else {
            return Err(Refused::new(
                "the walks of the workers are cut short; try again",
            ));
        };
        units.push(unit.to_vec());
        packed = rest;
    }
    match packed {
        [] => Ok(units),
        _ => Err(Refused::new(
            "the walks of the workers are cut short; try again",
        )),
    }
}
