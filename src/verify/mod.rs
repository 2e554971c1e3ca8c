//! Checks a finished database: its files, its compact files against the database, stored spectra
//! and factors toward views against fresh simulations at nodes, and look-ups in the compact file against fresh
//! simulations anywhere ([`crate::error_budget`]). A tailored file is checked by the last only.
//!
//! The checks that compare random numbers fail a correct database with a known probability:
//! [`FALSE_ALARM`] for each kind of fresh simulation.
mod answers;
mod compact;
mod fresh;
mod nodes;
mod report;
mod views;

use std::path::Path;
use std::sync::atomic::Ordering;

use ndarray::Array2;
use thiserror::Error;

use crate::budget;
use crate::build::BuildError;
use crate::colour::{Colorimeter, ColourError};
use crate::config::{self, ConfigError};
use crate::engine::{Control, EngineError};
use crate::error_budget::{ErrorBudget, ErrorBudgetError};
use crate::grid::{Grid, GridError};
use crate::lookup::{Database, LookupError};
use crate::measurement::Quantity;
use crate::store::{self, Store, StoreError, Variable};

pub use answers::{POINT_RAYS, tailored, tailored_walks};
#[cfg(feature = "cli")]
pub(crate) use compact::viewing;
pub use report::{Check, CheckedValue, VerifyReport};

/// Probability that the fresh simulations of one kind fail a correct database.
pub const FALSE_ALARM: f64 = 1e-6;

/// The settings of a verification.
#[derive(Debug, Clone, Copy)]
pub struct VerifyOptions {
    /// Number of fresh simulations at nodes; 0 skips this check.
    pub samples: usize,
    /// Least number of random points of the error budget; 0 skips the error budget.
    pub points: usize,
    /// Seed that chooses the points and the random streams of the fresh simulations.
    pub seed: u64,
    /// Rays of a fresh simulation at a node; `None` for the database's number of rays.
    pub rays: Option<u64>,
    /// Rays of a fresh simulation at a random point; `None` for [`POINT_RAYS`].
    pub point_rays: Option<u64>,
    /// CPU seconds after which no further simulation starts; at most half of them are used for
    /// the nodes. `None` for no limit.
    pub seconds: Option<f64>,
}

/// The reason why a verification could not run.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum VerifyError {
    /// The database cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The configuration of the database is not a grid that this version can simulate.
    #[error(
        "the grid stored in the database cannot be simulated (a water table that it names must lie beside the database): {0}"
    )]
    Config(#[from] ConfigError),
    /// The grid cannot simulate a point.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// A fresh simulation failed.
    #[error("the fresh simulation at {point} failed: {source}")]
    Engine {
        /// The point simulated.
        point: String,
        /// Error of the engine.
        source: EngineError,
    },
    /// The wavelengths or illuminants are invalid for colours.
    #[error(transparent)]
    Colour(#[from] ColourError),
    /// The shape of the compact file differs from that of the database.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// The curves toward views cannot be compressed.
    #[error(transparent)]
    Build(Box<BuildError>),
    /// The error budget could not be measured.
    #[error(transparent)]
    ErrorBudget(ErrorBudgetError),
    /// The caller cancelled the run.
    #[error("cancelled")]
    Cancelled,
}

/// An opened database with the settings of its verification.
#[derive(Debug)]
pub struct Verification {
    store: Store,
    grid: Grid,
    options: VerifyOptions,
}

impl From<BuildError> for VerifyError {
    fn from(error: BuildError) -> Self {
        Self::Build(Box::new(error))
    }
}

impl From<ErrorBudgetError> for VerifyError {
    fn from(error: ErrorBudgetError) -> Self {
        match error {
            ErrorBudgetError::Cancelled => Self::Cancelled,
            error => Self::ErrorBudget(error),
        }
    }
}

/// Runs `work` until it ends or `seconds` of CPU time are spent. `work` sees the end of the time
/// as a cancellation.
///
/// # Errors
/// Those of `work`; [`VerifyError::Cancelled`] if `control` was cancelled.
fn within<T>(
    seconds: Option<f64>,
    control: &Control,
    work: impl FnOnce(&Control) -> Result<T, VerifyError>,
) -> Result<T, VerifyError> {
    let result = budget::with_cpu_limit(seconds, control.cancel, |cancel| {
        work(&Control { cancel, ..*control })
    })?;
    if control.cancel.load(Ordering::Relaxed) {
        return Err(VerifyError::Cancelled);
    }
    Ok(result)
}

/// The inputs that all checks of a database share.
struct CheckContext<'a> {
    store: &'a Store,
    grid: &'a Grid,
    options: VerifyOptions,
}

