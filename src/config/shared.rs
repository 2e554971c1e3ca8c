//! Reading of keys that several kinds of file share: wavelengths, distributions, named
//! choices, illuminants and model options.
use std::path::Path;

use crate::colour::{ColourDifference, Illuminant, IlluminantError, IlluminantSpec, Viewing};
use crate::grain::{Shape, SizeLaw, SizeMeasure, TruncatedNormal};
use crate::optics::WaterTable;
use crate::transport::Model;

use super::check;
use super::document::Document;
use super::error::{ConfigError, Problem};
use super::keys::{
    AspectRatioKeys, CARBON_LAWS, ENTRIES, FACETS, ICE_TABLES, IMPURITY_MASSES, JOININGS,
    MAX_WAVELENGTHS, ModelKeys, PRESETS, SHAPES, SIZE_LAWS, SphericityKeys, WATER_TABLES,
    WavelengthKeys,
};

/// Refuses a file that gives both of two keys that exclude each other.
pub(super) fn exclusive(document: &Document, key: &str, other: &str) -> Result<(), ConfigError> {
    if !(document.has(key) && document.has(other)) {
        return Ok(());
    }
    let (first, second) = if document.line(key) <= document.line(other) {
        (key, other)
    } else {
        (other, key)
    };
    let conflict = Problem::Conflict {
        other: first.to_owned(),
        line: document.line(first),
    };
    Err(document.error(second, conflict, "give only one of the two"))
}

/// Refuses a `table` that gives the grain size by none or by several of its keys: `size`
/// and the names of the other measures.
pub(super) fn one_size(document: &Document, table: &str, size: &str) -> Result<(), ConfigError> {
    let [radius, surface] = SizeMeasure::ALL.map(SizeMeasure::name);
    let key = |name: &str| format!("{table}.{name}");
    for [name, other] in [[size, radius], [size, surface], [radius, surface]] {
        exclusive(document, &key(name), &key(other))?;
    }
    if [size, radius, surface]
        .iter()
        .any(|name| document.has(&key(name)))
    {
        return Ok(());
    }
    let help = format!("give the grain size by one of the keys {size}, {radius} or {surface}");
    Err(document.error(&key(size), Problem::Missing, help))
}

/// Refuses a list that is not strictly increasing.
pub(super) fn increasing(
    document: &Document,
    key: &str,
    values: &[f64],
) -> Result<(), ConfigError> {
    for (i, pair) in values.windows(2).enumerate() {
        let &[previous, value] = pair else { continue };
        if value <= previous {
            let relation = if value == previous {
                "repeats"
            } else {
                "is below"
            };
            let problem =
                Problem::Contradiction(format!("{relation} the previous value, {previous}"));
            let key = format!("{key}[{}]", i + 1);
            let help = "give each value once, in increasing order";
            return Err(document.error(&key, problem, help));
        }
    }
    Ok(())
}

/// The wavelengths, nm, strictly increasing. Adds a warning if the last step does not
/// reach `stop_nm`.
pub(super) fn wavelengths(
    document: &Document,
    keys: &WavelengthKeys,
    warnings: &mut Vec<String>,
) -> Result<Vec<f64>, ConfigError> {
    const HELP: &str = "give start_nm, stop_nm and step_nm, or values_nm";
    for key in ["start_nm", "stop_nm", "step_nm"] {
        exclusive(
            document,
            "wavelengths.values_nm",
            &format!("wavelengths.{key}"),
        )?;
    }
    if let Some(values) = &keys.values_nm {
        increasing(document, "wavelengths.values_nm", values)?;
        return Ok(values.clone());
    }
    let missing = |key: &str| document.error(&format!("wavelengths.{key}"), Problem::Missing, HELP);
    let start = keys.start_nm.ok_or_else(|| missing("start_nm"))?;
    let stop = keys.stop_nm.ok_or_else(|| missing("stop_nm"))?;
    let step = keys.step_nm.ok_or_else(|| missing("step_nm"))?;
    if start > stop {
        let problem = Problem::Contradiction(format!("is above stop_nm = {stop}"));
        return Err(document.error("wavelengths.start_nm", problem, "swap start_nm and stop_nm"));
    }
    let steps = (stop - start) / step;
    // A step such as 0.1 has no exact double, so that a whole number of steps may be off
    // by a rounding error.
    let whole = (steps - steps.round()).abs() < 1e-9 * steps.max(1.0);
    let count = if whole { steps.round() } else { steps.floor() };
    if count >= MAX_WAVELENGTHS as f64 {
        // Printed as an integer if it is short, else as 3e302.
        let total = match count + 1.0 {
            total if total < 1e9 => format!("{total}"),
            total => format!("{total:.0e}"),
        };
        let problem = Problem::Contradiction(format!(
            "gives {total} wavelengths from {start} to {stop} nm, more than {MAX_WAVELENGTHS}"
        ));
        return Err(document.error("wavelengths.step_nm", problem, "use a larger step"));
    }
    let mut values: Vec<f64> = (0..=count as u32)
        .map(|i| start + f64::from(i) * step)
        .collect();
    match values.last_mut() {
        Some(last) if whole => *last = stop,
        Some(last) => {
            let remark = format!(
                "is not a whole number of steps from start_nm; the last wavelength is {last} nm"
            );
            warnings.push(document.warning("wavelengths.stop_nm", remark));
        }
        None => {}
    }
    // A step below the spacing of doubles repeats a value.
    increasing(document, "wavelengths.step_nm", &values)?;
    Ok(values)
}

