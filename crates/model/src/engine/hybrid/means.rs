//! Mean scores of walks and mean grain events at one wavelength, as one list of
//! numbers.
//!
//! Every number is a mean over walks or grain events, so the list for all parts is
//! the mean of the lists of the single parts. The list with one part left out is
//! close to it. The delete-one jackknife (Tukey 1958) uses the scatter of the
//! results computed from these lists; they are practically linear in the noise of
//! the parts.
use std::sync::Arc;

use super::inside::Flights;
use super::plan::{Slab, WalkPlan};
use super::planes::Segment;
use super::walks::Walks;
use super::{HybridRun, inside};
use crate::engine::nodes::Mix;
use crate::engine::tables::PARTS;
use crate::table::{Event, Scores};
use crate::transport::{Coefficients, PlaneFluxes, Snow};

/// Numbers per plane: downward flux, its actinic flux, upward flux, its actinic flux.
const PLANE_NUMBERS: usize = 4;

/// Positions of the numbers in a list of means.
#[derive(Debug, Default)]
pub(super) struct MeanLayout {
    /// Per task, the position of its first number, and how many numbers it has for
    /// light that leaves above, for light that leaves below and, after these, for each plane that
    /// light crosses.
    tasks: Vec<(usize, [usize; 2], usize)>,
    /// Per layer, the position of its mean grain event; `None` if no bulk segment is
    /// in the layer.
    events: Vec<Option<usize>>,
    /// Number of moments of a grain event.
    moments: usize,
    len: usize,
}

/// Means at one wavelength.
#[derive(Debug, Clone)]
pub(super) struct Means(Vec<f64>);

impl MeanLayout {
    pub(super) fn new(plan: &WalkPlan, layers: usize, streams: usize) -> Self {
        let mut layout = Self {
            // one more than the solver uses, for delta-M
            moments: 2 * streams + 1,
            ..Self::default()
        };
        for task in &plan.tasks {
            let columns = task.columns();
            let crossings = PLANE_NUMBERS * task.planes_m.len();
            layout.tasks.push((layout.len, columns, crossings));
            layout.len += columns[0] + columns[1] + crossings;
        }
        for layer in 0..layers {
            let is_bulk = |segment: &Segment<usize>| match segment {
                Segment::Bulk(section) => section.layer == layer,
                Segment::Walked(_) => false,
            };
            let has_bulk = plan.slabs.iter().any(|slab| match slab {
                Slab::Thin(_) => false,
                Slab::Thick(slab) => slab.inside.iter().any(is_bulk),
            });
            layout.events.push(has_bulk.then_some(layout.len));
            if has_bulk {
                layout.len += layout.moments + 3;
            }
        }
        layout
    }
}

impl Means {
    /// Mean of all `parts`.
    pub(super) fn mean(parts: &[Self]) -> Self {
        let mut sum = vec![0.0; parts.first().map_or(0, |part| part.0.len())];
        for part in parts {
            let pairs = sum.iter_mut().zip(&part.0);
            pairs.for_each(|(sum, number)| *sum += number);
        }
        let share = 1.0 / parts.len() as f64;
        sum.iter_mut().for_each(|sum| *sum *= share);
        Self(sum)
    }

    /// Mean of all parts but `part`; `self` is the mean of all parts.
    pub(super) fn without(&self, part: &Self) -> Self {
        let others = 1.0 / (PARTS - 1) as f64;
        let pairs = self.0.iter().zip(&part.0);
        Self(
            pairs
                .map(|(all, left_out)| all + (all - left_out) * others)
                .collect(),
        )
    }

    /// Mean scores per walk of task number `task`, of light that leaves above and of
    /// light that leaves below.
    pub(super) fn scores(&self, layout: &MeanLayout, task: usize) -> [&[f64]; 2] {
        let (first, [out, through], _) = layout.tasks[task];
        let (out, rest) = self.0[first..].split_at(out);
        [out, &rest[..through]]
    }

