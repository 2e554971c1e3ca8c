//! The BRDF toward given views, from the sensors around each.
//!
//! A local quadratic fit (Fan and Gijbels 1996, section 2.3): a polynomial of second degree in the
//! two coordinates of the plane that touches the unit sphere at the view is fitted to the BRDF of
//! the sensors within [`REACH`] rings. Its value at the view is the result: a weighted sum of the
//! sensors, whose weights do not depend on the light. Units are those of the BRDF, 1/sr.
//!
//! The fit follows slope and curvature, and needs no light beyond the horizon. A lobe of 25 degrees
//! half width is reproduced within .4 % (tests below); narrower ones are flattened, and light that
//! leaves unscattered in one direction is spread over 13 degrees. Some weights are negative, so a
//! value near zero from few walks may be negative.
use thiserror::Error;

use super::Sensors;
use crate::math::Vec3;
use crate::slab::Matrix;

/// Number of sensors per hemisphere.
const SENSORS: usize = 2000;
/// Radius of the fit, in heights of a ring of sensors.
const REACH: f64 = 4.0;
/// Number of coefficients of the quadratic polynomial.
const TERMS: usize = 6;
/// Largest angle of a view from the normal, degrees.
pub const MAX_VIEW_DEG: f64 = 88.0;

/// Views toward which no BRDF can be computed.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ViewError {
    /// There is no view.
    #[error("there are no views\n  help: give one or more view angles and relative azimuths")]
    Empty,
    /// An angle from the normal is outside its range.
    #[error(
        "the view angle {0} degrees is outside 0 to {MAX_VIEW_DEG}\n  help: measure view angles from the normal"
    )]
    Angle(f64),
    /// An azimuth is outside its range.
    #[error(
        "the relative azimuth {0} degrees is outside -360 to 360\n  help: 0 is forward, 180 back toward the light"
    )]
    Azimuth(f64),
}

/// Directions of view, above or below the surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Views {
    sensors: Sensors,
    /// Angle from the normal and azimuth relative to the light, degrees.
    angles_deg: Vec<[f64; 2]>,
    /// For each view, its sensors and the BRDF per unit power on each, 1/sr.
    weights_per_sr: Vec<Vec<(usize, f64)>>,
}

impl Views {
    /// Views at `angles_deg`: angle from the normal on either side, 0 to [`MAX_VIEW_DEG`], and
    /// azimuth, -360 to 360 degrees. Azimuth 0 is forward, the direction in which the light
    /// travels; 180 is back toward the light.
    ///
    /// # Errors
    /// [`ViewError`].
    ///
    /// ```
    /// use splitsnow_model::measurement::Views;
    ///
    /// let views = Views::new(&[[0.0, 0.0], [60.0, 0.0], [60.0, 180.0]])?;
    /// assert_eq!(views.len(), 3);
    /// # Ok::<(), splitsnow_model::measurement::ViewError>(())
    /// ```
    pub fn new(angles_deg: &[[f64; 2]]) -> Result<Self, ViewError> {
        if angles_deg.is_empty() {
            return Err(ViewError::Empty);
        }
        for [polar, azimuth] in angles_deg {
            if !(0.0..=MAX_VIEW_DEG).contains(polar) {
                return Err(ViewError::Angle(*polar));
            }
            if !(-360.0..=360.0).contains(azimuth) {
                return Err(ViewError::Azimuth(*azimuth));
            }
        }
        let sensors = Sensors::new(SENSORS);
        let weights = |angles: &[f64; 2]| weights(&sensors, angles.map(f64::to_radians));
        Ok(Self {
            weights_per_sr: angles_deg.iter().map(weights).collect(),
            angles_deg: angles_deg.to_vec(),
            sensors,
        })
    }

    /// Number of views.
    #[must_use]
    pub fn len(&self) -> usize {
        self.angles_deg.len()
    }

    /// Always false: there is at least one view.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.angles_deg.is_empty()
    }

    /// Angle from the normal and relative azimuth of each view, degrees.
    #[must_use]
    pub fn angles_deg(&self) -> &[[f64; 2]] {
        &self.angles_deg
    }

    /// The sensors that receive the light.
    pub(crate) fn sensors(&self) -> &Sensors {
        &self.sensors
    }

    /// The BRDF toward each view, `[view][column]`, from the power on each sensor,
    /// `[sensor][column]`.
    pub(crate) fn brdf_per_sr(&self, power: &[f64], columns: usize) -> Vec<f64> {
        let mut brdf = vec![0.0; self.len() * columns];
        for (to, weights) in brdf.chunks_exact_mut(columns).zip(&self.weights_per_sr) {
            for (sensor, weight) in weights {
                let from = &power[sensor * columns..(sensor + 1) * columns];
                let pairs = to.iter_mut().zip(from);
                pairs.for_each(|(to, from)| *to += weight * from);
            }
        }
        brdf
    }
}

