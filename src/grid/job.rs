//! From a job's number to what an engine is asked for.
use std::fmt;

use super::{Conditions, Grid, GridError, Jobs, described};
use crate::engine::{Request, Resolution};
use crate::grain::{GrainType, SizeRange, TruncatedNormal};
use crate::measurement::{Measured, Spectrum};
use crate::transport::{Illumination, Pack, Snow};
use crate::units::{HALF_SPACE_M, cm_to_m, um_to_m};

/// One job: one snow at one combination of the axes beyond the five, one or all
/// thicknesses, one or all angles.
#[derive(Debug, Clone, PartialEq)]
pub struct Job {
    /// Number of the job, which is also the cell of its random streams.
    pub cell: u64,
    /// Its values on the axes beyond the five.
    pub conditions: Conditions,
    /// The snow.
    pub pack: Pack,
    /// Slab thicknesses, m, increasing: the job's curves in storage order.
    pub thicknesses_m: Vec<f64>,
    /// Polar angles of incidence, degrees.
    pub angles_deg: Vec<f64>,
    /// The same as illuminations, and isotropic light last if the grid asks for it.
    pub illuminations: Vec<Illumination>,
    /// How many of the first thicknesses are too thin for the grains: their curves
    /// do not exist ([`Grid::absent`]).
    pub absent: usize,
}

impl Job {
    /// Whether it has curves that exist.
    #[must_use]
    pub fn exists(&self) -> bool {
        self.absent < self.thicknesses_m.len()
    }

    /// The `spectra` of the curves that exist, after one of `wavelengths` NaN for each
    /// that does not: those of all curves.
    #[must_use]
    pub fn completed(&self, spectra: Vec<Spectrum>, wavelengths: usize) -> Vec<Spectrum> {
        let none = Measured {
            value: f64::NAN,
            se: f64::NAN,
        };
        let none = Spectrum {
            reflectance: vec![none; wavelengths],
            transmittance: vec![none; wavelengths],
            lost: vec![0.0; wavelengths],
        };
        let mut all = vec![none; self.absent * self.illuminations.len()];
        all.extend(spectra);
        all
    }

    /// What to ask an engine for: the curves that exist.
    #[must_use]
    pub fn request<'a>(&'a self, grid: &'a Grid) -> Request<'a> {
        Request {
            pack: &self.pack,
            thicknesses_m: self.thicknesses_m.get(self.absent..).unwrap_or_default(),
            illuminations: &self.illuminations,
            resolution: Resolution::default(),
            wavelengths_nm: &grid.wavelengths_nm,
            model: &grid.fixed.model,
            rays: grid.run.rays,
            max_error: grid.run.max_error,
            seed: grid.run.seed,
            cell: self.cell,
        }
    }
}

/// The parameters that single this job out, for messages.
impl fmt::Display for Job {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let snow = &self.pack.surface;
        let grain = &snow.grains[0].grain;
        write!(
            f,
            "facetness {}, grain size {:.0}-{:.0} um, density {} kg/m3, thickness",
            grain.facetness.mean(),
            grain.size.min_m() * 1e6,
            grain.size.max_m() * 1e6,
            snow.density_kg_m3,
        )?;
        let mut separator = " ";
        for thickness_m in &self.thicknesses_m {
            match *thickness_m < HALF_SPACE_M {
                true => write!(f, "{separator}{:.4}", thickness_m * 1e2)?,
                false => write!(f, "{separator}inf")?,
            }
            separator = ", ";
        }
        write!(f, " cm, angle")?;
        let mut separator = " ";
        for angle_deg in &self.angles_deg {
            write!(f, "{separator}{angle_deg}")?;
            separator = ", ";
        }
        f.write_str(&described(&" degrees", &self.conditions))
    }
}

