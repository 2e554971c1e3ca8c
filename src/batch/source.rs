//! Reuse of the spectra of other databases, so that an extended grid does not repeat
//! simulations.
//!
//! The spectrum of a node depends only on its own parameters and on the settings that a
//! whole database shares ([`crate::engine::identity`]). It can thus be copied from any
//! database with the same settings. `spectral` and `tabulated` (also if `auto` selects
//! them) continue walks from one thickness to the next, so that with these engines all
//! thicknesses of a snow under an illumination must be the same.
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use super::BatchError;
use crate::config;
use crate::engine::{Control, EngineError, Request, identity};
use crate::grid::{Grid, Job};
use crate::measurement::Spectrum;
use crate::store::Store;
use crate::transport::Illumination;

/// A finished or unfinished database whose spectra are reused.
#[derive(Debug)]
pub struct ReuseSource {
    store: Store,
    grid: Grid,
    /// Job numbers of each snowpack, by [`identity::of_snowpack`].
    jobs: HashMap<u64, Vec<u64>>,
}

impl ReuseSource {
    /// Opens a database to reuse its spectra in the database of `grid` and `inputs` (see
    /// [`Store::build`]). `path` is the database or its output directory. Data tables that
    /// its grid names are searched for in the directory of the grid file `file`.
    ///
    /// # Errors
    /// [`BatchError`] if the database does not exist, is damaged, or differs in more than
    /// the values of the axes.
    pub fn open(
        path: &Path,
        grid: &Grid,
        inputs: &BTreeMap<String, String>,
        file: &Path,
    ) -> Result<Self, BatchError> {
        let store = Store::open_for_reuse(path, grid, inputs)?;
        let name = file.display().to_string();
        let parsed = config::grid::parse(&name, store.config());
        let grid = parsed
            .map_err(|error| BatchError::Reuse {
                path: path.into(),
                reason: error.to_string(),
            })?
            .grid;
        let mut jobs: HashMap<u64, Vec<u64>> = HashMap::new();
        for number in 0..store.jobs().count() {
            let job = grid.job(store.jobs(), number)?;
            let snow = identity::of_snowpack(&job.snowpack);
            jobs.entry(snow).or_default().push(number);
        }
        Ok(Self { store, grid, jobs })
    }

    /// Fills in the missing spectra of `job` in `grid` that this database has.
    fn fill(
        &self,
        grid: &Grid,
        job: &Job,
        spectra: &mut [Option<Spectrum>],
    ) -> Result<(), BatchError> {
        let snow = identity::of_snowpack(&job.snowpack);
        let lights = job.illuminations.len();
        let wanted_m = existing(job);
        for number in self.jobs.get(&snow).into_iter().flatten() {
            let source_job = self.grid.job(self.store.jobs(), *number)?;
            let same_slabs = existing(&source_job) == wanted_m;
            let mut pairs = Vec::new();
            for (from, light) in source_job.illuminations.iter().enumerate() {
                let mut illuminations = job.illuminations.iter();
                let Some(to) = illuminations.position(|other| other == light) else {
                    continue;
                };
                if !same_slabs && !has_independent_thicknesses(grid, job, to) {
                    continue;
                }
                for (h, thickness_m) in existing(&source_job).iter().enumerate() {
                    let slab = wanted_m.iter().position(|other| other == thickness_m);
                    let curve = (source_job.absent + h) * source_job.illuminations.len() + from;
                    pairs.extend(slab.map(|slab| (curve, slab * lights + to)));
                }
            }
            if pairs.iter().all(|(_, to)| spectra[*to].is_some()) {
                continue;
            }
            let Some(stored) = self.store.spectra(*number)? else {
                continue;
            };
            // the share of lost rays is stored per job: that of single curves is not known
            let lost = stored.iter().flat_map(|spectrum| &spectrum.lost);
            let curves = existing(&source_job).len() * source_job.illuminations.len();
            if pairs.len() < curves && lost.into_iter().any(|share| *share > 0.0) {
                continue;
            }
            for (from, to) in pairs {
                spectra[to].get_or_insert_with(|| stored[from].clone());
            }
        }
        Ok(())
    }
}

/// The thicknesses, m, of `job` whose curves exist.
fn existing(job: &Job) -> &[f64] {
    job.thicknesses_m.get(job.absent..).unwrap_or_default()
}

/// Number of nodes of a job whose curves exist.
pub(super) fn node_count(job: &Job) -> u64 {
    (existing(job).len() * job.illuminations.len()) as u64
}

/// Whether the spectrum of `job` at one thickness under its illumination `light` is
/// independent of its other thicknesses.
fn has_independent_thicknesses(grid: &Grid, job: &Job, light: usize) -> bool {
    let lights: &[Illumination] = &job.illuminations[light..=light];
    let request = Request {
        illuminations: lights,
        ..job.request(grid)
    };
    grid.run
        .engine
        .resolve(&request)
        .has_independent_thicknesses()
}

/// The spectra of `job` in `grid` that exist, per thickness and illumination, and the number
/// of them that were reused from `sources`. `simulate` computes the others.
pub(super) fn spectra<S>(
    grid: &Grid,
    job: &Job,
    sources: &[ReuseSource],
    simulate: &S,
    control: &Control<'_>,
) -> Result<(Vec<Spectrum>, u64), Failure>
where
    S: Fn(&Request<'_>, &Control<'_>) -> Result<Vec<Spectrum>, EngineError>,
{
    let (lights, existing_m) = (job.illuminations.len(), existing(job));
    let mut spectra = vec![None; existing_m.len() * lights];
    for source in sources {
        source.fill(grid, job, &mut spectra)?;
    }
    let reused = spectra.iter().flatten().count() as u64;
    for (slabs, group_lights) in missing(&spectra, lights) {
        let thicknesses_m: Vec<f64> = slabs.iter().map(|h| existing_m[*h]).collect();
        let illuminations: Vec<_> = group_lights.iter().map(|i| job.illuminations[*i]).collect();
        let request = Request {
            thicknesses_m: &thicknesses_m,
            illuminations: &illuminations,
            ..job.request(grid)
        };
        let mut simulated = simulate(&request, control)?.into_iter();
        for h in slabs {
            for light in &group_lights {
                spectra[h * lights + light] = simulated.next();
            }
        }
    }
    // the store refuses the job if the engine returned too few spectra
    Ok((spectra.into_iter().flatten().collect(), reused))
}

/// Why [`spectra`] failed.
pub(super) enum Failure {
    Engine(EngineError),
    Source(BatchError),
}

impl From<EngineError> for Failure {
    fn from(error: EngineError) -> Self {
        Self::Engine(error)
    }
}

impl From<BatchError> for Failure {
    fn from(error: BatchError) -> Self {
        Self::Source(error)
    }
}

/// The missing thicknesses and illuminations. Illuminations with the same missing
/// thicknesses form a group, so that one request has all missing thicknesses of an
/// illumination.
fn missing<T>(spectra: &[Option<T>], lights: usize) -> Vec<(Vec<usize>, Vec<usize>)> {
    let mut groups: Vec<(Vec<usize>, Vec<usize>)> = Vec::new();
    for light in 0..lights {
        let column = spectra.iter().skip(light).step_by(lights).enumerate();
        let slabs: Vec<usize> = column
            .filter(|(_, s)| s.is_none())
            .map(|(h, _)| h)
            .collect();
        match groups.iter_mut().find(|(same, _)| *same == slabs) {
            _ if slabs.is_empty() => {}
            Some((_, group_lights)) => group_lights.push(light),
            None => groups.push((slabs, vec![light])),
        }
    }
    groups
}
