//! Study files: a sample, what is changed in it from curve to curve, and what
//! is drawn.
use std::path::Path;

use toml::Table;

use crate::measurement::Quantity;
use crate::transport::Illumination;

use super::change;
use super::document::{Document, read_text};
use super::error::{ConfigError, Problem};
use super::former;
use super::sample::{self, SampleFile};
use super::study_keys::{
    BRDF, DrawKeys, HEMISPHERE, LOGARITHMIC, StudyKeys, THICKNESS, VariantKeys,
};
use super::{directory_of, schema};

/// A study file, resolved: every variant is a sample of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyFile {
    /// The file's name without directory and extension.
    pub name: String,
    /// What the picture is headed.
    pub title: String,
    /// What is expected, and who says so.
    pub expected: String,
    /// What is drawn.
    pub draw: Draw,
    /// The curves, or the points of curves.
    pub variants: Vec<Variant>,
    /// Published values to draw beside them.
    pub published: Vec<Published>,
    /// Values beyond the ordinary ranges of docs/methods.md, for the user to see.
    pub warnings: Vec<String>,
    /// What was found in the files that its samples name and done, for the user to see.
    pub notes: Vec<String>,
}

/// What a study draws.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Draw {
    /// Reflectance or transmittance.
    Spectra(DrawSpectra),
    /// The BRDF. Every variant has one wavelength and light from one direction.
    Brdf(DrawBrdf),
}

/// How spectra are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrawSpectra {
    /// What is drawn.
    pub quantity: Quantity,
    /// What it is drawn against.
    pub against: Against,
    /// Where the axis of the quantity begins.
    pub from: f64,
}

/// How BRDFs are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrawBrdf {
    /// Whether in all directions; or those in the plane of incidence.
    pub hemisphere: bool,
    /// Whether the scale of radius or colour is logarithmic.
    pub logarithmic: bool,
    /// Sensors of the hemisphere.
    pub sensors: usize,
}

/// What a study draws spectra against.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Against {
    /// Wavelength: a curve for each variant.
    Wavelength,
    /// Thickness, of the mean over 400-700 nm: a point for each variant.
    Thickness,
}

/// One variant of the sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Variant {
    /// What it is called.
    pub label: String,
    /// Variants of one group share a panel, or with thicknesses a line.
    pub group: String,
    /// The sample, changed.
    pub sample: SampleFile,
}

/// One published value.
#[derive(Debug, Clone, PartialEq)]
pub struct Published {
    /// Whose it is.
    pub label: String,
    /// Wavelength, nm.
    pub wavelength_nm: f64,
    /// The value.
    pub value: f64,
    /// Least and largest, where a range is given.
    pub range: Option<[f64; 2]>,
}

/// Reads a study file and the sample file it names.
///
/// # Errors
/// [`ConfigError`] with file, line, key, value, and what is allowed.
pub fn read(path: &Path) -> Result<StudyFile, ConfigError> {
    parse(&path.display().to_string(), &read_text(path)?)
}

/// Reads the `text` of a study file; `name` is its path, for messages, for the
/// study's name and for the path of the sample in it.
///
/// # Errors
/// As [`read`].
pub fn parse(name: &str, text: &str) -> Result<StudyFile, ConfigError> {
    let (document, keys) = Document::read::<StudyKeys>(name, text, &schema::STUDY)?;
    let path = directory_of(name).join(&keys.sample);
    let base_name = path.display().to_string();
    let base_text = read_text(&path).map_err(|error| {
        let help = "give the path of a sample file, relative to this file";
        document.error("sample", error.problem().clone(), help)
    })?;
    // what is wrong with the sample as it stands is told at its own lines
    sample::parse(&base_name, &base_text)?;
    let base: Table = former::parsed(&base_text).map_err(|error| {
        let problem = Problem::Syntax(error.message().to_owned());
        document.error("sample", problem, "")
    })?;

    let (mut warnings, mut notes) = (Vec::new(), Vec::new());
    let mut variants = Vec::new();
    for (i, variant) in keys.variant.iter().enumerate() {
        let sets = [
            ("set".to_owned(), &keys.set),
            (format!("variant[{i}].set"), &variant.set),
        ];
        let sample = changed(&document, &base_name, base.clone(), &sets)?;
        for warning in &sample.warnings {
            // Its line is one of the changed text.
            let (_, remark) = warning.split_once(": ").unwrap_or(("", warning));
            let warning = format!("{name}: {}: {remark}", variant.label);
            warnings.push(warning);
        }
        for note in &sample.notes {
            if !notes.contains(note) {
                notes.push(note.clone());
            }
        }
        variants.push(named(variant, sample));
    }
    let draw = draw(&document, &keys.draw, &variants)?;
    let published = keys.published.into_iter().map(|keys| Published {
        label: keys.label,
        wavelength_nm: keys.wavelength_nm,
        value: keys.value,
        range: keys.min.zip(keys.max).map(|(min, max)| [min, max]),
    });
    let stem = Path::new(name).file_stem();
    Ok(StudyFile {
        name: stem.map_or("study".into(), |s| s.to_string_lossy().into_owned()),
        title: keys.title,
        expected: keys.expected,
        draw,
        variants,
        published: published.collect(),
        warnings,
        notes,
    })
}