impl Verification {
    /// Opens the database in `dir`.
    ///
    /// # Errors
    /// If there is no database, its metadata is damaged, or this version cannot simulate its
    /// grid.
    pub fn open(dir: &Path, options: VerifyOptions) -> Result<Self, VerifyError> {
        let store = Store::open(dir)?;
        // Tables that the grid names without a folder are looked up beside the database.
        let name = store.path().display().to_string();
        let grid = config::grid::parse(&name, store.config())?.grid;
        Ok(Self {
            store,
            grid,
            options,
        })
    }

    /// The largest number of walks of [`run`](Self::run), for a progress bar.
    ///
    /// # Errors
    /// If a point cannot be simulated.
    pub fn walks(&self) -> Result<u64, VerifyError> {
        let context = self.context();
        let nodes = nodes::simulations(&context).walks(&self.grid)?;
        let path = self.store.dir().join(store::COMPACT);
        // A file that cannot be read is reported by its check.
        let answers = match Database::open(&path) {
            Ok(database) if self.options.points > 0 => answers::walks(&context, &database)?,
            _ => 0,
        };
        Ok(nodes.saturating_add(answers))
    }

    /// Runs all checks that can be done. Returns the report and the error budget of the compact
    /// file. Both depend on the database and the options only, unless the time limit ends
    /// first. Then the report lists what was not checked, and the error budget appears in its
    /// notes only.
    ///
    /// # Errors
    /// If an existing file cannot be read, an engine fails, or the run is cancelled. Problems of
    /// the database itself are in the report.
    pub fn run(
        &self,
        control: &Control<'_>,
    ) -> Result<(VerifyReport, Option<ErrorBudget>), VerifyError> {
        within(self.options.seconds, control, |control| {
            self.checks(control)
        })
    }

    /// See [`run`](Self::run).
    fn checks(
        &self,
        control: &Control<'_>,
    ) -> Result<(VerifyReport, Option<ErrorBudget>), VerifyError> {
        let context = self.context();
        let mut not_checked = Vec::new();
        let integrity = self.integrity()?;
        if !integrity.passed() {
            let checks = vec![integrity];
            return Ok((
                VerifyReport {
                    checks,
                    not_checked,
                },
                None,
            ));
        }
        let mut checks = vec![integrity];
        let path = self.store.dir().join(store::COMPACT);
        let opened = Database::open(&path).map_err(|error| error.to_string());
        let opened = opened.and_then(|file| Ok((compact::viewing(&file)?, file)));
        let database = match opened {
            Ok((viewing, database)) => {
                let colour = Colorimeter::viewing(self.store.wavelengths_nm(), &viewing)?;
                let mut check = compact::check(&context, &database, colour.as_ref(), false)?;
                if colour.is_some() {
                    check.notes.push(format!("Delta-E: {viewing}"));
                }
                let passed = check.passed();
                checks.push(check);
                if let Some(check) = self.diffuse(&context, colour.as_ref())? {
                    checks.push(check);
                }
                passed.then_some((database, colour))
            }
            Err(error) => {
                let mut check = Check::new(compact::NAME);
                check.problems.push(format!(
                    "{error}; make the file again with `splitsnow compress`"
                ));
                checks.push(check);
                None
            }
        };
        if let Some(views) = &self.grid.views {
            checks.push(views::files(&context)?);
            if self.options.samples > 0 {
                let (check, [skipped, total]) = views::fresh(&context, views, control)?;
                if skipped < total {
                    checks.push(check);
                }
                if skipped > 0 {
                    not_checked.push(format!(
                        "{skipped} of {total} fresh simulations toward views"
                    ));
                }
            }
        }
        if self.options.samples > 0 {
            let half = self.options.seconds.map(|seconds| 0.5 * seconds);
            let (check, [skipped, total]) =
                budget::with_cpu_limit(half, control.cancel, |cancel| {
                    nodes::check(&context, &Control { cancel, ..*control })
                })?;
            if skipped < total {
                checks.push(check);
            }
            if total == 0 {
                not_checked.push("nodes of the grid: no node has a curve".into());
            }
            if skipped > 0 {
                not_checked.push(format!(
                    "{skipped} of {total} fresh simulations at nodes of the grid"
                ));
            }
        }
        let mut error_budget = None;
        if let Some((database, colour)) = database.filter(|_| self.options.points > 0) {
            let colour = colour.as_ref();
            let (check, measured, skipped) = answers::check(&context, &database, colour, control)?;
            checks.extend(check);
            not_checked.extend(skipped);
            error_budget = measured;
        }
        Ok((
            VerifyReport {
                checks,
                not_checked,
            },
            error_budget,
        ))
    }

