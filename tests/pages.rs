//! Numbers quoted in the docs match the files that the programs wrote.
//!
//! `docs/validation.md` is generated from `docs/validation.md.in`, in which `{...}` stands
//! for a number of the study whose figure comes next:
//!
//! | | |
//! |---|---|
//! | `{KEY @ 500}` | value of a curve at a wavelength; of the BRDF in the forward plane at whole degrees |
//! | `{KEY @ 67 180}` | value of the BRDF at the azimuth nearest to the given one |
//! | `{KEY @ 400-700}` | mean over wavelengths |
//! | `{A / B}`, `{A - B}` | ratio or difference of two of these |
//! | `{rmse KEY \| KEY}`, `noise`, `largest`, `percent` | comparison of two curves: root-mean-square difference, its standard error, largest difference, mean relative difference |
//! | `{peak KEY}` | wavelength of the maximum |
//! | `{slope KEY @ 1.25-10}`, `miss`, `left` | least-squares line through the logarithms: slope, largest residual in %, unexplained variance in % |
//!
//! KEY is a variant, `group, variant`, or a group. `; 3` sets the number of decimals;
//! without it the standard error of the last digits follows in parentheses. In other pages,
//! rows of tables are compared. `UPDATE_GOLDEN=1 cargo test --release --test pipeline pages`
//! rewrites all pages.
//!
//! In the other pages `<!-- = NAME -->` follows the numbers that NAME stands for
//! (tests/common/quoted.rs). NAME is a row of `docs/quoted.csv`, a number of another file
//! ([`values_of_other_files`]), or a result of a test whose source contains "NAME".
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::docs::keep;
use crate::quoted::{bracketed, fixed, like, marks, number, page};

#[path = "../examples/stability/cases.rs"]
#[allow(dead_code)]
mod cases;
#[path = "../examples/quoted/exact.rs"]
mod exact;
#[path = "../examples/quoted/row.rs"]
mod row;

fn docs() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("docs")
}

/// The rows of a CSV file, by its path in the repository, without comments.
fn rows(path: &str) -> Vec<csv::StringRecord> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(path);
    let reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .from_path(&path);
    reader.unwrap().into_records().map(Result::unwrap).collect()
}

/// A value with its standard error.
#[derive(Clone, Copy)]
struct Value {
    value: f64,
    se: f64,
}

/// A row of a study.
struct Point {
    /// Wavelength, thickness, or polar angle and azimuth.
    coordinates: Vec<f64>,
    value: Value,
}

/// The rows of a variant, or of all variants of a group.
fn curve(study: &str, key: &str) -> Vec<Point> {
    let rows = rows(&format!("docs/validation/{study}.csv"));
    let matches = |row: &&csv::StringRecord| {
        let (group, variant) = (&row[0], &row[1]);
        [group, variant, &format!("{group}, {variant}")].contains(&key)
    };
    let points: Vec<_> = rows
        .iter()
        .filter(matches)
        .map(|row| {
            let numbers: Vec<_> = row.iter().skip(2).map(number).collect();
            let (coordinates, value) = numbers.split_at(numbers.len() - 2);
            Point {
                coordinates: coordinates.to_vec(),
                value: Value {
                    value: value[0],
                    se: value[1],
                },
            }
        })
        .collect();
    assert!(!points.is_empty(), "{study}.csv has no {key}");
    points
}

/// Parses a range `LO-HI`.
fn range(text: &str) -> Option<(f64, f64)> {
    let (low, high) = text.split_once('-')?;
    Some((number(low), number(high)))
}

fn within(points: Vec<Point>, (low, high): (f64, f64)) -> Vec<Point> {
    let inside = |point: &Point| (low..=high).contains(&point.coordinates[0]);
    points.into_iter().filter(inside).collect()
}

