//! The job runner: runs the missing jobs of a database on all cores, and stores each job
//! when it is done.
mod error;
mod progress;
mod source;

use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use crate::engine::{Cache, Control, EngineError, Request, TableCounts, Units, exits};
use crate::grid::{Grid, GridError, GridViews, Job, Shard};
use crate::measurement::{Measured, Spectrum, ViewFactors, Views};
use crate::store::{Packer, Store, Survey};

pub use error::BatchError;
pub use progress::{Progress, RunInfo};
use source::Failure;
pub use source::ReuseSource;

/// Options of a run.
#[derive(Debug, Clone, Copy, Default)]
pub struct BatchOptions<'a> {
    /// Number of threads; 0 for one per core.
    pub threads: usize,
    /// Run only the jobs of this shard.
    pub shard: Option<Shard>,
    /// Receives progress reports.
    pub progress: Option<&'a dyn Progress>,
}

/// Summary of a run whose jobs are all done.
#[derive(Debug, Clone, PartialEq)]
pub struct BatchSummary {
    /// Number of jobs of the database or of the shard.
    pub jobs: u64,
    /// Number of jobs run now; the others were done before.
    pub run: u64,
    /// Number of spectra, of curves that exist, in the jobs run now.
    pub nodes: u64,
    /// Number of these spectra that were reused from other databases.
    pub reused: u64,
    /// Number of rays walked now.
    pub rays: u64,
    /// Share of the rays that hit an event limit, 0 to 1, over all jobs, including those
    /// done before: the mean over the jobs of each job's largest share over its curves and
    /// wavelengths.
    pub mean_lost_share: f64,
    /// The largest such share of any job.
    pub max_lost_share: f64,
    /// Number of parts of tables of grain events that were drawn or read now.
    pub tables: TableCounts,
    /// Why tables could not be shared with other processes; `None` if they could.
    pub unshared: Option<String>,
}

/// Runs the jobs of `grid` that are missing in `store`, which must have been opened for
/// this grid. `simulate` is an engine; its result must depend on the request alone.
///
/// Jobs are started in order, one per thread. At the end, when there are fewer jobs than
/// threads, a job may use several threads. The results do not depend on the threads.
/// Setting `cancel` stops the running jobs; a failure sets it.
///
/// # Errors
/// [`BatchError`] if a job fails, a file cannot be read or written, or the run is
/// cancelled. Jobs finished until then are stored and will not be run again.
pub fn run<S>(
    grid: &Grid,
    store: &Store,
    simulate: S,
    options: &BatchOptions<'_>,
    cancel: &AtomicBool,
) -> Result<BatchSummary, BatchError>
where
    S: Fn(&Request<'_>, &Control<'_>) -> Result<Vec<Spectrum>, EngineError> + Sync,
{
    run_from(grid, store, &[], simulate, options, cancel)
}

/// As [`run`], but reuses the spectra that are in `sources`.
///
/// # Errors
/// As [`run`], and if a source cannot be read.
pub fn run_from<S>(
    grid: &Grid,
    store: &Store,
    sources: &[ReuseSource],
    simulate: S,
    options: &BatchOptions<'_>,
    cancel: &AtomicBool,
) -> Result<BatchSummary, BatchError>
where
    S: Fn(&Request<'_>, &Control<'_>) -> Result<Vec<Spectrum>, EngineError> + Sync,
{
    run_surveyed(grid, (store, None), sources, simulate, options, cancel)
}

