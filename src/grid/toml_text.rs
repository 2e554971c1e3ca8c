//! Values as canonical TOML on one line: equal values give equal bytes.
use serde::Serialize;
use serde_json::{Map, Value};

/// A value as TOML: a table is an inline table with its keys in the order of its fields.
pub(crate) fn toml_text<T: Serialize + ?Sized>(value: &T) -> String {
    text(&serde_json::to_value(value).unwrap_or_default())
}

/// The keys of a table in the order of its fields, each with its value as TOML.
pub(crate) fn toml_entries<T: Serialize>(table: &T) -> Vec<(String, String)> {
    let value = serde_json::to_value(table).unwrap_or_default();
    let fields = value.as_object().into_iter().flatten();
    fields
        .map(|(key, value)| (key.clone(), text(value)))
        .collect()
}

fn text(value: &Value) -> String {
    match value {
        // JSON has no numbers that are not finite
        Value::Null => "nan".to_owned(),
        Value::Number(number) if number.is_f64() => float(number.as_f64().unwrap_or(f64::NAN)),
        Value::Bool(_) | Value::Number(_) => value.to_string(),
        Value::String(text) => toml::Value::from(text.as_str()).to_string(),
        Value::Array(items) => {
            let items: Vec<_> = items.iter().map(text).collect();
            format!("[{}]", items.join(", "))
        }
        Value::Object(table) => inline(table),
    }
}

fn inline(table: &Map<String, Value>) -> String {
    let line = |(key, value): (&String, &Value)| format!("{key} = {}", text(value));
    let lines: Vec<_> = table.iter().map(line).collect();
    format!("{{ {} }}", lines.join(", "))
}

/// The shortest decimal that reads back as the same number; -0 becomes 0.
fn float(value: f64) -> String {
    format!("{:?}", value + 0.0)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn numbers_are_as_short_as_they_can_be() {
        let numbers = [-0.0, 1.0, 0.1, 1e-7, 1e16, 1e15, -2.5];
        assert_eq!(
            toml_text(&numbers),
            "[0.0, 1.0, 0.1, 1e-7, 1e16, 1000000000000000.0, -2.5]"
        );
        assert_eq!(toml_text(&u64::MAX), "18446744073709551615");
    }

    #[test]
    fn tables_keep_the_order_of_their_fields() {
        let table = json!({ "b": 1.0, "a": { "z": "text", "y": true } });
        assert_eq!(
            toml_text(&table),
            "{ b = 1.0, a = { z = \"text\", y = true } }"
        );
        let [b, a] = &toml_entries(&table)[..] else {
            panic!("two keys");
        };
        assert_eq!([&b.0, &a.0], ["b", "a"]);
    }
}
