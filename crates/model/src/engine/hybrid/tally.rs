//! What walks and grain events come to at one wavelength, as one list of numbers.
//!
//! Every number is a mean over walks or grain events. So the list of all parts
//! is the mean of the lists of each, and that of all but one is close to it: the
//! delete-one jackknife (Tukey 1958) takes the scatter of what follows from
//! these, and is then as good as linear in the noise of the parts.
use std::sync::Arc;

use super::cut::{Plan, Slab};
use super::inside::Flights;
use super::planes::Piece;
use super::walks::Walks;
use super::{Run, inside};
use crate::engine::nodes::Mix;
use crate::engine::tables::PARTS;
use crate::table::{Event, Scores};
use crate::transport::{Coefficients, Snow};

/// Where the numbers are.
#[derive(Debug, Default)]
pub(super) struct Layout {
    /// First number of each task, and how many it has out and through.
    tasks: Vec<(usize, [usize; 2])>,
    /// First number of the mean grain event of each layer, of those that have an inside.
    events: Vec<Option<usize>>,
    /// Moments of a grain event.
    moments: usize,
    len: usize,
}

/// Means at one wavelength.
#[derive(Debug, Clone)]
pub(super) struct Tally(Vec<f64>);

impl Layout {
    pub(super) fn new(plan: &Plan, snows: usize, streams: usize) -> Self {
        let mut layout = Self {
            // one more than the solver uses, for delta-M
            moments: 2 * streams + 1,
            ..Self::default()
        };
        for task in &plan.tasks {
            let columns = task.columns();
            layout.tasks.push((layout.len, columns));
            layout.len += columns[0] + columns[1];
        }
        for snow in 0..snows {
            let points = |piece: &Piece<usize>| match piece {
                Piece::Points(stretch) => stretch.snow == snow,
                Piece::Walked(_) => false,
            };
            let is_inside = plan.slabs.iter().any(|slab| match slab {
                Slab::Thin(_) => false,
                Slab::Thick(cut) => cut.inside.iter().any(points),
            });
            layout.events.push(is_inside.then_some(layout.len));
            if is_inside {
                layout.len += layout.moments + 3;
            }
        }
        layout
    }
}

impl Tally {
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

    /// Mean of all parts but one, where this is the mean of all.
    pub(super) fn without(&self, part: &Self) -> Self {
        let others = 1.0 / (PARTS - 1) as f64;
        let pairs = self.0.iter().zip(&part.0);
        Self(pairs.map(|(all, one)| all + (all - one) * others).collect())
    }

    /// Mean scores per walk of task number `task`: of what leaves above, and below.
    pub(super) fn scores(&self, layout: &Layout, task: usize) -> [&[f64]; 2] {
        let (first, [out, through]) = layout.tasks[task];
        let (out, rest) = self.0[first..].split_at(out);
        [out, &rest[..through]]
    }

    /// The mean grain event of the `snow`-th layer, if it has an inside.
    pub(super) fn event(&self, layout: &Layout, snow: usize) -> Option<Event> {
        let numbers = &self.0[layout.events[snow]?..];
        let (moments, rest) = numbers.split_at(layout.moments);
        let mut moments = moments.to_vec();
        // of light that nothing absorbs a mean of ones may round above 1
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

impl Run<'_> {
    /// What `part` of the walks and grain events comes to at the wavelength of
    /// `coefficients`, with the flights through each layer.
    pub(super) fn tally(
        &self,
        walks: &[Arc<Walks>],
        mix: &Mix,
        coefficients: &Coefficients,
        flights: &[Flights],
        part: usize,
    ) -> Tally {
        let layout = &self.layout;
        let mut numbers = vec![0.0; layout.len];
        let mut sums = vec![0.0; self.streams.count()];
        for (walks, share) in mix.of(walks) {
            for (task, (first, columns)) in layout.tasks.iter().enumerate() {
                let Scores { out, through, rays } = walks.scores(part, task);
                let share = share / *rays as f64;
                let mut rest = &mut numbers[*first..];
                for (scores, columns) in [out, through].into_iter().zip(columns) {
                    let sums = &mut sums[..*columns];
                    scores.weighted(coefficients, sums);
                    let (here, after) = rest.split_at_mut(*columns);
                    let pairs = here.iter_mut().zip(&*sums);
                    pairs.for_each(|(number, sum)| *number += share * sum);
                    rest = after;
                }
            }
        }
        let snows: Vec<&Snow> = self.request.snowpack.snows().collect();
        for (number, first) in layout.events.iter().enumerate() {
            let Some(first) = first else { continue };
            let event = inside::event(walks, mix, snows[number], &flights[number], part, number);
            let [a, b] = event.displacement_m;
            let all = event
                .moments
                .iter()
                .chain([&a, &b, &event.displacement_sq_m2]);
            let pairs = numbers[*first..].iter_mut().zip(all);
            pairs.for_each(|(number, value)| *number = *value);
        }
        Tally(numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean of the others is that of all of them by hand.
    #[test]
    fn parts_are_left_out_one_at_a_time() {
        let parts: Vec<Tally> = (0..PARTS)
            .map(|part| Tally(vec![part as f64, (part * part) as f64]))
            .collect();
        let all = Tally::mean(&parts);
        for left in 0..PARTS {
            let mut others = parts.clone();
            others.remove(left);
            let (ours, expected) = (all.without(&parts[left]), Tally::mean(&others));
            for (a, b) in ours.0.iter().zip(&expected.0) {
                assert!((a - b).abs() < 1e-12, "{left}: {a} {b}");
            }
        }
    }
}
