//! Names and ranges of the compact file `snow.safetensors`, shared by its writer and its
//! reader.
//!
//! The file is a safetensors file: 8 bytes little-endian header length, a JSON header
//! padded with spaces to a multiple of 8, then little-endian data without gaps. Tensors
//! are sorted by element size, largest first, then by name, so that every tensor begins
//! at a multiple of its element size. Readers accept any order, because older files are
//! sorted by name only. Coordinates are f64 (f32 in files of version 1); other tensors
//! are f32 unless stated otherwise:
//!
//! | name | shape | content |
//! |---|---|---|
//! | `transmittance.coefficients` | `[s, l']` | C', one row per curve, row-major over the axes; f32 or f16 |
//! | `transmittance.coefficients.0` ... | `[s]` | instead, if quantised: integers, u8 or u16, one tensor per component |
//! | `transmittance.quantisation` | `[l', 2]` | if quantised: offset and step; a coefficient is offset + step * integer |
//! | `transmittance.basis` | `[l, l']` | V' |
//! | `reflectance.*` | likewise | with its own l' |
//! | `wavelength_nm` | `[l]` | strictly increasing |
//! | `facetness`, `grain_size_um`, `density_kg_m3`, `thickness_cm`, `angle_deg` | `[n]` each | the axes, slowest first; s is the product of their lengths |
//! | `black_carbon_ng_g`, `absorber_ug_g`, `water_saturation`, `temperature_c`, `sphericity`, `substrate_reflectance` | `[n]` each | optional axes, slower than the above, in this order; those in the file come first in the metadata `axis_order` |
//! | `view_deg`, `relative_azimuth_deg` | `[n]` each | only in files of anisotropy factors, slower than all others |
//! | `absent` | `[n]`, u16 | per grain size, the number of thinnest thicknesses without a curve; only if some curves do not exist |
//!
//! The file holds the tensors of the quantities that the metadata `quantities` name. With
//! [`CONTENT`] = [`ANISOTROPY`] the spectra are anisotropy factors: of reflected light under the
//! name `reflectance`, of transmitted light under `transmittance`.
use splitsnow_spectra::Quantity;

use crate::{Interval, Parameter};

/// Value of `format` in the metadata.
pub const FORMAT: &str = "splitsnow-compact";
/// Value of `format_version` in the metadata.
pub const FORMAT_VERSION: &str = "2";
/// The previous version: coordinates in f32, the substrate as free text
/// ([`BOTTOM_BOUNDARY`]).
pub const FORMAT_VERSION_1: &str = "1";
/// Metadata key of the [`SubstrateKind`], since version 2.
pub const SUBSTRATE: &str = "substrate";
/// Metadata key of the substrate as free text. In files of version 1 the text begins
/// with `black` if the substrate is black.
pub const BOTTOM_BOUNDARY: &str = "bottom_boundary";
/// Metadata key of the error table: errors per number of components, JSON per quantity.
pub const ERROR_TABLE: &str = "error_table";
/// Metadata key of the error bounds that every curve satisfies, JSON per quantity.
pub const BOUNDS: &str = "bounds";
/// Metadata key of the errors in each band with their bounds: JSON of a list per
/// quantity. Absent in older files and in files written by `tailor`.
pub const BAND_ERRORS: &str = "band_errors";
/// Metadata key of the provenance: JSON of the attributes of the database.
pub const PROVENANCE: &str = "provenance";
/// Metadata key of the [`crate::Basis`].
pub const BASIS: &str = "basis";
/// Metadata key of the [`crate::Precision`]. Absent in older files, which are f32.
pub const PRECISION: &str = "precision";
/// Metadata key of the quantities in the file. Absent in older files, which hold both.
pub const QUANTITIES: &str = "quantities";
/// Metadata key of what the spectra are; absent in files of reflectance and transmittance.
pub const CONTENT: &str = "content";
/// Value of [`CONTENT`] in files of anisotropy factors ([`crate::Anisotropy`]).
pub const ANISOTROPY: &str = "anisotropy_factor";
/// Tensor with the counts of curves that do not exist.
pub const ABSENT: &str = "absent";
/// Largest header written or read, bytes.
pub const MAX_HEADER: usize = 16 << 20;
/// Largest magnitude of a coefficient or basis entry. Sums of products of such numbers
/// do not overflow.
pub const MAX_NUMBER: f32 = 1e9;

/// Whether `value` is allowed as a coefficient or basis entry.
#[must_use]
pub fn is_valid_number(value: f32) -> bool {
    value.abs() <= MAX_NUMBER
}

/// What lies under the layer described by the axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SubstrateKind {
    /// A black substrate: no light is reflected.
    Black,
    /// A Lambertian reflector.
    Reflecting,
    /// Other layers of snow, and the substrate under them.
    Layers,
}

impl SubstrateKind {
    /// All variants.
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

/// Name of the tensor of wavelengths.
pub const WAVELENGTH: &str = "wavelength_nm";
/// Allowed wavelengths, nm.
const WAVELENGTHS_NM: Interval = Interval {
    min: 0.0,
    max: 1e6,
    open: [true, false],
};

/// Checks the values of an axis.
///
/// # Errors
/// A message if there are no values, a value is outside the physical range of the
/// parameter, or the values do not increase strictly.
pub fn check_axis(parameter: Parameter, values: &[f64]) -> Result<(), String> {
    check(parameter.name(), parameter.record().physical, values)
}

/// Checks wavelengths, nm, like the values of an axis.
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
    // look-ups use single precision
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
            "{name} has {second} after {first}; expected values that increase strictly, also when rounded to f32"
        ));
    }
    Ok(())
}

/// Name of the tensor of coefficients of `quantity`.
#[must_use]
pub fn coefficients_name(quantity: Quantity) -> String {
    format!("{}.coefficients", quantity.name())
}

/// Name of the tensor of quantised coefficients of one component of `quantity`.
#[must_use]
pub fn integers_name(quantity: Quantity, component: usize) -> String {
    format!("{}.coefficients.{component}", quantity.name())
}

/// Name of the tensor of quantisation offsets and steps of `quantity`.
#[must_use]
pub fn quantisation_name(quantity: Quantity) -> String {
    format!("{}.quantisation", quantity.name())
}

/// Name of the tensor of the basis of `quantity`.
#[must_use]
pub fn basis_name(quantity: Quantity) -> String {
    format!("{}.basis", quantity.name())
}

/// Metadata key with the number of components of `quantity`.
#[must_use]
pub fn components_key(quantity: Quantity) -> String {
    format!("{}.components", quantity.name())
}

/// Value of `quantities` in the metadata: names separated by commas.
#[must_use]
pub fn quantities(quantities: impl IntoIterator<Item = Quantity>) -> String {
    let names: Vec<_> = quantities.into_iter().map(Quantity::name).collect();
    names.join(",")
}

/// Value of `axis_order` in the metadata: names separated by commas.
#[must_use]
pub fn axis_order(axes: impl IntoIterator<Item = Parameter>) -> String {
    let names: Vec<_> = axes.into_iter().map(Parameter::name).collect();
    names.join(",")
}
