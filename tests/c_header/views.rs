//! Anisotropy factors and directional factors at random directions.
use std::fs;
use std::process::Command;

use splitsnow::compress::{Basis, Choice, CompactVariant, Precision};
use splitsnow::lookup::{Anisotropy, Database, DirectionalQuantity, Directions, LookupError};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Axes, Parameter, Point};

use super::files::Contents;
use super::parameters::number;
use super::{ANSWERS, Random, folder, run};

/// Anisotropy factors for the file of [`Contents::default`].
pub(crate) fn documented() -> Contents {
    let Contents { axes, .. } = Contents::default();
    Contents {
        axes: axes
            .with(
                Parameter::View,
                vec![0.0, 12.3, 27.0, 41.7, 60.0, 71.1, 80.0],
            )
            .with(
                Parameter::RelativeAzimuth,
                vec![0.0, 33.3, 61.7, 90.0, 120.0, 151.3, 180.0],
            ),
        ..Contents::default()
    }
}

/// Two files that belong together: spectra, and their anisotropy factors.
struct Pair {
    name: &'static str,
    spectra: Vec<u8>,
    views: Vec<u8>,
}

impl Pair {
    /// The second file has the contents of `views`, the first the same without the axes of views.
    fn new(name: &'static str, views: &Contents) -> Self {
        let spectra = Contents {
            axes: views.axes.without_views(),
            nm: views.nm.clone(),
            absent: views.absent.clone(),
            choice: views.choice,
            quantities: views.quantities.clone(),
            ..Contents::default()
        };
        Self {
            name,
            spectra: spectra.bytes(),
            views: views.bytes(),
        }
    }
}

/// The contents with other nodes on some axes.
fn with_nodes<const N: usize>(nodes: [(Parameter, &[f64]); N]) -> Contents {
    let set = |axes: Axes, (parameter, values): (Parameter, &[f64])| {
        axes.with(parameter, values.to_vec())
    };
    Contents {
        axes: nodes.into_iter().fold(documented().axes, set),
        ..Contents::default()
    }
}

fn pairs() -> Vec<Pair> {
    let mut pairs = Vec::new();
    for (name, precision) in [
        ("f32", Precision::F32),
        ("f16", Precision::F16),
        ("quantised", Precision::Quantised),
    ] {
        let variant = CompactVariant {
            basis: Basis::Linear,
            precision,
        };
        let contents = Contents {
            variant,
            ..documented()
        };
        pairs.push(Pair::new(name, &contents));
    }
    let short: [(Parameter, &[f64]); 5] = [
        (Parameter::Facetness, &[0.3, 0.5]),
        (Parameter::GrainSize, &[100.0, 300.0]),
        (Parameter::Density, &[300.0]),
        (Parameter::Thickness, &[1.0, 3.0, 9.0]),
        (Parameter::Incidence, &[0.0, 33.3, 70.0]),
    ];
    let optional = with_nodes(short).axes;
    let optional = optional
        .with(Parameter::BlackCarbon, vec![0.0, 50.0, 200.0])
        .with(Parameter::Temperature, vec![-20.0, -5.0])
        .with(Parameter::SubstrateReflectance, vec![0.25]);
    let contents = Contents {
        axes: optional,
        ..Contents::default()
    };
    pairs.push(Pair::new("optional", &contents));
    let contents = Contents {
        absent: vec![0, 2, 5],
        ..documented()
    };
    pairs.push(Pair::new("absent", &contents));
    // directions end at the normal
    let part = with_nodes([(Parameter::RelativeAzimuth, &[0.0, 30.0, 60.0])]);
    pairs.push(Pair::new("part of the azimuths", &part));
    let high = with_nodes([
        (Parameter::View, &[20.0, 30.0, 50.0]),
        (Parameter::Incidence, &[10.0, 60.0]),
    ]);
    pairs.push(Pair::new("without the normal", &high));
    let two = with_nodes([
        (Parameter::View, &[0.0, 60.0]),
        (Parameter::RelativeAzimuth, &[0.0, 180.0]),
        (Parameter::Incidence, &[0.0, 50.0]),
        (Parameter::Thickness, &[3.0, 9.0]),
    ]);
    pairs.push(Pair::new("two nodes", &two));
    let one = with_nodes([
        (Parameter::View, &[40.0]),
        (Parameter::RelativeAzimuth, &[90.0]),
        (Parameter::Incidence, &[30.0]),
        (Parameter::Facetness, &[0.3]),
        (Parameter::GrainSize, &[200.0]),
        (Parameter::Density, &[300.0]),
        (Parameter::Thickness, &[15.0]),
    ]);
    let one = Contents {
        choice: Choice::Components(1),
        ..one
    };
    pairs.push(Pair::new("one node", &one));
    // diffuse light
    let diffuse = with_nodes([
        (Parameter::RelativeAzimuth, &[0.0]),
        (Parameter::Incidence, &[0.0]),
    ]);
    pairs.push(Pair::new("diffuse", &diffuse));
    // more components than are summed in one block, and a single quantity
    let many = with_nodes([(Parameter::Thickness, &[1.0, 10.0])]);
    let many = Contents {
        nm: (0..90).map(|i| 380.0 + 5.0 * f64::from(i)).collect(),
        choice: Choice::Components(90),
        quantities: vec![Quantity::Reflectance],
        ..many
    };
    pairs.push(Pair::new("many", &many));
    pairs
}

