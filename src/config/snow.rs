//! Reading and checking of snow that several kinds of file share: limits of grain sizes
//! and slab thicknesses, water, and the properties that all curves share.
use std::path::Path;

use crate::grain::{Facets, SizeLaw, SizeRange, overpacking};
use crate::grid::{Fixed, MIN_GRAIN_LENGTHS, Spread};
use crate::optics::ice_density_kg_m3;
use crate::parameter::Parameter;
use crate::transport::{Joining, Model};
use crate::units::{HALF_SPACE_CM, m_to_cm, m_to_um, um_to_m};

use super::absorber::{self, Keys, absorbers};
use super::document::Document;
use super::error::{ConfigError, Problem};
use super::keys::{FixedKeys, MAX_THICKNESS_CM, SATURATION, SIZE_UM, SpreadKeys};
use super::shared::{exclusive, shape};
use super::{layer, water};

/// Widths of the distributions around the mean of a kind of snow.
pub(super) fn spread(keys: &SpreadKeys, size_law: SizeLaw) -> Spread {
    Spread {
        facetness_half_width: keys.facetness_half_width,
        facetness_sd: keys.facetness_sd,
        grain_size_half_width_um: keys.grain_size_half_width_um,
        sphericity_half_width: keys.sphericity_half_width,
        sphericity_sd: keys.sphericity_sd,
        size_law,
    }
}

/// Refuses a parameter that is both fixed and an axis in one of `tables`, and settings of
/// an axis that is not in the file.
pub(super) fn fixed_or_axis(
    document: &Document,
    tables: &[String],
    keys: &FixedKeys,
) -> Result<(), ConfigError> {
    const CONCENTRATION: &str = "fixed.black_carbon.concentration_ng_g";
    for table in tables {
        for parameter in Parameter::ALL {
            for fixed in parameter.record().fixed {
                exclusive(document, &format!("{table}.{}", parameter.key()), fixed)?;
            }
        }
    }
    let has = |axis: Parameter| {
        let mut keys = tables.iter().map(|table| format!("{table}.{}", axis.key()));
        keys.any(|key| document.has(&key))
    };
    for key in ["spread.sphericity_half_width", "spread.sphericity_sd"] {
        if document.has(key) && !has(Parameter::Sphericity) {
            let problem = "requires the axis sphericity, which is not in the file";
            let problem = Problem::Contradiction(problem.to_owned());
            return Err(document.error(key, problem, "remove it, or add the axis sphericity"));
        }
    }
    match (has(Parameter::Absorber), keys.absorber.first()) {
        (true, None) => {
            let help = "add [[fixed.absorber]] with its species, file or mass absorption efficiency: the axis gives the mass of the first one";
            return Err(document.error("fixed.absorber", Problem::Missing, help));
        }
        (false, Some(first)) => {
            absorber::concentration(document, "fixed.absorber[0]", first, false)?;
        }
        _ => {}
    }
    let needed = keys.black_carbon.is_some() && !has(Parameter::BlackCarbon);
    if needed && !document.has(CONCENTRATION) {
        let help = "add it: Mass of carbon per mass of snow, ng/g.";
        return Err(document.error(CONCENTRATION, Problem::Missing, help));
    }
    Ok(())
}

/// The properties that all curves share; `densities_kg_m3` are the dry densities of the
/// curves.
pub(super) fn fixed(
    document: &Document,
    keys: &FixedKeys,
    model: Model,
    size_law: SizeLaw,
    densities_kg_m3: &[f64],
    at: (&Path, &[f64]),
    (warnings, notes): (&mut Vec<String>, &mut Vec<String>),
) -> Result<Fixed, ConfigError> {
    let shape_keys = (
        keys.shape.as_str(),
        &keys.sphericity,
        keys.aspect_ratio.as_ref(),
    );
    let (shape, proportion) = shape(document, "fixed", shape_keys)?;
    exclusive(document, "fixed.water_saturation", "fixed.water_fraction")?;
    let water_saturation = match (keys.water_fraction, densities_kg_m3) {
        (None, _) => keys.water_saturation.unwrap_or(0.0),
        (Some(0.0), _) => 0.0,
        (Some(fraction), &[density]) => {
            let ice = ice_density_kg_m3(keys.temperature_c);
            saturation_from_fraction(document, "fixed", fraction, density, ice)?
        }
        // The same water fraction is a different saturation at each density.
        (Some(_), _) => {
            let problem = Problem::Unsupported("one water saturation for all densities");
            let help = "give water_saturation, or a single density";
            return Err(document.error("fixed.water_fraction", problem, help));
        }
    };
    let absorber_keys = Keys {
        carbon: [keys.black_carbon.as_ref(), keys.brown_carbon.as_ref()],
        others: &keys.absorber,
        may_be_axis: true,
    };
    let ([black_carbon, brown_carbon], absorbers) =
        absorbers(document, "fixed", &absorber_keys, at, notes)?;
    let options = (size_law, model.facets);
    let mut below = layer::layers(
        document,
        "fixed.below",
        &keys.below,
        options,
        at,
        (&mut *warnings, &mut *notes),
    )?;
    if model.joining == Joining::Cascade {
        for (i, (layer, keys)) in below.iter().zip(&keys.below).enumerate() {
            let key = format!("fixed.below[{i}].thickness_cm");
            let longest_um = m_to_um(layer.snow.sizes_m()[1]);
            holds_grains(document, &key, keys.thickness_cm, longest_um, 0.0)?;
        }
    }
    below.reverse();
    let fixed = Fixed {
        shape,
        proportion,
        temperature_c: keys.temperature_c,
        water_saturation,
        black_carbon,
        brown_carbon,
        absorbers,
        below,
        substrate: layer::substrate(
            document,
            "fixed.substrate",
            keys.substrate.as_ref(),
            at,
            notes,
        )?,
        model,
        diffuse: false,
    };
    if fixed.has_absorbers() {
        absorber::remark_mass(document, &fixed.model, warnings);
    }
    Ok(fixed)
}

