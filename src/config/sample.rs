//! Sample files: one snow sample, its light and the wavelengths.
use std::path::Path;

use crate::grain::{GrainType, SizeRange};
use crate::grid::number;
use crate::optics::ice_density_kg_m3;
use crate::transport::{Illumination, Model, Snow};
use crate::units::{cm_to_m, um_to_m};

use super::canonical::Writer;
use super::document::{Document, read_text};
use super::error::{ConfigError, Problem};
use super::keys::{DENSITY_KG_M3, GrainKeys, LayerKeys, NumberOrPath, SampleKeys};
use super::shared::{covered, exclusive, law, model, ordered, wavelengths};
use super::snow::{clean, remark, saturation_from_fraction};
use super::{MIN_GRAIN_LENGTHS, directory_of, schema, water};

/// A sample file, resolved: no defaults or alternatives are left.
#[derive(Debug, Clone, PartialEq)]
pub struct SampleFile {
    /// The snow.
    pub snow: Snow,
    /// Thickness of the slab, m.
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
    let (layer, grain) = only_layer(&document, &keys)?;
    let size = &grain.size_um;
    let snow = snow(&document, layer, grain, &mut warnings)?;
    let model = model(&document, &keys.model, directory_of(name))?;
    covered(&document, &model, &wavelengths_nm, snow.water_saturation)?;

    let least_cm = MIN_GRAIN_LENGTHS * size.max * 1e-4;
    if layer.thickness_cm < least_cm {
        let problem = Problem::OutOfRange(format!(
            "{least_cm} to 1000 cm with grains up to {} um, of which {MIN_GRAIN_LENGTHS} lengths must fit",
            size.max
        ));
        return Err(document.error(
            "layer[0].thickness_cm",
            problem,
            "take a thicker slab or smaller grains",
        ));
    }
    remark(
        &document,
        &mut warnings,
        "layer[0].thickness_cm",
        layer.thickness_cm,
        (1.0, 100.0),
        "cm",
    );

    let mut out = Writer::new();
    out.header("[illumination]");
    match keys.illumination.polar_angle_deg {
        Some(angle) => out.number("polar_angle_deg", angle),
        None => out.raw("diffuse", "true"),
    }
    out.header("[wavelengths]");
    out.numbers("values_nm", &wavelengths_nm);
    out.header("[[layer]]");
    out.number("thickness_cm", layer.thickness_cm);
    out.number("density_kg_m3", snow.density_kg_m3);
    out.number("temperature_c", snow.temperature_c);
    out.number("water_saturation", snow.water_saturation);
    out.header("[[layer.grain]]");
    out.number("fraction", 1.0);
    let (min, max) = (number(size.min), number(size.max));
    out.raw("size_um", &format!("{{ min = {min}, max = {max} }}"));
    out.law("facetness", &snow.grain.facetness);
    out.law("sphericity", &snow.grain.sphericity);
    out.model(&model, directory_of(name));

