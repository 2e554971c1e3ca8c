//! The keys of sample and grid files, their types, limits and meanings: the one
//! place from which the schema, the check and the help texts come. Comments of
//! the fields are those texts.
//!
//! Limits that involve two keys, or depend on tables, are in [`super::sample`],
//! [`super::grid`], [`super::shared`] and [`super::snow`].
use schemars::{JsonSchema, json_schema};
use serde::Deserialize;

use super::axis_keys::AxesKeys;
use crate::colour::{ColourDifference, Illuminant, IlluminantSpec, Viewing};
use crate::engine::Engine;
use crate::grain::SizeLaw;
use crate::grid::Spread;
use crate::optics::{CarbonLaw, IceTable, ImpurityMass, MODEL_RANGE_NM};
use crate::parameter::Parameter;
use crate::transport::{Entry, Joining};
use crate::units::HALF_SPACE_CM;

/// Least and largest value of a parameter in a config.
const fn ends(parameter: Parameter) -> (f64, f64) {
    let allowed = parameter.record().allowed;
    (allowed.min, allowed.max)
}

/// Most wavelengths of one config: 350-2500 nm by 1 nm.
pub(super) const MAX_WAVELENGTHS: u64 = 2151;
/// Most lights that colours are compared under.
const MAX_ILLUMINANTS: u64 = 16;
/// Limits of the dry density, kg/m3.
pub(super) const DENSITY_KG_M3: (f64, f64) = ends(Parameter::Density);
/// Limits of the water saturation of the pore space.
pub(super) const SATURATION: (f64, f64) = ends(Parameter::WaterSaturation);
/// Largest whole number of a config: above this a JSON reader that keeps numbers
/// as doubles would lose digits.
pub(super) const MAX_INTEGER: u64 = 9_007_199_254_740_991;
/// Limits of the temperature, Celsius.
pub(super) const TEMPERATURE_C: (f64, f64) = ends(Parameter::Temperature);
/// Most carbon, ng/g.
pub(super) const MAX_CARBON: f64 = ends(Parameter::BlackCarbon).1;
/// Limits of the grain size, um.
pub(super) const SIZE_UM: (f64, f64) = ends(Parameter::GrainSize);
/// Largest thickness that is no half space, cm.
pub(super) const MAX_THICKNESS_CM: f64 = ends(Parameter::Thickness).1;
/// Largest optical radius, um: of spheres of the largest size.
pub(super) const MAX_OPTICAL_RADIUS_UM: f64 = 3000.0;
/// Largest specific surface area, m2/kg.
pub(super) const MAX_SSA_M2_KG: f64 = 10_000.0;

pub(super) const ENTRIES: [(&str, Entry); 2] = [
    (Entry::Uniform.name(), Entry::Uniform),
    (Entry::Projected.name(), Entry::Projected),
];
pub(super) const SIZE_LAWS: [(&str, SizeLaw); 2] = [
    (SizeLaw::Varsa2025.name(), SizeLaw::Varsa2025),
    (SizeLaw::Consistent.name(), SizeLaw::Consistent),
];
pub(super) const JOININGS: [(&str, Joining); 2] = [
    (Joining::Continuous.name(), Joining::Continuous),
    (Joining::Cascade.name(), Joining::Cascade),
];
pub(super) const CARBON_LAWS: [(&str, CarbonLaw); 2] = [
    (CarbonLaw::Power.name(), CarbonLaw::Power),
    (CarbonLaw::Varsa2025.name(), CarbonLaw::Varsa2025),
];
pub(super) const IMPURITY_MASSES: [(&str, ImpurityMass); 2] = [
    (ImpurityMass::Varsa2025.name(), ImpurityMass::Varsa2025),
    (ImpurityMass::Conserved.name(), ImpurityMass::Conserved),
];
pub(super) const CONCENTRATIONS: [&str; 2] = ["dry_mass", "wet_mass"];
pub(super) const ICE_TABLES: [(&str, IceTable); 2] = [
    ("warren_brandt_2008", IceTable::WarrenBrandt2008),
    ("picard_2016", IceTable::Picard2016),
];
pub(super) const WATER_TABLES: [&str; 3] = ["segelstein_1981", "rowe_2020", "hale_querry_1973"];

