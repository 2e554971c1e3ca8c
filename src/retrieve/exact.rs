//! The optimum, checked and improved by the engine.
use std::sync::atomic::AtomicBool;

use splitsnow_retrieval::{Inverse, Optimum, Scratch};

use super::setup::Setup;
use super::{FileGrains, RetrieveError};
use crate::lookup::Database;
use crate::measurement::{Measured, Quantity};
use crate::parameter::{Parameter, Point};
use crate::simulation::{Simulation, default_rays};
use crate::transport::Illumination;
use crate::units::cm_to_m;

/// Largest number of simulations of the optimum.
const MOST_ROUNDS: usize = 4;
/// The optimum is final if it moves by less than this, in standard deviations.
const SHIFT: f64 = 0.1;

/// How the optimum is simulated.
#[derive(Debug, Clone, Copy)]
pub struct ExactOptions<'a> {
    /// Walks of each simulation; the grid's, but at least [`default_rays`], if `None`.
    pub rays: Option<u64>,
    /// Seed.
    pub seed: u64,
    /// Stops the run when it becomes true.
    pub cancel: Option<&'a AtomicBool>,
}

/// What the engine says about the optimum of the look-ups.
#[derive(Debug, Clone, PartialEq)]
pub struct ExactCheck {
    /// Number of simulations of the optimum, of all spectra together.
    pub rounds: usize,
    /// Walks of each.
    pub rays: u64,
    /// Largest difference between look-up and engine at the optimum of the look-ups, in standard
    /// deviations of the measured value.
    pub largest_sigma: f64,
    /// Root mean square of the same.
    pub rms_sigma: f64,
    /// How far the optimum moved, in posterior standard deviations of the unknown that moved most.
    pub moved_sd: f64,
    /// Whether the last step was below 0.1 standard deviations.
    pub settled: bool,
}

impl Setup {
    /// The differences engine - look-up at the optimum, for which the optimum is found again until
    /// it stays; with the check, and the last optimum.
    pub(super) fn exact(
        &self,
        database: &Database,
        first: Optimum,
        options: &ExactOptions<'_>,
    ) -> Result<(ExactCheck, Vec<f64>, Optimum), RetrieveError> {
        let grains = self
            .grains
            .as_ref()
            .ok_or(RetrieveError::NoGrains("--exact"))?;
        let run = &grains.grid().run;
        let usual = run.rays.max(default_rays(run.engine));
        let rays = options.rays.unwrap_or(usual);
        let zero = vec![0.0; self.values()];
        let sigmas = self.sigmas();
        let sd: Vec<f64> = {
            let covariance = first.covariance(&self.inverse(&zero));
            covariance.diagonal().iter().map(|v| v.sqrt()).collect()
        };
        let away = |a: &[f64], b: &[f64]| -> f64 {
            let moves = a
                .iter()
                .zip(b)
                .zip(&sd)
                .map(|((a, b), sd)| (a - b).abs() / sd);
            moves.fold(0.0, f64::max)
        };
        let begin = first.u.clone();
        let (mut optimum, mut offsets) = (first, zero.clone());
        let mut check = ExactCheck {
            rounds: 0,
            rays,
            largest_sigma: 0.0,
            rms_sigma: 0.0,
            moved_sd: 0.0,
            settled: false,
        };
        while check.rounds < MOST_ROUNDS && !check.settled {
            let inverse = self.inverse(&zero);
            let mut modelled = vec![0.0; self.values()];
            if !inverse.model(&optimum.u, &mut Scratch::default(), &mut modelled) {
                return Err(RetrieveError::NoSpectrum);
            }
            let exact = self.simulated(database, grains, &inverse, &optimum.u, rays, options)?;
            offsets = exact.iter().zip(&modelled).map(|(e, m)| e - m).collect();
            if check.rounds == 0 {
                let scaled = || {
                    offsets
                        .iter()
                        .zip(&sigmas)
                        .map(|(d, sigma)| (d / sigma).abs())
                };
                check.largest_sigma = scaled().fold(0.0, f64::max);
                let squares: f64 = scaled().map(|d| d * d).sum();
                check.rms_sigma = (squares / offsets.len() as f64).sqrt();
            }
            check.rounds += 1;
            let corrected = self.inverse(&offsets);
            let next = corrected.search(&optimum.u, &mut Scratch::default());
            let next = next.ok_or(RetrieveError::NoSpectrum)?;
            check.settled = away(&next.u, &optimum.u) < SHIFT;
            optimum = next;
        }
        check.moved_sd = away(&optimum.u, &begin);
        Ok((check, offsets, optimum))
    }

    /// The values of the engine at the places `u`.
    fn simulated(
        &self,
        database: &Database,
        grains: &FileGrains,
        inverse: &Inverse<'_>,
        u: &[f64],
        rays: u64,
        options: &ExactOptions<'_>,
    ) -> Result<Vec<f64>, RetrieveError> {
        let grid = grains.grid();
        let light = database.metadata().get("illumination");
        let is_diffuse = light.is_some_and(|light| light.starts_with("diffuse"));
        let mut values = Vec::with_capacity(self.values());
        for observation in inverse.observations() {
            let point: Point = inverse.point(observation, u);
            let snowpack = grid.snowpack(&point)?;
            let illumination = match is_diffuse {
                true => Illumination::Diffuse,
                false => Illumination::Collimated {
                    polar_angle_rad: point[Parameter::Incidence].to_radians(),
                },
            };
            let indices = observation.indices();
            let nm: Vec<f64> = match &self.bands {
                Some(_) => database.wavelengths_nm().to_vec(),
                None => indices.iter().map(|i| self.wavelengths_nm()[*i]).collect(),
            };
            let thickness_m = cm_to_m(point[Parameter::Thickness]);
            let mut simulation =
                Simulation::new(&snowpack, thickness_m, illumination, &nm, &grid.fixed.model)
                    .engine(grid.run.engine)
                    .rays(rays)
                    .seed(options.seed);
            if let Some(cancel) = options.cancel {
                simulation = simulation.cancel(cancel);
            }
            let spectrum = simulation.run()?;
            let found: &[Measured] = match observation.emulator().quantity() {
                Quantity::Reflectance => &spectrum.reflectance,
                Quantity::Transmittance => &spectrum.transmittance,
            };
            let found: Vec<f64> = found.iter().map(|measured| measured.value).collect();
            match &self.bands {
                Some(bands) => {
                    let averages = bands.averages().values(&found);
                    values.extend(indices.iter().map(|i| averages[*i]));
                }
                None => values.extend(found),
            }
        }
        Ok(values)
    }
}
