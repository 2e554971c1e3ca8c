//! Runs every setting on every sample.
use super::measure::{Bench, Tables, TimedRun, failed, request};
use super::truth::{Truth, values};
use super::{Metrics, NamedSample, Setting, SpectralDomain, TradeoffError, ladder};
use crate::accuracy::mean;
use crate::colour::Colorimeter;
use crate::engine::Engine;
use crate::measurement::Quantity;

/// Share of the budget that may be spent when all settings have run.
const SHARE: f64 = 0.8;

/// The origin of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowKind {
    /// Measured in runs of this setting.
    Measured,
    /// Extrapolated from a run with fewer rays and the truth.
    Extrapolated,
}

impl RowKind {
    /// The name used in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Extrapolated => "extrapolated",
        }
    }
}

/// The result of one setting on one sample, for one quantity in one band.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Name of the sample.
    pub sample: String,
    /// The setting.
    pub setting: Setting,
    /// The origin of the row.
    pub kind: RowKind,
    /// Number of runs, each with its own seed; 0 if extrapolated.
    pub seeds: u64,
    /// Band of wavelengths.
    pub band: SpectralDomain,
    /// Quantity that was compared.
    pub quantity: Quantity,
    /// CPU seconds of one run, which gives both quantities of the band: mean, minimum and
    /// maximum over the seeds.
    pub cpu_seconds: [f64; 3],
    /// CPU seconds of making the tables of grain events before the run, mean over the seeds.
    pub table_seconds: f64,
    /// Root mean square over the seeds of each error measure.
    pub error: Metrics,
    /// Standard error of the truth in the same measures.
    pub floor: Metrics,
    /// Rays of the truth.
    pub truth_rays: u64,
}

/// A setting that an engine refused on a sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Refusal {
    /// Name of the sample.
    pub sample: String,
    /// The setting.
    pub setting: Setting,
    /// Band of wavelengths.
    pub band: SpectralDomain,
    /// The engine's reason.
    pub reason: String,
}

/// One run, or the engine's reason for refusing it.
type Outcome = Result<TimedRun, String>;

/// Runs the ladders of settings and collects the results.
pub(super) struct Sweep<'a> {
    bench: &'a Bench<'a>,
    samples: &'a [NamedSample],
    truths: &'a [Vec<Truth>],
    seeds: u64,
    colours: Vec<Option<Colorimeter>>,
    /// Tables: `[sample][band][seed]`, the last running fastest.
    tables: Vec<Tables>,
    rows: Vec<Row>,
    refusals: Vec<Refusal>,
}

impl<'a> Sweep<'a> {
    /// A sweep over `samples`, whose truths are `truths`, `[sample][band]`.
    pub(super) fn new(
        bench: &'a Bench<'a>,
        samples: &'a [NamedSample],
        truths: &'a [Vec<Truth>],
        seeds: u64,
    ) -> Result<Self, TradeoffError> {
        let colours: Result<_, _> = SpectralDomain::ALL
            .into_iter()
            .map(SpectralDomain::colorimeter)
            .collect();
        Ok(Self {
            bench,
            samples,
            truths,
            seeds,
            colours: colours?,
            tables: (0..samples.len() * SpectralDomain::ALL.len() * seeds as usize)
                .map(|_| Tables::default())
                .collect(),
            rows: Vec::new(),
            refusals: Vec::new(),
        })
    }

    /// Runs the settings of `engine` that fit into its share of the budget, and the first setting
    /// in any case. `engines_left` engines, including this one, share the remaining budget.
    pub(super) fn climb(
        &mut self,
        engine: Engine,
        engines_left: usize,
        say: &dyn Fn(&str),
    ) -> Result<(), TradeoffError> {
        let mut allowance = self.bench.left_of(SHARE) / engines_left.max(1) as f64;
        // Cost and rays of the last setting.
        let mut last: Option<(f64, u64)> = None;
        for setting in ladder(engine) {
            let expected =
                last.map_or(0.0, |(cost, rays)| cost * setting.rays as f64 / rays as f64);
            if expected > allowance {
                continue;
            }
            say(&setting.to_string());
            let cost = self.run(&setting)?;
            allowance -= cost;
            last = Some((cost, setting.rays));
        }
        Ok(())
    }

