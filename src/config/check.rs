//! Checks a TOML document against the JSON Schema of its kind, so that an editor and
//! the program report the same errors.
//!
//! Only these schema keywords are evaluated: `type`, `enum`, limits of numbers and
//! lists, `properties`, `required`, and `additionalProperties` if it is true. Rules that
//! a schema cannot express well are checked in [`super::sample`], [`super::grid`] and
//! [`super::scene`].
use serde_json::Value;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::document::{Document, KeySpan, shorten};
use super::error::{ConfigError, Problem};

/// The choice most similar to `given`, if it is similar enough for `given` to be a
/// typing error.
pub(super) fn nearest<'c>(given: &str, choices: impl Iterator<Item = &'c str>) -> Option<String> {
    choices
        .map(|choice| (strsim::levenshtein(&given.to_lowercase(), choice), choice))
        .filter(|&(distance, choice)| distance <= 1 + choice.len() / 4)
        .min()
        .map(|(_, choice)| choice.to_owned())
}

/// Checks the keys of a table in the order of the file, then looks for missing keys.
pub(super) fn table(
    document: &mut Document<'_>,
    schema: &Value,
    path: &str,
    table: &DeTable<'_>,
) -> Result<(), ConfigError> {
    let join = |key: &str| match path {
        "" => key.to_owned(),
        _ => format!("{path}.{key}"),
    };
    let empty = serde_json::Map::new();
    let known = schema["properties"].as_object().unwrap_or(&empty);
    let mut entries: Vec<_> = table.iter().collect();
    entries.sort_by_key(|(key, _)| key.span().start);
    for (key, node) in entries {
        let path = join(&bare(key.get_ref()));
        document
            .spans
            .insert(path.clone(), key_span(key.span(), node));
        let Some(schema) = known.get(key.get_ref().as_ref()) else {
            if schema["additionalProperties"] == true {
                continue;
            }
            let suggestion = nearest(key.get_ref(), known.keys().map(String::as_str));
            let keys: Vec<_> = known.keys().map(String::as_str).collect();
            let help = format!(
                "rename or remove it: the keys allowed here are {}",
                keys.join(", ")
            );
            return Err(document.error(&path, Problem::UnknownKey(suggestion), help));
        };
        value(document, schema, &path, node)?;
    }
    for key in schema["required"].as_array().into_iter().flatten() {
        let key = key.as_str().unwrap_or_default();
        if !table.contains_key(key) {
            let help = schema["properties"][key]["description"].as_str();
            let help = format!("add it: {}", help.unwrap_or_default());
            return Err(document.error(&join(key), Problem::Missing, help));
        }
    }
    Ok(())
}

fn value(
    document: &mut Document<'_>,
    schema: &Value,
    path: &str,
    node: &Spanned<DeValue<'_>>,
) -> Result<(), ConfigError> {
    let help = schema["description"].as_str().unwrap_or_default();
    let (found, fits): (_, &[&str]) = match node.get_ref() {
        DeValue::String(_) => ("a string", &["string"]),
        DeValue::Integer(_) => ("an integer", &["integer", "number"]),
        DeValue::Float(_) => ("a floating-point number", &["number"]),
        DeValue::Boolean(_) => ("a boolean", &["boolean"]),
        DeValue::Datetime(_) => ("a date", &[]),
        DeValue::Array(_) => ("a list", &["array"]),
        DeValue::Table(_) => ("a table", &["object"]),
    };
    let types = match &schema["type"] {
        Value::Array(types) => types.iter().filter_map(Value::as_str).collect(),
        single => single.as_str().into_iter().collect::<Vec<_>>(),
    };
    if !fits.iter().any(|fit| types.contains(fit)) {
        let problem = Problem::WrongType {
            found,
            expected: expected(schema, path, &types),
        };
        return Err(document.error(path, problem, change(help)));
    }
    match node.get_ref() {
        DeValue::Integer(n) => {
            let n = i128::from_str_radix(n.as_str(), n.radix()).map_or(f64::NAN, |n| n as f64);
            number(document, schema, path, n)
        }
        DeValue::Float(x) => number(
            document,
            schema,
            path,
            x.as_str().parse().unwrap_or(f64::NAN),
        ),
        DeValue::String(given) => match schema["enum"].as_array() {
            Some(choices) => {
                let choices: Vec<_> = choices.iter().filter_map(Value::as_str).collect();
                choice(document, path, given, &choices, &change(help))
            }
            None => constant(document, schema, path, given),
        },
        DeValue::Array(items) => {
            let min = schema["minItems"].as_u64().unwrap_or(0);
            let max = schema["maxItems"].as_u64().unwrap_or(u64::MAX);
            let length = items.len() as u64;
            if !(min..=max).contains(&length) {
                let problem = Problem::OutOfRange(format!("{min} to {max} entries"));
                let help = format!("{} The list has {length} entries.", change(help));
                return Err(document.error(path, problem, help));
            }
            // Entries without a description of their own get that of the list.
            let mut item_schema = schema["items"].clone();
            if let Some(keywords) = item_schema.as_object_mut() {
                keywords.entry("description").or_insert_with(|| help.into());
            }
            items.iter().enumerate().try_for_each(|(i, item)| {
                let path = format!("{path}[{i}]");
                let span = key_span(item.span(), item);
                document.spans.insert(path.clone(), span);
                value(document, &item_schema, &path, item)
            })
        }
        DeValue::Table(entries) => table(document, schema, path, entries),
        DeValue::Boolean(_) | DeValue::Datetime(_) => Ok(()),
    }
}

