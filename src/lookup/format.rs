//! From bytes to a [`Database`], believing nothing.
//!
//! The `safetensors` crate parses the header and proves that the tensors tile
//! the data without gap or overlap and that shapes match sizes; what follows the
//! header is measured here, with checked sums, against the bytes there are.
use std::collections::BTreeMap;

use ndarray::Array2;
use safetensors::tensor::{Dtype, Metadata};
use thiserror::Error;

use super::{Database, Factors};
use crate::compress::format::{
    AXES, BASIS_LINEAR, Coordinate, FORMAT, FORMAT_VERSION, MAX_HEADER, MAX_NUMBER, WAVELENGTHS,
    axis_order, basis_name, coefficients_name, components_key, number,
};
use crate::measurement::Quantity;

/// Why bytes are not a compact file that this version reads.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum FormatError {
    /// A directory, a device, a pipe.
    #[error("it is not a regular file")]
    NotAFile,
    /// Not the beginning of a safetensors file.
    #[error(
        "it is not a safetensors file: its first 8 bytes must be a header length of 2 to {MAX_HEADER}, they are {found}"
    )]
    NotSafetensors {
        /// The length they would be, or that there are fewer.
        found: String,
    },
    /// Fewer bytes than declared.
    #[error("it is truncated: it has {found} bytes, its header declares {declared}")]
    Truncated {
        /// Bytes there are.
        found: u64,
        /// Bytes declared so far.
        declared: u64,
    },
    /// More bytes than declared.
    #[error("it has {found} bytes, its header declares {declared}: something was appended to it")]
    Trailing {
        /// Bytes there are.
        found: u64,
        /// Bytes declared.
        declared: u64,
    },
    /// The header is no safetensors header, or contradicts itself.
    #[error("its safetensors header is damaged: {0}")]
    Header(String),
    /// Not a compact file, or not one of this version.
    #[error("its metadata `{key}` is {found}, expected `{expected}`: {meaning}")]
    Metadata {
        /// The key.
        key: String,
        /// What it says.
        found: String,
        /// What this version reads.
        expected: String,
        /// What follows from it.
        meaning: &'static str,
    },
    /// A tensor is not there.
    #[error("it has no tensor `{0}`")]
    Missing(String),
    /// A tensor that this version does not know.
    #[error("it has a tensor `{0}`, which this version does not know")]
    Unknown(String),
    /// A tensor of another type or shape.
    #[error("its tensor `{name}` is {found}, expected {expected}")]
    Tensor {
        /// The tensor.
        name: String,
        /// Its type and shape.
        found: String,
        /// What they must be.
        expected: String,
    },
    /// A value that cannot be.
    #[error("its tensor {0}")]
    Value(String),
}

/// The header's length from the `first` bytes of a file of `size` bytes.
pub(super) fn header_length(first: &[u8], size: u64) -> Result<usize, FormatError> {
    let Some(&length) = first.first_chunk::<8>() else {
        let found = format!("only {} bytes", first.len());
        return Err(FormatError::NotSafetensors { found });
    };
    let length = u64::from_le_bytes(length);
    if !(2..=MAX_HEADER as u64).contains(&length) {
        let found = length.to_string();
        return Err(FormatError::NotSafetensors { found });
    }
    let declared = 8 + length;
    if declared > size {
        return Err(FormatError::Truncated {
            found: size,
            declared,
        });
    }
    // At most MAX_HEADER, so it fits.
    Ok(length as usize)
}

/// Reads and checks a whole file.
pub(super) fn read(bytes: &[u8]) -> Result<Database, FormatError> {
    let found = bytes.len() as u64;
    let length = header_length(bytes, found)?;
    let (header, data) = bytes
        .get(8..)
        .and_then(|rest| rest.split_at_checked(length))
        .ok_or(FormatError::Truncated {
            found,
            declared: 8 + length as u64,
        })?;
    let header: Metadata =
        serde_json::from_slice(header).map_err(|e| FormatError::Header(e.to_string()))?;
    let declared = (8 + length as u64).saturating_add(header.data_len() as u64);
    if declared > found {
        return Err(FormatError::Truncated { found, declared });
    }
    if declared < found {
        return Err(FormatError::Trailing { found, declared });
    }
    let metadata: BTreeMap<String, String> = header
        .metadata()
        .clone()
        .unwrap_or_default()
        .into_iter()
        .collect();
    Tensors {
        header,
        data,
        metadata,
    }
    .database()
}

/// A header and data that agree on their sizes.
struct Tensors<'a> {
    header: Metadata,
    data: &'a [u8],
    metadata: BTreeMap<String, String>,
}

