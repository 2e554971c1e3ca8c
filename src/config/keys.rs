//! The keys of sample and grid files, with their types, limits and descriptions.
//! The JSON Schemas, the checks and the help texts are all generated from this
//! module: the doc comment of a field is the description that users read.
//!
//! Limits that involve two keys, or that depend on tables, are in
//! [`super::sample`], [`super::grid`], [`super::shared`] and [`super::snow`].
use schemars::{JsonSchema, json_schema};
use serde::Deserialize;

use super::absorber::MAX_EFFICIENCY;
use super::axis_keys::AxesKeys;
use crate::colour::{ColourDifference, Illuminant, IlluminantSpec, Viewing};
use crate::engine::Engine;
use crate::grain::{Facets, Shape, SizeLaw};
use crate::grid::{GridViews, Spread};
use crate::optics::{CarbonLaw, IceTable, ImpurityMass, MODEL_RANGE_NM, SPECIES};
use crate::parameter::Parameter;
use crate::transport::{Entry, Joining};
use crate::units::HALF_SPACE_CM;

/// Smallest and largest value that a config file may give for a parameter.
const fn limits(parameter: Parameter) -> (f64, f64) {
    let allowed = parameter.record().allowed;
    (allowed.min, allowed.max)
}

/// Largest number of wavelengths in a config file: 350-5000 nm in steps of 1 nm.
pub(super) const MAX_WAVELENGTHS: u64 = 4651;
/// Largest number of illuminants that colours are compared under.
const MAX_ILLUMINANTS: u64 = 16;
/// Limits of the dry density, kg/m3.
pub(super) const DENSITY_KG_M3: (f64, f64) = limits(Parameter::Density);
/// Limits of the water saturation of the pore space.
pub(super) const SATURATION: (f64, f64) = limits(Parameter::WaterSaturation);
/// Largest integer in a config file, 2^53 - 1. JSON readers that store numbers as
/// doubles would lose digits of larger ones.
pub(super) const MAX_INTEGER: u64 = 9_007_199_254_740_991;
/// Limits of the temperature, degrees Celsius.
pub(super) const TEMPERATURE_C: (f64, f64) = limits(Parameter::Temperature);
/// Largest carbon concentration, ng/g.
pub(super) const MAX_CARBON: f64 = limits(Parameter::BlackCarbon).1;
/// Limits of the grain size, um.
pub(super) const SIZE_UM: (f64, f64) = limits(Parameter::GrainSize);
/// Largest finite thickness, cm; above it only the half space is allowed.
pub(super) const MAX_THICKNESS_CM: f64 = limits(Parameter::Thickness).1;
/// Limits of the aspect ratio of prisms.
pub(super) const ASPECT_RATIO: (f64, f64) = (0.02, 50.0);
/// Largest optical radius, um: the radius of spheres of the largest grain size.
pub(super) const MAX_OPTICAL_RADIUS_UM: f64 = 3000.0;
/// Largest specific surface area, m2/kg.
pub(super) const MAX_SSA_M2_KG: f64 = 10_000.0;