impl Grid {
    /// The job of number `job`, of the `jobs` this grid gave.
    ///
    /// # Errors
    /// No such job, or a law of its axis values is impossible.
    pub fn job(&self, jobs: &Jobs, job: u64) -> Result<Job, GridError> {
        let missing = || GridError::NoSuchJob {
            job,
            jobs: jobs.count(),
        };
        let [f, s, d, h, a] = jobs.origin(job)?.map(|i| i as usize);
        let [thicknesses, angles] = [3, 4].map(|axis| jobs.block()[axis] as usize);
        let at = |values: &[f64], i: usize| values.get(i).copied().ok_or_else(missing);
        let axes = &self.axes;
        let conditions = axes.conditions(jobs.combination(job));
        let fixed = self.fixed.at(&conditions, &self.spread)?;
        let grain = GrainType {
            size: self.size_law(at(&axes.grain_size_um, s)?)?,
            facetness: self.facetness_law(at(&axes.facetness, f)?)?,
            sphericity: fixed.sphericity,
        };
        let thicknesses_cm = axes.thickness_cm.get(h..h + thicknesses);
        let absent = self.absent()?.get(s).copied().unwrap_or_default();
        let angles_deg = axes.angle_deg.get(a..a + angles).ok_or_else(missing)?;
        Ok(Job {
            cell: job,
            conditions,
            pack: Pack {
                surface: Snow {
                    water_saturation: fixed.water_saturation,
                    black_carbon: fixed.black_carbon,
                    brown_carbon: fixed.brown_carbon,
                    ..Snow::dry(grain, at(&axes.density_kg_m3, d)?, fixed.temperature_c)
                },
                below: fixed.below,
                ground: fixed.ground,
            },
            thicknesses_m: thicknesses_cm
                .ok_or_else(missing)?
                .iter()
                .map(|cm| cm_to_m(*cm))
                .collect(),
            angles_deg: angles_deg.to_vec(),
            absent: absent.saturating_sub(h).min(thicknesses),
            illuminations: angles_deg
                .iter()
                .map(|deg| Illumination::Collimated {
                    polar_angle_rad: deg.to_radians(),
                })
                .chain(self.fixed.diffuse.then_some(Illumination::Diffuse))
                .collect(),
        })
    }

    /// Facetness around an axis value: cut to mean -+ half width, and to [0, 1].
    pub(super) fn facetness_law(&self, mean: f64) -> Result<TruncatedNormal, GridError> {
        let half_width = self.spread.facetness_half_width;
        let (min, max) = (mean - half_width, mean + half_width);
        TruncatedNormal::new(min.max(0.0), max.min(1.0), mean, self.spread.facetness_sd).map_err(
            |source| GridError::Law {
                axis: "facetness",
                value: mean,
                source,
            },
        )
    }

    /// Grain size around an axis value: uniform in value -+ half width.
    pub(super) fn size_law(&self, size_um: f64) -> Result<SizeRange, GridError> {
        self.check_size(size_um)?;
        let half_width_um = self.spread.grain_size_half_width_um;
        SizeRange::new(
            um_to_m(size_um - half_width_um),
            um_to_m(size_um + half_width_um),
        )
        .map(|size| size.with_law(self.spread.size_law))
        .map_err(|source| GridError::Law {
            axis: "grain_size_um",
            value: size_um,
            source,
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use crate::engine::Engine;
    use crate::grid::tests::small;

    #[test]
    fn the_last_axis_runs_fastest() {
        let grid = small(Engine::Reference);
        let jobs = grid.jobs().unwrap();
        let job = |n| grid.job(&jobs, n).unwrap();
        assert_eq!(jobs.count(), 24);
        assert_eq!(
            (&job(0).angles_deg[..], &job(1).angles_deg[..]),
            (&[0.0][..], &[60.0][..])
        );
        assert_eq!(job(1).thicknesses_m, [0.01]);
        assert_eq!(job(2).thicknesses_m, [0.02]);
        assert_eq!(job(6).pack.surface.sizes_m()[1], 250.0 * 1e-6);
        assert_eq!(job(12).pack.surface.grains[0].grain.facetness.mean(), 0.5);
        assert_eq!(job(23).cell, 23);
        assert!(grid.job(&jobs, 24).is_err());
    }

    #[test]
    fn a_shared_job_holds_all_thicknesses() {
        let grid = small(Engine::Spectral);
        let jobs = grid.jobs().unwrap();
        assert_eq!(jobs.count(), 8);
        let job = grid.job(&jobs, 3).unwrap();
        assert_eq!(job.thicknesses_m, [0.01, 0.02, 0.05]);
        assert_eq!(
            job.to_string(),
            "facetness 0.05, grain size 150-250 um, density 300 kg/m3, thickness 1.0000, 2.0000, 5.0000 cm, angle 60 degrees"
        );
    }

    #[test]
    fn facetness_is_cut_to_its_range() {
        let grid = small(Engine::Spectral);
        let law = grid.facetness_law(0.05).unwrap();
        assert_eq!((law.min(), law.max()), (0.0, 0.05 + 0.1));
        assert_eq!((law.mean(), law.sd()), (0.05, 0.072));
        assert_eq!(grid.facetness_law(1.0).unwrap().max(), 1.0);
    }
}
