//! The nodes of the table around a point, and sums over them.
use splitsnow_spectra::simd::{F32x8, F64x8, Simd};

use super::{BLOCK, INCIDENCE, LANES, Lookup};

/// The nodes of an axis, arranged for the search of the cell around a coordinate.
#[derive(Debug, Clone)]
pub(super) struct Cells {
    /// Coordinates of all nodes but the first and the last, filled up with infinity.
    inner: Vec<F64x8>,
    /// For each cell, the coordinate of its first node and its length; a single node is a cell of
    /// length 0.
    cells: Vec<[f32; 2]>,
}

impl Cells {
    pub(super) fn new(places: &[f32]) -> Self {
        let inner = places.get(1..places.len().max(2) - 1).unwrap_or_default();
        let chunk = |chunk: &[f32]| {
            let place = |i: usize| chunk.get(i).map_or(f64::INFINITY, |place| (*place).into());
            F64x8::new(std::array::from_fn(place))
        };
        let next = |i: usize| places.get(i + 1).or(places.last());
        let cell = |(i, from): (usize, &f32)| [*from, next(i).map_or(0.0, |next| next - from)];
        let cells = places.iter().enumerate().map(cell);
        Self {
            inner: inner.chunks(8).map(chunk).collect(),
            cells: cells.take(places.len().max(2) - 1).collect(),
        }
    }

    /// The cell around `place`, the nearest one if it is outside; the position in it, 0 to 1; and
    /// its length.
    #[inline(always)]
    pub(super) fn find<S: Simd>(&self, place: f32) -> (usize, f32, f32) {
        let mut cell = 0;
        for nodes in &self.inner {
            let below = nodes.on::<S>().le(F64x8::splat(f64::from(place)));
            cell += below.to_bitmask().count_ones();
        }
        let [from, step] = self.cells[cell as usize];
        let t = ((place - from) / step).clamp(0.0, 1.0);
        (cell as usize, if step > 0.0 { t } else { 0.0 }, step)
    }
}

/// The columns around a point: `N` snows at two angles. The second weights along an axis with one
/// node are 0.
pub(super) struct Corners<'a, const N: usize> {
    /// The tables of the snows, the facetness slowest.
    pub(super) snows: [&'a [F32x8]; N],
    /// For both angles, the weights of the snows.
    pub(super) weights: [[f32; N]; 2],
    /// Index in these tables of the nodes below and above the thickness at the lower angle.
    begin: [usize; 2],
}

impl Lookup {
    /// Number of nodes of a snow in its table at one thickness.
    pub(super) fn angles(&self) -> usize {
        self.values[INCIDENCE].len().max(2)
    }

    /// The table of a snow, by its number.
    #[inline(always)]
    fn snow(&self, number: usize) -> &[F32x8] {
        match self.table[number].get() {
            Some(table) => table,
            None => self.fill(number),
        }
    }

    /// Fills the table of a snow.
    #[cold]
    #[inline(never)]
    fn fill(&self, number: usize) -> &[F32x8] {
        self.table[number].get_or_init(|| self.filled(number))
    }

    /// The columns around the point with coordinates `places`, at thickness node `cell`.
    #[inline(always)]
    pub(super) fn corners<S: Simd, const N: usize>(
        &self,
        places: [f32; 5],
        cell: usize,
    ) -> Corners<'_, N> {
        let (angle, above, _) = self.cells[INCIDENCE].find::<S>(places[INCIDENCE]);
        let mut weights = [F32x8::<S>::splat(1.0 - above), F32x8::splat(above)];
        let mut first = 0;
        if N > 1 {
            let (i, above, _) = self.cells[2].find::<S>(places[2]);
            let [a, b] = [1.0 - above, above];
            let (j, above, _) = self.cells[1].find::<S>(places[1]);
            let [c, d] = [1.0 - above, above];
            let (k, above, _) = self.cells[0].find::<S>(places[0]);
            let [e, f] = [1.0 - above, above];
            first = i * self.strides[2] + j * self.strides[1] + k * self.strides[0];
            let shares = [
                [a, b, a, b, a, b, a, b],
                [c, c, d, d, c, c, d, d],
                [e, e, e, e, f, f, f, f],
            ];
            for shares in shares {
                let shares = F32x8::new(shares);
                weights[0] *= shares;
                weights[1] *= shares;
            }
        }
        let mut corners = Corners {
            snows: [&[]; N],
            weights: [[0.0; N]; 2],
            begin: [0, self.angles() * self.width]
                .map(|next| (cell * self.angles() + angle) * self.width + next),
        };
        for (i, snow) in corners.snows.iter_mut().enumerate() {
            *snow = self.snow(first + self.around[i]);
        }
        for (to, weights) in corners.weights.iter_mut().zip(weights) {
            to.copy_from_slice(&weights.as_array()[..N]);
        }
        corners
    }
}

