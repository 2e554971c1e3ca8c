//! What the compact file `snow.safetensors` holds; its writer and its reader
//! share these names and ranges.
//!
//! A safetensors file: 8 bytes little-endian header length, a JSON header padded
//! with spaces to a multiple of 8, little-endian data without gaps. Data are in the
//! order of their element size, largest first, then of their names, so that every
//! tensor begins at a multiple of its element size; readers take any order, since
//! older files are in that of their names. Tensors, f32 where nothing else is said:
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
//! | `black_carbon_ng_g`, `water_saturation`, `temperature_c`, `sphericity`, `substrate_reflectance` | `[n]` each | axes beyond the five, slower than these in this order; those there are stand first in the metadata `axis_order` |
//! | `absent` | `[n]`, u16 | per grain size, how many of the thinnest thicknesses have no curve; only if there are such |
//!
//! The tensors of a quantity are there if the metadata `quantities` name it.
use crate::grid::ExtraAxis;
use crate::measurement::Quantity;

/// `format` in the metadata.
pub(crate) const FORMAT: &str = "splitsnow-compact";
/// `format_version` in the metadata.
pub(crate) const FORMAT_VERSION: &str = "1";
/// Metadata key of the errors per number of components: JSON of a
/// [`super::ErrorTable`] per quantity.
pub const ERROR_TABLE: &str = "error_table";
/// Metadata key of the bounds that hold on every curve: JSON of
/// [`super::Bounds`] per quantity.
pub const BOUNDS: &str = "bounds";
/// Metadata key of the errors in each band, with the bounds that they keep: JSON of a
/// list of [`super::BandError`] per quantity; absent in older files and those of `fit`.
pub const BAND_ERRORS: &str = "band_errors";
/// Metadata key of where the numbers come from: JSON of the attributes of the
/// database ([`crate::store::Store::attributes`]).
pub const PROVENANCE: &str = "provenance";
/// Metadata key of the [`super::Basis`].
pub(crate) const BASIS: &str = "basis";
/// Metadata key of the [`super::Precision`]; absent in older files: f32.
pub(crate) const PRECISION: &str = "precision";
/// Metadata key of the quantities there are; absent in older files: both.
pub(crate) const QUANTITIES: &str = "quantities";
/// Tensor of the counts of curves that do not exist.
pub(crate) const ABSENT: &str = "absent";
/// Longest header written or read, bytes.
pub(crate) const MAX_HEADER: usize = 16 << 20;
/// Largest magnitude of a coefficient or basis entry: no sum of products of
/// such numbers overflows.
pub(crate) const MAX_NUMBER: f32 = 1e9;

/// Whether a coefficient or basis entry may have this value.
pub(crate) fn number(value: f32) -> bool {
    value.abs() <= MAX_NUMBER
}

/// What every compact file says about one of its coordinates.
#[derive(Debug, Clone, Copy)]
pub struct Coordinate {
    /// Tensor name, with the unit as suffix.
    pub name: &'static str,
    /// Unit; "1" for a pure number.
    pub unit: &'static str,
    /// The values allowed, in words.
    pub range: &'static str,
    /// Whether a value is allowed.
    allowed: fn(f32) -> bool,
}

/// The five axes, slowest first.
pub const AXES: [Coordinate; 5] = [
    Coordinate {
        name: "facetness",
        unit: "1",
        range: "0 to 1",
        allowed: |v| (0.0..=1.0).contains(&v),
    },
    Coordinate {
        name: "grain_size_um",
        unit: "um",
        range: "above 0 and at most 1e6",
        allowed: |v| v > 0.0 && v <= 1e6,
    },
    Coordinate {
        name: "density_kg_m3",
        unit: "kg/m3",
        range: "above 0 and below 1000",
        allowed: |v| v > 0.0 && v < 1000.0,
    },
    Coordinate {
        name: "thickness_cm",
        unit: "cm",
        range: "above 0 and at most 1e6",
        allowed: |v| v > 0.0 && v <= 1e6,
    },
    Coordinate {
        name: "angle_deg",
        unit: "degree",
        range: "at least 0 and below 90",
        allowed: |v| (0.0..90.0).contains(&v),
    },
];

/// An axis beyond the five.
pub(crate) fn extra(axis: ExtraAxis) -> Coordinate {
    let (range, allowed): (_, fn(f32) -> bool) = match axis {
        ExtraAxis::BlackCarbon => ("0 to 1e9", |v| (0.0..=1e9).contains(&v)),
        ExtraAxis::WaterSaturation => ("0 to 0.5", |v| (0.0..=0.5).contains(&v)),
        ExtraAxis::Temperature => ("-40 to 0", |v| (-40.0..=0.0).contains(&v)),
        ExtraAxis::Sphericity => ("above 0 and at most 1", |v| v > 0.0 && v <= 1.0),
        ExtraAxis::SubstrateReflectance => ("0 to 1", |v| (0.0..=1.0).contains(&v)),
    };
    Coordinate {
        name: axis.name(),
        unit: axis.unit(),
        range,
        allowed,
    }
}

/// The wavelengths.
pub(crate) const WAVELENGTHS: Coordinate = Coordinate {
    name: "wavelength_nm",
    unit: "nm",
    range: "above 0 and at most 1e6",
    allowed: |v| v > 0.0 && v <= 1e6,
};

impl Coordinate {
    /// Checks the values of this coordinate; says what is wrong with them.
    pub(crate) fn check(&self, values: &[f32]) -> Result<(), String> {
        let Self { name, range, .. } = self;
        if values.is_empty() {
            return Err(format!("{name} has no values"));
        }
        if let Some(bad) = values.iter().find(|v| !(self.allowed)(**v)) {
            return Err(format!("{name} has the value {bad}; expected {range}"));
        }
        if let Some(pair) = values.windows(2).find(|pair| pair[0] >= pair[1]) {
            let [first, second] = [pair[0], pair[1]];
            return Err(format!(
                "{name} has {second} after {first}; expected f32 values in strictly increasing order"
            ));
        }
        Ok(())
    }
}

/// Name of the coefficients of `quantity`.
pub(crate) fn coefficients_name(quantity: Quantity) -> String {
    format!("{}.coefficients", quantity.name())
}

/// Name of the integers of one component of `quantity`.
pub(crate) fn integers_name(quantity: Quantity, component: usize) -> String {
    format!("{}.coefficients.{component}", quantity.name())
}

/// Name of the offsets and steps of `quantity`.
pub(crate) fn quantisation_name(quantity: Quantity) -> String {
    format!("{}.quantisation", quantity.name())
}

/// Name of the basis of `quantity`.
pub(crate) fn basis_name(quantity: Quantity) -> String {
    format!("{}.basis", quantity.name())
}

/// Metadata key with the number of components of `quantity`.
pub(crate) fn components_key(quantity: Quantity) -> String {
    format!("{}.components", quantity.name())
}

/// `quantities` in the metadata.
pub(crate) fn quantities(there: impl IntoIterator<Item = Quantity>) -> String {
    let names: Vec<_> = there.into_iter().map(Quantity::name).collect();
    names.join(",")
}

/// `axis_order` in the metadata, with these axes beyond the five.
pub(crate) fn axis_order(extra: impl IntoIterator<Item = ExtraAxis>) -> String {
    let extra = extra.into_iter().map(ExtraAxis::name);
    let names: Vec<_> = extra.chain(AXES.map(|axis| axis.name)).collect();
    names.join(",")
}
