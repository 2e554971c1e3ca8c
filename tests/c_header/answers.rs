//! Spectra and colours at random points.
use std::fs;
use std::path::Path;
use std::process::Command;

use splitsnow::colour::{Colorimeter, Illuminant, Viewing};

use splitsnow::lookup::{Database, Lookup, LookupError};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::Point;
use splitsnow::spectrum::Resampling;

use super::files::variants;
use super::parameters::number;
use super::{ANSWERS, Random, folder, run};

/// The wavelengths at which tests/c/answers.c resamples spectra.
const RESAMPLED_NM: [f64; 6] = [100.0, 433.3, 433.4, 555.0, 700.0, 3000.0];

/// A random point of the core axes. Nodes, edges and points slightly outside are frequent.
fn random_point(database: &Database, random: &mut Random) -> [f64; 5] {
    let mut point = [0.0; 5];
    for (axis, (coordinate, nodes)) in point.iter_mut().zip(database.axes().core()).enumerate() {
        let [first, last] = [nodes[0], nodes[nodes.len() - 1]];
        *coordinate = match random.below(24) {
            0 => nodes[random.below(nodes.len())],
            1 => last * (1.0 + 5e-7),
            2 if axis == 3 => first * random.next(),
            3 if axis == 3 => last * (1.0 + 3.0 * random.next()),
            4 if axis == 3 => 0.0,
            _ => first + (last - first) * random.next(),
        };
    }
    match random.below(200) {
        0 => point[random.below(5)] = f64::NAN,
        1 => point[random.below(5)] = -1.0,
        2 => point[random.below(5)] = 1e300,
        3 => point[4] = 89.5,
        4 => point[3] = 1e30,
        _ => {}
    }
    point
}

/// Colorimeters for the spectra of the file: one per illuminant for linearly interpolated
/// spectra, and one for the wavelengths of the file alone.
fn colorimeters(database: &Database) -> Vec<Option<Colorimeter>> {
    let nm = database.wavelengths_nm().iter();
    let nm: Vec<f64> = nm.copied().collect();
    let viewing = |illuminant| Viewing {
        illuminants: vec![illuminant],
        ..Viewing::default()
    };
    let interpolated =
        |illuminant| Colorimeter::piecewise_linear(&nm, &viewing(illuminant)).unwrap();
    let mut colorimeters: Vec<_> = Illuminant::ALL.map(interpolated).into();
    colorimeters.push(Colorimeter::viewing(&nm, &viewing(Illuminant::D55)).unwrap());
    colorimeters
}

/// The numbers that tests/c/answers.c must write for a point with this spectrum.
fn expected(database: &Database, colours: &[Option<Colorimeter>], spectrum: &[f32]) -> Vec<f64> {
    let nm = database.wavelengths_nm();
    let spectrum: Vec<f64> = spectrum.iter().map(|v| f64::from(*v)).collect();
    let mut values = [spectrum.as_slice(), &spectrum].concat();
    values.extend(Resampling::new(nm, &RESAMPLED_NM).apply(&spectrum));
    for (i, colour) in colours.iter().enumerate() {
        values.extend(match colour {
            // minus SPLITSNOW_ERROR_ARGUMENT
            None => [-4.0; 3],
            Some(colour) if i == 7 => colour.linear_srgb(&spectrum),
            Some(colour) => colour.xyz(&spectrum),
        });
    }
    values
}

fn write_numbers(path: &Path, numbers: &[f64]) {
    let bytes: Vec<u8> = numbers.iter().flat_map(|v| v.to_ne_bytes()).collect();
    fs::write(path, bytes).unwrap();
}

/// 10,000 random points of all variants. Answers differ by at most 1e-6, and the same points
/// are refused.
#[test]
fn answers_agree_with_rust() {
    let folder = folder("points");
    let [file, points, out] = ["snow.safetensors", "points", "out"].map(|n| folder.join(n));
    let mut random = Random(1);
    let (mut worst, mut answered, mut refused) = (0.0_f64, 0, 0);
    for (name, bytes) in variants() {
        fs::write(&file, &bytes).unwrap();
        let database = Database::from_bytes(&bytes).unwrap();
        let colours = colorimeters(&database);
        for quantity in Quantity::ALL.into_iter().filter(|q| database.has(*q)) {
            // several values of the optional axes, if there are any
            let optional = database.axes().optional().region();
            for _ in 0..if optional.iter().count() == 0 { 1 } else { 4 } {
                let values = optional.iter().map(|(parameter, [first, last])| {
                    let u = [0.0, 1.0, random.next(), random.next()][random.below(4)];
                    (parameter, first + u * (last - first))
                });
                let conditions: Point = values.collect();
                let at_conditions = database.at(conditions).unwrap();
                let lookup = Lookup::new(&at_conditions, quantity).unwrap();
                let mut input = vec![conditions.iter().count() as f64];
                input.extend(conditions.iter().flat_map(|(a, v)| [number(a) as f64, v]));
                let count = if conditions.is_empty() { 500 } else { 125 };
                let mut queries: Vec<_> = (0..count)
                    .map(|_| random_point(&at_conditions, &mut random))
                    .collect();
                // several points share a snow, which is prepared once
                for group in queries.chunks_mut(5) {
                    let [facetness, size, density, ..] = group[0];
                    let snow = [facetness, size, density];
                    group[1..4]
                        .iter_mut()
                        .for_each(|p| p[..3].copy_from_slice(&snow));
                }
                input.extend(queries.iter().flatten());
                write_numbers(&points, &input);
                let mut command = Command::new(&*ANSWERS);
                command.arg("points").arg(&file).arg(quantity.name());
                run(command.args([&points, &out]));

                let found = fs::read(&out).unwrap();
                let found: Vec<f64> = found
                    .as_chunks::<8>()
                    .0
                    .iter()
                    .map(|bytes| f64::from_ne_bytes(*bytes))
                    .collect();
                let per_point = 2 * lookup.wavelengths() + RESAMPLED_NM.len() + 24;
                assert_eq!(found.len(), per_point * queries.len());
                for (point, found) in queries.iter().zip(found.chunks(per_point)) {
                    let mut spectrum = vec![0.0; lookup.wavelengths()];
                    let core = Point::from_core(*point);
                    if let Err(error) = lookup.spectrum(core, &mut spectrum) {
                        // minus SPLITSNOW_ERROR_ABSENT or _OUTSIDE
                        let status = match error {
                            LookupError::Absent { .. } => -11.0,
                            _ => -8.0,
                        };
                        let (spectra, colours) = found.split_at(per_point - 24);
                        assert!(
                            spectra.iter().all(|v| *v == status)
                                && colours.iter().all(|v| *v == status || *v == -4.0),
                            "{name} {point:?} {found:?}"
                        );
                        refused += 1;
                        continue;
                    }
                    let expected = expected(&database, &colours, &spectrum);
                    for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
                        let error = (found - expected).abs();
                        assert!(error <= 1e-6, "{name} {point:?} {i}: {found} {expected}");
                        worst = worst.max(error);
                    }
                    answered += 1;
                }
            }
        }
    }
    eprintln!("{answered} points answered, {refused} refused, largest difference {worst:e}");
    assert!(answered > 9_500 && refused > 100, "{answered} {refused}");
}
