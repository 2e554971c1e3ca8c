//! Outcomes in two groups: without a path in ice, and with one.
use std::ops::{Deref, Range};

use crate::table::PackedTable;

/// A table whose outcomes without a path in ice, reflections on the outside of grains, come
/// first. Where ice absorbs much, only they leave light.
#[derive(Debug, Clone)]
pub struct EscapeTable {
    table: PackedTable,
    /// Number of outcomes without a path in ice.
    outside: usize,
}

impl EscapeTable {
    /// Sorts `table` into the two groups. The order within each is kept.
    #[must_use]
    pub fn new(table: &PackedTable) -> Self {
        let rows = || 0..table.len();
        let in_ice = |row: &usize| table.motions[*row][5] > 0.0;
        let outside: Vec<usize> = rows().filter(|row| !in_ice(row)).collect();
        let order = || outside.iter().copied().chain(rows().filter(in_ice));
        Self {
            table: PackedTable {
                form: table.form,
                motions: order().map(|row| table.motions[row]).collect(),
                bodies: order().map(|row| table.bodies[row]).collect(),
            },
            outside: outside.len(),
        }
    }

    /// The rows of the two groups.
    #[inline(always)]
    pub(super) fn groups(&self) -> [Range<usize>; 2] {
        [0..self.outside, self.outside..self.table.len()]
    }
}

impl Deref for EscapeTable {
    type Target = PackedTable;

    fn deref(&self) -> &PackedTable {
        &self.table
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Key, Stream};
    use crate::table::Outcome;

    #[test]
    fn groups_hold_all_outcomes() {
        let outcomes: Vec<Outcome> = (0..64)
            .map(|i| Outcome {
                cos: 0.9 - 0.02 * i as f32,
                ice: if i % 5 == 0 { 0.0 } else { i as f32 },
                ..Outcome::default()
            })
            .collect();
        let mut rng = Stream::new(Key {
            seed: 1,
            cell: 0,
            purpose: [0; 3],
            batch: 0,
        });
        let packed = PackedTable::new(&outcomes, outcomes.len(), &mut rng);
        let table = EscapeTable::new(&packed);
        let [outside, inside] = table.groups();
        assert_eq!([outside.clone(), inside.clone()], [0..13, 13..64]);
        assert!(table.motions[outside.clone()].iter().all(|m| m[5] == 0.0));
        assert!(table.motions[inside].iter().all(|m| m[5] > 0.0));
        // the order of the deflections is kept, and nothing is lost
        assert!(table.motions[outside].is_sorted_by(|a, b| a[0] < b[0]));
        let sorted = |table: &PackedTable| {
            let mut motions = table.motions.clone();
            motions.sort_by(|a, b| a[5].total_cmp(&b[5]).then(a[0].total_cmp(&b[0])));
            motions
        };
        assert_eq!(sorted(&table), sorted(&packed));
    }
}