fn names<T>(choices: &[(&'static str, T)]) -> Vec<&'static str> {
    choices.iter().map(|(name, _)| *name).collect()
}

/// A snow sample, its illumination and the wavelengths to measure it at.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "SPLITSnow sample file")]
pub(super) struct SampleKeys {
    /// Version of the file format; this program reads 1.
    #[schemars(range(min = 1, max = 1))]
    #[serde(rename = "version")]
    pub(super) _version: u32,
    pub(super) illumination: IlluminationKeys,
    pub(super) wavelengths: WavelengthKeys,
    /// Layers of the snowpack: the first [[layer]] is the base, the last the surface.
    #[schemars(length(min = 1, max = 100))]
    pub(super) layer: Vec<LayerKeys>,
    pub(super) substrate: Option<SubstrateKeys>,
    #[serde(default)]
    pub(super) model: ModelKeys,
}

/// The light: incidence_angle_deg, or diffuse = true.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [
    { "required": ["incidence_angle_deg"], "properties": { "diffuse": { "const": false } } },
    { "required": ["diffuse"], "properties": { "diffuse": { "const": true }, "incidence_angle_deg": false } },
]))]
pub(super) struct IlluminationKeys {
    /// Angle between parallel rays and the surface normal, degrees, in [0, 90).
    #[schemars(range(min = 0.0), extend("exclusiveMaximum" = 90.0))]
    pub(super) incidence_angle_deg: Option<f64>,
    /// Isotropic radiance over the whole upper hemisphere.
    #[serde(default)]
    pub(super) diffuse: bool,
}

/// Wavelengths, nm: start_nm, stop_nm and step_nm, or values_nm.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [
    { "required": ["start_nm", "stop_nm", "step_nm"], "properties": { "values_nm": false } },
    { "required": ["values_nm"], "properties": { "start_nm": false, "stop_nm": false, "step_nm": false } },
]))]
pub(super) struct WavelengthKeys {
    /// First wavelength, nm, in [350, 2500].
    #[schemars(range(min = MODEL_RANGE_NM.0, max = MODEL_RANGE_NM.1))]
    pub(super) start_nm: Option<f64>,
    /// Last wavelength, nm, in [350, 2500]: included if a whole number of steps leads there.
    #[schemars(range(min = MODEL_RANGE_NM.0, max = MODEL_RANGE_NM.1))]
    pub(super) stop_nm: Option<f64>,
    /// Distance between wavelengths, nm.
    #[schemars(range(max = 2150.0), extend("exclusiveMinimum" = 0.0))]
    pub(super) step_nm: Option<f64>,
    /// The wavelengths themselves, nm, strictly increasing in [350, 2500].
    #[schemars(
        length(min = 1, max = MAX_WAVELENGTHS),
        inner(range(min = MODEL_RANGE_NM.0, max = MODEL_RANGE_NM.1)),
        extend("uniqueItems" = true)
    )]
    pub(super) values_nm: Option<Vec<f64>>,
}

/// One homogeneous layer of snow.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [
    { "required": ["density_kg_m3"] }, { "required": ["wet_density_kg_m3"] },
], "not" = { "required": ["water_saturation", "water_fraction"] }))]
pub(super) struct LayerKeys {
    /// Thickness, cm; ordinarily 1 to 100. The snowpack, or in a cascade each layer,
    /// holds at least 10 lengths of its biggest grain. `inf` makes the base of a sample a half space.
    #[schemars(with = "f64", transform = or_half_space)]
    #[serde(deserialize_with = "thickness")]
    pub(super) thickness_cm: f64,
    /// Density of the dry snow, kg/m3: ordinarily 50 to 450; ice itself has about 917.
    #[schemars(range(min = DENSITY_KG_M3.0, max = DENSITY_KG_M3.1))]
    pub(super) density_kg_m3: Option<f64>,
    /// Density with the water in the pores, kg/m3, instead of density_kg_m3.
    #[schemars(range(min = DENSITY_KG_M3.0, max = 1000.0))]
    pub(super) wet_density_kg_m3: Option<f64>,
    /// Temperature, Celsius.
    #[schemars(range(min = TEMPERATURE_C.0, max = TEMPERATURE_C.1))]
    #[serde(default = "default_temperature_c")]
    pub(super) temperature_c: f64,
    /// Share of the pore space that is water; default 0, dry.
    #[schemars(range(min = SATURATION.0, max = SATURATION.1))]
    pub(super) water_saturation: Option<f64>,
    /// Share of the whole volume that is water, instead of water_saturation.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub(super) water_fraction: Option<f64>,
    /// Types of grain.
    #[schemars(length(min = 1, max = 100))]
    pub(super) grain: Vec<GrainKeys>,
    pub(super) black_carbon: Option<CarbonKeys>,
    pub(super) brown_carbon: Option<CarbonKeys>,
}