fn named(keys: &VariantKeys, sample: SampleFile) -> Variant {
    Variant {
        label: keys.label.clone(),
        group: keys.group.clone(),
        sample,
    }
}

/// The sample `base` with what the tables `sets` of the study change in it.
fn changed(
    document: &Document,
    base_name: &str,
    mut base: Table,
    sets: &[(String, &Table); 2],
) -> Result<SampleFile, ConfigError> {
    for (table, set) in sets {
        for (path, value) in *set {
            change::set(&mut base, &former::path(path), value.clone()).map_err(|wrong| {
                let key = format!("{table}.{path:?}");
                let help = "write it as error messages do, such as layer[0].grain[0].size_um.min";
                document.error(&key, Problem::Contradiction(wrong), help)
            })?;
        }
    }
    let text = base.to_string();
    sample::parse(base_name, &text).map_err(|error| {
        // The base is right, so a change is to blame: the last that touches the key.
        let touches = |path: &str| error.key().starts_with(path) || path.starts_with(error.key());
        let of = |(table, set): &(String, &Table)| {
            let path = set.keys().find(|path| touches(path))?;
            Some(format!("{table}.{path:?}"))
        };
        let key = sets.iter().rev().find_map(of);
        let line = document.line(key.as_deref().unwrap_or(&sets[1].0));
        error.blamed(document.file(), line, &sets[1].0)
    })
}

/// What is drawn, once the keys suit it and the variants do.
fn draw(document: &Document, keys: &DrawKeys, variants: &[Variant]) -> Result<Draw, ConfigError> {
    let quantity = Quantity::ALL
        .into_iter()
        .find(|quantity| quantity.name() == keys.quantity);
    let (others, whose): (&[&str], _) = match quantity {
        Some(_) => (
            &["draw.directions", "draw.scale", "draw.sensors"],
            format!("is for the quantity {BRDF}"),
        ),
        None => (
            &["draw.against", "draw.from", "published"],
            "is for spectra: reflectance and transmittance".to_owned(),
        ),
    };
    if let Some(key) = others.iter().find(|key| document.has(key)) {
        let help = format!(
            "leave it out, or change draw.quantity = {:?}",
            keys.quantity
        );
        return Err(document.error(key, Problem::Contradiction(whose), help));
    }
    let Some(quantity) = quantity else {
        one_beam(document, variants)?;
        return Ok(Draw::Brdf(DrawBrdf {
            hemisphere: keys.directions.as_deref() == Some(HEMISPHERE),
            logarithmic: keys.scale.as_deref() == Some(LOGARITHMIC),
            sensors: keys.sensors.unwrap_or(DEFAULT_SENSORS),
        }));
    };
    let against = match keys.against == THICKNESS {
        true => Against::Thickness,
        false => Against::Wavelength,
    };
    if against == Against::Thickness {
        visible(document, variants)?;
    }
    Ok(Draw::Spectra(DrawSpectra {
        quantity,
        against,
        from: keys.from,
    }))
}

/// A BRDF is that of one wavelength and one direction of light.
fn one_beam(document: &Document, variants: &[Variant]) -> Result<(), ConfigError> {
    let refuse = |problem: String, help: &str| {
        Err(document.error("draw.quantity", Problem::Contradiction(problem), help))
    };
    for Variant { label, sample, .. } in variants {
        let count = sample.wavelengths_nm.len();
        if count != 1 {
            let problem = format!("needs one wavelength, but the variant {label:?} has {count}");
            let help = "set it, for all or for one: wavelengths = { values_nm = [600] }";
            return refuse(problem, help);
        }
        if sample.illumination == Illumination::Diffuse {
            let problem = format!(
                "needs light from one direction, but on the variant {label:?} it is diffuse"
            );
            let help = "set illumination = { incidence_angle_deg = 60 }, or another angle";
            return refuse(problem, help);
        }
    }
    Ok(())
}

/// A mean over the visible range needs wavelengths there.
fn visible(document: &Document, variants: &[Variant]) -> Result<(), ConfigError> {
    let seen = |variant: &Variant| {
        let mut all = variant.sample.wavelengths_nm.iter();
        all.any(|nm| VISIBLE_NM.contains(nm))
    };
    if variants.iter().all(seen) {
        return Ok(());
    }
    let problem = Problem::Contradiction(
        "needs wavelengths in 400-700 nm, over which it takes the mean".into(),
    );
    let help = "set the sample's wavelengths, for example start_nm = 400, stop_nm = 700";
    Err(document.error("draw.against", problem, help))
}

/// What the mean of a study against thickness is taken over, nm.
pub const VISIBLE_NM: std::ops::RangeInclusive<f64> = 400.0..=700.0;

/// Sensors of the hemisphere where none are given, as in `simulate --goniometer`.
const DEFAULT_SENSORS: usize = 1000;
