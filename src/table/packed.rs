//! A table of outcomes small enough for the processor's cache.
use crate::rng::Stream;
use crate::table::Outcome;

/// Outcomes to draw from with equal probability.
///
/// They are a stratified choice from a longer list: cut into equal parts by
/// the cosine of deflection and each part by the path in ice, one outcome is
/// taken from every piece. So the table's distributions of both, and the
/// asymmetry parameter above all, are nearly those of the longer list, at a
/// size at which a plain sample of them would be noisy.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// cosine, sine, displacement along the ray, across in the plane of
    /// scattering, across out of it; path in ice
    pub(super) motions: Vec<[f32; 8]>,
    /// centre (across in plane, across out of it, along), axis, flattening
    pub(super) bodies: Vec<[f32; 8]>,
}

impl Table {
    /// Picks `size` of `outcomes` (all, if there are no more than that).
    #[must_use]
    pub fn new(mut outcomes: Vec<Outcome>, size: usize, rng: &mut Stream) -> Self {
        let n = outcomes.len();
        let size = size.min(n).max(1);
        let parts = (size as f64).sqrt() as usize;
        outcomes.sort_unstable_by(|a, b| a.cos.total_cmp(&b.cos));
        for part in 0..parts {
            let edge = |part: usize| part * size / parts * n / size;
            outcomes[edge(part)..edge(part + 1)].sort_unstable_by(|a, b| a.ice.total_cmp(&b.ice));
        }
        let chosen: Vec<Outcome> = (0..size)
            .map(|stratum| {
                let (low, high) = (stratum * n / size, (stratum + 1) * n / size);
                let u = rng.uniform().as_array()[0];
                outcomes[low + (u * (high - low) as f64) as usize]
            })
            .collect();
        let motion = |o: &Outcome| {
            let [x, y, along] = o.displacement;
            [o.cos, o.sin, along, x, y, o.ice, 0.0, 0.0]
        };
        let body = |o: &Outcome| {
            let ([x, y, along], [ax, ay, az]) = (o.centre, o.axis);
            [x, y, along, ax, ay, az, o.flattening, 0.0]
        };
        Self {
            motions: chosen.iter().map(motion).collect(),
            bodies: chosen.iter().map(body).collect(),
        }
    }

    /// Number of outcomes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.motions.len()
    }

    /// Never: a table holds at least one outcome.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.motions.is_empty()
    }
}
