//! The BRDFs of the variants of a study.
use crate::config::study::{DrawBrdf, StudyFile, Variant};
use crate::engine::exits::Exits;
use crate::measurement::{Measured, Sensors};
use crate::transport::Illumination;

/// A study with the BRDF of each of its variants.
#[derive(Debug, Clone)]
pub struct Brdfs<'a> {
    /// What was asked.
    pub study: &'a StudyFile,
    /// How it is drawn.
    pub draw: DrawBrdf,
    /// Where the BRDFs are measured.
    pub sensors: Sensors,
    /// What came out, in the order of the variants.
    pub exits: Vec<Exits>,
}

/// What stands out of a BRDF in the plane of incidence, 1/sr. Angles are in degrees from
/// the normal: positive forward, the way the light travels, negative back toward it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Features {
    /// Angle and value of the largest forward.
    pub forward: (f64, Measured),
    /// Angle and value of the largest backward.
    pub backward: (f64, Measured),
    /// Along the normal.
    pub nadir: Measured,
}

impl Features {
    /// The forward peak over the nadir.
    #[must_use]
    pub fn contrast(&self) -> Measured {
        ratio(self.forward.1, self.nadir)
    }
}

/// One over another that errs on its own.
fn ratio(a: Measured, b: Measured) -> Measured {
    let value = a.value / b.value;
    Measured {
        value,
        se: value * (a.se / a.value).hypot(b.se / b.value),
    }
}

impl Brdfs<'_> {
    /// Every variant with what left it, the values of its sensors in 1/sr.
    pub fn variants(&self) -> impl Iterator<Item = (&Variant, &Exits)> {
        self.study.variants.iter().zip(&self.exits)
    }

    /// `exits` in the plane of incidence: angle as of [`Features`], and BRDF.
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

    /// What stands out of `exits`.
    #[must_use]
    pub fn features(&self, exits: &Exits) -> Features {
        let plane = self.plane(exits);
        let largest = |side: fn(f64) -> bool| {
            let of = plane.iter().filter(|(degrees, _)| side(*degrees));
            of.max_by(|a, b| a.1.value.total_cmp(&b.1.value)).copied()
        };
        Features {
            forward: largest(|degrees| degrees > 0.0).unwrap_or_default(),
            backward: largest(|degrees| degrees < 0.0).unwrap_or_default(),
            nadir: exits.reflected.first().copied().unwrap_or_default(),
        }
    }
}

/// The angle of the light on a variant from the normal, degrees.
#[must_use]
pub fn incidence_deg(variant: &Variant) -> Option<f64> {
    match variant.sample.illumination {
        Illumination::Collimated { polar_angle_rad } => Some(polar_angle_rad.to_degrees()),
        Illumination::Diffuse => None,
    }
}
