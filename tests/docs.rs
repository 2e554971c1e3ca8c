//! The tables of keys in `docs/formats.md` agree with the schemas, and therefore with the
//! program. `UPDATE_GOLDEN=1 cargo test --release --test pipeline docs::` rewrites them.
#![allow(clippy::unwrap_used)]
use std::fmt::Write;
use std::path::Path;

use serde_json::{Map, Value};
use splitsnow::config::schema;
use splitsnow::parameter::{Parameter, Scale};

/// Writes a row for each key below `node`.
fn write_rows(out: &mut String, node: &Value, path: &str) {
    let empty = Map::new();
    let keys = node["properties"].as_object().unwrap_or(&empty);
    let required = node["required"].as_array().cloned().unwrap_or_default();
    for (key, node) in keys {
        let path = match path {
            "" => key.clone(),
            _ => format!("{path}.{key}"),
        };
        let (name, inner) = if node["items"]["type"] == "object" {
            (format!("[[{path}]]"), &node["items"])
        } else if node["type"] == "object" {
            (format!("[{path}]"), node)
        } else {
            (path.clone(), &Value::Null)
        };
        let default = match &node["default"] {
            _ if required.contains(&key.as_str().into()) => "required".to_owned(),
            Value::Null => String::new(),
            value => literal(value),
        };
        let meaning = node["description"].as_str().unwrap_or_default();
        let meaning = meaning.replace('\n', " ");
        let allowed = allowed(node);
        writeln!(out, "| `{name}` | {allowed} | {default} | {meaning} |").unwrap();
        write_rows(out, inner, &path);
    }
}

/// The values that a key may have.
fn allowed(node: &Value) -> String {
    if let Some(max) = node["anyOf"][0]["maximum"].as_f64() {
        let min = node["exclusiveMinimum"].as_f64().unwrap();
        return format!("({}, {}], or inf", number(min), number(max));
    }
    let choices = match &node["enum"] {
        Value::Null => &node["anyOf"][0]["enum"],
        choices => choices,
    };
    if let Some(choices) = choices.as_array() {
        let mut words: Vec<_> = choices.iter().map(literal).collect();
        if node["anyOf"].is_array() {
            words.push("a path ending in .csv".to_owned());
        }
        return words.join(", ");
    }
    if let Some(names) = node["examples"].as_array() {
        let names: Vec<_> = names.iter().map(literal).collect();
        return format!("{}, or a path", names.join(", "));
    }
    if node["type"] == "array" {
        let min = node["minItems"].as_u64().unwrap_or(0);
        let count = format!("{min} to {}", node["maxItems"]);
        return match node["items"]["type"].as_str() {
            Some("object") => format!("{count} of them"),
            _ => format!("list of {count}, each {}", allowed(&node["items"])),
        };
    }
    let bounds = [
        ("minimum", "["),
        ("exclusiveMinimum", "("),
        ("maximum", "]"),
        ("exclusiveMaximum", ")"),
    ];
    let mut found = bounds
        .iter()
        .filter_map(|(keyword, bracket)| Some((number(node[keyword].as_f64()?), bracket)));
    let kind = match &node["properties"]["min"]["type"] {
        Value::Null => &node["type"],
        number => number,
    };
    match (kind.as_str(), found.next(), found.next()) {
        (Some("boolean"), ..) => "true, false".to_owned(),
        (kind, Some((low, open)), Some((high, close))) => {
            let range = if low == high {
                low
            } else {
                format!("{open}{low}, {high}{close}")
            };
            match kind {
                Some("integer") => format!("integer, {range}"),
                Some(_) => range,
                None => {
                    let types = node["type"].as_array();
                    let is_path = types.is_some_and(|types| types.contains(&"string".into()));
                    let path = if is_path { ", a path" } else { "" };
                    let longest = &node["maxItems"];
                    format!("{range}{path}, or a list of 1 to {longest}, each {range}")
                }
            }
        }
        _ => String::new(),
    }
}

