//! Errors of compression against the cost of a compact file: number of components, bytes, and
//! time to evaluate a spectrum, for each variant of the file.
use std::hint::black_box;
use std::path::PathBuf;

use cpu_time::ThreadTime;
use ndarray::{Array2, Axis};

use super::measure::{Bench, Tables};
use super::truth::values;
use super::{Setting, TradeoffError};
use crate::colour::Colorimeter;
use crate::compress::{
    Bands, Basis, Bounds, Choice, CompressError, CurveModel, DEFAULT_MAX_DELTA_E, ErrorRow,
    Precision,
};
use crate::engine::{EngineError, Resolution};
use crate::grid::{Compression, Grid, existing_rows};
use crate::lookup::add_component;
use crate::measurement::Quantity;
use crate::store::{Store, Variable};

/// Largest number of components measured.
const MOST: usize = 8;
/// Rays per curve of a grid in memory, for each CPU second of the budget; at most the grid's own
/// number.
const RAYS_PER_SECOND: f64 = 4.0;
/// Number of passes in which the evaluation is timed; the fastest pass counts.
const PASSES: u32 = 9;
/// Least CPU seconds of a pass.
const PASS: f64 = 0.002;

/// The source of the curves to compress.
#[derive(Debug)]
pub enum CompressionSource {
    /// The output directory of a finished build.
    Database(PathBuf),
    /// A grid that is simulated in memory.
    Grid(Box<Grid>),
}

/// A variant of the compact file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Coding {
    /// Components of the spectra, f32: the compression of Varsa 2025.
    Linear,
    /// Components of the logarithm, f32.
    Log,
    /// Components of the logarithm, f16.
    LogHalf,
    /// Components of the logarithm, 16-bit integers.
    LogIntegers,
    /// Components of the logarithm, 8-bit integers where Delta-E stays below the default bound.
    LogNarrow,
}

impl Coding {
    /// All variants.
    pub const ALL: [Self; 5] = [
        Self::Linear,
        Self::Log,
        Self::LogHalf,
        Self::LogIntegers,
        Self::LogNarrow,
    ];

    /// Quantity that the components decompose.
    #[must_use]
    pub fn basis(self) -> Basis {
        match self {
            Self::Linear => Basis::Linear,
            _ => Basis::Log,
        }
    }

    /// The name of the precision in result files.
    #[must_use]
    pub fn precision(self) -> &'static str {
        match self {
            Self::LogIntegers => "quantised_16",
            other => other.stored().name(),
        }
    }

    /// The precision of the stored coefficients.
    fn stored(self) -> Precision {
        match self {
            Self::Linear | Self::Log => Precision::F32,
            Self::LogHalf => Precision::F16,
            Self::LogIntegers | Self::LogNarrow => Precision::Quantised,
        }
    }
}

/// Errors and costs for one quantity, variant and number of components.
#[derive(Debug, Clone, PartialEq)]
pub struct Components {
    /// The quantity.
    pub quantity: Quantity,
    /// The variant.
    pub coding: Coding,
    /// Number of components.
    pub components: usize,
    /// Bytes of the quantity's coefficients and basis, as a compact file holds them.
    pub bytes: u64,
    /// CPU seconds to evaluate one spectrum.
    pub cpu_seconds: f64,
    /// Mean and largest RMSE over the curves.
    pub rmse: [f64; 2],
    /// Mean and largest Delta-E over the curves; `None` without visible wavelengths.
    pub delta_e: Option<[f64; 2]>,
}

/// Curves per quantity, `[curve, wavelength]`, with their wavelengths, nm.
struct Curves {
    nm: Vec<f64>,
    quantities: Vec<(Quantity, Array2<f64>)>,
}

