//! Tables of transmitted colours over thickness and cosine, for renderers that read images: half
//! floats in `OpenEXR`, a sidecar in JSON, and the look-up in shading languages.
mod axes;
mod certificate;
mod files;
mod primaries;

use half::f16;
use nalgebra::{Matrix3, Vector3};

use crate::colour::{Colorimeter, Illuminant, Viewing};
use crate::lookup::{Database, Lookup, LookupError};
use crate::measurement::Quantity;
use crate::parameter::{Parameter, Point};

use super::ExportError;
use axes::{CosineAxis, DepthAxis};
use certificate::EXPOSED;
pub use certificate::{LutCertificate, LutClipping, LutError};
pub use primaries::Primaries;

/// Texels hold the transmittance times this number, a power of two. Half floats have all their
/// digits above 6e-5 only; multiplied, they have them above 2e-9.
const SCALE: f64 = 32768.0;
/// Luminance, relative to the light, below which nothing is seen: a table ends there.
const DARK: f64 = 1e-6;
/// The largest thickness at which a table ends by itself, cm.
const DEEPEST_CM: f64 = 500.0;

/// The size and the colours of a table.
#[derive(Debug, Clone)]
pub struct LutOptions {
    /// The light, which is white.
    pub light: Illuminant,
    /// The primaries of the colours.
    pub primaries: Primaries,
    /// Number of thicknesses, 2 or more: the width of the image.
    pub thicknesses: usize,
    /// Number of cosines, 2 or more: its height.
    pub cosines: usize,
    /// The largest thickness, cm; `None` for that at which a millionth of the light
    /// is left, 500 at most.
    pub last_cm: Option<f64>,
}

impl Default for LutOptions {
    fn default() -> Self {
        Self {
            light: Illuminant::D65,
            primaries: Primaries::AcesCg,
            thicknesses: 256,
            cosines: 32,
            last_cm: None,
        }
    }
}

/// A colour: tristimulus values, each relative to that of white, or linear red, green and blue.
type Triple = Vector3<f64>;

/// The colours of one snow, from its compact file.
#[derive(Debug)]
struct Colours {
    lookup: Lookup,
    eye: Colorimeter,
    snow: Point,
    angles_deg: [f64; 2],
}

impl Colours {
    fn new(
        database: &Database,
        snow: Point,
        light: &Illuminant,
        quantity: Quantity,
    ) -> Result<Self, ExportError> {
        let nm = database.wavelengths_nm();
        let viewing = Viewing {
            illuminants: vec![light.clone()],
            ..Viewing::default()
        };
        let eye = Colorimeter::piecewise_linear(nm, &viewing)?;
        let eye = eye.ok_or_else(|| ExportError::NoColour {
            first: nm.first().copied().unwrap_or(f64::NAN),
            last: nm.last().copied().unwrap_or(f64::NAN),
        })?;
        let angles = database.axes().values(Parameter::Incidence);
        Ok(Self {
            lookup: Lookup::new(database, quantity)?.material(snow)?,
            eye,
            snow,
            angles_deg: ends(angles),
        })
    }

    /// The colour relative to white at a thickness and a cosine; of directions outside the file
    /// the nearest is taken.
    fn at(&self, thickness_cm: f64, cosine: f64) -> Result<Triple, LookupError> {
        let [first, last] = self.angles_deg;
        let deg = cosine.clamp(0.0, 1.0).acos().to_degrees();
        let point = self.snow.with(Parameter::Thickness, thickness_cm);
        let point = point.with(Parameter::Incidence, deg.clamp(first, last));
        let mut spectrum = vec![0.0; self.lookup.wavelengths()];
        self.lookup.spectrum(point, &mut spectrum)?;
        let spectrum: Vec<f64> = spectrum.into_iter().map(f64::from).collect();
        Ok(self.eye.relative_xyz(&spectrum).into())
    }
}

/// The first and the last of values.
fn ends(values: &[f64]) -> [f64; 2] {
    match values {
        [first, .., last] => [*first, *last],
        [only] => [*only; 2],
        [] => [f64::NAN; 2],
    }
}