/// Evaluates `KEY @ PLACE`, or the ratio or difference of two of these.
fn value(study: &str, text: &str) -> Value {
    if let Some((a, b)) = text.split_once(" / ") {
        let (a, b) = (value(study, a), value(study, b));
        let ratio = a.value / b.value;
        return Value {
            value: ratio,
            se: ratio * (a.se / a.value).hypot(b.se / b.value),
        };
    }
    if let Some((a, b)) = text.split_once(" - ") {
        let (a, b) = (value(study, a), value(study, b));
        return Value {
            value: a.value - b.value,
            se: a.se.hypot(b.se),
        };
    }
    let (key, place) = text
        .rsplit_once(" @ ")
        .unwrap_or_else(|| panic!("{text}: no wavelength or angle"));
    let points = curve(study, key);
    if let Some(range) = range(place) {
        let points = within(points, range);
        let sum: f64 = points.iter().map(|point| point.value.value).sum();
        // errors of different wavelengths are correlated, and the correlation is unknown
        return Value {
            value: sum / points.len() as f64,
            se: f64::NAN,
        };
    }
    let (x, azimuth) = place.split_once(' ').unwrap_or((place, "0"));
    let (x, azimuth) = (number(x), number(azimuth));
    let is_brdf = points[0].coordinates.len() == 2;
    let found = points.iter().filter(|point| {
        let coordinate = if is_brdf {
            point.coordinates[0].round()
        } else {
            point.coordinates[0]
        };
        (coordinate - x).abs() < 1e-6
    });
    let distance = |point: &&Point| {
        point
            .coordinates
            .get(1)
            .map_or(0.0, |other| (other - azimuth).abs())
    };
    let found: Vec<_> = found.collect();
    assert!(
        is_brdf || found.len() == 1,
        "{study}: {text}: {} rows",
        found.len()
    );
    let nearest = found
        .into_iter()
        .min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let nearest = nearest.unwrap_or_else(|| panic!("{study}: {text}: no row"));
    // nadir has no azimuth; elsewhere the azimuth may differ by the width of a sensor
    assert!(
        x == 0.0 || distance(&nearest) < 5.0,
        "{study}: {text}: no such azimuth"
    );
    nearest.value
}

/// The values of two curves, row by row.
fn pairs(study: &str, keys: &str) -> Vec<(Value, Value)> {
    let (a, b) = keys
        .split_once(" | ")
        .unwrap_or_else(|| panic!("{keys}: one curve"));
    let (a, b) = (curve(study, a), curve(study, b));
    assert!(
        a.iter()
            .map(|p| &p.coordinates)
            .eq(b.iter().map(|p| &p.coordinates)),
        "{keys}"
    );
    a.iter().zip(&b).map(|(a, b)| (a.value, b.value)).collect()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<_> = values.collect();
    values.iter().sum::<f64>() / values.len() as f64
}

/// The least-squares line through the logarithms: its slope, its largest relative residual
/// in % and the unexplained variance in %.
fn least_squares_line(study: &str, text: &str) -> [f64; 3] {
    let (key, place) = text.split_once(" @ ").unwrap();
    let points = within(curve(study, key), range(place).unwrap());
    let logs: Vec<_> = points
        .iter()
        .map(|p| [p.coordinates[0].ln(), p.value.value.ln()])
        .collect();
    let means = [0, 1].map(|i| mean(logs.iter().map(|p| p[i])));
    let product =
        |i: usize, j: usize| mean(logs.iter().map(|p| (p[i] - means[i]) * (p[j] - means[j])));
    let slope = product(0, 1) / product(0, 0);
    let residuals = logs
        .iter()
        .map(|p| (p[1] - means[1] - slope * (p[0] - means[0])).exp_m1().abs());
    let unexplained = 1.0 - slope * product(0, 1) / product(1, 1);
    [
        slope,
        100.0 * residuals.fold(0.0, f64::max),
        100.0 * unexplained,
    ]
}

/// The text that replaces a reference.
fn quoted(study: &str, reference: &str) -> String {
    let (text, decimals) = match reference.rsplit_once("; ") {
        Some((text, decimals)) => (text, Some(number(decimals) as usize)),
        None => (reference, None),
    };
    let (word, rest) = text.split_once(' ').unwrap();
    let difference = |(a, b): &(Value, Value)| a.value - b.value;
    let plain = match word {
        "rmse" => mean(pairs(study, rest).iter().map(|p| difference(p).powi(2))).sqrt(),
        "noise" => mean(
            pairs(study, rest)
                .iter()
                .map(|(a, b)| a.se.hypot(b.se).powi(2)),
        )
        .sqrt(),
        "largest" => pairs(study, rest)
            .iter()
            .map(|p| difference(p).abs())
            .fold(0.0, f64::max),
        "percent" => {
            100.0
                * mean(
                    pairs(study, rest)
                        .iter()
                        .map(|p| difference(p).abs() / p.0.value),
                )
        }
        "peak" => {
            let larger = |a: &Point, b: &Point| a.value.value.total_cmp(&b.value.value);
            return curve(study, rest)
                .into_iter()
                .max_by(larger)
                .unwrap()
                .coordinates[0]
                .to_string();
        }
        "slope" => least_squares_line(study, rest)[0],
        "miss" => least_squares_line(study, rest)[1],
        "left" => least_squares_line(study, rest)[2],
        _ => {
            let value = value(study, text);
            return match decimals {
                Some(decimals) => fixed(value.value, decimals),
                None => bracketed(value.value, value.se),
            };
        }
    };
    fixed(
        plain,
        decimals.unwrap_or_else(|| panic!("{reference}: number of decimals is missing")),
    )
}

