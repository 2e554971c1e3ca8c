//! `simulate --against`: reading of measured spectra, and their comparison with a
//! simulation.
#![allow(clippy::unwrap_used)]
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use proptest::prelude::*;
use serde_json::Value;
use splitsnow::comparison::{
    Band, Comparison, Exclusion, Hints, MeasuredError, MeasuredSpectrum, RANGE_NM,
};
use splitsnow::measurement::{Measured, Quantity};
use splitsnow::spectrum::measured::{
    self, Column, MaskReason, Order, ReadProblem, Unit, ValueScale,
};

fn hints(quantity: Option<Quantity>) -> Hints {
    Hints {
        quantity,
        ..Hints::default()
    }
}

fn reflectance() -> Hints {
    hints(Some(Quantity::Reflectance))
}

fn parse(text: &str) -> Result<MeasuredSpectrum, MeasuredError> {
    MeasuredSpectrum::parse("snow.csv", text.as_bytes(), &hints(None), &Exclusion::FIELD)
}

/// The line and the problem of a file that is refused.
fn refusal(read: Result<MeasuredSpectrum, MeasuredError>) -> (Option<usize>, ReadProblem) {
    match read.unwrap_err() {
        MeasuredError::Spectrum(error) => (error.line, *error.problem),
        other => panic!("{other}"),
    }
}

/// Reads a file of tests/data/measured.
fn file(name: &str, hints: &Hints, exclusions: &[Exclusion]) -> MeasuredSpectrum {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data/measured")
        .join(name);
    MeasuredSpectrum::read(&path, hints, exclusions).unwrap_or_else(|error| panic!("{error}"))
}

/// The same spectrum in the formats of various programs, libraries and instruments.
#[test]
fn one_spectrum_is_read_from_many_formats() {
    let nm: Vec<f64> = (7..=50).map(|i| 50.0 * f64::from(i)).collect();
    let plain = file(
        "ecostress_medium_converted.csv",
        &hints(None),
        &Exclusion::FIELD,
    );
    let expected = plain.at(&nm).unwrap();
    // every 50 nm from 350 to 1700 nm, except for one in a gap of the converted table, and
    // from 2000 to 2500 nm
    assert!(expected.iter().filter(|m| !m.excluded).count() > 30);
    for name in [
        "v_bom_crlf.csv",
        "v_descending.csv",
        "v_duplicate.csv",
        "v_header_caps.csv",
        "v_nan.csv",
        "v_noheader.csv",
        "v_percent.csv",
        "v_semicolon_comma.csv",
        "v_tab.txt",
        "ecostress.txt",
        "snow.sig",
        "utf16_le.csv",
        "utf16_be.csv",
    ] {
        let read = file(name, &hints(None), &Exclusion::FIELD);
        assert_eq!(read.quantity(), Quantity::Reflectance, "{name}");
        let found = read.at(&nm).unwrap();
        for point in expected.iter().filter(|point| !point.excluded) {
            let same = found.iter().find(|other| other.nm == point.nm);
            let value = same.map_or(f64::NAN, |other| other.value);
            // percentages are divided by 100; instruments write them with three decimals
            assert!(
                (value - point.value).abs() < 1e-12,
                "{name} at {} nm: {value}",
                point.nm
            );
        }
        assert!(!read.report().to_string().contains('\n'));
    }
    let report = |name: &str, exclusions: &[Exclusion]| {
        file(name, &hints(None), exclusions).report().clone()
    };
    let nan = report("v_nan.csv", &[]);
    let lines: Vec<usize> = nan.masked.iter().map(|row| row.line).collect();
    assert_eq!(lines, (97..=104).collect::<Vec<_>>());
    assert!(
        nan.to_string().contains("8 without a value (lines 97-104)"),
        "{nan}"
    );
    assert!(report("v_nan.csv", &Exclusion::FIELD).masked.is_empty());
    assert_eq!(report("v_duplicate.csv", &[]).merged, 1);
    assert_eq!(report("v_descending.csv", &[]).order, Order::Descending);
    let sig = report("snow.sig", &[]);
    assert_eq!(
        (sig.column, sig.order, sig.scale),
        (4, Order::Mixed, Some(ValueScale::Percent))
    );
    // two detectors overlap at 1000, 1880 and 1900 nm
    assert_eq!((sig.columns, sig.merged), (4, 3), "{sig}");
    let library = report("ecostress.txt", &[]);
    assert_eq!((library.unit, library.order), (Unit::Um, Order::Descending));
}

