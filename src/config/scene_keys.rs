//! The keys of scene files; see [`super::keys`] for those of sample and grid files.
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde_json::Value;

use crate::colour::{ColourDifference, IlluminantSpec};
use crate::measurement::Quantity;

use super::axis_keys::SnowKeys;
use super::keys::{
    FixedKeys, MAX_INTEGER, ModelKeys, SpreadKeys, WavelengthKeys, default_delta_e,
    default_illuminants, default_seed, illuminants, limit_items,
};

/// The snow that a renderer needs in a scene, and the accuracy that it needs.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "SPLITSnow scene file")]
pub(super) struct SceneKeys {
    /// Version of the file format; must be 1.
    #[schemars(range(min = 1, max = 1))]
    #[serde(rename = "version")]
    pub(super) _version: u32,
    pub(super) scene: RequirementKeys,
    /// Kinds of snow in the scene; each is needed at every thickness and incidence angle.
    #[schemars(length(min = 1, max = 100))]
    pub(super) snow: Vec<SnowKeys>,
    #[serde(default)]
    pub(super) spread: SpreadKeys,
    pub(super) wavelengths: WavelengthKeys,
    #[serde(default)]
    pub(super) fixed: FixedKeys,
    #[serde(default)]
    pub(super) model: ModelKeys,
    #[serde(default)]
    pub(super) run: SceneRunKeys,
}

/// What the scene requires: accuracy, quantities, thicknesses and incidence angles.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RequirementKeys {
    /// Largest colour difference Delta-E of the whole pipeline (simulation, compression
    /// and look-up), compared with an independent converged simulation.
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub(super) max_delta_e: f64,
    /// Quantities that the renderer needs.
    #[schemars(length(min = 1, max = Quantity::ALL.len()), extend("uniqueItems" = true),
        transform = quantity_names)]
    #[serde(default = "default_quantities")]
    pub(super) quantities: Vec<String>,
    #[schemars(schema_with = "illuminants")]
    #[serde(default = "default_illuminants")]
    pub(super) illuminants: Vec<IlluminantSpec>,
    /// Formula of the colour difference.
    #[schemars(extend("enum" = ColourDifference::ALL.map(ColourDifference::name)))]
    #[serde(default = "default_delta_e")]
    pub(super) delta_e: String,
    /// Largest size of the compact file, bytes; unlimited by default.
    #[schemars(range(min = 1, max = MAX_INTEGER))]
    pub(super) max_bytes: Option<u64>,
    /// Longest time for making the compact file, seconds; unlimited by default.
    #[schemars(range(max = 1e9), extend("exclusiveMinimum" = 0.0))]
    pub(super) max_seconds: Option<f64>,
    /// Thickness of the snowpack, cm: a number or a range; ordinarily 1 to 100. It must
    /// be at least 10 times the length of the largest grain.
    #[schemars(range(max = 1000.0), extend("exclusiveMinimum" = 0.0), transform = limit_ends)]
    pub(super) thickness_cm: RangeKeys,
    /// Incidence angle of a collimated beam, measured from the surface normal, degrees:
    /// a number or a range in [0, 90).
    #[schemars(range(min = 0.0), extend("exclusiveMaximum" = 90.0), transform = limit_ends)]
    pub(super) incidence_angle_deg: RangeKeys,
}

/// How the spectra of the scene are simulated.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneRunKeys {
    /// Seed of the random streams.
    #[schemars(range(min = 0, max = MAX_INTEGER))]
    #[serde(default = "default_seed")]
    pub(super) seed: u64,
}

impl Default for SceneRunKeys {
    fn default() -> Self {
        Self {
            seed: default_seed(),
        }
    }
}

/// A number, or the ends of a range.
#[derive(Deserialize, Clone, Copy)]
#[serde(untagged)]
pub(super) enum RangeKeys {
    Number(f64),
    Range { min: f64, max: f64 },
}

impl JsonSchema for RangeKeys {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Range".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": ["number", "object"],
            "properties": {
                "min": { "type": "number" },
                "max": { "type": "number" },
            },
            "required": ["min", "max"],
            "additionalProperties": false,
        })
    }
}

/// Copies the limits and the description of a number to `min` and `max` of the range.
pub(super) fn limit_ends(schema: &mut Schema) {
    const SHARED: [&str; 5] = [
        "description",
        "minimum",
        "exclusiveMinimum",
        "maximum",
        "exclusiveMaximum",
    ];
    let shared = SHARED.map(|keyword| (keyword, schema.get(keyword).cloned()));
    let ends = schema.get_mut("properties").and_then(Value::as_object_mut);
    for end in ends.into_iter().flat_map(|ends| ends.values_mut()) {
        for (keyword, value) in shared.iter().cloned() {
            if let (Some(end), Some(value)) = (end.as_object_mut(), value) {
                end.insert(keyword.to_owned(), value);
            }
        }
    }
}

fn quantity_names(schema: &mut Schema) {
    limit_items(schema, "enum", Quantity::ALL.map(Quantity::name));
}

fn default_quantities() -> Vec<String> {
    Quantity::ALL
        .map(|quantity| quantity.name().to_owned())
        .into()
}
