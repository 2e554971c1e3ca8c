//! `measure --against`: measured spectra as they are read, and a simulation
//! beside them.
#![allow(clippy::unwrap_used)]
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use proptest::prelude::*;
use serde_json::Value;
use splitsnow::comparison::{
    Band, Comparison, Exclusion, MeasuredError, MeasuredSpectrum, Problem, RANGE_NM,
};
use splitsnow::measurement::{Measured, Quantity};

const R: Option<Quantity> = Some(Quantity::Reflectance);

fn parse(text: &str) -> Result<MeasuredSpectrum, MeasuredError> {
    MeasuredSpectrum::parse("snow.csv", text.as_bytes(), None, &Exclusion::FIELD)
}

/// Wavelength, value and whether it is excluded, of all that is matched.
fn matched(text: &str, wavelengths_nm: &[f64]) -> Vec<(f64, f64, bool)> {
    let all = parse(text).unwrap().at(wavelengths_nm).unwrap();
    all.iter().map(|m| (m.nm, m.value, m.excluded)).collect()
}

#[test]
fn files_as_programs_write_them_are_read() {
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
    let named = MeasuredSpectrum::parse("x", value.as_bytes(), R, &[]).unwrap();
    assert_eq!(named.quantity(), Quantity::Reflectance);
}

