//! Fresh simulations of single snows, at some thicknesses and angles each.
use super::CertificateError;
use crate::budget;
use crate::engine::{Control, Engine, EngineError, Request};
use crate::grid::{Axes, Conditions, Grid, Run};
use crate::lookup::Point;
use crate::measurement::Spectrum;

/// Thicknesses and angles of one snow.
#[derive(Debug, Clone, PartialEq)]
pub struct Patch {
    /// Mean facetness, mean grain size, um, and density, kg/m3.
    pub snow: [f64; 3],
    /// Thicknesses, cm, strictly increasing.
    pub thickness_cm: Vec<f64>,
    /// Polar angles of incidence, degrees, strictly increasing.
    pub angle_deg: Vec<f64>,
    /// Values on the axes beyond the five.
    pub conditions: Conditions,
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
        let [facetness, grain_size_um, density_kg_m3] = self.snow;
        self.thickness_cm.iter().flat_map(move |&thickness_cm| {
            self.angle_deg.iter().map(move |&angle_deg| Point {
                facetness,
                grain_size_um,
                density_kg_m3,
                thickness_cm,
                angle_deg,
            })
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

impl Simulation<'_> {
    /// The grid of one patch, with an engine that holds there: `doubling`, or
    /// `spectral` where that refuses.
    fn grid(&self, patch: &Patch, number: u64) -> Result<Grid, CertificateError> {
        let [facetness, grain_size_um, density_kg_m3] = patch.snow.map(|value| vec![value]);
        let mut grid = Grid {
            axes: Axes {
                facetness,
                grain_size_um,
                density_kg_m3,
                thickness_cm: patch.thickness_cm.clone(),
                angle_deg: patch.angle_deg.clone(),
                ..Axes::default()
            },
            run: Run {
                engine: Engine::Doubling,
                seed: self.seed,
                rays: self.rays,
                ..self.grid.run
            },
            ..self.grid.at(&patch.conditions)?
        };
        grid.fixed.diffuse = false;
        let job = grid.job(&grid.jobs()?, 0)?;
        let request = Request {
            cell: number,
            ..job.request(&grid)
        };
        if Engine::Doubling.check(&request).is_err() {
            grid.run.engine = Engine::Spectral;
        }
        Ok(grid)
    }

    /// Spectra of all points of all patches, in order.
    ///
    /// # Errors
    /// A point of a patch cannot be run, or the run was cancelled.
    pub fn run(
        &self,
        patches: &[Patch],
        control: &Control,
    ) -> Result<Vec<Vec<Spectrum>>, CertificateError> {
        let order: Vec<usize> = (0..patches.len()).collect();
        let all = self.run_some(patches, &order, control)?;
        let all: Option<Vec<_>> = all.into_iter().collect();
        all.ok_or(CertificateError::Cancelled)
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
    ) -> Result<Vec<Option<Vec<Spectrum>>>, CertificateError> {
        let one = |number: usize, patch: &Patch| {
            let grid = self.grid(patch, number as u64)?;
            let jobs = grid.jobs()?;
            let mut spectra = vec![Spectrum::default(); patch.len()];
            for number_of_job in 0..jobs.count() {
                let job = grid.job(&jobs, number_of_job)?;
                let request = Request {
                    cell: number as u64 * jobs.count() + number_of_job,
                    ..job.request(&grid)
                };
                let found = grid.run.engine.run(&request, control);
                let found = found.map_err(|source| match source {
                    EngineError::Cancelled => CertificateError::Cancelled,
                    source => CertificateError::Engine {
                        at: job.to_string(),
                        source,
                    },
                })?;
                let [.., h, a] = jobs.origin(number_of_job)?.map(|i| i as usize);
                for (i, spectrum) in found.into_iter().enumerate() {
                    let (row, column) = (i / job.angles_deg.len(), i % job.angles_deg.len());
                    spectra[(h + row) * patch.angle_deg.len() + a + column] = spectrum;
                }
            }
            Ok(spectra)
        };
        let found = budget::in_order(order.len(), control.cancel, |place| {
            let number = order[place];
            match one(number, &patches[number]) {
                Err(CertificateError::Cancelled) => Ok::<_, CertificateError>(None),
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
    pub fn walks(&self, patches: &[Patch]) -> Result<u64, CertificateError> {
        let mut walks: u64 = 0;
        for patch in patches {
            let grid = self.grid(patch, 0)?;
            let jobs = grid.jobs()?;
            for number in 0..jobs.count() {
                let job = grid.job(&jobs, number)?;
                let one = grid.run.engine.walks(&job.request(&grid));
                let one = one.map_err(|source| CertificateError::Engine {
                    at: job.to_string(),
                    source,
                })?;
                walks = walks.saturating_add(one);
            }
        }
        Ok(walks)
    }
}
