//! What the kinds of file have in common about snow: limits of grains and slabs,
//! and water.
use std::path::Path;

use crate::grid::{ExtraAxis, Fixed, MIN_GRAIN_LENGTHS, Spread};
use crate::optics::{Carbon, ice_density_kg_m3};
use crate::transport::{Joining, Model};
use crate::units::{m_to_cm, m_to_um};

use super::document::Document;
use super::error::{ConfigError, Problem};
use super::keys::{CarbonKeys, FixedKeys, SATURATION, SIZE_UM, SpreadKeys};
use super::shared::{exclusive, law};
use super::{layer, water};

/// Widths of the laws around the mean of a kind of snow.
pub(super) fn spread(keys: &SpreadKeys) -> Spread {
    Spread {
        facetness_half_width: keys.facetness_half_width,
        facetness_sd: keys.facetness_sd,
        grain_size_half_width_um: keys.grain_size_half_width_um,
        sphericity_half_width: keys.sphericity_half_width,
        sphericity_sd: keys.sphericity_sd,
    }
}

/// Refuses what is an axis beyond the five in one of the `tables`, and fixed too;
/// and what is said of an axis that there is not.
pub(super) fn fixed_or_axis(
    document: &Document,
    tables: &[String],
    keys: &FixedKeys,
) -> Result<(), ConfigError> {
    const CONCENTRATION: &str = "fixed.black_carbon.concentration_ng_g";
    for table in tables {
        for (axis, fixed) in [
            (ExtraAxis::BlackCarbon, CONCENTRATION),
            (ExtraAxis::WaterSaturation, "fixed.water_saturation"),
            (ExtraAxis::WaterSaturation, "fixed.water_fraction"),
            (ExtraAxis::Temperature, "fixed.temperature_c"),
            (ExtraAxis::Sphericity, "fixed.sphericity"),
            (ExtraAxis::SubstrateReflectance, "fixed.substrate"),
        ] {
            exclusive(document, &format!("{table}.{}", axis.name()), fixed)?;
        }
    }
    let has = |axis: ExtraAxis| {
        let mut keys = tables
            .iter()
            .map(|table| format!("{table}.{}", axis.name()));
        keys.any(|key| document.has(&key))
    };
    for key in ["spread.sphericity_half_width", "spread.sphericity_sd"] {
        if document.has(key) && !has(ExtraAxis::Sphericity) {
            let problem = "is for an axis sphericity, and there is none";
            let problem = Problem::Contradiction(problem.to_owned());
            return Err(document.error(key, problem, "leave it out, or name the axis"));
        }
    }
    let needed = keys.black_carbon.is_some() && !has(ExtraAxis::BlackCarbon);
    if needed && !document.has(CONCENTRATION) {
        let help = "add it: Mass of carbon per mass of snow, ng/g.";
        return Err(document.error(CONCENTRATION, Problem::Missing, help));
    }
    Ok(())
}

/// What all snows of the dry `densities_kg_m3` have in common.
pub(super) fn fixed(
    document: &Document,
    keys: &FixedKeys,
    model: Model,
    densities_kg_m3: &[f64],
    (directory, wavelengths_nm): (&Path, &[f64]),
    warnings: &mut Vec<String>,
) -> Result<Fixed, ConfigError> {
    let s = &keys.sphericity;
    exclusive(document, "fixed.water_saturation", "fixed.water_fraction")?;
    let water_saturation = match (keys.water_fraction, densities_kg_m3) {
        (None, _) => keys.water_saturation.unwrap_or(0.0),
        (Some(0.0), _) => 0.0,
        (Some(fraction), &[density]) => {
            let ice = ice_density_kg_m3(keys.temperature_c);
            saturation_from_fraction(document, "fixed", fraction, density, ice)?
        }
        // One fraction of the volume is another saturation at each density.
        (Some(_), _) => {
            let problem = Problem::Unsupported("one water saturation for all densities");
            let help = "give water_saturation, or a single density";
            return Err(document.error("fixed.water_fraction", problem, help));
        }
    };
    let carbon = |name: &str, keys: &Option<CarbonKeys>, usual| {
        let key = format!("fixed.{name}");
        let carbon = keys
            .as_ref()
            .map(|keys| layer::carbon(document, &key, keys, usual));
        carbon.transpose()
    };
    let mut below = layer::layers(document, "fixed.below", &keys.below, warnings)?;
    if model.joining == Joining::Cascade {
        for (i, (layer, keys)) in below.iter().zip(&keys.below).enumerate() {
            let key = format!("fixed.below[{i}].thickness_cm");
            let biggest_um = m_to_um(layer.snow.sizes_m()[1]);
            holds_grains(document, &key, keys.thickness_cm, biggest_um, 0.0)?;
        }
    }
    below.reverse();
    let fixed = Fixed {
        sphericity: law(document, "fixed.sphericity", (s.min, s.max, s.mean, s.sd))?,
        temperature_c: keys.temperature_c,
        water_saturation,
        black_carbon: carbon("black_carbon", &keys.black_carbon, Carbon::black(0.0))?,
        brown_carbon: carbon("brown_carbon", &keys.brown_carbon, Carbon::brown(0.0))?,
        below,
        ground: layer::ground(
            document,
            "fixed.substrate",
            keys.substrate.as_ref(),
            directory,
            wavelengths_nm,
        )?,
        model,
        diffuse: false,
    };
    layer::exponents(document, "fixed", fixed.carbon())?;
    Ok(fixed)
}