/// Model options that a preset sets.
pub(super) type Preset = (Entry, Facets, SizeLaw);
pub(super) const PRESETS: [(&str, Preset); 2] = [
    (
        "varsa2025",
        (Entry::Uniform, Facets::Varsa2025, SizeLaw::Varsa2025),
    ),
    (
        "measured",
        (Entry::Projected, Facets::VGroove, SizeLaw::Consistent),
    ),
];
pub(super) const ENTRIES: [(&str, Entry); 2] = [
    (Entry::Uniform.name(), Entry::Uniform),
    (Entry::Projected.name(), Entry::Projected),
];
pub(super) const FACETS: [(&str, Facets); 3] = [
    (Facets::Varsa2025.name(), Facets::Varsa2025),
    (Facets::Visible.name(), Facets::Visible),
    (Facets::VGroove.name(), Facets::VGroove),
];
pub(super) const SHAPES: [(&str, Shape); 3] = [
    (Shape::Spheroid.name(), Shape::Spheroid),
    (Shape::Oblate.name(), Shape::Oblate),
    (Shape::Hexagonal.name(), Shape::Hexagonal),
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

/// A snow sample, its illumination and the wavelengths at which it is simulated.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "SPLITSnow sample file")]
pub(super) struct SampleKeys {
    /// Version of the file format; must be 1.
    #[schemars(range(min = 1, max = 1))]
    #[serde(rename = "version")]
    pub(super) _version: u32,
    pub(super) illumination: IlluminationKeys,
    pub(super) wavelengths: WavelengthKeys,
    /// Layers of the snowpack, from the base up: the first [[layer]] is the base, the
    /// last one the surface.
    #[schemars(length(min = 1, max = 100))]
    pub(super) layer: Vec<LayerKeys>,
    pub(super) substrate: Option<SubstrateKeys>,
    #[serde(default)]
    pub(super) model: ModelKeys,
}

/// The incident light: give either incidence_angle_deg (a collimated beam) or diffuse = true.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [
    { "required": ["incidence_angle_deg"], "properties": { "diffuse": { "const": false } } },
    { "required": ["diffuse"], "properties": { "diffuse": { "const": true }, "incidence_angle_deg": false } },
]))]
pub(super) struct IlluminationKeys {
    /// Incidence angle of a collimated beam, measured from the surface normal, degrees,
    /// in [0, 90).
    #[schemars(range(min = 0.0), extend("exclusiveMaximum" = 90.0))]
    pub(super) incidence_angle_deg: Option<f64>,
    /// True for diffuse light: isotropic radiance over the whole upper hemisphere.
    #[serde(default)]
    pub(super) diffuse: bool,
}

/// Wavelengths, nm: give either start_nm, stop_nm and step_nm, or values_nm.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [
    { "required": ["start_nm", "stop_nm", "step_nm"], "properties": { "values_nm": false } },
    { "required": ["values_nm"], "properties": { "start_nm": false, "stop_nm": false, "step_nm": false } },
]))]
pub(super) struct WavelengthKeys {
    /// First wavelength, nm, in [350, 5000]; beyond 2500 see docs/methods.md.
    #[schemars(range(min = MODEL_RANGE_NM.0, max = MODEL_RANGE_NM.1))]
    pub(super) start_nm: Option<f64>,
    /// Last wavelength, nm, in [350, 5000]. It is included if it lies a whole number of
    /// steps from start_nm.
    #[schemars(range(min = MODEL_RANGE_NM.0, max = MODEL_RANGE_NM.1))]
    pub(super) stop_nm: Option<f64>,
    /// Step between wavelengths, nm.
    #[schemars(range(max = 4650.0), extend("exclusiveMinimum" = 0.0))]
    pub(super) step_nm: Option<f64>,
    /// List of wavelengths, nm, in [350, 5000], strictly increasing.
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
    /// Thickness, cm; ordinarily 1 to 100. The snowpack (with model.layers = "cascade",
    /// each layer) must be at least 10 times as thick as its largest grain is long. In
    /// the base layer of a sample, `inf` is a half space.
    #[schemars(with = "f64", transform = or_half_space)]
    #[serde(deserialize_with = "thickness")]
    pub(super) thickness_cm: f64,
    /// Density of the dry snow, kg/m3; ordinarily 50 to 450, below that of ice (about 917).
    #[schemars(range(min = DENSITY_KG_M3.0, max = DENSITY_KG_M3.1))]
    pub(super) density_kg_m3: Option<f64>,
    /// Density of the snow including the liquid water in its pores, kg/m3, instead of
    /// density_kg_m3.
    #[schemars(range(min = DENSITY_KG_M3.0, max = 1000.0))]
    pub(super) wet_density_kg_m3: Option<f64>,
    /// Temperature, degrees Celsius.
    #[schemars(range(min = TEMPERATURE_C.0, max = TEMPERATURE_C.1))]
    #[serde(default = "default_temperature_c")]
    pub(super) temperature_c: f64,
    /// Fraction of the pore space that is filled with liquid water; default 0 (dry snow).
    #[schemars(range(min = SATURATION.0, max = SATURATION.1))]
    pub(super) water_saturation: Option<f64>,
    /// Fraction of the total volume that is liquid water, instead of water_saturation.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub(super) water_fraction: Option<f64>,
    /// Grain types of the layer.
    #[schemars(length(min = 1, max = 100))]
    pub(super) grain: Vec<GrainKeys>,
    pub(super) black_carbon: Option<CarbonKeys>,
    pub(super) brown_carbon: Option<CarbonKeys>,
    /// Other light-absorbing substances in the layer.
    #[schemars(length(max = 100))]
    #[serde(default)]
    pub(super) absorber: Vec<AbsorberKeys>,
}

