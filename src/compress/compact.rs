//! The writer of the compact file.
//!
//! The header is written here instead of by the `safetensors` crate, which keeps metadata in
//! a hash map, so that the bytes would differ from run to run.
use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use ndarray::Array2;
use serde_json::{Value, json};
use thiserror::Error;

use super::{
    BandError, Bounds, CompactVariant, Compressed, ErrorTable, Integers, StoredCoefficients,
};
use crate::atomic;
use crate::lookup::format::{
    ABSENT, ANISOTROPY, BAND_ERRORS, BASIS, BOUNDS, CONTENT, ERROR_TABLE, FORMAT, FORMAT_VERSION,
    MAX_HEADER, MAX_NUMBER, PRECISION, PROVENANCE, QUANTITIES, SUBSTRATE, WAVELENGTH, axis_order,
    basis_name, check_axis, check_wavelengths, coefficients_name, components_key, integers_name,
    is_valid_number, quantisation_name, quantities,
};
use crate::lookup::{Basis, SubstrateKind};
use crate::measurement::Quantity;
use crate::parameter::{Axes, Parameter};

/// The reason why a compact file could not be written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CompactError {
    /// The contents are inconsistent, too large or not allowed by the format.
    #[error("the compact file cannot be written: {0}")]
    Content(String),
    /// The header cannot be converted to or from JSON.
    #[error("the header of the compact file cannot be written: {0}")]
    Header(#[from] serde_json::Error),
    /// The file system reported an error.
    #[error("cannot write {}: {source}; check the path, its permissions and its disk, or choose another", path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Error of the file system.
        source: io::Error,
    },
}

/// The contents of a compact file. The bytes of the file depend on these fields only.
#[derive(Debug, Clone, Copy)]
pub struct CompactFile<'a> {
    /// The axes of the database; with those of a view, the file holds anisotropy factors.
    pub axes: &'a Axes,
    /// Wavelengths, nm.
    pub wavelengths_nm: &'a [f64],
    /// Substrate below the snow of the axes.
    pub substrate: SubstrateKind,
    /// For each grain size, how many of the thinnest thicknesses have no curve (see
    /// [`crate::grid::Grid::absent`]); empty if every thickness has a curve.
    pub absent: &'a [usize],
    /// Compressed transmittance, one row per node of the axes; `None` if the file holds
    /// reflectance only.
    pub transmittance: Option<&'a Compressed>,
    /// Compressed reflectance in the same variant; `None` if the file holds transmittance only.
    pub reflectance: Option<&'a Compressed>,
    /// Provenance of the numbers: the JSON of [`crate::store::Store::attributes`].
    pub provenance: &'a str,
    /// Further metadata (illumination, ...), without keys that the format itself defines.
    pub extra: &'a BTreeMap<String, String>,
}

