//! Databases whose spectra another one takes over: a grid that grows keeps what
//! it has.
//!
//! A node, one spectrum, is a function of its own parameters and of what a whole
//! database has in common ([`crate::engine::identity`]), so that it is copied from
//! any database in which the latter is the same. Where walks are resumed from one
//! thickness to the next, in `spectral`, `tabulated` and where `auto` chose one of
//! these, all thicknesses of a snow under a light are one node.
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use super::BatchError;
use crate::config;
use crate::engine::{Control, EngineError, Request, identity};
use crate::grid::{Grid, Job};
use crate::measurement::Spectrum;
use crate::store::Store;
use crate::transport::Illumination;

/// A database, whole or not, to take spectra over from.
#[derive(Debug)]
pub struct Source {
    store: Store,
    grid: Grid,
    /// Jobs of each snow, by [`identity::of_snowpack`].
    jobs: HashMap<u64, Vec<u64>>,
}

impl Source {
    /// The one in the directory `path`, or that is `path`, for a database of `grid`
    /// and `inputs` (see [`Store::build`]). Tables that its grid names are looked
    /// for beside `file`, the grid file.
    ///
    /// # Errors
    /// There is none, it is damaged, or it differs in more than the values of the
    /// axes.
    pub fn open(
        path: &Path,
        grid: &Grid,
        inputs: &BTreeMap<String, String>,
        file: &Path,
    ) -> Result<Self, BatchError> {
        let store = Store::open_source(path, grid, inputs)?;
        let name = file.display().to_string();
        let parsed = config::grid::parse(&name, store.config());
        let grid = parsed
            .map_err(|error| BatchError::Source {
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

    /// Fills in those of the spectra of `job` in `grid` that are here.
    fn fill(
        &self,
        grid: &Grid,
        job: &Job,
        spectra: &mut [Option<Spectrum>],
    ) -> Result<(), BatchError> {
        let snow = identity::of_snowpack(&job.snowpack);
        let lights = job.illuminations.len();
        let wanted = existing(job);
        for number in self.jobs.get(&snow).into_iter().flatten() {
            let there = self.grid.job(self.store.jobs(), *number)?;
            let same_slabs = existing(&there) == wanted;
            let mut pairs = Vec::new();
            for (from, light) in there.illuminations.iter().enumerate() {
                let mut all = job.illuminations.iter();
                let Some(to) = all.position(|other| other == light) else {
                    continue;
                };
                if !same_slabs && !keeps_thicknesses_apart(grid, job, to) {
                    continue;
                }
                for (h, thickness_m) in existing(&there).iter().enumerate() {
                    let slab = wanted.iter().position(|other| other == thickness_m);
                    let curve = (there.absent + h) * there.illuminations.len() + from;
                    pairs.extend(slab.map(|slab| (curve, slab * lights + to)));
                }
            }
            if pairs.iter().all(|(_, to)| spectra[*to].is_some()) {
                continue;
            }
            let Some(found) = self.store.spectra(*number)? else {
                continue;
            };
            // the lost share is that of the worst curve, which may be one of those left
            let lost = found.iter().flat_map(|spectrum| &spectrum.lost);
            let curves = existing(&there).len() * there.illuminations.len();
            if pairs.len() < curves && lost.into_iter().any(|share| *share > 0.0) {
                continue;
            }
            for (from, to) in pairs {
                spectra[to].get_or_insert_with(|| found[from].clone());
            }
        }
        Ok(())
    }
}

/// The thicknesses of `job` whose curves exist, m.
fn existing(job: &Job) -> &[f64] {
    job.thicknesses_m.get(job.absent..).unwrap_or_default()
}

/// How many nodes of a job exist.
pub(super) fn nodes(job: &Job) -> u64 {
    (existing(job).len() * job.illuminations.len()) as u64
}

/// Whether what `job` gives under its `light` for one thickness does not depend on
/// the others.
fn keeps_thicknesses_apart(grid: &Grid, job: &Job, light: usize) -> bool {
    let lights: &[Illumination] = &job.illuminations[light..=light];
    let request = Request {
        illuminations: lights,
        ..job.request(grid)
    };
    grid.run.engine.resolve(&request).keeps_thicknesses_apart()
}

/// The spectra of `job` in `grid` that exist, per thickness and light, and how many of them
/// come from `sources`; `simulate` does the rest.
pub(super) fn spectra<S>(
    grid: &Grid,
    job: &Job,
    sources: &[Source],
    simulate: &S,
    control: &Control<'_>,
) -> Result<(Vec<Spectrum>, u64), Failure>
where
    S: Fn(&Request<'_>, &Control<'_>) -> Result<Vec<Spectrum>, EngineError>,
{
    let (lights, all_m) = (job.illuminations.len(), existing(job));
    let mut spectra = vec![None; all_m.len() * lights];
    for source in sources {
        source.fill(grid, job, &mut spectra)?;
    }
    let taken = spectra.iter().flatten().count() as u64;
    for (slabs, lit) in missing(&spectra, lights) {
        let thicknesses_m: Vec<f64> = slabs.iter().map(|h| all_m[*h]).collect();
        let illuminations: Vec<_> = lit.iter().map(|i| job.illuminations[*i]).collect();
        let request = Request {
            thicknesses_m: &thicknesses_m,
            illuminations: &illuminations,
            ..job.request(grid)
        };
        let mut found = simulate(&request, control)?.into_iter();
        for h in slabs {
            for light in &lit {
                spectra[h * lights + light] = found.next();
            }
        }
    }
    // what an engine does not give, the store misses
    Ok((spectra.into_iter().flatten().collect(), taken))
}

/// Why [`spectra`] gave none.
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

/// Which thicknesses are missing under which lights: the lights that miss the same
/// ones together, so that all thicknesses of a light are asked for at once.
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
            Some((_, lit)) => lit.push(light),
            None => groups.push((slabs, vec![light])),
        }
    }
    groups
}