/// One grain type: the distributions of its size, facetness and shape.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [
    { "required": ["size_um"] }, { "required": ["optical_radius_um"] }, { "required": ["ssa_m2_kg"] },
]))]
pub(super) struct GrainKeys {
    /// Fraction of the ice volume of the layer; the fractions of a layer must sum to 1.
    /// Optional if the layer has a single grain type.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub(super) fraction: Option<f64>,
    pub(super) size_um: Option<SizeKeys>,
    /// Optical radius, um, instead of size_um. All grains have the one size whose optical
    /// radius, computed from the extinction of the walk as 3 / (4 K1 K2), has this value.
    #[schemars(range(max = MAX_OPTICAL_RADIUS_UM), extend("exclusiveMinimum" = 0.0))]
    pub(super) optical_radius_um: Option<f64>,
    /// Specific surface area, m2/kg, instead of size_um. All grains have the one size
    /// whose specific surface area, computed from the extinction of the walk as
    /// 4 K1 K2 / ice density, has this value.
    #[schemars(range(max = MAX_SSA_M2_KG), extend("exclusiveMinimum" = 0.0))]
    pub(super) ssa_m2_kg: Option<f64>,
    pub(super) facetness: FacetnessKeys,
    /// Shape of the grains: prolate spheroids (`spheroid`), oblate ones (`oblate`), or
    /// hexagonal columns and plates (`hexagonal`).
    #[serde(default = "default_shape")]
    #[schemars(extend("enum" = names(&SHAPES)))]
    pub(super) shape: String,
    #[serde(default)]
    pub(super) sphericity: SphericityKeys,
    pub(super) aspect_ratio: Option<AspectRatioKeys>,
}

fn default_shape() -> String {
    Shape::default().name().to_owned()
}

/// Grain size (full length of the major axis), um, drawn uniformly in [min, max].
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SizeKeys {
    /// Smallest grain size, um; ordinarily at least 50, down to 10 in fresh surface snow.
    #[schemars(range(min = SIZE_UM.0, max = SIZE_UM.1))]
    pub(super) min: f64,
    /// Largest grain size, um; ordinarily at most 3000.
    #[schemars(range(min = SIZE_UM.0, max = SIZE_UM.1))]
    pub(super) max: f64,
}

/// Facetness, 0 (smooth) to 1: a normal distribution truncated to [min, max].
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct FacetnessKeys {
    /// Smallest facetness.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub(super) min: f64,
    /// Largest facetness.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub(super) max: f64,
    /// Mean of the normal distribution before truncation; must be in [min, max].
    #[schemars(range(min = 0.0, max = 1.0))]
    pub(super) mean: f64,
    /// Standard deviation of the normal distribution before truncation.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub(super) sd: f64,
}

/// Sphericity, in (0, 1], where 1 is a sphere: a normal distribution truncated to [min, max].
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SphericityKeys {
    /// Smallest sphericity.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
    pub(super) min: f64,
    /// Largest sphericity.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
    pub(super) max: f64,
    /// Mean of the normal distribution before truncation; must be in [min, max].
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
    pub(super) mean: f64,
    /// Standard deviation of the normal distribution before truncation.
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

/// Aspect ratio of hexagonal prisms, height / diameter: a normal distribution truncated to
/// [min, max]. Below 1 they are plates, above it columns. Only with the shape `hexagonal`,
/// which requires it and has no sphericity.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct AspectRatioKeys {
    /// Smallest aspect ratio.
    #[schemars(range(min = ASPECT_RATIO.0, max = ASPECT_RATIO.1))]
    pub(super) min: f64,
    /// Largest aspect ratio.
    #[schemars(range(min = ASPECT_RATIO.0, max = ASPECT_RATIO.1))]
    pub(super) max: f64,
    /// Mean of the normal distribution before truncation; must be in [min, max].
    #[schemars(range(min = ASPECT_RATIO.0, max = ASPECT_RATIO.1))]
    pub(super) mean: f64,
    /// Standard deviation of the normal distribution before truncation.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub(super) sd: f64,
}