    Ok(SampleFile {
        thickness_m: cm_to_m(layer.thickness_cm),
        snow,
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

/// The one layer and the one type of grain that this version computes.
fn only_layer<'k>(
    document: &Document,
    keys: &'k SampleKeys,
) -> Result<(&'k LayerKeys, &'k GrainKeys), ConfigError> {
    let refuse = |key: &str, computes, help: &str| {
        Err(document.error(key, Problem::Unsupported(computes), help))
    };
    for (i, layer) in keys.layer.iter().enumerate() {
        fractions(document, &format!("layer[{i}]"), layer)?;
        clean(
            document,
            &format!("layer[{i}]"),
            layer.black_carbon.as_ref(),
            layer.brown_carbon.as_ref(),
        )?;
        if layer.grain.len() > 1 {
            let key = format!("layer[{i}].grain[1]");
            return refuse(&key, "one type of grain", "keep one [[layer.grain]]");
        }
    }
    let black = NumberOrPath::Number(0.0);
    if keys
        .substrate
        .as_ref()
        .is_some_and(|s| s.reflectance != black)
    {
        let help = "leave [substrate] out, or set it to 0";
        return refuse("substrate.reflectance", "a black ground", help);
    }
    match keys.layer.as_slice() {
        [layer] => match layer.grain.as_slice() {
            [grain] => Ok((layer, grain)),
            _ => refuse("layer[0].grain", "one type of grain", ""),
        },
        _ => refuse("layer[1]", "one layer", "keep one [[layer]]"),
    }
}

/// The fractions of several types are all given, and sum to 1.
fn fractions(document: &Document, table: &str, layer: &LayerKeys) -> Result<(), ConfigError> {
    let several = layer.grain.len() > 1;
    let mut sum = 0.0;
    for (i, grain) in layer.grain.iter().enumerate() {
        sum += match grain.fraction {
            Some(fraction) => fraction,
            None if several => {
                let key = format!("{table}.grain[{i}].fraction");
                let help = "give every type its share of the ice volume";
                return Err(document.error(&key, Problem::Missing, help));
            }
            None => 1.0,
        };
    }
    if (sum - 1.0).abs() <= 1e-6 {
        return Ok(());
    }
    let last = layer.grain.len() - 1;
    let key = format!("{table}.grain[{last}].fraction");
    let problem = Problem::Contradiction(format!(
        "makes the fractions of {table} sum to {sum}, not 1"
    ));
    Err(document.error(&key, problem, "the shares of the ice volume sum to 1"))
}

fn snow(
    document: &Document,
    layer: &LayerKeys,
    grain: &GrainKeys,
    warnings: &mut Vec<String>,
) -> Result<Snow, ConfigError> {
    let (size, f, s) = (&grain.size_um, &grain.facetness, &grain.sphericity);
    ordered(document, "layer[0].grain[0].size_um", size.min, size.max)?;
    let size_range = SizeRange::new(um_to_m(size.min), um_to_m(size.max)).map_err(|e| {
        let problem = Problem::Contradiction(e.to_string());
        document.error("layer[0].grain[0].size_um", problem, "")
    })?;
    remark(
        document,
        warnings,
        "layer[0].grain[0].size_um.min",
        size.min,
        (50.0, 3000.0),
        "um",
    );
    let facetness = (f.min, f.max, f.mean, f.sd);
    let sphericity = (s.min, s.max, s.mean, s.sd);
    let (density_kg_m3, water_saturation) = density_and_water(document, layer, warnings)?;
    Ok(Snow {
        grain: GrainType {
            size: size_range,
            facetness: law(document, "layer[0].grain[0].facetness", facetness)?,
            sphericity: law(document, "layer[0].grain[0].sphericity", sphericity)?,
        },
        density_kg_m3,
        temperature_c: layer.temperature_c,
        water_saturation,
    })
}

/// Dry density, kg/m3, and saturation, from whichever keys are given.
fn density_and_water(
    document: &Document,
    layer: &LayerKeys,
    warnings: &mut Vec<String>,
) -> Result<(f64, f64), ConfigError> {
    let (dry, wet) = ("layer[0].density_kg_m3", "layer[0].wet_density_kg_m3");
    exclusive(document, dry, wet)?;
    exclusive(
        document,
        "layer[0].water_saturation",
        "layer[0].water_fraction",
    )?;
    let ice = ice_density_kg_m3(layer.temperature_c);
    let saturation = layer.water_saturation.unwrap_or(0.0);
    let (key, density) = match (
        layer.density_kg_m3,
        layer.wet_density_kg_m3,
        layer.water_fraction,
    ) {
        (Some(density), _, _) => (dry, density),
        (None, Some(density), Some(fraction)) => (
            wet,
            water::dry_density_from_fraction_kg_m3(density, fraction),
        ),
        (None, Some(density), None) => (wet, water::dry_density_kg_m3(density, saturation, ice)),
        (None, None, _) => {
            let help = "give density_kg_m3 of the dry snow, or wet_density_kg_m3";
            return Err(document.error(dry, Problem::Missing, help));
        }
    };
    let (least, most) = DENSITY_KG_M3;
    if !(least <= density && density <= most && density < ice) {
        let problem = Problem::Contradiction(format!(
            "leaves a dry density of {density:.2} kg/m3: allowed {least} to {most}, and below ice ({ice:.2} kg/m3 at {} C)",
            layer.temperature_c
        ));
        return Err(document.error(key, problem, "change the density or the water"));
    }
    remark(
        document,
        warnings,
        key,
        density,
        (50.0, 450.0),
        "kg/m3 of dry snow",
    );
    let saturation = match layer.water_fraction {
        Some(fraction) => saturation_from_fraction(document, "layer[0]", fraction, density, ice)?,
        None => saturation,
    };
    Ok((density, saturation))
}