/// The errors and costs for 1, 2, ... components of each quantity and variant.
pub(super) fn measure(
    bench: &Bench,
    source: &CompressionSource,
    say: &dyn Fn(&str),
) -> Result<Vec<Components>, TradeoffError> {
    say("curves to compress");
    let curves = match source {
        CompressionSource::Database(folder) => stored(&Store::open(folder)?)?,
        CompressionSource::Grid(grid) => simulated(bench, grid)?,
    };
    let colour = Colorimeter::new(&curves.nm)?;
    let usual = Choice::Bounds(Compression {
        max_delta_e: DEFAULT_MAX_DELTA_E,
        max_rmse: None,
    });
    let bands = Bands::default();
    let bounds = usual.bounds(colour.is_some(), &bands);
    let mut rows = Vec::new();
    for (quantity, matrix) in &curves.quantities {
        for basis in Basis::ALL {
            let model = CurveModel::new(matrix.view(), *quantity, colour.as_ref(), &bands, basis)?;
            let most = MOST.min(model.rank_limit());
            let cpu_seconds = (1..=most).map(|n| evaluation_seconds(&model, n));
            let cpu_seconds: Vec<f64> = cpu_seconds.collect::<Result<_, _>>()?;
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

/// Bytes of the coefficients, and errors, for 1 to `most` components.
fn coded(
    model: &CurveModel,
    bounds: &Bounds,
    coding: Coding,
    most: usize,
) -> Result<Vec<(u64, ErrorRow)>, CompressError> {
    if coding != Coding::LogNarrow {
        let table = model.table(most, coding.stored())?;
        let bytes = |row: ErrorRow| {
            let stored = model.coefficients(row.components, coding.stored())?;
            Ok((stored.bytes(), row))
        };
        return table.rows.into_iter().map(bytes).collect();
    }
    let mut rows = Vec::new();
    for components in 1..=most {
        match model.quantised_to_bounds(components, bounds) {
            Ok((stored, row)) => rows.push((stored.bytes(), row)),
            // Even 16 bits do not keep the bound with so few components.
            Err(CompressError::Unreachable { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(rows)
}

/// The curves of a finished database.
fn stored(store: &Store) -> Result<Curves, TradeoffError> {
    let missing = store.missing()?.len();
    if missing > 0 {
        let path = store.path().into();
        return Err(TradeoffError::Unfinished { missing, path });
    }
    // Curves of grains that do not fit into the slab do not exist.
    let existing = existing_rows(store.axes(), store.absent());
    let read = |quantity| {
        let variable = match quantity {
            Quantity::Transmittance => Variable::TRANSMITTANCE,
            Quantity::Reflectance => Variable::REFLECTANCE,
        };
        let curves = store.read(variable)?.mapv(f64::from);
        Ok((quantity, curves.select(Axis(0), &existing)))
    };
    let quantities: Result<_, TradeoffError> = Quantity::ALL.into_iter().map(read).collect();
    Ok(Curves {
        nm: store.wavelengths_nm().to_vec(),
        quantities: quantities?,
    })
}

/// The curves of a grid, simulated with as many rays as the budget allows.
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
        // Curves under isotropic light belong to another file.
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
    let matrix_of = |quantity| {
        let rows: Vec<_> = spectra.iter().map(|s| values(s, quantity)).collect();
        let shape = (rows.len(), grid.wavelengths_nm.len());
        (quantity, Array2::from_shape_fn(shape, |(i, j)| rows[i][j]))
    };
    Ok(Curves {
        nm: grid.wavelengths_nm.clone(),
        quantities: Quantity::ALL.map(matrix_of).into(),
    })
}

/// CPU seconds to evaluate one spectrum in the way readers of compact files do; the fastest of
/// several passes.
fn evaluation_seconds(model: &CurveModel, components: usize) -> Result<f64, CompressError> {
    let basis = model.basis(components);
    let coefficients = model.coefficients(components, Precision::F32)?.decoded();
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
    Ok((0..PASSES).map(|_| pass()).fold(f64::INFINITY, f64::min))
}