/// As [`run_from`]; `surveyed` is the state of `store`, if it is known, so that the files of the
/// database are not read again.
///
/// # Errors
/// As [`run_from`].
pub(crate) fn run_surveyed<S>(
    grid: &Grid,
    (store, surveyed): (&Store, Option<Survey>),
    sources: &[ReuseSource],
    simulate: S,
    options: &BatchOptions<'_>,
    cancel: &AtomicBool,
) -> Result<BatchSummary, BatchError>
where
    S: Fn(&Request<'_>, &Control<'_>) -> Result<Vec<Spectrum>, EngineError> + Sync,
{
    let views = grid.views.as_ref().map(GridViews::views).transpose();
    let views = views.map_err(GridError::Views)?;
    // A shard trusts the commit marks. The run of all jobs checks every file once, for all shards.
    let (own, missing, loose) = match options.shard {
        None => {
            let survey = surveyed.map_or_else(|| store.survey(), Ok);
            let Survey { missing, loose } = survey?;
            (0..store.jobs().count(), missing, loose)
        }
        Some(shard) => {
            let own = shard.range(store.jobs());
            let mut missing = store.unmarked()?;
            missing.retain(|job| own.contains(job));
            let loose = store.loose_of(&own)?;
            (own, missing, loose)
        }
    };
    store.check_space(missing.len() as u64)?;
    let packer = Packer::new(store, &own, &missing, &loose)?;
    let total = own.end - own.start;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads)
        .build()
        .map_err(|error| BatchError::Threads(error.to_string()))?;
    let rays = Arc::new(AtomicU64::new(0));
    let remaining = missing.len() as u64;
    let progress = options.progress.filter(|_| remaining > 0);
    if let Some(progress) = progress {
        progress.begin(RunInfo {
            done: total - remaining,
            jobs: total,
            curves_per_job: store.jobs().curves_per_job(),
            rays: Arc::clone(&rays),
        });
    }
    let mut cache = Cache::tables_only();
    let tables = store.table_directory()?;
    if options.shard.is_some() || pool.current_num_threads() > 1 {
        cache = cache.with_table_store(Box::new(tables.clone()));
    }
    let next = AtomicUsize::new(0);
    let (finished, nodes) = (AtomicU64::new(0), AtomicU64::new(0));
    let reused = AtomicU64::new(0);
    let failure: Mutex<Option<BatchError>> = Mutex::new(None);
    let fail = |error| {
        cancel.store(true, Ordering::Relaxed);
        let mut failure = failure.lock().unwrap_or_else(PoisonError::into_inner);
        failure.get_or_insert(error);
    };
    pool.broadcast(|worker| {
        while !cancel.load(Ordering::Relaxed) {
            let position = next.fetch_add(1, Ordering::Relaxed);
            let Some(&job) = missing.get(position) else {
                break;
            };
            let control = Control {
                parallel: missing.len() - position < worker.num_threads(),
                cancel,
                rays_done: &rays,
                cache: &cache,
            };
            match run_job(
                (grid, views.as_ref()),
                store,
                sources,
                &simulate,
                job,
                &control,
            ) {
                Ok([job_reused, job_nodes]) => {
                    if let Err(error) = packer.committed(job) {
                        return fail(error.into());
                    }
                    reused.fetch_add(job_reused, Ordering::Relaxed);
                    nodes.fetch_add(job_nodes, Ordering::Relaxed);
                    finished.fetch_add(1, Ordering::Relaxed);
                    if let Some(progress) = progress {
                        progress.job_done();
                    }
                }
                Err(None) => break,
                Err(Some(error)) => fail(error),
            }
        }
    });
    if let Some(progress) = progress {
        progress.end();
    }
    if let Some(error) = failure.into_inner().unwrap_or_else(PoisonError::into_inner) {
        return Err(error);
    }
    let run = finished.into_inner();
    let remaining = remaining - run;
    if remaining > 0 {
        return Err(BatchError::Interrupted {
            done: total - remaining,
            total,
        });
    }
    let (mut sum, mut max_lost_share) = (0.0, 0.0_f64);
    for share in store.lost_shares(own)? {
        sum += share;
        max_lost_share = max_lost_share.max(share);
    }
    Ok(BatchSummary {
        jobs: total,
        run,
        nodes: nodes.into_inner(),
        reused: reused.into_inner(),
        rays: rays.load(Ordering::Relaxed),
        mean_lost_share: sum / total.max(1) as f64,
        max_lost_share,
        tables: cache.table_counts(),
        unshared: tables.failure().map(|error| error.to_string()),
    })
}

