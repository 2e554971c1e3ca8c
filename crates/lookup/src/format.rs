//! What the compact file `snow.safetensors` holds; its writer and its reader
//! share these names and ranges.
//!
//! A safetensors file: 8 bytes little-endian header length, a JSON header padded
//! with spaces to a multiple of 8, little-endian data without gaps. Data are in the
//! order of their element size, largest first, then of their names, so that every
//! tensor begins at a multiple of its element size; readers take any order, since
//! older files are in that of their names. Coordinates are f64 (f32 in files of version 1),
//! other tensors f32 where nothing else is said:
//!
//! | name | shape | content |
//! |---|---|---|
//! | `transmittance.coefficients` | `[s, l']` | C', one row per curve, row-major over the axes; f32 or f16 |
//! | `transmittance.coefficients.0` ... | `[s]` | instead, if quantised: integers, u8 or u16, one tensor per component |
//! | `transmittance.quantisation` | `[l', 2]` | if quantised: offset and step; a coefficient is offset + step integer |
//! | `transmittance.basis` | `[l, l']` | V' |
//! | `reflectance.*` | likewise | with its own l' |
//! | `wavelength_nm` | `[l]` | strictly increasing |
//! | `facetness`, `grain_size_um`, `density_kg_m3`, `thickness_cm`, `angle_deg` | `[n]` each | the axes, slowest first; s is the product of their lengths |
//! | `black_carbon_ng_g`, `water_saturation`, `temperature_c`, `sphericity`, `substrate_reflectance` | `[n]` each | optional axes, slower than these in this order; those there are stand first in the metadata `axis_order` |
//! | `absent` | `[n]`, u16 | per grain size, how many of the thinnest thicknesses have no curve; only if there are such |
//!
//! The tensors of a quantity are there if the metadata `quantities` name it.
use splitsnow_spectra::Quantity;

use crate::{Interval, Parameter};

/// `format` in the metadata.
pub const FORMAT: &str = "splitsnow-compact";
/// `format_version` in the metadata.
pub const FORMAT_VERSION: &str = "2";
/// The version before: coordinates in f32, the substrate in words
/// ([`BOTTOM_BOUNDARY`]).
pub const FORMAT_VERSION_1: &str = "1";
/// Metadata key of the [`SubstrateKind`]; since version 2.
pub const SUBSTRATE: &str = "substrate";
/// Metadata key of the same for people, which files of version 1 begin with `black`
/// where nothing sends light back.
pub const BOTTOM_BOUNDARY: &str = "bottom_boundary";
/// Metadata key of the errors per number of components: JSON per
/// quantity.
pub const ERROR_TABLE: &str = "error_table";
/// Metadata key of the bounds that hold on every curve: JSON per quantity.
pub const BOUNDS: &str = "bounds";
/// Metadata key of the errors in each band, with the bounds that they keep: JSON of a
/// list per quantity; absent in older files and those of `tailor`.
pub const BAND_ERRORS: &str = "band_errors";
/// Metadata key of where the numbers come from: JSON of the attributes of the
/// database.
pub const PROVENANCE: &str = "provenance";
/// Metadata key of the [`crate::Basis`].
pub const BASIS: &str = "basis";
/// Metadata key of the [`crate::Precision`]; absent in older files: f32.
pub const PRECISION: &str = "precision";
/// Metadata key of the quantities there are; absent in older files: both.
pub const QUANTITIES: &str = "quantities";
/// Tensor of the counts of curves that do not exist.
pub const ABSENT: &str = "absent";
/// Longest header written or read, bytes.
pub const MAX_HEADER: usize = 16 << 20;
/// Largest magnitude of a coefficient or basis entry: no sum of products of
/// such numbers overflows.
pub const MAX_NUMBER: f32 = 1e9;

/// Whether a coefficient or basis entry may have this value.
#[must_use]
pub fn number(value: f32) -> bool {
    value.abs() <= MAX_NUMBER
}

/// What lies under the snow of the axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SubstrateKind {
    /// Nothing that sends light back.
    Black,
    /// A Lambertian reflector.
    Reflecting,
    /// Other layers of snow, and whatever they lie on.
    Layers,
}

impl SubstrateKind {
    /// All there are.
    pub const ALL: [Self; 3] = [Self::Black, Self::Reflecting, Self::Layers];

    /// The name used in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Black => "black",
            Self::Reflecting => "reflecting",
            Self::Layers => "layers",
        }
    }
}

/// Name of the wavelengths.
pub const WAVELENGTH: &str = "wavelength_nm";
/// Wavelengths that a file may have, nm.
const WAVELENGTHS_NM: Interval = Interval {
    min: 0.0,
    max: 1e6,
    open: [true, false],
};

/// Checks the values of an axis; the error says what is wrong with them.
///
/// # Errors
/// There must be some, in the physical range, strictly increasing.
pub fn check_axis(parameter: Parameter, values: &[f64]) -> Result<(), String> {
    check(parameter.name(), parameter.record().physical, values)
}

/// The same for the wavelengths, nm.
///
/// # Errors
/// As [`check_axis`].
pub fn check_wavelengths(values: &[f64]) -> Result<(), String> {
    check(WAVELENGTH, WAVELENGTHS_NM, values)
}

fn check(name: &str, range: Interval, values: &[f64]) -> Result<(), String> {
    if values.is_empty() {
        return Err(format!("{name} has no values"));
    }
    // look-ups are in single precision
    let inside = |v: f64| range.contains(v) && range.contains(f64::from(v as f32));
    if let Some(bad) = values.iter().find(|v| !inside(**v)) {
        return Err(format!("{name} has the value {bad}; expected {range}"));
    }
    if let Some(pair) = values
        .windows(2)
        .find(|pair| pair[0] as f32 >= pair[1] as f32)
    {
        let [first, second] = [pair[0], pair[1]];
        return Err(format!(
            "{name} has {second} after {first}; expected values that increase strictly, in f32 too"
        ));
    }
    Ok(())
}

/// Name of the coefficients of `quantity`.
#[must_use]
pub fn coefficients_name(quantity: Quantity) -> String {
    format!("{}.coefficients", quantity.name())
}

/// Name of the integers of one component of `quantity`.
#[must_use]
pub fn integers_name(quantity: Quantity, component: usize) -> String {
    format!("{}.coefficients.{component}", quantity.name())
}

/// Name of the offsets and steps of `quantity`.
#[must_use]
pub fn quantisation_name(quantity: Quantity) -> String {
    format!("{}.quantisation", quantity.name())
}

/// Name of the basis of `quantity`.
#[must_use]
pub fn basis_name(quantity: Quantity) -> String {
    format!("{}.basis", quantity.name())
}

/// Metadata key with the number of components of `quantity`.
#[must_use]
pub fn components_key(quantity: Quantity) -> String {
    format!("{}.components", quantity.name())
}

/// `quantities` in the metadata.
#[must_use]
pub fn quantities(there: impl IntoIterator<Item = Quantity>) -> String {
    let names: Vec<_> = there.into_iter().map(Quantity::name).collect();
    names.join(",")
}

/// `axis_order` in the metadata.
#[must_use]
pub fn axis_order(axes: impl IntoIterator<Item = Parameter>) -> String {
    let names: Vec<_> = axes.into_iter().map(Parameter::name).collect();
    names.join(",")
}
