//! A table of outcomes small enough for the processor's cache.
use crate::grain::{Body, Form};
use crate::rng::Stream;
use crate::table::Outcome;

/// Outcomes, drawn with equal probability.
///
/// They are a stratified selection from a longer list. The list is cut into equal parts
/// by the cosine of deflection, each part is cut by the path in ice, and one outcome is
/// taken from every piece. So the distributions of both, and above all the asymmetry
/// parameter, are close to those of the longer list, although a random sample of this
/// size would be noisy.
#[derive(Debug, Clone, PartialEq)]
pub struct PackedTable {
    /// Shape of the grains.
    pub(super) form: Form,
    /// Cosine, sine, displacement along the ray, across it in the plane of scattering,
    /// across it out of this plane; path in ice.
    pub(super) motions: Vec<[f32; 8]>,
    /// Centre (across in plane, across out of plane, along), numbers of the body.
    pub(super) bodies: Vec<[f32; 8]>,
}

/// An integer that increases with `value` in the order of [`f32::total_cmp`].
fn rank(value: f32) -> i32 {
    let bits = value.to_bits() as i32;
    bits ^ ((bits >> 31) as u32 >> 1) as i32
}

impl PackedTable {
    /// Selects `size` of the `outcomes` (all, if there are no more).
    #[must_use]
    pub fn new(outcomes: &[Outcome], size: usize, rng: &mut Stream) -> Self {
        let n = outcomes.len();
        let size = size.min(n).max(1);
        let parts = (size as f64).sqrt() as usize;
        // sort pairs of key and index, which are cheaper to move than outcomes
        let mut by_cos: Vec<(i32, u32)> =
            (0..).zip(outcomes).map(|(i, o)| (rank(o.cos), i)).collect();
        by_cos.sort_unstable();
        let outcome = |place: u32| &outcomes[by_cos[place as usize].1 as usize];
        // outcomes of equal paths, such as the many with path 0, stay ordered by cosine
        let mut order: Vec<(i32, u32)> = (0..n as u32)
            .map(|place| (rank(outcome(place).ice), place))
            .collect();
        for part in 0..parts {
            let edge = |part: usize| part * size / parts * n / size;
            order[edge(part)..edge(part + 1)].sort_unstable();
        }
        let chosen: Vec<Outcome> = (0..size)
            .map(|stratum| {
                let (low, high) = (stratum * n / size, (stratum + 1) * n / size);
                let u = rng.uniform().as_array()[0];
                *outcome(order[low + (u * (high - low) as f64) as usize].1)
            })
            .collect();
        let motion = |o: &Outcome| {
            let [x, y, along] = o.displacement;
            [o.cos, o.sin, along, x, y, o.ice, 0.0, 0.0]
        };
        let body = |o: &Outcome| {
            let ([x, y, along], [a, b, c, d, e]) = (o.centre, o.body.numbers);
            [x, y, along, a, b, c, d, e]
        };
        Self {
            form: chosen[0].body.form,
            motions: chosen.iter().map(motion).collect(),
            bodies: chosen.iter().map(body).collect(),
        }
    }

    /// Centre of the grain of an outcome relative to the point of entry (across in plane,
    /// across out of plane, along), and its body.
    #[inline(always)]
    pub(super) fn grain(&self, row: usize) -> ([f64; 3], Body<f64>) {
        let [x, y, along, numbers @ ..] = self.bodies[row].map(f64::from);
        let form = self.form;
        ([x, y, along], Body { form, numbers })
    }

    /// Number of outcomes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.motions.len()
    }

    /// Bytes on the heap.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of::<[f32; 8]>() * (self.motions.capacity() + self.bodies.capacity())
    }

    /// Always false: a table holds at least one outcome.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.motions.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_increase_with_values() {
        let values = [
            f32::NEG_INFINITY,
            -1.0,
            -f32::MIN_POSITIVE,
            -0.0,
            0.0,
            1e-30,
            0.5,
            1.0,
            f32::INFINITY,
        ];
        let ranks = values.map(rank);
        assert!(ranks.is_sorted_by(|a, b| a < b), "{ranks:?}");
    }
}
