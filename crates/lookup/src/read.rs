//! Reads a [`Database`] from untrusted bytes.
//!
//! [`Header`] checks that the tensors tile the data. This module compares the declared
//! size with the number of bytes, in checked arithmetic.
use std::collections::{BTreeMap, BTreeSet};

use ndarray::{Array2, ShapeBuilder};
use splitsnow_spectra::Quantity;
use thiserror::Error;

use crate::format::{
    ABSENT, ANISOTROPY, BASIS, BOTTOM_BOUNDARY, CONTENT, FORMAT, FORMAT_VERSION, FORMAT_VERSION_1,
    MAX_HEADER, MAX_NUMBER, PRECISION, QUANTITIES, SUBSTRATE, SubstrateKind, WAVELENGTH,
    axis_order, basis_name, check_axis, check_wavelengths, coefficients_name, components_key,
    integers_name, is_valid_number, quantisation_name, quantities,
};
use crate::header::{Dtype, Header, Tensor};
use crate::{Axes, Basis, Database, Factors, Parameter, Precision, dequantised, f16_to_f32};

/// Explanation for an unknown metadata value.
const UNKNOWN_VARIANT: &str = "this version cannot read that variant";

/// A defect that makes a file unreadable as a compact file.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum FormatError {
    /// A directory, a device or a pipe.
    #[error("it is not a regular file")]
    NotAFile,
    /// Not the beginning of a safetensors file.
    #[error(
        "it is not a safetensors file: its first 8 bytes must be a header length of 2 to {MAX_HEADER}, found {found}"
    )]
    NotSafetensors {
        /// The header length read, or the number of bytes if fewer than 8.
        found: String,
    },
    /// Fewer bytes than declared.
    #[error("it is truncated: it has {found} bytes, its header declares {declared}")]
    Truncated {
        /// Size of the file, bytes.
        found: u64,
        /// Size declared by the part of the file that was read, bytes.
        declared: u64,
    },
    /// More bytes than declared.
    #[error("it has {found} bytes, its header declares {declared}: something was appended to it")]
    Trailing {
        /// Size of the file, bytes.
        found: u64,
        /// Size declared, bytes.
        declared: u64,
    },
    /// The header is not a valid safetensors header.
    #[error("its safetensors header is damaged: {0}")]
    Header(String),
    /// Not a compact file, or one that this version cannot read.
    #[error("its metadata `{key}` is {found}, expected `{expected}`: {meaning}")]
    Metadata {
        /// The key.
        key: String,
        /// Its value in the file, quoted, or `missing`.
        found: String,
        /// The value or values that this version accepts.
        expected: String,
        /// The consequence.
        meaning: &'static str,
    },
    /// A tensor is missing.
    #[error("it has no tensor `{0}`")]
    Missing(String),
    /// A tensor that this version does not know.
    #[error("it has a tensor `{0}`, which this version does not know")]
    Unknown(String),
    /// An axis that this version does not know.
    #[error("it has an axis `{0}`, which this version does not know")]
    UnknownAxis(String),
    /// A tensor of the wrong type or shape.
    #[error("its tensor `{name}` is {found}, expected {expected}")]
    Tensor {
        /// The tensor.
        name: String,
        /// Its type and shape in the file.
        found: String,
        /// The type and shape required.
        expected: String,
    },
    /// A tensor with a value outside its allowed range.
    #[error("its tensor {0}")]
    Value(String),
}

/// The length of the header, from the `first` bytes of a file of `size` bytes.
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
    // At most MAX_HEADER, so it fits a usize.
    Ok(length as usize)
}

/// Reads and validates a whole file.
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
    let header = Header::read(header).map_err(FormatError::Header)?;
    let declared = (8 + length as u64).saturating_add(header.data_len as u64);
    if declared > found {
        return Err(FormatError::Truncated { found, declared });
    }
    if declared < found {
        return Err(FormatError::Trailing { found, declared });
    }
    Tensors {
        metadata: header.metadata.unwrap_or_default(),
        tensors: header.tensors,
        data,
    }
    .database()
}

/// A header, and data of the declared size.
struct Tensors<'a> {
    tensors: BTreeMap<String, Tensor>,
    data: &'a [u8],
    metadata: BTreeMap<String, String>,
}

