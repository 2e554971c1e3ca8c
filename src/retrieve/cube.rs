//! Thousands of spectra with the same unknowns, such as the pixels of an image.
use rayon::prelude::*;
use splitsnow_retrieval::{
    Emulator, Inverse, NoiseModel, Observation, Optimum, Posterior, Scratch, StartTable, Unknown,
    Whitening,
};

use super::knowledge::{FreeParameter, KnownValue, Named};
use super::setup::{Knowledge, unknowns, with_single_nodes};
use super::{EmulatorError, FileGrains, MeasuredBands, RetrieveError};
use crate::grain::SizeMeasure;
use crate::lookup::Database;
use crate::measurement::Quantity;
use crate::parameter::{Parameter, Point};
use crate::units::HALF_SPACE_CM;

/// How the intervals of each spectrum are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CubeIntervals {
    /// From the derivatives at the optimum (Laplace), cut off at the ends of the ranges.
    Laplace,
    /// From the distribution on a grid, for at most four unknowns; Laplace where there would be
    /// too many cells.
    Grid,
}

/// What a [`Cube`] is made of.
#[derive(Debug, Clone)]
pub struct CubeRequest<'a> {
    /// The compact file.
    pub database: &'a Database,
    /// What was measured.
    pub quantity: Quantity,
    /// Indices of the wavelengths of the file, or of the bands, that have values, increasing.
    pub indices: Vec<usize>,
    /// The bands whose averages were measured; `None` for spectra.
    pub bands: Option<&'a MeasuredBands>,
    /// Priors, as in [`super::SetupRequest`].
    pub free: &'a [FreeParameter],
    /// Values that are known for all spectra.
    pub fix: &'a [KnownValue],
    /// Axes of which each spectrum has its own known value, with these values.
    pub varying: Vec<(Named, Vec<f64>)>,
    /// Errors of the measurements.
    pub noise: NoiseModel,
}

/// A problem for many spectra.
#[derive(Debug, Clone)]
pub struct Cube {
    unknowns: Vec<Unknown>,
    grains: Option<FileGrains>,
    emulator: Emulator,
    emulator_sd: Vec<f64>,
    indices: Vec<usize>,
    wavelengths_nm: Vec<f64>,
    point: Point,
    varying: Vec<(Parameter, Vec<f64>)>,
    noise: NoiseModel,
}

/// The snow of one spectrum.
#[derive(Debug, Clone, PartialEq)]
pub struct SpectrumRow {
    /// Most probable values, by name as [`Cube::names`].
    pub best: Vec<f64>,
    /// Ends of the central 68 %.
    pub p68: Vec<[f64; 2]>,
    /// Ends of the central 95 %.
    pub p95: Vec<[f64; 2]>,
    /// Covariance of the unknowns (Laplace), row by row.
    pub covariance: Vec<f64>,
    /// Chi-square of the measured values.
    pub chi_square: f64,
    /// Whether the search ended.
    pub converged: bool,
    /// Fitted values.
    pub fitted: Vec<f64>,
    /// Derivatives of the fitted values with the unknowns, `[unknown][value]`; empty unless
    /// asked for.
    pub jacobian: Vec<f64>,
}

/// The snow of each spectrum.
pub type CubeResult = Vec<SpectrumRow>;

