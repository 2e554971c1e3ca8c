//! The keys of axes, generated from the parameter records ([`crate::parameter`]).
use std::borrow::Cow;
use std::collections::BTreeMap;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::keys::{MAX_OPTICAL_RADIUS_UM, MAX_SSA_M2_KG, NumberOrInf, or_half_space};
use super::scene_keys::{RangeKeys, limit_ends};
use crate::grain::SizeMeasure;
use crate::parameter::{Interval, Parameter, Role};

/// The axes of the database, each strictly increasing.
#[derive(Deserialize)]
pub(super) struct AxesKeys {
    #[serde(default)]
    pub(super) diffuse: bool,
    #[serde(flatten)]
    lists: BTreeMap<String, Vec<NumberOrInf>>,
}

impl AxesKeys {
    /// Removes and returns the values of the axis `key`.
    pub(super) fn take(&mut self, key: &str) -> Option<Vec<f64>> {
        let values = self.lists.remove(key)?;
        Some(values.into_iter().map(NumberOrInf::number).collect())
    }

    /// The values of the axis `key`; empty if it is not in the grid.
    pub(super) fn values(&self, key: &str) -> Vec<f64> {
        let values = self.lists.get(key).into_iter().flatten();
        values.map(|value| value.clone().number()).collect()
    }
}

/// One kind of snow, or a box in parameter space: each parameter is a number or a range.
#[derive(Deserialize)]
pub(super) struct SnowKeys(BTreeMap<String, RangeKeys>);

impl SnowKeys {
    /// The parameters that are given, with their ranges; the parameters that every
    /// database has come first.
    pub(super) fn iter(&self) -> impl Iterator<Item = (Parameter, RangeKeys)> + '_ {
        let (optional, core) = snow_parameters();
        let parameters = core.into_iter().chain(optional);
        parameters.filter_map(|parameter| Some((parameter, *self.0.get(parameter.key())?)))
    }
}

/// The parameters of the snow itself: those that a database may leave out, and those
/// that every database has.
fn snow_parameters() -> (Vec<Parameter>, Vec<Parameter>) {
    let is_snow = |p: &Parameter| p.record().role == Role::Snow;
    let parameters = Parameter::ALL.into_iter().filter(is_snow);
    parameters.partition(|p| p.is_optional())
}

/// Adds the schema keywords that limit a number to `interval`.
fn limit(schema: &mut Map<String, Value>, interval: Interval) {
    let [open_min, open_max] = interval.open;
    let min = if open_min {
        "exclusiveMinimum"
    } else {
        "minimum"
    };
    let max = if open_max {
        "exclusiveMaximum"
    } else {
        "maximum"
    };
    schema.insert(min.to_owned(), interval.min.into());
    schema.insert(max.to_owned(), interval.max.into());
}

/// Description of a parameter, with its unit and ordinary range.
fn about(parameter: Parameter) -> String {
    let record = parameter.record();
    let mut words = record.long_name.chars();
    let first = words.next().map(|c| c.to_uppercase().to_string());
    let mut text = first.unwrap_or_default() + words.as_str();
    match record.unit {
        "1" => {}
        "degree" => text += ", degrees",
        unit => text += &format!(", {unit}"),
    }
    if record.ordinary != record.allowed {
        text += &format!("; ordinarily {}", record.ordinary);
    }
    text
}

/// Names the key that gives the value of a parameter if it is not an axis.
fn alternative_key(parameter: Parameter) -> String {
    match parameter.record().fixed.first() {
        Some(key) => format!(", instead of {key}"),
        None => String::new(),
    }
}

fn list(description: String, items: Value) -> Value {
    json!({
        "type": "array",
        "items": items,
        "description": description,
        "minItems": 1,
        "maxItems": 1000,
        "uniqueItems": true,
    })
}

fn numbers(interval: Interval) -> Value {
    let mut items = Map::from_iter([("type".to_owned(), "number".into())]);
    limit(&mut items, interval);
    items.into()
}