impl CompactFile<'_> {
    /// Writes the file atomically: `path` is replaced completely or not at all.
    ///
    /// # Errors
    /// [`CompactError`] of any kind.
    pub fn write(&self, path: &Path) -> Result<(), CompactError> {
        atomic::write(path, &self.to_bytes()?).map_err(|source| CompactError::Io {
            path: path.to_owned(),
            source,
        })
    }

    /// The bytes of the file.
    ///
    /// # Errors
    /// [`CompactError::Content`] and [`CompactError::Header`].
    pub fn to_bytes(&self) -> Result<Vec<u8>, CompactError> {
        let wavelengths = self.wavelengths_nm;
        check_wavelengths(wavelengths).map_err(CompactError::Content)?;
        let mut curves: usize = 1;
        // Sorted by name, the order of the header.
        let mut tensors = BTreeMap::new();
        for (parameter, values) in self.axes.iter() {
            check_axis(parameter, values).map_err(CompactError::Content)?;
            curves = curves.saturating_mul(values.len());
            tensors.insert(parameter.name().to_owned(), Tensor::f64(values));
        }
        for (quantity, compressed) in self.quantities() {
            let components = compressed.components();
            let name = coefficients_name(quantity);
            let coefficients = &compressed.coefficients;
            check_matrix(&name, &coefficients.decoded(), [curves, components])?;
            // Iteration is row-major, whatever the memory layout.
            match coefficients {
                StoredCoefficients::F32(values) => {
                    let tensor = Tensor::f32(values.shape(), values.iter().copied());
                    tensors.insert(name, tensor);
                }
                StoredCoefficients::F16(values) => {
                    let bytes = values.iter().flat_map(|v| v.to_le_bytes());
                    tensors.insert(name, Tensor::new("F16", 2, values.shape(), bytes));
                }
                StoredCoefficients::Quantised(quantised) => {
                    for (component, quantised) in quantised.iter().enumerate() {
                        let tensor = Tensor::integers(&quantised.integers);
                        tensors.insert(integers_name(quantity, component), tensor);
                    }
                    let scales = quantised.iter().flat_map(|c| [c.offset, c.step]);
                    let tensor = Tensor::f32(&[components, 2], scales);
                    tensors.insert(quantisation_name(quantity), tensor);
                }
            }
            let name = basis_name(quantity);
            let basis = &compressed.basis;
            check_matrix(&name, basis, [wavelengths.len(), components])?;
            tensors.insert(name, Tensor::f32(basis.shape(), basis.iter().copied()));
        }
        if !self.absent.is_empty() {
            tensors.insert(ABSENT.to_owned(), Tensor::integers(&self.absent()?));
        }
        tensors.insert(WAVELENGTH.to_owned(), Tensor::f64(wavelengths));

        let mut header = BTreeMap::from([("__metadata__".to_owned(), self.metadata()?)]);
        let mut begin = 0;
        // Largest elements first, so that each tensor begins at a multiple of its element size.
        let mut tensors: Vec<_> = tensors.into_iter().collect();
        tensors.sort_by_key(|(_, tensor)| Reverse(tensor.size));
        for (name, tensor) in &tensors {
            let Tensor { dtype, shape, .. } = tensor;
            let end = begin + tensor.bytes.len();
            let entry = json!({"dtype": dtype, "shape": shape, "data_offsets": [begin, end]});
            header.insert(name.clone(), entry);
            begin = end;
        }
        let mut file = assemble(&header, &[])?;
        file.reserve_exact(begin);
        // each tensor is dropped when it is in the file
        for (_, tensor) in tensors {
            file.extend(tensor.bytes);
        }
        Ok(file)
    }

    /// The numbers of absent curves as integers, one for each grain size.
    fn absent(&self) -> Result<Integers, CompactError> {
        let counts = self.absent.iter().map(|n| u16::try_from(*n).ok());
        let counts: Option<Vec<u16>> = counts.collect();
        let thicknesses = self.axes.values(Parameter::Thickness).len();
        let sizes = self.axes.values(Parameter::GrainSize).len();
        let fits = |counts: &Vec<u16>| {
            counts.len() == sizes && counts.iter().all(|n| usize::from(*n) <= thicknesses)
        };
        counts.filter(fits).map(Integers::U16).ok_or_else(|| {
            let problem = format!(
                "the counts of absent curves {:?} must be {sizes} numbers, one for each grain size, of at most {thicknesses}",
                self.absent
            );
            CompactError::Content(problem)
        })
    }

    /// The quantities in the file.
    fn quantities(&self) -> impl Iterator<Item = (Quantity, &Compressed)> {
        Quantity::ALL.into_iter().filter_map(|quantity| {
            let compressed = match quantity {
                Quantity::Transmittance => self.transmittance,
                Quantity::Reflectance => self.reflectance,
            };
            Some((quantity, compressed?))
        })
    }

    /// The variant that all quantities share.
    fn variant(&self) -> Result<CompactVariant, CompactError> {
        let mut variants = self
            .quantities()
            .map(|(_, compressed)| compressed.variant());
        let Some(variant) = variants.next() else {
            let problem = "it has neither transmittance nor reflectance".to_owned();
            return Err(CompactError::Content(problem));
        };
        if variants.any(|other| other != variant) {
            let problem = "transmittance and reflectance have different variants".to_owned();
            return Err(CompactError::Content(problem));
        }
        Ok(variant)
    }

    /// The entry `__metadata__`: strings by name.
    fn metadata(&self) -> Result<Value, CompactError> {
        let CompactVariant { basis, precision } = self.variant()?;
        let quantities = quantities(self.quantities().map(|(quantity, _)| quantity));
        let tables = self.quantities().map(|(q, c)| (q.name(), &c.table));
        let tables: BTreeMap<&str, &ErrorTable> = tables.collect();
        let bounds = self.quantities().map(|(q, c)| (q.name(), c.bounds));
        let bounds: BTreeMap<&str, Bounds> = bounds.collect();
        let axes = self.axes.iter().map(|(axis, _)| (axis.name(), axis.unit()));
        let mut units: BTreeMap<_, _> = axes.collect();
        units.insert(WAVELENGTH, "nm");
        units.extend(
            self.quantities()
                .map(|(quantity, _)| (quantity.name(), "1")),
        );

        let mut entries = BTreeMap::from([
            ("format".to_owned(), FORMAT.to_owned()),
            ("format_version".to_owned(), FORMAT_VERSION.to_owned()),
            (
                "axis_order".to_owned(),
                axis_order(self.axes.iter().map(|(axis, _)| axis)),
            ),
            ("units".to_owned(), serde_json::to_string(&units)?),
            (BASIS.to_owned(), basis.name().to_owned()),
            (PRECISION.to_owned(), precision.name().to_owned()),
            (QUANTITIES.to_owned(), quantities),
            (SUBSTRATE.to_owned(), self.substrate.name().to_owned()),
            (ERROR_TABLE.to_owned(), serde_json::to_string(&tables)?),
            (BOUNDS.to_owned(), serde_json::to_string(&bounds)?),
            (PROVENANCE.to_owned(), self.provenance.to_owned()),
        ]);
        let bands = self.quantities().map(|(q, c)| (q.name(), c.band_errors()));
        let bands: BTreeMap<&str, Vec<BandError>> = bands.collect();
        if bands.values().any(|errors| !errors.is_empty()) {
            entries.insert(BAND_ERRORS.to_owned(), serde_json::to_string(&bands)?);
        }
        if self.axes.has(Parameter::View) {
            if basis != Basis::Linear {
                let problem = "anisotropy factors are decomposed in the linear basis only";
                return Err(CompactError::Content(problem.to_owned()));
            }
            entries.insert(CONTENT.to_owned(), ANISOTROPY.to_owned());
        }
        for (quantity, compressed) in self.quantities() {
            entries.insert(
                components_key(quantity),
                compressed.components().to_string(),
            );
        }
        for (key, value) in self.extra {
            if entries.insert(key.clone(), value.clone()).is_some() {
                let problem = format!("`{key}` is a metadata key of the format itself");
                return Err(CompactError::Content(problem));
            }
        }
        Ok(serde_json::to_value(entries)?)
    }
}

