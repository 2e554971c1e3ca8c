//! Fresh simulations of single points, with random streams of their own.
use super::VerifyError;
use crate::budget;
use crate::engine::{Control, EngineError, Request};
use crate::grid::Grid;
use crate::measurement::Spectrum;
use crate::parameter::{Parameter, Point};
use crate::transport::{Illumination, Snowpack};
use crate::units::cm_to_m;

/// Points to simulate, each with `parts` independent simulations of `rays` rays.
pub(super) struct Simulations {
    pub(super) points: Vec<Point>,
    pub(super) parts: u64,
    pub(super) rays: u64,
    pub(super) seed: u64,
}

impl Simulations {
    /// The number of walks of all simulations.
    pub(super) fn walks(&self, grid: &Grid) -> Result<u64, VerifyError> {
        let mut walks: u64 = 0;
        for point in &self.points {
            let prepared = PreparedPoint::new(grid, *point)?;
            let walks_of_part = grid.run.engine.walks(&self.request(grid, &prepared, 0));
            let walks_of_part = walks_of_part.map_err(|source| prepared.error(source))?;
            walks = walks.saturating_add(walks_of_part.saturating_mul(self.parts));
        }
        Ok(walks)
    }

    /// The spectra, `[point][part]`; `None` for points that had not ended when `control` was
    /// cancelled.
    pub(super) fn run(
        &self,
        grid: &Grid,
        control: &Control<'_>,
    ) -> Result<Vec<Option<Vec<Spectrum>>>, VerifyError> {
        let prepared: Result<Vec<_>, _> = self
            .points
            .iter()
            .map(|point| PreparedPoint::new(grid, *point))
            .collect();
        let prepared = prepared?;
        let requests: Vec<_> = (0_u64..)
            .zip(
                prepared
                    .iter()
                    .flat_map(|p| (0..self.parts).map(move |_| p)),
            )
            .collect();
        let simulate = |(number, point): (u64, &PreparedPoint)| {
            let spectra = grid
                .run
                .engine
                .run(&self.request(grid, point, number), control);
            let mut spectra = spectra.map_err(|source| point.error(source))?;
            // One thickness gives one spectrum.
            Ok(spectra.pop().unwrap_or_default())
        };
        let spectra =
            budget::par_map_in_order(requests.len(), control.cancel, |i| {
                match simulate(requests[i]) {
                    Err(VerifyError::Cancelled) => Ok(None),
                    result => result.map(Some),
                }
            })?;
        let parts = self.parts.max(1) as usize;
        let points = spectra.chunks(parts);
        Ok(points
            .map(|parts| parts.iter().cloned().collect())
            .collect())
    }

    /// The request to the engine for simulation `number`.
    fn request<'a>(&self, grid: &'a Grid, point: &'a PreparedPoint, number: u64) -> Request<'a> {
        Request {
            rays: self.rays,
            seed: self.seed,
            ..point.request(grid, number)
        }
    }
}

/// A point converted to the inputs of an engine.
pub(super) struct PreparedPoint {
    /// The point as text, for messages.
    at: String,
    snowpack: Snowpack,
    thickness_m: [f64; 1],
    light: [Illumination; 1],
}

impl PreparedPoint {
    pub(super) fn new(grid: &Grid, point: Point) -> Result<Self, VerifyError> {
        Ok(Self {
            at: point.to_string(),
            snowpack: grid.snowpack(&point)?,
            thickness_m: [cm_to_m(point[Parameter::Thickness])],
            light: [Illumination::Collimated {
                polar_angle_rad: point[Parameter::Incidence].to_radians(),
            }],
        })
    }

    /// The request to an engine, with the random streams of `cell`.
    pub(super) fn request<'a>(&'a self, grid: &'a Grid, cell: u64) -> Request<'a> {
        grid.request(&self.snowpack, &self.thickness_m, &self.light, cell)
    }

    pub(super) fn error(&self, source: EngineError) -> VerifyError {
        match source {
            EngineError::Cancelled => VerifyError::Cancelled,
            source => VerifyError::Engine {
                point: self.at.clone(),
                source,
            },
        }
    }
}
