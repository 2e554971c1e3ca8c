//! Errors of compression against what a compact file costs: components, bytes,
//! and the time to rebuild a spectrum, in each of the file's variants.
use std::hint::black_box;
use std::path::PathBuf;

use cpu_time::ThreadTime;
use ndarray::{Array2, Axis};

use super::measure::{Bench, Tables};
use super::truth::values;
use super::{Setting, TradeoffError};
use crate::colour::Colorimeter;
use crate::compress::{
    Bands, Basis, Bounds, Choice, CompressError, DEFAULT_MAX_DELTA_E, ErrorRow, Model, Precision,
};
use crate::engine::{EngineError, Resolution};
use crate::grid::{Compression, Grid, existing};
use crate::lookup::add_component;
use crate::measurement::Quantity;
use crate::store::{Store, Variable};

/// Components of the last row, if there are as many.
const MOST: usize = 8;
/// Rays per curve, of a grid in memory, for each CPU second of the budget: at
/// most its own number.
const RAYS_PER_SECOND: f64 = 4.0;
/// Rebuilding is timed in so many passes, of which the fastest counts...
const PASSES: u32 = 9;
/// ... each of at least so many CPU seconds.
const PASS: f64 = 0.002;

/// The curves to compress.
#[derive(Debug)]
pub enum Source {
    /// A finished database, by its output directory.
    Database(PathBuf),
    /// A grid, simulated now.
    Grid(Box<Grid>),
}

/// A variant of the compact file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Coding {
    /// Components of the spectra, f32: that of Varsa 2025.
    Linear,
    /// Components of the logarithm, f32.
    Log,
    /// Likewise, f16.
    LogHalf,
    /// Likewise, integers of 16 bits.
    LogIntegers,
    /// Likewise, integers of 8 bits where Delta-E stays below the usual bound.
    LogNarrow,
}

impl Coding {
    /// All there are.
    pub const ALL: [Self; 5] = [
        Self::Linear,
        Self::Log,
        Self::LogHalf,
        Self::LogIntegers,
        Self::LogNarrow,
    ];

    /// What the components are of.
    #[must_use]
    pub fn basis(self) -> Basis {
        match self {
            Self::Linear => Basis::Linear,
            _ => Basis::Log,
        }
    }

    /// The precision's name in files of results.
    #[must_use]
    pub fn precision(self) -> &'static str {
        match self {
            Self::LogIntegers => "quantised_16",
            other => other.stored().name(),
        }
    }

    fn stored(self) -> Precision {
        match self {
            Self::Linear | Self::Log => Precision::F32,
            Self::LogHalf => Precision::F16,
            Self::LogIntegers | Self::LogNarrow => Precision::Quantised,
        }
    }
}

/// Errors and costs with one number of components of one quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct Components {
    /// The quantity.
    pub quantity: Quantity,
    /// The variant.
    pub coding: Coding,
    /// Their number.
    pub components: usize,
    /// Bytes of the quantity's coefficients and basis, as a compact file holds them.
    pub bytes: u64,
    /// CPU seconds to rebuild one spectrum.
    pub cpu_seconds: f64,
    /// Mean and largest RMSE over the curves.
    pub rmse: [f64; 2],
    /// Mean and largest Delta-E; `None` without visible wavelengths.
    pub delta_e: Option<[f64; 2]>,
}

/// Curves per quantity, `[curve, wavelength]`, and their wavelengths.
struct Curves {
    nm: Vec<f64>,
    of: Vec<(Quantity, Array2<f64>)>,
}

/// Rows per quantity for 1, 2, ... components.
pub(super) fn measure(
    bench: &Bench,
    source: &Source,
    say: &dyn Fn(&str),
) -> Result<Vec<Components>, TradeoffError> {
    say("curves to compress");
    let curves = match source {
        Source::Database(folder) => stored(&Store::open(folder)?)?,
        Source::Grid(grid) => simulated(bench, grid)?,
    };
    let colour = Colorimeter::new(&curves.nm)?;
    let usual = Choice::Bounds(Compression {
        max_delta_e: DEFAULT_MAX_DELTA_E,
        max_rmse: None,
    });
    let bands = Bands::default();
    let bounds = usual.bounds(colour.is_some(), &bands);
    let mut rows = Vec::new();
    for (quantity, matrix) in &curves.of {
        for basis in Basis::ALL {
            let model = Model::new(matrix.view(), *quantity, colour.as_ref(), &bands, basis)?;
            let most = MOST.min(model.rank_limit());
            let cpu_seconds: Vec<_> = (1..=most).map(|n| rebuilding(&model, n)).collect();
            for coding in Coding::ALL.into_iter().filter(|c| c.basis() == basis) {
                for (bytes, row) in coded(&model, &bounds, coding, most)? {
                    let numbers = matrix.ncols() * row.components;
                    rows.push(Components {
                        quantity: *quantity,
                        coding,
                        components: row.components,
                        bytes: bytes + (numbers * size_of::<f32>()) as u64,
                        cpu_seconds: cpu_seconds[row.components - 1],
                        rmse: [row.rmse.mean, row.rmse.max],
                        delta_e: row.delta_e.map(|e| [e.mean, e.max]),
                    });
                }
            }
        }
    }
    Ok(rows)
}

