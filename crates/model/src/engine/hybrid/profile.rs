//! Fluxes inside a snowpack, from the crossings of walks in windows and the streams that enter
//! these ([`super::windows`]).
//!
//! At a plane between two parts of the snowpack, downward light is d = (1 - B' B)^-1 s, where s is
//! the light from the illumination that comes down before any returns from below the plane, B'
//! reflects upward light at the part above and B downward light at the part below. Upward light is
//! B d.
use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::HybridRun;
use super::inside::{Flights, StreamOperators};
use super::means::Means;
use super::plan::{Slab, ThickSlab, depth_m};
use super::planes::Segment;
use super::solve::SceneOperators;
use super::walks::Walks;
use super::windows::Window;
use crate::engine::nodes::{Spacing, mixes};
use crate::engine::{Control, EngineError, Request, batches, coefficients, indices};
use crate::slab::Matrix;
use crate::table::Edge;
use crate::transport::{CROSSING_SCORES, PlaneFluxes};

/// Light in the streams at the ends of the parts of the inside.
#[derive(Default)]
struct StreamLight {
    /// Depths of the ends, m.
    ends_m: Vec<f64>,
    /// Downward and upward light there: columns.
    down: Vec<Matrix>,
    up: Vec<Matrix>,
    /// Reflectance and transmittance.
    leaving: [f64; 2],
}

impl StreamLight {
    /// Position of an end.
    fn part(&self, end_m: f64) -> usize {
        self.ends_m.partition_point(|z_m| *z_m < end_m)
    }

    /// Net downward flux at end number `end` of `window`.
    fn net(&self, window: &Window, end: usize) -> f64 {
        if window.edges[end] == Edge::Plane {
            let [reflected, transmitted] = self.leaving;
            return [1.0 - reflected, transmitted][end];
        }
        let part = self.part(window.ends_m[end]);
        let sum = |light: &Matrix| (0..light.rows()).map(|i| light[(i, 0)]).sum::<f64>();
        sum(&self.down[part]) - sum(&self.up[part])
    }
}

/// The fluxes at the depths of `window`, given the `counted` ones there and, first and last, at its
/// ends.
///
/// Walks of different windows have different noise, and the small difference of the fluxes, the
/// net flux, would be lost in it. The streams balance energy to rounding. So the net flux is that of
/// the streams (or of the light that leaves) at the ends of the window. In between absorption is the
/// counted one with a small correction. What is missing in it is missing next to open ends, where
/// the light that enters has not yet met grains; so the correction per absorbed power increases
/// linearly from a plane to an open end. Half of the correction of the net flux goes to either flux,
/// but none to the incident flux at the surface, and all of it to the transmitted flux at the base.
fn balanced(window: &Window, light: &StreamLight, counted: &[PlaneFluxes]) -> Vec<PlaneFluxes> {
    let [top_m, bottom_m] = window.ends_m;
    let net = |fluxes: &PlaneFluxes| fluxes[0] - fluxes[1];
    let last = counted.len() - 1;
    let missing = [0, last].map(|i| light.net(window, i.min(1)) - net(&counted[i]));
    let shares = match window.edges {
        [Edge::Plane, Edge::Plane] => [0.0, 1.0],
        [Edge::Plane, Edge::Open] => [0.0, 0.5],
        [Edge::Open, Edge::Plane] => [0.5, 1.0],
        [Edge::Open, Edge::Open] => [0.5; 2],
    };
    let pairs = window.depths_m.iter().zip(&counted[1..last]);
    let absorbed = |fluxes: &PlaneFluxes| net(&counted[0]) - net(fluxes);
    let in_all = absorbed(&counted[last]);
    let corrected = pairs.map(|(z_m, fluxes)| {
        let mix = |t: f64, [a, b]: [f64; 2]| (1.0 - t) * a + t * b;
        let depth = (z_m - top_m) / (bottom_m - top_m);
        let above = match absorbed(fluxes) / in_all {
            share if (0.0..=1.0).contains(&share) => share,
            // nothing absorbs, and rounding remains
            _ => depth,
        };
        let above = match window.edges {
            [Edge::Plane, Edge::Open] => above * above,
            [Edge::Open, Edge::Plane] => above * (2.0 - above),
            _ => above,
        };
        let (missing, share) = (mix(above, missing), mix(depth, shares));
        let [down, up, actinic] = *fluxes;
        [
            down + share * missing,
            up - (1.0 - share) * missing,
            actinic,
        ]
    });
    corrected.collect()
}

/// Fluxes at `depths_m`, increasing, in the only snowpack and under the only illumination of
/// `request`: per wavelength, from all parts of the walks and then with one part left out at a
/// time.
pub(in crate::engine) fn profile(
    request: &Request,
    depths_m: &[f64],
    control: &Control,
) -> Result<Vec<Vec<Vec<PlaneFluxes>>>, EngineError> {
    let run = HybridRun::new(request, depths_m)?;
    let indices = indices(request)?;
    let (nodes, mixes) = mixes(
        &indices,
        request.snowpack.is_wet(),
        Spacing::of_walks(request.rays),
    );
    let walks = nodes.iter().map(|&node| Walks::cached(&run, control, node));
    let walks: Vec<Arc<Walks>> = walks.collect::<Result<_, _>>()?;
    let coefficients = coefficients(request, &indices);
    batches::map(control, (0..indices.len()).collect(), |l| {
        if control.cancel.load(Ordering::Relaxed) {
            return Err(EngineError::Cancelled);
        }
        let fluxes = |means: &Means, flights: &[Flights]| run.fluxes(means, flights);
        let (all, others) = run.estimates(&walks, &mixes[l], &coefficients[l], fluxes)?;
        Ok(std::iter::once(all).chain(others).collect())
    })
}

