//! The keys of study files, as [`super::keys`] has those of the other kinds.
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use toml::Table;

use crate::measurement::{MOST_SENSORS, Quantity};
use crate::optics::MODEL_RANGE_NM;

pub(super) const BRDF: &str = "brdf";
pub(super) const WAVELENGTH: &str = "wavelength";
pub(super) const THICKNESS: &str = "thickness";
pub(super) const PRINCIPAL_PLANE: &str = "principal_plane";
pub(super) const HEMISPHERE: &str = "hemisphere";
pub(super) const LINEAR: &str = "linear";
pub(super) const LOGARITHMIC: &str = "logarithmic";

/// One sample, what is changed in it from curve to curve, and what is drawn.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "SPLITSnow study file")]
pub(super) struct StudyKeys {
    /// Version of the file format; this program reads 1.
    #[schemars(range(min = 1, max = 1))]
    #[serde(rename = "version")]
    pub(super) _version: u32,
    /// What the picture is headed.
    pub(super) title: String,
    /// What is expected, and who says so: the line under the heading.
    pub(super) expected: String,
    /// Path of the sample file that the variants change, relative to this file.
    pub(super) sample: String,
    pub(super) draw: DrawKeys,
    /// Keys of the sample changed in all variants: a quoted path such as
    /// "layer[0].density_kg_m3", and its value. The index after a list's last adds to it.
    #[schemars(schema_with = "changes")]
    #[serde(default)]
    pub(super) set: Table,
    /// The curves, or the points of curves.
    #[schemars(length(min = 1, max = 100))]
    pub(super) variant: Vec<VariantKeys>,
    /// Published values to draw beside them; with wavelengths only.
    #[schemars(length(max = 100))]
    #[serde(default)]
    pub(super) published: Vec<PublishedKeys>,
}

/// What is drawn.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct DrawKeys {
    /// The quantity; `brdf` at one wavelength of each variant.
    #[schemars(extend("enum" = quantities()))]
    pub(super) quantity: String,
    /// What a spectrum is drawn against: `wavelength`, a curve for each variant, or
    /// `thickness`, its mean over 400-700 nm on logarithmic axes, a point for each.
    #[schemars(extend("enum" = [WAVELENGTH, THICKNESS]))]
    #[serde(default = "default_against")]
    pub(super) against: String,
    /// Where the axis of the quantity begins; with wavelengths only.
    #[schemars(range(min = 0.0, max = 0.99))]
    #[serde(default)]
    pub(super) from: f64,
    /// Directions in which a BRDF is drawn: those in the plane of incidence, a polar
    /// curve for each variant, or all, a disc for each. Default `principal_plane`.
    #[schemars(extend("enum" = [PRINCIPAL_PLANE, HEMISPHERE]))]
    pub(super) directions: Option<String>,
    /// Scale of a BRDF, of radius or of colour. Default `linear`.
    #[schemars(extend("enum" = [LINEAR, LOGARITHMIC]))]
    pub(super) scale: Option<String>,
    /// Sensors of the hemisphere that a BRDF is measured on. Default 1000.
    #[schemars(range(min = 1, max = MOST_SENSORS))]
    pub(super) sensors: Option<usize>,
}

/// One variant of the sample.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct VariantKeys {
    /// What it is called in the legend.
    pub(super) label: String,
    /// Variants of one group share a panel, with thicknesses a line, or with discs a row.
    #[serde(default)]
    pub(super) group: String,
    /// Keys of the sample changed in this variant, as in the `set` of all.
    #[schemars(schema_with = "changes")]
    #[serde(default)]
    pub(super) set: Table,
}

/// One published value.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct PublishedKeys {
    /// Whose it is; values of one label share a look.
    pub(super) label: String,
    /// Wavelength, nm.
    #[schemars(range(min = MODEL_RANGE_NM.0, max = MODEL_RANGE_NM.1))]
    pub(super) wavelength_nm: f64,
    /// The value.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub(super) value: f64,
    /// Least value, where a range is given.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub(super) min: Option<f64>,
    /// Largest value, where a range is given.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub(super) max: Option<f64>,
}

/// A table of any keys.
fn changes(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "object", "additionalProperties": true })
}

fn default_against() -> String {
    WAVELENGTH.to_owned()
}

fn quantities() -> Vec<&'static str> {
    let spectra = Quantity::ALL.map(Quantity::name);
    spectra.into_iter().chain([BRDF]).collect()
}
