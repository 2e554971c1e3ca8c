//! The error error budget of a compact file: how far its answers are from fresh
//! simulations, anywhere in its box (docs/methods.md).
//!
//! An answer carries three errors: the simulation's, the compression's and the
//! interpolation's. The whole is measured against fresh simulations of many more
//! walks at random points; the parts by asking the curves the file was made
//! from as well, through the same look-up:
//!
//! - **compression**: the file against those curves, at the same points;
//! - **interpolation** (with the simulation's): those curves against the truth;
//! - **simulation**: the same on nodes, where nothing is interpolated;
//! - the interpolation along each axis alone;
//! - and, of a file with fewer wavelengths than the truth, the **wavelengths**: the
//!   truth with straight lines between those of the file, which interpolation and
//!   simulation are compared with, against the truth itself.
//!
//! Answers are compared at the wavelengths of the truth.
//!
//! The truth has noise of its own, told beside them: what a standard error at all
//! wavelengths at once would change. It does not hold what all engines have in
//! common, nor the method's own error of the engine that made it
//! (docs/stability.md).
mod measures;
mod patch;
mod trial;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::colour::Colorimeter;
use crate::compress::CurveError;
use crate::engine::{Control, EngineError};
use crate::grid::{Grid, GridError};
use crate::lookup::{Database, Lookup, LookupError};
use crate::measurement::{Quantity, Spectrum};
use crate::parameter::{Point, Region};
use crate::spectrum::Resampling;

pub use measures::{Measures, QuantityErrors, Summary, WorstPoint};
pub use patch::{Patch, Simulation};
use trial::{Kind, Trial};

/// Metadata key of an error budget in a compact file: its JSON.
pub const ERROR_BUDGET: &str = "error_budget";

/// The same key in files of version 0.1.
pub const FORMER_KEY: &str = "certificate";

/// Why nothing could be certified.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ErrorBudgetError {
    /// A point cannot be run.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// A fresh simulation failed.
    #[error("fresh simulation of {at}: {source}")]
    Engine {
        /// Where.
        at: String,
        /// Why.
        source: EngineError,
    },
    /// A file does not answer there.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// The caller asked it to stop.
    #[error("cancelled")]
    Cancelled,
}

/// What is to be certified, and how.
#[derive(Debug, Clone, Copy)]
pub struct Subject<'a> {
    /// Laws of the grains, wavelengths and model of the simulations. Answers are
    /// compared at its wavelengths, with straight lines between those of the databases.
    pub grid: &'a Grid,
    /// Where points are drawn; at least one.
    pub regions: &'a [Region],
    /// The file.
    pub file: &'a Database,
    /// The curves it was made from, as [`Database::from_curves`]; at its wavelengths.
    pub exact: &'a Database,
    /// What colours are seen with; of the wavelengths of `grid`.
    pub colour: Option<&'a Colorimeter>,
    /// Points anywhere, at least.
    pub points: usize,
    /// Walks of a fresh simulation.
    pub rays: u64,
    /// Chooses points and random numbers.
    pub seed: u64,
}

/// What was found; the same for the same subject.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ErrorBudget {
    /// Random points of the whole chain.
    pub points: usize,
    /// Walks per light and index node of the fresh simulations.
    pub rays: u64,
    /// Seed of points and simulations.
    pub seed: u64,
    /// The errors by name of the quantity.
    pub quantities: BTreeMap<String, QuantityErrors>,
}

impl ErrorBudget {
    /// The error budget in a compact file's metadata, if there is one.
    #[must_use]
    pub fn of(metadata: &BTreeMap<String, String>) -> Option<Self> {
        let text = [ERROR_BUDGET, FORMER_KEY]
            .iter()
            .find_map(|key| metadata.get(*key));
        serde_json::from_str(text?).ok()
    }
}

/// What of an error budget there was time for.
#[derive(Debug, Clone, PartialEq)]
pub struct Partial {
    /// From what was simulated; `None` without a random point.
    pub error_budget: Option<ErrorBudget>,
    /// Fresh simulations and random points left out, if any was.
    pub left: Option<[usize; 2]>,
    /// Points that were drawn where the file has no answer, for grains do not fit.
    pub unanswered: usize,
}