/// One type of grain.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [
    { "required": ["size_um"] }, { "required": ["optical_radius_um"] }, { "required": ["ssa_m2_kg"] },
]))]
pub(super) struct GrainKeys {
    /// Share of the ice volume; the shares of a layer sum to 1. May be left out for a single type.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub(super) fraction: Option<f64>,
    pub(super) size_um: Option<SizeKeys>,
    /// Optical radius, um, instead of size_um: grains are of the one size that has it by
    /// the walk's extinction, 3 / (4 K1 K2).
    #[schemars(range(max = MAX_OPTICAL_RADIUS_UM), extend("exclusiveMinimum" = 0.0))]
    pub(super) optical_radius_um: Option<f64>,
    /// Specific surface area, m2/kg, instead of size_um: grains are of the one size that
    /// has it by the walk's extinction, 4 K1 K2 / ice density.
    #[schemars(range(max = MAX_SSA_M2_KG), extend("exclusiveMinimum" = 0.0))]
    pub(super) ssa_m2_kg: Option<f64>,
    pub(super) facetness: FacetnessKeys,
    #[serde(default)]
    pub(super) sphericity: SphericityKeys,
}

/// Grain size (full length of the major axis), um, drawn uniformly in [min, max].
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SizeKeys {
    /// Smallest grain size, um: ordinarily at least 50, fresh surface snow down to 10.
    #[schemars(range(min = SIZE_UM.0, max = SIZE_UM.1))]
    pub(super) min: f64,
    /// Largest grain size, um: ordinarily at most 3000.
    #[schemars(range(min = SIZE_UM.0, max = SIZE_UM.1))]
    pub(super) max: f64,
}

/// Facetness, 0 (smooth) to 1: normal law cut to [min, max].
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct FacetnessKeys {
    /// Smallest facetness.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub(super) min: f64,
    /// Largest facetness.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub(super) max: f64,
    /// Mean of the law before it is cut, within [min, max].
    #[schemars(range(min = 0.0, max = 1.0))]
    pub(super) mean: f64,
    /// Standard deviation of the law before it is cut.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub(super) sd: f64,
}

/// Sphericity, in (0, 1], 1 is a sphere: normal law cut to [min, max].
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SphericityKeys {
    /// Smallest sphericity.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
    pub(super) min: f64,
    /// Largest sphericity.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
    pub(super) max: f64,
    /// Mean of the law before it is cut, within [min, max].
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
    pub(super) mean: f64,
    /// Standard deviation of the law before it is cut.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub(super) sd: f64,
}

impl Default for SphericityKeys {
    /// The representative sample of Varsa 2025, section 7.1.
    fn default() -> Self {
        Self {
            min: 0.6,
            max: 0.95,
            mean: 0.798,
            sd: 0.064,
        }
    }
}

/// Light-absorbing carbon.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("required" = ["concentration_ng_g"]))]
pub(super) struct CarbonKeys {
    /// Mass of carbon per mass of snow, ng/g.
    #[schemars(range(min = 0.0, max = MAX_CARBON), transform = without_default)]
    #[serde(default)]
    pub(super) concentration_ng_g: f64,
    /// Share of the carbon that sits in the ice, default 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub(super) sedimentation: Option<f64>,
    /// Mass absorption efficiency at the reference wavelength, m2/g, default 16.619.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub(super) mass_absorption_efficiency_m2_g: Option<f64>,
    /// Reference wavelength, nm, default 880.
    #[schemars(range(min = 100.0, max = 10_000.0))]
    pub(super) reference_wavelength_nm: Option<f64>,
    /// Angstrom exponent of the absorption, default 1 (black) or 2 (brown).
    #[schemars(range(min = 0.0, max = 20.0))]
    pub(super) angstrom_exponent: Option<f64>,
    /// Whether the concentration is per mass of the dry snow, or with its water.
    #[schemars(extend("enum" = CONCENTRATIONS))]
    #[serde(default = "default_concentration_per")]
    pub(super) concentration_per: String,
}

