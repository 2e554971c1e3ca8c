//! Anisotropy factors measured in the laboratory (Dumont et al. 2010).
use std::f64::consts::PI;

use splitsnow::engine::exits::{Exits, goniometer};
use splitsnow::engine::{Cache, Engine};
use splitsnow::math::Vec3;
use splitsnow::measurement::Sensors;
use splitsnow::transport::Illumination;

use crate::variants::Variant;
use crate::{Result, Runner, rms, rows};

pub(crate) const INCIDENCES_DEG: [f64; 3] = [0.0, 30.0, 60.0];
pub(crate) const SAMPLES: [u32; 2] = [1, 3];
/// Candidates of the optical radius, um.
const RADII_UM: [f64; 6] = [45.0, 70.0, 110.0, 170.0, 260.0, 400.0];
/// Wavelengths of the fit, nm.
const FITTED_NM: [f64; 3] = [1030.0, 1240.0, 1500.0];
/// Wavelengths of the picture, nm.
const DRAWN_NM: [f64; 2] = [600.0, 1030.0];

/// A measured factor.
struct Row {
    sample: u32,
    incidence_deg: f64,
    view_deg: f64,
    /// From the forward direction.
    azimuth_deg: f64,
    nm: f64,
    factor: f64,
}

fn measured() -> Vec<Row> {
    let row = |numbers: Vec<f64>| {
        let [sample, incidence_deg, view_deg, azimuth_deg, nm, factor] = numbers[..] else {
            panic!("six numbers: {numbers:?}")
        };
        Row {
            sample: sample as u32,
            incidence_deg,
            view_deg,
            azimuth_deg: 180.0 - azimuth_deg,
            nm,
            factor,
        }
    };
    let text = include_str!("../../tests/data/dumont_2010_anisotropy.csv");
    rows(text).into_iter().map(row).collect()
}

/// Sum of squared differences, of squared standard errors, and the number of views.
pub(crate) type Score = [f64; 3];

/// The misfit of a variant at one wavelength and incidence angle.
pub(crate) struct Misfit {
    pub(crate) sample: u32,
    pub(crate) radius_um: f64,
    pub(crate) nm: f64,
    pub(crate) incidence_deg: f64,
    pub(crate) score: Score,
}

/// A factor in the principal plane.
pub(crate) struct PlaneValue {
    pub(crate) sample: u32,
    pub(crate) nm: f64,
    pub(crate) incidence_deg: f64,
    /// Positive forward.
    pub(crate) view_deg: f64,
    pub(crate) measured: f64,
    pub(crate) computed: [f64; 2],
}

pub(crate) struct Directions {
    sensors: Sensors,
    rows: Vec<Row>,
    wavelengths_nm: Vec<f64>,
}

impl Directions {
    pub(crate) fn new() -> Self {
        let rows = measured();
        let mut wavelengths_nm: Vec<f64> = rows.iter().map(|row| row.nm).collect();
        wavelengths_nm.sort_by(f64::total_cmp);
        wavelengths_nm.dedup();
        Self {
            sensors: Sensors::new(2000),
            rows,
            wavelengths_nm,
        }
    }

    /// The factors of a variant under several incidence angles: per angle and wavelength.
    fn factors(
        &self,
        runner: &Runner,
        (variant, radius_um): (&Variant, f64),
        incidences_deg: &[f64],
        wavelengths_nm: &[f64],
        cache: &Cache,
    ) -> Result<Vec<Exits>> {
        let snow = variant.snow(radius_um, 275.0, -10.0).into();
        let collimated = |deg: &f64| Illumination::Collimated {
            polar_angle_rad: deg.to_radians(),
        };
        let illuminations: Vec<_> = incidences_deg.iter().map(collimated).collect();
        let request = runner.request(&snow, &[0.3], &illuminations, wavelengths_nm, variant);
        runner.with(cache, |control| {
            goniometer(Engine::Tabulated, &request, &self.sensors, control)
        })
    }

