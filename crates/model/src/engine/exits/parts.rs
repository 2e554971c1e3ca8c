//! Walks in independent parts, whose scatter gives the standard error of every bin.
use std::sync::atomic::Ordering;

use super::counting::Bins;
use super::{ExitScene, Exits};
use crate::engine::{EngineError, batches};
use crate::measurement::Measured;
use crate::rng::{Key, Stream};

/// Number of parts of a run: standard errors are known to 13 % (31 degrees of freedom).
pub const PARTS: u64 = 32;

/// Scores of the rays of one part.
pub(super) struct PartScores {
    /// Sums of weights: `[side][bin][band]`, reflected first.
    pub(super) sums: Vec<f64>,
    /// Number of rays that hit an event limit.
    pub(super) lost: u64,
}

impl PartScores {
    pub(super) fn empty(bins: &impl Bins, bands: usize) -> Self {
        Self {
            sums: vec![0.0; 2 * bins.len() * bands],
            lost: 0,
        }
    }
}

/// Sums over the parts, for one result, of: the part's mean, its square, and its product
/// with the part's total over all bins.
#[derive(Clone, Copy, Default)]
struct PartSums {
    sum: f64,
    sum_sq: f64,
    with_total: f64,
}

impl PartSums {
    fn add(&mut self, mean: f64, total: f64) {
        self.sum += mean;
        self.sum_sq += mean * mean;
        self.with_total += mean * total;
    }

    /// Sums of the residuals of the means from a constant share of `total`. Their
    /// standard error is that of the share (the ratio estimator) times the total.
    fn residual(&self, total: &Self) -> Self {
        let share = match total.sum {
            0.0 => 0.0,
            sum => self.sum / sum,
        };
        let sum_sq = self.sum_sq - 2.0 * share * self.with_total + share * share * total.sum_sq;
        Self {
            sum: 0.0,
            sum_sq: sum_sq.max(0.0),
            with_total: 0.0,
        }
    }

    /// Mean and standard error from `parts` parts with `rays` rays in all. If no ray
    /// scored, the standard error is 1 / rays, the size of a score that may have been
    /// missed. With a single part the scatter is unknown, and the standard error is set
    /// to the value.
    fn measured(&self, parts: u64, rays: u64) -> Measured {
        let n = parts as f64;
        let value = self.sum / n;
        let spread = (self.sum_sq - n * value * value).max(0.0);
        let se = match parts {
            _ if self.sum_sq == 0.0 => 1.0 / rays as f64,
            1 => value,
            _ => (spread / (n * (n - 1.0))).sqrt(),
        };
        Measured { value, se }
    }
}

/// The random stream of part number `part` for `purpose` (see [`Key`]).
pub(super) fn stream(scene: &ExitScene, purpose: [u32; 3], part: u64) -> Stream {
    let [kind, i, j] = purpose;
    Stream::new(Key {
        seed: scene.request.seed,
        cell: scene.request.cell,
        purpose: [kind | (scene.light as u32) << 8, i, j],
        batch: part,
    })
}

/// Exits per band. `walk` computes a part from its number and its number of rays. The
/// parts are added in order, so the result does not depend on the number of threads.
pub(super) fn run(
    scene: &ExitScene,
    bins: &impl Bins,
    bands: usize,
    walk: impl Fn(u64, u64) -> Result<PartScores, EngineError> + Sync + Send,
) -> Result<Vec<Exits>, EngineError> {
    let rays = scene.request.rays;
    let parts = PARTS.min(rays);
    let part_means = |part: u64| {
        let count = rays * (part + 1) / parts - rays * part / parts;
        let mut scores = walk(part, count)?;
        for side in scores.sums.chunks_exact_mut(bins.len() * bands) {
            bins.symmetrise(scene.is_axial(), side, bands);
        }
        let share = 1.0 / count as f64;
        scores.sums.iter_mut().for_each(|sum| *sum *= share);
        scene.control.rays_done.fetch_add(count, Ordering::Relaxed);
        Ok(scores)
    };
    let results = bins.results() * bands;
    let mut result_sums = vec![PartSums::default(); 2 * results];
    let mut totals = vec![PartSums::default(); 2 * bands];
    let mut lost = 0;
    // one part per thread at a time: a part takes much memory
    let at_once = if scene.control.parallel {
        rayon::current_num_threads()
    } else {
        1
    };
    for first in (0..parts).step_by(at_once) {
        let group = first..parts.min(first + at_once as u64);
        for scores in batches::map(scene.control, group.collect(), part_means)? {
            lost += scores.lost;
            let sides = scores.sums.chunks_exact(bins.len() * bands);
            let side_sums = result_sums.chunks_exact_mut(results);
            let totals = totals.chunks_exact_mut(bands);
            for ((side, side_sums), totals) in sides.zip(side_sums).zip(totals) {
                let reduced = bins.reduced(side, bands);
                for (band, total) in totals.iter_mut().enumerate() {
                    let side_total: f64 = side.iter().skip(band).step_by(bands).sum();
                    total.add(side_total, side_total);
                    let pairs = side_sums
                        .iter_mut()
                        .zip(&*reduced)
                        .skip(band)
                        .step_by(bands);
                    pairs.for_each(|(sums, mean)| sums.add(*mean, side_total));
                }
            }
        }
    }
    let measured = |sums: &PartSums| sums.measured(parts, rays);
    let exits = |band: usize| {
        let column = |side: usize| {
            let total = totals[side * bands + band];
            let measured = |sums: &PartSums| match scene.normalised && total.sum > 0.0 {
                true if sums.sum_sq > 0.0 && parts > 1 => Measured {
                    se: measured(&sums.residual(&total)).se,
                    ..measured(sums)
                },
                _ => measured(sums),
            };
            let rows = &result_sums[side * results..(side + 1) * results];
            rows.iter()
                .skip(band)
                .step_by(bands)
                .map(measured)
                .collect()
        };
        Exits {
            reflected: column(0),
            transmitted: column(1),
            reflectance: measured(&totals[band]),
            transmittance: measured(&totals[bands + band]),
            lost: lost as f64 / rays as f64,
            normalised: false,
        }
    };
    Ok((0..bands).map(exits).collect())
}
