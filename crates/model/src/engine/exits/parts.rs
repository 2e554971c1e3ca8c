//! Rays in independent parts, whose scatter is the standard error of every bin.
use std::sync::atomic::Ordering;

use super::counting::Bins;
use super::{Exits, Scene};
use crate::engine::{EngineError, batches};
use crate::measurement::Measured;
use crate::rng::{Key, Stream};

/// Parts of a run: standard errors are known to 13 % (31 degrees of freedom).
const PARTS: u64 = 32;

/// What the rays of a part left behind.
pub(super) struct Part {
    /// Sums of weights: `[side][bin][band]`, reflected first.
    pub(super) sums: Vec<f64>,
    pub(super) lost: u64,
}

impl Part {
    pub(super) fn empty(bins: &impl Bins, bands: usize) -> Self {
        Self {
            sums: vec![0.0; 2 * bins.len() * bands],
            lost: 0,
        }
    }
}

/// Sums over parts of their means, of the squares of these and of their products
/// with the part's total.
#[derive(Clone, Copy, Default)]
struct Scatter {
    sum: f64,
    sum_sq: f64,
    with_total: f64,
}

impl Scatter {
    fn add(&mut self, mean: f64, total: f64) {
        self.sum += mean;
        self.sum_sq += mean * mean;
        self.with_total += mean * total;
    }

    /// The same of what is left over the share that this has of `total`: its
    /// standard error is that of the share (the ratio estimator) times the total.
    fn apart(&self, total: &Self) -> Self {
        let share = match total.sum {
            0.0 => 0.0,
            sum => self.sum / sum,
        };
        let square = self.sum_sq - 2.0 * share * self.with_total + share * share * total.sum_sq;
        Self {
            sum: 0.0,
            sum_sq: square.max(0.0),
            with_total: 0.0,
        }
    }

    /// Mean and standard error of `parts` parts of `rays` rays in all. Where
    /// nothing was seen the error is 1 / rays, what may have been missed; of a
    /// single part nothing is known and it is the value.
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

/// The stream of number `part` for `purpose` (see [`Key`]).
pub(super) fn stream(scene: &Scene, purpose: [u32; 3], part: u64) -> Stream {
    let [what, i, j] = purpose;
    Stream::new(Key {
        seed: scene.request.seed,
        cell: scene.request.cell,
        purpose: [what | (scene.light as u32) << 8, i, j],
        batch: part,
    })
}

/// Exits per band from the parts that `walk` gives by number and count of rays.
/// The parts are added in order, so the result does not depend on threads.
pub(super) fn run(
    scene: &Scene,
    bins: &impl Bins,
    bands: usize,
    walk: impl Fn(u64, u64) -> Result<Part, EngineError> + Sync + Send,
) -> Result<Vec<Exits>, EngineError> {
    let rays = scene.request.rays;
    let parts = PARTS.min(rays);
    let one = |part: u64| {
        let count = rays * (part + 1) / parts - rays * part / parts;
        let mut done = walk(part, count)?;
        for side in done.sums.chunks_exact_mut(bins.len() * bands) {
            bins.symmetrise(scene.is_axial(), side, bands);
        }
        let share = 1.0 / count as f64;
        done.sums.iter_mut().for_each(|sum| *sum *= share);
        scene.control.rays_done.fetch_add(count, Ordering::Relaxed);
        Ok(done)
    };
    let mut scatter = vec![Scatter::default(); 2 * bins.len() * bands];
    let mut totals = vec![Scatter::default(); 2 * bands];
    let mut lost = 0;
    // as many at once as there are threads: a part takes much memory
    let at_once = if scene.control.parallel {
        rayon::current_num_threads()
    } else {
        1
    };
    for first in (0..parts).step_by(at_once) {
        let group = first..parts.min(first + at_once as u64);
        for done in batches::map(scene.control, group.collect(), one)? {
            lost += done.lost;
            let sides = done.sums.chunks_exact(bins.len() * bands);
            let scatters = scatter.chunks_exact_mut(bins.len() * bands);
            let totals = totals.chunks_exact_mut(bands);
            for ((side, scatters), totals) in sides.zip(scatters).zip(totals) {
                for (band, total) in totals.iter_mut().enumerate() {
                    let all: f64 = side.iter().skip(band).step_by(bands).sum();
                    total.add(all, all);
                    let pairs = scatters.iter_mut().zip(side).skip(band).step_by(bands);
                    pairs.for_each(|(scatter, mean)| scatter.add(*mean, all));
                }
            }
        }
    }
    let measured = |scatter: &Scatter| scatter.measured(parts, rays);
    let exits = |band: usize| {
        let column = |side: usize| {
            let total = totals[side * bands + band];
            let measured = |scatter: &Scatter| match scene.normalised && total.sum > 0.0 {
                true if scatter.sum_sq > 0.0 && parts > 1 => Measured {
                    se: measured(&scatter.apart(&total)).se,
                    ..measured(scatter)
                },
                _ => measured(scatter),
            };
            let from = side * bins.len() * bands;
            let rows = &scatter[from..from + bins.len() * bands];
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