#[test]
fn numbers_of_validation_match_the_studies() {
    let template = std::fs::read_to_string(docs().join("validation.md.in")).unwrap();
    let (mut page, mut rest) = (String::new(), template.as_str());
    while let Some((before, after)) = rest.split_once('{') {
        let (reference, after) = after.split_once('}').unwrap();
        let (_, picture) = after.split_once("](validation/").unwrap();
        let (study, _) = picture.split_once(".svg").unwrap();
        page += before;
        page += &quoted(study, &reference.replace('\n', " "));
        rest = after;
    }
    keep("validation.md", &(page + rest));
}

/// A page whose table rows are replaced one by one.
struct Page {
    name: &'static str,
    text: String,
}

impl Page {
    fn open(name: &'static str) -> Self {
        let text = std::fs::read_to_string(docs().join(name)).unwrap();
        Self { name, text }
    }

    /// Replaces the cells of the first line after `heading` that begins with `head`.
    fn row(&mut self, heading: &str, head: &str, cells: &[String]) {
        let missing = || panic!("{}: no row {head} after {heading}", self.name);
        let from = self.text.find(heading).unwrap_or_else(missing);
        let start = from
            + self.text[from..]
                .find(&format!("\n{head}"))
                .unwrap_or_else(missing)
            + 1;
        let end = start + self.text[start..].find('\n').unwrap();
        let line = format!("{head} {} |", cells.join(" | "));
        self.text.replace_range(start..end, &line);
    }

    fn keep(self) {
        keep(self.name, &self.text);
    }
}

/// Two decimals, or two significant digits below 1.
fn two_digits(x: f64) -> String {
    let decimals = if x < 1.0 {
        1.0 - x.log10().floor()
    } else {
        2.0
    };
    format!("{x:.*}", decimals as usize)
}

#[test]
fn tables_of_the_compression_match_its_data() {
    let rows = rows("docs/components.csv");
    let mut page = Page::open("performance.md");
    for count in 1..=8 {
        let find = |basis: &str, precision: &str| {
            let key = ["transmittance", basis, precision, &count.to_string()];
            rows.iter()
                .find(|row| key.iter().zip(row.iter()).all(|(a, b)| *a == b))
        };
        let cell = |(basis, precision)| match find(basis, precision) {
            Some(row) => {
                let kilobytes = number(&row[4]) / 1000.0;
                format!("{kilobytes:.0} kB, {}", two_digits(number(&row[9])))
            }
            None => "above 2.3".to_owned(),
        };
        let variants = [
            ("linear", "f32"),
            ("log", "f32"),
            ("log", "f16"),
            ("log", "quantised_16"),
            ("log", "quantised"),
        ];
        page.row(
            "| l' | linear, f32",
            &format!("| {count} |"),
            &variants.map(cell),
        );
        if count <= 4 {
            let row = find("linear", "f32").unwrap();
            let [rmse, rmse_max, delta_e, delta_e_max] = [6, 7, 8, 9].map(|i| number(&row[i]));
            let cells = [
                fixed(rmse, 5),
                fixed(rmse_max, 5),
                fixed(delta_e, 4),
                fixed(delta_e_max, 4),
            ];
            page.row("| l' | | RMSE mean", &format!("| {count} | here |"), &cells);
        }
    }
    page.keep();
}

#[test]
fn the_table_of_the_goniophotometer_matches_its_data() {
    let rows = rows("docs/goniometer.csv");
    let mut page = Page::open("performance.md");
    for nm in ["600", "1300", "1800"] {
        let light = format!("| {nm} nm, 60 degrees |");
        for (engine, walks, shown, light_cell) in [
            ("spectral", "200000", "200,000", light.as_str()),
            ("tabulated", "40000", "40,000", "| |"),
        ] {
            let key = [nm, "60", engine, walks];
            let matches = |row: &&csv::StringRecord| row.iter().zip(key).all(|(a, b)| a == b);
            let row = rows.iter().find(matches).unwrap();
            let [cpu_s, rms, largest] = [4, 5, 6].map(|i| number(&row[i]));
            let to_one_percent = cpu_s * (100.0 * rms).powi(2);
            let decimals = usize::from(to_one_percent < 10.0);
            let cells = [
                shown.to_owned(),
                two_digits(cpu_s),
                format!("{:.1} %", 100.0 * rms),
                format!("{:.1} %", 100.0 * largest),
                format!("{to_one_percent:.decimals$}"),
            ];
            // the row of the first engine follows the heading, the second follows the first
            let from = if engine == "spectral" {
                "| light | engine"
            } else {
                &light
            };
            page.row(from, &format!("{light_cell} `{engine}` |"), &cells);
        }
    }
    page.keep();
}

