//! The error budget of a compact file: how far its look-ups are from fresh simulations,
//! anywhere in its box (docs/methods.md).
//!
//! A look-up carries three errors: of the simulation, the compression and the
//! interpolation. The total error (the whole chain) is measured against fresh simulations of
//! many more rays at random points. To separate the parts, the curves that the file was made
//! from are evaluated as well, by the same interpolation:
//!
//! - **compression**: the file against those curves, at the same points;
//! - **interpolation** (and simulation): those curves against the truth;
//! - **simulation**: those curves against the truth at nodes, where nothing is interpolated;
//! - the interpolation error along each axis alone;
//! - **wavelengths**, for a file with fewer wavelengths than the truth: the truth, linear
//!   between the wavelengths of the file, against the truth itself. Interpolation and
//!   simulation are compared with the former.
//!
//! Spectra are compared at the wavelengths of the truth.
//!
//! The truth has noise of its own. The budget states it as the difference that one standard
//! error, at all wavelengths at once, would make. The budget does not include errors that all
//! engines share, nor the method error of the engine that made the truth
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

pub use measures::{ErrorSummary, Measures, QuantityErrors, WorstPoint};
pub use patch::{Patch, PatchSimulation};
use trial::{PointKind, Trial};

/// Metadata key of the error budget in a compact file; the value is JSON.
pub const ERROR_BUDGET: &str = "error_budget";

/// The metadata key of the error budget in files of version 0.1.
pub const FORMER_KEY: &str = "certificate";

/// The reason why no error budget could be measured.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ErrorBudgetError {
    /// The grid cannot simulate a point.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// A fresh simulation failed.
    #[error("the fresh simulation of {snow} failed: {source}")]
    Engine {
        /// The snow simulated.
        snow: String,
        /// Error of the engine.
        source: EngineError,
    },
    /// A look-up failed.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// The caller cancelled the run.
    #[error("cancelled")]
    Cancelled,
}

/// A compact file to certify, with the settings of the certification.
#[derive(Debug, Clone, Copy)]
pub struct Certification<'a> {
    /// Grain laws, wavelengths and model of the simulations. Spectra are compared at its
    /// wavelengths; those of the databases are interpolated linearly.
    pub grid: &'a Grid,
    /// Regions in which random points are drawn; at least one.
    pub regions: &'a [Region],
    /// The compact file.
    pub file: &'a Database,
    /// The curves that the file was made from, at its wavelengths; see
    /// [`Database::from_curves`].
    pub exact: &'a Database,
    /// Colorimeter for the wavelengths of `grid`; `None` if they determine no colour.
    pub colour: Option<&'a Colorimeter>,
    /// Least number of random points.
    pub points: usize,
    /// Rays of a fresh simulation.
    pub rays: u64,
    /// Seed that chooses the points and the random numbers.
    pub seed: u64,
}

/// The measured errors; the same for the same [`Certification`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ErrorBudget {
    /// Number of random points at which the total error was measured.
    pub points: usize,
    /// Rays per incidence angle and index node of the fresh simulations.
    pub rays: u64,
    /// Seed of the points and simulations.
    pub seed: u64,
    /// The errors by the name of the quantity.
    pub quantities: BTreeMap<String, QuantityErrors>,
}

impl ErrorBudget {
    /// The error budget in the metadata of a compact file; `None` if there is none.
    #[must_use]
    pub fn of(metadata: &BTreeMap<String, String>) -> Option<Self> {
        let text = [ERROR_BUDGET, FORMER_KEY]
            .iter()
            .find_map(|key| metadata.get(*key));
        serde_json::from_str(text?).ok()
    }
}

/// An error budget from the simulations that ended before the run was cancelled.
#[derive(Debug, Clone, PartialEq)]
pub struct PartialErrorBudget {
    /// The errors measured; `None` if no simulation at a random point ended.
    pub error_budget: Option<ErrorBudget>,
    /// Numbers of fresh simulations and of random points that were skipped; `None` if the
    /// error budget is complete.
    pub skipped: Option<[usize; 2]>,
    /// Number of points drawn where the file has no curve, because grains do not fit.
    pub uncovered: usize,
}