/// Unedited files from the field.
#[test]
fn field_files_are_read_and_their_noise_is_reported() {
    let sed = file("psr_cut.sed", &hints(None), &Exclusion::FIELD);
    assert_eq!((sed.report().column, sed.rows()), (4, 13));
    assert_eq!(sed.at(&[350.0, 362.0]).unwrap()[0].value, 0.233_105);

    let many = file("multicolumn_cut.csv", &hints(None), &Exclusion::FIELD);
    assert_eq!(
        (many.report().name.as_str(), many.report().other_columns),
        ("13_7_S1", 2)
    );
    let report = many.report().to_string();
    assert!(
        report.contains("column 2 `13_7_S1` (the first, 2 more match"),
        "{report}"
    );
    for column in ["13_7_S2", "3", "s2"] {
        let hints = Hints {
            column: Some(Column(column.into())),
            ..Hints::default()
        };
        let second = file("multicolumn_cut.csv", &hints, &Exclusion::FIELD);
        assert_eq!(second.at(&[350.0, 360.0]).unwrap()[0].value, 0.360_307_349);
    }

    let quiet = file("excluded_nan.csv", &hints(None), &Exclusion::FIELD);
    assert!(quiet.report().masked.is_empty() && quiet.at(&[400.0, 430.0, 1800.0]).is_ok());
    assert_eq!(
        file("excluded_nan.csv", &hints(None), &[])
            .report()
            .masked
            .len(),
        3
    );

    let spike = file("greenland_spike.csv", &hints(None), &Exclusion::FIELD);
    let [masked] = spike.report().masked[..] else {
        panic!("{}", spike.report());
    };
    assert_eq!((masked.line, masked.why), (19, MaskReason::Impossible));
    assert_eq!(spike.at(&[2256.5, 2258.0, 2260.0]).unwrap().len(), 3);

    let hole = file("greenland_empty_cell.csv", &hints(None), &[]);
    let lines = |why| -> Vec<usize> {
        let rows = hole.report().masked.iter();
        rows.filter(|row| row.why == why)
            .map(|row| row.line)
            .collect()
    };
    assert_eq!(lines(MaskReason::Missing), [21]);
    assert_eq!(lines(MaskReason::Impossible), [3, 13, 16, 17, 19, 20]);

    let low_sun = file("hcrf_above_1.2.csv", &hints(None), &Exclusion::FIELD);
    assert_eq!(
        low_sun.at(&[350.0, 352.0]).unwrap()[0].value,
        1.247_717_183_7
    );
}

/// Header names decide between the scales 0-100 and 0-1. A column of wavenumbers beside one
/// of wavelengths is ignored.
#[test]
fn column_names_are_not_overinterpreted() {
    for (text, expected) in [
        (
            "wavelength_nm,Reflectance (0-100)\n1500,0.9\n1510,0.8\n",
            0.009,
        ),
        ("wavelength_nm,Reflectance (0-1)\n1500,0.9\n1510,0.8\n", 0.9),
        (
            "wavelength_nm,wavenumber_cm-1,reflectance\n500,20000,0.9\n510,19608,0.8\n",
            0.9,
        ),
        (
            "wavelength_nm,radiance_W_cm-2_sr-1_cm-1,reflectance\n500,1e-6,0.9\n510,1e-6,0.8\n",
            0.9,
        ),
    ] {
        let read = parse(text).unwrap_or_else(|error| panic!("{text}: {error}"));
        let nm = if text.contains("1500") { 1500.0 } else { 500.0 };
        let first = read.at(&[nm, nm + 10.0]).unwrap()[0];
        assert!((first.value - expected).abs() < 1e-12, "{text}: {first:?}");
    }
}