/// Runs and stores one job. Returns the number of its spectra that were reused from
/// `sources`, and the number of all its spectra; `Err(None)` if it was cancelled.
fn run_job<S>(
    (grid, views): (&Grid, Option<&Views>),
    store: &Store,
    sources: &[ReuseSource],
    simulate: &S,
    number: u64,
    control: &Control<'_>,
) -> Result<[u64; 2], Option<BatchError>>
where
    S: Fn(&Request<'_>, &Control<'_>) -> Result<Vec<Spectrum>, EngineError>,
{
    let job = grid
        .job(store.jobs(), number)
        .map_err(|error| Some(BatchError::Grid(error)))?;
    // The units of this job that earlier runs finished, and the storage for further ones.
    let (unit_directory, stored_units) = store
        .unit_directory(number)
        .map_err(|error| Some(BatchError::Store(error)))?;
    let units = Units::new(Box::new(unit_directory.clone()), &stored_units);
    let cache = control.cache.with(units);
    let control = Control {
        cache: &cache,
        ..*control
    };
    let outcome = source::spectra(grid, &job, sources, simulate, &control);
    let saved = match outcome {
        Err(Failure::Engine(EngineError::Cancelled)) => cache.save_units(),
        _ => Ok(()),
    };
    if let Some(error) = unit_directory.failure() {
        return Err(Some(BatchError::Store(error)));
    }
    let outcome = saved.map_err(Failure::Engine).and(outcome);
    let failed = |error| match error {
        EngineError::Cancelled => None,
        source => Some(BatchError::Job {
            number,
            job: job.to_string(),
            source,
        }),
    };
    let (spectra, reused) = outcome.map_err(|failure| match failure {
        Failure::Engine(error) => failed(error),
        Failure::Source(error) => Some(error),
    })?;
    let factors = factors(grid, views, &job, &spectra, &control);
    let saved = match factors {
        Err(EngineError::Cancelled) => cache.save_units(),
        _ => Ok(()),
    };
    if let Some(error) = unit_directory.failure() {
        return Err(Some(BatchError::Store(error)));
    }
    let factors = saved.and(factors).map_err(failed)?;
    let spectra = job.completed(spectra, grid.wavelengths_nm.len());
    store
        .commit(number, &spectra, &factors)
        .map_err(|error| Some(BatchError::Store(error)))?;
    Ok([reused, source::node_count(&job)])
}

/// The factors toward the views of `grid` of all curves of `job`, whose `spectra` are those of the
/// curves that exist; empty if the grid has no views.
fn factors(
    grid: &Grid,
    views: Option<&Views>,
    job: &Job,
    spectra: &[Spectrum],
    control: &Control<'_>,
) -> Result<Vec<ViewFactors>, EngineError> {
    let (Some(grid_views), Some(views)) = (&grid.views, views) else {
        return Ok(Vec::new());
    };
    // as the store holds them, so that reused spectra give the same factors
    let single = |measured: &Measured| Measured {
        value: f64::from(measured.value as f32),
        se: f64::from(measured.se as f32),
    };
    let stored = spectra.iter().map(|spectrum| Spectrum {
        reflectance: spectrum.reflectance.iter().map(single).collect(),
        transmittance: spectrum.transmittance.iter().map(single).collect(),
        lost: Vec::new(),
    });
    let stored: Vec<_> = stored.collect();
    let how = (views, grid_views.rays);
    let request = job.request(grid);
    let factors = exits::view_factors(grid.run.engine, &request, how, &stored, control)?;
    let wavelengths = grid.wavelengths_nm.len();
    let lights = job.illuminations.iter().cycle();
    let factors = factors.into_iter().zip(lights);
    let factors =
        factors.map(|(factors, light)| grid_views.stored_under(light, factors, wavelengths));
    Ok(job.completed_views(factors.collect(), grid_views, wavelengths))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::collections::BTreeMap;

    use super::*;
    use crate::engine::Engine;
    use crate::grid::tests::small;
    use crate::measurement::Measured;
    use crate::store::{Access, StoreError};

    fn simulate(request: &Request, _: &Control) -> Result<Vec<Spectrum>, EngineError> {
        let n = request.wavelengths_nm.len();
        let spectrum = Spectrum {
            reflectance: vec![
                Measured {
                    value: 0.5,
                    se: 1e-3
                };
                n
            ],
            transmittance: vec![
                Measured {
                    value: 0.25,
                    se: 1e-3
                };
                n
            ],
            lost: vec![0.0; n],
        };
        Ok(vec![spectrum; request.thicknesses_m.len()])
    }

    /// Wherever the disk fills up, one clear error, and the run goes on later.
    #[test]
    fn a_full_disk_loses_nothing() {
        let grid = small(Engine::Spectral);
        // Eight jobs of one file, then a pack of six.
        for writes in 0..14 {
            let dir = tempfile::tempdir().unwrap();
            let build = || Store::build(dir.path(), &grid, &BTreeMap::new(), Access::Exclusive);
            let run = |store: &Store| {
                let options = BatchOptions {
                    threads: 1,
                    ..BatchOptions::default()
                };
                run(&grid, store, simulate, &options, &AtomicBool::new(false))
            };
            let store = build().unwrap();
            store.fill_disk_after(writes);
            let error = run(&store).unwrap_err();
            let full = matches!(error, BatchError::Store(StoreError::DiskFull { .. }));
            assert!(full, "{error}");
            drop(store);
            let store = build().unwrap();
            let done = writes.min(8);
            let missing: Vec<u64> = (done..8).collect();
            assert_eq!(store.survey().unwrap().missing, missing);
            assert_eq!(run(&store).unwrap().run, 8 - done);
            assert!(store.verify().unwrap().is_whole());
        }
    }
}
