//! Checks a finished database anew: its files, its compact file against it,
//! the curves against fresh simulations on the nodes, and the answers of the
//! compact file against fresh ones anywhere ([`crate::error_budget`]). Of a file
//! that was tailored to a scene there is only the last.
//!
//! Every check that compares random numbers states how often it would fail a
//! good database: [`FALSE_ALARM`] for each kind of fresh simulation.
mod answers;
mod compact;
mod fresh;
mod nodes;
mod report;

use std::path::Path;
use std::sync::atomic::Ordering;

use ndarray::Array2;
use thiserror::Error;

use crate::budget;
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
pub use report::{Check, Figure, Report};

/// Probability that fresh simulations fail a database that is right.
pub const FALSE_ALARM: f64 = 1e-6;

/// What to verify.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// Fresh simulations on nodes; 0 makes none.
    pub samples: usize,
    /// Random points of the error budget, at least; 0 makes none.
    pub points: usize,
    /// Chooses the points and the streams of the fresh simulations.
    pub seed: u64,
    /// Rays of a fresh simulation on a node; as many as the database's if `None`.
    pub rays: Option<u64>,
    /// Rays of a fresh simulation at a random point; [`POINT_RAYS`] if `None`.
    pub point_rays: Option<u64>,
    /// CPU seconds after which no more is simulated; half of them at most are for the
    /// nodes. `None`: without limit.
    pub seconds: Option<f64>,
}

/// Why a database could not be verified at all.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum VerifyError {
    /// It cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Its description is no grid this version can run.
    #[error(
        "the grid in the database's attributes cannot be run (a water table of its own is looked for beside the database): {0}"
    )]
    Config(#[from] ConfigError),
    /// A point of it cannot be run.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// A fresh simulation failed.
    #[error("fresh simulation at {point}: {source}")]
    Engine {
        /// Where.
        point: String,
        /// Why.
        source: EngineError,
    },
    /// Its wavelengths have no colour because of an error in them.
    #[error(transparent)]
    Colour(#[from] ColourError),
    /// The compact file is not of the database's shape.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// There is no error budget for it.
    #[error(transparent)]
    ErrorBudget(ErrorBudgetError),
    /// The caller asked it to stop.
    #[error("cancelled")]
    Cancelled,
}

/// A database about to be verified.
#[derive(Debug)]
pub struct Verification {
    store: Store,
    grid: Grid,
    options: Options,
}

impl From<ErrorBudgetError> for VerifyError {
    fn from(error: ErrorBudgetError) -> Self {
        match error {
            ErrorBudgetError::Cancelled => Self::Cancelled,
            error => Self::ErrorBudget(error),
        }
    }
}

/// Does `work` until it is done or `seconds` of CPU time are spent, which `work` is told
/// of as if it were cancelled.
fn within<T>(
    seconds: Option<f64>,
    control: &Control,
    work: impl FnOnce(&Control) -> Result<T, VerifyError>,
) -> Result<T, VerifyError> {
    let done = budget::within(seconds, control.cancel, |cancel| {
        work(&Control { cancel, ..*control })
    })?;
    if control.cancel.load(Ordering::Relaxed) {
        return Err(VerifyError::Cancelled);
    }
    Ok(done)
}

/// The parts of the checks that have a database in common.
struct Subject<'a> {
    store: &'a Store,
    grid: &'a Grid,
    options: Options,
}

impl Verification {
    /// Opens the database in `dir`.
    ///
    /// # Errors
    /// There is none, its metadata are damaged, or this version cannot run it.
    pub fn open(dir: &Path, options: Options) -> Result<Self, VerifyError> {
        let store = Store::open(dir)?;
        // Tables it names without a folder are looked for beside it.
        let name = store.path().display().to_string();
        let grid = config::grid::parse(&name, store.config())?.grid;
        Ok(Self {
            store,
            grid,
            options,
        })
    }

    /// How many walks [`run`](Self::run) does at most, for a progress bar.
    ///
    /// # Errors
    /// A point cannot be run.
    pub fn walks(&self) -> Result<u64, VerifyError> {
        let subject = self.subject();
        let nodes = nodes::simulations(&subject).walks(&self.grid)?;
        let path = self.store.dir().join(store::COMPACT);
        // one that cannot be read is told of by the check itself
        let answers = match Database::open(&path) {
            Ok(database) if self.options.points > 0 => answers::walks(&subject, &database)?,
            _ => 0,
        };
        Ok(nodes.saturating_add(answers))
    }