/// Very small wavelengths stay above 0.
#[test]
fn no_wavelength_is_rounded_to_zero() {
    let text = "wavelength_um,power\n0.7e-10,2\n0.351,2\n0.7,3\n";
    let light = measured::ReadOptions::new(Some(measured::Content::Power), (0.0, f64::MAX));
    let curve = measured::parse("lamp.csv", text.as_bytes(), &light).unwrap();
    let nm: Vec<f64> = curve.samples.iter().map(|sample| sample.nm).collect();
    assert_eq!(nm, [0.7e-10 * 1e3, 351.0, 700.0]);
}

/// Files that cannot be spectra are refused. Options override guesses of unit and scale.
#[test]
fn absurd_files_are_refused() {
    for (text, line, part) in [
        (
            "wavelength_nm,counts\n400,5000\n410,5100\n420,5200\n",
            Some(2),
            "5000 at 400 nm is not a valid reflectance: allowed -5 to 150 percent, and 3 of 3",
        ),
        (
            "400,0.5\n410,snow\n420,0.5\n",
            Some(2),
            "`snow` where a number is expected (the value)",
        ),
        (
            "wavelength_nm,reflectance\n400,0,5\n410,0,6\n",
            Some(2),
            "the row `400,0,5` has 3 cells; expected 2",
        ),
        ("400;0,5\n410;0.6\n", Some(2), "another decimal sign"),
        (
            "400,0.5\n-410,0.5\n",
            Some(2),
            "wavelength -410 is not above 0",
        ),
        (
            "wavenumber_cm-1,reflectance\n10000,0.5\n",
            Some(1),
            "wavenumbers",
        ),
        (&"400,0.5\n".repeat(5), None, "wavelength 400 nm has 5 rows"),
        (
            "wavelength_nm,reflectance\n.4,.5\n.5,.5",
            None,
            "taken as nm)",
        ),
        (
            "wavelength_nm,irradiance\n400,1.1\n410,1.2\n",
            Some(1),
            "holds relative power, but reflectance or transmittance is requested",
        ),
        (
            "wavelength_nm,absorbance\n400,1.1\n410,1.2\n",
            Some(1),
            "`absorbance` is neither reflectance nor transmittance",
        ),
        (
            "snow\nand ice\n",
            None,
            "no row with a wavelength and a value; the file begins with `snow`",
        ),
        ("", None, "no row"),
        (
            "\u{1}\u{2}",
            None,
            "not a text file: it contains the character U+0001",
        ),
    ] {
        let error = parse(text).unwrap_err().to_string();
        let place = line.map_or("snow.csv: ".into(), |line| format!("snow.csv:{line}: "));
        assert!(
            error.starts_with(&place) && error.contains(part),
            "{text:?}: {error}"
        );
        assert!(error.contains("\n  help: ") && error.len() < 400, "{error}");
    }
    let um = Hints {
        unit: Some(Unit::Um),
        scale: Some(ValueScale::Percent),
        ..Hints::default()
    };
    let text = "wavelength_nm,reflectance\n.4,.5\n.5,.5";
    let read = MeasuredSpectrum::parse("x", text.as_bytes(), &um, &[]).unwrap();
    let matched = read.at(&[400.0, 500.0]).unwrap();
    let values: Vec<f64> = matched.iter().map(|m| m.value).collect();
    assert_eq!(values, [0.005, 0.005]);
}

/// Wavelength, value and exclusion of all matched wavelengths.
fn matched(text: &str, wavelengths_nm: &[f64]) -> Vec<(f64, f64, bool)> {
    let points = parse(text).unwrap().at(wavelengths_nm).unwrap();
    points.iter().map(|m| (m.nm, m.value, m.excluded)).collect()
}