    /// Mean fluxes per walk of task number `task` at its planes.
    pub(super) fn crossings(
        &self,
        layout: &MeanLayout,
        task: usize,
    ) -> impl Iterator<Item = PlaneFluxes> {
        let (first, [out, through], crossings) = layout.tasks[task];
        let first = first + out + through;
        let (planes, _) = self.0[first..first + crossings].as_chunks::<PLANE_NUMBERS>();
        let fluxes = planes.iter();
        fluxes.map(|[down, actinic_down, up, actinic_up]| [*down, *up, actinic_down + actinic_up])
    }

    /// The mean grain event of layer number `layer`; `None` if the layer has no bulk
    /// segment.
    pub(super) fn event(&self, layout: &MeanLayout, layer: usize) -> Option<Event> {
        let numbers = &self.0[layout.events[layer]?..];
        let (moments, rest) = numbers.split_at(layout.moments);
        let mut moments = moments.to_vec();
        // without absorption, rounding may put a mean of ones above 1
        if let Some(albedo) = moments.first_mut().filter(|x| **x < 1.0 + 1e-12) {
            *albedo = albedo.min(1.0);
        }
        Some(Event {
            moments,
            displacement_m: [rest[0], rest[1]],
            displacement_sq_m2: rest[2],
        })
    }
}

impl HybridRun<'_> {
    /// Means over `part` of the walks and grain events at the wavelength of
    /// `coefficients`; `flights` are those of each layer.
    pub(super) fn means(
        &self,
        walks: &[Arc<Walks>],
        mix: &Mix,
        coefficients: &Coefficients,
        flights: &[Flights],
        part: usize,
    ) -> Means {
        let layout = &self.layout;
        let mut numbers = vec![0.0; layout.len];
        let mut sums = vec![0.0; self.streams.count().max(PLANE_NUMBERS / 2)];
        for (walks, share) in mix.select(walks) {
            for (task, (first, columns, _)) in layout.tasks.iter().enumerate() {
                let Scores {
                    out,
                    through,
                    crossings,
                    rays,
                } = walks.scores(part, task);
                let share = share / *rays as f64;
                let mut rest = &mut numbers[*first..];
                let columns = columns
                    .iter()
                    .chain(std::iter::repeat(&(PLANE_NUMBERS / 2)));
                for (scores, columns) in [out, through].into_iter().chain(crossings).zip(columns) {
                    let sums = &mut sums[..*columns];
                    scores.weighted(coefficients, sums);
                    let (task_numbers, after) = rest.split_at_mut(*columns);
                    let pairs = task_numbers.iter_mut().zip(&*sums);
                    pairs.for_each(|(number, sum)| *number += share * sum);
                    rest = after;
                }
            }
        }
        let snows: Vec<&Snow> = self.request.snowpack.snows().collect();
        for (layer, first) in layout.events.iter().enumerate() {
            let Some(first) = first else { continue };
            let event = inside::event(walks, mix, snows[layer], &flights[layer], part, layer);
            let [a, b] = event.displacement_m;
            let values = event
                .moments
                .iter()
                .chain([&a, &b, &event.displacement_sq_m2]);
            let pairs = numbers[*first..].iter_mut().zip(values);
            pairs.for_each(|(number, value)| *number = *value);
        }
        Means(numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `without` gives the mean of the other parts.
    #[test]
    fn parts_are_left_out_one_at_a_time() {
        let parts: Vec<Means> = (0..PARTS)
            .map(|part| Means(vec![part as f64, (part * part) as f64]))
            .collect();
        let all = Means::mean(&parts);
        for left_out in 0..PARTS {
            let mut others = parts.clone();
            others.remove(left_out);
            let (ours, expected) = (all.without(&parts[left_out]), Means::mean(&others));
            for (a, b) in ours.0.iter().zip(&expected.0) {
                assert!((a - b).abs() < 1e-12, "{left_out}: {a} {b}");
            }
        }
    }
}
