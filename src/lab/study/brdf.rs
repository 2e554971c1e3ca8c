//! The BRDFs of the variants of a study.
use crate::config::study::{DrawBrdf, StudyFile, StudyVariant};
use crate::engine::exits::Exits;
use crate::measurement::{Measured, Sensors};
use crate::transport::Illumination;

/// A study with the BRDF of each of its variants.
#[derive(Debug, Clone)]
pub struct Brdfs<'a> {
    /// The study file.
    pub study: &'a StudyFile,
    /// How the BRDFs are drawn.
    pub draw: DrawBrdf,
    /// The sensors that measure the BRDFs.
    pub sensors: Sensors,
    /// The measured exits, in the order of the variants.
    pub exits: Vec<Exits>,
}

/// Features of a BRDF in the plane of incidence, 1/sr. Angles are in degrees from the normal:
/// positive forward (the direction in which the light travels), negative back toward the
/// source.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Features {
    /// Angle and value of the forward maximum.
    pub forward: (f64, Measured),
    /// Angle and value of the backward maximum.
    pub backward: (f64, Measured),
    /// Value along the normal.
    pub nadir: Measured,
}

impl Features {
    /// The ratio of the forward maximum to the nadir value.
    #[must_use]
    pub fn contrast(&self) -> Measured {
        ratio(self.forward.1, self.nadir)
    }
}

/// The ratio of two values with independent errors.
fn ratio(a: Measured, b: Measured) -> Measured {
    let value = a.value / b.value;
    Measured {
        value,
        se: value * (a.se / a.value).hypot(b.se / b.value),
    }
}

impl Brdfs<'_> {
    /// The variants with their exits; sensor values are in 1/sr.
    pub fn variants(&self) -> impl Iterator<Item = (&StudyVariant, &Exits)> {
        self.study.variants.iter().zip(&self.exits)
    }

    /// The BRDF of `exits` in the plane of incidence: angle as in [`Features`], and value.
    #[must_use]
    pub fn plane(&self, exits: &Exits) -> Vec<(f64, Measured)> {
        let cut = self.sensors.principal_plane().into_iter();
        let values = cut.filter_map(|(sensor, [polar, azimuth])| {
            let degrees = polar.to_degrees();
            let signed = if azimuth == 0.0 { degrees } else { -degrees };
            Some((signed, *exits.reflected.get(sensor)?))
        });
        values.collect()
    }

    /// The features of `exits`.
    #[must_use]
    pub fn features(&self, exits: &Exits) -> Features {
        let plane = self.plane(exits);
        let largest = |side: fn(f64) -> bool| {
            let points = plane.iter().filter(|(degrees, _)| side(*degrees));
            points
                .max_by(|a, b| a.1.value.total_cmp(&b.1.value))
                .copied()
        };
        Features {
            forward: largest(|degrees| degrees > 0.0).unwrap_or_default(),
            backward: largest(|degrees| degrees < 0.0).unwrap_or_default(),
            nadir: exits.reflected.first().copied().unwrap_or_default(),
        }
    }
}

/// The incidence angle of a variant, degrees from the normal; `None` for diffuse light.
#[must_use]
pub fn incidence_deg(variant: &StudyVariant) -> Option<f64> {
    match variant.sample.illumination {
        Illumination::Collimated { polar_angle_rad } => Some(polar_angle_rad.to_degrees()),
        Illumination::Diffuse => None,
    }
}