#[test]
fn variants_of_csv_are_read() {
    let texts = [
        "wavelength_nm,reflectance\n400,0.5\n410,0.7\n",
        "\u{feff}# made\r\n\r\n\"wavelength_nm\" , \"reflectance\"\r\n400, .5\r\n# why\r\n410, 7e-1",
        "wavelength_nm,reflectance,uncertainty\n400,0.5,0.01\n410,0.7,0.03\n",
    ];
    for text in texts {
        assert_eq!(
            matched(text, &[400.0, 405.0, 410.0]),
            [
                (400.0, 0.5, false),
                (405.0, 0.6, false),
                (410.0, 0.7, false)
            ]
        );
    }
    let uncertain = parse(texts[2]).unwrap().at(&[400.0, 405.0]).unwrap();
    assert_eq!(uncertain[1].uncertainty, Some(0.02));
    let value = texts[0].replace("reflectance", "value");
    let named = MeasuredSpectrum::parse("x", value.as_bytes(), &reflectance(), &[]).unwrap();
    assert_eq!(named.quantity(), Quantity::Reflectance);
}

#[test]
fn values_are_not_extrapolated() {
    let text = "wavelength_nm,transmittance\n349,9\n400,0.1\n430,0.4\n461,0.7\n500,1\n2501,-3\n";
    assert_eq!(parse(text).unwrap().ignored(), 2);
    assert_eq!(parse(text).unwrap().rows(), 4);
    // No values outside the rows or in the gaps of 31 and 39 nm.
    let wavelengths_nm = [
        350.0, 399.9, 400.0, 410.0, 430.0, 440.0, 461.0, 480.0, 500.0, 501.0,
    ];
    let found = matched(text, &wavelengths_nm);
    let expected = [
        (400.0, 0.1),
        (410.0, 0.2),
        (430.0, 0.4),
        (461.0, 0.7),
        (500.0, 1.0),
    ];
    assert_eq!(found.len(), expected.len());
    for ((nm, value, _), (expected_nm, expected)) in found.into_iter().zip(expected) {
        assert!(
            nm == expected_nm && (value - expected).abs() < 1e-15,
            "{nm}: {value}"
        );
    }
}

#[test]
fn noise_in_excluded_bands_does_not_affect_other_bands() {
    let text =
        "wavelength_nm,reflectance\n1730,0.1\n1740,0.2\n1750,1e29\n1760,-7\n2010,0.4\n2020,0.5\n";
    let found = matched(
        text,
        &[1735.0, 1745.0, 1750.0, 1755.0, 1760.0, 2005.0, 2015.0],
    );
    let nm: Vec<_> = found
        .iter()
        .map(|(nm, _, excluded)| (*nm, *excluded))
        .collect();
    let expected = [
        (1735.0, false),
        (1750.0, true),
        (1755.0, true),
        (1760.0, true),
        (2015.0, false),
    ];
    assert_eq!(nm, expected);
    assert!(found.iter().all(|(_, value, _)| value.is_finite()));
    // Without exclusions, the noise is masked.
    let unfiltered =
        MeasuredSpectrum::parse("snow.csv", text.as_bytes(), &hints(None), &[]).unwrap();
    let masked: Vec<usize> = unfiltered
        .report()
        .masked
        .iter()
        .map(|row| row.line)
        .collect();
    assert_eq!(masked, [4, 5]);
}

#[test]
fn other_quantities_and_endless_files_are_refused() {
    let text = "wavelength_nm,transmittance\n400,0.5\n";
    let read = MeasuredSpectrum::parse("x", text.as_bytes(), &reflectance(), &[]);
    let (line, problem) = refusal(read);
    assert!(line == Some(1) && matches!(problem, ReadProblem::OtherContent { .. }));
    let endless = MeasuredSpectrum::read(Path::new("/dev/zero"), &hints(None), &[]);
    assert!(!cfg!(unix) || refusal(endless).1 == ReadProblem::Length);
}