/// Writes a table row: a column of a model's curve at the wavelengths of the table.
fn curve_row(
    page: &mut Page,
    heading: &str,
    head: &str,
    curve: &[csv::StringRecord],
    column: usize,
) {
    let shown = ["400", "600", "800", "900", "1040", "1240", "1400"];
    let cells = shown.map(|nm| {
        let matches = |row: &&csv::StringRecord| number(&row[0]) == number(nm);
        fixed(number(&curve.iter().find(matches).unwrap()[column]), 4)
    });
    page.row(heading, &format!("| {head} |"), &cells);
}

#[test]
fn tables_beside_other_models_match_their_data() {
    let mut page = Page::open("peers.md");
    let [tartes, disort] = ["tartes", "disort"].map(|name| rows(&format!("docs/peers/{name}.csv")));
    let [clean, pores, ice, thin] = ["clean", "soot_in_pores", "soot_in_ice", "thin"]
        .map(|name| rows(&format!("examples/peers/data/{name}.csv")));
    let albedo = "| albedo of 1 m |";
    curve_row(
        &mut page,
        albedo,
        "clean: TARTES, its own g and B",
        &tartes,
        1,
    );
    curve_row(&mut page, albedo, "TARTES, our g and B", &tartes, 2);
    curve_row(&mut page, albedo, "SPLITSnow", &clean, 1);
    let sooty = "100 ng/g: TARTES, its own g and B";
    curve_row(&mut page, albedo, sooty, &tartes, 3);
    curve_row(
        &mut page,
        &format!("| {sooty}"),
        "TARTES, our g and B",
        &tartes,
        4,
    );
    curve_row(
        &mut page,
        albedo,
        "SPLITSnow, carbon in the pores",
        &pores,
        1,
    );
    curve_row(&mut page, albedo, "SPLITSnow, carbon in the ice", &ice, 1);
    for (i, quantity) in ["R", "T"].iter().enumerate() {
        let ours = format!("{quantity}: SPLITSnow");
        curve_row(&mut page, "## Discrete ordinates", &ours, &thin, 1 + 2 * i);
        let ours = format!("| {ours} |");
        curve_row(
            &mut page,
            &ours,
            "points, distance of grains",
            &disort,
            1 + 2 * i,
        );
        curve_row(
            &mut page,
            &ours,
            "points, effective free path",
            &disort,
            2 + 2 * i,
        );
    }
    // one grain event: the header values of kernel.csv and its columns at two wavelengths
    let text = include_str!("../examples/peers/data/kernel.csv");
    let header_value = |key: &str| {
        let line = text.lines().find(|line| line.contains(key)).unwrap();
        number(line.rsplit(' ').next().unwrap())
    };
    let names: Vec<_> = text
        .lines()
        .find(|line| !line.starts_with('#'))
        .unwrap()
        .split(',')
        .collect();
    let kernel = rows("examples/peers/data/kernel.csv");
    let kernel_value = |nm: &str, name: &str| {
        let column = names.iter().position(|other| *other == name).unwrap();
        number(&kernel.iter().find(|row| &row[0] == nm).unwrap()[column])
    };
    let [g, far] = ["400", "1040"].map(|nm| kernel_value(nm, "p1"));
    let (surface, path) = (
        header_value("specific_surface_area"),
        kernel_value("400", "mean_path_m"),
    );
    let distance = header_value("mean_free_distance");
    let enhancement = path * surface * header_value("ice_density") / 4.0;
    for (row, quoted) in [
        ("specific surface area", format!("{surface:.2} m2/kg")),
        (
            "mean distance between grains",
            format!("{:.3} mm", 1e3 * distance),
        ),
        (
            "asymmetry parameter",
            format!("{g:.3} at 400 nm, {far:.3} at 1040 nm"),
        ),
        (
            "the same with diffraction",
            format!("{:.3}, {:.3}", (1.0 + g) / 2.0, (1.0 + far) / 2.0),
        ),
        (
            "mean path in ice per event",
            format!("{:.3} mm", 1e3 * path),
        ),
        ("absorption enhancement B", format!("{enhancement:.2}")),
    ] {
        let line = format!("| {row} | {quoted} |");
        assert!(page.text.contains(&line), "docs/peers.md lacks {line}");
    }
    page.keep();
}

/// A value with its standard error in brackets, with an exponent if it is small.
fn bracketed_power(value: f64, se: f64) -> String {
    if value >= 1e-3 {
        return bracketed(value, se);
    }
    let exponent = value.log10().floor() as i32;
    let scale = 10_f64.powi(-exponent);
    format!("{}e{exponent}", bracketed(value * scale, se * scale))
}