    /// Runs one setting on all samples, bands and seeds; returns the CPU seconds spent.
    fn run(&mut self, setting: &Setting) -> Result<f64, TradeoffError> {
        let mut items = Vec::new();
        for sample in self.samples {
            for band in SpectralDomain::ALL {
                items.extend((1..=self.seeds).map(|seed| (sample, band, seed)));
            }
        }
        let items: Vec<_> = items.into_iter().zip(&self.tables).collect();
        let outcomes = self.bench.map(&items, |&((sample, band, seed), tables)| {
            self.run_one(setting, sample, band, seed, tables)
        })?;
        let cost = outcomes.iter().flatten().map(|run| run.cpu_seconds).sum();
        let mut outcomes = outcomes.into_iter();
        for (sample, truths) in self.samples.iter().zip(self.truths) {
            for (band, truth) in SpectralDomain::ALL.into_iter().zip(truths) {
                let runs: Result<Vec<_>, _> = outcomes.by_ref().take(self.seeds as usize).collect();
                match runs {
                    Ok(runs) => self.compare(setting, sample, band, truth, &runs),
                    Err(reason) => self.refusals.push(Refusal {
                        sample: sample.name.clone(),
                        setting: *setting,
                        band,
                        reason,
                    }),
                }
            }
        }
        Ok(cost)
    }

    /// Runs one setting on one sample, band and seed.
    fn run_one(
        &self,
        setting: &Setting,
        sample: &NamedSample,
        band: SpectralDomain,
        seed: u64,
        tables: &Tables,
    ) -> Result<Outcome, TradeoffError> {
        let nm = band.wavelengths_nm();
        let thickness = [sample.file.thickness_m];
        let request = request(setting, sample, &thickness, &nm, seed);
        match self.bench.run(setting, &request, tables) {
            Ok(run) => Ok(Ok(run)),
            Err(error) => match failed(sample, setting, error) {
                TradeoffError::Engine { source, .. } => Ok(Err(source.to_string())),
                other => Err(other),
            },
        }
    }

    /// Adds the rows that compare `runs` with the truth.
    fn compare(
        &mut self,
        setting: &Setting,
        sample: &NamedSample,
        band: SpectralDomain,
        truth: &Truth,
        runs: &[TimedRun],
    ) {
        let seconds: Vec<f64> = runs.iter().map(|run| run.cpu_seconds).collect();
        let table_seconds: Vec<f64> = runs.iter().map(|run| run.table_seconds).collect();
        let least = seconds.iter().copied().fold(f64::INFINITY, f64::min);
        let most = seconds.iter().copied().fold(0.0, f64::max);
        let colour = self.colours[band as usize].as_ref();
        for quantity in Quantity::ALL {
            let expected = truth.of(quantity);
            let distances: Vec<_> = runs
                .iter()
                .map(|run| Metrics::between(&values(&run.spectra[0], quantity), &expected, colour))
                .collect();
            self.rows.push(Row {
                sample: sample.name.clone(),
                setting: *setting,
                kind: RowKind::Measured,
                seeds: self.seeds,
                band,
                quantity,
                cpu_seconds: [mean(&seconds), least, most],
                table_seconds: mean(&table_seconds),
                error: Metrics::rms(&distances),
                floor: truth.standard_error(quantity, colour),
                truth_rays: truth.rays,
            });
        }
    }

    /// The measured rows and the refused settings.
    pub(super) fn finish(self) -> (Vec<Row>, Vec<Refusal>) {
        (self.rows, self.refusals)
    }
}