#[test]
fn at_least_two_comparable_wavelengths_are_required() {
    let text = "wavelength_nm,reflectance\n900,0.5\n910,0.5\n1800,0.1\n1810,0.1\n";
    let error = parse(text).unwrap().at(&[400.0, 905.0, 1805.0, 1900.0]);
    assert!(error.unwrap_err().to_string().starts_with(
        "snow.csv: only 1 wavelengths of the sample (400 to 1900 nm) can be compared with the \
         file (900 to 1810 nm), at least 2 are needed; excluded: 1750-2000, 2350-2500\n  help: "
    ));
    assert!(parse(text).unwrap().at(&[]).is_err());
}

fn rows() -> impl Strategy<Value = Vec<(f64, f64)>> {
    prop::collection::vec((0.1..40.0, -0.05..=1.2), 2..60)
}

proptest! {
    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        if let Err(error) = MeasuredSpectrum::parse("x", &bytes, &reflectance(), &[]) {
            prop_assert!(!error.to_string().is_empty());
        }
    }

    #[test]
    fn any_cells_are_read_or_refused(
        cells in prop::collection::vec("[-+0-9.eE,;\t\"#infa \r\n]{0,40}", 0..20)
    ) {
        let text = format!("wavelength_nm,value\n{}", cells.join("\n"));
        if let Ok(spectrum) = MeasuredSpectrum::parse("x", text.as_bytes(), &reflectance(), &Exclusion::FIELD) {
            prop_assert!(spectrum.rows() > 0);
            let _ = spectrum.at(&[350.0, 500.0, 1800.0, 2500.0]);
        }
    }

    /// Interpolation of a straight line is exact. A simulation that is shifted by a constant
    /// has this constant as RMSE and bias in every band.
    #[test]
    fn a_constant_shift_is_the_rmse_and_bias(rows in rows(), shift in -0.5..0.5_f64) {
        let line = |nm: f64| 0.2 + 2e-4 * nm;
        let mut text = "wavelength_nm,reflectance\n".to_owned();
        let mut nm = RANGE_NM.0;
        for (step, _) in &rows {
            text += &format!("{nm},{}\n", line(nm));
            nm += step;
        }
        let wavelengths: Vec<f64> = (35..=250).map(|i| 10.0 * f64::from(i)).collect();
        // proptest fails if it must reject too many cases
        let matched = parse(&text).unwrap().at(&wavelengths);
        let matched = matched.map_err(|error| TestCaseError::reject(error.to_string()))?;
        let simulated = wavelengths.iter().map(|&nm| Measured { value: line(nm) + shift, se: 0.0 });
        let comparison = Comparison::new(&matched, &simulated.collect::<Vec<_>>());
        let bands = Band::ALL.map(|band| comparison.band(band));
        let counted: usize = bands.iter().flatten().map(|figures| figures.points).sum();
        let overall = comparison.overall();
        prop_assert_eq!(overall.map(|figures| figures.points), Some(counted));
        for figures in bands.into_iter().flatten().chain(overall) {
            prop_assert!((figures.rmse - shift.abs()).abs() < 1e-12);
            prop_assert!((figures.bias - shift).abs() < 1e-12);
        }
    }

    /// Interpolated values never leave the range of the rows, not even by rounding.
    #[test]
    fn interpolation_does_not_overshoot(rows in rows()) {
        let mut nm = RANGE_NM.0;
        let mut text = "wavelength_nm,reflectance\n".to_owned();
        for (step, value) in &rows {
            text += &format!("{nm},{value}\n");
            nm += step;
        }
        let values = || rows.iter().map(|(_, value)| *value);
        let (low, high) = (values().fold(2.0, f64::min), values().fold(-2.0, f64::max));
        let wavelengths: Vec<f64> = (350..2500).map(f64::from).collect();
        for point in parse(&text).unwrap().at(&wavelengths).unwrap_or_default() {
            prop_assert!(low <= point.value && point.value <= high);
        }
    }
}

struct Folder {
    dir: tempfile::TempDir,
}

