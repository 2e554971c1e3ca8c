//! Samples: from the JSON of the page to a sample, and to its file.
use std::collections::BTreeMap;
use std::path::Path;

use crate::config::absorber;
use crate::config::sample::{self, SampleFile};
use crate::engine::Engine;
use crate::grain::specific_surface_m2_kg;
use crate::optics::ice_density_kg_m3;
use crate::simulation::Simulation;
use crate::spectrum::measured::{self, Content, ReadOptions};
use crate::transport::Snow;
use crate::units::m_to_um;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::limits::check;
use super::refused::Refused;
use super::{Limits, PageEngine};

/// Name of the sample in messages.
const NAME: &str = "the sample";

/// Text files that samples name, by the name that they give.
pub(super) type Files = BTreeMap<String, String>;

#[derive(Debug, Deserialize)]
pub(super) struct SampleRequest {
    /// As JSON, or as the text of a sample file.
    sample: Value,
    #[serde(default)]
    files: Files,
}

#[derive(Debug, Serialize)]
pub(super) struct SampleAnswer {
    sample: Value,
    toml: String,
    warnings: Vec<String>,
    notes: Vec<String>,
    layers: Vec<LayerGrains>,
    nodes: usize,
    wavelengths_nm: Vec<f64>,
}

/// The grains of a layer together.
#[derive(Debug, Serialize)]
struct LayerGrains {
    ssa_m2_kg: f64,
    optical_radius_um: f64,
}

impl SampleRequest {
    pub(super) fn answer(self, engine: &PageEngine) -> Result<SampleAnswer, Refused> {
        let sample = match self.sample {
            Value::String(text) => json(&text)?,
            sample => sample,
        };
        let (file, notes) = read(&sample, &self.files, &engine.limits)?;
        // the page lists layers from the base up
        let mut layers: Vec<LayerGrains> = file.snowpack.snows().map(grains).collect();
        layers.reverse();
        Ok(SampleAnswer {
            sample,
            toml: file.to_toml().to_owned(),
            notes,
            layers,
            nodes: index_nodes(&file)?,
            warnings: file.warnings,
            wavelengths_nm: file.wavelengths_nm,
        })
    }
}

/// Number of index nodes whose walks workers may share, fewer with few walks; 1 if the engine has
/// none to share.
fn index_nodes(file: &SampleFile) -> Result<usize, Refused> {
    let simulation = Simulation::of(file);
    match simulation.resolved() {
        Engine::Hybrid => Ok(Engine::index_nodes(&simulation.request())?),
        _ => Ok(1),
    }
}

fn grains(snow: &Snow) -> LayerGrains {
    let density = ice_density_kg_m3(snow.temperature_c);
    let surfaces = snow.grains.iter().map(|component| {
        component.fraction * specific_surface_m2_kg(&component.grain, snow.temperature_c)
    });
    let ssa_m2_kg = surfaces.sum();
    LayerGrains {
        ssa_m2_kg,
        optical_radius_um: m_to_um(3.0 / (density * ssa_m2_kg)),
    }
}

/// The text of a sample file as JSON.
pub(super) fn json(text: &str) -> Result<Value, Refused> {
    // its own reader finds the line of an error
    let value: toml::Value = match toml::from_str(text) {
        Ok(value) => value,
        Err(error) => {
            sample::parse(NAME, text)?;
            return Err(Refused::new(error));
        }
    };
    serde_json::to_value(value).map_err(Refused::new)
}

/// Reads a sample given as JSON, and notes how its files were read.
pub(super) fn read(
    sample: &Value,
    files: &Files,
    limits: &Limits,
) -> Result<(SampleFile, Vec<String>), Refused> {
    check_counts(sample, limits)?;
    check_names(sample)?;
    let substrate = sample.pointer("/substrate/reflectance");
    let substrate = substrate.and_then(Value::as_str);
    let absorbers = absorber_files(sample);
    if substrate.is_none() && absorbers.is_empty() {
        return Ok((parse(sample)?, Vec::new()));
    }
    let mut sample = sample.clone();
    // the wavelengths are known once the rest is read
    if substrate.is_some() {
        sample["substrate"]["reflectance"] = json!(0.0);
    }
    for file in &absorbers {
        file.replace(&mut sample, &[json!(0.0), json!(500.0), json!(0.0)]);
    }
    let wavelengths_nm = parse(&sample)?.wavelengths_nm;
    let mut notes = Vec::new();
    if let Some(path) = substrate {
        let key = "substrate.reflectance";
        let help = "give a number from 0 to 1, or a list with one number per wavelength";
        let text = text_of(files, path, key, help)?;
        let options = ReadOptions::new(Some(Content::Reflectance), (0.0, 1.0));
        let curve = measured::parse(path, text.as_bytes(), &options);
        let curve = curve.map_err(|error| Refused::at(key, error))?;
        let values = curve.values_at(&wavelengths_nm);
        let values = values.map_err(|gap| Refused::at(key, format!("{key}: {path} {gap}")))?;
        sample["substrate"]["reflectance"] = json!(values);
        notes.push(format!("read {path}: {}", curve.report));
    }
    for file in &absorbers {
        let (key, path) = (file.key(), &file.path);
        let help = "add the file, or choose a species";
        let text = text_of(files, path, &key, help)?;
        let found = absorber::of_text(path, text, &wavelengths_nm);
        let (values, about) =
            found.map_err(|problem| Refused::at(&key, format!("{key}: {path} {problem}")))?;
        file.replace(&mut sample, &[json!(values)]);
        notes.push(format!("read {path}: {about}"));
    }
    Ok((parse(&sample)?, notes))
}

