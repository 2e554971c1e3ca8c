//! Counts light at horizontal planes in walks with grains from tables.
use splitsnow_spectra::simd::Simd;

use crate::math::set_lanes;
use crate::table::rays::Rays;
use crate::table::step::{StepMasks, Steps};
use crate::table::{Histogram, TableSnowpack};
use crate::transport::{Crossing, Leg, Path, Planes};

/// Number of scores of a crossing: its flux, and its actinic flux.
const COLUMNS: usize = 2;

/// Follows eight rays and scores their crossings of planes.
pub(super) struct Follower<'a> {
    planes: &'a Planes,
    /// Per plane, the downward crossings and the upward ones. They are kept apart because upward
    /// ones have the longer paths, and a histogram mixes paths within its bins: the difference of
    /// the two would suffer.
    crossings: Vec<[Histogram; 2]>,
    /// Per lane, the crossings of a flight that has been cut at a plane between layers: they do
    /// not count if its grain does not fit.
    pending: [Vec<Crossing>; 8],
    /// Per lane, whether the ray still has the direction of its source.
    in_beam: [bool; 8],
}

impl<'a> Follower<'a> {
    pub(super) fn new(planes: &'a Planes, snowpack: &TableSnowpack) -> Self {
        let empty = Histogram::new(snowpack.longest_m(), snowpack.tracers, COLUMNS);
        Self {
            planes,
            crossings: vec![[empty.clone(), empty]; planes.len()],
            pending: std::array::from_fn(|_| Vec::new()),
            in_beam: [false; 8],
        }
    }

    /// The scores of each plane: see [`super::Scores::crossings`].
    pub(super) fn into_crossings(self) -> Vec<Histogram> {
        let mut crossings: Vec<Histogram> = self.crossings.into_iter().flatten().collect();
        crossings.iter_mut().for_each(Histogram::shrink);
        crossings
    }

    /// A ray starts on `lane`; all rays start in the same direction if `is_beam`.
    pub(super) fn start(&mut self, lane: usize, is_beam: bool) {
        self.in_beam[lane] = is_beam;
    }

    /// Scores a step of the lanes set in `walking`, which were at `before`.
    #[inline(always)]
    pub(super) fn step<S: Simd>(
        &mut self,
        before: &Rays<S>,
        steps: &Steps<S>,
        stepped: &StepMasks,
        walking: u32,
    ) {
        for lane in set_lanes(walking) {
            let is = |mask: u32| mask >> lane & 1 == 1;
            // a ray lost in a grain has no end of its path
            if is(stepped.rejected | stepped.lost) {
                self.pending[lane].clear();
                continue;
            }
            let (from, to) = (before.get(lane), steps.rays.get(lane));
            let leg = |z_m, cosine, paths, is_beam| Leg {
                z_m,
                cosine,
                paths,
                is_beam,
            };
            let cosine = from.mu.abs();
            let is_beam = self.in_beam[lane];
            if is(stepped.met) {
                let contact_m = steps.contact_m.as_array()[lane];
                // the pores come first, then the grain
                let ice_m = to.path.ice_m - from.path.ice_m;
                let in_ice = &steps.snowpack.layers[from.layer].in_ice;
                let mut arrived = Path {
                    ice_m: from.path.ice_m,
                    ..to.path
                };
                let depths = arrived.impurities.iter_mut().zip(in_ice);
                depths.for_each(|(depth, per_m)| *depth -= per_m * ice_m);
                let flight = leg([from.z_m, contact_m], cosine, [from.path, arrived], is_beam);
                self.cross(lane, &flight);
                let down_m = to.z_m - contact_m;
                if down_m != 0.0 {
                    let cosine = (down_m / steps.chord_m.as_array()[lane]).abs();
                    let grain = leg([contact_m, to.z_m], cosine, [arrived, to.path], false);
                    self.cross(lane, &grain);
                }
                self.in_beam[lane] = false;
                self.commit(lane);
                continue;
            }
            let is_out = is(stepped.above | stepped.below);
            let end_m = match (is(stepped.above), is_out) {
                (true, _) => 0.0,
                (false, true) => steps.depth_m.as_array()[lane],
                // onto a plane between layers
                (false, false) => to.z_m,
            };
            let flight = leg([from.z_m, end_m], cosine, [from.path, to.path], is_beam);
            self.cross(lane, &flight);
            if is_out {
                self.commit(lane);
            }
        }
    }

    fn cross(&mut self, lane: usize, leg: &Leg) {
        self.pending[lane].extend(self.planes.crossings(leg));
    }

    fn commit(&mut self, lane: usize) {
        for crossing in self.pending[lane].drain(..) {
            let [down, _, actinic] = crossing.scores;
            let [downward, upward] = &mut self.crossings[crossing.plane];
            let histogram = if down > 0.0 { downward } else { upward };
            histogram.add(&crossing.path, &[1.0, actinic]);
        }
    }
}
