//! Illuminants from files: reading, errors, storage in databases, and use without the
//! original file.
use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use assert_cmd::cargo::cargo_bin;
use splitsnow::colour::{
    Colorimeter, ColourDifference, ColourError, Illuminant, IlluminantError, Viewing, delta_e,
};
use splitsnow::config::{grid, scene};

const D65: &str = include_str!("../crates/spectra/data/illuminant_d65.csv");
const IGLOO: &str = include_str!("../configs/scenes/igloo.toml");

/// The wavelengths, nm, and powers of D65.
fn d65() -> Vec<(f64, f64)> {
    let rows = D65
        .lines()
        .filter(|line| line.starts_with(char::is_numeric));
    rows.map(|row| {
        let (nm, power) = row.split_once(',').unwrap();
        (nm.parse().unwrap(), power.parse().unwrap())
    })
    .collect()
}

/// A table of D65 in which `change` replaces the power of some rows.
fn d65_with(change: impl Fn(f64, f64) -> Option<String>) -> String {
    let mut text = "wavelength_nm,power\n".to_owned();
    for (nm, power) in d65() {
        let cell = change(nm, power).unwrap_or(power.to_string());
        writeln!(text, "{nm},{cell}").unwrap();
    }
    text
}

fn read(text: &str) -> Result<Illuminant, IlluminantError> {
    Ok(Illuminant::parse("lamp.csv", text.as_bytes())?.0)
}

fn viewing(illuminant: Illuminant) -> Viewing {
    Viewing {
        illuminants: vec![illuminant],
        difference: ColourDifference::Cie1976,
    }
}

fn visible() -> Vec<f64> {
    (38..=78).map(|i| f64::from(i) * 10.0).collect()
}

/// Independent of scale, units and order of the rows, to a Delta-E of 1e-9.
#[test]
fn a_table_of_d65_gives_the_colours_of_d65() {
    let nm = visible();
    let spectra: Vec<Vec<f64>> = (0..8)
        .map(|i| {
            nm.iter()
                .map(|w| 0.5 + 0.4 * (w / (9.0 + f64::from(i))).sin())
                .collect()
        })
        .collect();
    let reference = Colorimeter::viewing(&nm, &viewing(Illuminant::D65))
        .unwrap()
        .unwrap();
    let mut descending = String::from("um\tpower [W/m2/nm]\n");
    let (mut bare, mut semicolons) = (String::new(), String::from("Wellenlaenge (nm);Leistung\n"));
    for (nm, power) in d65().into_iter().rev() {
        writeln!(descending, "{:.3}\t{:e}", nm / 1000.0, 3e-7 * power).unwrap();
    }
    for (nm, power) in d65() {
        writeln!(bare, "{nm} {power}").unwrap();
        writeln!(
            semicolons,
            "{};{}",
            nm,
            (1e4 * power).to_string().replace('.', ",")
        )
        .unwrap();
    }
    for text in [D65, &descending, &bare, &semicolons, &d65_with(|_, _| None)] {
        let (light, report) = Illuminant::parse("lamp.txt", text.as_bytes()).unwrap();
        assert!(!report.to_string().contains('\n'));
        assert!(
            report.to_string().contains("relative power in column 2"),
            "{report}"
        );
        let colorimeter = Colorimeter::viewing(&nm, &viewing(light)).unwrap().unwrap();
        for spectrum in &spectra {
            let difference = delta_e(colorimeter.lab(spectrum), reference.lab(spectrum));
            assert!(difference < 1e-9, "{difference} with {}", &text[..40]);
        }
    }
}

