//! Snow layers and the substrate.
use std::path::Path;

use crate::grain::{
    Facets, GrainType, Shape, SizeConversion, SizeLaw, SizeMeasure, SizeRange, TruncatedNormal,
};
use crate::optics::ice_density_kg_m3;
use crate::spectrum::Table;
use crate::spectrum::measured::{self, Content, CoverageGap, MAX_BRIDGE_NM, ReadOptions};
use crate::transport::{Component, Layer, Snow, Substrate};
use crate::units::{HALF_SPACE_CM, cm_to_m, um_to_m};

use super::absorber::absorbers;
use super::document::Document;
use super::error::{ConfigError, Problem};
use super::keys::{DENSITY_KG_M3, GrainKeys, LayerKeys, ReflectanceKeys, SubstrateKeys};
use super::shared::{exclusive, law, one_size, ordered, shape};
use super::snow::{
    ORDINARY_UM, longest_grain, remark, remark_overpacked, remark_sizes, remark_smooth,
    remark_thickness, saturation_from_fraction,
};
use super::water;

/// The only layer of a sample that may be a half space.
const BASE: &str = "layer[0]";

/// The layers in the list of tables `[[name]]`, from the base up. `options` are those of the model
/// that belong to the grains. `at` is the directory to which paths are relative, and the
/// wavelengths, nm; a note on each file that is read is added to `notes`.
pub(super) fn layers(
    document: &Document,
    name: &str,
    keys: &[LayerKeys],
    options: (SizeLaw, Facets),
    at: (&Path, &[f64]),
    (warnings, notes): (&mut Vec<String>, &mut Vec<String>),
) -> Result<Vec<Layer>, ConfigError> {
    let read_layer = |(i, keys): (usize, &LayerKeys)| {
        let table = format!("{name}[{i}]");
        layer(document, &table, keys, options, at, (warnings, notes))
    };
    keys.iter().enumerate().map(read_layer).collect()
}

fn layer(
    document: &Document,
    table: &str,
    keys: &LayerKeys,
    options: (SizeLaw, Facets),
    at: (&Path, &[f64]),
    (warnings, notes): (&mut Vec<String>, &mut Vec<String>),
) -> Result<Layer, ConfigError> {
    check_fractions(document, table, keys)?;
    let grain = |(i, grain): (usize, &GrainKeys)| {
        let key = format!("{table}.grain[{i}]");
        Ok(Component {
            fraction: grain.fraction.unwrap_or(1.0),
            grain: grain_type(
                document,
                &key,
                grain,
                (options, keys.temperature_c),
                warnings,
            )?,
        })
    };
    let grains = keys.grain.iter().enumerate().map(grain);
    let grains = grains.collect::<Result<_, ConfigError>>()?;
    let (density_kg_m3, water_saturation) = density_and_water(document, table, keys, warnings)?;
    let thickness = format!("{table}.thickness_cm");
    if keys.thickness_cm >= HALF_SPACE_CM && table != BASE {
        let problem =
            "must be finite: only the first [[layer]] of a sample, its base, may be a half space";
        let problem = Problem::Contradiction(problem.to_owned());
        let help = "give a finite thickness, or make this layer the first [[layer]]";
        return Err(document.error(&thickness, problem, help));
    }
    remark_thickness(document, warnings, &thickness, keys.thickness_cm);
    let ([black_carbon, brown_carbon], absorbers) =
        absorbers(document, table, &keys.into(), at, notes)?;
    Ok(Layer {
        snow: Snow {
            grains,
            density_kg_m3,
            temperature_c: keys.temperature_c,
            water_saturation,
            black_carbon,
            brown_carbon,
            absorbers,
        },
        thickness_m: cm_to_m(keys.thickness_cm),
    })
}

/// The substrate described by the table `table`, at `wavelengths_nm`. Paths are relative
/// to `directory`; a note on each file that is read is added to `notes`.
pub(super) fn substrate(
    document: &Document,
    table: &str,
    keys: Option<&SubstrateKeys>,
    (directory, wavelengths_nm): (&Path, &[f64]),
    notes: &mut Vec<String>,
) -> Result<Substrate, ConfigError> {
    let key = format!("{table}.reflectance");
    let refuse =
        |problem: String, help: &str| document.error(&key, Problem::Contradiction(problem), help);
    let values = match keys.map(|keys| &keys.reflectance) {
        None => return Ok(Substrate::Black),
        Some(ReflectanceKeys::Number(reflectance)) => vec![*reflectance],
        Some(ReflectanceKeys::List(values)) => {
            let (given, needed) = (values.len(), wavelengths_nm.len());
            if given != needed {
                let problem = format!("has {given} values for {needed} wavelengths");
                return Err(refuse(
                    problem,
                    "give one value for each wavelength, in the same order",
                ));
            }
            values.clone()
        }
        Some(ReflectanceKeys::Path(path)) => {
            let path = directory.join(path);
            // a reflectance is between 0 and 1
            let request = ReadOptions::new(Some(Content::Reflectance), (0.0, 1.0));
            let curve = measured::read(&path, &request).map_err(|error| {
                refuse(format!("cannot be used: {}", error.without_choices()), "")
            })?;
            notes.push(format!("read {}: {}", path.display(), curve.report));
            curve.values_at(wavelengths_nm).map_err(|gap| {
                let help = match gap {
                    CoverageGap::Short { .. } => "extend the table or choose other wavelengths".to_owned(),
                    CoverageGap::Hole { .. } => format!(
                        "fill the gap or choose other wavelengths; linear interpolation bridges at most {MAX_BRIDGE_NM} nm"
                    ),
                };
                refuse(gap.to_string(), &help)
            })?
        }
    };
    Ok(match values[..] {
        [0.0] => Substrate::Black,
        [reflectance] => Substrate::Grey(reflectance),
        _ => match Table::from_column(wavelengths_nm, &values) {
            Some(table) => Substrate::Spectrum { table },
            None => return Err(refuse("has non-finite values".to_owned(), "")),
        },
    })
}