#[test]
fn no_value_is_made_up() {
    let text = "wavelength_nm,transmittance\n349,9\n400,0.1\n430,0.4\n461,0.7\n500,1\n2501,-3\n";
    assert_eq!(parse(text).unwrap().ignored(), 2);
    assert_eq!(parse(text).unwrap().rows(), 4);
    // Not beyond the rows, not in gaps of 31 and 39 nm.
    let asked = [
        350.0, 399.9, 400.0, 410.0, 430.0, 440.0, 461.0, 480.0, 500.0, 501.0,
    ];
    let found = matched(text, &asked);
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
fn noise_in_excluded_bands_does_not_reach_what_counts() {
    let text =
        "wavelength_nm,reflectance\n1730,0.1\n1740,0.2\n1750,1e308\n1760,-7\n2010,0.4\n2020,0.5\n";
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
    // The same file counted throughout is refused for its noise.
    let all = MeasuredSpectrum::parse("snow.csv", text.as_bytes(), None, &[]);
    let error = all.unwrap_err();
    assert_eq!(
        (error.line, error.problem),
        (Some(4), Problem::Value(1e308))
    );
}

#[test]
fn refusals_say_where_and_what_to_do() {
    let row = |row: &str| format!("# a\nwavelength_nm,value\n400,0.5\n{row}\n");
    let long = "x".repeat(1000);
    let cases = [
        ("", "snow.csv: the header is ``"),
        ("400,0.5\n", "snow.csv:1: the header is `400,0.5`, allowed"),
        (
            "wavelength_nm;reflectance\n",
            "snow.csv:1: the header is `wavelength_nm;refl",
        ),
        (
            "wavelength_nm,albedo\n",
            "snow.csv:1: the header is `wavelength_nm,albedo`",
        ),
        ("wavelength_nm,value,se\n", "snow.csv:1: the header"),
        (&long, "allowed `wavelength_nm,reflectance`"),
        (
            "wavelength_nm,transmittance\n",
            "snow.csv:1: the column is transmittance, asked for is refl",
        ),
        (
            "wavelength_nm,value\n",
            "snow.csv: none of its 0 rows lies within 350 to 2500 nm",
        ),
        (
            "wavelength_nm,value\n.4,.5\n.5,.5",
            "none of its 2 rows lies within 350 to 2500 nm\n  help: give wavelengths in nm",
        ),
        (&row("410"), "snow.csv:4: 1 columns where the header has 2"),
        (
            &row("410,0,5"),
            "snow.csv:4: 3 columns where the header has 2",
        ),
        (&row("410,"), "snow.csv:4: `` is not a finite number"),
        (
            &row("410,NaN"),
            "snow.csv:4: `NaN` is not a finite number\n  help: leave out",
        ),
        (&row("inf,1"), "snow.csv:4: `inf` is not a finite number"),
        (
            &row("400,1"),
            "snow.csv:4: wavelength 400 nm is not above the one before it",
        ),
        (
            &row("410,-0.051"),
            "snow.csv:4: -0.051 is out of range: allowed -0.05 to 1.2",
        ),
        (
            &row("410,50"),
            "snow.csv:4: 50 is out of range: allowed -0.05 to 1.2\n  help: give shares, not percents",
        ),
    ];
    for (text, message) in cases {
        let parsed = MeasuredSpectrum::parse("snow.csv", text.as_bytes(), R, &[]);
        let error = parsed.unwrap_err().to_string();
        assert!(
            error.contains(message) && error.contains("\n  help: "),
            "{error}"
        );
        assert!(error.len() < 400, "{error}");
    }
    let uncertain = "wavelength_nm,reflectance,uncertainty\n400,1,-1\n";
    assert_eq!(
        parse(uncertain).unwrap_err().problem,
        Problem::Uncertainty(-1.0)
    );
    let unnamed = parse("wavelength_nm,value\n400,1\n").unwrap_err();
    assert_eq!(unnamed.problem, Problem::Unnamed);
    let bytes = MeasuredSpectrum::parse("x", &[0xb5, 0x0a], None, &[]);
    assert_eq!(bytes.unwrap_err().problem, Problem::Encoding);
    let endless = MeasuredSpectrum::read(Path::new("/dev/zero"), None, &[]);
    assert!(!cfg!(unix) || endless.unwrap_err().problem == Problem::Length);
}

#[test]
fn two_wavelengths_that_count_are_needed() {
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
        if let Err(error) = MeasuredSpectrum::parse("x", &bytes, R, &[]) {
            prop_assert!(!error.to_string().is_empty());
        }
    }

    #[test]
    fn any_cells_are_read_or_refused(
        cells in prop::collection::vec("[-+0-9.eE,\"#infa \r\n]{0,40}", 0..20)
    ) {
        let text = format!("wavelength_nm,value\n{}", cells.join("\n"));
        if let Ok(spectrum) = MeasuredSpectrum::parse("x", text.as_bytes(), R, &Exclusion::FIELD) {
            prop_assert!(spectrum.rows() > 0);
            let _ = spectrum.at(&[350.0, 500.0, 1800.0, 2500.0]);
        }
    }

    /// A straight line is met between its rows, and a shift of the simulation is
    /// its RMSE and bias in every band.
    #[test]
    fn shifts_are_found(rows in rows(), shift in -0.5..0.5_f64) {
        let line = |nm: f64| 0.2 + 2e-4 * nm;
        let mut text = "wavelength_nm,reflectance\n".to_owned();
        let mut nm = RANGE_NM.0;
        for (step, _) in &rows {
            text += &format!("{nm},{}\n", line(nm));
            nm += step;
        }
        let wavelengths: Vec<f64> = (35..=250).map(|i| 10.0 * f64::from(i)).collect();
        if let Ok(matched) = parse(&text).unwrap().at(&wavelengths) {
            let simulated = wavelengths.iter().map(|&nm| Measured { value: line(nm) + shift, se: 0.0 });
            let comparison = Comparison::new(&matched, &simulated.collect::<Vec<_>>());
            let bands = Band::ALL.map(|band| comparison.band(band));
            let counted: usize = bands.iter().flatten().map(|figures| figures.points).sum();
            let all = comparison.overall();
            prop_assert_eq!(all.map(|figures| figures.points), Some(counted));
            for figures in bands.into_iter().flatten().chain(all) {
                prop_assert!((figures.rmse - shift.abs()).abs() < 1e-12);
                prop_assert!((figures.bias - shift).abs() < 1e-12);
            }
        }
    }

    /// Interpolated values lie between those of the rows, to the last bit.
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

struct Bench {
    dir: tempfile::TempDir,
}

impl Bench {
    /// The folder of a sample of the thesis at few wavelengths.
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
        let fixed = "measure basal.toml --engine doubling --rays 500 ";
        command.args((fixed.to_owned() + args).split_whitespace());
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
fn a_simulation_against_itself_and_shifted() {
    let bench = Bench::new();
    let own = bench.json("");
    let column = |name: &str| -> Vec<f64> { serde_json::from_value(own[name].clone()).unwrap() };
    let (nm, t) = (column("wavelength_nm"), column("transmittance"));
    for (file, shift) in [("same.csv", 0.0), ("shifted.csv", 0.04)] {
        let mut text = "wavelength_nm,transmittance\n".to_owned();
        for (nm, t) in nm.iter().zip(&t) {
            text += &format!("{nm},{:?}\n", t + shift);
        }
        std::fs::write(bench.path(file), text).unwrap();
    }

    let csv = bench.text("--against same.csv --plot same.svg");
    let lines: Vec<&str> = csv.lines().collect();
    for line in [
        "# engine: doubling",
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
    let svg = std::fs::read_to_string(bench.path("same.svg")).unwrap();
    for words in [
        "Simulated and measured transmittance: RMSE 0.0000",
        "1750-2000",
    ] {
        assert!(svg.contains(words));
    }

    let json = bench.json("--against shifted.csv --exclude none --plot shifted.png");
    let against = &json["against"];
    let close = |value: &Value, to: f64| (value.as_f64().unwrap() - to).abs() < 1e-12;
    assert!(close(&against["overall"]["rmse"], 0.04), "{against}");
    assert!(close(&against["overall"]["bias"], -0.04), "{against}");
    assert_eq!(against["overall"]["points"], 6);
    assert_eq!(against["bands"][3]["points"], 2);
    assert_eq!(against["bands"][1]["name"], "visible");
    assert_eq!(
        (&against["good"], &json["rays"]),
        (&false.into(), &500.into())
    );
    assert_eq!(against["simulated"], own["transmittance"]);
    assert_eq!(against["simulated_se"], own["transmittance_se"]);
    let png = std::fs::read(bench.path("shifted.png")).unwrap();
    assert!(png.starts_with(b"\x89PNG\r\n\x1a\n"));

    let json = bench.json("--against shifted.csv --exclude 350-450 --exclude 1500-1900");
    let bands = json["against"]["bands"].as_array().unwrap();
    let points: Vec<_> = bands
        .iter()
        .map(|band| band["points"].as_u64().unwrap())
        .collect();
    assert_eq!(points, [0, 2, 1, 0]);
    assert_eq!(bands[0]["rmse"], Value::Null);
}

#[test]
fn refusals_come_before_the_simulation() {
    let bench = Bench::new();
    std::fs::write(
        bench.path("far.csv"),
        "wavelength_nm,value\n2000,0\n2010,0\n",
    )
    .unwrap();
    for (args, message) in [
        (
            "--against none.csv",
            "error: none.csv: cannot be read: No such file",
        ),
        (
            "--against far.csv",
            "error: far.csv:1: the column `value` does not say of what",
        ),
        (
            "--against far.csv --quantity reflectance",
            "(390 to 1800 nm) can be compared",
        ),
        (
            "--against far.csv --exclude none --exclude 1-2",
            "--exclude none cannot stand",
        ),
        ("--against far.csv --exclude 2-1", "the shorter first"),
        (
            "--against far.csv --plot far.pdf",
            "must end with .svg or .png",
        ),
        ("--plot far.png", "--against"),
    ] {
        let output = bench.run(args);
        let errors = String::from_utf8(output.stderr).unwrap();
        assert!(
            !output.status.success() && errors.contains(message),
            "{errors}"
        );
        assert!(output.stdout.is_empty());
    }
}
