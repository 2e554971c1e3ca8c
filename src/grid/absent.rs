//! Absent curves of a grid: those whose slab is too thin for the grains.
//!
//! A slab must be at least [`MIN_GRAIN_LENGTHS`] times as thick as its longest grain is
//! long. Absent curves are described by one count per grain size: the number of the
//! thinnest thicknesses that are too thin. An empty list means that all curves exist.
use std::fmt::Write;

use super::{Fixed, Grid, GridError};
use crate::parameter::{Axes, Parameter};
use crate::transport::Joining;
use crate::units::cm_to_m;

/// Smallest thickness of a slab, in lengths of its longest grain (docs/methods.md).
pub const MIN_GRAIN_LENGTHS: f64 = 10.0;

impl Fixed {
    /// Smallest total thickness of the snowpack, m, if the longest grain of the surface
    /// layer has the length `longest_m`, m.
    #[must_use]
    pub fn thinnest_m(&self, longest_m: f64) -> f64 {
        match self.model.joining {
            Joining::Continuous => {
                let below = self.below.iter().map(|layer| layer.snow.sizes_m()[1]);
                MIN_GRAIN_LENGTHS * below.fold(longest_m, f64::max)
            }
            Joining::Cascade => {
                let below: f64 = self.below.iter().map(|layer| layer.thickness_m).sum();
                below + MIN_GRAIN_LENGTHS * longest_m
            }
        }
    }
}

impl Grid {
    /// For each grain size, the number of the thinnest thicknesses that are too thin for
    /// its grains, so that they have no curve. Empty if all curves exist.
    ///
    /// # Errors
    /// [`GridError::SmallGrain`] or [`GridError::Law`] if the size distribution of a grain
    /// size is invalid.
    pub fn absent(&self) -> Result<Vec<usize>, GridError> {
        let mut absent = Vec::new();
        for &size_um in self.axes.values(Parameter::GrainSize) {
            let min_m = self.fixed.thinnest_m(self.size_law(size_um)?.max_m());
            // tolerance for rounding errors in sums of thicknesses
            let thin = |cm: &&f64| cm_to_m(**cm) < min_m * (1.0 - 1e-12);
            let thicknesses = self.axes.values(Parameter::Thickness).iter();
            absent.push(thicknesses.take_while(thin).count());
        }
        if absent.iter().all(|n| *n == 0) {
            absent.clear();
        }
        Ok(absent)
    }
}

/// Number of curves of `axes` that do not exist, from the counts of [`Grid::absent`].
#[must_use]
pub fn absent_curves(axes: &Axes, absent: &[usize]) -> u64 {
    let pairs = absent.iter().sum::<usize>() as u64;
    let others = axes
        .iter()
        .filter(|(p, _)| ![Parameter::GrainSize, Parameter::Thickness].contains(p));
    others.fold(pairs, |n, (_, values)| n * values.len() as u64)
}

/// Rows, in storage order, of the curves that exist.
#[must_use]
pub fn existing_rows(axes: &Axes, absent: &[usize]) -> Vec<usize> {
    let [_, sizes, densities, thicknesses, angles] = axes.core_shape();
    let exists = |row: &usize| {
        let thickness = row / angles % thicknesses;
        let size = row / (angles * thicknesses * densities) % sizes;
        thickness >= absent.get(size).copied().unwrap_or_default()
    };
    (0..axes.count() as usize).filter(exists).collect()
}

/// A message that says how many curves do not exist, and for which grain sizes and
/// thicknesses.
#[must_use]
pub fn why_absent(axes: &Axes, absent: &[usize]) -> String {
    let mut text = format!(
        "{} of {} curves do not exist and are NaN: the slab must be at least {MIN_GRAIN_LENGTHS} lengths of the longest grain thick",
        absent_curves(axes, absent),
        axes.count()
    );
    let thicknesses = axes.values(Parameter::Thickness);
    let mut separator = "; too thin are";
    let sizes_um = axes.values(Parameter::GrainSize);
    let mut row = 0;
    for run in absent.chunk_by(|a, b| a == b) {
        let sizes_um = &sizes_um[row..row + run.len()];
        row += run.len();
        let (Some(last), Some(first), Some(end)) =
            (run[0].checked_sub(1), sizes_um.first(), sizes_um.last())
        else {
            continue;
        };
        let cm = thicknesses.get(last).copied().unwrap_or_default();
        let _ = write!(
            text,
            "{separator} slabs up to {cm} cm for grain_size_um {first}"
        );
        if end > first {
            let _ = write!(text, " to {end}");
        }
        separator = ",";
    }
    text
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::engine::Engine;
    use crate::grid::tests::small;

    #[test]
    fn ten_lengths_of_the_longest_grain_must_fit() {
        let mut grid = small(Engine::Spectral);
        // grains up to 150, 250, 1050 and 2050 um in 1, 2 and 5 cm
        assert!(grid.absent().unwrap().is_empty());
        grid.axes
            .values_mut(Parameter::GrainSize)
            .extend([1000.0, 2000.0]);
        assert_eq!(grid.absent().unwrap(), [0, 0, 1, 2]);
        let absent = grid.absent().unwrap();
        // two facetnesses, one density, two angles
        assert_eq!(absent_curves(&grid.axes, &absent), 3 * 4);
        let why = why_absent(&grid.axes, &absent);
        assert!(why.starts_with("12 of 48 curves"), "{why}");
        assert!(why.ends_with(
            "too thin are slabs up to 1 cm for grain_size_um 1000, slabs up to 2 cm for grain_size_um 2000"
        ));
        // sizes that lack the same slabs are given as a range
        let sizes = grid.axes.values_mut(Parameter::GrainSize);
        sizes.extend([2010.0, 2020.0]);
        let why = why_absent(&grid.axes, &grid.absent().unwrap());
        assert!(
            why.ends_with("grain_size_um 1000, slabs up to 2 cm for grain_size_um 2000 to 2020")
        );
        grid.axes.values_mut(Parameter::GrainSize).truncate(4);
        // exactly ten lengths are enough
        grid.axes.values_mut(Parameter::GrainSize)[3] = 1950.0;
        assert_eq!(grid.absent().unwrap(), [0, 0, 1, 1]);
    }
}