    /// The rows of a sample at one incidence angle and wavelength, each with the computed factor
    /// and its standard error.
    fn compared<'a>(
        &'a self,
        exits: &'a Exits,
        (sample, incidence_deg, nm): (u32, f64, f64),
    ) -> impl Iterator<Item = (&'a Row, [f64; 2])> {
        let rows = self.rows.iter().filter(move |row| {
            row.sample == sample && row.incidence_deg == incidence_deg && row.nm == nm
        });
        rows.map(|row| (row, factor(exits, &self.sensors, row)))
    }

    fn score(&self, exits: &Exits, place: (u32, f64, f64)) -> Score {
        let add = |[squares, noise, count]: Score, (row, [value, se]): (&Row, [f64; 2])| {
            let difference = value - row.factor;
            [
                squares + difference * difference,
                noise + se * se,
                count + 1.0,
            ]
        };
        self.compared(exits, place).fold([0.0; 3], add)
    }

    /// The misfits of a variant, and its factors in the principal plane.
    pub(crate) fn judge(
        &self,
        runner: &Runner,
        variant: &Variant,
    ) -> Result<(Vec<Misfit>, Vec<PlaneValue>)> {
        let cache = Cache::tables_only();
        let normal = |radius_um: &f64| {
            self.factors(runner, (variant, *radius_um), &[0.0], &FITTED_NM, &cache)
        };
        let candidates: Vec<_> = RADII_UM.iter().map(normal).collect::<Result<_>>()?;
        let (mut misfits, mut plane) = (Vec::new(), Vec::new());
        for sample in SAMPLES {
            let misfit = |exits: &Vec<Exits>| {
                let pairs = FITTED_NM.iter().zip(exits);
                rms(pairs.map(|(nm, exits)| self.score(exits, (sample, 0.0, *nm))))[0]
            };
            let fitted: Vec<f64> = candidates.iter().map(misfit).collect();
            let best = (0..fitted.len()).min_by(|a, b| fitted[*a].total_cmp(&fitted[*b]));
            let radius_um = RADII_UM[best.unwrap()];
            let (angles, wavelengths) = (&INCIDENCES_DEG, &self.wavelengths_nm);
            let exits = self.factors(runner, (variant, radius_um), angles, wavelengths, &cache)?;
            let places = angles
                .iter()
                .flat_map(|deg| wavelengths.iter().map(move |nm| (*deg, *nm)));
            for ((incidence_deg, nm), exits) in places.zip(&exits) {
                let place = (sample, incidence_deg, nm);
                misfits.push(Misfit {
                    sample,
                    radius_um,
                    nm,
                    incidence_deg,
                    score: self.score(exits, place),
                });
                let in_plane = self.compared(exits, place).filter(|(row, _)| {
                    DRAWN_NM.contains(&nm) && [0.0, 180.0].contains(&row.azimuth_deg)
                });
                plane.extend(in_plane.map(|(row, computed)| PlaneValue {
                    sample,
                    nm,
                    incidence_deg,
                    view_deg: match row.azimuth_deg == 0.0 {
                        true => row.view_deg,
                        false => -row.view_deg,
                    },
                    measured: row.factor,
                    computed,
                }));
            }
        }
        Ok((misfits, plane))
    }
}

/// The anisotropy factor toward a view, and its standard error: linear in the polar angle between
/// the nearest two sensors.
fn factor(exits: &Exits, sensors: &Sensors, row: &Row) -> [f64; 2] {
    let at = |view_deg: f64| {
        let (sin, cos) = view_deg.to_radians().sin_cos();
        let (y, x) = row.azimuth_deg.to_radians().sin_cos();
        let sensor = sensors.index(Vec3::new(sin * x, sin * y, cos));
        let centre_deg = sensors.centre_rad(sensor)[0].to_degrees();
        (centre_deg, exits.reflected[sensor])
    };
    let (near_deg, near) = at(row.view_deg);
    let ring_deg = (2.0 * PI / sensors.len() as f64).sqrt().to_degrees();
    let step = match row.view_deg > near_deg {
        true => ring_deg,
        false => -ring_deg,
    };
    let (far_deg, far) = at((row.view_deg + step).max(0.0));
    let t = match far_deg == near_deg {
        true => 0.0,
        false => (row.view_deg - near_deg) / (far_deg - near_deg),
    };
    let scale = PI / exits.reflectance.value;
    let mixed = near.mix(far, t);
    [scale * mixed.value, scale * mixed.se]
}
