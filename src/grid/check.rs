//! What makes a grid impossible, whoever built it.
use thiserror::Error;

use super::{ExtraAxis, Grid, Jobs};
use crate::grain::GrainError;

/// Smallest grain a law may reach, um (docs/methods.md).
const SMALLEST_GRAIN_UM: f64 = 10.0;

/// Why a grid cannot be expanded into jobs.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GridError {
    /// An axis, or the wavelength list, has no values.
    #[error("{axis} is empty; give at least one value")]
    Empty {
        /// Name of the axis.
        axis: &'static str,
    },
    /// Values are not strictly increasing.
    #[error(
        "{axis}: {next} follows {value}; values must be strictly increasing, without duplicates"
    )]
    Order {
        /// Name of the axis.
        axis: &'static str,
        /// A value.
        value: f64,
        /// The one that follows it.
        next: f64,
    },
    /// A value is outside the physical range of its axis, or not finite.
    #[error("{axis} = {value} must be in {allowed}")]
    Value {
        /// Name of the axis.
        axis: &'static str,
        /// The value.
        value: f64,
        /// The range it must be in.
        allowed: &'static str,
    },
    /// A size law reaches below the smallest grain.
    #[error(
        "grain_size_um = {size_um} -+ {half_width_um} reaches below the smallest grain, {SMALLEST_GRAIN_UM} um; raise the size or lower spread.grain_size_half_width_um"
    )]
    SmallGrain {
        /// Axis value, um.
        size_um: f64,
        /// Half width of the law, um.
        half_width_um: f64,
    },
    /// A law of an axis value is not a distribution.
    #[error("{axis} = {value}: {source}")]
    Law {
        /// Name of the axis.
        axis: &'static str,
        /// The axis value.
        value: f64,
        /// What is wrong with its law.
        source: GrainError,
    },
    /// The product of the axis lengths does not fit a 64-bit number.
    #[error("{} curves are more than can be counted; shorten the axes", .shape.iter().map(u64::to_string).collect::<Vec<_>>().join(" x "))]
    TooMany {
        /// Axis lengths, storage order (one number for all axes beyond the
        /// five), and wavelengths.
        shape: Vec<u64>,
    },
    /// Isotropic light with an engine that has a job for each angle.
    #[error("diffuse light beside angles needs the engine doubling or auto, not {engine}")]
    Diffuse {
        /// The engine.
        engine: &'static str,
    },
    /// A job number outside the grid.
    #[error("job {job} does not exist: the grid has {jobs} jobs, counted from 0")]
    NoSuchJob {
        /// The number asked for.
        job: u64,
        /// How many there are.
        jobs: u64,
    },
}

impl Grid {
    /// The jobs of this grid, after checking that all of them can be made.
    ///
    /// # Errors
    /// Empty, unsorted or unphysical axes, laws that are no distributions, or
    /// more values than can be counted.
    pub fn jobs(&self) -> Result<Jobs, GridError> {
        type Range = (fn(f64) -> bool, &'static str);
        let ranges: [Range; 5] = [
            (|f| (0.0..=1.0).contains(&f), "[0, 1]"),
            (|s| s > 0.0, "(0, infinity)"),
            (|d| d > 0.0, "(0, density of ice)"),
            (|h| h > 0.0, "(0, infinity)"),
            (|a| (0.0..90.0).contains(&a), "[0, 90)"),
        ];
        for ((axis, values), (inside, allowed)) in self.axes.named().into_iter().zip(ranges) {
            check_list(axis, values, inside, allowed)?;
        }
        for (axis, values) in &self.axes.extra {
            let (inside, allowed) = axis.range();
            check_list(axis.name(), values, inside, allowed)?;
        }
        let positive = |nm| nm > 0.0;
        check_list(
            "wavelength_nm",
            &self.wavelengths_nm,
            positive,
            "(0, infinity)",
        )?;
        for &value in &self.axes.facetness {
            self.facetness_law(value)?;
        }
        for &value in &self.axes.grain_size_um {
            self.size_law(value)?;
        }
        for &value in self
            .axes
            .extra
            .get(&ExtraAxis::Sphericity)
            .into_iter()
            .flatten()
        {
            self.spread.sphericity_law(value)?;
        }
        if self.fixed.diffuse && !self.run.engine.shares_angles() {
            let engine = self.run.engine.name();
            return Err(GridError::Diffuse { engine });
        }
        Jobs::new(
            self.run.engine,
            self.axes.shape(),
            self.wavelengths_nm.len() as u64,
        )?
        .repeated(self.axes.combinations())
    }

    /// Refuses a size law below the smallest grain.
    pub(super) fn check_size(&self, size_um: f64) -> Result<(), GridError> {
        let half_width_um = self.spread.grain_size_half_width_um;
        // A hair below is a rounded difference, not a smaller grain.
        if size_um - half_width_um < SMALLEST_GRAIN_UM * (1.0 - 1e-12) {
            return Err(GridError::SmallGrain {
                size_um,
                half_width_um,
            });
        }
        Ok(())
    }
}

fn check_list(
    axis: &'static str,
    values: &[f64],
    inside: impl Fn(f64) -> bool,
    allowed: &'static str,
) -> Result<(), GridError> {
    if values.is_empty() {
        return Err(GridError::Empty { axis });
    }
    if let Some(&value) = values.iter().find(|v| !(v.is_finite() && inside(**v))) {
        return Err(GridError::Value {
            axis,
            value,
            allowed,
        });
    }
    match values
        .iter()
        .zip(values.iter().skip(1))
        .find(|(v, next)| next <= v)
    {
        Some((&value, &next)) => Err(GridError::Order { axis, value, next }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::engine::Engine;
    use crate::grid::tests::small;

    #[test]
    fn refuses_what_cannot_be_run() {
        let refused = |change: fn(&mut Grid)| {
            let mut grid = small(Engine::Spectral);
            change(&mut grid);
            grid.jobs().unwrap_err().to_string()
        };
        type Case = (fn(&mut Grid), &'static str);
        let cases: [Case; 10] = [
            (|g| g.axes.angle_deg.clear(), "angle_deg is empty"),
            (
                |g| g.axes.angle_deg.push(90.0),
                "angle_deg = 90 must be in [0, 90)",
            ),
            (
                |g| g.axes.thickness_cm.push(5.0),
                "thickness_cm: 5 follows 5",
            ),
            (
                |g| g.axes.density_kg_m3.push(f64::NAN),
                "density_kg_m3 = NaN",
            ),
            (
                |g| g.axes.facetness.push(1.1),
                "facetness = 1.1 must be in [0, 1]",
            ),
            (
                |g| g.axes.grain_size_um.insert(0, 59.0),
                "grain_size_um = 59 -+ 50",
            ),
            (
                |g| g.spread.grain_size_half_width_um = -1.0,
                "grain_size_um = 100:",
            ),
            (
                |g| g.spread.facetness_half_width = -0.1,
                "facetness = 0.05:",
            ),
            (|g| g.spread.facetness_sd = f64::NAN, "facetness = 0.05:"),
            (|g| g.wavelengths_nm.clear(), "wavelength_nm is empty"),
        ];
        for (change, message) in cases {
            let got = refused(change);
            assert!(got.starts_with(message), "{got} / {message}");
        }
    }

    #[test]
    fn a_grain_of_exactly_ten_um_is_allowed() {
        let mut grid = small(Engine::Spectral);
        grid.axes.grain_size_um.insert(0, 60.0);
        assert!(grid.jobs().is_ok());
    }
}
