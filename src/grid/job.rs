//! Expands a job number into the request to an engine.
use std::fmt;

use super::{Grid, GridError, GridViews, Jobs};
use crate::engine::{Engine, Request, identity};
use crate::grain::{GrainType, SizeRange};
use crate::measurement::{Measured, Spectrum, ViewFactors};
use crate::parameter::{Parameter, Point, Role};
use crate::transport::{Illumination, Snow, Snowpack};
use crate::units::{HALF_SPACE_M, cm_to_m, m_to_cm, um_to_m};

/// Jobs with the same grain shape share tables, so tables have the resolution for this
/// many times the walks of one job. From 16,384 walks of `hybrid` per job on, they have the finest
/// resolution.
const SHARED: u64 = 16;

/// One job: one kind of snow, at one or all thicknesses and one or all incidence angles.
#[derive(Debug, Clone, PartialEq)]
pub struct Job {
    /// Key of the random streams: the [`identity`] of the job's own parameters,
    /// independent of its position in the grid.
    pub cell: u64,
    /// Values on all axes except thickness and incidence angle.
    pub snow: Point,
    /// The snowpack.
    pub snowpack: Snowpack,
    /// Slab thicknesses, m, increasing: the job's curves in storage order.
    pub thicknesses_m: Vec<f64>,
    /// Incidence angles, degrees.
    pub angles_deg: Vec<f64>,
    /// Illuminations at the incidence angles, followed by diffuse light if the grid has it.
    pub illuminations: Vec<Illumination>,
    /// Number of the thinnest thicknesses that are too thin for the grains: their curves
    /// do not exist ([`Grid::absent`]).
    pub absent: usize,
}

impl Job {
    /// Whether any curve of the job exists.
    #[must_use]
    pub fn exists(&self) -> bool {
        self.absent < self.thicknesses_m.len()
    }

    /// The spectra of all curves: a spectrum of NaN at `wavelengths` wavelengths for each
    /// curve that does not exist, followed by the `spectra` of those that exist.
    #[must_use]
    pub fn completed(&self, spectra: Vec<Spectrum>, wavelengths: usize) -> Vec<Spectrum> {
        let nan = Measured {
            value: f64::NAN,
            se: f64::NAN,
        };
        let absent_spectrum = Spectrum {
            reflectance: vec![nan; wavelengths],
            transmittance: vec![nan; wavelengths],
            lost: vec![0.0; wavelengths],
        };
        let mut completed = vec![absent_spectrum; self.absent * self.illuminations.len()];
        completed.extend(spectra);
        completed
    }

    /// The factors toward views of all curves, as [`completed`](Self::completed): `existing` of
    /// the curves that exist, NaN for the others.
    #[must_use]
    pub fn completed_views(
        &self,
        existing: Vec<ViewFactors>,
        views: &GridViews,
        wavelengths: usize,
    ) -> Vec<ViewFactors> {
        let nan = Measured {
            value: f64::NAN,
            se: f64::NAN,
        };
        let absent_factors = |light: &Illumination| {
            let absent = vec![nan; views.count_under(light) * wavelengths];
            ViewFactors {
                reflected: absent.clone(),
                transmitted: absent,
            }
        };
        let absent_slab: Vec<_> = self.illuminations.iter().map(absent_factors).collect();
        let mut completed: Vec<_> = vec![absent_slab; self.absent].concat();
        completed.extend(existing);
        completed
    }

    /// The request to an engine for the curves that exist.
    #[must_use]
    pub fn request<'a>(&'a self, grid: &'a Grid) -> Request<'a> {
        let thicknesses_m = self.thicknesses_m.get(self.absent..).unwrap_or_default();
        grid.request(
            &self.snowpack,
            thicknesses_m,
            &self.illuminations,
            self.cell,
        )
    }
}

/// The parameters of the job, for messages.
impl fmt::Display for Job {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |f: &mut fmt::Formatter<'_>, values: &[f64]| {
            let mut separator = " ";
            for value in values {
                write!(f, "{separator}{value}")?;
                separator = ", ";
            }
            Ok(())
        };
        let thicknesses: Vec<f64> = self
            .thicknesses_m
            .iter()
            .map(|m| {
                if *m < HALF_SPACE_M {
                    m_to_cm(*m)
                } else {
                    f64::INFINITY
                }
            })
            .collect();
        write!(f, "{}, thickness", self.snow)?;
        list(f, &thicknesses)?;
        write!(f, " cm, angle")?;
        list(f, &self.angles_deg)?;
        f.write_str(" degrees")
    }
}

