//! Scores of walks, binned by their paths in ice, water and impurities. The mean score
//! at any absorption follows from them.
use serde::{Deserialize, Serialize};

use crate::math::exp_neg;
use crate::transport::{Coefficients, Path, TRACERS};

/// Bins per factor of two of the path in ice, a power of two; half as many for water.
const BINS_PER_OCTAVE: u32 = 4;
/// The first octave begins at 2 to this power, in units of the scale.
const FIRST_OCTAVE: i32 = -7;
const OCTAVES: u32 = 20;

/// Sums of scores over rays with similar paths.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Histogram {
    /// Inverse of the unit of path length, 1/m.
    per_m: f64,
    /// Number of impurities whose optical depths are stored.
    impurities: usize,
    /// Number of scores per ray.
    columns: usize,
    /// 1-based positions in `sums` of the bins, or 0 for an empty bin. Ordered by the path
    /// in water (if it is 0, by the depth of the first impurity), then by the path in ice.
    /// So the list is short if all paths are in ice.
    positions: Vec<u32>,
    /// Per bin: the number of rays; sums of their paths in ice and water and depths of
    /// impurities, of the squares of these, and of the products of two of them; then sums
    /// of the scores.
    sums: Vec<f64>,
}

/// Maximum number of paths and depths of a ray.
const MAX_PATHS: usize = 2 + TRACERS;

/// Number of sums of a bin that precede its scores, for `paths` paths and depths.
const fn moments(paths: usize) -> usize {
    1 + paths + paths * (paths + 1) / 2
}

const ICE_BINS: usize = bins(BINS_PER_OCTAVE);

const fn bins(per_octave: u32) -> usize {
    (per_octave * OCTAVES + 2) as usize
}

/// Bin of path `x`, in units of the scale: 0 for no path, 1 for a short one.
fn bin(x: f64, per_octave: u32) -> usize {
    if x <= 0.0 {
        return 0;
    }
    // exponent and leading bits of the mantissa, which grow like a logarithm
    let shift = 52 - per_octave.trailing_zeros();
    let first = ((1023 + i64::from(FIRST_OCTAVE)) << 52 >> shift) - 1;
    let position = (x.to_bits() >> shift) as i64 - first;
    position.clamp(1, bins(per_octave) as i64 - 1) as usize
}

impl Histogram {
    /// An empty histogram for paths of about `scale_m`, this number of `impurities` (at most
    /// [`TRACERS`]) and `columns` scores per ray.
    #[must_use]
    pub fn new(scale_m: f64, impurities: usize, columns: usize) -> Self {
        Self {
            per_m: 1.0 / scale_m,
            impurities: impurities.min(TRACERS),
            columns,
            ..Self::default()
        }
    }

