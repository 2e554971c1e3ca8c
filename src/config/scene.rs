//! Scene files: the snow that a renderer needs, and the accuracy that it needs.
use std::path::Path;

use crate::colour::Colorimeter;
use crate::measurement::Quantity;
use crate::parameter::{Parameter, Region};
use crate::scene::Scene;
use crate::transport::Substrate;

use super::document::{Document, read_text};
use super::error::{ConfigError, Problem};
use super::scene_keys::{RangeKeys, SceneKeys};
use super::shared::{choose_all, covered, model, ordered, size_law, viewing, wavelengths};
use super::snow::{
    fixed, fixed_or_axis, longest_grain, remark_axis, remark_sizes, remark_smooth, remark_spread,
    spread, thick_enough,
};
use super::{directory_of, schema};

/// A resolved scene file: defaults are filled in, and alternative keys are converted.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneFile {
    /// The file's name without directory and extension.
    pub name: String,
    /// The scene that the file describes.
    pub scene: Scene,
    /// Warnings for the user, such as values outside the ordinary ranges of
    /// docs/methods.md.
    pub warnings: Vec<String>,
    /// Notes for the user on how the data files that it names were read.
    pub notes: Vec<String>,
    /// The text of the file.
    pub text: String,
}

impl SceneFile {
    /// The scene as TOML without comments, in which the tables of illuminants and of the
    /// substrate are inlined: it does not refer to those files.
    #[must_use]
    pub fn self_contained(&self) -> String {
        let with_tables = || {
            let mut document = self.text.parse::<toml::Table>().ok()?;
            let scene = document.get_mut("scene")?.as_table_mut()?;
            if let Some(illuminants) = scene.get_mut("illuminants") {
                *illuminants = toml::Value::try_from(&self.scene.viewing.illuminants).ok()?;
            }
            if let Substrate::Spectrum { table } = &self.scene.fixed.substrate {
                let keys = document
                    .get_mut("fixed")?
                    .get_mut("substrate")?
                    .as_table_mut()?;
                let values = toml::Value::try_from(table.column(0)).ok()?;
                keys.insert("reflectance".to_owned(), values);
            }
            toml::to_string(&document).ok()
        };
        with_tables().unwrap_or_else(|| self.text.clone())
    }
}

/// Reads a scene file.
///
/// # Errors
/// [`ConfigError`] if the file cannot be read or a value is not allowed.
pub fn read(path: &Path) -> Result<SceneFile, ConfigError> {
    parse(&path.display().to_string(), &read_text(path)?)
}