/// Key of the random streams of a job. Thickness and illumination are part of the key
/// only if the job has a single one; otherwise the engine uses separate streams for them.
fn cell(
    engine: Engine,
    snowpack: &Snowpack,
    thicknesses_m: &[f64],
    lights: &[Illumination],
) -> u64 {
    let mut cell = identity::of_snowpack(snowpack);
    if let ([light], false) = (lights, engine.shares_angles()) {
        cell = identity::with_light(cell, light);
    }
    if let ([thickness_m], false) = (thicknesses_m, engine.shares_thicknesses()) {
        cell = identity::with_thickness(cell, *thickness_m);
    }
    cell
}

impl Grid {
    /// The snowpack at `point`, which need not be a node. Thickness and incidence angle are
    /// ignored.
    ///
    /// # Errors
    /// [`GridError::SmallGrain`] or [`GridError::Law`] if a distribution around a value of
    /// `point` is invalid.
    pub fn snowpack(&self, point: &Point) -> Result<Snowpack, GridError> {
        let fixed = self.fixed.at(point, &self.spread)?;
        let grain = GrainType {
            size: self.size_law(point[Parameter::GrainSize])?,
            facetness: self.spread.facetness_law(point[Parameter::Facetness])?,
            shape: fixed.shape,
            proportion: fixed.proportion,
        };
        let surface = Snow::dry(grain, point[Parameter::Density], fixed.temperature_c);
        Ok(Snowpack {
            surface: Snow {
                water_saturation: fixed.water_saturation,
                black_carbon: fixed.black_carbon,
                brown_carbon: fixed.brown_carbon,
                absorbers: fixed.absorbers,
                ..surface
            },
            below: fixed.below,
            substrate: fixed.substrate,
        })
    }

