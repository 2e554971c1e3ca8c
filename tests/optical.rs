//! A grid of specific surface areas up to a half-space, from the build to the query.
use std::fs;
use std::process::Command;

use assert_cmd::cargo::cargo_bin;
use serde_json::{Value, json};
use splitsnow::parameter::Parameter;
use splitsnow::store::Store;

const GRID: &str = "version = 1
[axes]
facetness = [0.3]
ssa_m2_kg = [10, 20, 40]
density_kg_m3 = [300]
thickness_cm = [2, 10, inf]
incidence_angle_deg = [0]
[wavelengths]
values_nm = [500, 1000, 1300]
[run]
engine = \"hybrid\"
rays = 1024
";

/// Runs the program in the folder that holds the grid.
fn output(dir: &std::path::Path, args: &str) -> String {
    let mut command = Command::new(cargo_bin!("splitsnow"));
    let output = command
        .current_dir(dir)
        .args(args.split_whitespace())
        .output();
    let output = output.unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{args}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// The values of a coordinate in its only chunk; the chunk ends with a checksum.
fn coordinate(dir: &std::path::Path, name: &str) -> Vec<f64> {
    let bytes = fs::read(dir.join("out/g/database.zarr").join(name).join("c.0")).unwrap();
    let numbers = bytes[..bytes.len() - 4].as_chunks::<8>().0.iter();
    numbers.map(|bytes| f64::from_le_bytes(*bytes)).collect()
}

#[test]
fn surface_areas_and_a_half_space_are_built_stored_and_queried() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    fs::write(dir.join("g.toml"), GRID).unwrap();
    output(dir, "build g.toml --threads 1");

    // the store: increasing sizes, the given surface areas next to them, and an infinite
    // thickness
    let sizes = coordinate(dir, "grain_size_um");
    assert!(
        sizes.is_sorted() && (sizes[1] / sizes[0] - 2.0).abs() < 1e-12,
        "{sizes:?}"
    );
    assert_eq!(coordinate(dir, "ssa_m2_kg"), [40.0, 20.0, 10.0]);
    assert_eq!(coordinate(dir, "thickness_cm"), [2.0, 10.0, f64::INFINITY]);
    let root = fs::read_to_string(dir.join("out/g/database.zarr/zarr.json")).unwrap();
    let root: Value = serde_json::from_str(&root).unwrap();
    let attributes = &root["attributes"];
    assert_eq!(attributes["coordinates"], "ssa_m2_kg");
    assert_eq!(attributes["ssa_m2_kg"], json!([40.0, 20.0, 10.0]));
    let relation = attributes["grain_size_relation"].as_str().unwrap();
    assert!(relation.contains("4 K1 K2 / ice density"), "{relation}");
    let nodes = &root["consolidated_metadata"]["metadata"];
    assert_eq!(
        nodes["ssa_m2_kg"]["dimension_names"],
        json!(["grain_size_um"])
    );
    assert_eq!(nodes["ssa_m2_kg"]["attributes"]["units"], "m2 kg-1");
    let store = Store::open(&dir.join("out/g")).unwrap();
    assert_eq!(store.axes().values(Parameter::GrainSize), sizes);
    assert!(store.verify().unwrap().is_whole());
    drop(store);
    // building again reuses the store
    output(dir, "build g.toml --threads 1");

    // the compact file and its answers
    let file = fs::read(dir.join("out/g/snow.safetensors")).unwrap();
    let length = u64::from_le_bytes(*file.first_chunk().unwrap()) as usize;
    let header: Value = serde_json::from_slice(&file[8..8 + length]).unwrap();
    let about = &header["__metadata__"];
    assert_eq!(about["ssa_m2_kg"], "[40.0,20.0,10.0]");
    assert_eq!(about["grain_size_relation"], relation);
    let query = |thickness: &str, quantity: &str| -> Vec<f64> {
        let size = sizes[1];
        let args = format!(
            "query out/g/snow.safetensors --facetness 0.3 --grain-size-um {size} --density-kg-m3 300 --thickness-cm {thickness} --incidence-angle-deg 0 --quantity {quantity}"
        );
        let lines = output(dir, &args);
        let values = lines.lines().skip(1);
        values
            .map(|line| line.split_once(',').unwrap().1.parse().unwrap())
            .collect()
    };
    let depths = ["10", "30", "1000", "inf"];
    let reflectances = depths.map(|depth| query(depth, "reflectance"));
    let transmittances = depths.map(|depth| query(depth, "transmittance"));
    for pair in reflectances.windows(2) {
        assert!(
            (0..3).all(|l| pair[0][l] <= pair[1][l] + 1e-6),
            "{reflectances:?}"
        );
    }
    for pair in transmittances.windows(2) {
        assert!(
            (0..3).all(|l| pair[0][l] >= pair[1][l] - 1e-6),
            "{transmittances:?}"
        );
    }
    // clean snow reflects nearly all visible light; the tolerance is that of the file
    assert!(
        reflectances[3][0] > 0.97 && reflectances[3][0] > reflectances[0][0] + 0.01,
        "{reflectances:?}"
    );
    assert!(
        transmittances[3].iter().all(|t| t.abs() < 5e-3),
        "{transmittances:?}"
    );
}