/// Light-absorbing carbon in the snow.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("required" = ["concentration_ng_g"]))]
pub(super) struct CarbonKeys {
    /// Mass of carbon per mass of snow, ng/g.
    #[schemars(range(min = 0.0, max = MAX_CARBON), transform = without_default)]
    #[serde(default)]
    pub(super) concentration_ng_g: f64,
    /// Fraction of the carbon that is inside the ice; default 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub(super) sedimentation: Option<f64>,
    /// Mass absorption efficiency at the reference wavelength, m2/g; default 16.619.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub(super) mass_absorption_efficiency_m2_g: Option<f64>,
    /// Reference wavelength of the mass absorption efficiency, nm; default 880.
    #[schemars(range(min = 100.0, max = 10_000.0))]
    pub(super) reference_wavelength_nm: Option<f64>,
    /// Absorption Angstrom exponent; default 1 for black carbon, 2 for brown carbon.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub(super) angstrom_exponent: Option<f64>,
    /// Mass that the concentration refers to: that of the dry snow (`dry_mass`), or that
    /// of the snow with its liquid water (`wet_mass`).
    #[schemars(extend("enum" = CONCENTRATIONS))]
    #[serde(default = "default_concentration_per")]
    pub(super) concentration_per: String,
}

/// A light-absorbing substance in the snow, such as mineral dust. Its mass absorption
/// efficiency comes from `species`, from `file`, or from `mass_absorption_efficiency_m2_g`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [
    { "required": ["species"] }, { "required": ["file"] },
    { "required": ["mass_absorption_efficiency_m2_g"] },
]))]
pub(super) struct AbsorberKeys {
    /// Name in messages and files; default the species, or the name of the file.
    pub(super) name: Option<String>,
    /// Mass per mass of snow, ng/g.
    #[schemars(range(min = 0.0, max = MAX_CARBON))]
    pub(super) concentration_ng_g: Option<f64>,
    /// Mass per mass of snow, ug/g, instead of concentration_ng_g.
    #[schemars(range(min = 0.0, max = 1e-3 * MAX_CARBON))]
    pub(super) concentration_ug_g: Option<f64>,
    /// Mass that the concentration refers to: that of the dry snow (`dry_mass`), or that
    /// of the snow with its liquid water (`wet_mass`).
    #[schemars(extend("enum" = CONCENTRATIONS))]
    #[serde(default = "default_concentration_per")]
    pub(super) concentration_per: String,
    /// Where it is: inside the ice (`ice`, default) or in the pore space (`pores`).
    #[schemars(extend("enum" = ["ice", "pores"]))]
    pub(super) phase: Option<String>,
    /// Fraction of it that is inside the ice, instead of phase.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub(super) sedimentation: Option<f64>,
    /// A substance whose mass absorption efficiency is known (docs/absorbers.md).
    #[schemars(extend("enum" = species()))]
    pub(super) species: Option<String>,
    /// CSV file with the columns wavelength_nm,mac_m2_g, relative to this file, that covers
    /// all wavelengths; log-log between its rows.
    pub(super) file: Option<String>,
    #[schemars(schema_with = "efficiency")]
    #[serde(default)]
    pub(super) mass_absorption_efficiency_m2_g: Option<EfficiencyKeys>,
    /// Wavelength at which mass_absorption_efficiency_m2_g is one number, nm.
    #[schemars(range(min = 100.0, max = 10_000.0))]
    pub(super) reference_wavelength_nm: Option<f64>,
    /// Absorption Angstrom exponent; needed with mass_absorption_efficiency_m2_g as one number.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub(super) angstrom_exponent: Option<f64>,
    /// Mass scattering efficiency of particles in the pores, m2/g, the same at all wavelengths;
    /// without it they do not scatter.
    #[schemars(range(min = 0.0, max = MAX_EFFICIENCY))]
    pub(super) mass_scattering_efficiency_m2_g: Option<f64>,
    /// Asymmetry parameter of their phase function (Henyey-Greenstein); needed with
    /// mass_scattering_efficiency_m2_g.
    #[schemars(range(min = -0.95, max = 0.95))]
    pub(super) asymmetry_parameter: Option<f64>,
}