    /// The request to an engine for the curves of one `snowpack`.
    #[must_use]
    pub fn request<'a>(
        &'a self,
        snowpack: &'a Snowpack,
        thicknesses_m: &'a [f64],
        illuminations: &'a [Illumination],
        cell: u64,
    ) -> Request<'a> {
        Request {
            snowpack,
            thicknesses_m,
            illuminations,
            resolution: self
                .run
                .engine
                .resolution(self.run.rays.saturating_mul(SHARED)),
            wavelengths_nm: &self.wavelengths_nm,
            model: &self.fixed.model,
            rays: self.run.rays,
            max_error: self.run.max_error,
            seed: self.run.seed,
            cell,
        }
    }

    /// The job with number `job`; `jobs` must come from [`Grid::jobs`] of this grid.
    ///
    /// # Errors
    /// [`GridError::NoSuchJob`] if `job` is out of range; [`GridError::SmallGrain`] or
    /// [`GridError::Law`] if a distribution around an axis value is invalid.
    pub fn job(&self, jobs: &Jobs, job: u64) -> Result<Job, GridError> {
        let axes = &self.axes;
        let snow: Point = axes
            .point(axes.number(&jobs.origin(job)?))
            .iter()
            .filter(|(parameter, _)| parameter.record().role == Role::Snow)
            .collect();
        let nodes_and_values =
            |parameter| Ok((jobs.nodes(job, parameter)?, axes.values(parameter)));
        let [size, thicknesses, angles] = [
            Parameter::GrainSize,
            Parameter::Thickness,
            Parameter::Incidence,
        ]
        .map(nodes_and_values);
        let ((size, _), (thicknesses, all_cm), (angles, all_deg)) = (size?, thicknesses?, angles?);
        let absent = self.absent()?.get(size.start).copied().unwrap_or_default();
        let snowpack = self.snowpack(&snow)?;
        let missing = || GridError::NoSuchJob {
            job,
            jobs: jobs.count(),
        };
        let absent = absent
            .saturating_sub(thicknesses.start)
            .min(thicknesses.len());
        let thicknesses_cm = all_cm.get(thicknesses).ok_or_else(missing)?.iter();
        let thicknesses_m: Vec<f64> = thicknesses_cm.map(|cm| cm_to_m(*cm)).collect();
        let angles_deg = all_deg.get(angles).ok_or_else(missing)?;
        let light = |deg: &f64| Illumination::Collimated {
            polar_angle_rad: deg.to_radians(),
        };
        let diffuse = self.fixed.diffuse.then_some(Illumination::Diffuse);
        let illuminations: Vec<_> = angles_deg.iter().map(light).chain(diffuse).collect();
        Ok(Job {
            cell: cell(self.run.engine, &snowpack, &thicknesses_m, &illuminations),
            snow,
            snowpack,
            thicknesses_m,
            angles_deg: angles_deg.to_vec(),
            absent,
            illuminations,
        })
    }

    /// Size distribution around an axis value: uniform in value +- half width.
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
    use super::*;
    use crate::engine::identity::{of_snowpack, with_light, with_thickness};
    use crate::grid::tests::{small, with_extra};
    use crate::optics::Carbon;
    use crate::transport::Substrate;

    /// Every parameter counts, and nothing but parameters. The number is part of
    /// what decides the bytes of databases: it may change with the format only.
    #[test]
    fn bits_are_of_parameters() {
        let grid = with_extra(small(Engine::Hybrid));
        let jobs = grid.jobs().unwrap();
        let mut all: Vec<u64> = (0..jobs.count())
            .map(|job| grid.job(&jobs, job).unwrap().cell)
            .collect();
        let snowpack = grid.job(&jobs, 0).unwrap().snowpack;
        assert_eq!(all[0], of_snowpack(&snowpack));
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len() as u64, jobs.count());

        let clean = Snowpack {
            surface: Snow {
                black_carbon: None,
                ..snowpack.surface.clone()
            },
            ..snowpack.clone()
        };
        assert_eq!(of_snowpack(&clean), of_snowpack(&snowpack));
        let sooty = |carbon: Carbon| {
            let mut snowpack = snowpack.clone();
            snowpack.surface.black_carbon = Some(carbon);
            of_snowpack(&snowpack)
        };
        let carbon = Carbon::black(10.0);
        let wet = Carbon {
            per_wet_mass: !carbon.per_wet_mass,
            ..carbon
        };
        assert_ne!(sooty(carbon), of_snowpack(&snowpack));
        assert_ne!(sooty(carbon), sooty(wet));
        let on = |substrate| {
            let snowpack = snowpack.clone();
            of_snowpack(&Snowpack {
                substrate,
                ..snowpack
            })
        };
        assert_ne!(on(Substrate::Grey(0.2)), on(Substrate::Black));
        assert_ne!(on(Substrate::Grey(0.2)), on(Substrate::Grey(0.3)));
        let angle = |polar_angle_rad| Illumination::Collimated { polar_angle_rad };
        assert_ne!(with_light(1, &angle(0.0)), with_light(1, &angle(0.5)));
        assert_ne!(with_light(1, &angle(0.0)), with_light(2, &angle(0.0)));
        assert_ne!(
            with_light(1, &angle(0.0)),
            with_light(1, &Illumination::Diffuse)
        );
        assert_ne!(with_thickness(1, 0.1), with_thickness(1, 0.2));
    }

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
        assert_eq!(job(6).snowpack.surface.sizes_m()[1], 250.0 * 1e-6);
        assert_eq!(
            job(12).snowpack.surface.grains[0].grain.facetness.mean(),
            0.5
        );
        let mut cells: Vec<u64> = (0..24).map(|n| job(n).cell).collect();
        cells.sort_unstable();
        cells.dedup();
        assert_eq!(cells.len(), 24);
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
            "facetness 0.05, grain size 200 um, density 300 kg m-3, thickness 1, 2, 5 cm, angle 60 degrees"
        );
    }

    #[test]
    fn facetness_is_cut_to_its_range() {
        let grid = small(Engine::Spectral);
        let law = grid.spread.facetness_law(0.05).unwrap();
        assert_eq!((law.min(), law.max()), (0.0, 0.05 + 0.1));
        assert_eq!((law.mean(), law.sd()), (0.05, 0.072));
        assert_eq!(grid.spread.facetness_law(1.0).unwrap().max(), 1.0);
    }
}
