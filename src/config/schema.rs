//! JSON Schemas (draft 2020-12) of the four kinds of config file. They are generated
//! from the lists of keys and committed under `schema/`, where editors use them for
//! completion and validation.
use std::sync::LazyLock;

use schemars::transform::RecursiveTransform;
use schemars::{JsonSchema, Schema, generate::SchemaSettings};
use serde_json::Value;

use super::keys::{GridKeys, SampleKeys};
use super::scene_keys::SceneKeys;
use super::study_keys::StudyKeys;

pub(super) static SAMPLE: LazyLock<Value> = LazyLock::new(generate::<SampleKeys>);
pub(super) static GRID: LazyLock<Value> = LazyLock::new(generate::<GridKeys>);
pub(super) static SCENE: LazyLock<Value> = LazyLock::new(generate::<SceneKeys>);
pub(super) static STUDY: LazyLock<Value> = LazyLock::new(generate::<StudyKeys>);

/// The schema of a sample file, as committed in `schema/sample.schema.json`.
#[must_use]
pub fn sample() -> String {
    // The alternate form `#` indents the JSON.
    format!("{:#}\n", *SAMPLE)
}

/// The schema of a grid file, as committed in `schema/grid.schema.json`.
#[must_use]
pub fn grid() -> String {
    format!("{:#}\n", *GRID)
}

/// The schema of a scene file, as committed in `schema/scene.schema.json`.
#[must_use]
pub fn scene() -> String {
    format!("{:#}\n", *SCENE)
}

/// The schema of a study file, as committed in `schema/study.schema.json`.
#[must_use]
pub fn study() -> String {
    format!("{:#}\n", *STUDY)
}

/// The schema of `Keys`, with all subschemas inlined.
fn generate<Keys: JsonSchema>() -> Value {
    SchemaSettings::draft2020_12()
        .with(|settings| settings.inline_subschemas = true)
        .with_transform(RecursiveTransform(plain))
        .into_generator()
        .into_root_schema_for::<Keys>()
        .to_value()
}

/// Removes what Rust types add to a schema but TOML does not have: null, and number formats.
fn plain(schema: &mut Schema) {
    let Some(keywords) = schema.as_object_mut() else {
        return;
    };
    keywords.retain(|name, value| name != "format" && !(name == "default" && value.is_null()));
    if let Some(Value::Array(types)) = keywords.get_mut("type") {
        types.retain(|kind| kind != "null");
        if let [single] = types.as_slice() {
            let single = single.clone();
            keywords.insert("type".to_owned(), single);
        }
    }
}
