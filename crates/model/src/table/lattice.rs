//! Points of a lattice that cover the unit cube evenly: a Kronecker sequence (Roberts 2018),
//! shifted at random.
use splitsnow_spectra::simd::{F64x8, Simd};

use crate::rng::Stream;

const TWO_TO_64: f64 = 18_446_744_073_709_551_616.0;

/// A shifted lattice.
#[derive(Debug)]
pub(super) struct Lattice {
    increments: Vec<u64>,
    shifts: Vec<u64>,
}

/// The first 52 bits as a number in [0, 1).
#[inline(always)]
fn unit_interval(bits: u64) -> f64 {
    f64::from_bits(bits >> 12 | 0x3ff0_0000_0000_0000) - 1.0
}

impl Lattice {
    /// A lattice of so many dimensions. Its increments are powers of 1/phi, where phi is the
    /// root of x^(d+1) = x + 1, in units of 2^-64.
    pub(super) fn new<S: Simd>(dimensions: usize, rng: &mut Stream<S>) -> Self {
        let d = dimensions as f64;
        let mut phi = 1.5_f64;
        for _ in 0..64 {
            phi = libm::pow(1.0 + phi, 1.0 / (d + 1.0));
        }
        let increment = |j| (libm::pow(phi, -f64::from(j)) % 1.0 * TWO_TO_64) as u64;
        let mut lattice = Self {
            increments: (1..=dimensions as u32).map(increment).collect(),
            shifts: vec![0; dimensions],
        };
        lattice.shift(rng);
        lattice
    }

    /// Shifts the lattice at random.
    #[inline(always)]
    pub(super) fn shift<S: Simd>(&mut self, rng: &mut Stream<S>) {
        for shift in &mut self.shifts {
            *shift = (rng.uniform().as_array()[0] * TWO_TO_64) as u64;
        }
    }

    /// The coordinates of the next point.
    #[inline(always)]
    pub(super) fn next(&mut self) -> impl Iterator<Item = f64> {
        let coordinates = self.shifts.iter_mut().zip(&self.increments);
        coordinates.map(|(point, increment)| {
            *point = point.wrapping_add(*increment);
            unit_interval(*point)
        })
    }

    /// One coordinate of the points number `first` to `first + 7`.
    #[inline(always)]
    pub(super) fn eight<S: Simd>(&self, dimension: usize, first: usize) -> F64x8<S> {
        let (shift, increment) = (self.shifts[dimension], self.increments[dimension]);
        let mut point = shift.wrapping_add(increment.wrapping_mul(first as u64));
        let mut lanes = [0.0; 8];
        for lane in &mut lanes {
            *lane = unit_interval(point);
            point = point.wrapping_add(increment);
        }
        F64x8::new(lanes)
    }
}

#[cfg(test)]
mod tests {
    use splitsnow_spectra::simd::Portable;

    use super::*;
    use crate::rng::Key;

    #[test]
    fn points_cover_intervals_evenly_and_eight_at_once_are_those_one_by_one() {
        let mut rng = Stream::new(Key {
            seed: 1,
            cell: 0,
            purpose: [0; 3],
            batch: 0,
        });
        let mut lattice = Lattice::new(3, &mut rng);
        let points = 1024;
        let eights: Vec<f64> = (0..points)
            .step_by(8)
            .flat_map(|first| lattice.eight::<Portable>(0, first).to_array())
            .collect();
        // number `first` is the shift itself, which `next` steps over
        let one_by_one: Vec<f64> = (1..points).filter_map(|_| lattice.next().next()).collect();
        assert_eq!(eights[1..], one_by_one);
        // of random points, a tenth would hold 102 +- 10
        for tenth in 0..10 {
            let inside = |u: &&f64| (**u * 10.0) as usize == tenth;
            let count = eights.iter().filter(inside).count();
            assert!(count.abs_diff(102) <= 4, "{tenth}: {count}");
        }
    }
}
