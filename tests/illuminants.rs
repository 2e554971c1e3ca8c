//! Illuminants from files: how they are read, refused, kept, and used again without
//! the file.
use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use assert_cmd::cargo::cargo_bin;
use splitsnow::colour::{
    Colorimeter, ColourDifference, ColourError, Illuminant, IlluminantError, Viewing, delta_e,
};
use splitsnow::config::{grid, scene};

const D65: &str = include_str!("../data/illuminant_d65.csv");
const IGLOO: &str = include_str!("../configs/scenes/igloo.toml");

/// Wavelengths, nm, and power of D65.
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

/// D65 with a row changed, or none.
fn d65_but(change: impl Fn(f64, f64) -> Option<String>) -> String {
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

/// Whatever the scale, the units and the order, to 1e-9 of Delta-E.
#[test]
fn the_numbers_of_d65_are_d65() {
    let nm = visible();
    let spectra: Vec<Vec<f64>> = (0..8)
        .map(|i| {
            nm.iter()
                .map(|w| 0.5 + 0.4 * (w / (9.0 + f64::from(i))).sin())
                .collect()
        })
        .collect();
    let named = Colorimeter::viewing(&nm, &viewing(Illuminant::D65))
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
    for text in [D65, &descending, &bare, &semicolons, &d65_but(|_, _| None)] {
        let (light, report) = Illuminant::parse("lamp.txt", text.as_bytes()).unwrap();
        assert!(!report.to_string().contains('\n'));
        assert!(
            report.to_string().contains("relative power in column 2"),
            "{report}"
        );
        let seen = Colorimeter::viewing(&nm, &viewing(light)).unwrap().unwrap();
        for spectrum in &spectra {
            let difference = delta_e(seen.lab(spectrum), named.lab(spectrum));
            assert!(difference < 1e-9, "{difference} with {}", &text[..40]);
        }
    }
}

/// The first line of what is said of a wrong file.
#[test]
fn wrong_tables_are_refused() {
    let at =
        |at: f64, cell: &'static str| d65_but(move |nm, _| (nm == at).then(|| cell.to_owned()));
    let wrong = |cell: &'static str| d65_but(move |_, _| Some(cell.to_owned()));
    let rows = |keep: fn(f64) -> bool| -> String {
        let text = d65_but(|_, _| None);
        let kept = |line: &&str| line.split(',').next().unwrap().parse().map_or(true, keep);
        text.lines()
            .filter(kept)
            .fold(String::new(), |text, line| text + line + "\n")
    };
    for (text, message) in [
        (
            at(500.0, "NaN"),
            "lamp.csv:42: no power at 500 nm: an illuminant needs",
        ),
        (at(780.0, ""), "lamp.csv:98: no power at 780 nm"),
        (at(450.0, "-3"), "lamp.csv:32: a power of -3 at 450 nm"),
        (
            wrong("0"),
            "lamp.csv: it has no power where the observer sees",
        ),
        (
            wrong("-1"),
            "lamp.csv:2: -1 at 300 nm is not a valid relative power: allowed 0 to inf",
        ),
        (
            rows(|nm| nm > 650.0),
            "lamp.csv: it has no power where the observer sees",
        ),
        (rows(|nm| nm == 500.0), "lamp.csv: fewer than two rows"),
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
    // where the observer sees nothing, a hole is no harm
    assert!(read(&at(370.0, "NaN")).is_ok() && read(&at(300.0, "-1")).is_ok());
}

/// A table must reach over the wavelengths of the spectra within 380-780 nm.
#[test]
fn a_table_covers_what_it_is_used_for() {
    let text = d65_but(|nm, _| (!(400.0..=700.0).contains(&nm)).then(String::new));
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
    // none of these is seen
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
fn tables_are_told_apart_by_content() {
    let (light, other) = (
        read(D65).unwrap(),
        read(&d65_but(|nm, p| {
            (nm == 500.0).then(|| (p + 1e-3).to_string())
        })),
    );
    let other = other.unwrap();
    assert_eq!(light.name(), other.name());
    assert_ne!(light, other);
    assert_ne!(light.to_string(), other.to_string());
    // neither a name nor what nobody sees make another light
    let (renamed, _) = Illuminant::parse("folder/b.txt", D65.as_bytes()).unwrap();
    assert_eq!(renamed, light);
    assert_eq!(renamed.name(), "b.txt");
    assert_eq!(
        read(&d65_but(|nm, _| (nm < 350.0).then(|| "9".into()))).unwrap(),
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
fn configs_name_files_beside_them() {
    let dir = tempfile::tempdir().unwrap();
    fs::create_dir(dir.path().join("lights")).unwrap();
    fs::write(dir.path().join("lights/lamp.csv"), D65).unwrap();
    fs::write(dir.path().join("same.csv"), D65).unwrap();
    let name = dir.path().join("g.toml").display().to_string();
    let quick = include_str!("../configs/quick.toml");
    let with = |lights: &str| {
        let text = format!("{quick}\n[compression]\nilluminants = [{lights}]\n");
        grid::parse(&name, &text)
    };
    let read = with("\"D50\", \"lights/lamp.csv\", \"A\"").unwrap();
    let lamp = self::read(D65).unwrap();
    assert_eq!(
        read.viewing.illuminants,
        [Illuminant::D50, lamp, Illuminant::A]
    );
    let [note] = &read.notes[..] else {
        panic!("{:?}", read.notes)
    };
    assert!(note.starts_with("read ") && note.contains("lights/lamp.csv: a table, 2 columns"));
    let twice = with("\"lights/lamp.csv\", \"same.csv\"")
        .unwrap_err()
        .to_string();
    assert!(
        twice.contains("illuminants[1]` = \"same.csv\" is a duplicate"),
        "{twice}"
    );

    // a scene keeps the table, and needs the file no more
    let path = dir.path().join("s.toml");
    let text = IGLOO.replace("\"D55\"", "\"lights/lamp.csv\", \"D50\"");
    fs::write(&path, text).unwrap();
    let file = scene::read(&path).unwrap();
    let kept = scene::parse("elsewhere/s.toml", &file.self_contained()).unwrap();
    assert_eq!(kept.scene, file.scene);
    assert_eq!(kept.scene.viewing.illuminants.len(), 2);
    assert!(kept.notes.is_empty() && file.notes.len() == 1);
    assert_eq!(kept.self_contained(), file.self_contained());
}

fn run(dir: &Path, args: &str) -> Output {
    let mut command = Command::new(cargo_bin!("splitsnow"));
    command.current_dir(dir).args(args.split_whitespace());
    command.output().unwrap()
}

/// Standard output and standard error of a command that must end well.
fn done(dir: &Path, args: &str) -> [String; 2] {
    let output = run(dir, args);
    let texts = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(output.status.success(), "{texts:?}");
    texts
}

/// More power in the blue than D65 has: under it errors of compression look unlike those under D65.
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
fn a_database_needs_its_illuminant_s_file_no_more() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let tiny = include_str!("cli/build.in/tiny.toml");
    let viewing = "[compression]\nmax_delta_e = 0.5\nilluminants = [\"lamp.csv\", \"A\"]\n";
    fs::write(dir.join("tiny.toml"), format!("{tiny}\n{viewing}")).unwrap();
    fs::write(dir.join("lamp.csv"), lamp()).unwrap();
    let [_, told] = done(dir, "build tiny.toml");
    assert_eq!(told.lines().count(), 1, "{told}");
    assert!(
        told.starts_with("read lamp.csv: a table, 2 columns by semicolons"),
        "{told}"
    );
    let compact = dir.join("out/tiny/snow.safetensors");
    let built = fs::read(&compact).unwrap();

    let asked = "compress out/tiny --max-delta-e 0.5 --illuminant lamp.csv --illuminant A";
    let [_, told] = done(dir, asked);
    assert!(told.starts_with("read lamp.csv: "), "{told}");
    assert!(fs::read(&compact).unwrap() == built);
    fs::remove_file(dir.join("lamp.csv")).unwrap();
    let [_, told] = done(dir, asked);
    assert!(
        told.starts_with("no file lamp.csv: the table lamp.csv (table "),
        "{told}"
    );
    assert!(fs::read(&compact).unwrap() == built);
    let [report, _] = done(dir, "verify out/tiny --samples 2 --rays 100 --points 0");
    assert!(
        report.contains("Delta-E: cie1976, the worst of lamp.csv (table "),
        "{report}"
    );
    assert!(report.ends_with("PASS\n"), "{report}");

    // the errors stated are those under this lamp and no other
    let start = br#"\"power\":["#;
    let at = built
        .windows(start.len())
        .position(|bytes| bytes == start)
        .unwrap();
    let mut other = built.clone();
    for power in other[at + start.len()..].chunks_exact_mut(4).take(20) {
        assert_eq!(power, b"5.0,");
        power[0] = b'9';
    }
    fs::write(&compact, other).unwrap();
    let verify = run(dir, "verify out/tiny --samples 0 --points 0");
    let report = String::from_utf8(verify.stdout).unwrap();
    assert!(report.contains("its error table states"), "{report}");
    fs::write(&compact, &built).unwrap();

    // a name that is neither
    let output = run(dir, "compress out/tiny --illuminant D60");
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success());
    assert!(
        error.contains("no illuminant is named `D60` and no such file can be read")
            && error.contains("give one of D55, D65, E, FL3.15, LED-B5, A, D50, or the path"),
        "{error}"
    );
    // once other lights took its place, the table is gone
    done(dir, "compress out/tiny");
    assert!(!run(dir, asked).status.success());
}

/// A tailored file keeps the table in its scene, by which it is verified.
#[test]
fn a_fitted_file_needs_its_illuminant_s_file_no_more() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let scene = "version = 1\n[scene]\nmax_delta_e = 1\nquantities = [\"transmittance\"]\n\
        illuminants = [\"lamp.csv\", \"D50\"]\nthickness_cm = { min = 5, max = 7 }\nincidence_angle_deg = 20\n\
        [[snow]]\nfacetness = 0.3\ngrain_size_um = 300\ndensity_kg_m3 = 300\n\
        [wavelengths]\nstart_nm = 400\nstop_nm = 700\nstep_nm = 20\n";
    fs::write(dir.join("s.toml"), scene).unwrap();
    fs::write(dir.join("lamp.csv"), lamp()).unwrap();
    let [_, told] = done(dir, "fit s.toml --points 16");
    assert!(
        told.starts_with("read lamp.csv: ") && told.lines().count() == 1,
        "{told}"
    );
    fs::remove_file(dir.join("lamp.csv")).unwrap();
    let [report, told] = done(dir, "verify out/s --points 16 --point-rays 131072");
    assert!(
        report.ends_with("PASS\n") && told.is_empty(),
        "{report}{told}"
    );
    // the scene in the file is one to fit to again
    let database = splitsnow::lookup::Database::open(dir.join("out/s/snow.safetensors")).unwrap();
    let kept = scene::parse("elsewhere/s.toml", &database.metadata()["scene"]).unwrap();
    let names: Vec<_> = kept
        .scene
        .viewing
        .illuminants
        .iter()
        .map(Illuminant::name)
        .collect();
    assert_eq!(names, ["lamp.csv", "D50"]);
}