/// The truncated normal distribution given by `key.min`, `key.max`, `key.mean` and `key.sd`.
pub(super) fn law(
    document: &Document,
    key: &str,
    (min, max, mean, sd): (f64, f64, f64, f64),
) -> Result<TruncatedNormal, ConfigError> {
    ordered(document, key, min, max)?;
    if !(min <= mean && mean <= max) {
        let problem = Problem::OutOfRange(format!("{min} to {max}, its min and max"));
        return Err(document.error(&format!("{key}.mean"), problem, "change mean, min or max"));
    }
    TruncatedNormal::new(min, max, mean, sd).map_err(|e| {
        document.error(
            key,
            Problem::Contradiction(e.to_string()),
            "change min, max, mean or sd",
        )
    })
}

/// The shape of grains and the distribution of their proportion, from the keys `shape`,
/// `sphericity` and `aspect_ratio` of `table`.
pub(super) fn shape(
    document: &Document,
    table: &str,
    (name, sphericity, aspect_ratio): (&str, &SphericityKeys, Option<&AspectRatioKeys>),
) -> Result<(Shape, TruncatedNormal), ConfigError> {
    let shape = choose(document, &format!("{table}.shape"), &SHAPES, name)?;
    let key = |name: &str| format!("{table}.{name}");
    let refuse = |name: &str, help: &str| {
        let problem =
            Problem::Contradiction(format!("does not go with the shape {}", shape.name()));
        Err(document.error(&key(name), problem, help))
    };
    match (shape.has_aspect_ratio(), aspect_ratio) {
        (true, _) if document.has(&key("sphericity")) => {
            refuse("sphericity", "remove it, and give aspect_ratio")
        }
        (true, Some(a)) => {
            let law = law(document, &key("aspect_ratio"), (a.min, a.max, a.mean, a.sd))?;
            Ok((shape, law))
        }
        (true, None) => refuse(
            "shape",
            "give aspect_ratio = { min = ..., max = ..., mean = ..., sd = ... } too",
        ),
        (false, Some(_)) => refuse("aspect_ratio", "remove it, or choose the shape hexagonal"),
        (false, None) => {
            let s = sphericity;
            let law = law(document, &key("sphericity"), (s.min, s.max, s.mean, s.sd))?;
            Ok((shape, law))
        }
    }
}

/// Refuses a `key.min` that is above `key.max`.
pub(super) fn ordered(
    document: &Document,
    key: &str,
    min: f64,
    max: f64,
) -> Result<(), ConfigError> {
    if min <= max {
        return Ok(());
    }
    let problem = Problem::Contradiction(format!("is above max = {max}"));
    Err(document.error(&format!("{key}.min"), problem, "swap min and max"))
}

/// The size law: how often a ray meets grains of each size in a size range.
pub(super) fn size_law(document: &Document, keys: &ModelKeys) -> Result<SizeLaw, ConfigError> {
    let (.., law) = choose(document, "model.preset", &PRESETS, &keys.preset)?;
    choose_or(
        document,
        "model.size_law",
        &SIZE_LAWS,
        (&keys.size_law, law),
    )
}

/// As [`choose`], but `preset` if the file does not have the key.
fn choose_or<T: Copy>(
    document: &Document,
    key: &str,
    choices: &[(&str, T)],
    (given, preset): (&str, T),
) -> Result<T, ConfigError> {
    match document.has(key) {
        true => choose(document, key, choices, given),
        false => Ok(preset),
    }
}

/// The model options except the size law, which is part of the grains. Paths are relative
/// to `directory`.
pub(super) fn model(
    document: &Document,
    keys: &ModelKeys,
    directory: &Path,
) -> Result<Model, ConfigError> {
    let water = match keys.water.as_str() {
        "segelstein_1981" => WaterTable::Segelstein1981,
        "rowe_2020" => WaterTable::Rowe2020,
        "hale_querry_1973" => WaterTable::HaleQuerry1973,
        path if path.ends_with(".csv") => WaterTable::Csv(directory.join(path)),
        name => {
            let help = "give one of these names, or the path of a file that ends in .csv";
            check::choice(document, "model.water", name, &WATER_TABLES, help)?;
            WaterTable::default()
        }
    };
    let (entry, facets, _) = choose(document, "model.preset", &PRESETS, &keys.preset)?;
    Ok(Model {
        entry: choose_or(document, "model.entry", &ENTRIES, (&keys.entry, entry))?,
        facets: choose_or(document, "model.facets", &FACETS, (&keys.facets, facets))?,
        joining: choose(document, "model.layers", &JOININGS, &keys.layers)?,
        carbon_law: choose(document, "model.carbon_law", &CARBON_LAWS, &keys.carbon_law)?,
        impurity_mass: choose(
            document,
            "model.impurity_mass",
            &IMPURITY_MASSES,
            &keys.impurity_mass,
        )?,
        ice: choose(document, "model.ice", &ICE_TABLES, &keys.ice)?,
        water,
    })
}