/// The unit vector at an angle from the normal and an azimuth, rad.
fn unit([polar, azimuth]: [f64; 2]) -> Vec3 {
    let (sin, cos) = (libm::sin(polar), libm::cos(polar));
    Vec3::new(sin * libm::cos(azimuth), sin * libm::sin(azimuth), cos)
}

/// The sensors around a view, and their weights per projected solid angle.
fn weights(sensors: &Sensors, view: [f64; 2]) -> Vec<(usize, f64)> {
    let [polar, azimuth] = view;
    let towards = unit(view);
    // away from the normal, and across
    let away = Vec3::new(
        libm::cos(polar) * libm::cos(azimuth),
        libm::cos(polar) * libm::sin(azimuth),
        -libm::sin(polar),
    );
    let across = Vec3::new(-libm::sin(azimuth), libm::cos(azimuth), 0.0);
    let reach = REACH * sensors.solid_angle_sr().sqrt();
    let (mut chosen, mut moments) = (Vec::new(), Matrix::zeros(TERMS, TERMS));
    for sensor in 0..sensors.len() {
        let centre = unit(sensors.centre_rad(sensor));
        let [x, y] = [away, across].map(|axis| centre.dot(axis) / reach);
        let square = x * x + y * y;
        if centre.dot(towards) <= 0.0 || square >= 1.0 {
            continue;
        }
        let projected_sr = sensors.projected_sr(sensor);
        let terms = [1.0, x, y, x * x, x * y, y * y];
        // the variance of a sensor's BRDF decreases with its projected solid angle
        let certainty = projected_sr * (1.0 - square);
        for (i, a) in terms.iter().enumerate() {
            let row = moments.row_mut(i).iter_mut();
            row.zip(terms)
                .for_each(|(sum, b)| *sum += certainty * a * b);
        }
        chosen.push((sensor, terms, certainty / projected_sr));
    }
    let value = Matrix::from_fn(TERMS, 1, |i, _| f64::from(u8::from(i == 0)));
    #[expect(
        clippy::expect_used,
        reason = "sensors around any view determine a parabola"
    )]
    let solution = moments.solve(value).expect("regular");
    let weight = |(sensor, terms, certainty): &(usize, [f64; TERMS], f64)| {
        let products = terms
            .iter()
            .enumerate()
            .map(|(i, term)| term * solution.row(i)[0]);
        (*sensor, certainty * products.sum::<f64>())
    };
    chosen.iter().map(weight).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn views() -> Views {
        let angles = [0.0, 15.0, 40.0, 60.0, 75.0, 88.0];
        let at = |polar: f64| [0.0, 90.0, 135.0, -180.0].map(move |azimuth| [polar, azimuth]);
        let angles: Vec<_> = angles.into_iter().flat_map(at).collect();
        Views::new(&angles).unwrap()
    }

    /// The largest relative error of `brdf`, a function of the direction.
    fn worst(views: &Views, brdf: impl Fn(Vec3) -> f64) -> f64 {
        let sensors = views.sensors();
        let power = (0..sensors.len())
            .map(|sensor| brdf(unit(sensors.centre_rad(sensor))) * sensors.projected_sr(sensor));
        let found = views.brdf_per_sr(&power.collect::<Vec<_>>(), 1);
        let errors = found.iter().zip(views.angles_deg()).map(|(found, angles)| {
            let expected = brdf(unit(angles.map(f64::to_radians)));
            (found / expected - 1.0).abs()
        });
        errors.fold(0.0, f64::max)
    }

    #[test]
    fn a_lambertian_surface_looks_the_same_from_everywhere() {
        assert!(worst(&views(), |_| 1.0 / PI) < 1e-12);
    }

    /// A lobe of half width `half_deg` (at 1/e) on a Lambertian background.
    fn lobe(half_deg: f64) -> impl Fn(Vec3) -> f64 {
        let peak = unit([1.3, 0.0]);
        let sharpness = 1.0 / (1.0 - libm::cos(half_deg.to_radians()));
        move |direction| 1.0 + 3.0 * libm::exp(sharpness * (peak.dot(direction) - 1.0))
    }

    /// The fit follows a lobe narrower than the forward lobe of snow within half of the 1 % that is
    /// asked of the noise, and the error falls with the width.
    #[test]
    fn lobes_keep_their_height() {
        let views = views();
        let errors = [25.0, 35.0, 50.0].map(|half| worst(&views, lobe(half)));
        assert!(errors[0] > errors[1] && errors[1] > errors[2], "{errors:?}");
        assert!(errors[0] < 0.005, "{errors:?}");
    }

    #[test]
    fn impossible_views_are_refused() {
        assert_eq!(Views::new(&[]), Err(ViewError::Empty));
        assert_eq!(Views::new(&[[89.0, 0.0]]), Err(ViewError::Angle(89.0)));
        assert_eq!(Views::new(&[[10.0, 361.0]]), Err(ViewError::Azimuth(361.0)));
        assert!(Views::new(&[[f64::NAN, 0.0]]).is_err());
    }
}