impl<const N: usize> Corners<'_, N> {
    /// Sums of values and slopes at the nodes below and above the thickness, with `weights`: eight
    /// components a vector, for at most [`BLOCK`] `vectors` of a node from number `first`.
    #[inline(always)]
    pub(super) fn block<S: Simd>(
        &self,
        weights: [F32x8<S>; 2],
        width: usize,
        first: usize,
        vectors: usize,
    ) -> [F32x8<S>; BLOCK / 2] {
        let mut sums = [F32x8::<S>::ZERO; BLOCK];
        if vectors == BLOCK {
            // The compiler knows this length.
            sums = self.sums(weights, width, first);
        } else {
            for (i, sum) in sums.iter_mut().enumerate().take(vectors) {
                [*sum] = self.sums(weights, width, first + i);
            }
        }
        std::array::from_fn(|i| folded(sums[2 * i], sums[2 * i + 1]))
    }

    /// The same sums where a node has one vector, values and slopes still apart.
    #[inline(always)]
    pub(super) fn single<S: Simd>(&self, [lower, upper]: [F32x8<S>; 2]) -> F32x8<S> {
        let [mut below, mut above] = [F32x8::<S>::ZERO; 2];
        for (i, snow) in self.snows.iter().enumerate() {
            // both angles
            let [lower, upper] = self.begin.map(|at| vectors::<2>(snow, at));
            for (angle, weights) in self.weights.iter().enumerate() {
                let weight = F32x8::<S>::splat(weights[i]);
                below += lower[angle].on() * weight;
                above += upper[angle].on() * weight;
            }
        }
        below * lower + above * upper
    }

    /// The same sums for `M` of the `width` vectors of a node, values and slopes still apart.
    #[inline(always)]
    fn sums<S: Simd, const M: usize>(
        &self,
        [lower, upper]: [F32x8<S>; 2],
        width: usize,
        first: usize,
    ) -> [F32x8<S>; M] {
        let mut below = [F32x8::<S>::ZERO; M];
        let mut above = [F32x8::<S>::ZERO; M];
        for (i, snow) in self.snows.iter().enumerate() {
            for (angle, weights) in self.weights.iter().enumerate() {
                let weight = F32x8::<S>::splat(weights[i]);
                let at = self.begin.map(|begin| begin + angle * width + first);
                let [lower, upper] = at.map(|at| vectors::<M>(snow, at));
                for j in 0..M {
                    below[j] += lower[j].on() * weight;
                    above[j] += upper[j].on() * weight;
                }
            }
        }
        for (below, above) in below.iter_mut().zip(above) {
            *below = *below * lower + above * upper;
        }
        below
    }
}

/// `M` vectors of the table of a snow. Their index is always within it; the zeros instead of a panic
/// leave the compiler no branch between sums, which it would keep in memory then.
#[inline(always)]
fn vectors<const M: usize>(snow: &[F32x8], at: usize) -> &[F32x8; M] {
    let vectors = snow.get(at..).and_then(<[F32x8]>::first_chunk);
    vectors.unwrap_or(const { &[F32x8::ZERO; M] })
}

/// The sums of values and slopes of two vectors, for eight components.
#[inline(always)]
pub(super) fn folded<S: Simd>(low: F32x8<S>, high: F32x8<S>) -> F32x8<S> {
    let (low, high) = (low.as_array(), high.as_array());
    let half = |from: usize| {
        F32x8::new(std::array::from_fn(|i| match i < LANES {
            true => low[from + i],
            false => high[from + i - LANES],
        }))
    };
    half(0) + half(LANES)
}
