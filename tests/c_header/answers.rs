//! Answers at points, and their colours.
use std::fs;
use std::path::Path;
use std::process::Command;

use splitsnow::colour::{Colorimeter, Illuminant, Viewing};

use splitsnow::lookup::{Database, Lookup, LookupError};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Parameter, Point};
use splitsnow::spectrum::Resampling;

use super::files::variants;
use super::{ANSWERS, Numbers, folder, run};

/// Wavelengths that tests/c/answers.c asks spectra at.
const AT: [f64; 6] = [100.0, 433.3, 433.4, 555.0, 700.0, 3000.0];

/// A point of the box, on its edges more often than chance, and a little outside.
fn point(database: &Database, numbers: &mut Numbers) -> [f64; 5] {
    let mut point = [0.0; 5];
    for (axis, (to, nodes)) in point.iter_mut().zip(database.axes().core()).enumerate() {
        let [first, last] = [nodes[0], nodes[nodes.len() - 1]];
        *to = match numbers.below(24) {
            0 => nodes[numbers.below(nodes.len())],
            1 => last * (1.0 + 5e-7),
            2 if axis == 3 => first * numbers.next(),
            3 if axis == 3 => last * (1.0 + 3.0 * numbers.next()),
            4 if axis == 3 => 0.0,
            _ => first + (last - first) * numbers.next(),
        };
    }
    match numbers.below(200) {
        0 => point[numbers.below(5)] = f64::NAN,
        1 => point[numbers.below(5)] = -1.0,
        2 => point[numbers.below(5)] = 1e300,
        3 => point[4] = 89.5,
        4 => point[3] = 1e30,
        _ => {}
    }
    point
}

/// How spectra of the file are seen: under each illuminant as lines, and under the first
/// at the wavelengths of the file alone.
fn colorimeters(database: &Database) -> Vec<Option<Colorimeter>> {
    let nm = database.wavelengths_nm().iter();
    let nm: Vec<f64> = nm.copied().collect();
    let viewing = |illuminant| Viewing {
        illuminants: vec![illuminant],
        ..Viewing::default()
    };
    let lines = |light| Colorimeter::piecewise_linear(&nm, &viewing(light)).unwrap();
    let mut all: Vec<_> = Illuminant::ALL.map(lines).into();
    all.push(Colorimeter::viewing(&nm, &viewing(Illuminant::D55)).unwrap());
    all
}

/// What tests/c/answers.c writes of a point that Rust answers with `spectrum`.
fn expected(database: &Database, colours: &[Option<Colorimeter>], spectrum: &[f32]) -> Vec<f64> {
    let nm = database.wavelengths_nm();
    let spectrum: Vec<f64> = spectrum.iter().map(|v| f64::from(*v)).collect();
    let mut all = [spectrum.as_slice(), &spectrum].concat();
    all.extend(Resampling::new(nm, &AT).apply(&spectrum));
    for (i, colour) in colours.iter().enumerate() {
        all.extend(match colour {
            // minus SPLITSNOW_ERROR_ARGUMENT
            None => [-4.0; 3],
            Some(colour) if i == 7 => colour.linear_srgb(&spectrum),
            Some(colour) => colour.xyz(&spectrum),
        });
    }
    all
}

fn write_numbers(path: &Path, numbers: &[f64]) {
    let bytes: Vec<u8> = numbers.iter().flat_map(|v| v.to_ne_bytes()).collect();
    fs::write(path, bytes).unwrap();
}

/// 10,000 points of all variants: answers differ by 1e-6 at most, and refusals agree.
#[test]
fn answers_are_those_of_rust() {
    let folder = folder("points");
    let [file, points, out] = ["snow.safetensors", "points", "out"].map(|n| folder.join(n));
    let mut numbers = Numbers(1);
    let (mut worst, mut asked, mut refused) = (0.0_f64, 0, 0);
    for (name, bytes) in variants() {
        fs::write(&file, &bytes).unwrap();
        let database = Database::from_bytes(&bytes).unwrap();
        let colours = colorimeters(&database);
        for quantity in Quantity::ALL.into_iter().filter(|q| database.has(*q)) {
            // with optional axes, at several places on them
            let optional = database.axes().optional().region();
            for _ in 0..if optional.iter().count() == 0 { 1 } else { 4 } {
                let place = optional.iter().map(|(parameter, [first, last])| {
                    let u = [0.0, 1.0, numbers.next(), numbers.next()][numbers.below(4)];
                    (parameter, first + u * (last - first))
                });
                let conditions: Point = place.collect();
                let there = database.at(conditions).unwrap();
                let lookup = Lookup::new(&there, quantity).unwrap();
                let number = |axis| 5 + Parameter::ALL.iter().position(|a| *a == axis).unwrap();
                let mut given = vec![conditions.iter().count() as f64];
                given.extend(conditions.iter().flat_map(|(a, v)| [number(a) as f64, v]));
                let count = if conditions.is_empty() { 500 } else { 125 };
                let mut all: Vec<_> = (0..count).map(|_| point(&there, &mut numbers)).collect();
                // several of each snow, which is prepared once
                for same in all.chunks_mut(5) {
                    let [facetness, size, density, ..] = same[0];
                    let snow = [facetness, size, density];
                    same[1..4]
                        .iter_mut()
                        .for_each(|p| p[..3].copy_from_slice(&snow));
                }
                given.extend(all.iter().flatten());
                write_numbers(&points, &given);
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
                let each = 2 * lookup.wavelengths() + AT.len() + 24;
                assert_eq!(found.len(), each * all.len());
                for (point, found) in all.iter().zip(found.chunks(each)) {
                    let mut spectrum = vec![0.0; lookup.wavelengths()];
                    let at = Point::from_core(*point);
                    if let Err(error) = lookup.spectrum(at, &mut spectrum) {
                        // minus SPLITSNOW_ERROR_ABSENT or _OUTSIDE, or as below
                        let status = match error {
                            LookupError::Absent { .. } => -11.0,
                            _ => -8.0,
                        };
                        let (spectra, seen) = found.split_at(each - 24);
                        assert!(
                            spectra.iter().all(|v| *v == status)
                                && seen.iter().all(|v| *v == status || *v == -4.0),
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
                    asked += 1;
                }
            }
        }
    }
    eprintln!("{asked} points, {refused} refused, at most {worst:e} off");
    assert!(asked > 9_500 && refused > 100, "{asked} {refused}");
}
