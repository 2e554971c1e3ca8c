//! Scores of walks by their paths in ice and water, from which the mean score
//! at any absorption follows.
use crate::math::exp_neg;

/// Bins per factor of two of path in ice, a power of two; of path in water half as many.
const BINS_PER_OCTAVE: u32 = 4;
/// The first octave begins at 2 to this power, in units of the scale.
const FIRST_OCTAVE: i32 = -7;
const OCTAVES: u32 = 20;

/// Sums of scores over rays of about the same paths.
#[derive(Debug, Clone, Default)]
pub struct Histogram {
    /// One over the unit of path lengths, 1/m.
    per_m: f64,
    /// Scores per ray.
    columns: usize,
    /// Where the bins of `sums` are, by path in ice and in water; 0 for none.
    places: Vec<u32>,
    /// Per bin: rays, their paths in ice and water, the squares and the
    /// product of these; then the scores.
    sums: Vec<f64>,
}

/// Sums of a bin that come before its scores.
const PATHS: usize = 6;
const WATER_BINS: usize = bins(BINS_PER_OCTAVE / 2);

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
    /// Empty, for paths of about `scale_m` and `columns` scores per ray.
    #[must_use]
    pub fn new(scale_m: f64, columns: usize) -> Self {
        Self {
            per_m: 1.0 / scale_m,
            columns,
            ..Self::default()
        }
    }

    /// Adds a ray's scores.
    #[inline]
    pub fn add(&mut self, ice_m: f64, water_m: f64, scores: &[f64]) {
        let (ice, water) = (ice_m * self.per_m, water_m * self.per_m);
        let place = bin(ice, BINS_PER_OCTAVE) * WATER_BINS + bin(water, BINS_PER_OCTAVE / 2);
        if place >= self.places.len() {
            self.places.resize(place + 1, 0);
        }
        let width = PATHS + self.columns;
        if self.places[place] == 0 {
            self.sums.resize(self.sums.len() + width, 0.0);
            self.places[place] = (self.sums.len() / width) as u32;
        }
        let start = (self.places[place] as usize - 1) * width;
        let sums = &mut self.sums[start..start + width];
        let paths = [1.0, ice, water, ice * ice, water * water, ice * water];
        let all = paths.iter().chain(scores);
        sums.iter_mut()
            .zip(all)
            .for_each(|(sum, value)| *sum += value);
    }

    /// Adds the sums of another of the same kind.
    pub fn merge(&mut self, other: &Self) {
        let width = PATHS + self.columns;
        if self.places.len() < other.places.len() {
            self.places.resize(other.places.len(), 0);
        }
        for (place, theirs) in other.places.iter().enumerate().filter(|(_, p)| **p > 0) {
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

    /// Sums of the scores, each ray weighted by exp(-alpha L) in ice and
    /// water; `scores` receives them.
    ///
    /// Within a bin the weight is that of the mean path and, to second order,
    /// of the spread about it.
    pub fn weighted(&self, ice_per_m: f64, water_per_m: f64, scores: &mut [f64]) {
        let (a, w) = (ice_per_m / self.per_m, water_per_m / self.per_m);
        scores.fill(0.0);
        for bin in self.sums.chunks_exact(PATHS + self.columns) {
            let (paths, sums) = bin.split_at(PATHS);
            let [ice, water, ice_sq, water_sq, both] = [1, 2, 3, 4, 5].map(|i| paths[i] / paths[0]);
            let variance = a * a * (ice_sq - ice * ice)
                + w * w * (water_sq - water * water)
                + 2.0 * a * w * (both - ice * water);
            let weight = exp_neg(a * ice + w * water) * (1.0 + 0.5 * variance.max(0.0));
            let sums = scores.iter_mut().zip(sums);
            sums.for_each(|(score, sum)| *score += weight * sum);
        }
    }
}