    /// Does all checks that can be done, and gives the error budget of the compact
    /// file. They are functions of the database and the options alone, unless a budget
    /// of time ends first: then the report says what was left out, and there is no
    /// error budget but in its notes.
    ///
    /// # Errors
    /// A file is there but cannot be read, an engine fails, or
    /// [`VerifyError::Cancelled`]. What is wrong with the database itself is in
    /// the report.
    pub fn run(&self, control: &Control<'_>) -> Result<(Report, Option<ErrorBudget>), VerifyError> {
        within(self.options.seconds, control, |control| {
            self.checks(control)
        })
    }

    fn checks(&self, control: &Control<'_>) -> Result<(Report, Option<ErrorBudget>), VerifyError> {
        let subject = self.subject();
        let mut not_checked = Vec::new();
        let integrity = self.integrity()?;
        if !integrity.passed() {
            let checks = vec![integrity];
            return Ok((
                Report {
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
                let mut check = compact::check(&subject, &database, colour.as_ref(), false)?;
                if colour.is_some() {
                    check.notes.push(format!("Delta-E: {viewing}"));
                }
                let passed = check.passed();
                checks.push(check);
                if let Some(check) = self.diffuse(&subject, colour.as_ref())? {
                    checks.push(check);
                }
                passed.then_some((database, colour))
            }
            Err(error) => {
                let mut check = Check::new(compact::NAME);
                check.problems.push(format!(
                    "{error}; make the file anew with `splitsnow compress`"
                ));
                checks.push(check);
                None
            }
        };
        if self.options.samples > 0 {
            let half = self.options.seconds.map(|seconds| 0.5 * seconds);
            let (check, [left, of]) = budget::within(half, control.cancel, |cancel| {
                nodes::check(&subject, &Control { cancel, ..*control })
            })?;
            if left < of {
                checks.push(check);
            }
            if of == 0 {
                not_checked.push("nodes of the grid, for none exists".into());
            }
            if left > 0 {
                not_checked.push(format!(
                    "{left} of {of} fresh simulations at nodes of the grid"
                ));
            }
        }
        let mut error_budget = None;
        if let Some((database, colour)) = database.filter(|_| self.options.points > 0) {
            let colour = colour.as_ref();
            let (check, found, left) = answers::check(&subject, &database, colour, control)?;
            checks.extend(check);
            not_checked.extend(left);
            error_budget = found;
        }
        Ok((
            Report {
                checks,
                not_checked,
            },
            error_budget,
        ))
    }

    fn subject(&self) -> Subject<'_> {
        Subject {
            store: &self.store,
            grid: &self.grid,
            options: self.options,
        }
    }

    /// The compact file of isotropic light, where there is one.
    fn diffuse(
        &self,
        subject: &Subject<'_>,
        colour: Option<&Colorimeter>,
    ) -> Result<Option<Check>, VerifyError> {
        if !self.store.has_diffuse() {
            return Ok(None);
        }
        let path = self.store.dir().join(store::DIFFUSE);
        Ok(Some(match Database::open(&path) {
            Ok(file) => compact::check(subject, &file, colour, true)?,
            Err(error) => {
                let mut check = Check::new(compact::DIFFUSE_NAME);
                check.problems.push(format!(
                    "{error}; make the file anew with `splitsnow compress`"
                ));
                check
            }
        }))
    }

    /// Every job's files and mark.
    fn integrity(&self) -> Result<Check, VerifyError> {
        let mut check = Check::new("files of the database");
        let integrity = self.store.verify()?;
        let jobs = self.store.jobs();
        check.notes.push(format!("{} jobs", integrity.jobs));
        for file in &integrity.damaged {
            check.problems.push(format!("{file} is damaged"));
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
            let help =
                "`splitsnow build` with the same grid file mends it; nothing else was checked";
            check.notes.push(help.into());
        }
        Ok(check)
    }
}

impl Subject<'_> {
    /// The stored curves of a quantity and their standard errors, `[s, l]`.
    fn curves(&self, quantity: Quantity, diffuse: bool) -> Result<[Array2<f64>; 2], StoreError> {
        let [value, se] = match quantity {
            Quantity::Transmittance => [Variable::Transmittance, Variable::TransmittanceSe],
            Quantity::Reflectance => [Variable::Reflectance, Variable::ReflectanceSe],
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