impl Cube {
    /// Joins the parts of `request`.
    ///
    /// # Errors
    /// As [`super::Setup::new`].
    pub fn new(request: CubeRequest<'_>) -> Result<Self, RetrieveError> {
        let database = request.database;
        database.require_hemispherical()?;
        let grains = FileGrains::of(database);
        let knowledge = Knowledge::new(database, grains.as_ref());
        let mut point = Point::default();
        knowledge.fix(&mut point, request.fix)?;
        let emulator = Emulator::new(database, request.quantity, point)?;
        let mut known = point;
        let mut varying = Vec::new();
        for (named, values) in request.varying {
            let Named::Axis(parameter) = named else {
                return Err(RetrieveError::Knowledge(format!(
                    "{} must be one number; give grain_size_um for each spectrum instead",
                    named.name()
                )));
            };
            let stored = |value: &f64| match parameter {
                Parameter::Thickness => value.min(HALF_SPACE_CM),
                _ => *value,
            };
            let values: Vec<f64> = values.iter().map(stored).collect();
            let ends = [
                values.iter().copied().fold(f64::INFINITY, f64::min),
                values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            ];
            for value in ends {
                knowledge.fix(&mut Point::default(), &[KnownValue { named, value }])?;
            }
            if known.get(parameter).is_some() {
                return Err(RetrieveError::Knowledge(format!(
                    "{} is given twice; remove one of them",
                    parameter.key()
                )));
            }
            known.set(parameter, ends[0]);
            varying.push((parameter, values));
        }
        let (unknowns, _) = unknowns(
            &knowledge,
            request.free,
            &with_single_nodes(database, known),
        )?;
        let mut error = EmulatorError::of(database, request.quantity);
        let emulator = match request.bands {
            None => emulator,
            Some(bands) => bands.averaged(emulator, &mut error),
        };
        let nm = request.indices.iter();
        Ok(Self {
            wavelengths_nm: nm.map(|i| emulator.wavelengths_nm()[*i]).collect(),
            emulator_sd: request.indices.iter().map(|i| error.sd[*i]).collect(),
            unknowns,
            grains,
            emulator,
            indices: request.indices,
            point: with_single_nodes(database, point),
            varying,
            noise: request.noise,
        })
    }