#[derive(Deserialize)]
#[serde(untagged)]
pub(super) enum EfficiencyKeys {
    Number(f64),
    /// One per wavelength.
    List(Vec<f64>),
}

fn species() -> Vec<&'static str> {
    SPECIES.iter().map(|species| species.name).collect()
}

fn efficiency(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    json_schema!({
        "description": "Mass absorption efficiency, m2/g: a number at reference_wavelength_nm, or a list with one number per wavelength.",
        "type": ["number", "array"],
        "minimum": 0.0,
        "maximum": MAX_EFFICIENCY,
        "items": { "type": "number", "minimum": 0.0, "maximum": MAX_EFFICIENCY },
        "minItems": 1,
        "maxItems": MAX_WAVELENGTHS,
    })
}

/// Removes the default from a schema whose parent lists the key as required.
fn without_default(schema: &mut schemars::Schema) {
    schema.remove("default");
}

/// The schema of carbon without a required concentration: where black carbon is an
/// axis, the axis gives the concentration and only the other properties are fixed.
fn carbon_of_any_amount(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
    let mut schema = CarbonKeys::json_schema(generator);
    schema.remove("required");
    schema
}

/// The substrate under the snow: a Lambertian reflector; black by default.
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
    /// One reflectance per wavelength.
    List(Vec<f64>),
}

fn reflectance(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    json_schema!({
        "description": "Lambertian reflectance: a number from 0 to 1, a list with one number per wavelength, or the path of a file with a reflectance spectrum, relative to this file.",
        "type": ["number", "string", "array"],
        "minimum": 0.0,
        "maximum": 1.0,
        "items": { "type": "number", "minimum": 0.0, "maximum": 1.0 },
        "minItems": 1,
        "maxItems": MAX_WAVELENGTHS,
    })
}

/// Model options.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct ModelKeys {
    /// Values of `entry`, `facets` and `size_law` where these keys are not given: as published
    /// (`varsa2025`: uniform, varsa2025, varsa2025), or those that agree best with measured
    /// directions (`measured`: projected, v_groove, consistent).
    #[schemars(extend("enum" = names(&PRESETS)))]
    pub(super) preset: String,
    /// Distribution of the points where rays enter a grain: uniform over the surface
    /// that faces the ray (`uniform`), or over the projected area, with which attitudes are
    /// weighted too (`projected`): exact for randomly placed grains.
    #[schemars(extend("enum" = names(&ENTRIES)))]
    pub(super) entry: String,
    /// Which facets of a grain a ray meets: any that faces it (`varsa2025`), in proportion
    /// to the area that the ray sees (`visible`), or the sides of V-grooves, with further
    /// hits inside the groove (`v_groove`), which alone conserves etendue.
    #[schemars(extend("enum" = names(&FACETS)))]
    pub(super) facets: String,
    /// How often a ray meets grains of each size in a size range: as published
    /// (`varsa2025`), where a ray crosses more ice per metre than the density holds, or
    /// such that the ice per metre agrees with the density (`consistent`).
    #[schemars(extend("enum" = names(&SIZE_LAWS)))]
    pub(super) size_law: String,
    /// How layers are combined: walks continue from one layer into the next
    /// (`continuous`), or each layer is a separate slab over a substrate that has the
    /// reflectance of everything below it (`cascade`).
    #[schemars(extend("enum" = names(&JOININGS)))]
    pub(super) layers: String,
    /// Spectral law of carbon absorption: M (lambda_0 / lambda)^A (`power`), or the formula
    /// as printed in Varsa 2025 (`varsa2025`).
    #[schemars(extend("enum" = names(&CARBON_LAWS)))]
    pub(super) carbon_law: String,
    /// How much carbon absorbs in each phase: as if the phase filled the whole snow
    /// (`varsa2025`), or such that the mass of carbon is conserved (`conserved`).
    #[schemars(extend("enum" = names(&IMPURITY_MASSES)))]
    pub(super) impurity_mass: String,
    /// Table of the refractive index of ice.
    #[schemars(extend("enum" = names(&ICE_TABLES)))]
    pub(super) ice: String,
    /// Refractive index of water: the name of a table, or the path of a CSV file with
    /// the columns wavelength_nm,n,k, relative to this file. Used for wet snow only.
    #[schemars(extend("anyOf" = [{ "enum": WATER_TABLES }, { "pattern": "\\.csv$" }]))]
    pub(super) water: String,
}