#[test]
fn tables_of_profiles_match_their_data() {
    let mut page = Page::open("profiles.md");
    for (kind, heading, first, deepest, heads) in [
        (
            "par",
            "| depth, cm | 0 |",
            5,
            30.0,
            ["downwelling PAR, clean", "with soot"],
        ),
        (
            "broadband",
            "| absorbed sunlight",
            11,
            10.0,
            ["clean", "with soot"],
        ),
    ] {
        for (sample, head) in ["clean", "soot"].iter().zip(heads) {
            let rows = rows(&format!("examples/peers/data/profile_{sample}_{kind}.csv"));
            let [depth, value, error] = [4, first, first + 1];
            let shown = rows.iter().filter(|row| number(&row[depth]) <= deepest);
            let cells: Vec<String> = shown
                .map(|row| match (number(&row[value]), &row[depth]) {
                    // all light arrives at the surface, without an error
                    (_, "0") if kind == "par" => "1".to_owned(),
                    (found, _) => bracketed_power(found, number(&row[error])),
                })
                .collect();
            page.row(heading, &format!("| {head} |"), &cells);
        }
    }
    page.keep();
}

/// `examples/stability` writes the page and the file. The page states, for each case, the
/// largest difference in the file.
#[test]
fn tables_of_measurements_match_their_data() {
    let mut page = Page::open("measurements.md");
    let [directions, reflectance] =
        ["directions", "reflectance"].map(|name| rows(&format!("docs/judge/{name}.csv")));
    let without_zero = |value: f64| format!("{value:.3}").trim_start_matches('0').to_owned();
    let rms = |pairs: &mut dyn Iterator<Item = (f64, f64)>| {
        let [squares, count] = pairs.fold([0.0; 2], |[squares, count], (value, weight)| {
            [squares + weight * value * value, count + weight]
        });
        assert!(count > 0.0);
        (squares / count).sqrt()
    };
    let mut variants: Vec<&str> = reflectance.iter().map(|row| &row[0]).collect();
    variants.dedup();
    variants.sort_unstable();
    variants.dedup();
    for variant in variants {
        let score = |column: usize, nm: &[&str], deg: Option<&str>| {
            let chosen = directions.iter().filter(|row| {
                &row[0] == variant
                    && (nm.is_empty() || nm.contains(&&row[3]))
                    && deg.is_none_or(|deg| &row[4] == deg)
            });
            rms(&mut chosen.map(|row| (number(&row[column]), number(&row[5]))))
        };
        let whole = |nm: &[&str]| {
            let [rmse, noise] = [6, 7].map(|column| without_zero(score(column, nm, None)));
            format!("{rmse} ({noise})")
        };
        let angles = |nm: &str| {
            let each = ["0", "30", "60"].map(|deg| without_zero(score(6, &[nm], Some(deg))));
            each.join(", ")
        };
        let head = format!("| {variant} |");
        let cells = [
            whole(&["600"]),
            whole(&["1030"]),
            angles("600"),
            angles("1030"),
            whole(&[]),
        ];
        page.row("| variant | 600 nm |", &head, &cells);

        let snow = |data: &str| {
            let chosen = reflectance
                .iter()
                .filter(|row| &row[0] == variant && &row[1] == data);
            without_zero(rms(
                &mut chosen.map(|row| (number(&row[4]) - number(&row[3]), 1.0))
            ))
        };
        let fitted =
            |row: &&csv::StringRecord| &row[0] == variant && &row[1] == "snow, 34 cm, fitted";
        let condition = &reflectance.iter().find(fitted).unwrap()[2];
        let area = condition.rsplit(", ").next().unwrap();
        let cells = [
            snow("snow, 34 cm"),
            snow("snow, 2.5 cm"),
            area.trim_end_matches(" m2/kg").to_owned(),
            snow("snow, 34 cm, fitted"),
            snow("snow, 2.5 cm, fitted"),
        ];
        page.row("| variant | 34 cm, 26.1 m2/kg |", &head, &cells);
    }

    for options in ["varsa2025", "measured"] {
        let chosen = reflectance
            .iter()
            .filter(|row| &row[0] == options && &row[1] == "spheres, 82 um");
        let differences: Vec<f64> = chosen
            .map(|row| number(&row[4]) - number(&row[3]))
            .collect();
        let largest = differences.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        let rmse = rms(&mut differences.iter().map(|difference| (*difference, 1.0)));
        let cells = [rmse, largest].map(without_zero);
        page.row(
            "| options |",
            &format!("| {options}, smooth spheres |"),
            &cells,
        );
    }

    let options = [
        "varsa2025",
        "varsa2025, projected",
        "visible, projected",
        "measured",
    ];
    for (condition, given) in [
        ("R at 842 nm, 25 cm, 62.3 degrees", ".878"),
        ("R at 1038 nm, 25 cm, 62.3 degrees", ".692"),
        ("R at 1238 nm, 25 cm, 62.3 degrees", ".495"),
        ("T at 630 nm, 12 cm", ".02"),
        ("T at 550 nm, 2.5 cm, 100 kg/m3", "\"a quarter\""),
        ("T at 550 nm, 2.5 cm, 450-550 um", "above .10"),
        ("Delta-E of T, facetness 0.1 and 0.9, 15 cm", "3.4"),
    ] {
        let cells = options.map(|variant| {
            let is_it = |row: &&csv::StringRecord| &row[0] == variant && &row[2] == condition;
            let row = reflectance.iter().find(is_it).unwrap();
            let [value, se] = [4, 5].map(|column| number(&row[column]));
            bracketed(value, se)
        });
        let heading = "| | Varsa 2025 | varsa2025 |";
        page.row(heading, &format!("| {condition} | {given} |"), &cells);
    }
    page.keep();
}