impl Folder {
    /// A folder with a sample of the thesis at a few wavelengths.
    fn new() -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/samples/basal.toml");
        let text = std::fs::read_to_string(path).unwrap();
        let (head, rest) = text.split_once("start_nm").unwrap();
        let (_, tail) = rest.split_once("[[layer]]").unwrap();
        let text = format!("{head}values_nm = [390, 500, 700, 900, 1600, 1800]\n[[layer]]{tail}");
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("basal.toml"), text).unwrap();
        Self { dir }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn run(&self, args: &str) -> Output {
        let mut command = Command::new(PathBuf::from(env!("CARGO_BIN_EXE_splitsnow")));
        let options = "measure basal.toml --engine hybrid --rays 500 ";
        command.args((options.to_owned() + args).split_whitespace());
        command.current_dir(self.dir.path()).output().unwrap()
    }

    fn text(&self, args: &str) -> String {
        let output = self.run(args);
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        String::from_utf8(output.stdout).unwrap()
    }

    fn json(&self, args: &str) -> Value {
        serde_json::from_str(&self.text(&format!("{args} --json"))).unwrap()
    }
}

#[test]
fn a_simulation_is_compared_with_itself_and_with_a_shifted_copy() {
    let folder = Folder::new();
    let own = folder.json("");
    let column = |name: &str| -> Vec<f64> { serde_json::from_value(own[name].clone()).unwrap() };
    let (nm, t) = (column("wavelength_nm"), column("transmittance"));
    for (file, shift) in [("same.csv", 0.0), ("shifted.csv", 0.04)] {
        let mut text = "wavelength_nm,transmittance\n".to_owned();
        for (nm, t) in nm.iter().zip(&t) {
            text += &format!("{nm},{:?}\n", t + shift);
        }
        std::fs::write(folder.path(file), text).unwrap();
    }

    let csv = folder.text("--against same.csv --plot same.svg");
    let lines: Vec<&str> = csv.lines().collect();
    for line in [
        "# engine: hybrid",
        "# against: same.csv, transmittance, 6 rows used, 0 outside 350-2500 nm",
        "# not_compared: 0 wavelengths of the sample without rows near them",
        "# excluded_nm: 1750-2000, 2350-2500",
        "# good: yes (Varsa 2025: an RMSE below 0.03)",
        "wavelength_nm,simulated,simulated_se,measured,residual,excluded",
    ] {
        assert!(lines.contains(&line), "{csv}");
    }
    for (start, end) in [
        ("# overall: rmse 0.00000, bias 0.00000,", "points 5"),
        ("# uv_a 350-400 nm: rmse 0.00000,", "points 1"),
        ("# visible 400-780 nm: rmse 0.00000,", "points 2"),
        ("# ir_a 780-1400 nm: rmse 0.00000,", "points 1"),
        ("# ir_b 1400-2500 nm: rmse 0.00000,", "points 1"),
    ] {
        assert!(
            lines
                .iter()
                .any(|l| l.starts_with(start) && l.ends_with(end)),
            "{csv}"
        );
    }
    let rows: Vec<&&str> = lines
        .iter()
        .skip_while(|line| !line.starts_with("390"))
        .collect();
    assert_eq!(rows.len(), 6);
    assert!(
        rows[..5].iter().all(|row| row.ends_with(",0.0,false")),
        "{csv}"
    );
    assert!(
        rows[5].starts_with("1800,") && rows[5].ends_with(",0.0,true"),
        "{csv}"
    );
    let svg = std::fs::read_to_string(folder.path("same.svg")).unwrap();
    for words in [
        "Simulated and measured transmittance: RMSE 0.0000",
        "1750-2000",
    ] {
        assert!(svg.contains(words));
    }

    let json = folder.json("--against shifted.csv --exclude none --plot shifted.png");
    let against = &json["against"];
    let close = |value: &Value, expected: f64| (value.as_f64().unwrap() - expected).abs() < 1e-12;
    assert!(close(&against["overall"]["rmse"], 0.04), "{against}");
    assert!(close(&against["overall"]["bias"], -0.04), "{against}");
    assert_eq!(against["overall"]["points"], 6);
    let read = &against["read"];
    assert_eq!((&read["column"], &read["unit"]), (&2.into(), &"nm".into()));
    let stderr = folder
        .run("--against shifted.csv --column 2 --exclude none")
        .stderr;
    let stderr = String::from_utf8(stderr).unwrap();
    assert!(stderr.starts_with("read shifted.csv: a table, 2 columns by commas; transmittance"));
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
    assert_eq!(against["bands"][3]["points"], 2);
    assert_eq!(against["bands"][1]["name"], "visible");
    assert_eq!(
        (&against["good"], &json["rays"]),
        (&false.into(), &500.into())
    );
    assert_eq!(against["simulated"], own["transmittance"]);
    assert_eq!(against["simulated_se"], own["transmittance_se"]);
    let png = std::fs::read(folder.path("shifted.png")).unwrap();
    assert!(png.starts_with(b"\x89PNG\r\n\x1a\n"));

    let json = folder.json("--against shifted.csv --exclude 350-450 --exclude 1500-1900");
    let bands = json["against"]["bands"].as_array().unwrap();
    let points: Vec<_> = bands
        .iter()
        .map(|band| band["points"].as_u64().unwrap())
        .collect();
    assert_eq!(points, [0, 2, 1, 0]);
    assert_eq!(bands[0]["rmse"], Value::Null);
}

