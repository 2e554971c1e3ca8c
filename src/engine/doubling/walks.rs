//! The walks next to the surfaces, at one pair of refractive indices.
use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::{FROM_BELOW, Run};
use crate::engine::tables::{self, Outcomes, PARTS};
use crate::engine::{Control, EngineError, Resolution, batches, engine_error};
use crate::optics::Index;
use crate::rng::{Key, Stream};
use crate::table::{Kernel, Layer, Lower, Scores, Source, TableSnow};
use crate::transport::{Entry, Illumination, Snow};

/// Outcomes of grain events and what walks with them came to.
#[derive(Debug)]
pub(in crate::engine) struct Walks {
    /// In air and in water.
    outcomes: [Arc<Outcomes>; 2],
    /// What came of each part.
    parts: Vec<Ends>,
    /// Of all parts together.
    all: Ends,
}

/// Where walks ended.
#[derive(Debug, Clone)]
pub(super) struct Ends {
    /// In the boundary layer: from each stream below, then from each light
    /// above; empty if no slab has one.
    pub(super) layer: Vec<Scores>,
    /// Through slabs without an inside: for each thickness and light, the
    /// latter running fastest.
    pub(super) thin: Vec<Scores>,
}

/// One of the independent parts, or all.
#[derive(Debug, Clone, Copy)]
pub(super) enum Part {
    One(usize),
    All,
}

/// All that walks follow from.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::engine) struct Occasion {
    snow: Snow,
    lights: Vec<Illumination>,
    thin_m: Vec<f64>,
    has_inside: bool,
    node: (Index, Index),
    entry: Entry,
    rays: u64,
    resolution: Resolution,
    seed: u64,
    cell: u64,
}

/// Walks of one kind from one source.
pub(super) struct Task {
    /// What its random streams are for.
    purpose: [u32; 2],
    thickness_m: f64,
    lower: Lower,
    source: Source,
    moments: usize,
    /// Per part.
    pub(super) rays: u64,
}

impl Run<'_> {
    /// What is to be walked, for each part alike: in the boundary layer, then
    /// through thin slabs.
    pub(super) fn tasks(&self) -> Vec<Task> {
        let request = self.request;
        let rays = request.rays.div_ceil(PARTS as u64);
        let below = ((rays as f64 * FROM_BELOW).ceil() as u64).max(1);
        let lights: Vec<Source> = request.illuminations.iter().map(source).collect();
        let mut tasks = Vec::new();
        if !self.is_all_thin() {
            let streams = self.streams.cosines().iter();
            let streams = streams.map(|cosine| (Source::Below(*cosine), below));
            let sources = streams.chain(lights.iter().map(|light| (*light, rays)));
            tasks.extend(sources.enumerate().map(|(i, (source, rays))| Task {
                purpose: [4, i as u32],
                thickness_m: self.layer_m,
                lower: Lower::Open,
                source,
                moments: self.streams.count(),
                rays,
            }));
        }
        let thin = request.thicknesses_m[..self.thin].iter();
        let thin = thin.flat_map(|h| lights.iter().map(move |light| (*h, *light)));
        tasks.extend(thin.enumerate().map(|(i, (thickness_m, source))| Task {
            purpose: [5, i as u32],
            thickness_m,
            lower: Lower::Plane,
            source,
            moments: 1,
            rays,
        }));
        tasks
    }
}

fn source(light: &Illumination) -> Source {
    match light {
        Illumination::Collimated { polar_angle_rad } => Source::Above(libm::cos(*polar_angle_rad)),
        Illumination::Diffuse => Source::Diffuse,
    }
}

impl Ends {
    /// Adds those of another part.
    fn merge(&mut self, other: &Self) {
        let ours = self.layer.iter_mut().chain(&mut self.thin);
        let theirs = other.layer.iter().chain(&other.thin);
        ours.zip(theirs)
            .for_each(|(ours, theirs)| ours.merge(theirs));
    }
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
            snow: request.pack.surface.clone(),
            lights: request.illuminations.to_vec(),
            thin_m: request.thicknesses_m[..run.thin].to_vec(),
            has_inside: !run.is_all_thin(),
            node,
            entry: request.model.entry,
            rays: request.rays,
            resolution: request.resolution,
            seed: request.seed,
            cell: request.cell,
        };
        let walks = &control.cache.walks;
        walks.get(&occasion, || Self::new(run, control, node))
    }

    /// Where those of `part` ended.
    pub(super) fn ends(&self, part: Part) -> &Ends {
        match part {
            Part::One(part) => &self.parts[part],
            Part::All => &self.all,
        }
    }

    /// Averages over the grain events of `part`, in air and in water.
    pub(super) fn kernels(&self, part: Part) -> [&Kernel; 2] {
        self.outcomes.each_ref().map(|outcomes| match part {
            Part::One(part) => &outcomes.kernels[part],
            Part::All => &outcomes.kernel,
        })
    }

    fn new(run: &Run, control: &Control, node: (Index, Index)) -> Result<Self, EngineError> {
        let request = run.request;
        let outcomes = tables::outcomes(request, control, node)?;
        let snows: Vec<TableSnow> = (0..PARTS)
            .map(|part| outcomes.each_ref().map(|outcomes| &outcomes.tables[part]))
            .map(|tables| TableSnow::new(&request.pack.surface, tables))
            .collect();
        let tasks = run.tasks();
        let one = |(part, task): (usize, &Task)| {
            if control.cancel.load(Ordering::Relaxed) {
                return Err(EngineError::Cancelled);
            }
            let [kind, number] = task.purpose;
            let stream = Stream::new(Key {
                seed: request.seed,
                cell: request.cell,
                // the same at all nodes, so that noise does not bury dispersion
                purpose: [kind, number, 0],
                batch: part as u64,
            });
            let layer = Layer {
                snow: snows[part],
                thickness_m: task.thickness_m,
                lower: task.lower,
            };
            let scores = layer.walk(task.source, task.rays, task.moments, stream);
            control.rays_done.fetch_add(task.rays, Ordering::Relaxed);
            scores.map_err(|error| engine_error(request, error))
        };
        let all = (0..PARTS).flat_map(|part| tasks.iter().map(move |task| (part, task)));
        let mut scores = batches::map(control, all.collect(), one)?.into_iter();
        let in_layer = tasks
            .iter()
            .filter(|task| task.lower == Lower::Open)
            .count();
        let parts = (0..PARTS).map(|_| Ends {
            layer: scores.by_ref().take(in_layer).collect(),
            thin: scores.by_ref().take(tasks.len() - in_layer).collect(),
        });
        let parts: Vec<Ends> = parts.collect();
        let mut all = parts[0].clone();
        parts[1..].iter().for_each(|part| all.merge(part));
        Ok(Self {
            outcomes,
            parts,
            all,
        })
    }
}
