//! Fresh simulations of single snows, at some thicknesses and angles each.
use super::ErrorBudgetError;
use crate::budget;
use crate::engine::{Control, Engine, EngineError, Request};
use crate::grid::{Grid, Run};
use crate::measurement::Spectrum;
use crate::parameter::{Parameter, Point};
use crate::transport::{Illumination, Snowpack};
use crate::units::cm_to_m;

/// Thicknesses and angles of one snow.
#[derive(Debug, Clone, PartialEq)]
pub struct Patch {
    /// The snow, on all axes but thickness and incidence.
    pub snow: Point,
    /// Thicknesses, cm, strictly increasing.
    pub thickness_cm: Vec<f64>,
    /// Polar angles of incidence, degrees, strictly increasing.
    pub angle_deg: Vec<f64>,
}

/// How patches are simulated.
#[derive(Debug, Clone, Copy)]
pub struct Simulation<'a> {
    /// All but the axes and the run: laws of the grains, wavelengths, model.
    pub grid: &'a Grid,
    /// Walks per light and index node.
    pub rays: u64,
    /// Seed of its tables and walks.
    pub seed: u64,
}

impl Patch {
    /// Its points, angles running fastest.
    pub fn points(&self) -> impl Iterator<Item = Point> {
        self.thickness_cm.iter().flat_map(move |&thickness_cm| {
            let slab = self.snow.with(Parameter::Thickness, thickness_cm);
            let angles = self.angle_deg.iter();
            angles.map(move |&angle_deg| slab.with(Parameter::Incidence, angle_deg))
        })
    }

    /// How many points it has.
    #[must_use]
    pub fn len(&self) -> usize {
        self.thickness_cm.len() * self.angle_deg.len()
    }

    /// Whether it has none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A patch as an engine takes it.
struct Prepared {
    grid: Grid,
    snowpack: Snowpack,
    thicknesses_m: Vec<f64>,
    lights: Vec<Illumination>,
}

impl Prepared {
    /// What to ask the engine for, one after another, and the position of the first
    /// thickness and angle of each: all those at once that share their walks.
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

impl Simulation<'_> {
    /// One patch, with an engine that holds there: `hybrid`, or `spectral` where that
    /// refuses.
    fn prepared(&self, patch: &Patch) -> Result<Prepared, ErrorBudgetError> {
        let light = |deg: &f64| Illumination::Collimated {
            polar_angle_rad: deg.to_radians(),
        };
        let run = Run {
            engine: Engine::Hybrid,
            seed: self.seed,
            rays: self.rays,
            ..self.grid.run
        };
        let mut prepared = Prepared {
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

    /// Spectra of all points of all patches, in order.
    ///
    /// # Errors
    /// A point of a patch cannot be run, or the run was cancelled.
    pub fn run(
        &self,
        patches: &[Patch],
        control: &Control,
    ) -> Result<Vec<Vec<Spectrum>>, ErrorBudgetError> {
        let order: Vec<usize> = (0..patches.len()).collect();
        let all = self.run_some(patches, &order, control)?;
        let all: Option<Vec<_>> = all.into_iter().collect();
        all.ok_or(ErrorBudgetError::Cancelled)
    }

    /// The same, begun in this `order` of the patches' numbers; `None` of those that
    /// were not done when it was cancelled.
    ///
    /// # Errors
    /// A point of a patch cannot be run.
    pub fn run_some(
        &self,
        patches: &[Patch],
        order: &[usize],
        control: &Control,
    ) -> Result<Vec<Option<Vec<Spectrum>>>, ErrorBudgetError> {
        let one = |number: usize, patch: &Patch| {
            let prepared = self.prepared(patch)?;
            let engine = prepared.grid.run.engine;
            let mut spectra = vec![Spectrum::default(); patch.len()];
            for ([h, a], request) in prepared.requests(number as u64) {
                let found = engine.run(&request, control);
                let found = found.map_err(|source| match source {
                    EngineError::Cancelled => ErrorBudgetError::Cancelled,
                    source => self.failed(patch, source),
                })?;
                let lights = request.illuminations.len();
                for (i, spectrum) in found.into_iter().enumerate() {
                    let (row, column) = (i / lights, i % lights);
                    spectra[(h + row) * patch.angle_deg.len() + a + column] = spectrum;
                }
            }
            Ok(spectra)
        };
        let found = budget::in_order(order.len(), control.cancel, |place| {
            let number = order[place];
            match one(number, &patches[number]) {
                Err(ErrorBudgetError::Cancelled) => Ok::<_, ErrorBudgetError>(None),
                found => Ok(Some((number, found?))),
            }
        })?;
        let mut spectra = vec![None; patches.len()];
        for (number, found) in found.into_iter().flatten() {
            spectra[number] = Some(found);
        }
        Ok(spectra)
    }

    /// How many walks [`Simulation::run`] does.
    ///
    /// # Errors
    /// A point of a patch cannot be run.
    pub fn walks(&self, patches: &[Patch]) -> Result<u64, ErrorBudgetError> {
        let mut walks: u64 = 0;
        for patch in patches {
            let prepared = self.prepared(patch)?;
            for (_, request) in prepared.requests(0) {
                let one = prepared.grid.run.engine.walks(&request);
                let one = one.map_err(|source| self.failed(patch, source))?;
                walks = walks.saturating_add(one);
            }
        }
        Ok(walks)
    }

    fn failed(&self, patch: &Patch, source: EngineError) -> ErrorBudgetError {
        ErrorBudgetError::Engine {
            at: patch.snow.to_string(),
            source,
        }
    }
}
