//! The header of a safetensors file, which locates its tensors.
//!
//! The format: <https://github.com/huggingface/safetensors>. Tensors must tile the data
//! without gaps or overlaps, and their shapes must match their sizes. (The crate
//! `safetensors` checks the same, but would be a third of the code that a renderer
//! compiles.)
use std::collections::BTreeMap;

use serde::Deserialize;

/// Element types of tensors; those smaller than a byte are not supported.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[allow(clippy::upper_case_acronyms)]
pub(crate) enum Dtype {
    BOOL,
    U8,
    I8,
    U16,
    I16,
    F16,
    BF16,
    U32,
    I32,
    F32,
    U64,
    I64,
    F64,
}

impl Dtype {
    /// Size of an element, bytes.
    const fn size(self) -> usize {
        match self {
            Self::BOOL | Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 | Self::F16 | Self::BF16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }
}

/// One tensor: the type of its elements, its shape, and its first byte and the byte after
/// its last, counted from the start of the data.
#[derive(Debug, Deserialize)]
pub(crate) struct Tensor {
    pub(crate) dtype: Dtype,
    pub(crate) shape: Vec<usize>,
    pub(crate) data_offsets: (usize, usize),
}

/// A header whose tensors tile the data.
#[derive(Debug, Deserialize)]
pub(crate) struct Header {
    #[serde(rename = "__metadata__")]
    pub(crate) metadata: Option<BTreeMap<String, String>>,
    #[serde(flatten)]
    pub(crate) tensors: BTreeMap<String, Tensor>,
    /// Total size of all tensors, bytes.
    #[serde(skip)]
    pub(crate) data_len: usize,
}

impl Header {
    /// Reads and checks the JSON of a header; the error describes the defect.
    pub(crate) fn read(json: &[u8]) -> Result<Self, String> {
        let mut header: Self = serde_json::from_slice(json).map_err(|error| error.to_string())?;
        let mut tensors: Vec<_> = header.tensors.iter().collect();
        tensors.sort_by_key(|(_, tensor)| tensor.data_offsets);
        for (name, tensor) in tensors {
            let (begin, end) = tensor.data_offsets;
            if begin != header.data_len {
                return Err(format!(
                    "tensor `{name}` begins at byte {begin}, but the data before it end at byte {}",
                    header.data_len
                ));
            }
            let mut lengths = tensor.shape.iter();
            let size = lengths.try_fold(tensor.dtype.size(), |n, length| n.checked_mul(*length));
            if size.is_none() || size != end.checked_sub(begin) {
                return Err(format!(
                    "tensor `{name}` is {:?} {:?}, which does not match its data from byte {begin} to {end}",
                    tensor.dtype, tensor.shape
                ));
            }
            header.data_len = end;
        }
        Ok(header)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn tensors_tile_the_data() {
        let tensor = |name: &str, shape: &str, offsets: &str| {
            format!(r#""{name}":{{"dtype":"F32","shape":{shape},"data_offsets":{offsets}}}"#)
        };
        let read =
            |tensors: &[String]| Header::read(format!("{{{}}}", tensors.join(",")).as_bytes());
        let whole = read(&[tensor("a", "[1]", "[8,12]"), tensor("b", "[2]", "[0,8]")]).unwrap();
        assert_eq!((whole.data_len, whole.tensors.len()), (12, 2));
        assert!(whole.metadata.is_none());
        assert_eq!(read(&[]).unwrap().data_len, 0);
        for (shape, offsets) in [
            ("[2]", "[4,12]"),
            ("[2]", "[0,4]"),
            ("[2]", "[8,0]"),
            // 4 x 2^62 elements x 4 bytes wrap to no bytes
            ("[4,4611686018427387904]", "[0,0]"),
            ("[-1]", "[0,8]"),
        ] {
            assert!(
                read(&[tensor("a", shape, offsets)]).is_err(),
                "{shape} {offsets}"
            );
        }
        let twice = [tensor("a", "[2]", "[0,8]"), tensor("b", "[2]", "[0,8]")];
        assert!(read(&twice).unwrap_err().contains("begins at byte 0"));
    }
}