/// From colours relative to white to linear primaries, and back.
#[derive(Debug)]
struct Conversion {
    to_primaries: Matrix3<f64>,
    back: Matrix3<f64>,
}

impl Conversion {
    fn new(primaries: Primaries) -> Self {
        let white = Matrix3::from_diagonal(&primaries::white_xyz());
        let to_primaries = primaries.matrix() * white;
        Self {
            to_primaries,
            back: primaries::inverse(&to_primaries),
        }
    }

    /// The linear colour, without what the primaries cannot show.
    fn shown(&self, relative: Triple) -> Triple {
        (self.to_primaries * relative).map(|value| value.max(0.0))
    }

    /// A linear colour, not negative, times `scale` as half floats: of the three numbers nearest
    /// in each channel those that together are nearest in colour. Rounded on its own, each channel
    /// is off by up to a part in 2048, and a grey by a Delta-E of 0.06, in X, Y and Z 0.1.
    fn halves(&self, shown: Triple, scale: f64) -> [f16; 3] {
        let around = [shown.x, shown.y, shown.z].map(|value| {
            let near = f16::from_f64(value * scale).to_bits();
            // black stays black
            let above = if value > 0.0 { near + 1 } else { near };
            [near.saturating_sub(1), near, above].map(f16::from_bits)
        });
        let exact = self.back * shown;
        let bright = EXPOSED / exact.y.max(EXPOSED / SCALE);
        let error = |halves: &[f16; 3]| {
            let found = self.back * Triple::from(halves.map(f64::from)) / scale;
            certificate::difference(found, exact, bright)
        };
        let (mut best, mut least) = ([f16::ZERO; 3], f64::INFINITY);
        for red in around[0] {
            for green in around[1] {
                for blue in around[2] {
                    let halves = [red, green, blue];
                    let error = error(&halves);
                    if error < least {
                        (best, least) = (halves, error);
                    }
                }
            }
        }
        best
    }
}

/// An image of half floats, row by row.
#[derive(Debug, Clone, PartialEq)]
struct HalfImage {
    width: usize,
    pixels: Vec<[f16; 3]>,
    /// The number of which a texel holds a multiple.
    scale: f64,
}

impl HalfImage {
    fn height(&self) -> usize {
        self.pixels.len() / self.width
    }

    fn texel(&self, column: usize, row: usize) -> Triple {
        let texel = self.pixels[row * self.width + column];
        Triple::from(texel.map(f64::from)) / self.scale
    }

    /// Interpolates between texels, as a sampler does; coordinates count texels, from 0.
    fn sample(&self, [column, row]: [f64; 2]) -> Triple {
        let sides = |place: f64, count: usize| {
            let place = place.clamp(0.0, (count - 1) as f64);
            let below = place as usize;
            let above = (below + 1).min(count - 1);
            let share = place - below as f64;
            [(below, 1.0 - share), (above, share)]
        };
        let mut sum = Triple::zeros();
        for (row, share) in sides(row, self.height()) {
            for (column, part) in sides(column, self.width) {
                sum += self.texel(column, row) * (share * part);
            }
        }
        sum
    }
}

/// Tables of the colours of one snow, with their measured errors.
#[derive(Debug)]
pub struct Lut {
    options: LutOptions,
    snow: Point,
    wavelengths_nm: Vec<f64>,
    depth: DepthAxis,
    cosine: CosineAxis,
    transmittance: HalfImage,
    /// Of the thickest snow of the file, cm; `None` if the file has no reflectance.
    reflectance: Option<(f64, HalfImage)>,
    certificate: LutCertificate,
    clipping: LutClipping,
}

