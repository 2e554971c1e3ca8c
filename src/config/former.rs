//! Keys and values that were renamed after version 0.1. The old names are still read,
//! but neither the schemas nor the help texts mention them.
use std::borrow::Cow;

use serde::Deserialize;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::engine::Engine;

/// Table, old key and new key.
const KEYS: [[&str; 3]; 3] = [
    ["axes", "angle_deg", "incidence_angle_deg"],
    ["illumination", "polar_angle_deg", "incidence_angle_deg"],
    ["scene", "angle_deg", "incidence_angle_deg"],
];

/// The path of a key, with the key's new name.
pub(super) fn path(path: &str) -> Cow<'_, str> {
    let renamed = KEYS.iter().find_map(|[table, former, key]| {
        let parent = path.strip_suffix(former)?;
        parent
            .ends_with(&format!("{table}."))
            .then(|| parent.to_owned() + key)
    });
    renamed.map_or(path.into(), Cow::from)
}

/// Parses `text` as TOML and renames its old keys.
///
/// # Errors
/// `text` is not valid TOML.
pub(super) fn parsed(text: &str) -> Result<toml::Table, toml::de::Error> {
    let mut root = DeTable::parse(text)?;
    rename("", root.get_mut());
    toml::Table::deserialize(toml::Deserializer::from(root))
}

/// Renames the old keys and values in `table`, which has the key `name`, and in all
/// tables inside it. If a table has both the old and the new key, the old one is kept,
/// and the check against the schema refuses it.
pub(super) fn rename(name: &str, table: &mut DeTable<'_>) {
    for [_, former, key] in KEYS.iter().filter(|[table, ..]| *table == name) {
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
                let mut aliases = Engine::ALIASES.into_iter();
                if let Some((_, engine)) = aliases.find(|(former, _)| former == text) {
                    *text = engine.name().into();
                }
            }
            _ => {}
        }
    }
}