/// A tensor to be written.
struct Tensor {
    dtype: &'static str,
    /// Size of an element, bytes.
    size: usize,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

impl Tensor {
    fn new(
        dtype: &'static str,
        size: usize,
        shape: &[usize],
        bytes: impl IntoIterator<Item = u8>,
    ) -> Self {
        Self {
            dtype,
            size,
            shape: shape.to_vec(),
            bytes: bytes.into_iter().collect(),
        }
    }

    fn f32(shape: &[usize], values: impl IntoIterator<Item = f32>) -> Self {
        let bytes = values.into_iter().flat_map(f32::to_le_bytes);
        Self::new("F32", 4, shape, bytes)
    }

    fn f64(values: &[f64]) -> Self {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes());
        Self::new("F64", 8, &[values.len()], bytes)
    }

    fn integers(integers: &Integers) -> Self {
        match integers {
            Integers::U8(values) => Self::new("U8", 1, &[values.len()], values.iter().copied()),
            Integers::U16(values) => {
                let bytes = values.iter().flat_map(|i| i.to_le_bytes());
                Self::new("U16", 2, &[values.len()], bytes)
            }
        }
    }
}

/// A safetensors file with this header and data. The data begins at a multiple of 8 bytes.
pub(super) fn assemble(
    header: &BTreeMap<String, Value>,
    data: &[u8],
) -> Result<Vec<u8>, CompactError> {
    let mut header = serde_json::to_vec(header)?;
    header.resize(header.len().next_multiple_of(8), b' ');
    if header.len() > MAX_HEADER {
        let problem = format!(
            "its metadata takes {} bytes; at most {MAX_HEADER} are allowed",
            header.len()
        );
        return Err(CompactError::Content(problem));
    }
    let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
    bytes.append(&mut header);
    bytes.extend_from_slice(data);
    Ok(bytes)
}

/// Checks that a matrix has the given shape and holds only numbers that readers accept.
fn check_matrix(name: &str, matrix: &Array2<f32>, shape: [usize; 2]) -> Result<(), CompactError> {
    if matrix.shape() != shape {
        let problem = format!("{name} has the shape {:?}, not {shape:?}", matrix.shape());
        return Err(CompactError::Content(problem));
    }
    if let Some(bad) = matrix.iter().find(|v| !is_valid_number(**v)) {
        let problem =
            format!("{name} has the value {bad}, which is not finite or above {MAX_NUMBER:e}");
        return Err(CompactError::Content(problem));
    }
    Ok(())
}
