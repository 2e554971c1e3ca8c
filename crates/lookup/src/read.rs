//! From bytes to a [`Database`], believing nothing.
//!
//! [`Header`] proves that the tensors tile the data; what follows the header is measured
//! here, with checked sums, against the bytes there are.
use std::collections::{BTreeMap, BTreeSet};

use ndarray::{Array2, ShapeBuilder};
use splitsnow_spectra::Quantity;
use thiserror::Error;

use crate::format::{
    ABSENT, BASIS, BOTTOM_BOUNDARY, FORMAT, FORMAT_VERSION, FORMAT_VERSION_1, MAX_HEADER,
    MAX_NUMBER, PRECISION, QUANTITIES, SUBSTRATE, SubstrateKind, WAVELENGTH, axis_order,
    basis_name, check_axis, check_wavelengths, coefficients_name, components_key, integers_name,
    number, quantisation_name, quantities,
};
use crate::header::{Dtype, Header, Tensor};
use crate::{Axes, Basis, Database, Factors, Parameter, Precision, dequantised, f16_to_f32};

/// What an unknown value of a variant's key means.
const ANOTHER_VARIANT: &str = "this version cannot read that variant";

/// Why bytes are not a compact file that this version reads.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
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
    /// An axis that this version does not know.
    #[error("it has an axis `{0}`, which this version does not know")]
    UnknownAxis(String),
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

/// A header and data that agree on their sizes.
struct Tensors<'a> {
    tensors: BTreeMap<String, Tensor>,
    data: &'a [u8],
    metadata: BTreeMap<String, String>,
}

impl Tensors<'_> {
    fn database(self) -> Result<Database, FormatError> {
        self.says("format", FORMAT, "it is another kind of file")?;
        let versions = [FORMAT_VERSION, FORMAT_VERSION_1].map(|v| (v.to_owned(), v));
        let version = self.version(versions)?;
        let parameters = self.parameters()?;
        let kind = self.one_of(BASIS, None, Basis::ALL.map(|b| (b.name().to_owned(), b)))?;
        let all = Precision::ALL.map(|p| (p.name().to_owned(), p));
        let precision = self.one_of(PRECISION, Some(Precision::F32), all)?;
        let [first, second] = Quantity::ALL;
        let all = [vec![first, second], vec![first], vec![second]];
        let all = all.map(|there| (quantities(there.iter().copied()), there));
        let there = self.one_of(QUANTITIES, Some(Quantity::ALL.into()), all)?;

        let wavelengths_nm = self.coordinate(WAVELENGTH)?;
        check_wavelengths(&wavelengths_nm).map_err(FormatError::Value)?;
        let mut components = Vec::new();
        for quantity in there {
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

        // More curves than fit in a usize match no tensor: checked below.
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
            transmittance,
            reflectance,
            curves,
            axes,
            absent,
            wavelengths_nm,
            metadata: self.metadata,
        })
    }

    /// The axes: those that every file has, after those that it may have.
    fn parameters(&self) -> Result<Vec<Parameter>, FormatError> {
        let found = self.metadata.get("axis_order");
        let mut parameters: BTreeSet<_> = Parameter::CORE.into();
        for name in found.map_or("", String::as_str).split_terminator(',') {
            let unknown = || FormatError::UnknownAxis(name.to_owned());
            parameters.insert(Parameter::named(name).ok_or_else(unknown)?);
        }
        let expected = axis_order(parameters.iter().copied());
        self.says("axis_order", &expected, ANOTHER_VARIANT)?;
        Ok(parameters.into_iter().collect())
    }

    /// The version of the format, of those that are read.
    fn version(&self, known: [(String, &'static str); 2]) -> Result<&'static str, FormatError> {
        let meaning = "another version of the program wrote it";
        self.one_of("format_version", None, known)
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

    /// Whether nothing but the snow of the axes sends light back.
    fn has_black_substrate(&self, version: &str) -> Result<bool, FormatError> {
        if version == FORMAT_VERSION_1 {
            let bottom = self.metadata.get(BOTTOM_BOUNDARY);
            return Ok(bottom.is_none_or(|bottom| bottom.starts_with("black")));
        }
        let known = SubstrateKind::ALL.map(|s| (s.name().to_owned(), s == SubstrateKind::Black));
        self.one_of(SUBSTRATE, None, known)
    }

    /// The value of which metadata `key` has the name; `absent` without the key.
    fn one_of<T, const N: usize>(
        &self,
        key: &str,
        absent: Option<T>,
        named: [(String, T); N],
    ) -> Result<T, FormatError> {
        let found = self.metadata.get(key);
        if let (None, Some(absent)) = (found, absent) {
            return Ok(absent);
        }
        let expected = named
            .each_ref()
            .map(|(name, _)| name.as_str())
            .join("` or `");
        let mut named = named.into_iter();
        let value = named.find(|(name, _)| found == Some(name));
        value
            .map(|(_, value)| value)
            .ok_or_else(|| FormatError::Metadata {
                key: key.to_owned(),
                found: quoted(found),
                expected,
                meaning: ANOTHER_VARIANT,
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
            found: quoted(found),
            expected: expected.to_owned(),
            meaning,
        })
    }

    /// Values of an axis or the wavelengths. Those of version 1 are in single precision and
    /// mean the shortest decimals that round to them.
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

    /// The number of components of `quantity`, of `l` wavelengths.
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

    /// For each of `sizes` grain sizes, how many of the thinnest `thicknesses` have no
    /// curve; empty if all have.
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
                "{ABSENT} has the value {bad}; expected at most the {thicknesses} thicknesses there are"
            ))),
            None => Ok(counts),
        }
    }

    /// Quantised coefficients, `[s, l']`, decoded.
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

    /// The numbers of one tensor, if it is f32 of a shape that `fits`.
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

    /// The type and bytes of one tensor, if it is of one of `types` and of a
    /// shape that `fits`.
    fn data(
        &self,
        name: &str,
        types: &[Dtype],
        expected: &str,
        fits: impl Fn(&[usize]) -> bool,
    ) -> Result<(Dtype, &[u8]), FormatError> {
        let missing = || FormatError::Missing(name.to_owned());
        let info = self.tensors.get(name).ok_or_else(missing)?;
        if !types.contains(&info.dtype) || !fits(&info.shape) {
            let types: Vec<_> = types.iter().map(|dtype| format!("{dtype:?}")).collect();
            return Err(FormatError::Tensor {
                name: name.to_owned(),
                found: format!("{:?} {:?}", info.dtype, info.shape),
                expected: format!("{} {expected}", types.join(" or ")),
            });
        }
        let (begin, end) = info.data_offsets;
        let data = self.data.get(begin..end).ok_or_else(missing)?;
        Ok((info.dtype, data))
    }
}

/// The shortest decimal that rounds to an f32.
fn decimal(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(f64::from(value))
}

/// A metadata value in a message.
fn quoted(found: Option<&String>) -> String {
    found.map_or("missing".to_owned(), |found| format!("{found:?}"))
}

/// Whether `name` is of a tensor of `quantity`.
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
    match values.iter().find(|value| !number(**value)) {
        Some(bad) => Err(FormatError::Value(format!(
            "{name} has the value {bad}; expected finite numbers up to {MAX_NUMBER:e} in magnitude"
        ))),
        None => Ok(()),
    }
}
