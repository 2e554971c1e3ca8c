//! The keys of axes, made from their records ([`crate::parameter`]).
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
    /// Takes the values of an axis by its key.
    pub(super) fn take(&mut self, key: &str) -> Option<Vec<f64>> {
        let values = self.lists.remove(key)?;
        Some(values.into_iter().map(NumberOrInf::number).collect())
    }

    /// The values of an axis by its key.
    pub(super) fn values(&self, key: &str) -> Vec<f64> {
        let values = self.lists.get(key).into_iter().flatten();
        values.map(|value| value.clone().number()).collect()
    }
}

/// One kind of snow, or a box of kinds: numbers or ranges.
#[derive(Deserialize)]
pub(super) struct SnowKeys(BTreeMap<String, RangeKeys>);

impl SnowKeys {
    /// What it says of each parameter, those that every database has first.
    pub(super) fn iter(&self) -> impl Iterator<Item = (Parameter, RangeKeys)> + '_ {
        let of_snow = |p: &Parameter| p.record().role == Role::Snow;
        let all = Parameter::ALL.into_iter().filter(of_snow);
        let (optional, core): (Vec<_>, Vec<_>) = all.partition(|p| p.is_optional());
        let all = core.into_iter().chain(optional);
        all.filter_map(|parameter| Some((parameter, *self.0.get(parameter.key())?)))
    }
}

/// Adds the keywords of an interval.
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

/// What a parameter is, with unit and ordinary range.
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

/// Where else a parameter that is no axis gets its value from.
fn instead(parameter: Parameter) -> String {
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
            let mut text = about(parameter) + &instead(parameter);
            let items = match parameter {
                Parameter::Thickness => {
                    let mut items = Schema::default();
                    or_half_space(&mut items);
                    text += ". Curves of grains of which 10 lengths do not fit are NaN. `inf` is a half space";
                    items.to_value()
                }
                _ => numbers(record.allowed),
            };
            if parameter == Parameter::GrainSize {
                text += "; required unless one of the next two is given";
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
            "description": "Whether curves under isotropic light are computed beside those of all angles; with the engines hybrid and auto.",
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

/// The key of a measure that grain sizes may be given by.
fn measure(measure: SizeMeasure) -> (String, Value) {
    let (what, unit) = measure.about();
    let most = match measure {
        SizeMeasure::OpticalRadius => MAX_OPTICAL_RADIUS_UM,
        SizeMeasure::SpecificSurface => MAX_SSA_M2_KG,
    };
    let (first, rest) = what.split_at(1);
    let text = format!(
        "{}{rest}, {unit}, instead of {}: each gives a mean grain size.",
        first.to_uppercase(),
        Parameter::GrainSize.key()
    );
    let allowed = Interval {
        min: 0.0,
        max: most,
        open: [true, false],
    };
    (measure.name().to_owned(), list(text, numbers(allowed)))
}

impl JsonSchema for SnowKeys {
    fn schema_name() -> Cow<'static, str> {
        "Snow".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let of_snow = |p: &Parameter| p.record().role == Role::Snow;
        let all = Parameter::ALL.into_iter().filter(of_snow);
        let (optional, core): (Vec<_>, Vec<_>) = all.partition(|p| p.is_optional());
        let mut properties = Map::new();
        for &parameter in core.iter().chain(&optional) {
            let text = format!(
                "{}: a number or a range{}.",
                about(parameter),
                instead(parameter)
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
            "description": "One kind of snow, or a box of kinds.",
            "type": "object",
            "properties": properties,
            "additionalProperties": false,
            "required": core.iter().map(|p| p.key()).collect::<Vec<_>>(),
        })
    }
}