    /// Bytes on the heap.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of::<u32>() * self.positions.capacity() + size_of::<f64>() * self.sums.capacity()
    }

    /// Frees the memory reserved for more rays.
    pub fn shrink(&mut self) {
        self.positions.shrink_to_fit();
        self.sums.shrink_to_fit();
    }

    /// Number of sums per bin.
    fn width(&self) -> usize {
        moments(2 + self.impurities) + self.columns
    }

    /// Adds the scores of a ray.
    #[inline(always)]
    pub fn add(&mut self, path: &Path, scores: &[f64]) {
        self.add_weighted(path, 1.0, scores);
    }

    /// Adds the scores of `weight` rays with the same path.
    #[inline(always)]
    pub fn add_weighted(&mut self, path: &Path, weight: f64, scores: &[f64]) {
        let mut ray_paths = [0.0; MAX_PATHS];
        (ray_paths[0], ray_paths[1]) = (path.ice_m * self.per_m, path.water_m * self.per_m);
        ray_paths[2..].copy_from_slice(&path.impurities);
        let second = if ray_paths[1] > 0.0 {
            ray_paths[1]
        } else {
            ray_paths[2]
        };
        let position =
            bin(second, BINS_PER_OCTAVE / 2) * ICE_BINS + bin(ray_paths[0], BINS_PER_OCTAVE);
        if position >= self.positions.len() {
            self.positions.resize(position + 1, 0);
        }
        let width = self.width();
        if self.positions[position] == 0 {
            self.sums.resize(self.sums.len() + width, 0.0);
            self.positions[position] = (self.sums.len() / width) as u32;
        }
        let start = (self.positions[position] as usize - 1) * width;
        let sums = &mut self.sums[start..start + width];
        let paths = &ray_paths[..2 + self.impurities];
        let (moments, sums) = sums.split_at_mut(moments(paths.len()));
        if let [ice, water] = paths {
            let terms = [1.0, *ice, *water, ice * ice, water * water, ice * water];
            for (sum, term) in moments.iter_mut().zip(terms) {
                *sum += weight * term;
            }
        } else {
            let mut moments = moments.iter_mut();
            let mut next = |term: f64| {
                if let Some(sum) = moments.next() {
                    *sum += weight * term;
                }
            };
            next(1.0);
            paths.iter().for_each(|x| next(*x));
            paths.iter().for_each(|x| next(x * x));
            for (i, x) in paths.iter().enumerate() {
                paths[i + 1..].iter().for_each(|y| next(x * y));
            }
        }
        for (sum, score) in sums.iter_mut().zip(scores) {
            *sum += weight * score;
        }
    }

    /// Adds the sums of another histogram of the same kind.
    pub fn merge(&mut self, other: &Self) {
        let width = self.width();
        if self.positions.len() < other.positions.len() {
            self.positions.resize(other.positions.len(), 0);
        }
        // ordered by the path in ice first; this fixes the order of summation
        let rows = other.positions.len().div_ceil(ICE_BINS);
        let order = (0..ICE_BINS).flat_map(|ice| (0..rows).map(move |row| row * ICE_BINS + ice));
        let positions =
            order.filter_map(|position| Some((position, other.positions.get(position)?)));
        for (position, theirs) in positions.filter(|(_, p)| **p > 0) {
            let start = (*theirs as usize - 1) * width;
            let theirs = &other.sums[start..start + width];
            if self.positions[position] == 0 {
                self.sums.extend_from_slice(theirs);
                self.positions[position] = (self.sums.len() / width) as u32;
            } else {
                let start = (self.positions[position] as usize - 1) * width;
                let ours = self.sums[start..start + width].iter_mut();
                ours.zip(theirs).for_each(|(ours, theirs)| *ours += theirs);
            }
        }
    }

    /// Writes the sums of the scores to `scores`, each ray weighted by exp(-depth) at these
    /// `coefficients`.
    ///
    /// Within a bin the weight is that of the mean path, with a second-order correction for
    /// the spread of the paths.
    pub fn weighted(&self, coefficients: &Coefficients, scores: &mut [f64]) {
        let mut rates = [0.0; MAX_PATHS];
        rates[0] = coefficients.ice_per_m / self.per_m;
        rates[1] = coefficients.water_per_m / self.per_m;
        rates[2..].copy_from_slice(&coefficients.impurities);
        let n = 2 + self.impurities;
        let rates = &rates[..n];
        scores.fill(0.0);
        for bin in self.sums.chunks_exact(self.width()) {
            let (paths, sums) = bin.split_at(moments(n));
            let per_ray = 1.0 / paths[0];
            let mut depth = 0.0;
            let mut square = 0.0;
            let mut product_position = 1 + 2 * n;
            for (i, a) in rates.iter().enumerate() {
                let others = rates.len() - i - 1;
                if *a > 0.0 {
                    depth += a * paths[1 + i] * per_ray;
                    square += a * a * paths[1 + n + i] * per_ray;
                    for (w, product) in rates[i + 1..].iter().zip(&paths[product_position..]) {
                        square += 2.0 * a * w * product * per_ray;
                    }
                }
                product_position += others;
            }
            let variance = square - depth * depth;
            let weight = exp_neg(depth) * (1.0 + 0.5 * variance.max(0.0));
            let sums = scores.iter_mut().zip(sums);
            sums.for_each(|(score, sum)| *score += weight * sum);
        }
    }
}