impl Tensors<'_> {
    fn database(self) -> Result<Database, FormatError> {
        self.expect_metadata("format", FORMAT, "it is another kind of file")?;
        let versions = [FORMAT_VERSION, FORMAT_VERSION_1].map(|v| (v.to_owned(), v));
        let version = self.version(versions)?;
        let parameters = self.parameters()?;
        self.check_content(&parameters)?;
        let bases = Basis::ALL.map(|b| (b.name().to_owned(), b));
        let kind = self.variant(BASIS, None, bases)?;
        if parameters.contains(&Parameter::View) {
            let meaning = "anisotropy factors have no logarithm of this kind";
            self.expect_metadata(BASIS, Basis::Linear.name(), meaning)?;
        }
        let precisions = Precision::ALL.map(|p| (p.name().to_owned(), p));
        let precision = self.variant(PRECISION, Some(Precision::F32), precisions)?;
        let [first, second] = Quantity::ALL;
        let subsets = [vec![first, second], vec![first], vec![second]];
        let subsets = subsets.map(|subset| (quantities(subset.iter().copied()), subset));
        let stored = self.variant(QUANTITIES, Some(Quantity::ALL.into()), subsets)?;

        let wavelengths_nm = self.coordinate(WAVELENGTH)?;
        check_wavelengths(&wavelengths_nm).map_err(FormatError::Value)?;
        let mut components = Vec::new();
        for quantity in stored {
            components.push((quantity, self.components(quantity, wavelengths_nm.len())?));
        }
        for name in self.tensors.keys() {
            let axes = parameters.iter().any(|axis| axis.name() == name.as_str());
            let mut quantities = components.iter();
            let known = axes
                || name == WAVELENGTH
                || name == ABSENT
                || quantities.any(|&(q, components)| belongs(name, q, components, precision));
            if !known {
                return Err(FormatError::Unknown(name.clone()));
            }
        }

        // A saturated number of curves matches no tensor; the shapes are checked below.
        let mut curves: usize = 1;
        let mut axes = Axes::default();
        for parameter in parameters {
            let values = self.coordinate(parameter.name())?;
            check_axis(parameter, &values).map_err(FormatError::Value)?;
            curves = curves.saturating_mul(values.len());
            axes.set(parameter, values);
        }
        let [_, sizes, _, thicknesses, _] = axes.core_shape();
        let absent = self.absent(sizes, thicknesses)?;
        let [mut transmittance, mut reflectance] = <[Factors; 2]>::default();
        for (quantity, components) in components {
            let factors = match quantity {
                Quantity::Transmittance => &mut transmittance,
                Quantity::Reflectance => &mut reflectance,
            };
            *factors = Factors {
                coefficients: match precision {
                    Precision::Quantised => self.integers(quantity, [curves, components])?,
                    other => {
                        self.matrix(&coefficients_name(quantity), [curves, components], other)?
                    }
                },
                basis: self.matrix(
                    &basis_name(quantity),
                    [wavelengths_nm.len(), components],
                    Precision::F32,
                )?,
            };
        }
        Ok(Database {
            has_black_substrate: self.has_black_substrate(version)?,
            kind,
            precision,
            transmittance: transmittance.into(),
            reflectance: reflectance.into(),
            curves,
            axes,
            absent,
            wavelengths_nm,
            metadata: self.metadata,
        })
    }

    /// The parameters of the axes in storage order: optional ones, then the core ones.
    fn parameters(&self) -> Result<Vec<Parameter>, FormatError> {
        let found = self.metadata.get("axis_order");
        let mut parameters: BTreeSet<_> = Parameter::CORE.into();
        for name in found.map_or("", String::as_str).split_terminator(',') {
            let unknown = || FormatError::UnknownAxis(name.to_owned());
            parameters.insert(Parameter::named(name).ok_or_else(unknown)?);
        }
        let expected = axis_order(parameters.iter().copied());
        self.expect_metadata("axis_order", &expected, UNKNOWN_VARIANT)?;
        Ok(parameters.into_iter().collect())
    }

    /// An error unless the file has the axes of views if, and only if, it holds anisotropy
    /// factors.
    fn check_content(&self, parameters: &[Parameter]) -> Result<(), FormatError> {
        let has_views = Parameter::VIEWS.map(|axis| parameters.contains(&axis));
        let expected = match (self.metadata.get(CONTENT), has_views) {
            (None, [false, false]) => return Ok(()),
            (_, [false, false]) => "missing",
            _ => ANISOTROPY,
        };
        if has_views[0] != has_views[1] {
            return Err(FormatError::Metadata {
                key: "axis_order".to_owned(),
                found: quoted(self.metadata.get("axis_order")),
                expected: axis_order(Parameter::VIEWS),
                meaning: "a direction of view needs both",
            });
        }
        self.expect_metadata(CONTENT, expected, UNKNOWN_VARIANT)
    }

    /// The version of the format, one of `known`.
    fn version(&self, known: [(String, &'static str); 2]) -> Result<&'static str, FormatError> {
        let meaning = "another version of the program wrote it";
        self.variant("format_version", None, known)
            .map_err(|error| match error {
                FormatError::Metadata {
                    key,
                    found,
                    expected,
                    ..
                } => FormatError::Metadata {
                    key,
                    found,
                    expected,
                    meaning,
                },
                other => other,
            })
    }

    /// Whether the slab lies on a black substrate, with no other layers.
    fn has_black_substrate(&self, version: &str) -> Result<bool, FormatError> {
        if version == FORMAT_VERSION_1 {
            let bottom = self.metadata.get(BOTTOM_BOUNDARY);
            return Ok(bottom.is_none_or(|bottom| bottom.starts_with("black")));
        }
        let known = SubstrateKind::ALL.map(|s| (s.name().to_owned(), s == SubstrateKind::Black));
        self.variant(SUBSTRATE, None, known)
    }

    /// The variant whose name is the value of metadata `key`; `default`, if any, without
    /// the key.
    fn variant<T, const N: usize>(
        &self,
        key: &str,
        default: Option<T>,
        variants: [(String, T); N],
    ) -> Result<T, FormatError> {
        let found = self.metadata.get(key);
        if let (None, Some(default)) = (found, default) {
            return Ok(default);
        }
        let expected = variants
            .each_ref()
            .map(|(name, _)| name.as_str())
            .join("` or `");
        let mut variants = variants.into_iter();
        let value = variants.find(|(name, _)| found == Some(name));
        value
            .map(|(_, value)| value)
            .ok_or_else(|| FormatError::Metadata {
                key: key.to_owned(),
                found: quoted(found),
                expected,
                meaning: UNKNOWN_VARIANT,
            })
    }

    /// An error unless the value of metadata `key` is `expected`.
    fn expect_metadata(
        &self,
        key: &str,
        expected: &str,
        meaning: &'static str,
    ) -> Result<(), FormatError> {
        let found = self.metadata.get(key);
        if found.is_some_and(|found| found == expected) {
            return Ok(());
        }
        Err(FormatError::Metadata {
            key: key.to_owned(),
            found: quoted(found),
            expected: expected.to_owned(),
            meaning,
        })
    }

    /// Values of an axis or the wavelengths. Files of version 1 store them in single
    /// precision; each stands for the shortest decimal that rounds to it.
    fn coordinate(&self, name: &str) -> Result<Vec<f64>, FormatError> {
        let types = [Dtype::F64, Dtype::F32];
        let (dtype, data) = self.data(name, &types, "[n]", |shape| shape.len() == 1)?;
        if dtype == Dtype::F64 {
            let numbers = data.as_chunks::<8>().0.iter();
            return Ok(numbers.map(|&bytes| f64::from_le_bytes(bytes)).collect());
        }
        let numbers = data.as_chunks::<4>().0.iter();
        let numbers = numbers.map(|&bytes| f32::from_le_bytes(bytes));
        Ok(numbers.map(decimal).collect())
    }

    /// The number of components of `quantity`; `l` is the number of wavelengths.
    fn components(&self, quantity: Quantity, l: usize) -> Result<usize, FormatError> {
        let key = components_key(quantity);
        let found = self.metadata.get(&key);
        let stated = found.and_then(|text| text.parse().ok());
        stated
            .filter(|n| (1..=l).contains(n))
            .ok_or_else(|| FormatError::Metadata {
                found: quoted(found),
                key,
                expected: format!("1 to {l}"),
                meaning: "there are at most as many components as wavelengths",
            })
    }

    /// For each of `sizes` grain sizes, the number of thinnest thicknesses without a
    /// curve, at most `thicknesses`; empty if every curve exists.
    fn absent(&self, sizes: usize, thicknesses: usize) -> Result<Vec<usize>, FormatError> {
        if !self.tensors.contains_key(ABSENT) {
            return Ok(Vec::new());
        }
        let expected = format!("[{sizes}]");
        let (_, data) = self.data(ABSENT, &[Dtype::U16], &expected, |found| found == [sizes])?;
        let counts = data.as_chunks::<2>().0.iter();
        let counts: Vec<usize> = counts.map(|&n| u16::from_le_bytes(n).into()).collect();
        match counts.iter().find(|n| **n > thicknesses) {
            Some(bad) => Err(FormatError::Value(format!(
                "{ABSENT} has the value {bad}; expected at most {thicknesses}, the number of thicknesses"
            ))),
            None => Ok(counts),
        }
    }

    /// Quantised coefficients, `[s, l']`, converted to f32.
    fn integers(
        &self,
        quantity: Quantity,
        [s, components]: [usize; 2],
    ) -> Result<Array2<f32>, FormatError> {
        let name = quantisation_name(quantity);
        let scales = self.matrix(&name, [components, 2], Precision::F32)?;
        let mut columns = Vec::new();
        for (component, scale) in scales.rows().into_iter().enumerate() {
            let name = integers_name(quantity, component);
            let types = [Dtype::U8, Dtype::U16];
            let (dtype, data) =
                self.data(&name, &types, &format!("[{s}]"), |found| found == [s])?;
            let decoded = |integer| dequantised(scale[0], scale[1], integer);
            let begin = columns.len();
            match dtype {
                Dtype::U8 => columns.extend(data.iter().map(|&i| decoded(i.into()))),
                _ => {
                    let integers = data.as_chunks::<2>().0.iter();
                    columns.extend(integers.map(|&bytes| decoded(u16::from_le_bytes(bytes))));
                }
            }
            check_numbers(&name, columns.get(begin..).unwrap_or_default())?;
        }
        let columns = Array2::from_shape_vec((s, components).f(), columns);
        let columns = columns.map_err(|e| FormatError::Header(e.to_string()))?;
        Ok(columns.as_standard_layout().into_owned())
    }

    fn matrix(
        &self,
        name: &str,
        shape: [usize; 2],
        precision: Precision,
    ) -> Result<Array2<f32>, FormatError> {
        let expected = format!("{shape:?}");
        let fits = |found: &[usize]| found == shape;
        let values = match precision {
            Precision::F16 => {
                let (_, data) = self.data(name, &[Dtype::F16], &expected, fits)?;
                let numbers = data.as_chunks::<2>().0.iter();
                numbers
                    .map(|&bytes| f16_to_f32(u16::from_le_bytes(bytes)))
                    .collect()
            }
            _ => self.values(name, &expected, fits)?,
        };
        check_numbers(name, &values)?;
        Array2::from_shape_vec(shape, values).map_err(|e| FormatError::Header(e.to_string()))
    }

    /// The numbers of a tensor of type f32 whose shape satisfies `fits`.
    fn values(
        &self,
        name: &str,
        expected: &str,
        fits: impl Fn(&[usize]) -> bool,
    ) -> Result<Vec<f32>, FormatError> {
        let (_, data) = self.data(name, &[Dtype::F32], expected, fits)?;
        let numbers = data.as_chunks::<4>().0.iter();
        Ok(numbers.map(|&bytes| f32::from_le_bytes(bytes)).collect())
    }

    /// The type and bytes of a tensor whose type is one of `types` and whose shape
    /// satisfies `fits`.
    fn data(
        &self,
        name: &str,
        types: &[Dtype],
        expected: &str,
        fits: impl Fn(&[usize]) -> bool,
    ) -> Result<(Dtype, &[u8]), FormatError> {
        let missing = || FormatError::Missing(name.to_owned());
        let tensor = self.tensors.get(name).ok_or_else(missing)?;
        if !types.contains(&tensor.dtype) || !fits(&tensor.shape) {
            let types: Vec<_> = types.iter().map(|dtype| format!("{dtype:?}")).collect();
            return Err(FormatError::Tensor {
                name: name.to_owned(),
                found: format!("{:?} {:?}", tensor.dtype, tensor.shape),
                expected: format!("{} {expected}", types.join(" or ")),
            });
        }
        let (begin, end) = tensor.data_offsets;
        let data = self.data.get(begin..end).ok_or_else(missing)?;
        Ok((tensor.dtype, data))
    }
}

/// The shortest decimal that rounds to an f32.
fn decimal(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(f64::from(value))
}

/// A metadata value as quoted in a message.
fn quoted(found: Option<&String>) -> String {
    found.map_or("missing".to_owned(), |found| format!("{found:?}"))
}

/// Whether `name` is the name of a tensor of `quantity`.
fn belongs(name: &str, quantity: Quantity, components: usize, precision: Precision) -> bool {
    if name == basis_name(quantity) {
        return true;
    }
    if precision != Precision::Quantised {
        return name == coefficients_name(quantity);
    }
    let component = name.rsplit('.').next().and_then(|last| last.parse().ok());
    let integers = |component| component < components && name == integers_name(quantity, component);
    name == quantisation_name(quantity) || component.is_some_and(integers)
}

fn check_numbers(name: &str, values: &[f32]) -> Result<(), FormatError> {
    match values.iter().find(|value| !is_valid_number(**value)) {
        Some(bad) => Err(FormatError::Value(format!(
            "{name} has the value {bad}; expected finite numbers up to {MAX_NUMBER:e} in magnitude"
        ))),
        None => Ok(()),
    }
}
