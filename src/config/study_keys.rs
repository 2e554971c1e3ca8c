//! The keys of study files; see [`super::keys`] for those of sample and grid files.
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

/// A sample, variants of it that change some of its keys, and the plot to draw.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "SPLITSnow study file")]
pub(super) struct StudyKeys {
    /// Version of the file format; must be 1.
    #[schemars(range(min = 1, max = 1))]
    #[serde(rename = "version")]
    pub(super) _version: u32,
    /// Title of the figure.
    pub(super) title: String,
    /// Expected result and its source; printed under the title.
    pub(super) expected: String,
    /// Path of the sample file that the variants change, relative to this file.
    pub(super) sample: String,
    pub(super) draw: DrawKeys,
    /// Keys of the sample to change in all variants: a quoted path such as
    /// "layer[0].density_kg_m3", and its value. The index after the last entry of a list
    /// appends to the list.
    #[schemars(schema_with = "changes")]
    #[serde(default)]
    pub(super) set: Table,
    /// Variants of the sample: each is a curve or a point of a curve.
    #[schemars(length(min = 1, max = 100))]
    pub(super) variant: Vec<VariantKeys>,
    /// Published values to draw with the curves; only with draw.against = "wavelength".
    #[schemars(length(max = 100))]
    #[serde(default)]
    pub(super) published: Vec<PublishedKeys>,
}

/// The plot to draw.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct DrawKeys {
    /// Quantity to draw; `brdf` requires that every variant has a single wavelength.
    #[schemars(extend("enum" = quantities()))]
    pub(super) quantity: String,
    /// Horizontal axis of spectra: `wavelength` draws one curve per variant; `thickness`
    /// draws one point per variant, the mean over 400-700 nm, on logarithmic axes.
    #[schemars(extend("enum" = [WAVELENGTH, THICKNESS]))]
    #[serde(default = "default_against")]
    pub(super) against: String,
    /// Lower end of the vertical axis; only with against = "wavelength".
    #[schemars(range(min = 0.0, max = 0.99))]
    #[serde(default)]
    pub(super) from: f64,
    /// Directions in which a BRDF is drawn: those in the plane of incidence, as one polar
    /// curve per variant (`principal_plane`, the default), or all directions, as one disc
    /// per variant (`hemisphere`).
    #[schemars(extend("enum" = [PRINCIPAL_PLANE, HEMISPHERE]))]
    pub(super) directions: Option<String>,
    /// Scale of the BRDF: of the radius of polar curves, or of the colour of discs;
    /// default `linear`.
    #[schemars(extend("enum" = [LINEAR, LOGARITHMIC]))]
    pub(super) scale: Option<String>,
    /// Number of sensors on the hemisphere that measures a BRDF; default 1000.
    #[schemars(range(min = 1, max = MOST_SENSORS))]
    pub(super) sensors: Option<usize>,
}

/// One variant of the sample.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct VariantKeys {
    /// Name in the legend.
    pub(super) label: String,
    /// Group of the variant. Variants of a group share a panel; against thickness they
    /// share a line, and discs share a row.
    #[serde(default)]
    pub(super) group: String,
    /// Keys of the sample to change in this variant, as in the `set` of all variants.
    #[schemars(schema_with = "changes")]
    #[serde(default)]
    pub(super) set: Table,
}

/// One published value.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct PublishedKeys {
    /// Name of the source in the legend; values with the same label share a marker.
    pub(super) label: String,
    /// Wavelength, nm.
    #[schemars(range(min = MODEL_RANGE_NM.0, max = MODEL_RANGE_NM.1))]
    pub(super) wavelength_nm: f64,
    /// Value of the quantity.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub(super) value: f64,
    /// Lower end of the published range; optional, with max.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub(super) min: Option<f64>,
    /// Upper end of the published range; optional, with min.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub(super) max: Option<f64>,
}

/// The schema of a table with arbitrary keys.
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