#[test]
fn the_stability_map_matches_its_data() {
    let text = std::fs::read_to_string(docs().join("stability.md")).unwrap();
    let (_, map) = text.split_once("<!-- map -->\n| case |").unwrap();
    let mut lines = map.lines();
    let engines: Vec<_> = lines.next().unwrap().split('|').map(str::trim).collect();
    let rows = rows("docs/stability.csv");
    let mut compared = 0;
    for line in lines.skip(1).take_while(|line| line.starts_with('|')) {
        let cells: Vec<_> = line.split('|').map(str::trim).collect();
        for (engine, cell) in engines
            .iter()
            .zip(&cells[2..])
            .filter(|(e, _)| !e.is_empty())
        {
            let (verdict, largest) = cell.split_once(' ').unwrap_or((cell, ""));
            let of_case: Vec<_> = rows
                .iter()
                .filter(|row| [&row[0], &row[1]] == [cells[1], engine])
                .collect();
            let difference = |row: &&csv::StringRecord| {
                [11, 13]
                    .map(|i| number(&row[i]).abs())
                    .into_iter()
                    .fold(0.0, f64::max)
            };
            assert!(
                of_case.iter().all(|row| &row[2] == verdict) && !of_case.is_empty(),
                "{line}"
            );
            if !largest.is_empty() {
                let found = of_case.iter().map(difference).fold(0.0, f64::max);
                // the page has four decimals, the file six digits
                let rounding = (found - number(largest)).abs();
                assert!(rounding < 5.1e-5, "{line}: {engine}: {found}");
                compared += 1;
            }
        }
    }
    assert!(compared > 300, "{compared}");
}

/// Pages with marked numbers, relative to `docs`.
const MARKED: [&str; 6] = [
    "methods.md",
    "profiles.md",
    "performance.md",
    "stability.md",
    "mitsuba.md",
    "../README.md",
];

/// Values by name.
type NamedValues = BTreeMap<String, Vec<Value>>;