/// Bytes of the coefficients and errors for 1 to `most` components.
fn coded(
    model: &Model,
    bounds: &Bounds,
    coding: Coding,
    most: usize,
) -> Result<Vec<(u64, ErrorRow)>, CompressError> {
    if coding != Coding::LogNarrow {
        let table = model.table(&model.coefficients(most, coding.stored()));
        let bytes = |row: ErrorRow| {
            let stored = model.coefficients(row.components, coding.stored());
            (stored.bytes(), row)
        };
        return Ok(table.rows.into_iter().map(bytes).collect());
    }
    let mut rows = Vec::new();
    for components in 1..=most {
        match model.quantised_to_bounds(components, bounds) {
            Ok((stored, row)) => rows.push((stored.bytes(), row)),
            // So few components do not keep the bound in 16 bits.
            Err(CompressError::Unreachable { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(rows)
}

fn stored(store: &Store) -> Result<Curves, TradeoffError> {
    let missing = store.missing(None)?.len();
    if missing > 0 {
        let path = store.path().into();
        return Err(TradeoffError::Unfinished { missing, path });
    }
    // those of grains that do not fit in their slab are not there
    let existing = existing(store.axes(), store.absent());
    let read = |quantity| {
        let variable = match quantity {
            Quantity::Transmittance => Variable::Transmittance,
            Quantity::Reflectance => Variable::Reflectance,
        };
        let curves = store.read(variable)?.mapv(f64::from);
        Ok((quantity, curves.select(Axis(0), &existing)))
    };
    let of: Result<_, TradeoffError> = Quantity::ALL.into_iter().map(read).collect();
    Ok(Curves {
        nm: store.wavelengths_nm().to_vec(),
        of: of?,
    })
}

fn simulated(bench: &Bench, grid: &Grid) -> Result<Curves, TradeoffError> {
    let affordable = (RAYS_PER_SECOND * bench.budget()).max(1.0) as u64;
    let setting = Setting {
        engine: grid.run.engine,
        rays: grid.run.rays.min(affordable),
        resolution: Resolution::default(),
    };
    let jobs = grid.jobs()?;
    let numbers: Vec<u64> = (0..jobs.count()).collect();
    let spectra = bench.map(&numbers, |&number| {
        let job = grid.job(&jobs, number)?;
        let mut request = job.request(grid);
        // isotropic light is another file's
        request.illuminations = &job.illuminations[..job.angles_deg.len()];
        request.rays = setting.rays;
        let run = bench.run(&setting, &request, &Tables::default());
        let run = run.map_err(|source| match source {
            EngineError::Cancelled => TradeoffError::Cancelled,
            source => TradeoffError::Engine {
                sample: job.to_string(),
                setting: setting.to_string(),
                source,
            },
        })?;
        Ok(run.spectra)
    })?;
    let spectra: Vec<_> = spectra.into_iter().flatten().collect();
    let of = |quantity| {
        let rows: Vec<_> = spectra.iter().map(|s| values(s, quantity)).collect();
        let shape = (rows.len(), grid.wavelengths_nm.len());
        (quantity, Array2::from_shape_fn(shape, |(i, j)| rows[i][j]))
    };
    Ok(Curves {
        nm: grid.wavelengths_nm.clone(),
        of: Quantity::ALL.map(of).into(),
    })
}

/// CPU seconds to rebuild one spectrum as readers of compact files do, undisturbed.
fn rebuilding(model: &Model, components: usize) -> f64 {
    let basis = model.basis(components);
    let coefficients = model.coefficients(components, Precision::F32).decoded();
    let mut sum = vec![0.0; basis.nrows()];
    let mut pass = || {
        let (begin, mut spectra) = (ThreadTime::now(), 0_u32);
        loop {
            for row in coefficients.rows() {
                sum.fill(0.0);
                for (&coefficient, vector) in row.iter().zip(basis.columns()) {
                    add_component(&mut sum, coefficient, vector);
                }
                for value in &mut sum {
                    *value = model.value(*value);
                }
                black_box(&sum);
                spectra += 1;
            }
            let seconds = begin.elapsed().as_secs_f64();
            if seconds >= PASS {
                return seconds / f64::from(spectra);
            }
        }
    };
    (0..PASSES).map(|_| pass()).fold(f64::INFINITY, f64::min)
}