/// Checks the first line of each error message.
#[test]
fn invalid_tables_are_rejected() {
    let with_cell = |row_nm: f64, cell: &'static str| {
        d65_with(move |nm, _| (nm == row_nm).then(|| cell.to_owned()))
    };
    let with_all_cells = |cell: &'static str| d65_with(move |_, _| Some(cell.to_owned()));
    let with_rows = |keep: fn(f64) -> bool| -> String {
        let text = d65_with(|_, _| None);
        let keeps = |line: &&str| line.split(',').next().unwrap().parse().map_or(true, keep);
        text.lines()
            .filter(keeps)
            .fold(String::new(), |text, line| text + line + "\n")
    };
    for (text, message) in [
        (
            with_cell(500.0, "NaN"),
            "lamp.csv:42: no power at 500 nm: an illuminant needs",
        ),
        (with_cell(780.0, ""), "lamp.csv:98: no power at 780 nm"),
        (
            with_cell(450.0, "-3"),
            "lamp.csv:32: a power of -3 at 450 nm",
        ),
        (
            with_all_cells("0"),
            "lamp.csv: it has no power where the observer sees",
        ),
        (
            with_all_cells("-1"),
            "lamp.csv:2: -1 at 300 nm is not a valid relative power: allowed 0 to inf",
        ),
        (
            with_rows(|nm| nm > 650.0),
            "lamp.csv: it has no power where the observer sees",
        ),
        (with_rows(|nm| nm == 500.0), "lamp.csv: fewer than two rows"),
        (
            D65.replace("spd", "reflectance"),
            "lamp.csv:2: the column `reflectance` holds reflectance, but relative power is requested",
        ),
        (
            "nothing".into(),
            "lamp.csv: no row with a wavelength and a value",
        ),
    ] {
        let error = read(&text).unwrap_err().to_string();
        assert!(error.starts_with(message), "{error}");
        assert!(error.contains("\n  help: "), "{error}");
    }
    // gaps outside the sensitivity of the observer are allowed
    assert!(read(&with_cell(370.0, "NaN")).is_ok() && read(&with_cell(300.0, "-1")).is_ok());
}

/// A table must cover the wavelengths of the spectra within 380-780 nm.
#[test]
fn a_table_must_cover_the_spectra() {
    let text = d65_with(|nm, _| (!(400.0..=700.0).contains(&nm)).then(String::new));
    let light = read(
        &text
            .lines()
            .filter(|line| !line.ends_with(','))
            .fold(String::new(), |text, line| text + line + "\n"),
    );
    let light = light.unwrap();
    let nm: Vec<f64> = (40..=70).map(|i| f64::from(i) * 10.0).collect();
    assert!(
        Colorimeter::viewing(&nm, &viewing(light.clone()))
            .unwrap()
            .is_some()
    );
    // the observer sees none of these
    assert_eq!(light.covers(&[350.0, 375.0, 790.0, 2500.0]), Ok(()));
    for (nm, needed) in [
        (visible(), (380.0, 780.0)),
        (vec![395.0, 500.0, 600.0], (395.0, 600.0)),
    ] {
        let error = Colorimeter::viewing(&nm, &viewing(light.clone())).unwrap_err();
        let expected = IlluminantError::Short {
            name: "lamp.csv".into(),
            covered: (400.0, 700.0),
            needed,
        };
        assert_eq!(error, ColourError::Illuminant(expected));
    }
    assert!(
        read(D65)
            .unwrap()
            .covers(&[350.0, 380.0, 780.0, 2500.0])
            .is_ok()
    );
}