impl HybridRun<'_> {
    /// Fluxes at all depths at one wavelength.
    fn fluxes(&self, means: &Means, flights: &[Flights]) -> Result<Vec<PlaneFluxes>, EngineError> {
        let light = self.scene_light(means, flights)?;
        let fluxes = self.windows.iter().flat_map(|window| {
            let mut sums = vec![[0.0; CROSSING_SCORES]; window.depths_m.len() + 2];
            let mut task = window.first;
            let mut add = |light: f64| {
                let crossings = means.crossings(&self.layout, task);
                for (sums, crossings) in sums.iter_mut().zip(crossings) {
                    let pairs = sums.iter_mut().zip(crossings);
                    pairs.for_each(|(sum, score)| *sum += light * score);
                }
                task += 1;
            };
            for (end, edge) in window.edges.into_iter().enumerate() {
                if edge == Edge::Plane {
                    if end == 0 {
                        add(1.0);
                    }
                    continue;
                }
                let part = light.part(window.ends_m[end]);
                let streams = [&light.down, &light.up][end];
                // light from outside has survived its flight up to the window
                let per_arriving = 1.0 / flights[window.layers[end]].moment(1);
                (0..self.streams.count()).for_each(|i| add(per_arriving * streams[part][(i, 0)]));
            }
            balanced(window, &light, &sums)
        });
        Ok(fluxes.collect())
    }

    /// The light in the streams, and what leaves the snowpack.
    fn scene_light(&self, means: &Means, flights: &[Flights]) -> Result<StreamLight, EngineError> {
        let slab = match &self.plan.slabs[0] {
            Slab::Thin(task) => {
                let [out, through] = means.scores(&self.layout, *task);
                return Ok(StreamLight {
                    leaving: [out[0], through[0]],
                    ..StreamLight::default()
                });
            }
            Slab::Thick(slab) => slab,
        };
        let operators = self.operators(means, flights)?;
        let (parts, ends_m) = self.parts(slab, &operators)?;
        let light = self.light(slab, &operators, &parts)?;
        Ok(StreamLight { ends_m, ..light })
    }

    /// Divides the inside of `slab` at the open ends of windows. Returns the parts and the depths
    /// of their ends, m.
    fn parts(
        &self,
        slab: &ThickSlab,
        operators: &SceneOperators,
    ) -> Result<(Vec<StreamOperators>, Vec<f64>), EngineError> {
        let windows = self.windows.iter();
        let open = windows.flat_map(|window| {
            let ends = window.edges.into_iter().zip(window.ends_m);
            ends.filter_map(|(edge, end_m)| (edge == Edge::Open).then_some(end_m))
        });
        let mut cuts_m: Vec<f64> = open.collect();
        cuts_m.sort_by(f64::total_cmp);
        cuts_m.dedup();
        let (mut parts, mut ends_m) = (Vec::new(), vec![slab.upper_m]);
        let mut top_m = slab.upper_m;
        for segment in &slab.inside {
            let (end_m, layer) = match segment {
                Segment::Walked(number) => {
                    top_m += depth_m(&self.plan.interfaces[*number].sections);
                    parts.push(operators.interfaces[*number].clone());
                    ends_m.push(top_m);
                    continue;
                }
                Segment::Bulk(section) => (top_m + section.thickness_m, section.layer),
            };
            let Some(bulk) = &operators.bulk[layer] else {
                continue;
            };
            let inside = |z_m: &&f64| top_m < **z_m && **z_m < end_m;
            let cuts_m = cuts_m.iter().filter(inside).copied().chain([end_m]);
            for cut_m in cuts_m.collect::<Vec<f64>>() {
                parts.push(bulk.operators(cut_m - top_m)?);
                ends_m.push(cut_m);
                top_m = cut_m;
            }
        }
        Ok((parts, ends_m))
    }

    /// The light at the ends of all `parts` of the inside of `slab`.
    fn light(
        &self,
        slab: &ThickSlab,
        operators: &SceneOperators,
        parts: &[StreamOperators],
    ) -> Result<StreamLight, EngineError> {
        let identity = Matrix::identity(self.streams.count());
        let couplings = &operators.couplings;
        let (upper, lower) = (&couplings[slab.upper], &couplings[slab.lower]);
        let (mut source, mut back) = (upper.entry.clone(), upper.inner.clone());
        let mut above = vec![(source.clone(), back.clone())];
        for part in parts {
            let [reflected, through] = &part.from_above;
            let [returned, risen] = &part.from_below;
            let both = &identity - &(&back * reflected);
            source = through * &both.clone().solve(source)?;
            back = returned + &(through * &both.solve(&back * risen)?);
            above.push((source.clone(), back.clone()));
        }
        let mut below = vec![lower.inner.clone()];
        let mut under = lower.inner.clone();
        for part in parts.iter().rev() {
            let [reflected, through] = &part.from_above;
            let [returned, risen] = &part.from_below;
            let passed = (&identity - &(returned * &under)).solve(through.clone())?;
            under = reflected + &(risen * &(&under * &passed));
            below.push(under.clone());
        }
        below.reverse();
        let mut light = StreamLight::default();
        for ((source, back), below) in above.into_iter().zip(&below) {
            let down = (&identity - &(&back * below)).solve(source)?;
            light.up.push(below * &down);
            light.down.push(down);
        }
        let escaped = |escape: &[f64], streams: &Matrix| -> f64 {
            let terms = escape.iter().enumerate();
            terms.map(|(i, escape)| escape * streams[(i, 0)]).sum()
        };
        light.leaving = [
            upper.reflected[0] + escaped(&upper.escape, &light.up[0]),
            escaped(&lower.escape, &light.down[parts.len()]),
        ];
        Ok(light)
    }
}
