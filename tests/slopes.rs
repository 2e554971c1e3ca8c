//! The slopes of the cubic along the thickness: what their limit keeps, and that it costs no
//! accuracy between nodes.
use std::collections::BTreeMap;

use ndarray::Array2;
use proptest::prelude::*;
use splitsnow::compress::{Bands, Basis, Choice, CompactFile, CompactVariant, compress};
use splitsnow::lookup::{Database, Lookup, SubstrateKind};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Axes, Parameter, Point};

const WAVELENGTHS: usize = 31;
/// Number of curves of [`axes`].
const CURVES: usize = 24;
const NODES_CM: [f64; 6] = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0];

fn axes() -> Axes {
    Axes::from([
        (Parameter::Facetness, vec![0.3]),
        (Parameter::GrainSize, vec![200.0, 500.0]),
        (Parameter::Density, vec![300.0]),
        (Parameter::Thickness, NODES_CM.to_vec()),
        (Parameter::Incidence, vec![0.0, 60.0]),
    ])
}

fn points() -> impl Iterator<Item = Point> {
    let axes = axes();
    (0..axes.count()).map(move |number| axes.point(number))
}

/// R and T of a slab by two streams (Kubelka and Munk 1931). Absorption over scattering grows from
/// 1e-5 to 3, so that light passes at the first wavelengths, and at the last ones the thinnest slab
/// reflects as little as the thickest.
fn slab(point: Point, quantity: Quantity) -> Vec<f64> {
    let scatter = 200.0 / point[Parameter::GrainSize]
        * (1.0 + 0.5 * point[Parameter::Incidence].to_radians().cos());
    let value = |l: usize| {
        let ratio = 1e-5 * 3e5f64.powf(l as f64 / 30.0);
        let a = 1.0 + ratio;
        let b = (a * a - 1.0).sqrt();
        let along = b * scatter * point[Parameter::Thickness];
        match quantity {
            Quantity::Transmittance => b / (a * along.sinh() + b * along.cosh()),
            Quantity::Reflectance => 1.0 / (a + b / along.tanh()),
        }
    };
    (0..WAVELENGTHS).map(value).collect()
}

/// A file of these curves with this basis and number of components.
fn file(
    substrate: SubstrateKind,
    (basis, components): (Basis, usize),
    curve: impl Fn(Point, Quantity) -> Vec<f64>,
) -> Database {
    let axes = axes();
    let compressed = |quantity| {
        let rows = points().flat_map(|point| curve(point, quantity)).collect();
        let curves = Array2::from_shape_vec((CURVES, WAVELENGTHS), rows).unwrap();
        let variant = CompactVariant {
            basis,
            ..CompactVariant::default()
        };
        let components = Choice::Components(components);
        let bands = Bands::default();
        compress(curves.view(), quantity, None, &bands, components, variant).unwrap()
    };
    let nm: Vec<f64> = (0..WAVELENGTHS).map(|l| 400.0 + 50.0 * l as f64).collect();
    let file = CompactFile {
        axes: &axes,
        absent: &[],
        wavelengths_nm: &nm,
        substrate,
        transmittance: Some(&compressed(Quantity::Transmittance)),
        reflectance: Some(&compressed(Quantity::Reflectance)),
        provenance: "{}",
        extra: &BTreeMap::new(),
    };
    Database::from_bytes(&file.to_bytes().unwrap()).unwrap()
}

/// Spectra of one snow at `steps` thicknesses from every node to the next, the node first; then
/// that of the last node.
fn spectra(lookup: &Lookup, first: Point, steps: usize) -> Vec<Vec<f32>> {
    let between = |pair: &[f64]| {
        let [from, to] = [pair[0], pair[1]];
        (0..steps).map(move |i| from + (to - from) * i as f64 / steps as f64)
    };
    let thicknesses_cm = NODES_CM.windows(2).flat_map(between).chain([NODES_CM[5]]);
    let spectrum = |thickness_cm| {
        let mut spectrum = vec![0.0; WAVELENGTHS];
        let point = first.with(Parameter::Thickness, thickness_cm);
        lookup.spectrum(point, &mut spectrum).unwrap();
        spectrum
    };
    thicknesses_cm.map(spectrum).collect()
}

/// The snow between the nodes of the other axes.
fn snow() -> Point {
    let point = axes().point(0);
    point
        .with(Parameter::GrainSize, 300.0)
        .with(Parameter::Incidence, 40.0)
}

/// Largest differences between two lists of spectra: at nodes, and anywhere.
fn differences(a: &[Vec<f32>], b: &[Vec<f32>], steps: usize) -> [f32; 2] {
    let mut largest = [0.0f32; 2];
    for (i, (a, b)) in a.iter().zip(b).enumerate() {
        for (a, b) in a.iter().zip(b) {
            let difference = (a - b).abs();
            largest[1] = largest[1].max(difference);
            if i % steps == 0 {
                largest[0] = largest[0].max(difference);
            }
        }
    }
    largest
}

