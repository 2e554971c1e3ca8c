//! The errors of a table: Delta-E*ab (CIE 1976) of interpolated texels against look-ups in the
//! compact file, at its texels and in the middles between them. Angles beyond 80 degrees are
//! counted apart.
use serde::Serialize;

use crate::colour::{delta_e, relative_lab};
use crate::lookup::LookupError;

use super::axes::{CosineAxis, DepthAxis};
use super::{Colours, Conversion, HalfImage, Triple};

/// Angle from the normal up to which the errors of a table are bounded, degrees.
const STEEP_DEG: f64 = 80.0;
/// Luminance to which dark colours are exposed, relative to white.
pub(super) const EXPOSED: f64 = 0.5;
/// The largest factor by which they are exposed; darker colours are not.
const MOST_EXPOSURE: f64 = 1000.0;

/// A largest Delta-E*ab (CIE 1976), and where it is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LutError {
    /// The largest difference.
    pub delta_e: f64,
    /// Thickness where it is, cm.
    pub thickness_cm: f64,
    /// Angle from the normal where it is, degrees.
    pub angle_deg: f64,
}

impl LutError {
    const NONE: Self = Self {
        delta_e: 0.0,
        thickness_cm: 0.0,
        angle_deg: 0.0,
    };

    fn add(&mut self, delta_e: f64, thickness_cm: f64, cosine: f64) {
        if delta_e > self.delta_e || delta_e.is_nan() {
            *self = Self {
                delta_e,
                thickness_cm,
                angle_deg: cosine.acos().to_degrees(),
            };
        }
    }
}

/// The errors of interpolated half floats against look-ups in the compact file, both without
/// what the primaries cannot show. White is the light.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LutCertificate {
    /// Number of texels.
    pub texels: usize,
    /// Number of points where errors are measured: the texels, the middles between two and
    /// those between four.
    pub points: usize,
    /// The largest error up to 80 degrees.
    pub largest: LutError,
    /// The mean of these errors.
    pub mean_delta_e: f64,
    /// The largest error beyond 80 degrees; `None` if the file ends before.
    pub beyond_80_deg: Option<LutError>,
    /// The largest error up to 80 degrees where colours are exposed to half the luminance of
    /// white, of those that need a factor of 1000 at most.
    pub exposed: LutError,
    /// The largest error of the reflectance; `None` if the file has none.
    pub reflectance: Option<LutError>,
}

/// What the primaries cannot show: colours with a negative component, which is set to 0.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LutClipping {
    /// Number of texels with a negative component.
    pub texels: usize,
    /// Thickness of the thinnest of them, cm.
    pub from_cm: Option<f64>,
    /// The largest error that this makes.
    pub largest: LutError,
    /// The largest error where colours are exposed to half the luminance of white, of those that
    /// need a factor of 1000 at most; `None` if there are none.
    pub exposed: Option<LutError>,
}

/// Delta-E*ab of two colours relative to white, times `exposure`.
pub(super) fn difference(first: Triple, second: Triple, exposure: f64) -> f64 {
    let lab = |colour: Triple| relative_lab((colour * exposure).into());
    delta_e(lab(first), lab(second))
}

/// The factor that exposes a colour to half the luminance of white, if not above the largest.
fn exposure(colour: Triple) -> Option<f64> {
    let factor = (EXPOSED / colour.y).max(1.0);
    (factor <= MOST_EXPOSURE).then_some(factor)
}

pub(super) fn of_transmittance(
    colours: &Colours,
    conversion: &Conversion,
    (depth, cosines): (&DepthAxis, &CosineAxis),
    image: &HalfImage,
    reflectance: Option<LutError>,
) -> Result<(LutCertificate, LutClipping), LookupError> {
    let steep = STEEP_DEG.to_radians().cos();
    let (mut largest, mut exposed) = (LutError::NONE, LutError::NONE);
    let mut beyond = None;
    let (mut sum, mut count, mut points) = (0.0, 0, 0);
    let mut clipping = LutClipping {
        texels: 0,
        from_cm: None,
        largest: LutError::NONE,
        exposed: None,
    };
    let halves = |count: usize| (0..2 * count - 1).map(|i| i as f64 / 2.0);
    let thicknesses: Vec<_> = halves(depth.count).map(|t| (t, depth.value(t))).collect();
    for row in halves(cosines.count) {
        let cosine = cosines.value(row).min(1.0);
        for &(column, cm) in &thicknesses {
            let exact = colours.at(cm, cosine)?;
            let linear = conversion.to_primaries * exact;
            let shown = conversion.back * conversion.shown(exact);
            let bright = exposure(exact);
            if row.fract() == 0.0 && column.fract() == 0.0 && linear.min() < 0.0 {
                clipping.texels += 1;
                clipping.from_cm = Some(clipping.from_cm.map_or(cm, |from| from.min(cm)));
                let error = difference(shown, exact, 1.0);
                clipping.largest.add(error, cm, cosine);
                if let Some(factor) = bright {
                    let exposed = clipping.exposed.get_or_insert(LutError::NONE);
                    exposed.add(difference(shown, exact, factor), cm, cosine);
                }
            }
            let found = conversion.back * image.sample([column, row]);
            let error = difference(found, shown, 1.0);
            points += 1;
            if cosine < steep {
                let beyond = beyond.get_or_insert(LutError::NONE);
                beyond.add(error, cm, cosine);
                continue;
            }
            largest.add(error, cm, cosine);
            if let Some(factor) = bright {
                exposed.add(difference(found, shown, factor), cm, cosine);
            }
            sum += error;
            count += 1;
        }
    }
    let certificate = LutCertificate {
        texels: image.pixels.len(),
        points,
        largest,
        mean_delta_e: sum / f64::from(count.max(1)),
        beyond_80_deg: beyond,
        exposed,
        reflectance,
    };
    Ok((certificate, clipping))
}

/// The largest error of the reflectance of snow `thickness_cm` thick.
pub(super) fn of_reflectance(
    colours: &Colours,
    thickness_cm: f64,
    conversion: &Conversion,
    cosines: &CosineAxis,
    strip: &HalfImage,
) -> Result<LutError, LookupError> {
    let mut largest = LutError::NONE;
    for texel in (0..2 * cosines.count - 1).map(|i| i as f64 / 2.0) {
        let cosine = cosines.value(texel).min(1.0);
        let exact = conversion.back * conversion.shown(colours.at(thickness_cm, cosine)?);
        let found = conversion.back * strip.sample([texel, 0.0]);
        largest.add(difference(found, exact, 1.0), thickness_cm, cosine);
    }
    Ok(largest)
}