impl Default for ModelKeys {
    fn default() -> Self {
        Self {
            preset: PRESETS[0].0.to_owned(),
            entry: Entry::default().name().to_owned(),
            facets: Facets::default().name().to_owned(),
            size_law: SizeLaw::default().name().to_owned(),
            layers: "continuous".to_owned(),
            carbon_law: "power".to_owned(),
            impurity_mass: "varsa2025".to_owned(),
            ice: "warren_brandt_2008".to_owned(),
            water: "segelstein_1981".to_owned(),
        }
    }
}

/// A spectral database: every combination of axis values is one curve (spectrum).
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "SPLITSnow grid file")]
pub(super) struct GridKeys {
    /// Version of the file format; must be 1.
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

/// Adds the limits of a thickness, cm: a number, or "inf" for a half space.
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
    /// Always "inf": the check against the schema refuses any other text.
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

/// Reads a thickness, cm; a half space is [`HALF_SPACE_CM`].
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

/// Widths of the distributions of facetness, grain size and sphericity around an axis value.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SpreadKeys {
    /// Half width of the facetness distribution: it is truncated to mean +- this value,
    /// and to [0, 1].
    #[schemars(range(min = 0.0, max = 1.0))]
    pub(super) facetness_half_width: f64,
    /// Standard deviation of facetness before truncation.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub(super) facetness_sd: f64,
    /// Half width of the grain size distribution, um: sizes are uniform in mean +- this
    /// value. The default is 0 if the axis is optical_radius_um or ssa_m2_kg. In a grid,
    /// the default is lower than 50 if grains would otherwise be smaller than 10 um.
    #[schemars(range(min = 0.0, max = SIZE_UM.1))]
    pub(super) grain_size_half_width_um: f64,
    /// Half width of the sphericity distribution if sphericity is an axis: it is
    /// truncated to mean +- this value, and to (0, 1].
    #[schemars(range(min = 0.0, max = 1.0))]
    pub(super) sphericity_half_width: f64,
    /// Standard deviation of sphericity before truncation, if sphericity is an axis.
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

/// Properties that all curves share.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("not" = { "required": ["water_saturation", "water_fraction"] }))]
pub(super) struct FixedKeys {
    /// Shape of the grains: prolate spheroids (`spheroid`), oblate ones (`oblate`), or
    /// hexagonal columns and plates (`hexagonal`).
    #[schemars(extend("enum" = names(&SHAPES)))]
    pub(super) shape: String,
    pub(super) sphericity: SphericityKeys,
    pub(super) aspect_ratio: Option<AspectRatioKeys>,
    /// Temperature, degrees Celsius.
    #[schemars(range(min = TEMPERATURE_C.0, max = TEMPERATURE_C.1))]
    pub(super) temperature_c: f64,
    /// Fraction of the pore space that is filled with liquid water; default 0 (dry snow).
    #[schemars(range(min = SATURATION.0, max = SATURATION.1))]
    pub(super) water_saturation: Option<f64>,
    /// Fraction of the total volume that is liquid water, instead of water_saturation.
    /// Only allowed with a single density.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub(super) water_fraction: Option<f64>,
    #[schemars(schema_with = "carbon_of_any_amount")]
    pub(super) black_carbon: Option<CarbonKeys>,
    pub(super) brown_carbon: Option<CarbonKeys>,
    /// Other light-absorbing substances in the surface layer. If `absorber_ug_g` is an axis,
    /// it gives the mass of the first one.
    #[schemars(length(max = 100))]
    pub(super) absorber: Vec<AbsorberKeys>,
    /// Layers under the surface layer that the axes describe, from the base up. The
    /// thickness axis is the total thickness of all layers.
    #[schemars(length(max = 100))]
    pub(super) below: Vec<LayerKeys>,
    pub(super) substrate: Option<SubstrateKeys>,
}

impl Default for FixedKeys {
    fn default() -> Self {
        Self {
            shape: default_shape(),
            sphericity: SphericityKeys::default(),
            aspect_ratio: None,
            temperature_c: default_temperature_c(),
            water_saturation: None,
            water_fraction: None,
            black_carbon: None,
            brown_carbon: None,
            absorber: Vec::new(),
            below: Vec::new(),
            substrate: None,
        }
    }
}

/// How the curves are simulated: engine, seed and number of walks.
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
    /// Number of walks per curve: per wavelength in `reference`, per index node in
    /// `spectral` and `tabulated`, per index node and angle in `hybrid`. Optional with
    /// `auto`, which by default takes as many as `max_error` needs; required with the
    /// other engines.
    #[schemars(range(min = 1, max = 1_000_000_000_000_u64))]
    pub(super) rays: Option<u64>,
    /// Number of walks per curve for the light toward views; only with axes.view_deg.
    #[schemars(range(min = 1, max = 1_000_000_000_000_u64))]
    #[schemars(extend("default" = GridViews::RAYS))]
    pub(super) view_rays: Option<u64>,
    /// Largest error of a curve, for the engine `auto`, which selects the cheapest engine
    /// that meets it.
    pub(super) max_error: Option<MaxErrorKeys>,
}