/// The schema says where it is required.
fn without_default(schema: &mut schemars::Schema) {
    schema.remove("default");
}

/// Of black carbon that is an axis only the kind is fixed.
fn carbon_of_any_amount(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
    let mut schema = CarbonKeys::json_schema(generator);
    schema.remove("required");
    schema
}

/// What lies below the snow: a Lambertian reflector, black by default.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SubstrateKeys {
    #[schemars(schema_with = "reflectance")]
    pub(super) reflectance: ReflectanceKeys,
}

#[derive(Deserialize)]
#[serde(untagged)]
pub(super) enum ReflectanceKeys {
    Number(f64),
    Path(String),
    /// One per wavelength.
    List(Vec<f64>),
}

fn reflectance(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    json_schema!({
        "description": "Lambertian reflectance: a number from 0 to 1, the path of a file with its spectrum relative to this file, or a list with a number for each wavelength.",
        "type": ["number", "string", "array"],
        "minimum": 0.0,
        "maximum": 1.0,
        "items": { "type": "number", "minimum": 0.0, "maximum": 1.0 },
        "minItems": 1,
        "maxItems": MAX_WAVELENGTHS,
    })
}

/// Choices within the model.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct ModelKeys {
    /// Where a ray enters a grain: uniformly over its facing surface, or over its projected area.
    #[schemars(extend("enum" = names(&ENTRIES)))]
    pub(super) entry: String,
    /// How often grains of a range of sizes are met: as published, which brings more ice
    /// than the density holds, or so that the ice met per metre is what it holds.
    #[schemars(extend("enum" = names(&SIZE_LAWS)))]
    pub(super) size_law: String,
    /// How layers are joined: walks go on from one to the next, or each is a slab
    /// of its own over the reflectance of all below it.
    #[schemars(extend("enum" = names(&JOININGS)))]
    pub(super) layers: String,
    /// Spectral law of carbon absorption: M (lambda_0 / lambda)^A, or as printed in Varsa 2025.
    #[schemars(extend("enum" = names(&CARBON_LAWS)))]
    pub(super) carbon_law: String,
    /// Whether carbon absorbs in each phase as if it filled the snow, or its mass is conserved.
    #[schemars(extend("enum" = names(&IMPURITY_MASSES)))]
    pub(super) impurity_mass: String,
    /// Refractive index of ice.
    #[schemars(extend("enum" = names(&ICE_TABLES)))]
    pub(super) ice: String,
    /// Refractive index of water: a table's name, or the path of a CSV file
    /// wavelength_nm,n,k relative to this file. Read only for wet snow.
    #[schemars(extend("anyOf" = [{ "enum": WATER_TABLES }, { "pattern": "\\.csv$" }]))]
    pub(super) water: String,
}

impl Default for ModelKeys {
    fn default() -> Self {
        Self {
            entry: "uniform".to_owned(),
            size_law: SizeLaw::default().name().to_owned(),
            layers: "continuous".to_owned(),
            carbon_law: "power".to_owned(),
            impurity_mass: "varsa2025".to_owned(),
            ice: "warren_brandt_2008".to_owned(),
            water: "segelstein_1981".to_owned(),
        }
    }
}

/// A spectral database: every combination of the axes is one curve.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "SPLITSnow grid file")]
pub(super) struct GridKeys {
    /// Version of the file format; this program reads 1.
    #[schemars(range(min = 1, max = 1))]
    #[serde(rename = "version")]
    pub(super) _version: u32,
    pub(super) axes: AxesKeys,
    #[serde(default)]
    pub(super) spread: SpreadKeys,
    pub(super) wavelengths: WavelengthKeys,
    #[serde(default)]
    pub(super) fixed: FixedKeys,
    #[serde(default)]
    pub(super) model: ModelKeys,
    #[serde(default)]
    pub(super) run: RunKeys,
    #[serde(default)]
    pub(super) compression: CompressionKeys,
}

