//! The walks of a request at one pair of refractive indices.
use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::HybridRun;
use super::plan::{WalkTask, depth_m};
use crate::engine::cache::HeapSize;
use crate::engine::tables::{self, Averages, Outcomes, PARTS, SnowpackOutcomes};
use crate::engine::{Control, EngineError, Resolution, batches, engine_error};
use crate::optics::Index;
use crate::rng::{Fingerprint, Key, Stream};
use crate::table::{BoundaryRegion, Kernel, Scores};
use crate::transport::{Layer, Model, Planes, Snow};

/// Mean grain events and scores of the walks.
#[derive(Debug)]
pub(in crate::engine) struct Walks {
    averages: SnowpackAverages,
    /// Scores of each task in each part: `[part][task]`.
    parts: Vec<Vec<Scores>>,
}

/// Mean grain events of each grain type in each layer, in air and in water:
/// `[layer][type][medium]`.
type SnowpackAverages = Vec<Vec<[Arc<Averages>; 2]>>;

/// Most walks with one random stream; they take some seconds.
const BATCH: u64 = 1 << 17;

/// Name of a unit of `run`. It contains the tasks because a job may run several
/// requests with the same cell.
pub(super) fn unit(run: &HybridRun, kind: &str) -> String {
    let tasks = Fingerprint::of("tasks");
    let tasks = run.plan.tasks.iter().fold(tasks, |digest, task| {
        let purpose = task.purpose().map(u64::from);
        let planes = task.planes_m.iter().map(|z_m| z_m.to_bits());
        let bits = purpose.into_iter().chain(planes);
        bits.fold(digest, Fingerprint::and_bits)
    });
    format!("{kind} {:x} {:x}", run.request.cell, tasks.finish())
}

/// All inputs that determine the walks.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::engine) struct CacheKey {
    surface: Snow,
    below: Vec<Layer>,
    tasks: Vec<WalkTask>,
    node: (Index, Index),
    model: Model,
    resolution: Resolution,
    seed: u64,
    cell: u64,
}

impl Walks {
    /// The walks of `run` at the indices `node` of ice and water, from the cache if
    /// they are in it.
    pub(super) fn cached(
        run: &HybridRun,
        control: &Control,
        node: (Index, Index),
    ) -> Result<Arc<Self>, EngineError> {
        let request = run.request;
        let key = CacheKey {
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
        walks.get(&key, || Self::new(run, control, node))
    }

    /// Scores of task number `task` in `part`.
    pub(super) fn scores(&self, part: usize, task: usize) -> &Scores {
        &self.parts[part][task]
    }

    /// Kernels from the grain events of `part` in layer number `layer`: per grain
    /// type, in air and in water.
    pub(super) fn kernels(&self, part: usize, layer: usize) -> impl Iterator<Item = [&Kernel; 2]> {
        let media = self.averages[layer].iter();
        media.map(move |[air, water]| [&air.kernels[part], &water.kernels[part]])
    }

    fn new(run: &HybridRun, control: &Control, node: (Index, Index)) -> Result<Self, EngineError> {
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
        let walk_batch = |part: usize, task: &WalkTask, first: u64, outcomes: &SnowpackOutcomes| {
            if control.cancel.load(Ordering::Relaxed) {
                return Err(EngineError::Cancelled);
            }
            let stream = Stream::new(Key {
                seed: request.seed,
                cell: request.cell,
                // the same at all nodes, so that noise does not hide dispersion
                purpose: task.purpose(),
                batch: part as u64 + PARTS as u64 * (first / BATCH),
            });
            let region = BoundaryRegion {
                snowpack: tables::snowpack(request, outcomes, part, &task.sections),
                thickness_m: depth_m(&task.sections),
                edges: task.edges,
                planes: Planes::new(&task.planes_m, depth_m(&task.sections)),
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
        let saved: Option<Vec<Vec<[Averages; 2]>>> = units.take(&name);
        let averages = match saved.filter(|_| missing.is_empty()) {
            Some(saved) => {
                let shared = saved.into_iter().map(|kinds| {
                    let kinds = kinds.into_iter();
                    kinds.map(|media| media.map(Arc::new)).collect()
                });
                shared.collect()
            }
            None => {
                let outcomes = tables::outcomes(request, control, node)?;
                let walked = batches::map(control, missing.clone(), |i| {
                    let (task, first) = batches[i % batches.len()];
                    let walked = walk_batch(i / batches.len(), task, first, &outcomes)?;
                    units.add(&unit(i), &walked)?;
                    Ok(walked)
                })?;
                for (i, walked) in missing.into_iter().zip(walked) {
                    scores[i] = Some(walked);
                }
                // the tables themselves are no longer needed
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
    let media = |media: [Arc<Outcomes>; 2]| media.map(|outcomes| Arc::clone(&outcomes.averages));
    let kinds = outcomes.into_iter();
    kinds
        .map(|kinds| kinds.into_iter().map(media).collect())
        .collect()
}

impl HeapSize for Walks {
    fn bytes(&self) -> usize {
        let scores = self.parts.iter().flatten();
        let averages = self.averages.iter().flatten().flatten();
        scores.map(Scores::bytes).sum::<usize>()
            + averages.map(|average| average.bytes()).sum::<usize>()
    }
}
