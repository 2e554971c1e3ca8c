//! Sample files: one snowpack, its illumination and the wavelengths.
use std::path::Path;

use crate::transport::{Illumination, Joining, Layer, Model, Snowpack};
use crate::units::{m_to_cm, m_to_um};

use super::canonical::TomlWriter;
use super::document::{Document, read_text};
use super::error::{ConfigError, Problem};
use super::keys::SampleKeys;
use super::shared::{covered, exclusive, model, size_law, wavelengths};
use super::snow::holds_grains;
use super::{absorber, directory_of, layer, schema};

/// A resolved sample file: defaults are filled in, and alternative keys are converted.
#[derive(Debug, Clone, PartialEq)]
pub struct SampleFile {
    /// The snowpack and its substrate.
    pub snowpack: Snowpack,
    /// Total thickness of the layers, m.
    pub thickness_m: f64,
    /// The incident light.
    pub illumination: Illumination,
    /// Wavelengths, nm, strictly increasing.
    pub wavelengths_nm: Vec<f64>,
    /// Model options.
    pub model: Model,
    /// Warnings for the user, such as values outside the ordinary ranges of
    /// docs/methods.md.
    pub warnings: Vec<String>,
    /// Notes for the user on how the data files that it names were read.
    pub notes: Vec<String>,
    canonical: String,
}

impl SampleFile {
    /// The sample as canonical TOML: every value is explicit and in the units of the
    /// file. [`parse`] with the same file name gives the same sample.
    #[must_use]
    pub fn to_toml(&self) -> &str {
        &self.canonical
    }
}

/// Reads a sample file.
///
/// # Errors
/// [`ConfigError`] if the file cannot be read or a value is not allowed.
pub fn read(path: &Path) -> Result<SampleFile, ConfigError> {
    parse(&path.display().to_string(), &read_text(path)?)
}

/// Reads a sample file with other wavelengths than its own: `wavelengths_nm`, nm, strictly
/// increasing.
///
/// # Errors
/// As [`read`].
pub fn read_at(path: &Path, wavelengths_nm: Vec<f64>) -> Result<SampleFile, ConfigError> {
    let name = path.display().to_string();
    parse_at(&name, &read_text(path)?, Some(wavelengths_nm))
}

/// Reads the `text` of a sample file. `name` is its path: it appears in messages, and the
/// paths in the file are relative to its directory.
///
/// # Errors
/// As [`read`].
pub fn parse(name: &str, text: &str) -> Result<SampleFile, ConfigError> {
    parse_at(name, text, None)
}

/// As [`parse`], with `other_nm` instead of the wavelengths of the file.
fn parse_at(name: &str, text: &str, other_nm: Option<Vec<f64>>) -> Result<SampleFile, ConfigError> {
    let (document, keys) = Document::read::<SampleKeys>(name, text, &schema::SAMPLE)?;
    let (mut warnings, mut notes) = (Vec::new(), Vec::new());
    let illumination = illumination(&document, &keys)?;
    let wavelengths_nm = match other_nm {
        Some(other) => other,
        None => wavelengths(&document, &keys.wavelengths, &mut warnings)?,
    };
    let size_law = size_law(&document, &keys.model)?;
    let directory = directory_of(name);
    let model = model(&document, &keys.model, directory)?;
    let options = (size_law, model.facets);
    let at = (directory, wavelengths_nm.as_slice());
    let mut layers = layer::layers(
        &document,
        "layer",
        &keys.layer,
        options,
        at,
        (&mut warnings, &mut notes),
    )?;
    let substrate = keys.substrate.as_ref();
    let substrate = layer::substrate(&document, "substrate", substrate, at, &mut notes)?;
    check_fit(&document, &layers, model.joining)?;

    let mut out = TomlWriter::new();
    out.header("[illumination]");
    match keys.illumination.incidence_angle_deg {
        Some(angle) => out.number("incidence_angle_deg", angle),
        None => out.raw("diffuse", "true"),
    }
    out.header("[wavelengths]");
    out.numbers("values_nm", &wavelengths_nm);
    for (layer, keys) in layers.iter().zip(&keys.layer) {
        out.layer(layer, keys);
    }
    out.substrate(&substrate);
    out.model(&model, size_law, directory);

    // config files list layers from the base up, the model from the surface down
    layers.reverse();
    let Some((snowpack, thickness_m)) = Snowpack::of(&layers, substrate) else {
        return Err(document.error("layer", Problem::Missing, "add a [[layer]]"));
    };
    let wet = snowpack.is_wet();
    covered(&document, &model, &wavelengths_nm, wet)?;
    if snowpack.snows().any(|snow| !snow.absorbers.is_empty()) {
        absorber::remark_mass(&document, &model, &mut warnings);
    }
    Ok(SampleFile {
        snowpack,
        thickness_m,
        illumination,
        wavelengths_nm,
        model,
        warnings,
        notes,
        canonical: out.finish(),
    })
}

fn illumination(document: &Document, keys: &SampleKeys) -> Result<Illumination, ConfigError> {
    let (angle, diffuse) = ("illumination.incidence_angle_deg", "illumination.diffuse");
    match (
        keys.illumination.incidence_angle_deg,
        keys.illumination.diffuse,
    ) {
        (Some(degrees), false) => Ok(Illumination::Collimated {
            polar_angle_rad: degrees.to_radians(),
        }),
        (None, true) => Ok(Illumination::Diffuse),
        (Some(_), true) => exclusive(document, angle, diffuse).map(|()| Illumination::Diffuse),
        (None, false) => {
            let help = "give the incidence angle from the surface normal, or diffuse = true";
            Err(document.error(angle, Problem::Missing, help))
        }
    }
}

/// Refuses slabs that are too thin for their longest grain. The slab is the whole
/// snowpack or, in a cascade, each layer.
fn check_fit(document: &Document, layers: &[Layer], joining: Joining) -> Result<(), ConfigError> {
    let slabs: Vec<&[Layer]> = match joining {
        Joining::Continuous => vec![layers],
        Joining::Cascade => layers.chunks(1).collect(),
    };
    for (i, slab) in slabs.iter().enumerate() {
        let longest_m = slab.iter().map(|layer| layer.snow.sizes_m()[1]);
        let longest_um = m_to_um(longest_m.fold(0.0, f64::max));
        // an error is attributed to the thickness of the base
        let (base_m, over_m) = slab.split_first().map_or((0.0, 0.0), |(base, over)| {
            (
                base.thickness_m,
                over.iter().map(|layer| layer.thickness_m).sum(),
            )
        });
        let key = format!("layer[{i}].thickness_cm");
        let (base_cm, over_cm) = (m_to_cm(base_m), m_to_cm(over_m));
        holds_grains(document, &key, base_cm, longest_um, -over_cm)?;
    }
    Ok(())
}
