//! The walks next to the planes, at one pair of refractive indices.
use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::Run;
use super::cut::Task;
use crate::engine::cache::Bytes;
use crate::engine::tables::{self, Averages, Outcomes, PARTS, SnowpackOutcomes, Stretch};
use crate::engine::{Control, EngineError, Resolution, batches, engine_error};
use crate::optics::Index;
use crate::rng::{Fingerprint, Key, Stream};
use crate::table::{Kernel, Region, Scores};
use crate::transport::{Layer, Model, Snow};

/// What grain events do on average and what walks with them came to.
#[derive(Debug)]
pub(in crate::engine) struct Walks {
    /// Of the grains of each type in each layer, in air and in water.
    averages: SnowpackAverages,
    /// What came of each task in each part.
    parts: Vec<Vec<Scores>>,
}

/// Of each type in each layer, in air and in water.
type SnowpackAverages = Vec<Vec<[Arc<Averages>; 2]>>;

/// Walks with one stream, at most: some seconds.
const BATCH: u64 = 1 << 20;

/// Name of a unit of `run`: a request, of which a job may take several, walks what
/// its tasks say.
pub(super) fn unit(run: &Run, kind: &str) -> String {
    let tasks = Fingerprint::of("tasks");
    let tasks = run.plan.tasks.iter().fold(tasks, |digest, task| {
        let purpose = task.purpose().map(u64::from);
        purpose.into_iter().fold(digest, Fingerprint::and_bits)
    });
    format!("{kind} {:x} {:x}", run.request.cell, tasks.finish())
}

/// All that walks follow from.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::engine) struct CacheKey {
    surface: Snow,
    below: Vec<Layer>,
    tasks: Vec<Task>,
    node: (Index, Index),
    model: Model,
    resolution: Resolution,
    seed: u64,
    cell: u64,
}

impl Walks {
    /// Those of `run` at the indices `node` of ice and water.
    pub(super) fn of(
        run: &Run,
        control: &Control,
        node: (Index, Index),
    ) -> Result<Arc<Self>, EngineError> {
        let request = run.request;
        let occasion = CacheKey {
            surface: request.snowpack.surface.clone(),
            below: request.snowpack.below.clone(),
            tasks: run.plan.tasks.clone(),
            node,
            model: request.model.clone(),
            resolution: request.resolution,
            seed: request.seed,
            cell: request.cell,
        };
        let walks = &control.cache.walks;
        walks.get(&occasion, || Self::new(run, control, node))
    }

    /// What came of task number `task` in `part`.
    pub(super) fn scores(&self, part: usize, task: usize) -> &Scores {
        &self.parts[part][task]
    }

    /// Averages over the grain events of `part` in the `snow`-th layer, of each
    /// type in air and in water.
    pub(super) fn kernels(&self, part: usize, snow: usize) -> impl Iterator<Item = [&Kernel; 2]> {
        let media = self.averages[snow].iter();
        media.map(move |[air, water]| [&air.kernels[part], &water.kernels[part]])
    }

    fn new(run: &Run, control: &Control, node: (Index, Index)) -> Result<Self, EngineError> {
        let (request, units) = (run.request, &control.cache.units);
        let indices = [node.0.n, node.0.k, node.1.n, node.1.k].map(f64::to_bits);
        let name = format!("{} {indices:x?}", unit(run, "walks"));
        let tasks = &run.plan.tasks;
        let batches = tasks.iter().flat_map(|task| {
            (0..task.rays)
                .step_by(BATCH as usize)
                .map(move |first| (task, first))
        });
        let batches = batches.collect::<Vec<_>>();
        let one = |part: usize, task: &Task, first: u64, outcomes: &SnowpackOutcomes| {
            if control.cancel.load(Ordering::Relaxed) {
                return Err(EngineError::Cancelled);
            }
            let stream = Stream::new(Key {
                seed: request.seed,
                cell: request.cell,
                // the same at all nodes, so that noise does not bury dispersion
                purpose: task.purpose(),
                batch: part as u64 + PARTS as u64 * (first / BATCH),
            });
            let thickness = |stretch: &Stretch| stretch.thickness_m;
            let region = Region {
                snowpack: tables::snowpack(request, outcomes, part, &task.stretches),
                thickness_m: task.stretches.iter().map(thickness).sum(),
                edges: task.edges,
            };
            let rays = BATCH.min(task.rays - first);
            let scores = region.walk(task.source, rays, task.moments, stream);
            control.rays_done.fetch_add(rays, Ordering::Relaxed);
            let mut scores = scores.map_err(|error| engine_error(request, error))?;
            scores.shrink();
            Ok(scores)
        };
        let unit = |i: usize| format!("{name} {i}");
        let count = PARTS * batches.len();
        let mut scores: Vec<Option<Scores>> = (0..count).map(|i| units.take(&unit(i))).collect();
        let missing: Vec<usize> = (0..count).filter(|i| scores[*i].is_none()).collect();
        let kept: Option<Vec<Vec<[Averages; 2]>>> = units.take(&name);
        let averages = match kept.filter(|_| missing.is_empty()) {
            Some(kept) => {
                let shared = kept.into_iter().map(|kinds| {
                    let kinds = kinds.into_iter();
                    kinds.map(|media| media.map(Arc::new)).collect()
                });
                shared.collect()
            }
            None => {
                let outcomes = tables::outcomes(request, control, node)?;
                let walked = batches::map(control, missing.clone(), |i| {
                    let (task, first) = batches[i % batches.len()];
                    let walked = one(i / batches.len(), task, first, &outcomes)?;
                    units.add(&unit(i), &walked)?;
                    Ok(walked)
                })?;
                for (i, walked) in missing.into_iter().zip(walked) {
                    scores[i] = Some(walked);
                }
                // the tables themselves are done with
                let averages = averages(outcomes);
                let plain = averages.iter().map(|kinds| {
                    let kinds = kinds.iter();
                    kinds
                        .map(|media| media.each_ref().map(AsRef::as_ref))
                        .collect()
                });
                units.add(&name, &plain.collect::<Vec<Vec<[&Averages; 2]>>>())?;
                averages
            }
        };
        let mut scores = scores.into_iter().flatten();
        let mut part = || -> Vec<Scores> {
            let mut part: Vec<Scores> = Vec::new();
            for ((_, first), scores) in batches.iter().zip(scores.by_ref()) {
                match part.last_mut().filter(|_| *first > 0) {
                    Some(task) => task.merge(&scores),
                    None => part.push(scores),
                }
            }
            part
        };
        let parts: Vec<Vec<Scores>> = (0..PARTS).map(|_| part()).collect();
        Ok(Self { averages, parts })
    }
}

fn averages(outcomes: SnowpackOutcomes) -> SnowpackAverages {
    let media = |media: [Arc<Outcomes>; 2]| media.map(|one| Arc::clone(&one.averages));
    let kinds = outcomes.into_iter();
    kinds
        .map(|kinds| kinds.into_iter().map(media).collect())
        .collect()
}

impl Bytes for Walks {
    fn bytes(&self) -> usize {
        let scores = self.parts.iter().flatten();
        let averages = self.averages.iter().flatten().flatten();
        scores.map(Scores::bytes).sum::<usize>() + averages.map(|one| one.bytes()).sum::<usize>()
    }
}
