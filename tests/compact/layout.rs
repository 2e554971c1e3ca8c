//! Layout of tensors: written files are aligned, and files of any layout are read.
use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ndarray::{Array2, Axis};
use safetensors::SafeTensors;
use serde_json::Value;
use splitsnow::compress::{Bands, Choice, CompactFile, compress, with_metadata};
use splitsnow::grid::Compression;
use splitsnow::lookup::{Database, SubstrateKind};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Axes, Parameter};

use super::variants::variants;
use super::{BOUNDS, axes, curves, wavelengths};

/// The tensors in the order of the data, and the offset of the data in the file. Each tensor
/// has its name, the size of an element in bytes, and its offset in the data.
fn tensor_offsets(bytes: &[u8]) -> (Vec<(String, usize, usize)>, usize) {
    let (header, metadata) = SafeTensors::read_metadata(bytes).unwrap();
    let tensors = metadata.tensors().into_iter();
    let offset = |(name, info): (String, &safetensors::tensor::TensorInfo)| {
        let (begin, end) = info.data_offsets;
        (
            name,
            (end - begin) / info.shape.iter().product::<usize>(),
            begin,
        )
    };
    let mut tensors: Vec<_> = tensors.map(offset).collect();
    tensors.sort_by_key(|(.., begin)| *begin);
    (tensors, 8 + header)
}

/// Asserts that all tensors are aligned and sorted by element size and name.
fn assert_aligned(bytes: &[u8], file: &str) {
    let (tensors, data) = tensor_offsets(bytes);
    assert_eq!(data % 8, 0, "{file}");
    for (name, size, begin) in &tensors {
        assert_eq!(begin % size, 0, "{file}: {name} at {begin}");
    }
    let by_size_and_name =
        tensors.is_sorted_by_key(|(name, size, _)| (Reverse(*size), name.clone()));
    assert!(by_size_and_name, "{file}: {tensors:?}");
}

/// An odd number of curves, so that tensors of 8 and 16 bits end at odd offsets.
fn odd_curves() -> (Axes, Array2<f64>) {
    let axes = axes()
        .with(Parameter::Facetness, vec![0.1])
        .with(Parameter::Density, vec![200.0]);
    (axes, curves().view().split_at(Axis(0), 27).0.to_owned())
}

#[test]
fn every_tensor_of_every_variant_is_aligned() {
    let (axes, curves) = odd_curves();
    let loose = Choice::Bounds(Compression {
        max_delta_e: 2.3,
        max_rmse: Some(5e-4),
    });
    let bands = Bands::new(&wavelengths());
    for variant in variants() {
        for choice in [BOUNDS, loose, Choice::Components(3)] {
            let [t, r] = Quantity::ALL
                .map(|q| compress(curves.view(), q, None, &bands, choice, variant).unwrap());
            for [t, r] in [[Some(&t), Some(&r)], [Some(&t), None], [None, Some(&r)]] {
                let bytes = CompactFile {
                    axes: &axes,
                    absent: &[],
                    wavelengths_nm: &wavelengths(),
                    substrate: SubstrateKind::Black,
                    transmittance: t,
                    reflectance: r,
                    provenance: "{}",
                    extra: &BTreeMap::new(),
                }
                .to_bytes()
                .unwrap();
                assert_aligned(&bytes, &format!("{variant:?} {choice:?}"));
                let with_note = with_metadata(&bytes, &[("error_budget", Some("{}"))]).unwrap();
                assert_aligned(&with_note, &format!("{variant:?} {choice:?}, annotated"));
            }
        }
    }
}

/// A committed file: its path and its bytes.
fn committed(path: &str) -> (PathBuf, Vec<u8>) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    (path, bytes)
}

#[test]
fn committed_examples_are_aligned() {
    for name in ["dome", "snow", "snows", "sooty"] {
        let (path, bytes) = committed(&format!("examples/mitsuba/{name}.safetensors"));
        assert_aligned(&bytes, &path.display().to_string());
        Database::from_bytes(&bytes).unwrap();
    }
}

/// The file with its tensors reordered by `key`.
fn reordered<K: Ord>(bytes: &[u8], key: impl Fn(&(String, usize, usize)) -> K) -> Vec<u8> {
    let (mut tensors, data) = tensor_offsets(bytes);
    tensors.sort_by_key(key);
    let mut header: BTreeMap<String, Value> = serde_json::from_slice(&bytes[8..data]).unwrap();
    let mut new_data = Vec::new();
    for (name, ..) in &tensors {
        let offsets = &mut header.get_mut(name).unwrap()["data_offsets"];
        let ends: [usize; 2] = serde_json::from_value(offsets.clone()).unwrap();
        let begin = new_data.len();
        new_data.extend_from_slice(&bytes[data + ends[0]..data + ends[1]]);
        *offsets = serde_json::json!([begin, new_data.len()]);
    }
    let header = serde_json::to_vec(&header).unwrap();
    [&(header.len() as u64).to_le_bytes()[..], &header, &new_data].concat()
}

/// A file from before tensors were aligned is read, and so is one with few aligned tensors.
/// Both equal the file in the present layout.
#[test]
fn misaligned_files_are_read() {
    let (_, old) = committed("tests/data/compact_tensors_by_name.safetensors");
    let (tensors, _) = tensor_offsets(&old);
    assert!(tensors.is_sorted_by_key(|(name, ..)| name.clone()));
    let misaligned = |bytes: &[u8]| {
        let (tensors, data) = tensor_offsets(bytes);
        let misaligned = tensors
            .iter()
            .filter(|(_, size, begin)| (data + begin) % size != 0);
        misaligned.count()
    };
    assert_eq!(misaligned(&old), 3);
    let aligned = reordered(&old, |(name, size, _)| (Reverse(*size), name.clone()));
    // a tensor of odd length comes first
    let worst = reordered(&old, |(name, ..)| {
        (name != "transmittance.coefficients.0", name.clone())
    });
    assert!(misaligned(&worst) > 3);
    let [aligned, old, worst] = [&aligned, &old, &worst].map(|b| Database::from_bytes(b).unwrap());
    for other in [old, worst] {
        assert_eq!(other.axes(), aligned.axes());
        assert_eq!(other.wavelengths_nm(), aligned.wavelengths_nm());
        assert_eq!(other.metadata(), aligned.metadata());
        for quantity in Quantity::ALL {
            assert_eq!(other.coefficients(quantity), aligned.coefficients(quantity));
            assert_eq!(other.basis(quantity), aligned.basis(quantity));
        }
    }
}
