//! Study files: a sample, variants of it that change some of its keys, and the plot to
//! draw.
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

/// A resolved study file: every variant is a complete sample.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyFile {
    /// The file's name without directory and extension.
    pub name: String,
    /// Title of the figure.
    pub title: String,
    /// Expected result and its source.
    pub expected: String,
    /// The plot to draw.
    pub draw: Draw,
    /// Variants of the sample: each is a curve or a point of a curve.
    pub variants: Vec<StudyVariant>,
    /// Published values to draw with the curves.
    pub published: Vec<Published>,
    /// Warnings for the user, such as values outside the ordinary ranges of
    /// docs/methods.md.
    pub warnings: Vec<String>,
    /// Notes for the user on how the data files that the samples name were read.
    pub notes: Vec<String>,
}

/// The plot that a study draws.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Draw {
    /// Reflectance or transmittance.
    Spectra(DrawSpectra),
    /// The BRDF. Every variant has a single wavelength and collimated light.
    Brdf(DrawBrdf),
}

/// How spectra are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrawSpectra {
    /// Quantity on the vertical axis.
    pub quantity: Quantity,
    /// Quantity on the horizontal axis.
    pub against: Against,
    /// Lower end of the vertical axis.
    pub from: f64,
}

/// How BRDFs are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrawBrdf {
    /// Whether all directions are drawn, or only those in the plane of incidence.
    pub hemisphere: bool,
    /// Whether the scale of radius or colour is logarithmic.
    pub logarithmic: bool,
    /// Number of sensors on the hemisphere.
    pub sensors: usize,
}

/// The horizontal axis of a plot of spectra.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Against {
    /// Wavelength: one curve per variant.
    Wavelength,
    /// Thickness: one point per variant, the mean over 400-700 nm.
    Thickness,
}

/// One variant of the sample.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyVariant {
    /// Name in the legend.
    pub label: String,
    /// Group of the variant: variants of a group share a panel or, against thickness, a
    /// line.
    pub group: String,
    /// The sample with the changes of the variant.
    pub sample: SampleFile,
}

/// One published value.
#[derive(Debug, Clone, PartialEq)]
pub struct Published {
    /// Name of the source in the legend.
    pub label: String,
    /// Wavelength, nm.
    pub wavelength_nm: f64,
    /// Value of the quantity.
    pub value: f64,
    /// Smallest and largest value, if a range is given.
    pub range: Option<[f64; 2]>,
}

/// Reads a study file and the sample file it names.
///
/// # Errors
/// [`ConfigError`] if a file cannot be read or a value is not allowed.
pub fn read(path: &Path) -> Result<StudyFile, ConfigError> {
    parse(&path.display().to_string(), &read_text(path)?)
}

/// Reads the `text` of a study file. `name` is its path: it appears in messages, names the
/// study, and the path of the sample is relative to its directory.
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
    // errors in the unchanged sample are reported at their lines in the sample file
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
            // The line number is dropped: it refers to the changed text.
            let (_, remark) = warning.split_once(": ").unwrap_or(("", warning));
            let warning = format!("{name}: {}: {remark}", variant.label);
            warnings.push(warning);
        }
        for note in &sample.notes {
            if !notes.contains(note) {
                notes.push(note.clone());
            }
        }
        variants.push(with_sample(variant, sample));
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

fn with_sample(keys: &VariantKeys, sample: SampleFile) -> StudyVariant {
    StudyVariant {
        label: keys.label.clone(),
        group: keys.group.clone(),
        sample,
    }
}

/// The sample `base` with the changes in the tables `sets` of the study.
fn changed(
    document: &Document,
    base_name: &str,
    mut base: Table,
    sets: &[(String, &Table); 2],
) -> Result<SampleFile, ConfigError> {
    for (table, set) in sets {
        for (path, value) in *set {
            change::set(&mut base, &former::path(path), value.clone()).map_err(|problem| {
                let key = format!("{table}.{path:?}");
                let help = "write a path such as layer[0].grain[0].size_um.min";
                document.error(&key, Problem::Contradiction(problem), help)
            })?;
        }
    }
    let text = base.to_string();
    sample::parse(base_name, &text).map_err(|error| {
        // The base is valid, so that the last change of the key caused the error.
        let touches = |path: &str| error.key().starts_with(path) || path.starts_with(error.key());
        let changed_key = |(table, set): &(String, &Table)| {
            let path = set.keys().find(|path| touches(path))?;
            Some(format!("{table}.{path:?}"))
        };
        let key = sets.iter().rev().find_map(changed_key);
        let line = document.line(key.as_deref().unwrap_or(&sets[1].0));
        error.attributed_to(document.file(), line, &sets[1].0)
    })
}

/// The plot to draw; refuses keys and variants that do not suit the quantity.
fn draw(
    document: &Document,
    keys: &DrawKeys,
    variants: &[StudyVariant],
) -> Result<Draw, ConfigError> {
    let quantity = Quantity::ALL
        .into_iter()
        .find(|quantity| quantity.name() == keys.quantity);
    let (inapplicable, problem): (&[&str], _) = match quantity {
        Some(_) => (
            &["draw.directions", "draw.scale", "draw.sensors"],
            format!("applies only to the quantity {BRDF}"),
        ),
        None => (
            &["draw.against", "draw.from", "published"],
            "applies only to the quantities reflectance and transmittance".to_owned(),
        ),
    };
    if let Some(key) = inapplicable.iter().find(|key| document.has(key)) {
        let help = format!("remove it, or change draw.quantity = {:?}", keys.quantity);
        return Err(document.error(key, Problem::Contradiction(problem), help));
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

/// Refuses variants of a BRDF study that have several wavelengths or diffuse light.
fn one_beam(document: &Document, variants: &[StudyVariant]) -> Result<(), ConfigError> {
    let refuse = |problem: String, help: &str| {
        Err(document.error("draw.quantity", Problem::Contradiction(problem), help))
    };
    for StudyVariant { label, sample, .. } in variants {
        let count = sample.wavelengths_nm.len();
        if count != 1 {
            let problem = format!("needs one wavelength, but the variant {label:?} has {count}");
            let help =
                "set it for all variants or for this one: wavelengths = { values_nm = [600] }";
            return refuse(problem, help);
        }
        if sample.illumination == Illumination::Diffuse {
            let problem = format!(
                "needs light from one direction, but that of the variant {label:?} is diffuse"
            );
            let help = "set illumination = { incidence_angle_deg = 60 }, or another angle";
            return refuse(problem, help);
        }
    }
    Ok(())
}

/// Refuses variants without wavelengths in [`VISIBLE_NM`], over which the mean is taken.
fn visible(document: &Document, variants: &[StudyVariant]) -> Result<(), ConfigError> {
    let has_visible = |variant: &StudyVariant| {
        let mut wavelengths_nm = variant.sample.wavelengths_nm.iter();
        wavelengths_nm.any(|nm| VISIBLE_NM.contains(nm))
    };
    if variants.iter().all(has_visible) {
        return Ok(());
    }
    let problem = Problem::Contradiction(
        "needs wavelengths in 400-700 nm, over which the mean is taken".into(),
    );
    let help = "set the sample's wavelengths, for example start_nm = 400, stop_nm = 700";
    Err(document.error("draw.against", problem, help))
}

/// Wavelength range over which a study against thickness takes the mean, nm.
pub const VISIBLE_NM: std::ops::RangeInclusive<f64> = 400.0..=700.0;

/// Default number of sensors on the hemisphere, as in `simulate --goniometer`.
const DEFAULT_SENSORS: usize = 1000;