#[test]
fn tables_are_compared_by_visible_content() {
    let (light, other) = (
        read(D65).unwrap(),
        read(&d65_with(|nm, p| {
            (nm == 500.0).then(|| (p + 1e-3).to_string())
        })),
    );
    let other = other.unwrap();
    assert_eq!(light.name(), other.name());
    assert_ne!(light, other);
    assert_ne!(light.to_string(), other.to_string());
    // neither the name nor invisible wavelengths distinguish two illuminants
    let (renamed, _) = Illuminant::parse("folder/b.txt", D65.as_bytes()).unwrap();
    assert_eq!(renamed, light);
    assert_eq!(renamed.name(), "b.txt");
    assert_eq!(
        read(&d65_with(|nm, _| (nm < 350.0).then(|| "9".into()))).unwrap(),
        light
    );

    let viewing = viewing(light);
    let json = serde_json::to_string(&viewing).unwrap();
    assert!(json.starts_with(r#"{"illuminants":[{"name":"lamp.csv","wavelength_nm":[360.0,"#));
    assert_eq!(serde_json::from_str::<Viewing>(&json).unwrap(), viewing);
    for (from, to) in [
        ("360.0", "790.0"),
        ("46.6383", "-1"),
        ("46.6383", "1,1"),
        ("lamp.csv\"", ""),
    ] {
        let damaged = json.replacen(from, to, 1);
        assert!(serde_json::from_str::<Viewing>(&damaged).is_err(), "{to}");
    }
}

#[test]
fn configs_refer_to_files_next_to_them() {
    let dir = tempfile::tempdir().unwrap();
    fs::create_dir(dir.path().join("lights")).unwrap();
    fs::write(dir.path().join("lights/lamp.csv"), D65).unwrap();
    fs::write(dir.path().join("same.csv"), D65).unwrap();
    let name = dir.path().join("g.toml").display().to_string();
    let quick = include_str!("../configs/quick.toml");
    let parse_with = |lights: &str| {
        let text = format!("{quick}\n[compression]\nilluminants = [{lights}]\n");
        grid::parse(&name, &text)
    };
    let parsed = parse_with("\"D50\", \"lights/lamp.csv\", \"A\"").unwrap();
    let lamp = read(D65).unwrap();
    assert_eq!(
        parsed.viewing.illuminants,
        [Illuminant::D50, lamp, Illuminant::A]
    );
    let [note] = &parsed.notes[..] else {
        panic!("{:?}", parsed.notes)
    };
    assert!(note.starts_with("read ") && note.contains("lights/lamp.csv: a table, 2 columns"));
    let duplicate = parse_with("\"lights/lamp.csv\", \"same.csv\"")
        .unwrap_err()
        .to_string();
    assert!(
        duplicate.contains("illuminants[1]` = \"same.csv\" is a duplicate"),
        "{duplicate}"
    );

    // a scene contains the table and no longer needs the file
    let path = dir.path().join("s.toml");
    let text = IGLOO.replace("\"D55\"", "\"lights/lamp.csv\", \"D50\"");
    fs::write(&path, text).unwrap();
    let file = scene::read(&path).unwrap();
    let stored = scene::parse("elsewhere/s.toml", &file.self_contained()).unwrap();
    assert_eq!(stored.scene, file.scene);
    assert_eq!(stored.scene.viewing.illuminants.len(), 2);
    assert!(stored.notes.is_empty() && file.notes.len() == 1);
    assert_eq!(stored.self_contained(), file.self_contained());
}

fn run(dir: &Path, args: &str) -> Output {
    let mut command = Command::new(cargo_bin!("splitsnow"));
    command.current_dir(dir).args(args.split_whitespace());
    command.output().unwrap()
}

/// Standard output and standard error of a command that must succeed.
fn run_successfully(dir: &Path, args: &str) -> [String; 2] {
    let output = run(dir, args);
    let texts = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(output.status.success(), "{texts:?}");
    texts
}

/// A lamp with more blue than D65, so that compression errors differ from those under D65.
fn lamp() -> String {
    let mut text = "nm;power\n".to_owned();
    for nm in (380..=780).step_by(5) {
        writeln!(
            text,
            "{nm};{}",
            if nm < 500 { 5.0 } else { 1e-2 * f64::from(nm) }
        )
        .unwrap();
    }
    text
}

#[test]
fn a_database_does_not_need_the_file_of_its_illuminant() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let tiny = include_str!("cli/build.in/tiny.toml");
    let viewing = "[compression]\nmax_delta_e = 0.5\nilluminants = [\"lamp.csv\", \"A\"]\n";
    fs::write(dir.join("tiny.toml"), format!("{tiny}\n{viewing}")).unwrap();
    fs::write(dir.join("lamp.csv"), lamp()).unwrap();
    let [_, stderr] = run_successfully(dir, "build tiny.toml");
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
    assert!(
        stderr.starts_with("read lamp.csv: a table, 2 columns by semicolons"),
        "{stderr}"
    );
    let compact = dir.join("out/tiny/snow.safetensors");
    let built = fs::read(&compact).unwrap();

    let arguments = "compress out/tiny --max-delta-e 0.5 --illuminant lamp.csv --illuminant A";
    let [_, stderr] = run_successfully(dir, arguments);
    assert!(stderr.starts_with("read lamp.csv: "), "{stderr}");
    assert!(fs::read(&compact).unwrap() == built);
    fs::remove_file(dir.join("lamp.csv")).unwrap();
    let [_, stderr] = run_successfully(dir, arguments);
    assert!(
        stderr.starts_with("no file lamp.csv: the table lamp.csv (table "),
        "{stderr}"
    );
    assert!(fs::read(&compact).unwrap() == built);
    let [report, _] = run_successfully(dir, "verify out/tiny --samples 2 --rays 100 --points 0");
    assert!(
        report.contains("Delta-E: cie1976, the worst of lamp.csv (table "),
        "{report}"
    );
    assert!(report.ends_with("PASS\n"), "{report}");

    // the stated errors are those under this lamp only
    let start = br#"\"power\":["#;
    let offset = built
        .windows(start.len())
        .position(|bytes| bytes == start)
        .unwrap();
    let mut other = built.clone();
    for power in other[offset + start.len()..].chunks_exact_mut(4).take(20) {
        assert_eq!(power, b"5.0,");
        power[0] = b'9';
    }
    fs::write(&compact, other).unwrap();
    let verify = run(dir, "verify out/tiny --samples 0 --points 0");
    let report = String::from_utf8(verify.stdout).unwrap();
    assert!(report.contains("its error table states"), "{report}");
    fs::write(&compact, &built).unwrap();

    // neither a standard illuminant nor a file
    let output = run(dir, "compress out/tiny --illuminant D60");
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success());
    assert!(
        error.contains("no illuminant is named `D60` and no such file can be read")
            && error.contains("give one of D55, D65, E, FL3.15, LED-B5, A, D50, or the path"),
        "{error}"
    );
    // after compression under other illuminants, the table is gone
    run_successfully(dir, "compress out/tiny");
    assert!(!run(dir, arguments).status.success());
}

