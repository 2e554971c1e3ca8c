//! The settings of a grid that affect the spectra, with the keys of a grid file. The same
//! structs write and read the canonical text of a grid. It does not depend on the comments,
//! order and formatting of the user's file, nor on the bounds of the compression, which do
//! not affect the spectra.
use std::collections::BTreeMap;
use std::fmt::Write;

use serde::de::Error;
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value};

use super::SizeAxis;
use super::toml_text::toml_entries;
use crate::engine::Engine;
use crate::grain::SizeMeasure;
use crate::parameter::{Axes, Parameter};

/// Every setting of a grid that affects the spectra; settings without effect are left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GridSettings {
    pub(crate) axes: AxisSettings,
    pub(crate) spread: SpreadSettings,
    pub(crate) wavelengths: WavelengthSettings,
    #[serde(default)]
    pub(crate) fixed: FixedSettings,
    pub(crate) run: RunSettings,
    pub(crate) model: ModelSettings,
}

impl GridSettings {
    /// The text of a grid file with these settings.
    pub(crate) fn to_config(&self) -> String {
        config_text(&self.entries())
    }

    /// Key, such as `run.seed`, and TOML value of each setting.
    pub(crate) fn entries(&self) -> Vec<(String, String)> {
        let sections = [
            ("axes", toml_entries(&self.axes)),
            ("spread", toml_entries(&self.spread)),
            ("wavelengths", toml_entries(&self.wavelengths)),
            ("fixed", toml_entries(&self.fixed)),
            ("run", toml_entries(&self.run)),
            ("model", toml_entries(&self.model)),
        ];
        let entries = sections.into_iter().flat_map(|(section, entries)| {
            let entries = entries.into_iter();
            entries.map(move |(key, value)| (format!("{section}.{key}"), value))
        });
        entries.collect()
    }
}

/// The text of a grid file with these entries (see [`GridSettings::entries`]).
pub(crate) fn config_text(entries: &[(String, String)]) -> String {
    let mut text = String::from("version = 1\n");
    let mut current = "";
    for (path, value) in entries {
        let (section, key) = path.split_once('.').unwrap_or(("", path));
        if section != current {
            let _ = writeln!(text, "\n[{section}]");
            current = section;
        }
        let _ = writeln!(text, "{key} = {value}");
    }
    text
}

/// The axes, and whether there are curves under diffuse light.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(try_from = "UnorderedAxes")]
pub(crate) struct AxisSettings {
    /// Key and values of each axis: those that every database has, then the optional ones.
    pub(super) lists: Vec<(&'static str, Vec<f64>)>,
    pub(crate) diffuse: bool,
}

/// The axes in any order and spelling.
#[derive(Deserialize)]
struct UnorderedAxes {
    #[serde(default)]
    diffuse: bool,
    #[serde(flatten)]
    lists: BTreeMap<String, Vec<f64>>,
}

impl AxisSettings {
    pub(super) fn new(axes: &Axes, given: Option<&SizeAxis>, diffuse: bool) -> Self {
        let list = |parameter: Parameter| match given {
            // the measure by which sizes are given determines the sizes
            Some(given) if parameter == Parameter::GrainSize => {
                (given.measure.name(), given.values.clone())
            }
            _ => (parameter.key(), axes.values(parameter).to_vec()),
        };
        let parameters = canonical_order().filter(|parameter| axes.has(*parameter));
        Self {
            lists: parameters.map(list).collect(),
            diffuse,
        }
    }
}

/// The parameters that every database has, then the optional ones.
fn canonical_order() -> impl Iterator<Item = Parameter> {
    let optional = Parameter::ALL.into_iter().filter(|p| p.is_optional());
    Parameter::CORE.into_iter().chain(optional)
}

impl TryFrom<UnorderedAxes> for AxisSettings {
    type Error = String;