impl Tensors<'_> {
    fn database(self) -> Result<Database, FormatError> {
        self.says("format", FORMAT, "it is another kind of file")?;
        self.says(
            "format_version",
            FORMAT_VERSION,
            "another version of the program wrote it",
        )?;
        self.says(
            "basis",
            BASIS_LINEAR,
            "this version cannot read that variant",
        )?;
        self.says(
            "axis_order",
            &axis_order(),
            "this version cannot read that variant",
        )?;

        let mut known: Vec<String> = AXES.iter().map(|axis| axis.name.to_owned()).collect();
        known.push(WAVELENGTHS.name.to_owned());
        known.extend(
            Quantity::ALL
                .iter()
                .flat_map(|&q| [coefficients_name(q), basis_name(q)]),
        );
        for name in self.header.offset_keys() {
            if !known.contains(&name) {
                return Err(FormatError::Unknown(name));
            }
        }

        let wavelengths_nm = self.coordinate(&WAVELENGTHS)?;
        let mut axes: [Vec<f32>; 5] = Default::default();
        // More curves than fit in a usize match no tensor: checked below.
        let mut curves: usize = 1;
        for (axis, coordinate) in axes.iter_mut().zip(&AXES) {
            *axis = self.coordinate(coordinate)?;
            curves = curves.saturating_mul(axis.len());
        }
        Ok(Database {
            transmittance: self.factors(Quantity::Transmittance, curves, wavelengths_nm.len())?,
            reflectance: self.factors(Quantity::Reflectance, curves, wavelengths_nm.len())?,
            axes,
            wavelengths_nm,
            metadata: self.metadata,
        })
    }

    /// Refuses a file whose metadata `key` is not `expected`.
    fn says(&self, key: &str, expected: &str, meaning: &'static str) -> Result<(), FormatError> {
        let found = self.metadata.get(key);
        if found.is_some_and(|found| found == expected) {
            return Ok(());
        }
        Err(FormatError::Metadata {
            key: key.to_owned(),
            found: found.map_or("missing".to_owned(), |found| format!("{found:?}")),
            expected: expected.to_owned(),
            meaning,
        })
    }

    fn coordinate(&self, coordinate: &Coordinate) -> Result<Vec<f32>, FormatError> {
        let values = self.values(coordinate.name, "[n]", |shape| shape.len() == 1)?;
        coordinate.check(&values).map_err(FormatError::Value)?;
        Ok(values)
    }

    fn factors(&self, quantity: Quantity, s: usize, l: usize) -> Result<Factors, FormatError> {
        let key = components_key(quantity);
        let stated = self.metadata.get(&key).and_then(|text| text.parse().ok());
        let Some(components) = stated.filter(|n| (1..=l).contains(n)) else {
            return Err(FormatError::Metadata {
                found: self
                    .metadata
                    .get(&key)
                    .map_or("missing".to_owned(), |v| format!("{v:?}")),
                key,
                expected: format!("1 to {l}"),
                meaning: "there are at most as many components as wavelengths",
            });
        };
        Ok(Factors {
            coefficients: self.matrix(&coefficients_name(quantity), [s, components])?,
            basis: self.matrix(&basis_name(quantity), [l, components])?,
        })
    }

    fn matrix(&self, name: &str, shape: [usize; 2]) -> Result<Array2<f32>, FormatError> {
        let expected = format!("{shape:?}");
        let values = self.values(name, &expected, |found| found == shape)?;
        if let Some(bad) = values.iter().find(|v| !number(**v)) {
            return Err(FormatError::Value(format!(
                "{name} has the value {bad}; expected finite numbers up to {MAX_NUMBER:e} in magnitude"
            )));
        }
        Array2::from_shape_vec(shape, values).map_err(|e| FormatError::Header(e.to_string()))
    }

    /// The numbers of one tensor, if it is f32 of a shape that `fits`.
    fn values(
        &self,
        name: &str,
        expected: &str,
        fits: impl Fn(&[usize]) -> bool,
    ) -> Result<Vec<f32>, FormatError> {
        let missing = || FormatError::Missing(name.to_owned());
        let info = self.header.info(name).ok_or_else(missing)?;
        if info.dtype != Dtype::F32 || !fits(&info.shape) {
            return Err(FormatError::Tensor {
                name: name.to_owned(),
                found: format!("{:?} {:?}", info.dtype, info.shape),
                expected: format!("F32 {expected}"),
            });
        }
        let (begin, end) = info.data_offsets;
        let data = self.data.get(begin..end).ok_or_else(missing)?;
        let (numbers, _) = data.as_chunks::<4>();
        Ok(numbers
            .iter()
            .map(|&bytes| f32::from_le_bytes(bytes))
            .collect())
    }
}