/// A fitted file stores the table in its scene, and `verify` uses it.
#[test]
fn a_fitted_file_does_not_need_the_file_of_its_illuminant() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let scene = "version = 1\n[scene]\nmax_delta_e = 1\nquantities = [\"transmittance\"]\n\
        illuminants = [\"lamp.csv\", \"D50\"]\nthickness_cm = { min = 5, max = 7 }\nincidence_angle_deg = 20\n\
        [[snow]]\nfacetness = 0.3\ngrain_size_um = 300\ndensity_kg_m3 = 300\n\
        [wavelengths]\nstart_nm = 400\nstop_nm = 700\nstep_nm = 20\n";
    fs::write(dir.join("s.toml"), scene).unwrap();
    fs::write(dir.join("lamp.csv"), lamp()).unwrap();
    let [_, stderr] = run_successfully(dir, "fit s.toml --points 16");
    assert!(
        stderr.starts_with("read lamp.csv: ") && stderr.lines().count() == 1,
        "{stderr}"
    );
    fs::remove_file(dir.join("lamp.csv")).unwrap();
    let [report, stderr] = run_successfully(dir, "verify out/s --points 16 --point-rays 131072");
    assert!(
        report.ends_with("PASS\n") && stderr.is_empty(),
        "{report}{stderr}"
    );
    // the scene stored in the file can be parsed again
    let database = splitsnow::lookup::Database::open(dir.join("out/s/snow.safetensors")).unwrap();
    let stored = scene::parse("elsewhere/s.toml", &database.metadata()["scene"]).unwrap();
    let names: Vec<_> = stored
        .scene
        .viewing
        .illuminants
        .iter()
        .map(Illuminant::name)
        .collect();
    assert_eq!(names, ["lamp.csv", "D50"]);
}