const CORE_AND_VIEWS: [Parameter; 7] = {
    let [facetness, size, density, thickness, incidence] = Parameter::CORE;
    let [view, azimuth] = Parameter::VIEWS;
    [
        facetness, size, density, thickness, incidence, view, azimuth,
    ]
};

/// A random point. Nodes, edges and points slightly outside are frequent.
fn random_point(axes: &Axes, random: &mut Random) -> [f64; 7] {
    let mut point = CORE_AND_VIEWS.map(|parameter| {
        let nodes = axes.values(parameter);
        let [first, last] = [nodes[0], nodes[nodes.len() - 1]];
        match (random.below(20), parameter) {
            (0, _) => nodes[random.below(nodes.len())],
            (1, _) => last * (1.0 + 5e-7),
            (2, _) => first * (1.0 - 5e-7),
            (3, Parameter::Thickness) => first * random.next(),
            (4, Parameter::Thickness) => last * (1.0 + 3.0 * random.next()),
            (5, Parameter::Thickness) => 0.0,
            // near the normal, from both sides of the plane
            (3, Parameter::View | Parameter::Incidence) => first * 1.01,
            (3, Parameter::RelativeAzimuth) => 360.0 * (random.next() - 0.5) * 4.0,
            (4, Parameter::RelativeAzimuth) => 360.0 - last,
            _ => first + (last - first) * random.next(),
        }
    });
    let strange = [f64::NAN, f64::INFINITY, -1.0, 1e300, 89.5, -1e-8];
    if random.below(40) == 0 {
        point[random.below(7)] = strange[random.below(strange.len())];
    }
    point
}

/// Minus the status of the header for this error.
fn status(error: &LookupError) -> f64 {
    match error {
        LookupError::Absent { .. } => -11.0,
        _ => -8.0,
    }
}

/// Whether the numbers of the header are this spectrum, within 1e-6 of each value and `absolute`,
/// or all the status of this error. Returns the largest difference over the value.
fn compare(
    found: &[f64],
    expected: &Result<Vec<f32>, LookupError>,
    absolute: f64,
) -> Result<f64, String> {
    let mut worst = 0.0_f64;
    for (i, found) in found.iter().enumerate() {
        let expected = match expected {
            Ok(spectrum) => f64::from(spectrum[i]),
            Err(error) => status(error),
        };
        let error = (found - expected).abs();
        if error.is_nan() || error > 1e-6 * expected.abs() + absolute {
            return Err(format!("{i}: found {found}, expected {expected}"));
        }
        worst = worst.max(error / expected.abs());
    }
    Ok(worst)
}