fn literal(value: &Value) -> String {
    match value {
        Value::String(_) | Value::Array(_) => format!("`{value}`"),
        value => value.as_f64().map_or_else(|| value.to_string(), number),
    }
}

fn number(value: f64) -> String {
    if value.abs() < 1e6 || value > 1e15 {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

/// Asserts that a page in `docs` equals `text`, or writes it if `UPDATE_GOLDEN` is set.
pub(crate) fn keep(name: &str, text: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("docs")
        .join(name);
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        return std::fs::write(&path, text).unwrap();
    }
    let before = std::fs::read_to_string(&path).unwrap();
    let differs = before
        .lines()
        .zip(text.lines())
        .find(|(old, new)| old != new);
    assert!(
        before == text,
        "docs/{name} is out of date: run with UPDATE_GOLDEN=1 and review the diff; first difference: {differs:?}"
    );
}

#[test]
fn tables_of_keys_are_current() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/formats.md");
    let mut after = std::fs::read_to_string(&path).unwrap();
    for (name, schema) in [
        ("sample", schema::sample()),
        ("grid", schema::grid()),
        ("scene", schema::scene()),
        ("study", schema::study()),
    ] {
        let schema: Value = serde_json::from_str(&schema).unwrap();
        let mut table = "| key | allowed | default | meaning |\n|---|---|---|---|\n".to_owned();
        write_rows(&mut table, &schema, "");
        let (begin, end) = (format!("<!-- keys of {name} -->\n"), "<!-- end -->");
        let (head, rest) = after.split_once(&begin).unwrap();
        let (_, tail) = rest.split_once(end).unwrap();
        after = format!("{head}{begin}{table}{end}{tail}");
    }
    keep("formats.md", &after);
}

/// No dependency requires a newer compiler than `rust-version`.
#[test]
fn the_minimum_rust_version_suffices_for_all_dependencies() {
    let output = std::process::Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap().iter();
    let version = |text: &str| -> Vec<u32> {
        text.split('.')
            .map(|number| number.parse().unwrap())
            .collect()
    };
    let minimum = version(env!("CARGO_PKG_RUST_VERSION"));
    for package in packages {
        if let Some(text) = package["rust_version"].as_str() {
            assert!(
                version(text)[..2] <= minimum[..2],
                "{} needs {text}",
                package["name"]
            );
        }
    }
}

fn coordinate(scale: Scale) -> String {
    match scale {
        Scale::Linear => "x".to_owned(),
        Scale::Log => "ln x".to_owned(),
        Scale::Shifted(s) => format!("ln(1 + x / {s})"),
        Scale::Root(s) => format!("sqrt(x + {s})"),
        Scale::Complement(s) => format!("-ln(1 - {s} x)"),
        Scale::Saturating(s) => format!("-exp(-x / {s})"),
        Scale::Grazing([a, s]) => format!("{a} exp(-cos x / {s}) - cos x"),
    }
}

#[test]
fn the_table_of_parameters_is_current() {
    let page =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/formats.md"))
            .unwrap();
    let mut table = String::from(
        "| name | symbol | unit | | in files | in configs | ordinary | coordinate |\n|---|---|---|---|---|---|---|---|\n",
    );
    for parameter in Parameter::ALL {
        let record = parameter.record();
        let optional = if record.optional { " (optional)" } else { "" };
        writeln!(
            table,
            "| `{}` | {} | {} | {}{optional} | {} | {} | {} | {} |",
            record.name,
            record.symbol,
            record.unit,
            record.long_name,
            record.physical,
            record.allowed,
            record.ordinary,
            coordinate(record.scale)
        )
        .unwrap();
    }
    let (begin, end) = ("<!-- parameters -->\n", "<!-- end -->");
    let table_start = page.find(begin).unwrap() + begin.len();
    let table_end = table_start + page[table_start..].find(end).unwrap();
    let expected = format!("{}{table}{}", &page[..table_start], &page[table_end..]);
    keep("formats.md", &expected);
}