impl JsonSchema for AxesKeys {
    fn schema_name() -> Cow<'static, str> {
        "Axes".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let mut properties = Map::new();
        let axis = |parameter: Parameter| {
            let record = parameter.record();
            let mut text = about(parameter) + &alternative_key(parameter);
            let items = match parameter {
                Parameter::Thickness => {
                    let mut items = Schema::default();
                    or_half_space(&mut items);
                    text += ". Curves for which the slab is thinner than 10 lengths of the longest grain are NaN. `inf` is a half space";
                    items.to_value()
                }
                _ => numbers(record.allowed),
            };
            if parameter == Parameter::View {
                text += ". Requires relative_azimuth_deg. The light of every curve toward every view is then computed too, with run.view_rays walks per curve";
            }
            if parameter == Parameter::GrainSize {
                text += "; required unless optical_radius_um or ssa_m2_kg is given";
            }
            (record.key.to_owned(), list(text + ".", items))
        };
        for parameter in Parameter::CORE {
            properties.extend([axis(parameter)]);
            if parameter == Parameter::GrainSize {
                properties.extend(SizeMeasure::ALL.map(measure));
            }
        }
        let diffuse = json!({
            "type": "boolean",
            "description": "Whether to simulate curves under diffuse (isotropic) light in addition to those at the incidence angles; only with the engines hybrid and auto.",
            "default": false,
        });
        properties.insert("diffuse".to_owned(), diffuse);
        let optional = Parameter::ALL.into_iter().filter(|p| p.is_optional());
        properties.extend(optional.map(axis));
        let core = Parameter::CORE.into_iter();
        let required = core.filter(|p| *p != Parameter::GrainSize);
        let sizes = [Parameter::GrainSize.key()].into_iter();
        let sizes = sizes.chain(SizeMeasure::ALL.map(SizeMeasure::name));
        json_schema!({
            "description": "The axes of the database, each strictly increasing.",
            "type": "object",
            "additionalProperties": false,
            "properties": properties,
            "required": required.map(Parameter::key).collect::<Vec<_>>(),
            "oneOf": sizes.map(|name| json!({ "required": [name] })).collect::<Vec<_>>(),
        })
    }
}

/// Key and schema of an axis that gives the grain size by another measure.
fn measure(measure: SizeMeasure) -> (String, Value) {
    let (long_name, unit) = measure.about();
    let largest = match measure {
        SizeMeasure::OpticalRadius => MAX_OPTICAL_RADIUS_UM,
        SizeMeasure::SpecificSurface => MAX_SSA_M2_KG,
    };
    let (first, rest) = long_name.split_at(1);
    let text = format!(
        "{}{rest}, {unit}, instead of {}; each value determines a mean grain size.",
        first.to_uppercase(),
        Parameter::GrainSize.key()
    );
    let allowed = Interval {
        min: 0.0,
        max: largest,
        open: [true, false],
    };
    (measure.name().to_owned(), list(text, numbers(allowed)))
}

impl JsonSchema for SnowKeys {
    fn schema_name() -> Cow<'static, str> {
        "Snow".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let (optional, core) = snow_parameters();
        let mut properties = Map::new();
        for &parameter in core.iter().chain(&optional) {
            let text = format!(
                "{}: a number or a range{}.",
                about(parameter),
                alternative_key(parameter)
            );
            let mut range = RangeKeys::json_schema(generator);
            range.insert("description".to_owned(), text.into());
            if let Some(keywords) = range.as_object_mut() {
                limit(keywords, parameter.record().allowed);
            }
            limit_ends(&mut range);
            properties.insert(parameter.key().to_owned(), range.to_value());
        }
        json_schema!({
            "description": "One kind of snow, or a box in parameter space: each parameter is a number or a range.",
            "type": "object",
            "properties": properties,
            "additionalProperties": false,
            "required": core.iter().map(|p| p.key()).collect::<Vec<_>>(),
        })
    }
}