#[test]
fn errors_come_before_the_simulation() {
    let folder = Folder::new();
    std::fs::write(
        folder.path("far.csv"),
        "wavelength_nm,value\n2000,0\n2010,0\n",
    )
    .unwrap();
    for (args, message) in [
        (
            "--against none.csv",
            "error: none.csv: cannot be read: No such file",
        ),
        ("--against far.csv", "(390 to 1800 nm) can be compared"),
        (
            "--against far.csv --quantity reflectance",
            "(390 to 1800 nm) can be compared",
        ),
        (
            "--against far.csv --exclude none --exclude 1-2",
            "--exclude none cannot be combined",
        ),
        ("--against far.csv --exclude 2-1", "the shorter first"),
        (
            "--against far.csv --plot far.pdf",
            "must end with .svg or .png",
        ),
        ("--plot far.png", "--against"),
    ] {
        let output = folder.run(args);
        let errors = String::from_utf8(output.stderr).unwrap();
        assert!(
            !output.status.success() && errors.contains(message),
            "{errors}"
        );
        assert!(output.stdout.is_empty());
    }
}

/// A library spectrum that goes on into the thermal infrared: it is used up to 2500 nm, or, if the
/// sample goes beyond, up to 5000 nm. In both cases the rows that are not used are counted.
#[test]
fn wavelengths_beyond_2500_nm_are_used_if_the_sample_has_them() {
    let folder = Folder::new();
    let sample = std::fs::read_to_string(folder.path("basal.toml")).unwrap();
    let beyond = sample.replace("1600, 1800]", "1600, 1800, 2700, 3600, 4300, 4800]");
    assert_ne!(beyond, sample);
    std::fs::write(folder.path("basal.toml"), beyond).unwrap();
    let own = folder.json("");
    let column = |name: &str| -> Vec<f64> { serde_json::from_value(own[name].clone()).unwrap() };
    let (nm, r) = (column("wavelength_nm"), column("reflectance"));
    let mut text = "wavelength_um,reflectance\n".to_owned();
    for (nm, r) in nm.iter().zip(&r).rev() {
        text += &format!("{},{:?}\n", nm / 1e3, r + 0.01);
    }
    std::fs::write(folder.path("library.csv"), text + "5.1,0.03\n14.0,0.02\n").unwrap();

    let csv = folder.text("--against library.csv");
    for line in [
        "# against: library.csv, reflectance, 10 rows used, 2 outside 350-5000 nm",
        "# excluded_nm: 1750-2000, 2350-3350, 4150-4500",
    ] {
        assert!(csv.lines().any(|other| other == line), "{csv}");
    }
    let figures = |start: &str| {
        let line = csv.lines().find(|line| line.starts_with(start));
        line.unwrap_or_else(|| panic!("{start}: {csv}")).to_owned()
    };
    let beyond = figures("# beyond 2500 nm: rmse 0.01000, bias -0.01000");
    assert!(beyond.ends_with("points 2"), "{beyond}");
    assert!(figures("# ir_b 1400-2500 nm").ends_with("points 1"));
    assert!(figures("# overall").ends_with("points 7"));
    let json = folder.json("--against library.csv --exclude none");
    assert_eq!(json["against"]["beyond_bands"]["points"], 4);

    std::fs::write(folder.path("basal.toml"), &sample).unwrap();
    let output = folder.run("--against library.csv");
    let (csv, errors) = [output.stdout, output.stderr]
        .map(|bytes| String::from_utf8(bytes).unwrap())
        .into();
    assert!(
        csv.contains("6 rows used, 6 outside 350-2500 nm\n"),
        "{csv}"
    );
    assert!(csv.contains("# excluded_nm: 1750-2000, 2350-2500\n") && !csv.contains("# beyond"));
    for part in [
        "6 outside the range (from 2700 to 14000 nm)",
        "used up to 2500 nm: give the sample [wavelengths] beyond it to use more",
    ] {
        assert!(errors.contains(part), "{errors}");
    }
    let far = "wavelength_nm,reflectance\n3000,0.02\n3020,0.02\n";
    std::fs::write(folder.path("far.csv"), far).unwrap();
    let errors = String::from_utf8(folder.run("--against far.csv").stderr).unwrap();
    for part in [
        "within 350 to 2500 nm",
        "they go from 3000 to 3020 nm",
        "help: give the sample [wavelengths] beyond it, or give the unit",
    ] {
        assert!(errors.contains(part), "{errors}");
    }
}

