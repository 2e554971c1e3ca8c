//! Scene files: which snow a renderer will ask for, and how good the answers
//! must be.
use std::path::Path;

use crate::colour::Colorimeter;
use crate::grid::ExtraAxis;
use crate::measurement::Quantity;
use crate::scene::{Range, Scene, SceneSnow};
use crate::transport::Ground;

use super::document::{Document, read_text};
use super::error::{ConfigError, Problem};
use super::scene_keys::{RangeKeys, SceneKeys, SnowKeys};
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
            if let Ground::Spectrum { table } = &self.scene.fixed.ground {
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
        let facetness = Given::new(&document, format!("snow[{i}].facetness"), keys.facetness)?;
        if let Some((key, least)) = facetness.ends.first() {
            remark_smooth(&document, &mut warnings, key, *least);
        }
        let size = Given::new(
            &document,
            format!("snow[{i}].grain_size_um"),
            keys.grain_size_um,
        )?;
        let density = Given::new(
            &document,
            format!("snow[{i}].density_kg_m3"),
            keys.density_kg_m3,
        )?;
        for (key, mean) in &size.ends {
            biggest = biggest.max(biggest_grain(&document, key, *mean, half_width)?);
            let ends = [mean - half_width, mean + half_width];
            remark_sizes(&document, &mut warnings, [key, key], ends);
            remark_spread(&document, &mut warnings, key, *mean, &spread);
        }
        for (key, value) in &density.ends {
            remark_axis(&document, &mut warnings, "density_kg_m3", key, *value);
            densities.push(*value);
        }
        snow.push(SceneSnow {
            facetness: facetness.range,
            grain_size_um: size.range,
            density_kg_m3: density.range,
            extra: beyond(&document, i, keys)?,
        });
    }
    let thickness = Given::new(&document, "scene.thickness_cm".into(), asked.thickness_cm)?;
    for (key, value) in &thickness.ends {
        remark_axis(&document, &mut warnings, "thickness_cm", key, *value);
    }
    let angle = Given::new(&document, "scene.angle_deg".into(), asked.angle_deg)?;

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
    same_axes(&document, &snow)?;
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
    let water =
        |(axis, range): (ExtraAxis, Range)| axis == ExtraAxis::WaterSaturation && range.max > 0.0;
    let wet = fixed.is_wet() || snow.iter().any(|snow| snow.beyond().any(water));
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
            thickness_cm: thickness.range,
            angle_deg: angle.range,
            snow,
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

/// What snow number `i` says of the axes beyond the five.
fn beyond(
    document: &Document,
    i: usize,
    keys: &SnowKeys,
) -> Result<[Option<Range>; 5], ConfigError> {
    let mut ranges = [None; 5];
    for ((range, keys), axis) in ranges.iter_mut().zip(keys.extra()).zip(ExtraAxis::ALL) {
        if let Some(keys) = keys {
            let key = format!("snow[{i}].{}", axis.name());
            *range = Some(Given::new(document, key, keys)?.range);
        }
    }
    Ok(ranges)
}

/// Refuses an axis beyond the five that only some of the snows have.
fn same_axes(document: &Document, snow: &[SceneSnow]) -> Result<(), ConfigError> {
    for (axis, name) in ExtraAxis::ALL.map(ExtraAxis::name).into_iter().enumerate() {
        let has = |snow: &SceneSnow| snow.extra[axis].is_some();
        if let Some(i) = snow.iter().position(|snow| !has(snow))
            && snow.iter().any(has)
        {
            let help = "give it for every snow, or for none";
            let key = format!("snow[{i}].{name}");
            return Err(document.error(&key, Problem::Missing, help));
        }
    }
    Ok(())
}

/// A range, and the keys and values it was given by: one for a number, else two.
struct Given {
    range: Range,
    ends: Vec<(String, f64)>,
}

impl Given {
    fn new(document: &Document, key: String, keys: RangeKeys) -> Result<Self, ConfigError> {
        let (range, ends) = match keys {
            RangeKeys::Number(value) => {
                let range = Range {
                    min: value,
                    max: value,
                };
                (range, vec![(key, value)])
            }
            RangeKeys::Range { min, max } => {
                ordered(document, &key, min, max)?;
                let ends = vec![(format!("{key}.min"), min), (format!("{key}.max"), max)];
                (Range { min, max }, ends)
            }
        };
        Ok(Self { range, ends })
    }
}