    /// The inputs of the checks.
    fn context(&self) -> CheckContext<'_> {
        CheckContext {
            store: &self.store,
            grid: &self.grid,
            options: self.options,
        }
    }

    /// The check of the compact file for isotropic light; `None` if the database has none.
    fn diffuse(
        &self,
        context: &CheckContext<'_>,
        colour: Option<&Colorimeter>,
    ) -> Result<Option<Check>, VerifyError> {
        if !self.store.has_diffuse() {
            return Ok(None);
        }
        let path = self.store.dir().join(store::DIFFUSE);
        Ok(Some(match Database::open(&path) {
            Ok(file) => compact::check(context, &file, colour, true)?,
            Err(error) => {
                let mut check = Check::new(compact::DIFFUSE_NAME);
                check.problems.push(format!(
                    "{error}; make the file again with `splitsnow compress`"
                ));
                check
            }
        }))
    }

    /// The check of the files of every job.
    fn integrity(&self) -> Result<Check, VerifyError> {
        let mut check = Check::new("files of the database");
        let integrity = self.store.verify()?;
        let jobs = self.store.jobs();
        check.notes.push(format!("{} jobs", integrity.jobs));
        for file in &integrity.damaged {
            check.problems.push(format!("{file} is damaged"));
        }
        for file in &integrity.outdated {
            check.notes.push(format!(
                "{file} was written by an earlier version: run `splitsnow build` with the same grid file to renew it"
            ));
        }
        const NAMED: usize = 10;
        for &number in integrity.missing.iter().take(NAMED) {
            let job = self.grid.job(jobs, number)?;
            let problem = format!("job {number} is missing or damaged: {job}");
            check.problems.push(problem);
        }
        if integrity.missing.len() > NAMED {
            let more = integrity.missing.len() - NAMED;
            check
                .problems
                .push(format!("{more} more jobs are missing or damaged"));
        }
        if !check.problems.is_empty() {
            let help = "run `splitsnow build` with the same grid file to repair it; nothing else was checked";
            check.notes.push(help.into());
        }
        Ok(check)
    }
}

impl CheckContext<'_> {
    /// The stored curves of a quantity, and their standard errors, both `[s, l]`.
    fn curves(&self, quantity: Quantity, diffuse: bool) -> Result<[Array2<f64>; 2], StoreError> {
        let [value, se] = match quantity {
            Quantity::Transmittance => [Variable::TRANSMITTANCE, Variable::TRANSMITTANCE.se()],
            Quantity::Reflectance => [Variable::REFLECTANCE, Variable::REFLECTANCE.se()],
        };
        let read = |variable: Variable| {
            let variable = if diffuse {
                variable.diffuse()
            } else {
                variable
            };
            self.store.read(variable)
        };
        Ok([read(value)?.mapv(f64::from), read(se)?.mapv(f64::from)])
    }
}
