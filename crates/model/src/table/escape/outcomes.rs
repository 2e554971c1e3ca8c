//! Outcomes in two groups, without and with a path in ice, each with its probability.
use std::ops::{Deref, Range};

use crate::rng::Stream;
use crate::table::{Outcome, PackedTable};

/// Outcomes of grain events, and as many of those without a path in ice: reflections on the
/// outside of grains. These are few, and where ice absorbs much, only they leave light.
#[derive(Debug, Clone)]
pub struct EscapeTable {
    /// Outcomes of all kinds: without a path in ice before row `first_in_ice`, with one from there.
    all: PackedTable,
    first_in_ice: usize,
    /// Reflections on the outside.
    outside: PackedTable,
    /// Their probability.
    chance_outside: f64,
}

impl EscapeTable {
    /// `size` of the `outcomes`, and as many of those `reflected` on the outside of grains (at
    /// least one), which come with the probability of being reflected.
    #[must_use]
    pub fn new(
        outcomes: &[Outcome],
        reflected: &[(Outcome, f64)],
        size: usize,
        rng: &mut Stream,
    ) -> Self {
        let table = PackedTable::new(outcomes, size, rng);
        let is_in_ice = |row: &usize| table.motions[*row][5] > 0.0;
        let (in_ice, outside): (Vec<_>, Vec<_>) = (0..table.len()).partition(is_in_ice);
        let order = || outside.iter().chain(&in_ice);
        let all = PackedTable {
            form: table.form,
            motions: order().map(|row| table.motions[*row]).collect(),
            bodies: order().map(|row| table.bodies[*row]).collect(),
        };
        let chances = reflected.iter().map(|(_, chance)| chance);
        Self {
            all,
            first_in_ice: outside.len(),
            chance_outside: chances.sum::<f64>() / reflected.len() as f64,
            outside: PackedTable::new(&in_proportion(reflected, size, rng), size, rng),
        }
    }

    /// Outcomes without and with a path in ice: tables, rows in them, probabilities.
    #[inline(always)]
    pub(super) fn groups(&self) -> [(&PackedTable, Range<usize>, f64); 2] {
        let in_ice = self.first_in_ice..self.all.len();
        [
            (&self.outside, 0..self.outside.len(), self.chance_outside),
            (&self.all, in_ice, 1.0 - self.chance_outside),
        ]
    }
}

/// At most `size` of these outcomes (at least one) in proportion to their weights, evenly along
/// the cosine of deflection.
fn in_proportion(weighted: &[(Outcome, f64)], size: usize, rng: &mut Stream) -> Vec<Outcome> {
    let mut order: Vec<&(Outcome, f64)> = weighted.iter().collect();
    order.sort_unstable_by(|a, b| a.0.cos.total_cmp(&b.0.cos));
    let step = order.iter().map(|(_, weight)| weight).sum::<f64>() / size as f64;
    let (mut passed, mut place) = (0.0, step * rng.uniform().as_array()[0]);
    let mut chosen = Vec::with_capacity(size);
    for (outcome, weight) in order {
        passed += weight;
        while place < passed && chosen.len() < size {
            chosen.push(*outcome);
            place += step;
        }
    }
    // without any contrast of indices, nothing is reflected
    if chosen.is_empty() {
        chosen.push(weighted[0].0);
    }
    chosen
}

impl Deref for EscapeTable {
    type Target = PackedTable;

    fn deref(&self) -> &PackedTable {
        &self.all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Key, Stream};
    use crate::table::Outcome;

    fn stream() -> Stream {
        Stream::new(Key {
            seed: 1,
            cell: 0,
            purpose: [0; 3],
            batch: 0,
        })
    }

    #[test]
    fn groups_hold_all_outcomes() {
        let outcomes: Vec<Outcome> = (0..64)
            .map(|i| Outcome {
                cos: 0.9 - 0.02 * i as f32,
                ice: if i % 5 == 0 { 0.0 } else { i as f32 },
                ..Outcome::default()
            })
            .collect();
        let reflected = [0.2, 0.1, 0.3].map(|chance| (Outcome::default(), chance));
        let table = EscapeTable::new(&outcomes, &reflected, outcomes.len(), &mut stream());
        let [(outside, of_outside, chance), (all, in_ice, rest)] = table.groups();
        assert!((chance - 0.2).abs() < 1e-15 && (chance + rest - 1.0).abs() < 1e-15);
        assert_eq!([of_outside, in_ice.clone()], [0..outside.len(), 13..64]);
        assert!(outside.motions.iter().all(|m| m[5] == 0.0));
        assert!(all.motions[..13].iter().all(|m| m[5] == 0.0));
        assert!(all.motions[in_ice].iter().all(|m| m[5] > 0.0));
        // the order of the deflections is kept, and nothing is lost
        assert!(all.motions[..13].is_sorted_by(|a, b| a[0] < b[0]));
        let sorted = |table: &PackedTable| {
            let mut motions = table.motions.clone();
            motions.sort_by(|a, b| a[5].total_cmp(&b[5]).then(a[0].total_cmp(&b[0])));
            motions
        };
        let packed = PackedTable::new(&outcomes, outcomes.len(), &mut stream());
        assert_eq!(sorted(all), sorted(&packed));
    }

    #[test]
    fn outcomes_are_chosen_in_proportion() {
        // cosines from 1 down to -1, weights from 0 to 2
        let weighted: Vec<_> = (0..1000)
            .map(|i| {
                let cos = 1.0 - f64::from(i) / 499.5;
                let outcome = Outcome {
                    cos: cos as f32,
                    ..Outcome::default()
                };
                (outcome, 1.0 - cos)
            })
            .collect();
        let chosen = in_proportion(&weighted, 100, &mut stream());
        assert_eq!(chosen.len(), 100);
        // the share below a cosine x is (3 - x)(1 + x) / 4, for x = 0 three quarters
        for x in [-0.5_f32, 0.0, 0.5] {
            let below = chosen.iter().filter(|outcome| outcome.cos < x).count();
            let expected = 25.0 * (3.0 - x) * (1.0 + x);
            assert!((below as f32 - expected).abs() <= 1.5, "{x}: {below}");
        }
        // a single outcome where nothing is reflected
        let dark = weighted[..3].iter().map(|(outcome, _)| (*outcome, 0.0));
        assert_eq!(
            in_proportion(&dark.collect::<Vec<_>>(), 2, &mut stream()).len(),
            1
        );
    }
}
