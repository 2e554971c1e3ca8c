//! Scores of walks by their paths in ice, water and impurities, from which the
//! mean score at any absorption follows.
use serde::{Deserialize, Serialize};

use crate::math::exp_neg;
use crate::transport::{Coefficients, EXPONENTS, Path};

/// Bins per factor of two of path in ice, a power of two; of path in water half as many.
const BINS_PER_OCTAVE: u32 = 4;
/// The first octave begins at 2 to this power, in units of the scale.
const FIRST_OCTAVE: i32 = -7;
const OCTAVES: u32 = 20;

/// Sums of scores over rays of about the same paths.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Histogram {
    /// One over the unit of path lengths, 1/m.
    per_m: f64,
    /// Impurities whose depths are kept.
    impurities: usize,
    /// Scores per ray.
    columns: usize,
    /// Where the bins of `sums` are, by path in water (or, where there is none, the
    /// depth of the first impurity) and, running faster, in ice; 0 for none. So it is
    /// short where there are paths in ice alone.
    places: Vec<u32>,
    /// Per bin: rays; their paths in ice and water and depths of impurities,
    /// the squares and the products of two of these; then the scores.
    sums: Vec<f64>,
}

/// Paths and depths of a ray, at most.
const MOST: usize = 2 + EXPONENTS;

/// Sums of a bin that come before its scores, of `paths` paths and depths.
const fn moments(paths: usize) -> usize {
    1 + paths + paths * (paths + 1) / 2
}

const ICE_BINS: usize = bins(BINS_PER_OCTAVE);

const fn bins(per_octave: u32) -> usize {
    (per_octave * OCTAVES + 2) as usize
}

/// Bin of path `x`, in units of the scale: 0 for none, 1 for short.
fn bin(x: f64, per_octave: u32) -> usize {
    if x <= 0.0 {
        return 0;
    }
    // exponent and leading bits of the mantissa, which grow like a logarithm
    let shift = 52 - per_octave.trailing_zeros();
    let first = ((1023 + i64::from(FIRST_OCTAVE)) << 52 >> shift) - 1;
    let place = (x.to_bits() >> shift) as i64 - first;
    place.clamp(1, bins(per_octave) as i64 - 1) as usize
}

impl Histogram {
    /// Empty, for paths of about `scale_m`, so many `impurities` (of at most
    /// [`EXPONENTS`]) and `columns` scores per ray.
    #[must_use]
    pub fn new(scale_m: f64, impurities: usize, columns: usize) -> Self {
        Self {
            per_m: 1.0 / scale_m,
            impurities: impurities.min(EXPONENTS),
            columns,
            ..Self::default()
        }
    }

    /// Bytes on the heap.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of::<u32>() * self.places.capacity() + size_of::<f64>() * self.sums.capacity()
    }

    /// Gives back the memory that more rays would have needed.
    pub fn shrink(&mut self) {
        self.places.shrink_to_fit();
        self.sums.shrink_to_fit();
    }

    /// Sums per bin.
    fn width(&self) -> usize {
        moments(2 + self.impurities) + self.columns
    }

    /// Adds a ray's scores.
    #[inline(always)]
    pub fn add(&mut self, path: &Path, scores: &[f64]) {
        let mut all = [0.0; MOST];
        (all[0], all[1]) = (path.ice_m * self.per_m, path.water_m * self.per_m);
        all[2..].copy_from_slice(&path.impurities);
        let second = if all[1] > 0.0 { all[1] } else { all[2] };
        let place = bin(second, BINS_PER_OCTAVE / 2) * ICE_BINS + bin(all[0], BINS_PER_OCTAVE);
        if place >= self.places.len() {
            self.places.resize(place + 1, 0);
        }
        let width = self.width();
        if self.places[place] == 0 {
            self.sums.resize(self.sums.len() + width, 0.0);
            self.places[place] = (self.sums.len() / width) as u32;
        }
        let start = (self.places[place] as usize - 1) * width;
        let mut sums = self.sums[start..start + width].iter_mut();
        let paths = &all[..2 + self.impurities];
        let mut next = |value: f64| {
            if let Some(sum) = sums.next() {
                *sum += value;
            }
        };
        next(1.0);
        paths.iter().for_each(|x| next(*x));
        paths.iter().for_each(|x| next(x * x));
        for (i, x) in paths.iter().enumerate() {
            paths[i + 1..].iter().for_each(|y| next(x * y));
        }
        scores.iter().for_each(|score| next(*score));
    }

    /// Adds the sums of another of the same kind.
    pub fn merge(&mut self, other: &Self) {
        let width = self.width();
        if self.places.len() < other.places.len() {
            self.places.resize(other.places.len(), 0);
        }
        // by path in ice and then the other: sums are added in this order
        let rows = other.places.len().div_ceil(ICE_BINS);
        let order = (0..ICE_BINS).flat_map(|ice| (0..rows).map(move |row| row * ICE_BINS + ice));
        let places = order.filter_map(|place| Some((place, other.places.get(place)?)));
        for (place, theirs) in places.filter(|(_, p)| **p > 0) {
            let start = (*theirs as usize - 1) * width;
            let theirs = &other.sums[start..start + width];
            if self.places[place] == 0 {
                self.sums.extend_from_slice(theirs);
                self.places[place] = (self.sums.len() / width) as u32;
            } else {
                let start = (self.places[place] as usize - 1) * width;
                let ours = self.sums[start..start + width].iter_mut();
                ours.zip(theirs).for_each(|(ours, theirs)| *ours += theirs);
            }
        }
    }

    /// Sums of the scores, each ray weighted by exp(-depth) at these
    /// `coefficients`; `scores` receives them.
    ///
    /// Within a bin the weight is that of the mean path and, to second order,
    /// of the spread about it.
    pub fn weighted(&self, coefficients: &Coefficients, scores: &mut [f64]) {
        let mut all = [0.0; MOST];
        all[0] = coefficients.ice_per_m / self.per_m;
        all[1] = coefficients.water_per_m / self.per_m;
        all[2..].copy_from_slice(&coefficients.impurities);
        let n = 2 + self.impurities;
        let per = &all[..n];
        scores.fill(0.0);
        for bin in self.sums.chunks_exact(self.width()) {
            let (paths, sums) = bin.split_at(moments(n));
            let per_ray = 1.0 / paths[0];
            let mut depth = 0.0;
            let mut square = 0.0;
            let mut place = 1 + 2 * n;
            for (i, a) in per.iter().enumerate() {
                let others = per.len() - i - 1;
                if *a > 0.0 {
                    depth += a * paths[1 + i] * per_ray;
                    square += a * a * paths[1 + n + i] * per_ray;
                    for (w, product) in per[i + 1..].iter().zip(&paths[place..]) {
                        square += 2.0 * a * w * product * per_ray;
                    }
                }
                place += others;
            }
            let variance = square - depth * depth;
            let weight = exp_neg(depth) * (1.0 + 0.5 * variance.max(0.0));
            let sums = scores.iter_mut().zip(sums);
            sums.for_each(|(score, sum)| *score += weight * sum);
        }
    }
}