    fn try_from(UnorderedAxes { diffuse, mut lists }: UnorderedAxes) -> Result<Self, String> {
        let mut ordered = Vec::new();
        for parameter in canonical_order() {
            let measures: &[SizeMeasure] = match parameter {
                Parameter::GrainSize => &SizeMeasure::ALL,
                _ => &[],
            };
            // in version 0.1, the key of an axis was its name in files
            let keys = [
                (parameter.key(), parameter.key()),
                (parameter.name(), parameter.key()),
            ];
            let measures = measures
                .iter()
                .map(|measure| (measure.name(), measure.name()));
            let mut keys = measures.chain(keys);
            match keys.find_map(|(stored, key)| Some((key, lists.remove(stored)?))) {
                Some(list) => ordered.push(list),
                None if parameter.is_optional() => {}
                None => return Err(format!("missing field `{}`", parameter.key())),
            }
        }
        Ok(Self {
            lists: ordered,
            diffuse,
        })
    }
}

impl Serialize for AxisSettings {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (key, values) in &self.lists {
            map.serialize_entry(key, values)?;
        }
        if self.diffuse {
            map.serialize_entry("diffuse", &true)?;
        }
        map.end()
    }
}

/// Widths of the distributions around an axis value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct SpreadSettings {
    pub(crate) facetness_half_width: f64,
    pub(crate) facetness_sd: f64,
    pub(crate) grain_size_half_width_um: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) sphericity_half_width: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) sphericity_sd: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct WavelengthSettings {
    pub(crate) values_nm: Vec<f64>,
}

/// Properties that all curves share, by config key. The keys that an axis replaces
/// ([`crate::parameter::Record::fixed`]) are left out.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Map<String, Value>")]
pub(crate) struct FixedSettings(pub(super) Map<String, Value>);

impl FixedSettings {
    pub(super) fn new(properties: &Properties, axes: &Axes) -> Self {
        let mut properties = serde_json::to_value(properties).unwrap_or_default();
        let parameters = Parameter::ALL.into_iter().filter(|p| axes.has(*p));
        for key in parameters.flat_map(|parameter| parameter.record().fixed) {
            remove(&mut properties, key.trim_start_matches("fixed."));
        }
        match properties {
            Value::Object(properties) => Self(properties),
            _ => Self::default(),
        }
    }
}

/// Removes the value at a path such as `black_carbon.concentration_ng_g`; `absorber[0]` is the
/// first entry of a list.
fn remove(value: &mut Value, path: &str) {
    let Some(table) = value.as_object_mut() else {
        return;
    };
    match path.split_once('.') {
        Some((key, rest)) => {
            let inner = match key.strip_suffix("[0]") {
                Some(list) => table.get_mut(list).and_then(|list| list.get_mut(0)),
                None => table.get_mut(key),
            };
            if let Some(inner) = inner {
                remove(inner, rest);
            }
        }
        // the order of the keys that stay is part of the canonical text
        None => drop(table.shift_remove(path)),
    }
}

impl TryFrom<Map<String, Value>> for FixedSettings {
    type Error = serde_json::Error;

    /// In any order; what is missing is replaced by an axis, or unknown to the version that
    /// wrote the file.
    fn try_from(given: Map<String, Value>) -> Result<Self, Self::Error> {
        let properties: Properties = serde_json::from_value(Value::Object(given.clone()))?;
        let mut ordered = serde_json::to_value(properties)?;
        keep(&mut ordered, &given);
        Ok(Self(ordered.as_object().cloned().unwrap_or_default()))
    }
}

/// Removes the keys that `given` does not have.
fn keep(value: &mut Value, given: &Map<String, Value>) {
    if let Some(table) = value.as_object_mut() {
        table.retain(|key, _| given.contains_key(key));
        for (key, inner) in table {
            if let Some(given) = given.get(key).and_then(Value::as_object) {
                keep(inner, given);
            }
        }
    }
}