/// Random points of the whole chain.
fn anywhere(trials: &[Trial]) -> usize {
    let kinds = trials.iter().flat_map(|trial| &trial.kinds);
    kinds.filter(|kind| **kind == Kind::Anywhere).count()
}

/// Numbers of the trials in an order that has, wherever it ends, the same share of
/// those anywhere and of those along the axes.
fn interleaved(trials: &[Trial]) -> Vec<usize> {
    let is_anywhere = |trial: &Trial| trial.kinds.iter().all(|kind| *kind == Kind::Anywhere);
    let number = trials.iter().take_while(|trial| is_anywhere(trial)).count();
    let place = |i: usize| {
        let (before, of) = if i < number {
            (i, number)
        } else {
            (i - number, trials.len() - number)
        };
        (before as f64 + 0.5) / of as f64
    };
    let mut order: Vec<usize> = (0..trials.len()).collect();
    order.sort_by(|a, b| place(*a).total_cmp(&place(*b)));
    order
}

impl Subject<'_> {
    fn simulation(&self) -> Simulation<'_> {
        Simulation {
            grid: self.grid,
            rays: self.rays,
            seed: trial::simulation_seed(self.seed),
        }
    }

    /// And how many points drawn the file does not answer.
    fn trials(&self) -> (Vec<Trial>, usize) {
        let covered = |size, thickness| self.file.covers(size, thickness);
        let (mut trials, unanswered) =
            trial::anywhere(self.regions, self.points, self.seed, &covered);
        // snow that a scene leaves out would be of no use to it
        if self.regions.len() == 1 {
            let along = trial::along(self.file.axes(), self.seed).into_iter();
            trials.extend(along.filter_map(|trial| trial.within(&covered)));
        }
        (trials, unanswered)
    }

    fn patches(&self) -> Vec<Patch> {
        let (trials, _) = self.trials();
        trials.into_iter().map(|trial| trial.patch).collect()
    }

    /// How many walks [`Subject::certify`] does.
    ///
    /// # Errors
    /// A point cannot be run.
    pub fn walks(&self) -> Result<u64, ErrorBudgetError> {
        self.simulation().walks(&self.patches())
    }

    /// Simulates and compares.
    ///
    /// # Errors
    /// See [`ErrorBudgetError`].
    pub fn certify(&self, control: &Control) -> Result<ErrorBudget, ErrorBudgetError> {
        let Partial {
            error_budget, left, ..
        } = self.certify_some(control)?;
        let whole = error_budget.filter(|_| left.is_none());
        whole.ok_or(ErrorBudgetError::Cancelled)
    }

    /// The same from what was simulated when `control` said to stop.
    ///
    /// # Errors
    /// See [`ErrorBudgetError`].
    pub fn certify_some(&self, control: &Control) -> Result<Partial, ErrorBudgetError> {
        let (trials, unanswered) = self.trials();
        let patches: Vec<Patch> = trials.iter().map(|trial| trial.patch.clone()).collect();
        let truth = self
            .simulation()
            .run_some(&patches, &interleaved(&trials), control)?;
        let (total, patches) = (anywhere(&trials), trials.len());
        let done = trials.into_iter().zip(truth);
        let done = done.filter_map(|(trial, truth)| Some((trial, truth?)));
        let (trials, truth): (Vec<Trial>, Vec<Vec<Spectrum>>) = done.unzip();
        let points = anywhere(&trials);
        let left = (trials.len() < patches).then(|| [patches - trials.len(), total - points]);
        if points == 0 {
            return Ok(Partial {
                error_budget: None,
                left,
                unanswered,
            });
        }
        let mut quantities = BTreeMap::new();
        let there = Quantity::ALL.into_iter().filter(|q| self.file.has(*q));
        for quantity in there {
            let chain = self.chain(quantity, &trials, &truth)?;
            quantities.insert(quantity.name().to_owned(), chain);
        }
        let error_budget = Some(ErrorBudget {
            points,
            rays: self.rays,
            seed: self.seed,
            quantities,
        });
        Ok(Partial {
            error_budget,
            left,
            unanswered,
        })
    }

    fn chain(
        &self,
        quantity: Quantity,
        trials: &[Trial],
        truth: &[Vec<Spectrum>],
    ) -> Result<QuantityErrors, ErrorBudgetError> {
        let lookups = |optional: Point| {
            let mut found = Vec::new();
            for database in [self.file, self.exact] {
                found.push(Lookup::new(&database.at(optional)?, quantity)?);
            }
            Ok::<_, LookupError>(found)
        };
        let nm = &self.grid.wavelengths_nm;
        let lines = Resampling::new(self.file.wavelengths_nm(), nm);
        let fewer = nm != self.file.wavelengths_nm();
        let there = Resampling::new(nm, self.file.wavelengths_nm());
        let mut found = vec![0.0; self.file.wavelengths_nm().len()];
        let mut ask = |lookup: &Lookup, point| -> Result<Vec<f64>, LookupError> {
            lookup.spectrum(point, &mut found)?;
            let found: Vec<f64> = found.iter().map(|v| f64::from(*v)).collect();
            Ok(lines.apply(&found))
        };
        let error = |a: &[f64], b: &[f64]| CurveError::between(a, b, self.colour);
        let mut chain = measures::Collector::default();
        let mut current: Option<(Point, Vec<Lookup>)> = None;
        for (trial, truth) in trials.iter().zip(truth) {
            let optional = trial.patch.snow.optional();
            let (_, lookups) = match current.take() {
                Some(same) if same.0 == optional => current.insert(same),
                _ => current.insert((optional, lookups(optional)?)),
            };
            let points = trial.patch.points().zip(&trial.kinds).zip(truth);
            for ((point, kind), truth) in points {
                let values = |add: f64| -> Vec<f64> {
                    let all = truth.of(quantity).iter();
                    all.map(|m| m.value + add * m.se).collect()
                };
                let truth = values(0.0);
                let (answer, curves) = (ask(&lookups[0], point)?, ask(&lookups[1], point)?);
                let drawn = lines.apply(&there.apply(&truth));
                let interpolated = error(&drawn, &curves);
                match kind {
                    Kind::Anywhere => {
                        if fewer {
                            chain.wavelengths.push(error(&truth, &drawn));
                        }
                        let at = point.to_string();
                        chain.total.push((at, error(&truth, &answer)));
                        chain.compression.push(error(&curves, &answer));
                        chain.interpolation.push(interpolated);
                        chain.noise.push(error(&truth, &values(1.0)));
                    }
                    Kind::Along(parameter) => {
                        let name = parameter.name().to_owned();
                        chain.axes.entry(name).or_default().push(interpolated);
                    }
                    Kind::Slab => {}
                    Kind::Nodes => chain.simulation.push(interpolated),
                }
            }
        }
        Ok(chain.finish())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameter::Parameter;

    #[test]
    fn whatever_there_is_time_for_holds_both_kinds() {
        let trial = |kind| Trial {
            patch: Patch {
                snow: Point::from([(Parameter::Facetness, 0.3)]),
                thickness_cm: vec![1.0],
                angle_deg: vec![0.0],
            },
            kinds: vec![kind],
        };
        let mut trials: Vec<Trial> = (0..30).map(|_| trial(Kind::Anywhere)).collect();
        trials.extend((0..10).map(|_| trial(Kind::Along(Parameter::GrainSize))));
        let order = interleaved(&trials);
        for n in 1..=order.len() {
            let along = order[..n].iter().filter(|i| **i >= 30).count();
            assert!(
                (along as f64 - n as f64 / 4.0).abs() <= 1.0,
                "{along} of {n}"
            );
        }
        let mut all = order;
        all.sort_unstable();
        assert!(all.into_iter().eq(0..40));
        assert_eq!(interleaved(&trials[..3]), [0, 1, 2]);
    }
}
