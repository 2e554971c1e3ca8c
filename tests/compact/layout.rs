//! Where tensors lie: aligned in what is written, anywhere in what is read.
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

/// Name, size of an element in bytes, and the first byte in the data, in the order of
/// the data; and where the data begin in the file.
fn places(bytes: &[u8]) -> (Vec<(String, usize, usize)>, usize) {
    let (header, metadata) = SafeTensors::read_metadata(bytes).unwrap();
    let tensors = metadata.tensors().into_iter();
    let place = |(name, info): (String, &safetensors::tensor::TensorInfo)| {
        let (begin, end) = info.data_offsets;
        (
            name,
            (end - begin) / info.shape.iter().product::<usize>(),
            begin,
        )
    };
    let mut all: Vec<_> = tensors.map(place).collect();
    all.sort_by_key(|(.., begin)| *begin);
    (all, 8 + header)
}

fn assert_laid_out(bytes: &[u8], what: &str) {
    let (tensors, data) = places(bytes);
    assert_eq!(data % 8, 0, "{what}");
    for (name, size, begin) in &tensors {
        assert_eq!(begin % size, 0, "{what}: {name} at {begin}");
    }
    let by_size_and_name =
        tensors.is_sorted_by_key(|(name, size, _)| (Reverse(*size), name.clone()));
    assert!(by_size_and_name, "{what}: {tensors:?}");
}

/// An odd number of curves, so that 8 and 16 bits leave odd places behind.
fn odd() -> (Axes, Array2<f64>) {
    let axes = axes()
        .with(Parameter::Facetness, vec![0.1])
        .with(Parameter::Density, vec![200.0]);
    (axes, curves().view().split_at(Axis(0), 27).0.to_owned())
}

#[test]
fn every_tensor_of_every_variant_is_aligned() {
    let (axes, curves) = odd();
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
                assert_laid_out(&bytes, &format!("{variant:?} {choice:?}"));
                let noted = with_metadata(&bytes, &[("error_budget", Some("{}"))]).unwrap();
                assert_laid_out(&noted, &format!("{variant:?} {choice:?}, certified"));
            }
        }
    }
}

fn committed(path: &str) -> (PathBuf, Vec<u8>) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    (path, bytes)
}

#[test]
fn the_examples_are_aligned() {
    for name in ["dome", "snow", "snows", "sooty"] {
        let (path, bytes) = committed(&format!("examples/mitsuba/{name}.safetensors"));
        assert_laid_out(&bytes, &path.display().to_string());
        Database::from_bytes(&bytes).unwrap();
    }
}

/// The file with its tensors in the order of `key`.
fn reordered<K: Ord>(bytes: &[u8], key: impl Fn(&(String, usize, usize)) -> K) -> Vec<u8> {
    let (mut tensors, data) = places(bytes);
    tensors.sort_by_key(key);
    let mut header: BTreeMap<String, Value> = serde_json::from_slice(&bytes[8..data]).unwrap();
    let mut moved = Vec::new();
    for (name, ..) in &tensors {
        let offsets = &mut header.get_mut(name).unwrap()["data_offsets"];
        let ends: [usize; 2] = serde_json::from_value(offsets.clone()).unwrap();
        let begin = moved.len();
        moved.extend_from_slice(&bytes[data + ends[0]..data + ends[1]]);
        *offsets = serde_json::json!([begin, moved.len()]);
    }
    let header = serde_json::to_vec(&header).unwrap();
    [&(header.len() as u64).to_le_bytes()[..], &header, &moved].concat()
}

/// A file from before tensors were aligned, and one in which hardly any is, are read
/// as the same in today's layout.
#[test]
fn older_layouts_are_read() {
    let (_, old) = committed("tests/data/compact_tensors_by_name.safetensors");
    let (tensors, _) = places(&old);
    assert!(tensors.is_sorted_by_key(|(name, ..)| name.clone()));
    let misaligned = |bytes: &[u8]| {
        let (tensors, data) = places(bytes);
        let odd = tensors
            .iter()
            .filter(|(_, size, begin)| (data + begin) % size != 0);
        odd.count()
    };
    assert_eq!(misaligned(&old), 3);
    let today = reordered(&old, |(name, size, _)| (Reverse(*size), name.clone()));
    // nine bytes before all others
    let worst = reordered(&old, |(name, ..)| {
        (name != "transmittance.coefficients.0", name.clone())
    });
    assert!(misaligned(&worst) > 3);
    let [today, old, worst] = [&today, &old, &worst].map(|b| Database::from_bytes(b).unwrap());
    for other in [old, worst] {
        assert_eq!(other.axes(), today.axes());
        assert_eq!(other.wavelengths_nm(), today.wavelengths_nm());
        assert_eq!(other.metadata(), today.metadata());
        for quantity in Quantity::ALL {
            assert_eq!(other.coefficients(quantity), today.coefficients(quantity));
            assert_eq!(other.basis(quantity), today.basis(quantity));
        }
    }
}
