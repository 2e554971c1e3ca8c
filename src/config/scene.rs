//! Scene files: which snow a renderer will ask for, and how good the answers
//! must be.
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
    biggest_grain, fixed, fixed_or_axis, remark_axis, remark_sizes, remark_smooth, remark_spread,
    spread, thick_enough,
};
use super::{directory_of, schema};

/// A scene file, resolved: no defaults or alternatives are left.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneFile {
    /// The file's name without directory and extension.
    pub name: String,
    /// The scene it describes.
    pub scene: Scene,
    /// Values beyond the ordinary ranges of docs/methods.md, for the user to see.
    pub warnings: Vec<String>,
    /// What was found in the files it names and done, for the user to see.
    pub notes: Vec<String>,
    /// The file as it was read.
    pub text: String,
}

impl SceneFile {
    /// The scene as TOML that needs no files of illuminants and of the substrate: their
    /// numbers stand in place of the paths. Without comments.
    #[must_use]
    pub fn self_contained(&self) -> String {
        let with_tables = || {
            let mut all = self.text.parse::<toml::Table>().ok()?;
            let scene = all.get_mut("scene")?.as_table_mut()?;
            if let Some(lights) = scene.get_mut("illuminants") {
                *lights = toml::Value::try_from(&self.scene.viewing.illuminants).ok()?;
            }
            if let Substrate::Spectrum { table } = &self.scene.fixed.substrate {
                let keys = all.get_mut("fixed")?.get_mut("substrate")?.as_table_mut()?;
                let values = toml::Value::try_from(table.column(0)).ok()?;
                keys.insert("reflectance".to_owned(), values);
            }
            toml::to_string(&all).ok()
        };
        with_tables().unwrap_or_else(|| self.text.clone())
    }
}

/// Reads a scene file.
///
/// # Errors
/// [`ConfigError`] with file, line, key, value, and what is allowed.
pub fn read(path: &Path) -> Result<SceneFile, ConfigError> {
    parse(&path.display().to_string(), &read_text(path)?)
}

/// Reads the `text` of a scene file; `name` is its path, for messages, for the
/// scene's name and for the paths in it.
///
/// # Errors
/// As [`read`].
pub fn parse(name: &str, text: &str) -> Result<SceneFile, ConfigError> {
    let (document, keys) = Document::read::<SceneKeys>(name, text, &schema::SCENE)?;
    let (mut warnings, mut notes) = (Vec::new(), Vec::new());
    let asked = &keys.scene;
    let size_law = size_law(&document, &keys.model)?;
    let spread = spread(&keys.spread, size_law);
    let half_width = spread.grain_size_half_width_um;

    let mut snow = Vec::new();
    let mut densities = Vec::new();
    let mut biggest = 0.0_f64;
    for (i, keys) in keys.snow.iter().enumerate() {
        let mut ranges = Vec::new();
        for (parameter, keys) in keys.iter() {
            let key = format!("snow[{i}].{}", parameter.key());
            let given = Given::new(&document, key, keys)?;
            ranges.push((parameter, given.range));
            match parameter {
                Parameter::Facetness => {
                    if let Some((key, least)) = given.ends.first() {
                        remark_smooth(&document, &mut warnings, key, *least);
                    }
                }
                Parameter::GrainSize => {
                    for (key, mean) in &given.ends {
                        biggest = biggest.max(biggest_grain(&document, key, *mean, half_width)?);
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
    let thickness = Given::new(&document, "scene.thickness_cm".into(), asked.thickness_cm)?;
    for (key, value) in &thickness.ends {
        remark_axis(&document, &mut warnings, Parameter::Thickness, key, *value);
    }
    let angle = Given::new(
        &document,
        "scene.incidence_angle_deg".into(),
        asked.incidence_angle_deg,
    )?;

    let wavelengths_nm = wavelengths(&document, &keys.wavelengths, &mut warnings)?;
    let viewing = viewing(
        &document,
        "scene",
        (&asked.illuminants, &asked.delta_e),
        (directory_of(name), &wavelengths_nm),
        &mut notes,
    )?;
    if !matches!(Colorimeter::viewing(&wavelengths_nm, &viewing), Ok(Some(_))) {
        let problem = Problem::Contradiction("have no colour, which max_delta_e is of".into());
        let help = "take in 400 to 700 nm, for example start_nm = 400, stop_nm = 700, step_nm = 10";
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
    let model = model(&document, &keys.model, directory_of(name))?;
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
        thick_enough(&document, key, *value, biggest, &fixed)?;
    }
    let water = |region: &Region| {
        let saturation = region.get(Parameter::WaterSaturation);
        saturation.is_some_and(|[_, most]| most > 0.0)
    };
    let wet = fixed.is_wet() || regions.iter().any(water);
    covered(&document, &fixed.model, &wavelengths_nm, wet)?;
    let quantities = Quantity::ALL.map(|quantity| (quantity.name(), quantity));
    let stem = Path::new(name).file_stem();
    Ok(SceneFile {
        name: stem.map_or("scene".into(), |s| s.to_string_lossy().into_owned()),
        scene: Scene {
            max_delta_e: asked.max_delta_e,
            quantities: choose_all(
                &document,
                "scene.quantities",
                &quantities,
                &asked.quantities,
            )?,
            viewing,
            max_bytes: asked.max_bytes,
            max_seconds: asked.max_seconds,
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

/// Refuses an axis that only some of the snows have.
fn same_axes(document: &Document, regions: &[Region]) -> Result<(), ConfigError> {
    for parameter in Parameter::ALL {
        let has = |region: &Region| region.get(parameter).is_some();
        if let Some(i) = regions.iter().position(|region| !has(region))
            && regions.iter().any(has)
        {
            let help = "give it for every snow, or for none";
            let key = format!("snow[{i}].{}", parameter.key());
            return Err(document.error(&key, Problem::Missing, help));
        }
    }
    Ok(())
}

/// A range, and the keys and values it was given by: one for a number, else two.
struct Given {
    range: [f64; 2],
    ends: Vec<(String, f64)>,
}

impl Given {
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