/// Refuses a string other than the only one that the schema allows instead of a number.
fn constant(
    document: &Document<'_>,
    schema: &Value,
    path: &str,
    given: &str,
) -> Result<(), ConfigError> {
    let branches = schema["anyOf"].as_array();
    let constant =
        branches.and_then(|list| list.iter().find_map(|branch| branch["const"].as_str()));
    match constant {
        Some(constant) if constant != given => {
            let help = schema["description"].as_str().unwrap_or_default();
            let problem = Problem::OutOfRange(format!("a number, or {constant:?}"));
            Err(document.error(path, problem, change(help)))
        }
        _ => Ok(()),
    }
}

fn number(document: &Document<'_>, schema: &Value, path: &str, x: f64) -> Result<(), ConfigError> {
    // one number above the range, and infinity, may stand for a half space
    let special = schema["anyOf"][1]["const"].as_f64();
    if special.is_some_and(|special| x == special || x == f64::INFINITY) {
        return Ok(());
    }
    let limit = |keyword: &str| {
        let limits = [&schema[keyword], &schema["anyOf"][0][keyword]];
        limits.into_iter().find_map(Value::as_f64)
    };
    let inside = x.is_finite()
        && limit("minimum").is_none_or(|min| x >= min)
        && limit("exclusiveMinimum").is_none_or(|min| x > min)
        && limit("maximum").is_none_or(|max| x <= max)
        && limit("exclusiveMaximum").is_none_or(|max| x < max);
    if inside {
        return Ok(());
    }
    let clause = |keyword: &str, words: &str| limit(keyword).map(|x| format!("{words} {x}"));
    let allowed = match (limit("minimum"), limit("maximum")) {
        (Some(min), Some(max)) if min == max => min.to_string(),
        (Some(min), Some(max)) => format!("{min} to {max}"),
        _ => {
            let limits = [
                clause("minimum", "at least"),
                clause("exclusiveMinimum", "above"),
                clause("maximum", "at most"),
                clause("exclusiveMaximum", "below"),
            ];
            limits.into_iter().flatten().collect::<Vec<_>>().join(", ")
        }
    };
    let allowed = match special {
        Some(_) => format!("{allowed}, or inf"),
        None => allowed,
    };
    let help = schema["description"].as_str().unwrap_or_default();
    let problem = Problem::OutOfRange(allowed);
    Err(document.error(path, problem, change(help)))
}

/// The help for a value that is not allowed, from the description of its key.
fn change(description: &str) -> String {
    format!("change it: {description}")
}

/// Refuses `given` unless it is one of the `choices`.
pub(super) fn choice(
    document: &Document<'_>,
    path: &str,
    given: &str,
    choices: &[&str],
    help: &str,
) -> Result<(), ConfigError> {
    if choices.contains(&given) {
        return Ok(());
    }
    let problem = Problem::Choice {
        suggestion: nearest(given, choices.iter().copied()),
        choices: choices.join(", "),
    };
    Err(document.error(path, problem, help))
}

fn expected(schema: &Value, path: &str, types: &[&str]) -> String {
    let name = |&kind: &&str| match kind {
        "string" => "a string".to_owned(),
        "integer" => "an integer".to_owned(),
        "number" => "a number".to_owned(),
        "boolean" => "true or false".to_owned(),
        "array" if schema["items"]["type"] == "object" => {
            let header = path.replace("[0]", "");
            format!("a list of tables: write [[{header}]]")
        }
        "array" => "a list in [ ]".to_owned(),
        // A key that takes a number or a table takes a range.
        "object" if types.contains(&"number") => "a range { min, max }".to_owned(),
        _ => "a table".to_owned(),
    };
    types.iter().map(name).collect::<Vec<_>>().join(" or ")
}

fn key_span(key: std::ops::Range<usize>, node: &Spanned<DeValue<'_>>) -> KeySpan {
    KeySpan {
        key,
        value: node.span(),
        quotable: !matches!(node.get_ref(), DeValue::Table(_) | DeValue::Array(_)),
    }
}

/// A key as written in a dotted path: quoted where TOML requires it.
fn bare(key: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !key.is_empty() && key.chars().all(plain) {
        key.to_owned()
    } else {
        format!("{:?}", shorten(key))
    }
}