/// The text of the file `path` that the key `key` names.
fn text_of<'a>(files: &'a Files, path: &str, key: &str, help: &str) -> Result<&'a str, Refused> {
    let text = files.get(path).map(String::as_str);
    text.ok_or_else(|| {
        let message = format!("{key} names the file {path}, which is not here; {help}");
        Refused::at(key, message)
    })
}

/// The file of an absorber.
struct AbsorberFile {
    layer: usize,
    number: usize,
    path: String,
}

/// The keys of the law of an absorber. With a list, which has one number per wavelength, the first
/// stands alone.
const LAW: [&str; 3] = [
    "mass_absorption_efficiency_m2_g",
    "reference_wavelength_nm",
    "angstrom_exponent",
];

/// The absorbers of `sample` that name a file and no law beside it, which is refused.
fn absorber_files(sample: &Value) -> Vec<AbsorberFile> {
    let list = |keys: &Value, key: &str| keys.get(key).and_then(Value::as_array).cloned();
    let mut files = Vec::new();
    for (layer, keys) in list(sample, "layer").into_iter().flatten().enumerate() {
        for (number, keys) in list(&keys, "absorber").into_iter().flatten().enumerate() {
            let has_law = LAW.iter().any(|key| keys.get(key).is_some());
            let path = keys.get("file").and_then(Value::as_str).map(str::to_owned);
            if let Some(path) = path.filter(|_| !has_law && keys.get("species").is_none()) {
                files.push(AbsorberFile {
                    layer,
                    number,
                    path,
                });
            }
        }
    }
    files
}

impl AbsorberFile {
    fn key(&self) -> String {
        format!("layer[{}].absorber[{}].file", self.layer, self.number)
    }

    /// Gives the absorber of `sample` this `law` instead of the file or of an earlier law, and the
    /// name that the file gives it.
    fn replace(&self, sample: &mut Value, law: &[Value]) {
        let absorber = &mut sample["layer"][self.layer]["absorber"][self.number];
        let Some(keys) = absorber.as_object_mut() else {
            return;
        };
        keys.retain(|key, _| key != "file" && !LAW.contains(&key.as_str()));
        let law = LAW.iter().zip(law);
        keys.extend(law.map(|(key, value)| ((*key).to_owned(), value.clone())));
        let stem = Path::new(&self.path).file_stem();
        let name = stem.unwrap_or_default().to_string_lossy();
        keys.entry("name").or_insert_with(|| json!(name));
    }
}

fn parse(sample: &Value) -> Result<SampleFile, Refused> {
    let value: toml::Value =
        serde_json::from_value(sample.clone()).map_err(|error| Refused::new(explain(&error)))?;
    let text = toml::to_string(&value).map_err(|error| Refused::new(explain(&error)))?;
    sample::parse(NAME, &text).map_err(|error| {
        // the page shows no lines of this text
        let message = error.to_string();
        let line = error.line().map(|line| format!("{NAME}:{line}: "));
        let message = line.and_then(|line| message.strip_prefix(&line).map(str::to_owned));
        match message {
            Some(message) => Refused::at(error.key(), message),
            None => error.into(),
        }
    })
}

fn explain(error: &impl std::fmt::Display) -> String {
    format!("the sample is not one that a sample file can state: {error}")
}

/// Refuses samples that are too large to be meant.
fn check_counts(sample: &Value, limits: &Limits) -> Result<(), Refused> {
    let length = |value: Option<&Value>| value.and_then(Value::as_array).map_or(0, Vec::len);
    check(
        "layers",
        length(sample.get("layer")) as u64,
        limits.layers as u64,
    )?;
    for layer in sample
        .get("layer")
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
    {
        check(
            "grain types",
            length(layer.get("grain")) as u64,
            limits.grains as u64,
        )?;
        check(
            "absorbers",
            length(layer.get("absorber")) as u64,
            limits.absorbers as u64,
        )?;
    }
    let wavelengths = sample.get("wavelengths");
    let number = |key: &str| wavelengths?.get(key)?.as_f64();
    let listed = length(wavelengths.and_then(|keys| keys.get("values_nm"))) as u64;
    let stepped = match (number("start_nm"), number("stop_nm"), number("step_nm")) {
        (Some(start), Some(stop), Some(step)) => ((stop - start) / step) as u64,
        _ => 0,
    };
    check(
        "wavelengths",
        listed.max(stepped),
        limits.wavelengths as u64,
    )
}

/// Refuses a refractive index from a file: the page reads no paths.
fn check_names(sample: &Value) -> Result<(), Refused> {
    match sample.pointer("/model/water").and_then(Value::as_str) {
        Some(name) if name.ends_with(".csv") => Err(Refused::at(
            "model.water",
            format!(
                "model.water = {name:?} is a file, which the page does not read; give the name of a table"
            ),
        )),
        _ => Ok(()),
    }
}