/// Saturation of the pore space from the key `table.water_fraction`.
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
    let most = water::water_fraction(SATURATION.1, density_kg_m3, ice_density_kg_m3);
    let problem = Problem::OutOfRange(format!(
        "0 to {most:.4} at {density_kg_m3} kg/m3, where it fills half of the pore space"
    ));
    let help = "lower the water or the density";
    Err(document.error(&format!("{table}.water_fraction"), problem, help))
}

/// The biggest grain, um, of sizes in `mean_um` -+ `half_width_um`, the value at
/// `key`; refuses sizes out of range.
pub(super) fn biggest_grain(
    document: &Document,
    key: &str,
    mean_um: f64,
    half_width_um: f64,
) -> Result<f64, ConfigError> {
    let (least, most) = SIZE_UM;
    let (min, max) = (mean_um - half_width_um, mean_um + half_width_um);
    if !(least <= min && max <= most) {
        let problem = Problem::Contradiction(format!(
            "makes grains of {min} to {max} um with spread.grain_size_half_width_um = {half_width_um}: allowed {least} to {most}"
        ));
        return Err(document.error(key, problem, "move the size or narrow the spread"));
    }
    Ok(max)
}

/// Remarks on sizes that reach below the ordinary.
pub(super) fn remark_small(
    document: &Document,
    warnings: &mut Vec<String>,
    key: &str,
    mean_um: f64,
    half_width_um: f64,
) {
    let min = mean_um - half_width_um;
    if min < 50.0 {
        let remark = format!("makes grains down to {min} um; ordinary are 50 to 3000 um");
        warnings.push(document.warning(key, remark));
    }
}

/// Refuses a pack over the layers of `fixed` that leaves nothing for the surface
/// layer, or that the biggest grain does not fit into often enough.
pub(super) fn thick_enough(
    document: &Document,
    key: &str,
    thickness_cm: f64,
    biggest_um: f64,
    fixed: &Fixed,
) -> Result<(), ConfigError> {
    let below_cm = m_to_cm(fixed.below.iter().map(|layer| layer.thickness_m).sum());
    if !fixed.below.is_empty() && thickness_cm <= below_cm {
        let problem = Problem::OutOfRange(format!(
            "above {below_cm} cm, which the layers of fixed.below take: it is the thickness of all layers"
        ));
        let help = "take thicker packs or thinner layers below";
        return Err(document.error(key, problem, help));
    }
    match fixed.model.joining {
        Joining::Continuous => {
            let below = fixed.below.iter().map(|layer| layer.snow.sizes_m()[1]);
            let biggest_um = below.map(m_to_um).fold(biggest_um, f64::max);
            holds_grains(document, key, thickness_cm, biggest_um, 0.0)
        }
        Joining::Cascade => holds_grains(document, key, thickness_cm, biggest_um, below_cm),
    }
}

/// Refuses a slab that grains up to `biggest_um` do not fit into often enough.
/// The value at `key` is its thickness and `rest_cm` of other layers; or, if that
/// is negative, its thickness but for those.
pub(super) fn holds_grains(
    document: &Document,
    key: &str,
    thickness_cm: f64,
    biggest_um: f64,
    rest_cm: f64,
) -> Result<(), ConfigError> {
    let least_cm = rest_cm + MIN_GRAIN_LENGTHS * biggest_um * 1e-4;
    // sums of thicknesses may miss one by a rounding
    if thickness_cm >= least_cm * (1.0 - 1e-12) {
        return Ok(());
    }
    let rest = match rest_cm {
        0.0 => String::new(),
        ..0.0 => format!(" with the {} cm of other layers", -rest_cm),
        _ => format!(" beside the {rest_cm} cm of other layers"),
    };
    let problem = Problem::OutOfRange(format!(
        "{least_cm} to 1000 cm with grains up to {biggest_um} um, of which {MIN_GRAIN_LENGTHS} lengths must fit{rest}"
    ));
    Err(document.error(key, problem, "take thicker slabs or smaller grains"))
}

/// Remarks on a thickness or density beyond the ordinary.
pub(super) fn remark_axis(
    document: &Document,
    warnings: &mut Vec<String>,
    axis: &str,
    key: &str,
    value: f64,
) {
    let (range, unit) = match axis {
        "thickness_cm" => ((1.0, 100.0), "cm"),
        _ => ((50.0, 450.0), "kg/m3"),
    };
    remark(document, warnings, key, value, range, unit);
}

/// Remarks on values that are allowed but beyond the ordinary range of
/// docs/methods.md.
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
