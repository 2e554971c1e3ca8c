//! Fresh simulations of single points, with streams of their own.
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use sha2::{Digest, Sha256};

use super::{Subject, VerifyError};
use crate::budget;
use crate::engine::{Control, EngineError, Request};
use crate::grid::Grid;
use crate::measurement::Spectrum;
use crate::parameter::{Parameter, Point};
use crate::transport::{Illumination, Snowpack};
use crate::units::cm_to_m;

/// Points to simulate, each in `parts` independent parts of `rays` rays.
pub(super) struct Simulations {
    pub(super) points: Vec<Point>,
    pub(super) parts: u64,
    pub(super) rays: u64,
    pub(super) seed: u64,
}

/// Random numbers of the verification: a function of the seed and of what
/// they are for, and by their hash none of those that made the database.
pub(super) fn random(subject: &Subject<'_>, purpose: &str) -> Xoshiro256PlusPlus {
    let mut hash = Sha256::new();
    hash.update(b"splitsnow verify 1 ");
    hash.update(purpose);
    hash.update(subject.options.seed.to_le_bytes());
    Xoshiro256PlusPlus::from_seed(hash.finalize().into())
}

impl Simulations {
    /// Walks of all of them.
    pub(super) fn walks(&self, grid: &Grid) -> Result<u64, VerifyError> {
        let mut walks: u64 = 0;
        for point in &self.points {
            let cell = Cell::new(grid, *point)?;
            let one = grid.run.engine.walks(&self.request(grid, &cell, 0));
            let one = one.map_err(|source| cell.error(source))?;
            walks = walks.saturating_add(one.saturating_mul(self.parts));
        }
        Ok(walks)
    }

    /// Their spectra, [point][part]; of the points that were done when it was cancelled.
    pub(super) fn run(
        &self,
        grid: &Grid,
        control: &Control<'_>,
    ) -> Result<Vec<Option<Vec<Spectrum>>>, VerifyError> {
        let cells: Result<Vec<_>, _> = self
            .points
            .iter()
            .map(|point| Cell::new(grid, *point))
            .collect();
        let cells = cells?;
        let requests: Vec<_> = (0_u64..)
            .zip(cells.iter().flat_map(|c| (0..self.parts).map(move |_| c)))
            .collect();
        let one = |(number, cell): (u64, &Cell)| {
            let spectra = grid
                .run
                .engine
                .run(&self.request(grid, cell, number), control);
            let mut spectra = spectra.map_err(|source| cell.error(source))?;
            // One thickness, one spectrum.
            Ok(spectra.pop().unwrap_or_default())
        };
        let spectra =
            budget::in_order(requests.len(), control.cancel, |i| match one(requests[i]) {
                Err(VerifyError::Cancelled) => Ok(None),
                found => found.map(Some),
            })?;
        let parts = self.parts.max(1) as usize;
        let points = spectra.chunks(parts);
        Ok(points
            .map(|parts| parts.iter().cloned().collect())
            .collect())
    }

    fn request<'a>(&self, grid: &'a Grid, cell: &'a Cell, number: u64) -> Request<'a> {
        Request {
            rays: self.rays,
            seed: self.seed,
            ..grid.request(&cell.snowpack, &cell.thickness_m, &cell.light, number)
        }
    }
}

/// One point to simulate.
struct Cell {
    /// Where, for messages.
    at: String,
    snowpack: Snowpack,
    thickness_m: [f64; 1],
    light: [Illumination; 1],
}

impl Cell {
    fn new(grid: &Grid, point: Point) -> Result<Self, VerifyError> {
        Ok(Self {
            at: point.to_string(),
            snowpack: grid.snowpack(&point)?,
            thickness_m: [cm_to_m(point[Parameter::Thickness])],
            light: [Illumination::Collimated {
                polar_angle_rad: point[Parameter::Incidence].to_radians(),
            }],
        })
    }

    fn error(&self, source: EngineError) -> VerifyError {
        match source {
            EngineError::Cancelled => VerifyError::Cancelled,
            source => VerifyError::Engine {
                point: self.at.clone(),
                source,
            },
        }
    }
}