/// How colours at `wavelengths_nm` are compared, from the keys `illuminants` and
/// `delta_e` of `table`. Paths are relative to `directory`; a note on each file that is
/// read is added to `notes`.
pub(super) fn viewing(
    document: &Document,
    table: &str,
    (illuminants, delta_e): (&[IlluminantSpec], &str),
    (directory, wavelengths_nm): (&Path, &[f64]),
    notes: &mut Vec<String>,
) -> Result<Viewing, ConfigError> {
    let differences = ColourDifference::ALL.map(|d| (d.name(), d));
    let mut lights: Vec<Illuminant> = Vec::new();
    for (i, stated) in illuminants.iter().enumerate() {
        let key = format!("{table}.illuminants[{i}]");
        let light = illuminant(document, &key, stated, directory, notes)?;
        light.covers(wavelengths_nm).map_err(|error| {
            let problem = Problem::Contradiction(format!("cannot be used: {error}"));
            document.error(&key, problem, "")
        })?;
        if lights.contains(&light) {
            let problem = Problem::Contradiction("is a duplicate".to_owned());
            return Err(document.error(&key, problem, "give each illuminant once"));
        }
        lights.push(light);
    }
    Ok(Viewing {
        illuminants: lights,
        difference: choose(document, &format!("{table}.delta_e"), &differences, delta_e)?,
    })
}

/// The illuminant given by its name, by the path of a file, or as an inline table.
fn illuminant(
    document: &Document,
    key: &str,
    stated: &IlluminantSpec,
    directory: &Path,
    notes: &mut Vec<String>,
) -> Result<Illuminant, ConfigError> {
    let refuse = |problem: String| document.error(key, Problem::Contradiction(problem), "");
    let IlluminantSpec::Name(name) = stated else {
        return Illuminant::try_from(stated.clone()).map_err(refuse);
    };
    match Illuminant::find(name, directory) {
        Ok((light, report)) => {
            let file = directory.join(name);
            notes.extend(report.map(|report| format!("read {}: {report}", file.display())));
            Ok(light)
        }
        Err(IlluminantError::Unknown { .. }) => {
            let problem = Problem::Choice {
                suggestion: check::nearest(name, Illuminant::NAMES.into_iter()),
                choices: format!("{}, or the path of a file", Illuminant::NAMES.join(", ")),
            };
            let help = "give a name, or a path relative to the directory of this file";
            Err(document.error(key, problem, help))
        }
        Err(error) => Err(refuse(format!("cannot be used: {error}"))),
    }
}

/// The values of `choices` with the names in `given`; refuses duplicates.
pub(super) fn choose_all<T: Copy + PartialEq>(
    document: &Document,
    key: &str,
    choices: &[(&str, T)],
    given: &[String],
) -> Result<Vec<T>, ConfigError> {
    let mut chosen = Vec::new();
    for (i, name) in given.iter().enumerate() {
        let key = format!("{key}[{i}]");
        let value = choose(document, &key, choices, name)?;
        if chosen.contains(&value) {
            let problem = Problem::Contradiction("is a duplicate".to_owned());
            return Err(document.error(&key, problem, "give each name once"));
        }
        chosen.push(value);
    }
    Ok(chosen)
}

/// The value of `choices` with the name `given`.
pub(super) fn choose<T: Copy>(
    document: &Document,
    key: &str,
    choices: &[(&str, T)],
    given: &str,
) -> Result<T, ConfigError> {
    let names: Vec<_> = choices.iter().map(|(name, _)| *name).collect();
    check::choice(document, key, given, &names, "")?;
    let chosen = choices.iter().find(|(name, _)| *name == given);
    chosen
        .map(|(_, value)| *value)
        .ok_or_else(|| document.error(key, Problem::Missing, ""))
}

/// Refuses wavelengths that the chosen tables of refractive index do not cover.
pub(super) fn covered(
    document: &Document,
    model: &Model,
    wavelengths_nm: &[f64],
    wet: bool,
) -> Result<(), ConfigError> {
    let (Some(&first), Some(&last)) = (wavelengths_nm.first(), wavelengths_nm.last()) else {
        return Ok(());
    };
    let within = |key: &str, (min, max): (f64, f64)| {
        if min <= first && last <= max {
            return Ok(());
        }
        let problem = Problem::Contradiction(format!(
            "covers {min} to {max} nm, but the wavelengths run from {first} to {last} nm"
        ));
        let help = "choose another table or other wavelengths";
        Err(document.error(key, problem, help))
    };
    within("model.ice", model.ice.range_nm())?;
    if wet {
        let water = model.water.load().map_err(|e| {
            let problem = Problem::Contradiction(format!("cannot be used: {e}"));
            document.error(
                "model.water",
                problem,
                "correct the table, or choose another",
            )
        })?;
        within("model.water", water.range_nm())?;
    }
    Ok(())
}
