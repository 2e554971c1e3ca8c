//! A table of outcomes small enough for the processor's cache.
use crate::grain::{Body, Form};
use crate::rng::Stream;
use crate::table::Outcome;

/// Number of columns of each array of a table.
const COLUMNS: usize = 8;

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
    pub(super) motions: Vec<[f32; COLUMNS]>,
    /// Centre (across in plane, across out of plane, along), numbers of the body.
    pub(super) bodies: Vec<[f32; COLUMNS]>,
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
        Self::all(&chosen)
    }

    /// A table of these outcomes, at least one.
    #[must_use]
    pub fn all(chosen: &[Outcome]) -> Self {
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

    /// The table as bytes: the number of its form, the number of rows (8 bytes), then each column
    /// of `motions` and `bodies`: whether its values differ, and all values or the only one.
    /// Numbers are little-endian.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let form = Form::ALL.iter().position(|form| *form == self.form);
        let mut bytes = vec![form.unwrap_or_default() as u8];
        bytes.extend((self.len() as u64).to_le_bytes());
        for rows in [&self.motions, &self.bodies] {
            for column in 0..COLUMNS {
                let mut values = rows.iter().map(|row| row[column].to_bits());
                let first = values.clone().next().unwrap_or_default();
                let differ = values.any(|value| value != first);
                bytes.push(u8::from(differ));
                let stored = if differ { rows.len() } else { 1 };
                let values = rows.iter().take(stored);
                bytes.extend(values.flat_map(|row| row[column].to_le_bytes()));
            }
        }
        bytes
    }

    /// The inverse of [`to_bytes`](Self::to_bytes), to the bit; `None` if the length does not fit.
    #[must_use]
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (form, bytes) = bytes.split_first()?;
        let (rows, mut bytes) = bytes.split_first_chunk()?;
        let rows = usize::try_from(u64::from_le_bytes(*rows)).ok()?;
        // a column that differs has four bytes a row
        if rows == 0 || rows > bytes.len() {
            return None;
        }
        let mut arrays = [vec![[0.0; COLUMNS]; rows], vec![[0.0; COLUMNS]; rows]];
        for array in &mut arrays {
            for column in 0..COLUMNS {
                let (differ, rest) = bytes.split_first()?;
                let stored = if *differ == 0 { 1 } else { rows };
                let (values, rest) = rest.split_at_checked(stored.checked_mul(4)?)?;
                let (values, _) = values.as_chunks();
                for (row, value) in array.iter_mut().zip(values.iter().cycle()) {
                    row[column] = f32::from_le_bytes(*value);
                }
                bytes = rest;
            }
        }
        let [motions, bodies] = arrays;
        bytes.is_empty().then_some(Self {
            form: *Form::ALL.get(usize::from(*form))?,
            motions,
            bodies,
        })
    }

    /// Number of outcomes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.motions.len()
    }

    /// Bytes on the heap.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of::<[f32; COLUMNS]>() * (self.motions.capacity() + self.bodies.capacity())
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
    fn bytes_give_the_same_table() {
        let outcome = |i: u16| Outcome {
            cos: f32::from(i).sin(),
            ice: if i == 3 { f32::INFINITY } else { -0.0 },
            displacement: [0.5; 3],
            ..Outcome::default()
        };
        let outcomes: Vec<Outcome> = (0..50).map(outcome).collect();
        let key = crate::rng::Key {
            seed: 1,
            cell: 0,
            purpose: [0; 3],
            batch: 0,
        };
        for size in [1, 2, 50] {
            let table = PackedTable::new(&outcomes, size, &mut Stream::new(key));
            let bytes = table.to_bytes();
            let again = PackedTable::from_bytes(&bytes).map(|table| table.to_bytes());
            assert_eq!(again.as_ref(), Some(&bytes), "{size}");
            // only the cosine, and in the largest table the path, have different values
            let whole = [0, 1, 2][usize::from(size > 1) + usize::from(size > 2)];
            let constant = 2 * COLUMNS - whole;
            assert_eq!(bytes.len(), 9 + 16 + 4 * (constant + whole * size));
            for cut in [0, 8, 9, bytes.len() - 1] {
                assert!(PackedTable::from_bytes(&bytes[..cut]).is_none(), "{cut}");
            }
            assert!(PackedTable::from_bytes(&[&bytes[..], &[0]].concat()).is_none());
            assert!(PackedTable::from_bytes(&[&[9], &bytes[1..]].concat()).is_none());
        }
    }

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
