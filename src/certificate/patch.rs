//! Fresh simulations of single snows, at some thicknesses and angles each.
use super::CertificateError;
use crate::budget;
use crate::engine::{Control, Engine, EngineError, Request};
use crate::grid::{Grid, Run};
use crate::measurement::Spectrum;
use crate::parameter::{Axes, Parameter, Point};

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

impl Simulation<'_> {
    /// The grid of one patch, with an engine that holds there: `doubling`, or
    /// `spectral` where that refuses.
    fn grid(&self, patch: &Patch, number: u64) -> Result<Grid, CertificateError> {
        let mut axes: Axes = patch
            .snow
            .iter()
            .map(|(parameter, value)| (parameter, vec![value]))
            .collect();
        axes.set(Parameter::Thickness, patch.thickness_cm.clone());
        axes.set(Parameter::Incidence, patch.angle_deg.clone());
        let mut grid = Grid {
            axes,
            given_sizes: None,
            run: Run {
                engine: Engine::Doubling,
                seed: self.seed,
                rays: self.rays,
                ..self.grid.run
            },
            ..self.grid.clone()
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
                let [h, a] = [Parameter::Thickness, Parameter::Incidence]
                    .map(|parameter| jobs.nodes(number_of_job, parameter));
                let (h, a) = (h?.start, a?.start);
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