    /// The measures of the grains that follow from the unknowns.
    fn measures(&self) -> &'static [SizeMeasure] {
        let mut parameters = self.unknowns.iter().map(Unknown::parameter);
        match self.grains.is_some() && parameters.any(|p| p == Parameter::GrainSize) {
            true => &[SizeMeasure::SpecificSurface, SizeMeasure::OpticalRadius],
            false => &[],
        }
    }

    /// Names of the results of each spectrum: specific surface area and optical radius, if the
    /// file states its grains, then the unknowns.
    #[must_use]
    pub fn names(&self) -> Vec<&'static str> {
        let measures = self.measures().iter().map(|measure| measure.name());
        let unknowns = self.unknowns.iter().map(|u| u.parameter().key());
        measures.chain(unknowns).collect()
    }

    /// Number of unknowns.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.unknowns.len()
    }

    fn whitening(&self, sigma: &[f64]) -> Result<Whitening, RetrieveError> {
        let found = Whitening::new(&self.wavelengths_nm, sigma, &self.emulator_sd, &self.noise);
        found.ok_or(RetrieveError::Noise)
    }

    /// The known values of spectrum `number`.
    fn known(&self, number: usize) -> Point {
        let mut point = self.point;
        for (parameter, values) in &self.varying {
            point.set(*parameter, values[number]);
        }
        point
    }

    /// Finds the snow of each of `spectra`, rows of as many values as wavelengths, on the current
    /// thread pool. `sigma` holds the standard deviation of each value, if it is stated. A
    /// spectrum that is not finite gives NaN.
    ///
    /// # Errors
    /// [`RetrieveError::Noise`] if the errors give no covariance.
    pub fn solve(
        &self,
        spectra: &[f64],
        sigma: Option<&[f64]>,
        intervals: CubeIntervals,
        with_jacobian: bool,
    ) -> Result<CubeResult, RetrieveError> {
        let n = self.indices.len();
        let shared = self.whitening(&vec![self.noise.value; n])?;
        // the coarse grid is shared if the known values are
        let table = self.varying.is_empty().then(|| {
            let blank = self.observation(&shared, self.point, vec![0.5; n]);
            StartTable::new(&Inverse::new(&self.unknowns, vec![blank]))
        });
        let rows: Vec<&[f64]> = spectra.chunks_exact(n.max(1)).collect();
        let solve = |scratch: &mut Scratch, (number, row): (usize, &&[f64])| {
            let own = match sigma {
                Some(sigma) => Some(self.whitening(&sigma[number * n..(number + 1) * n])?),
                None => None,
            };
            let whitening = own.as_ref().unwrap_or(&shared);
            if !row.iter().all(|value| value.is_finite()) {
                return Ok(self.missing(with_jacobian));
            }
            let known = self.known(number);
            let observation = self.observation(whitening, known, row.to_vec());
            let inverse = Inverse::new(&self.unknowns, vec![observation]);
            let optimum = match &table {
                Some(table) => inverse.best_from(table, scratch),
                None => inverse.best(),
            };
            Ok(match optimum {
                Some(optimum) => self.row(
                    &inverse,
                    &optimum,
                    &known,
                    (intervals, with_jacobian),
                    scratch,
                ),
                None => self.missing(with_jacobian),
            })
        };
        rows.par_iter()
            .enumerate()
            .map_init(Scratch::default, solve)
            .collect()
    }

    fn observation<'a>(
        &'a self,
        whitening: &'a Whitening,
        point: Point,
        values: Vec<f64>,
    ) -> Observation<'a> {
        Observation::new(&self.emulator, whitening, &self.indices, point, values)
    }

    fn missing(&self, with_jacobian: bool) -> SpectrumRow {
        let (names, d, n) = (self.names().len(), self.unknowns.len(), self.indices.len());
        let jacobian = if with_jacobian { d * n } else { 0 };
        SpectrumRow {
            best: vec![f64::NAN; names],
            p68: vec![[f64::NAN; 2]; names],
            p95: vec![[f64::NAN; 2]; names],
            covariance: vec![f64::NAN; d * d],
            chi_square: f64::NAN,
            converged: false,
            fitted: vec![f64::NAN; n],
            jacobian: vec![f64::NAN; jacobian],
        }
    }

    fn row(
        &self,
        inverse: &Inverse<'_>,
        optimum: &Optimum,
        known: &Point,
        (intervals, with_jacobian): (CubeIntervals, bool),
        scratch: &mut Scratch,
    ) -> SpectrumRow {
        let (u, d) = (&optimum.u, self.unknowns.len());
        let covariance = optimum.covariance(inverse);
        let slopes: Vec<f64> = self
            .unknowns
            .iter()
            .zip(u)
            .map(|(k, u)| k.slope(*u))
            .collect();
        let scaled = (0..d * d).map(|k| {
            let (i, j) = (k / d, k % d);
            covariance[(i, j)] * slopes[i] * slopes[j]
        });
        let posterior = match intervals {
            CubeIntervals::Grid => Posterior::grid(inverse, optimum),
            CubeIntervals::Laplace => None,
        };
        let point = |u: &[f64]| {
            let mut point = *known;
            for (unknown, u) in self.unknowns.iter().zip(u) {
                point.set(unknown.parameter(), unknown.value(*u));
            }
            point
        };
        let size = self
            .unknowns
            .iter()
            .position(|k| k.parameter() == Parameter::GrainSize);
        let value = |name: usize, u: &[f64]| {
            let measures = self.measures();
            match (measures.get(name), &self.grains) {
                (Some(measure), Some(grains)) => grains.measure(*measure, &point(u)),
                _ => {
                    let i = name - measures.len();
                    self.unknowns[i].value(u[i])
                }
            }
        };
        let names = self.measures().len() + d;
        // along the unknown that the quantity depends on
        let ends = |name: usize, mass: f64| {
            let measures = self.measures().len();
            let i = if name < measures {
                size.unwrap_or(0)
            } else {
                name - measures
            };
            let [a, b] = optimum.interval(inverse, i, mass).map(|end| {
                let mut moved = u.clone();
                moved[i] = end;
                value(name, &moved)
            });
            [a.min(b), a.max(b)]
        };
        let interval = |name: usize| match &posterior {
            Some(posterior) => {
                let found = posterior.interval(|u| value(name, u));
                (found.p68, found.p95)
            }
            None => (ends(name, 0.68), ends(name, 0.95)),
        };
        let (p68, p95) = (0..names).map(interval).unzip();
        let mut fitted = vec![0.0; self.indices.len()];
        inverse.model(u, scratch, &mut fitted);
        let jacobian = match with_jacobian {
            true => inverse.sensitivity(u, scratch),
            false => None,
        };
        SpectrumRow {
            best: (0..names).map(|name| value(name, u)).collect(),
            p68,
            p95,
            covariance: scaled.collect(),
            chi_square: optimum.chi_square,
            converged: optimum.converged,
            fitted,
            jacobian: jacobian.map_or_else(Vec::new, |j| j.as_slice().to_vec()),
        }
    }
}