/// Water saturation of the pore space, from the value of the key `table.water_fraction`.
pub(super) fn saturation_from_fraction(
    document: &Document,
    table: &str,
    fraction: f64,
    density_kg_m3: f64,
    ice_density_kg_m3: f64,
) -> Result<f64, ConfigError> {
    let saturation = water::saturation(fraction, density_kg_m3, ice_density_kg_m3);
    if saturation <= SATURATION.1 {
        return Ok(saturation);
    }
    let largest = water::water_fraction(SATURATION.1, density_kg_m3, ice_density_kg_m3);
    let problem = Problem::OutOfRange(format!(
        "0 to {largest:.4} at {density_kg_m3} kg/m3, where water fills half of the pore space"
    ));
    let help = "lower the water fraction or the density";
    Err(document.error(&format!("{table}.water_fraction"), problem, help))
}

/// Length of the longest grain, um, for sizes in `mean_um` +- `half_width_um`. `key`
/// gives the mean. Refuses sizes out of range.
pub(super) fn longest_grain(
    document: &Document,
    key: &str,
    mean_um: f64,
    half_width_um: f64,
) -> Result<f64, ConfigError> {
    let (allowed_min, allowed_max) = SIZE_UM;
    let (min, max) = (mean_um - half_width_um, mean_um + half_width_um);
    if !(allowed_min <= min && max <= allowed_max) {
        let sizes = match half_width_um {
            0.0 => format!("{mean_um} um"),
            _ => {
                format!("{min} to {max} um with spread.grain_size_half_width_um = {half_width_um}")
            }
        };
        let problem = format!("makes grains of {sizes}: allowed {allowed_min} to {allowed_max} um");
        let problem = Problem::Contradiction(problem);
        return Err(document.error(key, problem, "change the size or lower the half width"));
    }
    Ok(max)
}

/// Warns of grain sizes from `min` to `max`, um, that reach outside the ordinary range;
/// `first` and `last` are the keys that give them.
pub(super) fn remark_sizes(
    document: &Document,
    warnings: &mut Vec<String>,
    [first, last]: [&str; 2],
    [min, max]: [f64; 2],
) {
    let (ordinary_min, ordinary_max) = ORDINARY_UM;
    let mut remark = |key: &str, extent: String| {
        let remark = format!(
            "makes grains {extent} um; the ordinary range is {ordinary_min} to {ordinary_max} um"
        );
        warnings.push(document.warning(key, remark));
    };
    if min < ordinary_min {
        remark(first, format!("down to {}", min as f32));
    }
    if max > ordinary_max {
        remark(last, format!("up to {}", max as f32));
    }
}

/// Ordinary range of grain sizes, um.
pub(super) const ORDINARY_UM: (f64, f64) = {
    let ordinary = Parameter::GrainSize.record().ordinary;
    (ordinary.min, ordinary.max)
};

/// Warns if `smallest`, the smallest facetness, given at `key`, is 0, where reflectance is
/// discontinuous with the published facets.
pub(super) fn remark_smooth(
    document: &Document,
    warnings: &mut Vec<String>,
    facets: Facets,
    (key, smallest): (&str, f64),
) {
    if smallest == 0.0 && facets == Facets::Varsa2025 {
        let remark = "is where reflectance is discontinuous: facetness 0 and 0.01 give very different reflectances, and look-ups between the two are not reliable (docs/stability.md)";
        warnings.push(document.warning(key, remark.to_owned()));
    }
}

/// Largest ratio of the ice that rays cross under the published size law to the ice that
/// the density holds, without a warning.
const OVERPACKED: f64 = 1.3;

