//! Sample files: one snow pack, its light and the wavelengths.
use std::path::Path;

use crate::transport::{EXPONENTS, Illumination, Joining, Layer, Model, Pack};
use crate::units::m_to_um;

use super::canonical::Writer;
use super::document::{Document, read_text};
use super::error::{ConfigError, Problem};
use super::keys::SampleKeys;
use super::shared::{covered, exclusive, model, wavelengths};
use super::{MIN_GRAIN_LENGTHS, directory_of, layer, schema};

/// A sample file, resolved: no defaults or alternatives are left.
#[derive(Debug, Clone, PartialEq)]
pub struct SampleFile {
    /// The snow.
    pub pack: Pack,
    /// Thickness of all its layers together, m.
    pub thickness_m: f64,
    /// The light.
    pub illumination: Illumination,
    /// Wavelengths, nm, strictly increasing.
    pub wavelengths_nm: Vec<f64>,
    /// Choices within the model.
    pub model: Model,
    /// Values beyond the ordinary ranges of docs/methods.md, for the user to see.
    pub warnings: Vec<String>,
    canonical: String,
}

impl SampleFile {
    /// The sample as canonical TOML, every value explicit, in the file's units;
    /// [`parse`] under the same file name gives the same sample.
    #[must_use]
    pub fn to_toml(&self) -> &str {
        &self.canonical
    }
}

/// Reads a sample file.
///
/// # Errors
/// [`ConfigError`] with file, line, key, value, and what is allowed.
pub fn read(path: &Path) -> Result<SampleFile, ConfigError> {
    parse(&path.display().to_string(), &read_text(path)?)
}

/// Reads the `text` of a sample file; `name` is its path, for messages and for
/// the paths in it.
///
/// # Errors
/// As [`read`].
pub fn parse(name: &str, text: &str) -> Result<SampleFile, ConfigError> {
    let (document, keys) = Document::read::<SampleKeys>(name, text, &schema::SAMPLE)?;
    let mut warnings = Vec::new();
    let illumination = illumination(&document, &keys)?;
    let wavelengths_nm = wavelengths(&document, &keys.wavelengths, &mut warnings)?;
    let mut layers = layer::layers(&document, "layer", &keys.layer, &mut warnings)?;
    let directory = directory_of(name);
    let model = model(&document, &keys.model, directory)?;
    let substrate = keys.substrate.as_ref();
    let ground = layer::ground(
        &document,
        "substrate",
        substrate,
        directory,
        &wavelengths_nm,
    )?;
    room(&document, &layers, model.joining)?;

    let mut out = Writer::new();
    out.header("[illumination]");
    match keys.illumination.polar_angle_deg {
        Some(angle) => out.number("polar_angle_deg", angle),
        None => out.raw("diffuse", "true"),
    }
    out.header("[wavelengths]");
    out.numbers("values_nm", &wavelengths_nm);
    for (layer, keys) in layers.iter().zip(&keys.layer) {
        out.layer(layer, keys);
    }
    out.ground(&ground, directory);
    out.model(&model, directory);

    // a config begins at the base, light at the surface
    layers.reverse();
    let Some((pack, thickness_m)) = Pack::of(&layers, ground) else {
        return Err(document.error("layer", Problem::Missing, "add a [[layer]]"));
    };
    let wet = pack.is_wet();
    covered(&document, &model, &wavelengths_nm, wet)?;
    exponents(&document, &pack)?;
    Ok(SampleFile {
        pack,
        thickness_m,
        illumination,
        wavelengths_nm,
        model,
        warnings,
        canonical: out.finish(),
    })
}

fn illumination(document: &Document, keys: &SampleKeys) -> Result<Illumination, ConfigError> {
    let (angle, diffuse) = ("illumination.polar_angle_deg", "illumination.diffuse");
    match (keys.illumination.polar_angle_deg, keys.illumination.diffuse) {
        (Some(degrees), false) => Ok(Illumination::Collimated {
            polar_angle_rad: degrees.to_radians(),
        }),
        (None, true) => Ok(Illumination::Diffuse),
        (Some(_), true) => exclusive(document, angle, diffuse).map(|()| Illumination::Diffuse),
        (None, false) => {
            let help = "give the angle of the rays from the surface normal, or diffuse = true";
            Err(document.error(angle, Problem::Missing, help))
        }
    }
}

/// Grains must fit between the planes that reject them: those of the pack, or
/// in a cascade of each layer.
fn room(document: &Document, layers: &[Layer], joining: Joining) -> Result<(), ConfigError> {
    let biggest_m = |layers: &[Layer]| {
        let sizes = layers.iter().map(|layer| layer.snow.sizes_m()[1]);
        sizes.fold(0.0, f64::max)
    };
    let slabs: Vec<&[Layer]> = match joining {
        Joining::Continuous => vec![layers],
        Joining::Cascade => layers.chunks(1).collect(),
    };
    for (i, slab) in slabs.iter().enumerate() {
        let least_cm = MIN_GRAIN_LENGTHS * biggest_m(slab) * 1e2;
        let thickness_m: f64 = slab.iter().map(|layer| layer.thickness_m).sum();
        // a sum of thicknesses in m may miss one in cm by a rounding
        if thickness_m * 1e2 < least_cm * (1.0 - 1e-12) {
            let together = if slab.len() > 1 { "for the pack " } else { "" };
            let problem = Problem::OutOfRange(format!(
                "{together}{least_cm} to 1000 cm with grains up to {} um, of which {MIN_GRAIN_LENGTHS} lengths must fit",
                m_to_um(biggest_m(slab))
            ));
            let key = format!("layer[{i}].thickness_cm");
            return Err(document.error(&key, problem, "take a thicker slab or smaller grains"));
        }
    }
    Ok(())
}

/// No more different exponents than walks keep apart.
fn exponents(document: &Document, pack: &Pack) -> Result<(), ConfigError> {
    let found = pack.exponents().len();
    if found <= EXPONENTS {
        return Ok(());
    }
    let problem = Problem::Contradiction(format!(
        "brings carbon of {found} different Angstrom exponents: at most {EXPONENTS} in one pack"
    ));
    Err(document.error("layer", problem, "give alike carbon the same exponent"))
}
