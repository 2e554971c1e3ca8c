//! `about`: the version, presets and lights.
use std::collections::BTreeMap;

use crate::colour::Illuminant;
use serde::Serialize;
use serde_json::Value;

use super::refused::Refused;
use super::sample;

#[derive(Debug, Serialize)]
pub(super) struct About {
    version: &'static str,
    build: &'static str,
    threads: usize,
    illuminants: [&'static str; Illuminant::NAMES.len()],
    presets: Vec<Preset>,
}

#[derive(Debug, Serialize)]
struct Preset {
    name: &'static str,
    title: String,
    sample: Value,
    files: BTreeMap<&'static str, &'static str>,
}

/// A sample of `configs/samples` by its name.
macro_rules! preset {
    ($name:literal) => {
        (
            $name,
            include_str!(concat!("../../configs/samples/", $name, ".toml")),
        )
    };
}

/// All samples of `configs/samples`; the first is what the page begins with.
const PRESETS: [(&str, &str); 13] = [
    preset!("representative"),
    preset!("small"),
    preset!("large"),
    preset!("mixture"),
    preset!("surface"),
    preset!("basal"),
    preset!("surface_on_basal"),
    preset!("crust"),
    preset!("p18"),
    preset!("sispec_195"),
    preset!("sispec_197"),
    preset!("soot_on_grass"),
    preset!("dusty"),
];

/// The data files that samples name.
const FILES: [(&str, &str); 1] = [(
    "data/grass_made_up.csv",
    include_str!("../../configs/samples/data/grass_made_up.csv"),
)];

/// The first sentence of the comment at the begin of `text`.
fn title(text: &str) -> String {
    let comments = text.lines().skip_while(|line| line.starts_with("#:"));
    let comments = comments.map_while(|line| line.strip_prefix('#'));
    let comment = comments.map(str::trim).collect::<Vec<_>>().join(" ");
    let end = comment.find(". ").unwrap_or(comment.len());
    comment[..end].trim_end_matches('.').to_owned()
}

pub(super) fn answer(threads: usize) -> Result<About, Refused> {
    let preset = |(name, text): &(&'static str, &'static str)| {
        let is_named = |(file, _): &&(&'static str, &'static str)| text.contains(*file);
        Ok(Preset {
            name,
            title: title(text),
            sample: sample::json(text)?,
            files: FILES.iter().filter(is_named).copied().collect(),
        })
    };
    Ok(About {
        version: env!("CARGO_PKG_VERSION"),
        build: if cfg!(target_family = "wasm") {
            "wasm"
        } else {
            "native"
        },
        threads,
        illuminants: Illuminant::NAMES,
        presets: PRESETS.iter().map(preset).collect::<Result<_, Refused>>()?,
    })
}
