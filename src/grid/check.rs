//! Checks that a grid is valid, whether it comes from a file or from code.
use thiserror::Error;

use super::{Grid, Jobs};
use crate::grain::GrainError;
use crate::measurement::ViewError;
use crate::parameter::{Interval, Parameter};

/// Smallest grain that a size distribution may contain, um (docs/methods.md).
const SMALLEST_GRAIN_UM: f64 = 10.0;

/// Why a grid cannot be expanded into jobs.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum GridError {
    /// An axis, or the wavelength list, has no values.
    #[error("{axis} is empty; give at least one value")]
    Empty {
        /// Name of the axis.
        axis: &'static str,
    },
    /// The values of an axis are not strictly increasing.
    #[error(
        "{axis}: {next} follows {value}; values must be strictly increasing, without duplicates; sort them"
    )]
    Order {
        /// Name of the axis.
        axis: &'static str,
        /// The value before `next`.
        value: f64,
        /// A value that is not above `value`.
        next: f64,
    },
    /// A value is outside the physical range of its axis, or not finite.
    #[error("{axis} = {value} must be {allowed}")]
    Value {
        /// Name of the axis.
        axis: &'static str,
        /// The value.
        value: f64,
        /// The allowed range.
        allowed: Interval,
    },
    /// A size distribution contains grains that are too small.
    #[error(
        "grain_size_um = {size_um} +- {half_width_um} includes grains smaller than {SMALLEST_GRAIN_UM} um, the smallest allowed size; raise the size or lower spread.grain_size_half_width_um"
    )]
    SmallGrain {
        /// Axis value, um.
        size_um: f64,
        /// Half width of the size distribution, um.
        half_width_um: f64,
    },
    /// The distribution around an axis value is invalid.
    #[error("{axis} = {value}: {source}")]
    Law {
        /// Name of the axis.
        axis: &'static str,
        /// The axis value.
        value: f64,
        /// What is wrong with the distribution.
        source: GrainError,
    },
    /// The product of the axis lengths does not fit into 64 bits.
    #[error("{} values are too many to be counted; shorten the axes", .shape.iter().map(u64::to_string).collect::<Vec<_>>().join(" x "))]
    TooMany {
        /// Lengths of the axes in storage order, then the number of wavelengths.
        shape: Vec<u64>,
    },
    /// Diffuse light with an engine that has a separate job for each incidence angle.
    #[error("axes.diffuse requires the engine hybrid or auto, not {engine}; use one of these two")]
    Diffuse {
        /// Name of the engine.
        engine: &'static str,
    },
    /// A view is out of range.
    #[error(transparent)]
    Views(ViewError),
    /// The job number is out of range.
    #[error("job {job} does not exist: the grid has {jobs} jobs, counted from 0")]
    NoSuchJob {
        /// The requested job number.
        job: u64,
        /// Number of jobs in the grid.
        jobs: u64,
    },
}

impl Grid {
    /// The jobs of this grid, after checking that all of them are valid.
    ///
    /// # Errors
    /// [`GridError`] if an axis is empty, unsorted or unphysical, a distribution is invalid,
    /// the engine does not support diffuse light, or the grid has too many values to count.
    pub fn jobs(&self) -> Result<Jobs, GridError> {
        let missing = Parameter::CORE.into_iter().find(|p| !self.axes.has(*p));
        if let Some(parameter) = missing {
            let axis = parameter.key();
            return Err(GridError::Empty { axis });
        }
        if let Some(views) = &self.views {
            let mut axes = Parameter::VIEWS.into_iter();
            if let Some(parameter) = axes.find(|p| !views.axes.has(*p)) {
                let axis = parameter.key();
                return Err(GridError::Empty { axis });
            }
        }
        let views = self.views.iter().flat_map(|views| views.axes.iter());
        for (parameter, values) in self.axes.iter().chain(views) {
            check_list(parameter.key(), values, parameter.record().physical)?;
        }
        let wavelengths = Interval {
            min: 0.0,
            max: 1e6,
            open: [true, false],
        };
        check_list("wavelength_nm", &self.wavelengths_nm, wavelengths)?;
        for &value in self.axes.values(Parameter::Facetness) {
            self.spread.facetness_law(value)?;
        }
        for &value in self.axes.values(Parameter::GrainSize) {
            self.size_law(value)?;
        }
        for &value in self.axes.values(Parameter::Sphericity) {
            self.spread.sphericity_law(value)?;
        }
        if self.fixed.diffuse && !self.run.engine.shares_angles() {
            let engine = self.run.engine.name();
            return Err(GridError::Diffuse { engine });
        }
        let wavelengths = self.wavelengths_nm.len() as u64;
        Jobs::new(self.run.engine, &self.axes, wavelengths)
    }

    /// Refuses a size distribution with grains smaller than [`SMALLEST_GRAIN_UM`].
    pub(super) fn check_size(&self, size_um: f64) -> Result<(), GridError> {
        let half_width_um = self.spread.grain_size_half_width_um;
        // The tolerance allows for the rounding error of the difference.
        if size_um - half_width_um < SMALLEST_GRAIN_UM * (1.0 - 1e-12) {
            return Err(GridError::SmallGrain {
                size_um,
                half_width_um,
            });
        }
        Ok(())
    }
}

fn check_list(axis: &'static str, values: &[f64], allowed: Interval) -> Result<(), GridError> {
    if values.is_empty() {
        return Err(GridError::Empty { axis });
    }
    if let Some(&value) = values.iter().find(|v| !allowed.contains(**v)) {
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
            (
                |g| g.axes.values_mut(Parameter::Incidence).clear(),
                "incidence_angle_deg is empty",
            ),
            (
                |g| g.axes.values_mut(Parameter::Incidence).push(90.0),
                "incidence_angle_deg = 90 must be at least 0 and below 90",
            ),
            (
                |g| g.axes.values_mut(Parameter::Thickness).push(5.0),
                "thickness_cm: 5 follows 5",
            ),
            (
                |g| g.axes.values_mut(Parameter::Density).push(f64::NAN),
                "density_kg_m3 = NaN",
            ),
            (
                |g| g.axes.values_mut(Parameter::Facetness).push(1.1),
                "facetness = 1.1 must be 0 to 1",
            ),
            (
                |g| g.axes.values_mut(Parameter::GrainSize).insert(0, 59.0),
                "grain_size_um = 59 +- 50",
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
        grid.axes.values_mut(Parameter::GrainSize).insert(0, 60.0);
        assert!(grid.jobs().is_ok());
    }
}