/// Limits of a thickness, cm: a number, or "inf" for a half space.
pub(super) fn or_half_space(schema: &mut schemars::Schema) {
    schema.insert("type".to_owned(), serde_json::json!(["number", "string"]));
    schema.insert("exclusiveMinimum".to_owned(), 0.0.into());
    let branches = serde_json::json!([
        { "type": "number", "maximum": MAX_THICKNESS_CM },
        { "type": "number", "const": HALF_SPACE_CM },
        { "const": "inf" },
    ]);
    schema.insert("anyOf".to_owned(), branches);
}

/// A number, or "inf" for the thickness of a half space.
#[derive(Deserialize, Clone)]
#[serde(untagged)]
pub(super) enum NumberOrInf {
    Number(f64),
    /// The check against the schema lets "inf" pass only.
    Text(#[allow(dead_code)] String),
}

impl NumberOrInf {
    pub(super) fn number(self) -> f64 {
        match self {
            Self::Number(number) if number < f64::INFINITY => number,
            _ => HALF_SPACE_CM,
        }
    }
}

/// A thickness, cm: that of a half space is [`HALF_SPACE_CM`].
fn thickness<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    NumberOrInf::deserialize(from).map(NumberOrInf::number)
}

pub(super) fn limit_items(
    schema: &mut schemars::Schema,
    keyword: &str,
    limit: impl Into<serde_json::Value>,
) {
    if let Some(items) = schema.get_mut("items").and_then(|i| i.as_object_mut()) {
        items.insert(keyword.to_owned(), limit.into());
    }
}

/// Widths of the laws around an axis value.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SpreadKeys {
    /// Facetness is cut to mean -+ this, and to [0, 1].
    #[schemars(range(min = 0.0, max = 1.0))]
    pub(super) facetness_half_width: f64,
    /// Standard deviation of facetness before it is cut.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub(super) facetness_sd: f64,
    /// Grain size is uniform in mean -+ this, um. The default is 0 where the axis is
    /// optical_radius_um or ssa_m2_kg. In a grid the default is less than 50 where a
    /// grain would be below 10 um.
    #[schemars(range(min = 0.0, max = SIZE_UM.1))]
    pub(super) grain_size_half_width_um: f64,
    /// Where sphericity is an axis, it is cut to mean -+ this, and to (0, 1].
    #[schemars(range(min = 0.0, max = 1.0))]
    pub(super) sphericity_half_width: f64,
    /// Standard deviation of sphericity before it is cut, where it is an axis.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub(super) sphericity_sd: f64,
}

impl Default for SpreadKeys {
    fn default() -> Self {
        let spread = Spread::default();
        Self {
            facetness_half_width: spread.facetness_half_width,
            facetness_sd: spread.facetness_sd,
            grain_size_half_width_um: spread.grain_size_half_width_um,
            sphericity_half_width: spread.sphericity_half_width,
            sphericity_sd: spread.sphericity_sd,
        }
    }
}

/// What every curve has in common.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("not" = { "required": ["water_saturation", "water_fraction"] }))]
pub(super) struct FixedKeys {
    pub(super) sphericity: SphericityKeys,
    /// Temperature, Celsius.
    #[schemars(range(min = TEMPERATURE_C.0, max = TEMPERATURE_C.1))]
    pub(super) temperature_c: f64,
    /// Share of the pore space that is water; default 0, dry.
    #[schemars(range(min = SATURATION.0, max = SATURATION.1))]
    pub(super) water_saturation: Option<f64>,
    /// Share of the whole volume that is water, instead of water_saturation; with a single density only.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub(super) water_fraction: Option<f64>,
    #[schemars(schema_with = "carbon_of_any_amount")]
    pub(super) black_carbon: Option<CarbonKeys>,
    pub(super) brown_carbon: Option<CarbonKeys>,
    /// Layers under the snow of the axes: the first is the base. The thickness
    /// axis is that of all layers together.
    #[schemars(length(max = 100))]
    pub(super) below: Vec<LayerKeys>,
    pub(super) substrate: Option<SubstrateKeys>,
}

impl Default for FixedKeys {
    fn default() -> Self {
        Self {
            sphericity: SphericityKeys::default(),
            temperature_c: default_temperature_c(),
            water_saturation: None,
            water_fraction: None,
            black_carbon: None,
            brown_carbon: None,
            below: Vec::new(),
            substrate: None,
        }
    }
}