/// Values that pages quote from files that are committed for other reasons.
fn values_of_other_files() -> NamedValues {
    let mut known = NamedValues::new();
    let mut add = |name: &str, values: &[f64]| {
        let values = values.iter().map(|&value| Value {
            value,
            se: f64::NAN,
        });
        known.insert(name.to_owned(), values.collect());
    };

    let components = rows("docs/components.csv");
    let component = |key: [&str; 4], column: usize| {
        let matches = |row: &&csv::StringRecord| key.iter().zip(row.iter()).all(|(a, b)| *a == b);
        number(&components.iter().find(matches).unwrap()[column])
    };
    let [bytes, rmse, delta_e] = [4, 7, 9];
    let log_values = |precision, column| {
        let rows = components.iter().filter(|row| &row[0] == "transmittance");
        let rows = rows.filter(move |row| [&row[1], &row[2]] == ["log", precision]);
        rows.map(move |row| number(&row[column]))
    };
    let [eight, plain] = [("log", "quantised", "2"), ("linear", "f32", "3")];
    let kilobytes = |(basis, precision, count)| {
        component(["transmittance", basis, precision, count], bytes) / 1e3
    };
    add(
        "bytes of transmittance",
        &[kilobytes(eight), kilobytes(plain)],
    );
    let own = kilobytes(("linear", "f32", "2"));
    add("bytes of the thesis own file", &[own]);
    let reflectance =
        |basis, count, column| component(["reflectance", basis, "f32", count], column);
    let single = ["linear", "log"].map(|basis| reflectance(basis, "1", delta_e));
    add("reflectance of one component", &single);
    let linear = ["1", "2"].map(|count| reflectance("linear", count, rmse));
    add("RMSE of one component of reflectance", &linear[..1]);
    add("RMSE of two components of reflectance", &linear[1..]);
    let eight_bits = log_values("quantised", rmse).fold(0.0, f64::max);
    add("RMSE of 8 bits", &[eight_bits]);
    // the error of f16 that remains with any number of components
    let limit = |precision| log_values(precision, delta_e).fold(f64::INFINITY, f64::min);
    add("Delta-E of f16", &[limit("f16")]);
    add("Delta-E of 16 bits", &[limit("quantised_16")]);
    // mean and largest Delta-E in Varsa 2025, section 8.2
    let thesis = [[0.7612, 2.8638], [0.2720, 1.3955], [0.1074, 0.5203]];
    let ratios = thesis
        .iter()
        .zip(["1", "2", "3"])
        .flat_map(|(published, count)| {
            let ours =
                [8, 9].map(|column| component(["transmittance", "linear", "f32", count], column));
            [ours[0] / published[0], ours[1] / published[1]]
        });
    let ratios: Vec<f64> = ratios.collect();
    let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
    let most = ratios.iter().copied().fold(0.0, f64::max);
    add("Delta-E beside the thesis", &[least, most]);

    let goniometer = rows("docs/goniometer.csv");
    let sensor_value = |nm: &str, engine: &str, walks: &str, column: usize| {
        let key = [nm, "60", engine, walks];
        let matches = |row: &&csv::StringRecord| row.iter().zip(key).all(|(a, b)| a == b);
        number(&goniometer.iter().find(matches).unwrap()[column])
    };
    let scored =
        |column| ["600", "1300", "1800"].map(|nm| sensor_value(nm, "tabulated", "40000", column));
    add("goniometer, chi-square", &scored(8));
    add("goniometer, sensors", &[scored(9)[0]]);
    let [visible, _, infrared] = scored(7);
    add("goniometer, worst sensor at 600 nm", &[visible]);
    add("goniometer, worst sensor at 1800 nm", &[infrared]);
    // cost to reach a given error: seconds times the squared rms error
    let cost = |nm, engine, walks| {
        sensor_value(nm, engine, walks, 4) * sensor_value(nm, engine, walks, 5).powi(2)
    };
    let times = ["600", "1300", "1800"]
        .map(|nm| cost(nm, "spectral", "200000") / cost(nm, "tabulated", "40000"));
    add("goniometer, times less", &times);

    let chart = rows("docs/tradeoff.csv");
    // transmittance, worst of the samples
    let worst = |key: [&str; 5], column: usize| {
        let matches = |row: &&csv::StringRecord| {
            [&row[1], &row[2], &row[3], &row[4], &row[5]] == key
                && [&row[6], &row[7]] == ["visible", "transmittance"]
        };
        let values = chart.iter().filter(matches).map(|row| number(&row[column]));
        values.fold(f64::NAN, f64::max)
    };
    let [rmse, delta_e] = [14, 16];
    let floor = ["hybrid", "65536", "131072", "8", "measured"];
    add("chart, floor", &[worst(floor, rmse), worst(floor, delta_e)]);
    add("chart, truth", &[worst(floor, 17), worst(floor, 19)]);
    let baseline = ["reference", "100000", "131072", "8", "extrapolated"];
    add("chart, operating point", &[worst(baseline, rmse)]);
    let first = ["tabulated", "64", "131072", "8", "measured"];
    add("chart, first look", &[worst(first, rmse)]);
    let scaling = rows("docs/scaling.csv");
    let seconds = |varied: &str, value: &str, engine: &str| {
        let key = [varied, value, engine];
        let matches = |row: &&csv::StringRecord| row.iter().zip(key).all(|(a, b)| a == b);
        number(&scaling.iter().find(matches).unwrap()[6])
    };
    let cost_of_another = |varied| {
        let [one, many] = ["1", "16"].map(|n| seconds(varied, n, "hybrid"));
        (many / one - 1.0) / 15.0
    };
    add(
        "chart, one more",
        &[cost_of_another("thicknesses"), cost_of_another("angles")],
    );
    let thick = ["reference", "spectral", "tabulated"]
        .map(|engine| seconds("thickness_cm", "50", engine) / seconds("thickness_cm", "1", engine));
    add("chart, 50 cm", &thick);

    let kernel = rows("examples/mitsuba/kernel.csv");
    let middle = &kernel[kernel.len() / 2];
    add("free path of mitsuba", &[1e3 * number(&middle[4])]);
    add("asymmetry of mitsuba", &[number(&middle[6])]);
    let [points, ours] = ["docs/peers/disort.csv", "examples/peers/data/thin.csv"].map(rows);
    let at_400_nm = |rows: &[csv::StringRecord], column: usize| {
        number(&rows.iter().find(|row| &row[0] == "400").unwrap()[column])
    };
    let less = 100.0 * (1.0 - at_400_nm(&points, 4) / at_400_nm(&ours, 3));
    add("less through 2 cm by points", &[less]);
    let [ratio] = crate::quoted::numbers("docs/performance.md", "times less for spectral");
    add("times less for spectral", &[ratio]);

    let profiles = docs().join("peers/tartes_profile.csv");
    let mut profiles = csv::Reader::from_path(profiles).unwrap();
    let names = profiles.headers().unwrap().clone();
    let profiles: Vec<_> = profiles.records().map(Result::unwrap).collect();
    // ours and that of TARTES in clean snow
    let beside = |nm: &str, flux: &str, depth: &str| {
        let row = profiles.iter().find(|row| &row[0] == depth).unwrap();
        ["", ", TARTES"].map(|model| {
            let name = format!("profile_clean {nm} nm {flux}{model}");
            number(&row[names.iter().position(|other| other == name).unwrap()])
        })
    };
    let decay = ["700", "900"].map(|nm| {
        let [from, to] = ["5", "20"].map(|depth| beside(nm, "down", depth));
        (from[0] / to[0]).ln() / (from[1] / to[1]).ln()
    });
    add("decay beside TARTES", &decay);
    add("flux beside TARTES", &beside("440", "down", "1"));
    add("actinic flux beside TARTES", &beside("440", "actinic", "0"));
    add("albedo beside TARTES", &beside("440", "up", "0"));

    let resolution = page("docs/stability.md");
    let two_streams = "| hybrid | 100000 | 131072 | 2 |";
    let row = resolution
        .lines()
        .find(|line| line.starts_with(two_streams));
    let mean = row.unwrap().split('|').nth(6).unwrap().trim();
    add("two streams", &[number(mean).abs()]);

    let stability = rows("docs/stability.csv");
    for (name, thickness) in [
        ("black pores 2.4", "2.50000e0"),
        ("black pores 4.8", "5.00000e0"),
    ] {
        let matches = |row: &&csv::StringRecord| {
            [&row[0], &row[1]] == ["1e5 ng/g in the pores", "spectral"]
                && [&row[4], &row[5]] == [thickness, "4.00000e2"]
        };
        let row = stability.iter().find(matches).unwrap();
        let [value, se] = [6, 7].map(|column| number(&row[column]));
        known.insert(name.to_owned(), vec![Value { value, se }]);
    }
    known
}