/// Random directions of all kinds of files. Factors differ by at most 1e-6 of their value, and
/// the same points are refused.
#[test]
fn directions_agree_with_rust() {
    let folder = folder("views");
    let [spectra, views, points, out] =
        ["snow.safetensors", "views.safetensors", "points", "out"].map(|n| folder.join(n));
    let mut random = Random(3);
    let (mut worst, mut answered, mut refused) = (0.0_f64, 0, 0);
    for pair in pairs() {
        let name = pair.name;
        fs::write(&spectra, &pair.spectra).unwrap();
        fs::write(&views, &pair.views).unwrap();
        let [database, anisotropy] =
            [&pair.spectra, &pair.views].map(|bytes| Database::from_bytes(bytes).unwrap());
        let axes = anisotropy.axes().clone();
        let optional = axes.optional().region();
        let stored = Quantity::ALL.into_iter().filter(|q| anisotropy.has(*q));
        for quantity in stored {
            for _ in 0..if optional.iter().count() == 0 { 1 } else { 4 } {
                let values = optional.iter().map(|(parameter, [first, last])| {
                    let u = [0.0, 1.0, random.next(), random.next()][random.below(4)];
                    (parameter, first + u * (last - first))
                });
                let conditions: Point = values.collect();
                let [database, anisotropy] =
                    [&database, &anisotropy].map(|file| file.at(conditions).unwrap());
                let directions = Directions::new(&database, &anisotropy).unwrap();
                let factors = Anisotropy::new(&anisotropy, quantity).unwrap();
                let mut input = vec![conditions.iter().count() as f64];
                input.extend(conditions.iter().flat_map(|(a, v)| [number(a) as f64, v]));
                let count = if conditions.is_empty() { 400 } else { 150 };
                let mut queries: Vec<_> = (0..count)
                    .map(|_| random_point(&axes, &mut random))
                    .collect();
                // several points share a snow, which is prepared once
                for group in queries.chunks_mut(5) {
                    let [facetness, size, density, ..] = group[0];
                    let snow = [facetness, size, density];
                    let others = group[1..4].iter_mut();
                    others.for_each(|p| p[..3].copy_from_slice(&snow));
                }
                input.extend(queries.iter().flatten());
                let bytes: Vec<u8> = input.iter().flat_map(|v| v.to_ne_bytes()).collect();
                fs::write(&points, bytes).unwrap();
                let mut command = Command::new(&*ANSWERS);
                command.arg("views").args([&spectra, &views]);
                run(command.arg(quantity.name()).args([&points, &out]));

                let found = fs::read(&out).unwrap();
                let numbers = found.as_chunks::<8>().0.iter();
                let found: Vec<f64> = numbers.map(|bytes| f64::from_ne_bytes(*bytes)).collect();
                let n = factors.wavelengths();
                assert_eq!(found.len(), 4 * n * queries.len(), "{name}");
                for (point, found) in queries.iter().zip(found.chunks(4 * n)) {
                    let at: Point = CORE_AND_VIEWS.into_iter().zip(*point).collect();
                    let mut spectrum = vec![0.0; n];
                    let factor = factors.spectrum(at, &mut spectrum);
                    let factor = factor.map(|()| spectrum.clone());
                    let toward = match quantity {
                        Quantity::Reflectance => DirectionalQuantity::ReflectanceFactor,
                        Quantity::Transmittance => DirectionalQuantity::TransmittanceFactor,
                    };
                    let product = directions.spectrum(toward, at, &mut spectrum);
                    let product = product.map(|()| spectrum);
                    let (factors, products) = found.split_at(2 * n);
                    for (found, expected, absolute) in [
                        (factors, &factor, 0.0),
                        // the accuracy of the look-up times the largest factor
                        (products, &product, 3e-6),
                    ] {
                        for found in found.chunks(n) {
                            match compare(found, expected, absolute) {
                                Ok(difference) if absolute == 0.0 => worst = worst.max(difference),
                                Ok(_) => {}
                                Err(error) => panic!("{name} {quantity:?} {point:?} {error}"),
                            }
                        }
                    }
                    answered += usize::from(factor.is_ok());
                    refused += usize::from(factor.is_err());
                }
            }
        }
    }
    eprintln!("{answered} points answered, {refused} refused, largest difference {worst:e}");
    assert!(answered > 7_000 && refused > 500, "{answered} {refused}");
}
