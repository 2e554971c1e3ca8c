//! Fresh simulations of snow at some thicknesses and incidence angles.
use super::ErrorBudgetError;
use crate::budget;
use crate::engine::{Control, Engine, EngineError, Request};
use crate::grid::{Grid, Run};
use crate::measurement::Spectrum;
use crate::parameter::{Parameter, Point};
use crate::transport::{Illumination, Snowpack};
use crate::units::cm_to_m;

/// One snow at all combinations of some thicknesses and incidence angles.
#[derive(Debug, Clone, PartialEq)]
pub struct Patch {
    /// The snow: values on all axes but thickness and incidence angle.
    pub snow: Point,
    /// Thicknesses, cm, strictly increasing.
    pub thickness_cm: Vec<f64>,
    /// Incidence angles from the normal, degrees, strictly increasing.
    pub angle_deg: Vec<f64>,
}

/// The settings with which patches are simulated.
#[derive(Debug, Clone, Copy)]
pub struct PatchSimulation<'a> {
    /// Grain laws, wavelengths and model; its axes and run settings are not used.
    pub grid: &'a Grid,
    /// Rays per incidence angle and index node.
    pub rays: u64,
    /// Seed of the grain tables and walks.
    pub seed: u64,
}

impl Patch {
    /// The points of the patch; incidence angles vary fastest.
    pub fn points(&self) -> impl Iterator<Item = Point> {
        self.thickness_cm.iter().flat_map(move |&thickness_cm| {
            let slab = self.snow.with(Parameter::Thickness, thickness_cm);
            let angles = self.angle_deg.iter();
            angles.map(move |&angle_deg| slab.with(Parameter::Incidence, angle_deg))
        })
    }

    /// The number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.thickness_cm.len() * self.angle_deg.len()
    }

    /// Whether there are no points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A patch converted to the inputs of an engine.
struct PreparedPatch {
    grid: Grid,
    snowpack: Snowpack,
    thicknesses_m: Vec<f64>,
    lights: Vec<Illumination>,
}

impl PreparedPatch {
    /// The requests to the engine, each with the indices of its first thickness and incidence
    /// angle. A request includes all thicknesses and angles that share their walks.
    fn requests(&self, number: u64) -> impl Iterator<Item = ([usize; 2], Request<'_>)> {
        let engine = self.grid.run.engine;
        let slabs = match engine.shares_thicknesses() {
            true => self.thicknesses_m.len(),
            false => 1,
        };
        let angles = match engine.shares_angles() {
            true => self.lights.len(),
            false => 1,
        };
        let blocks = (0..self.thicknesses_m.len()).step_by(slabs.max(1));
        let blocks = blocks.flat_map(move |h| {
            let blocks = (0..self.lights.len()).step_by(angles.max(1));
            blocks.map(move |a| [h, a])
        });
        let blocks: Vec<_> = blocks.collect();
        let first = number * blocks.len() as u64;
        blocks.into_iter().zip(first..).map(move |([h, a], cell)| {
            let slabs = &self.thicknesses_m[h..h + slabs];
            let lights = &self.lights[a..a + angles];
            (
                [h, a],
                self.grid.request(&self.snowpack, slabs, lights, cell),
            )
        })
    }
}

impl PatchSimulation<'_> {
    /// Prepares a patch for `hybrid`, or for `spectral` where `hybrid` refuses the patch.
    fn prepared(&self, patch: &Patch) -> Result<PreparedPatch, ErrorBudgetError> {
        let light = |deg: &f64| Illumination::Collimated {
            polar_angle_rad: deg.to_radians(),
        };
        let run = Run {
            engine: Engine::Hybrid,
            seed: self.seed,
            rays: self.rays,
            ..self.grid.run
        };
        let mut prepared = PreparedPatch {
            snowpack: self.grid.snowpack(&patch.snow)?,
            thicknesses_m: patch.thickness_cm.iter().map(|cm| cm_to_m(*cm)).collect(),
            lights: patch.angle_deg.iter().map(light).collect(),
            grid: Grid {
                run,
                ..self.grid.clone()
            },
        };
        let refused = |(_, request): (_, Request<'_>)| Engine::Hybrid.check(&request).is_err();
        if prepared.requests(0).any(refused) {
            prepared.grid.run.engine = Engine::Spectral;
        }
        Ok(prepared)
    }

    /// Simulates all patches. Returns the spectra of the points of each patch, in order.
    ///
    /// # Errors
    /// If a point cannot be simulated, or `control` is cancelled.
    pub fn run(
        &self,
        patches: &[Patch],
        control: &Control,
    ) -> Result<Vec<Vec<Spectrum>>, ErrorBudgetError> {
        let order: Vec<usize> = (0..patches.len()).collect();
        let spectra = self.run_in_order(patches, &order, control)?;
        let spectra: Option<Vec<_>> = spectra.into_iter().collect();
        spectra.ok_or(ErrorBudgetError::Cancelled)
    }

    /// Simulates the patches with the indices `order`, in that order. Returns `None` for the
    /// patches that had not ended when `control` was cancelled.
    ///
    /// # Errors
    /// If a point cannot be simulated.
    pub fn run_in_order(
        &self,
        patches: &[Patch],
        order: &[usize],
        control: &Control,
    ) -> Result<Vec<Option<Vec<Spectrum>>>, ErrorBudgetError> {
        let run_patch = |number: usize, patch: &Patch| {
            let prepared = self.prepared(patch)?;
            let engine = prepared.grid.run.engine;
            let mut spectra = vec![Spectrum::default(); patch.len()];
            for ([h, a], request) in prepared.requests(number as u64) {
                let results = engine.run(&request, control);
                let results = results.map_err(|source| match source {
                    EngineError::Cancelled => ErrorBudgetError::Cancelled,
                    source => self.failed(patch, source),
                })?;
                let lights = request.illuminations.len();
                for (i, spectrum) in results.into_iter().enumerate() {
                    let (row, column) = (i / lights, i % lights);
                    spectra[(h + row) * patch.angle_deg.len() + a + column] = spectrum;
                }
            }
            Ok(spectra)
        };
        let results = budget::par_map_in_order(order.len(), control.cancel, |place| {
            let number = order[place];
            match run_patch(number, &patches[number]) {
                Err(ErrorBudgetError::Cancelled) => Ok::<_, ErrorBudgetError>(None),
                result => Ok(Some((number, result?))),
            }
        })?;
        let mut spectra = vec![None; patches.len()];
        for (number, result) in results.into_iter().flatten() {
            spectra[number] = Some(result);
        }
        Ok(spectra)
    }

    /// The number of walks that [`PatchSimulation::run`] simulates.
    ///
    /// # Errors
    /// If a point cannot be simulated.
    pub fn walks(&self, patches: &[Patch]) -> Result<u64, ErrorBudgetError> {
        let mut walks: u64 = 0;
        for patch in patches {
            let prepared = self.prepared(patch)?;
            for (_, request) in prepared.requests(0) {
                let patch_walks = prepared.grid.run.engine.walks(&request);
                let patch_walks = patch_walks.map_err(|source| self.failed(patch, source))?;
                walks = walks.saturating_add(patch_walks);
            }
        }
        Ok(walks)
    }

    /// The error of an engine on `patch`.
    fn failed(&self, patch: &Patch, source: EngineError) -> ErrorBudgetError {
        ErrorBudgetError::Engine {
            snow: patch.snow.to_string(),
            source,
        }
    }
}