/// How far the spectra between two nodes leave the range of those at the nodes.
fn overshoot(spectra: &[Vec<f32>], steps: usize) -> f32 {
    let mut largest = 0.0f32;
    for (i, spectrum) in spectra.iter().enumerate().take(spectra.len() - 1) {
        let [thin, thick] = [i / steps, i / steps + 1].map(|node| &spectra[node * steps]);
        for ((value, thin), thick) in spectrum.iter().zip(thin).zip(thick) {
            largest = largest
                .max(thin.min(*thick) - value)
                .max(value - thin.max(*thick));
        }
    }
    largest
}

/// R of the last wavelengths is the same at all nodes, where R of the first ones still grows. A
/// logarithmic file answers between nodes as the plain file of all components does, but for its error
/// on nodes and 0.001.
#[test]
fn saturated_wavelengths_do_not_flatten_the_others() {
    let plain = file(SubstrateKind::Black, (Basis::Linear, CURVES), slab);
    for components in [6, 10, CURVES] {
        let log = file(SubstrateKind::Black, (Basis::Log, components), slab);
        for quantity in Quantity::ALL {
            let [plain, log] = [&plain, &log]
                .map(|file| spectra(&Lookup::new(file, quantity).unwrap(), snow(), 20));
            let [on_nodes, anywhere] = differences(&plain, &log, 20);
            let what = format!("{quantity:?}, {components} components: {on_nodes} on nodes");
            assert!(anywhere < on_nodes + 1e-3, "{what}, {anywhere} anywhere");
            let overshoot = overshoot(&log, 20);
            assert!(
                overshoot < 1e-3,
                "{what}, {overshoot} beyond those of nodes"
            );
        }
    }
}

/// Over bright ground R falls with thickness. Halfway between nodes, slopes of 0, which are
/// monotone too, give the mean of y. The error is a small part of theirs.
#[test]
fn falling_reflectance_is_followed_between_nodes() {
    let over_ground = |point: Point, quantity| match quantity {
        Quantity::Transmittance => slab(point, quantity),
        Quantity::Reflectance => {
            let ground = 0.95;
            let value = |(r, t): (&f64, &f64)| r + t * t * ground / (1.0 - ground * r);
            let t = slab(point, Quantity::Transmittance);
            slab(point, quantity).iter().zip(&t).map(value).collect()
        }
    };
    let point = axes().point(0);
    for basis in Basis::ALL {
        let file = file(SubstrateKind::Reflecting, (basis, CURVES), over_ground);
        let lookup = Lookup::new(&file, Quantity::Reflectance).unwrap();
        let found = spectra(&lookup, point, 2);
        let [mut error, mut error_of_flat, mut falls] = [0.0; 3];
        for (cell, nodes) in NODES_CM.windows(2).zip(found.windows(3).step_by(2)) {
            let middle = point.with(Parameter::Thickness, 0.5 * (cell[0] + cell[1]));
            // the cubic's middle is that of the coordinate ln(1 + h / 0.5 cm)
            let place = |cm: f64| (1.0 + cm / 0.5).ln();
            let t = (place(middle[Parameter::Thickness]) - place(cell[0]))
                / (place(cell[1]) - place(cell[0]));
            let weight = t * t * (3.0 - 2.0 * t);
            let expected = over_ground(middle, Quantity::Reflectance);
            for (l, expected) in expected.iter().enumerate() {
                let [from, now, to] = [0, 1, 2].map(|i| f64::from(nodes[i][l]));
                if to < from - 1e-3 {
                    let flat = 1.0 - (1.0 - from).powf(1.0 - weight) * (1.0 - to).powf(weight);
                    falls += 1.0;
                    error += (now - expected).abs();
                    error_of_flat += (flat - expected).abs();
                }
            }
        }
        assert!(falls > 20.0, "{falls}");
        assert!(
            error < 0.5 * error_of_flat,
            "{basis:?}: {error} {error_of_flat}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: None,
        ..ProptestConfig::with_cases(32)
    })]
    /// Of any curves, with noise, also T of 0, a logarithmic file leaves the range of two nodes by no
    /// more than twice its error on nodes and 0.001.
    #[test]
    fn logarithmic_files_hardly_overshoot(
        noise in proptest::collection::vec(-1e-3..1e-3_f64, CURVES),
        components in 3..=CURVES,
    ) {
        let noisy = |point: Point, quantity| {
            let row = points().position(|other| other == point).unwrap();
            let value = |v: &f64| (v + noise[row]).clamp(0.0, 1.0);
            slab(point, quantity).iter().map(value).collect()
        };
        let plain = file(SubstrateKind::Layers, (Basis::Linear, CURVES), noisy);
        let log = file(SubstrateKind::Layers, (Basis::Log, components), noisy);
        for quantity in Quantity::ALL {
            let [plain, log] = [&plain, &log]
                .map(|file| spectra(&Lookup::new(file, quantity).unwrap(), axes().point(0), 20));
            prop_assert!(log.iter().flatten().all(|value| (0.0..=1.0).contains(value)));
            let [on_nodes, _] = differences(&plain, &log, 20);
            let overshoot = overshoot(&log, 20);
            prop_assert!(
                overshoot < 2.0 * on_nodes + 1e-3,
                "{quantity:?}, {components} components: {on_nodes} on nodes, {overshoot} between"
            );
        }
    }
}