impl Lut {
    /// The table of `snow` in `database`, which must have no optional axes left
    /// ([`Database::at`]).
    ///
    /// # Errors
    /// [`ExportError::Lookup`] if the snow is outside the file; [`ExportError::Lut`] if the file
    /// has a single thickness, or the table ends where it begins; [`ExportError::NoColour`] if
    /// its wavelengths have no colour.
    pub fn new(database: &Database, snow: Point, options: LutOptions) -> Result<Self, ExportError> {
        let colours = Colours::new(database, snow, &options.light, Quantity::Transmittance)?;
        let nodes = database.axes().values(Parameter::Thickness);
        let angles = ends(database.axes().values(Parameter::Incidence));
        let first_cm = first_cm(database, snow, nodes)?;
        let last_cm = match options.last_cm {
            Some(cm) => cm,
            None => dark_cm(&colours, first_cm)?,
        };
        if first_cm >= last_cm {
            return Err(ExportError::Lut(format!(
                "the snow is thinnest at {first_cm} cm, and the table ends at {last_cm} cm; give a larger --last-cm"
            )));
        }
        let depth = DepthAxis::new([first_cm, last_cm], options.thicknesses);
        let cosine = CosineAxis::new(angles, options.cosines);
        let conversion = Conversion::new(options.primaries);
        let image = |scale: f64, colours: &Colours, thicknesses: &[f64]| {
            let mut pixels = Vec::new();
            for cosine in cosine.values() {
                for cm in thicknesses {
                    let shown = conversion.shown(colours.at(*cm, cosine)?);
                    pixels.push(conversion.halves(shown, scale));
                }
            }
            Ok::<_, LookupError>(HalfImage {
                width: thicknesses.len(),
                pixels,
                scale,
            })
        };
        let transmittance = image(SCALE, &colours, &depth.values())?;
        let thickest_cm = nodes.last().copied().unwrap_or(f64::NAN);
        let mut reflectance = None;
        let mut reflected = None;
        if database.has(Quantity::Reflectance) {
            let colours = Colours::new(database, snow, &options.light, Quantity::Reflectance)?;
            // cosines along the width
            let mut strip = image(1.0, &colours, &[thickest_cm])?;
            strip.width = strip.pixels.len();
            reflected = Some(certificate::of_reflectance(
                &colours,
                thickest_cm,
                &conversion,
                &cosine,
                &strip,
            )?);
            reflectance = Some((thickest_cm, strip));
        }
        let (certificate, clipping) = certificate::of_transmittance(
            &colours,
            &conversion,
            (&depth, &cosine),
            &transmittance,
            reflected,
        )?;
        Ok(Self {
            options,
            snow,
            wavelengths_nm: database.wavelengths_nm().to_vec(),
            depth,
            cosine,
            transmittance,
            reflectance,
            certificate,
            clipping,
        })
    }

    /// The errors of the table against look-ups.
    #[must_use]
    pub fn certificate(&self) -> &LutCertificate {
        &self.certificate
    }

    /// What the primaries cannot show.
    #[must_use]
    pub fn clipping(&self) -> &LutClipping {
        &self.clipping
    }

    /// The primaries of the colours.
    #[must_use]
    pub fn primaries(&self) -> Primaries {
        self.options.primaries
    }
}

/// The thinnest snow that can be looked up, cm.
fn first_cm(database: &Database, snow: Point, nodes: &[f64]) -> Result<f64, ExportError> {
    if let [only] = nodes {
        return Err(ExportError::Lut(format!(
            "the file has a single thickness, {only} cm; use a file that covers a range"
        )));
    }
    let size = snow[Parameter::GrainSize];
    let mut covered = nodes.iter().filter(|cm| database.covers(size, **cm));
    let first = covered.next().copied().unwrap_or(f64::NAN);
    if database.has_black_substrate() && database.covers(size, 0.0) {
        return Ok(0.0);
    }
    Ok(first)
}

/// The thickness through which a share [`DARK`] of the light passes, cm.
fn dark_cm(colours: &Colours, first_cm: f64) -> Result<f64, LookupError> {
    let [normal, grazing] = colours.angles_deg.map(|deg| deg.to_radians().cos());
    let (mut below, mut above) = (first_cm.max(0.01).ln(), DEEPEST_CM.ln());
    for _ in 0..40 {
        let middle = 0.5 * (below + above);
        let cm = middle.exp();
        let luminance = colours.at(cm, normal)?.y.max(colours.at(cm, grazing)?.y);
        *(if luminance > DARK {
            &mut below
        } else {
            &mut above
        }) = middle;
    }
    // three digits are enough
    let cm = above.exp();
    Ok(format!("{cm:.2e}").parse().unwrap_or(cm))
}