/// The number of random points in `trials`.
fn count_anywhere(trials: &[Trial]) -> usize {
    let kinds = trials.iter().flat_map(|trial| &trial.kinds);
    kinds.filter(|kind| **kind == PointKind::Anywhere).count()
}

/// Indices of the trials in an order in which every prefix has about the same shares of
/// random points and of points along axes.
fn interleaved(trials: &[Trial]) -> Vec<usize> {
    let is_anywhere = |trial: &Trial| trial.kinds.iter().all(|kind| *kind == PointKind::Anywhere);
    let number = trials.iter().take_while(|trial| is_anywhere(trial)).count();
    let position = |i: usize| {
        let (before, total) = if i < number {
            (i, number)
        } else {
            (i - number, trials.len() - number)
        };
        (before as f64 + 0.5) / total as f64
    };
    let mut order: Vec<usize> = (0..trials.len()).collect();
    order.sort_by(|a, b| position(*a).total_cmp(&position(*b)));
    order
}

impl Certification<'_> {
    /// The fresh simulations.
    fn simulation(&self) -> PatchSimulation<'_> {
        PatchSimulation {
            grid: self.grid,
            rays: self.rays,
            seed: trial::simulation_seed(self.seed),
        }
    }

    /// The trials, and the number of points drawn that the file does not cover.
    fn trials(&self) -> (Vec<Trial>, usize) {
        let is_covered = |size, thickness| self.file.covers(size, thickness);
        let (mut trials, uncovered) =
            trial::anywhere(self.regions, self.points, self.seed, &is_covered);
        // With several regions, points along an axis could lie outside all of them.
        if self.regions.len() == 1 {
            let along = trial::along(self.file.axes(), self.seed).into_iter();
            trials.extend(along.filter_map(|trial| trial.within(&is_covered)));
        }
        (trials, uncovered)
    }

    /// The patches of all trials.
    fn patches(&self) -> Vec<Patch> {
        let (trials, _) = self.trials();
        trials.into_iter().map(|trial| trial.patch).collect()
    }

    /// The number of walks that [`Certification::certify`] simulates.
    ///
    /// # Errors
    /// If the grid cannot simulate a point.
    pub fn walks(&self) -> Result<u64, ErrorBudgetError> {
        self.simulation().walks(&self.patches())
    }

    /// Simulates all points and compares them with the file.
    ///
    /// # Errors
    /// [`ErrorBudgetError`] of any kind.
    pub fn certify(&self, control: &Control) -> Result<ErrorBudget, ErrorBudgetError> {
        let PartialErrorBudget {
            error_budget,
            skipped,
            ..
        } = self.certify_until_cancelled(control)?;
        let complete = error_budget.filter(|_| skipped.is_none());
        complete.ok_or(ErrorBudgetError::Cancelled)
    }

    /// Like [`Certification::certify`], but uses the simulations that ended if `control` is
    /// cancelled.
    ///
    /// # Errors
    /// [`ErrorBudgetError::Grid`], [`ErrorBudgetError::Engine`] and
    /// [`ErrorBudgetError::Lookup`].
    pub fn certify_until_cancelled(
        &self,
        control: &Control,
    ) -> Result<PartialErrorBudget, ErrorBudgetError> {
        let (trials, uncovered) = self.trials();
        let patches: Vec<Patch> = trials.iter().map(|trial| trial.patch.clone()).collect();
        let truth = self
            .simulation()
            .run_in_order(&patches, &interleaved(&trials), control)?;
        let (total, patches) = (count_anywhere(&trials), trials.len());
        let ended = trials.into_iter().zip(truth);
        let ended = ended.filter_map(|(trial, truth)| Some((trial, truth?)));
        let (trials, truth): (Vec<Trial>, Vec<Vec<Spectrum>>) = ended.unzip();
        let points = count_anywhere(&trials);
        let skipped = (trials.len() < patches).then(|| [patches - trials.len(), total - points]);
        if points == 0 {
            return Ok(PartialErrorBudget {
                error_budget: None,
                skipped,
                uncovered,
            });
        }
        let mut quantities = BTreeMap::new();
        let held = Quantity::ALL.into_iter().filter(|q| self.file.has(*q));
        for quantity in held {
            let errors = self.errors(quantity, &trials, &truth)?;
            quantities.insert(quantity.name().to_owned(), errors);
        }
        let error_budget = Some(ErrorBudget {
            points,
            rays: self.rays,
            seed: self.seed,
            quantities,
        });
        Ok(PartialErrorBudget {
            error_budget,
            skipped,
            uncovered,
        })
    }

    /// The errors of one quantity at the points of `trials`, whose simulations are `truth`.
    fn errors(
        &self,
        quantity: Quantity,
        trials: &[Trial],
        truth: &[Vec<Spectrum>],
    ) -> Result<QuantityErrors, ErrorBudgetError> {
        let lookups = |optional: Point| {
            let mut lookups = Vec::new();
            for database in [self.file, self.exact] {
                lookups.push(Lookup::new(&database.at(optional)?, quantity)?);
            }
            Ok::<_, LookupError>(lookups)
        };
        let nm = &self.grid.wavelengths_nm;
        let to_truth = Resampling::new(self.file.wavelengths_nm(), nm);
        let has_fewer = nm != self.file.wavelengths_nm();
        let to_file = Resampling::new(nm, self.file.wavelengths_nm());
        let mut buffer = vec![0.0; self.file.wavelengths_nm().len()];
        let mut evaluate = |lookup: &Lookup, point| -> Result<Vec<f64>, LookupError> {
            lookup.spectrum(point, &mut buffer)?;
            let values: Vec<f64> = buffer.iter().map(|v| f64::from(*v)).collect();
            Ok(to_truth.apply(&values))
        };
        let error = |a: &[f64], b: &[f64]| CurveError::between(a, b, self.colour);
        let mut collector = measures::Collector::default();
        let mut current: Option<(Point, Vec<Lookup>)> = None;
        for (trial, truth) in trials.iter().zip(truth) {
            let optional = trial.patch.snow.optional();
            let (_, lookups) = match current.take() {
                Some(same) if same.0 == optional => current.insert(same),
                _ => current.insert((optional, lookups(optional)?)),
            };
            let points = trial.patch.points().zip(&trial.kinds).zip(truth);
            for ((point, kind), truth) in points {
                let values = |errors: f64| -> Vec<f64> {
                    let measured = truth.of(quantity).iter();
                    measured.map(|m| m.value + errors * m.se).collect()
                };
                let truth = values(0.0);
                let answer = evaluate(&lookups[0], point)?;
                let curves = evaluate(&lookups[1], point)?;
                let linear_truth = to_truth.apply(&to_file.apply(&truth));
                let interpolated = error(&linear_truth, &curves);
                match kind {
                    PointKind::Anywhere => {
                        if has_fewer {
                            collector.wavelengths.push(error(&truth, &linear_truth));
                        }
                        let at = point.to_string();
                        collector.total.push((at, error(&truth, &answer)));
                        collector.compression.push(error(&curves, &answer));
                        collector.interpolation.push(interpolated);
                        collector.noise.push(error(&truth, &values(1.0)));
                    }
                    PointKind::Along(parameter) => {
                        let name = parameter.name().to_owned();
                        collector.axes.entry(name).or_default().push(interpolated);
                    }
                    PointKind::Slab => {}
                    PointKind::Nodes => collector.simulation.push(interpolated),
                }
            }
        }
        Ok(collector.finish())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameter::Parameter;

    #[test]
    fn every_prefix_holds_both_kinds() {
        let trial = |kind| Trial {
            patch: Patch {
                snow: Point::from([(Parameter::Facetness, 0.3)]),
                thickness_cm: vec![1.0],
                angle_deg: vec![0.0],
            },
            kinds: vec![kind],
        };
        let mut trials: Vec<Trial> = (0..30).map(|_| trial(PointKind::Anywhere)).collect();
        trials.extend((0..10).map(|_| trial(PointKind::Along(Parameter::GrainSize))));
        let order = interleaved(&trials);
        for n in 1..=order.len() {
            let along = order[..n].iter().filter(|i| **i >= 30).count();
            assert!(
                (along as f64 - n as f64 / 4.0).abs() <= 1.0,
                "{along} of {n}"
            );
        }
        let mut sorted = order;
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..40));
        assert_eq!(interleaved(&trials[..3]), [0, 1, 2]);
    }
}
