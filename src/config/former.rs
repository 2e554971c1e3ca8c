//! Keys and values of config files by their names in version 0.1: still read, but
//! in no schema and no help.
use std::borrow::Cow;

use serde::Deserialize;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::engine::Engine;

/// Table, former key, and key.
const KEYS: [[&str; 3]; 3] = [
    ["axes", "angle_deg", "incidence_angle_deg"],
    ["illumination", "polar_angle_deg", "incidence_angle_deg"],
    ["scene", "angle_deg", "incidence_angle_deg"],
];

/// The path of a key by its present name.
pub(super) fn path(path: &str) -> Cow<'_, str> {
    let renamed = KEYS.iter().find_map(|[table, former, key]| {
        let before = path.strip_suffix(former)?;
        before
            .ends_with(&format!("{table}."))
            .then(|| before.to_owned() + key)
    });
    renamed.map_or(path.into(), Cow::from)
}

/// The table that `text` holds, if it is TOML.
pub(super) fn parsed(text: &str) -> Result<toml::Table, toml::de::Error> {
    let mut root = DeTable::parse(text)?;
    rename("", root.get_mut());
    toml::Table::deserialize(toml::Deserializer::from(root))
}

/// Gives what `table`, which is named `name`, and all tables in it hold their present
/// names. A key that is there by both names is left for the schema to refuse.
pub(super) fn rename(name: &str, table: &mut DeTable<'_>) {
    for [_, former, key] in KEYS.iter().filter(|[of, ..]| *of == name) {
        if table.contains_key(*key) {
            continue;
        }
        let mut keys = table.keys();
        let Some(span) = keys.find(|k| k.get_ref() == former).map(Spanned::span) else {
            continue;
        };
        if let Some(value) = table.remove(*former) {
            table.insert(Spanned::new(span, (*key).into()), value);
        }
    }
    for (key, node) in table.iter_mut() {
        match node.get_mut() {
            DeValue::Table(inner) => rename(key.get_ref(), inner),
            DeValue::Array(items) => {
                for item in items.iter_mut() {
                    if let DeValue::Table(inner) = item.get_mut() {
                        rename(key.get_ref(), inner);
                    }
                }
            }
            DeValue::String(text) if name == "run" && key.get_ref() == "engine" => {
                let mut all = Engine::ALIASES.into_iter();
                if let Some((_, engine)) = all.find(|(former, _)| former == text) {
                    *text = engine.name().into();
                }
            }
            _ => {}
        }
    }
}