/// Warns of a size range, given at `key`, for which rays cross much more ice under the
/// published size law than the density holds.
pub(super) fn remark_overpacked(
    document: &Document,
    warnings: &mut Vec<String>,
    key: &str,
    size: &SizeRange,
) {
    let ratio = overpacking(size);
    if ratio > OVERPACKED {
        let [min, max] = [size.min_m(), size.max_m()].map(|m| m_to_um(m) as f32);
        let remark = format!(
            "makes grains of {min} to {max} um, for which rays cross {ratio:.2} times the ice that the density holds under the published size law; set model.size_law = \"consistent\" to avoid this"
        );
        warnings.push(document.warning(key, remark));
    }
}

/// As [`remark_overpacked`], for sizes with the width of `spread` around `mean_um`, which
/// is given at `key`.
pub(super) fn remark_spread(
    document: &Document,
    warnings: &mut Vec<String>,
    key: &str,
    mean_um: f64,
    spread: &Spread,
) {
    let half_width_um = spread.grain_size_half_width_um;
    let ends = [mean_um - half_width_um, mean_um + half_width_um].map(um_to_m);
    // an invalid size range is refused elsewhere
    if let Ok(size) = SizeRange::new(ends[0], ends[1]) {
        remark_overpacked(document, warnings, key, &size.with_law(spread.size_law));
    }
}

/// Refuses a snowpack that is not thicker than its layers in `fixed`, and a slab that is
/// too thin for its longest grain.
pub(super) fn thick_enough(
    document: &Document,
    key: &str,
    thickness_cm: f64,
    longest_um: f64,
    fixed: &Fixed,
) -> Result<(), ConfigError> {
    let below_cm = m_to_cm(fixed.below.iter().map(|layer| layer.thickness_m).sum());
    if !fixed.below.is_empty() && thickness_cm <= below_cm {
        let problem = Problem::OutOfRange(format!(
            "above {below_cm} cm, the thickness of the layers of fixed.below: thickness_cm is the total thickness of all layers"
        ));
        let help = "use thicker snowpacks or thinner layers below";
        return Err(document.error(key, problem, help));
    }
    match fixed.model.joining {
        Joining::Continuous => {
            let below = fixed.below.iter().map(|layer| layer.snow.sizes_m()[1]);
            let longest_um = below.map(m_to_um).fold(longest_um, f64::max);
            holds_grains(document, key, thickness_cm, longest_um, 0.0)
        }
        Joining::Cascade => holds_grains(document, key, thickness_cm, longest_um, below_cm),
    }
}

/// Refuses a slab thinner than [`MIN_GRAIN_LENGTHS`] lengths of grains of `longest_um`.
/// The value at `key` is `thickness_cm`. If `rest_cm` is positive, this value includes
/// `rest_cm` of layers that are not part of the slab; if it is negative, the slab has
/// further layers of `-rest_cm` in total.
pub(super) fn holds_grains(
    document: &Document,
    key: &str,
    thickness_cm: f64,
    longest_um: f64,
    rest_cm: f64,
) -> Result<(), ConfigError> {
    let min_cm = rest_cm + MIN_GRAIN_LENGTHS * longest_um * 1e-4;
    // tolerance for rounding errors in sums of thicknesses
    if thickness_cm >= min_cm * (1.0 - 1e-12) {
        return Ok(());
    }
    let rest = match rest_cm {
        0.0 => String::new(),
        ..0.0 => format!(" with the {} cm of the other layers", -rest_cm),
        _ => format!(" in addition to the {rest_cm} cm of the other layers"),
    };
    let problem = Problem::OutOfRange(format!(
        "{min_cm} to {MAX_THICKNESS_CM} cm: {MIN_GRAIN_LENGTHS} lengths of the longest grain, {longest_um} um, must fit{rest}"
    ));
    Err(document.error(key, problem, "use thicker slabs or smaller grains"))
}

/// Warns of an axis value outside the ordinary range of its parameter.
pub(super) fn remark_axis(
    document: &Document,
    warnings: &mut Vec<String>,
    parameter: Parameter,
    key: &str,
    value: f64,
) {
    let record = parameter.record();
    match parameter {
        Parameter::Thickness => remark_thickness(document, warnings, key, value),
        _ => {
            let ordinary = (record.ordinary.min, record.ordinary.max);
            remark(document, warnings, key, value, ordinary, record.unit);
        }
    }
}

/// Warns of a finite thickness, cm, outside the ordinary range.
pub(super) fn remark_thickness(
    document: &Document,
    warnings: &mut Vec<String>,
    key: &str,
    value: f64,
) {
    if value < HALF_SPACE_CM {
        let ordinary = Parameter::Thickness.record().ordinary;
        let ordinary = (ordinary.min, ordinary.max);
        remark(document, warnings, key, value, ordinary, "cm");
    }
}

/// Warns of a value that is allowed but outside its ordinary range (docs/methods.md).
pub(super) fn remark(
    document: &Document,
    warnings: &mut Vec<String>,
    key: &str,
    value: f64,
    (min, max): (f64, f64),
    unit: &str,
) {
    if !(min..=max).contains(&value) {
        let remark = format!("is outside the ordinary range {min} to {max} {unit}");
        warnings.push(document.warning(key, remark));
    }
}