/// Properties of the snow and what is under it, in the order of the canonical text.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Properties {
    /// Left out for spheroids, as in databases from before this key existed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) shape: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) sphericity: Option<LawSettings>,
    /// Of prisms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) aspect_ratio: Option<LawSettings>,
    pub(crate) temperature_c: f64,
    pub(crate) water_saturation: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) black_carbon: Option<CarbonSettings>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) brown_carbon: Option<CarbonSettings>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) absorber: Vec<AbsorberSettings>,
    /// Layers under the surface layer, from the base up.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) below: Vec<BelowSettings>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) substrate: Option<SubstrateSettings>,
}

/// A truncated normal distribution.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct LawSettings {
    pub(crate) min: f64,
    pub(crate) max: f64,
    pub(crate) mean: f64,
    pub(crate) sd: f64,
}

/// Any key may be missing: an axis may replace it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct CarbonSettings {
    pub(crate) concentration_ng_g: f64,
    pub(crate) sedimentation: f64,
    pub(crate) mass_absorption_efficiency_m2_g: f64,
    pub(crate) reference_wavelength_nm: f64,
    pub(crate) angstrom_exponent: f64,
    pub(crate) concentration_per: String,
}

/// A light-absorbing substance other than carbon.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct AbsorberSettings {
    pub(crate) name: String,
    /// Left out if an axis gives it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) concentration_ng_g: Option<f64>,
    pub(crate) sedimentation: f64,
    pub(crate) mass_absorption_efficiency_m2_g: EfficiencySettings,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) reference_wavelength_nm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) angstrom_exponent: Option<f64>,
    pub(crate) concentration_per: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) mass_scattering_efficiency_m2_g: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) asymmetry_parameter: Option<f64>,
}

/// A mass absorption efficiency: at the reference wavelength, or one per wavelength.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub(crate) enum EfficiencySettings {
    Power(f64),
    Spectrum(Vec<f64>),
}

/// A layer under the surface layer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct BelowSettings {
    pub(crate) thickness_cm: f64,
    pub(crate) density_kg_m3: f64,
    pub(crate) temperature_c: f64,
    pub(crate) water_saturation: f64,
    pub(crate) grain: Vec<GrainSettings>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) black_carbon: Option<CarbonSettings>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) brown_carbon: Option<CarbonSettings>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) absorber: Vec<AbsorberSettings>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct GrainSettings {
    pub(crate) fraction: f64,
    pub(crate) size_um: SizeSettings,
    pub(crate) facetness: LawSettings,
    /// As in [`Properties`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) shape: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) sphericity: Option<LawSettings>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) aspect_ratio: Option<LawSettings>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct SizeSettings {
    pub(crate) min: f64,
    pub(crate) max: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct SubstrateSettings {
    pub(crate) reflectance: Reflectance,
}

/// The reflectance of a substrate: one for all wavelengths, or one per wavelength.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub(crate) enum Reflectance {
    Grey(f64),
    Spectrum(Vec<f64>),
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct RunSettings {
    #[serde(serialize_with = "engine_name", deserialize_with = "engine_named")]
    pub(crate) engine: Engine,
    pub(crate) seed: u64,
    pub(crate) rays: u64,
    /// Only with axes of a view.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) view_rays: Option<u64>,
    /// Only with the engine `auto`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) max_error: Option<ErrorSettings>,
}

/// Largest error of a curve that the engine may leave.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ErrorSettings {
    pub(crate) delta_e: f64,
    pub(crate) rmse: f64,
}

/// Names of the model options.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ModelSettings {
    pub(crate) entry: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) facets: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) size_law: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) layers: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) carbon_law: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) impurity_mass: Option<String>,
    pub(crate) ice: String,
    pub(crate) water: String,
}

fn engine_name<S: Serializer>(engine: &Engine, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(engine.name())
}

fn engine_named<'de, D: Deserializer<'de>>(from: D) -> Result<Engine, D::Error> {
    let name = String::deserialize(from)?;
    Engine::named(&name).ok_or_else(|| D::Error::custom(format!("unknown engine {name:?}")))
}