/// Reads the `text` of a scene file. `name` is its path: it appears in messages, names the
/// scene, and the paths in the file are relative to its directory.
///
/// # Errors
/// As [`read`].
pub fn parse(name: &str, text: &str) -> Result<SceneFile, ConfigError> {
    let (document, keys) = Document::read::<SceneKeys>(name, text, &schema::SCENE)?;
    let (mut warnings, mut notes) = (Vec::new(), Vec::new());
    let requirements = &keys.scene;
    let size_law = size_law(&document, &keys.model)?;
    let model = model(&document, &keys.model, directory_of(name))?;
    let spread = spread(&keys.spread, size_law);
    let half_width = spread.grain_size_half_width_um;

    let mut snow = Vec::new();
    let mut densities = Vec::new();
    let mut longest_um = 0.0_f64;
    for (i, keys) in keys.snow.iter().enumerate() {
        let mut ranges = Vec::new();
        for (parameter, keys) in keys.iter() {
            let key = format!("snow[{i}].{}", parameter.key());
            let given = KeyedRange::new(&document, key, keys)?;
            ranges.push((parameter, given.range));
            match parameter {
                Parameter::Facetness => {
                    if let Some((key, smallest)) = given.ends.first() {
                        let given = (key.as_str(), *smallest);
                        remark_smooth(&document, &mut warnings, model.facets, given);
                    }
                }
                Parameter::GrainSize => {
                    for (key, mean) in &given.ends {
                        let longest = longest_grain(&document, key, *mean, half_width)?;
                        longest_um = longest_um.max(longest);
                        let ends = [mean - half_width, mean + half_width];
                        remark_sizes(&document, &mut warnings, [key, key], ends);
                        remark_spread(&document, &mut warnings, key, *mean, &spread);
                    }
                }
                Parameter::Density => {
                    for (key, value) in &given.ends {
                        remark_axis(&document, &mut warnings, parameter, key, *value);
                        densities.push(*value);
                    }
                }
                _ => {}
            }
        }
        snow.push(ranges);
    }
    let thickness = KeyedRange::new(
        &document,
        "scene.thickness_cm".into(),
        requirements.thickness_cm,
    )?;
    for (key, value) in &thickness.ends {
        remark_axis(&document, &mut warnings, Parameter::Thickness, key, *value);
    }
    let angle = KeyedRange::new(
        &document,
        "scene.incidence_angle_deg".into(),
        requirements.incidence_angle_deg,
    )?;

    let wavelengths_nm = wavelengths(&document, &keys.wavelengths, &mut warnings)?;
    let viewing = viewing(
        &document,
        "scene",
        (&requirements.illuminants, &requirements.delta_e),
        (directory_of(name), &wavelengths_nm),
        &mut notes,
    )?;
    if !matches!(Colorimeter::viewing(&wavelengths_nm, &viewing), Ok(Some(_))) {
        let problem =
            "cover too little of the visible range to have a colour, which max_delta_e needs";
        let problem = Problem::Contradiction(problem.into());
        let help = "include 400 to 700 nm, for example start_nm = 400, stop_nm = 700, step_nm = 10";
        return Err(document.error("wavelengths", problem, help));
    }
    let tables: Vec<String> = (0..snow.len()).map(|i| format!("snow[{i}]")).collect();
    fixed_or_axis(&document, &tables, &keys.fixed)?;
    let slab = [
        (Parameter::Thickness, thickness.range),
        (Parameter::Incidence, angle.range),
    ];
    let boxes = snow
        .into_iter()
        .map(|ranges| ranges.into_iter().chain(slab));
    let regions: Vec<Region> = boxes.map(Iterator::collect).collect();
    same_axes(&document, &regions)?;
    densities.dedup();
    let fixed = fixed(
        &document,
        &keys.fixed,
        model,
        size_law,
        &densities,
        (directory_of(name), &wavelengths_nm),
        (&mut warnings, &mut notes),
    )?;
    for (key, value) in &thickness.ends {
        thick_enough(&document, key, *value, longest_um, &fixed)?;
    }
    let water = |region: &Region| {
        let saturation = region.get(Parameter::WaterSaturation);
        saturation.is_some_and(|[_, largest]| largest > 0.0)
    };
    let wet = fixed.is_wet() || regions.iter().any(water);
    covered(&document, &fixed.model, &wavelengths_nm, wet)?;
    let quantities = Quantity::ALL.map(|quantity| (quantity.name(), quantity));
    let stem = Path::new(name).file_stem();
    Ok(SceneFile {
        name: stem.map_or("scene".into(), |s| s.to_string_lossy().into_owned()),
        scene: Scene {
            max_delta_e: requirements.max_delta_e,
            quantities: choose_all(
                &document,
                "scene.quantities",
                &quantities,
                &requirements.quantities,
            )?,
            viewing,
            max_bytes: requirements.max_bytes,
            max_seconds: requirements.max_seconds,
            regions,
            spread,
            wavelengths_nm,
            fixed,
            seed: keys.run.seed,
        },
        warnings,
        notes,
        text: text.to_owned(),
    })
}

/// Refuses a parameter that only some of the kinds of snow have.
fn same_axes(document: &Document, regions: &[Region]) -> Result<(), ConfigError> {
    for parameter in Parameter::ALL {
        let has = |region: &Region| region.get(parameter).is_some();
        if let Some(i) = regions.iter().position(|region| !has(region))
            && regions.iter().any(has)
        {
            let help = "give it in every [[snow]] table, or in none";
            let key = format!("snow[{i}].{}", parameter.key());
            return Err(document.error(&key, Problem::Missing, help));
        }
    }
    Ok(())
}

/// A range, with the keys and values that give it: one for a number, two for a range.
struct KeyedRange {
    range: [f64; 2],
    ends: Vec<(String, f64)>,
}

impl KeyedRange {
    fn new(document: &Document, key: String, keys: RangeKeys) -> Result<Self, ConfigError> {
        let (range, ends) = match keys {
            RangeKeys::Number(value) => ([value, value], vec![(key, value)]),
            RangeKeys::Range { min, max } => {
                ordered(document, &key, min, max)?;
                let ends = vec![(format!("{key}.min"), min), (format!("{key}.max"), max)];
                ([min, max], ends)
            }
        };
        Ok(Self { range, ends })
    }
}
