//! Changes metadata entries of a compact file.
use std::collections::BTreeMap;

use serde_json::Value;

use super::CompactError;

/// The compact file `bytes` with each metadata key in `entries` set to its value, or
/// removed if the value is `None`. Everything else stays the same to the byte.
///
/// # Errors
/// [`CompactError::Content`] if `bytes` are not a safetensors file;
/// [`CompactError::Header`] if their header is not valid JSON.
pub fn with_metadata(
    bytes: &[u8],
    entries: &[(&str, Option<&str>)],
) -> Result<Vec<u8>, CompactError> {
    let broken = || CompactError::Content("it is not a safetensors file".into());
    let (length, rest) = bytes.split_first_chunk::<8>().ok_or_else(broken)?;
    let length = usize::try_from(u64::from_le_bytes(*length)).map_err(|_| broken())?;
    let (header, data) = rest.split_at_checked(length).ok_or_else(broken)?;
    let mut header: BTreeMap<String, Value> = serde_json::from_slice(header)?;
    let metadata = header.remove("__metadata__").unwrap_or_default();
    let mut metadata: BTreeMap<String, Value> = serde_json::from_value(metadata)?;
    for (key, value) in entries {
        match value {
            Some(value) => metadata.insert((*key).to_owned(), (*value).into()),
            None => metadata.remove(*key),
        };
    }
    header.insert("__metadata__".to_owned(), serde_json::to_value(metadata)?);
    super::compact::assemble(&header, data)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::with_metadata;

    #[test]
    fn nothing_else_changes() {
        let header =
            br#"{"__metadata__":{"b":"1"},"x":{"dtype":"U8","shape":[3],"data_offsets":[0,3]}}"#;
        let mut file = (header.len() as u64).to_le_bytes().to_vec();
        file.extend(header);
        file.extend([7, 8, 9]);
        let once = with_metadata(&file, &[("a", Some("\"new\""))]).unwrap();
        let length = u64::from_le_bytes(*once.first_chunk().unwrap()) as usize;
        assert_eq!((length % 8, &once[8 + length..]), (0, &[7, 8, 9][..]));
        let header: serde_json::Value = serde_json::from_slice(&once[8..8 + length]).unwrap();
        assert_eq!(header["__metadata__"]["a"], "\"new\"");
        assert_eq!(header["__metadata__"]["b"], "1");
        assert_eq!(header["x"]["dtype"], "U8");
        // again, and back
        assert_eq!(
            with_metadata(&once, &[("a", Some("\"new\""))]).unwrap(),
            once
        );
        let without = with_metadata(&once, &[("a", None)]).unwrap();
        assert_eq!(without, with_metadata(&file, &[]).unwrap());
        for broken in [&file[..7], &file[..20], b""] {
            assert!(with_metadata(broken, &[("a", Some("b"))]).is_err());
        }
    }
}