/// Refuses a layer with several grain types if a fraction is missing, and fractions that
/// do not sum to 1.
fn check_fractions(document: &Document, table: &str, layer: &LayerKeys) -> Result<(), ConfigError> {
    let several = layer.grain.len() > 1;
    let mut sum = 0.0;
    for (i, grain) in layer.grain.iter().enumerate() {
        sum += match grain.fraction {
            Some(fraction) => fraction,
            None if several => {
                let key = format!("{table}.grain[{i}].fraction");
                let help = "give the fraction of the ice volume for every grain type";
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
    Err(document.error(
        &key,
        problem,
        "make the fractions of the ice volume sum to 1",
    ))
}

fn grain_type(
    document: &Document,
    table: &str,
    grain: &GrainKeys,
    ((size_law, facets), temperature_c): ((SizeLaw, Facets), f64),
    warnings: &mut Vec<String>,
) -> Result<GrainType, ConfigError> {
    let f = &grain.facetness;
    let keys = (
        grain.shape.as_str(),
        &grain.sphericity,
        grain.aspect_ratio.as_ref(),
    );
    let (shape, proportion) = shape(document, table, keys)?;
    one_size(document, table, "size_um")?;
    let sizes_um = sizes_um(grain, size_law, (shape, proportion), temperature_c);
    let key = match size_measure(grain) {
        None => {
            let key = format!("{table}.size_um");
            ordered(document, &key, sizes_um[0], sizes_um[1])?;
            for (end, size) in ["min", "max"].into_iter().zip(sizes_um) {
                let key = format!("{key}.{end}");
                remark(document, warnings, &key, size, ORDINARY_UM, "um");
            }
            key
        }
        Some((measure, _)) => {
            let key = format!("{table}.{}", measure.name());
            longest_grain(document, &key, sizes_um[0], 0.0)?;
            remark_sizes(document, warnings, [&key, &key], sizes_um);
            key
        }
    };
    let range = SizeRange::new(um_to_m(sizes_um[0]), um_to_m(sizes_um[1]))
        .map_err(|e| document.error(&key, Problem::Contradiction(e.to_string()), ""))?
        .with_law(size_law);
    remark_overpacked(document, warnings, &key, &range);
    let key = format!("{table}.facetness.min");
    remark_smooth(document, warnings, facets, (&key, f.min));
    let facetness = (f.min, f.max, f.mean, f.sd);
    Ok(GrainType {
        size: range,
        facetness: law(document, &format!("{table}.facetness"), facetness)?,
        shape,
        proportion,
    })
}

/// The measure that gives the grain size, and its value; `None` if `size_um` is given.
fn size_measure(grain: &GrainKeys) -> Option<(SizeMeasure, f64)> {
    let radius = grain
        .optical_radius_um
        .map(|r| (SizeMeasure::OpticalRadius, r));
    radius.or(grain
        .ssa_m2_kg
        .map(|ssa| (SizeMeasure::SpecificSurface, ssa)))
}

/// Smallest and largest grain size, um; they are equal if the size is given by another
/// measure.
pub(super) fn sizes_um(
    grain: &GrainKeys,
    size_law: SizeLaw,
    (shape, proportion): (Shape, TruncatedNormal),
    temperature_c: f64,
) -> [f64; 2] {
    if let Some(size) = &grain.size_um {
        return [size.min, size.max];
    }
    let conversion = SizeConversion {
        half_width_um: 0.0,
        size_law,
        shape,
        proportion,
        temperature_c,
    };
    let size = size_measure(grain).map_or(f64::NAN, |(measure, value)| {
        measure.size_um(value, &conversion)
    });
    [size; 2]
}

/// Dry density, kg/m3, and water saturation, from the keys that are given.
fn density_and_water(
    document: &Document,
    table: &str,
    layer: &LayerKeys,
    warnings: &mut Vec<String>,
) -> Result<(f64, f64), ConfigError> {
    let key = |name: &str| format!("{table}.{name}");
    let (dry, wet) = (key("density_kg_m3"), key("wet_density_kg_m3"));
    exclusive(document, &dry, &wet)?;
    exclusive(document, &key("water_saturation"), &key("water_fraction"))?;
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
            let help = "give density_kg_m3 (dry snow) or wet_density_kg_m3";
            return Err(document.error(&dry, Problem::Missing, help));
        }
    };
    let (min, max) = DENSITY_KG_M3;
    if !(min <= density && density <= max && density < ice) {
        let problem = Problem::Contradiction(format!(
            "gives a dry density of {density:.2} kg/m3: allowed {min} to {max}, and below that of ice ({ice:.2} kg/m3 at {} C)",
            layer.temperature_c
        ));
        return Err(document.error(&key, problem, "change the density or the water content"));
    }
    remark(
        document,
        warnings,
        &key,
        density,
        (50.0, 450.0),
        "kg/m3 of dry snow",
    );
    let saturation = match layer.water_fraction {
        Some(fraction) => saturation_from_fraction(document, table, fraction, density, ice)?,
        None => saturation,
    };
    Ok((density, saturation))
}
