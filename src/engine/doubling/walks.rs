//! The walks next to the planes, at one pair of refractive indices.
use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::Run;
use super::cut::Task;
use crate::engine::cache::Bytes;
use crate::engine::tables::{self, Averages, PARTS, Stretch};
use crate::engine::{Control, EngineError, Resolution, batches, engine_error};
use crate::optics::Index;
use crate::rng::{Key, Stream};
use crate::table::{Kernel, Region, Scores};
use crate::transport::{Layer, Model, Snow};

/// What grain events do on average and what walks with them came to.
#[derive(Debug)]
pub(in crate::engine) struct Walks {
    /// Of the grains of each type in each layer, in air and in water.
    averages: Vec<Vec<[Arc<Averages>; 2]>>,
    /// What came of each task in each part.
    parts: Vec<Vec<Scores>>,
}

/// All that walks follow from.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::engine) struct Occasion {
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
        let occasion = Occasion {
            surface: request.pack.surface.clone(),
            below: request.pack.below.clone(),
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
        let request = run.request;
        let outcomes = tables::outcomes(request, control, node)?;
        let tasks = &run.plan.tasks;
        let one = |(part, task): (usize, &Task)| {
            if control.cancel.load(Ordering::Relaxed) {
                return Err(EngineError::Cancelled);
            }
            let stream = Stream::new(Key {
                seed: request.seed,
                cell: request.cell,
                // the same at all nodes, so that noise does not bury dispersion
                purpose: task.purpose(),
                batch: part as u64,
            });
            let thickness = |stretch: &Stretch| stretch.thickness_m;
            let region = Region {
                pack: tables::pack(request, &outcomes, part, &task.stretches),
                thickness_m: task.stretches.iter().map(thickness).sum(),
                edges: task.edges,
            };
            let scores = region.walk(task.source, task.rays, task.moments, stream);
            control.rays_done.fetch_add(task.rays, Ordering::Relaxed);
            let mut scores = scores.map_err(|error| engine_error(request, error))?;
            scores.shrink();
            Ok(scores)
        };
        let each = (0..PARTS).flat_map(|part| tasks.iter().map(move |task| (part, task)));
        let mut scores = batches::map(control, each.collect(), one)?.into_iter();
        let parts = (0..PARTS).map(|_| scores.by_ref().take(tasks.len()).collect());
        let parts = parts.collect();
        // the tables themselves are done with
        let averages = |media: [Arc<tables::Outcomes>; 2]| media.map(|one| one.averages.clone());
        let averages = outcomes
            .into_iter()
            .map(|kinds| kinds.into_iter().map(averages).collect());
        Ok(Self {
            averages: averages.collect(),
            parts,
        })
    }
}

impl Bytes for Walks {
    fn bytes(&self) -> usize {
        let scores = self.parts.iter().flatten();
        let averages = self.averages.iter().flatten().flatten();
        scores.map(Scores::bytes).sum::<usize>() + averages.map(|one| one.bytes()).sum::<usize>()
    }
}