/// How the curves are computed.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RunKeys {
    /// The engine that runs the walks.
    #[schemars(extend("enum" = engine_names()))]
    #[serde(default = "default_engine")]
    pub(super) engine: String,
    /// Seed of the random streams.
    #[schemars(range(min = 0, max = MAX_INTEGER))]
    #[serde(default = "default_seed")]
    pub(super) seed: u64,
    /// Walks per curve: at each wavelength in `reference`, at each index node
    /// in `spectral` and `tabulated`, at each index node and angle in
    /// `hybrid`. May be left out in `auto`, which then takes as many as
    /// `max_error` needs; other engines need it.
    #[schemars(range(min = 1, max = 1_000_000_000_000_u64))]
    pub(super) rays: Option<u64>,
    /// Largest error of a curve in `auto`, which takes the cheapest engine that holds it.
    pub(super) max_error: Option<MaxErrorKeys>,
}

impl Default for RunKeys {
    fn default() -> Self {
        Self {
            engine: default_engine(),
            seed: default_seed(),
            rays: None,
            max_error: None,
        }
    }
}

/// Errors that `auto` may leave: of the simulation, before compression.
#[derive(Deserialize, JsonSchema, Default)]
#[serde(deny_unknown_fields, default)]
pub(super) struct MaxErrorKeys {
    /// Colour difference Delta-E*ab (CIE 1976), by default 0.3.
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub(super) delta_e: Option<f64>,
    /// Root-mean-square error over the wavelengths, one standard error; by
    /// default 0.0006, or 0.002 where there are wavelengths beyond 780 nm.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
    pub(super) rmse: Option<f64>,
}

/// Bounds on the curves rebuilt from the compact file.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct CompressionKeys {
    /// Largest colour difference Delta-E of any curve.
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub(super) max_delta_e: f64,
    /// Largest root-mean-square error of any curve, over all its wavelengths and in each
    /// band of them; by default that of a band is twice its largest standard error, but
    /// at least 0.002.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
    pub(super) max_rmse: Option<f64>,
    #[schemars(schema_with = "illuminants")]
    pub(super) illuminants: Vec<IlluminantSpec>,
    /// Formula of the colour difference.
    #[schemars(extend("enum" = ColourDifference::ALL.map(ColourDifference::name)))]
    pub(super) delta_e: String,
}

impl Default for CompressionKeys {
    fn default() -> Self {
        Self {
            max_delta_e: 2.3,
            max_rmse: None,
            illuminants: default_illuminants(),
            delta_e: default_delta_e(),
        }
    }
}

/// Names, paths, or the tables themselves, as files keep them.
pub(super) fn illuminants(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    json_schema!({
        "description": "Lights that colours are compared under; of several the worst case counts. What is no name is the path of a table of relative power, relative to this file.",
        "type": "array",
        "minItems": 1,
        "maxItems": MAX_ILLUMINANTS,
        "uniqueItems": true,
        "items": {
            "type": ["string", "object"],
            "examples": Illuminant::NAMES,
            "properties": {
                "name": { "type": "string", "description": "What the table is called." },
                "wavelength_nm": table_column("Wavelengths of the table, nm, strictly increasing."),
                "power": table_column("Relative power at each of them, 0 or more."),
            },
            "required": ["name", "wavelength_nm", "power"],
            "additionalProperties": false,
        },
    })
}

fn table_column(description: &str) -> serde_json::Value {
    serde_json::json!({
        "type": "array",
        "description": description,
        "items": { "type": "number" },
        "minItems": 2,
        "maxItems": 100_000,
    })
}

pub(super) fn default_illuminants() -> Vec<IlluminantSpec> {
    let all = Viewing::default().illuminants.into_iter();
    all.map(IlluminantSpec::from).collect()
}

pub(super) fn default_delta_e() -> String {
    Viewing::default().difference.name().to_owned()
}

fn default_temperature_c() -> f64 {
    -1.0
}

fn default_concentration_per() -> String {
    CONCENTRATIONS[0].to_owned()
}

fn engine_names() -> Vec<&'static str> {
    Engine::ALL.map(Engine::name).into()
}

fn default_engine() -> String {
    Engine::Auto.name().to_owned()
}

pub(super) fn default_seed() -> u64 {
    1
}