/// The source text of all tests.
fn sources(dir: &Path) -> String {
    let mut text = String::new();
    for entry in std::fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            text += &sources(&path);
        } else if path.extension().is_some_and(|end| end == "rs") {
            text += &std::fs::read_to_string(&path).unwrap();
        }
    }
    text
}

/// Every marked number matches a file or is checked by a test. Every number of
/// `docs/quoted.csv` is quoted.
#[test]
fn marked_numbers_match_their_sources() {
    let mut known = values_of_other_files();
    for row in row::read(&docs().join("quoted.csv")).unwrap() {
        let se = row.standard_error;
        let value = Value {
            value: row.value,
            se,
        };
        known.entry(row.name).or_default().push(value);
    }
    let tests = sources(&docs().join("../tests"));
    let (mut unused, mut marked): (BTreeSet<_>, _) = (known.keys().cloned().collect(), 0);
    for name in MARKED {
        let mut text = page(&format!("docs/{name}"));
        for mark in marks(&text).into_iter().rev() {
            marked += 1;
            unused.remove(&mark.name);
            let Some(values) = known.get(&mark.name) else {
                // the name must occur in a test, in a call of `assert_says` or `numbers`; some
                // names are put together with `format!`
                let parts = [mark.name.as_str(), mark.name.split(' ').next().unwrap()];
                let parts = [parts[0], parts[1].trim_end_matches(',')];
                let found = tests.contains(&format!("\"{}\"", parts[0]))
                    || tests.contains(&format!("\"{}, {{", parts[1]));
                assert!(found, "{name}: no file and no test has {}", mark.name);
                continue;
            };
            // an error after +- belongs to the number before it
            let errors = mark.numbers.iter();
            let errors: Vec<bool> = errors
                .map(|range| text[..range.start].ends_with("+- "))
                .collect();
            let mut wanted = values.iter().rev();
            let mut next = wanted.next();
            for i in (0..mark.numbers.len()).rev() {
                let Some(value) = next else { break };
                let range = mark.numbers[i].clone();
                let error = errors[i];
                let source = if error { value.se } else { value.value };
                let written = like(&text[range.clone()], source, value.se);
                text.replace_range(range, &written);
                if !error {
                    next = wanted.next();
                }
            }
            assert!(
                next.is_none(),
                "{name}: too few numbers before {}",
                mark.name
            );
        }
        keep(name, &text);
    }
    assert!(unused.is_empty(), "no page quotes {unused:?}");
    assert!(marked > 120, "{marked}");
}

/// Numbers of the model that need no random numbers match the file.
#[test]
fn exact_numbers_match_the_file() {
    let file = row::read(&docs().join("quoted.csv")).unwrap();
    for expected in exact::exact() {
        let found = file.iter().find(|row| {
            [&row.name, &row.setting] == [&expected.name, &expected.setting]
                && (row.value - expected.value).abs() <= 1e-6 * expected.value.abs()
        });
        assert!(
            found.is_some(),
            "docs/quoted.csv lacks {expected:?}: run `just quoted`"
        );
    }
}