/// An option that belongs to another measurement is refused, not ignored.
#[test]
fn options_of_other_measurements_are_refused() {
    let folder = Folder::new();
    let measurements = [
        ("--against x.csv", "against"),
        ("--goniometer", "goniometer"),
        ("--radial-profile 3", "radial"),
        ("--view-deg 30", "view"),
        ("--depths-cm 0,1", "depths"),
        ("--bands sentinel2a:B3", "bands"),
    ];
    for (option, owners) in [
        ("--plot x.svg", &["against"][..]),
        ("--column 2", &["against"]),
        ("--unit nm", &["against"]),
        ("--scale percent", &["against"]),
        ("--quantity reflectance", &["against"]),
        ("--exclude none", &["against"]),
        ("--sensors 20", &["goniometer"]),
        ("--principal-plane", &["goniometer"]),
        ("--relative-azimuth-deg 0", &["view"]),
        ("--sun equal_energy", &["bands", "depths"]),
    ] {
        assert!(!folder.run(option).status.success(), "{option}");
        for (measurement, name) in measurements {
            if owners.contains(&name) {
                continue;
            }
            let output = folder.run(&format!("{measurement} {option}"));
            let errors = String::from_utf8(output.stderr).unwrap();
            assert!(
                output.status.code() == Some(2) && output.stdout.is_empty(),
                "{measurement} {option}: {errors}"
            );
        }
    }
    let output = folder.run("--depths-cm 0,1 --bands par --sun equal_energy");
    assert!(output.status.success());
}

#[test]
fn pictures_are_checked_and_short_ranges_are_named_before_the_simulation() {
    let folder = Folder::new();
    let file = "wavelength_nm,reflectance\n400,0.9\n410,0.9\n";
    std::fs::write(folder.path("some.csv"), file).unwrap();
    let output = folder.run("--against some.csv --plot none/x.svg");
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(
        errors.starts_with("error: cannot write none/x.svg") && output.stdout.is_empty(),
        "{errors}"
    );
    let errors = |args: &str| String::from_utf8(folder.run(args).stderr).unwrap();
    let short = errors("--depths-cm 0:1:0.3");
    let expected = "warning: --depths-cm 0:1:0.3: 1 is not a whole number of steps from 0; the last depth is 0.9";
    assert!(short.contains(expected), "{short}");
    let whole = errors("--depths-cm 0:0.9:0.3");
    assert!(!whole.contains("warning"), "{whole}");
}