impl Default for RunKeys {
    fn default() -> Self {
        Self {
            engine: default_engine(),
            seed: default_seed(),
            rays: None,
            view_rays: None,
            max_error: None,
        }
    }
}

/// Largest errors of the simulation, before compression, that the engine `auto` may leave.
#[derive(Deserialize, JsonSchema, Default)]
#[serde(deny_unknown_fields, default)]
pub(super) struct MaxErrorKeys {
    /// Largest colour difference Delta-E*ab (CIE 1976); default 0.3.
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub(super) delta_e: Option<f64>,
    /// Largest root-mean-square error over the wavelengths, as one standard error;
    /// default 0.0006, or 0.002 if there are wavelengths above 780 nm.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
    pub(super) rmse: Option<f64>,
}

/// Bounds on the errors of the curves that are reconstructed from the compact file.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct CompressionKeys {
    /// Largest colour difference Delta-E of any curve.
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub(super) max_delta_e: f64,
    /// Largest root-mean-square error of any curve, over all its wavelengths and within
    /// each wavelength band. By default, the bound of a band is twice its largest
    /// standard error, but at least 0.002.
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

/// The schema of illuminants: names, paths, or inline tables as in self-contained files.
pub(super) fn illuminants(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    json_schema!({
        "description": "Illuminants that colours are compared under; if there are several, the largest difference counts. Each is the name of a standard illuminant, or the path of a table of relative power, relative to this file.",
        "type": "array",
        "minItems": 1,
        "maxItems": MAX_ILLUMINANTS,
        "uniqueItems": true,
        "items": {
            "type": ["string", "object"],
            "examples": Illuminant::NAMES,
            "properties": {
                "name": { "type": "string", "description": "Name of the illuminant." },
                "wavelength_nm": table_column("Wavelengths of the table, nm, strictly increasing."),
                "power": table_column("Relative power at each wavelength, 0 or more."),
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
    let illuminants = Viewing::default().illuminants.into_iter();
    illuminants.map(IlluminantSpec::from).collect()
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
