//! `simulate`: the format of its output, and that it depends only on sample, engine, number
//! of rays and seed.
#![allow(clippy::unwrap_used)]
use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};

/// A thin slab at a few wavelengths. Its unusual density gives one warning.
const SAMPLE: &str = "\
version = 1
[illumination]
incidence_angle_deg = 30
[wavelengths]
values_nm = [450, 600.5, 1000, 1300]
[[layer]]
thickness_cm = 1
density_kg_m3 = 500
[[layer.grain]]
size_um = { min = 300, max = 500 }
facetness = { min = 0.2, max = 0.4, mean = 0.3, sd = 0.072 }
";
const HEADER: &str =
    "wavelength_nm,reflectance,reflectance_se,transmittance,transmittance_se,absorptance";

struct Bench {
    dir: tempfile::TempDir,
}

impl Bench {
    fn new(sample: &str) -> Self {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("sample.toml"), sample).unwrap();
        Self { dir }
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(PathBuf::from(env!("CARGO_BIN_EXE_splitsnow")));
        let command_line = [&["measure", "sample.toml"], args].concat();
        command.args(command_line).current_dir(self.dir.path());
        command
    }

    fn start(&self, args: &[&str]) -> Child {
        let mut command = self.command(args);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().unwrap()
    }

    fn output(&self, args: &[&str]) -> Output {
        self.command(args).output().unwrap()
    }

    fn text(&self, args: &[&str]) -> String {
        let output = self.output(args);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{errors}");
        String::from_utf8(output.stdout).unwrap()
    }
}

/// The rows below the header.
fn rows(text: &str) -> Vec<[f64; 6]> {
    let mut lines = text.lines().skip_while(|line| line.starts_with('#'));
    assert_eq!(lines.next(), Some(HEADER));
    let numbers =
        |line: &str| -> Vec<f64> { line.split(',').map(|n| n.parse().unwrap()).collect() };
    lines
        .map(|line| numbers(line).try_into().unwrap())
        .collect()
}

#[test]
fn csv_and_json_contain_the_same_numbers() {
    let bench = Bench::new(SAMPLE);
    let csv = bench.text(&["--rays", "2000", "--seed", "7"]);
    for line in [
        "# sample: sample.toml",
        "# engine: hybrid",
        "# rays: 2000",
        "# seed: 7",
    ] {
        assert!(csv.lines().any(|l| l == line), "{csv}");
    }
    let rows = rows(&csv);
    assert_eq!(
        rows.iter().map(|row| row[0]).collect::<Vec<_>>(),
        [450.0, 600.5, 1000.0, 1300.0]
    );
    for [_, r, r_se, t, t_se, a] in &rows {
        assert_eq!(*a, 1.0 - r - t);
        assert!(r_se > &0.0 && t_se > &0.0 && r_se < &0.05);
    }
    // ice absorbs little at 450 nm and much at 1300 nm
    assert!(rows[0][5] < 0.01 && rows[3][5] > 0.1, "{csv}");
    let json = bench.text(&["--rays", "2000", "--seed", "7", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["engine"], "hybrid");
    for (column, name) in HEADER.split(',').enumerate() {
        let values: Vec<_> = rows.iter().map(|row| row[column]).collect();
        assert_eq!(json[name], serde_json::json!(values), "{name}");
    }
    assert_eq!(json["lost_share"].as_array().unwrap().len(), 4);
}

#[test]
fn the_seed_changes_results_and_the_number_of_threads_does_not() {
    let bench = Bench::new(SAMPLE);
    for engine in ["reference", "spectral"] {
        let run = |threads, seed| {
            let args = [
                "--engine",
                engine,
                "--rays",
                "9000",
                "--threads",
                threads,
                "--seed",
                seed,
            ];
            bench.text(&args)
        };
        let single_threaded = run("1", "1");
        assert_eq!(single_threaded, run("2", "1"));
        assert_ne!(rows(&single_threaded), rows(&run("2", "2")));
    }
}

#[test]
fn reference_and_spectral_agree() {
    let bench = Bench::new(SAMPLE);
    let measured = |engine| rows(&bench.text(&["--rays", "40000", "--engine", engine]));
    // 16 comparisons at 4.5 standard errors: a false alarm in 1e4 runs. The bias of spectral,
    // at most 0.1 %, is a fraction of a standard error here.
    for (a, b) in measured("reference").iter().zip(measured("spectral")) {
        for column in [1, 3] {
            let se = a[column + 1].hypot(b[column + 1]);
            let z = (a[column] - b[column]) / se;
            assert!(z.abs() < 4.5, "{z} at {} nm: {a:?} {b:?}", a[0]);
        }
    }
}

#[test]
fn errors_leave_standard_output_empty() {
    let broken = SAMPLE.replace("500 }", "50 }");
    let cases: [(&str, &[&str], &str); 4] = [
        (
            &broken,
            &[],
            "sample.toml:10: `layer[0].grain[0].size_um.min` = 300 is above max = 50",
        ),
        (SAMPLE, &["--engine", "spektral"], "spectral"),
        (SAMPLE, &["--rays", "0"], "--rays"),
        (SAMPLE, &["--seed", "-1"], "-1"),
    ];
    for (sample, args, message) in cases {
        let output = Bench::new(sample).output(args);
        let errors = String::from_utf8(output.stderr).unwrap();
        assert!(
            !output.status.success() && errors.contains(message),
            "{errors}"
        );
        assert!(output.stdout.is_empty());
    }
}

#[test]
fn a_closed_pipe_is_not_an_error() {
    let bench = Bench::new(SAMPLE);
    let mut child = bench.start(&["--rays", "100"]);
    drop(child.stdout.take());
    let mut errors = String::new();
    child
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut errors)
        .unwrap();
    assert!(child.wait().unwrap().success(), "{errors}");
    assert_eq!(errors.lines().count(), 1, "only the warning: {errors}");
}

#[cfg(unix)]
#[test]
fn an_interrupted_measurement_prints_nothing() {
    let bench = Bench::new(SAMPLE);
    let mut child = bench.start(&["--rays", "1000000000000"]);
    let mut errors = BufReader::new(child.stderr.take().unwrap());
    // once the warning is printed, the handler of Ctrl-C is installed
    let mut warning = String::new();
    errors.read_line(&mut warning).unwrap();
    assert!(
        warning.starts_with("warning: sample.toml:8: `layer[0].density_kg_m3`"),
        "{warning}"
    );
    // twice, as `timeout` sends it: to the process and to its group
    let id = child.id();
    let twice = format!("kill -INT {id} && sleep 0.01 && kill -INT {id} || true");
    let sent = Command::new("sh").args(["-c", &twice]).status();
    assert!(sent.unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    assert!(output.stdout.is_empty());
    let mut rest = String::new();
    errors.read_to_string(&mut rest).unwrap();
    assert_eq!(
        rest,
        "\nstopping (Ctrl-C again stops at once)\ninterrupted: nothing was written\n"
    );
}

/// Every sample in configs/samples can be measured and conserves energy.
#[test]
fn committed_samples_can_be_measured() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("configs/samples");
    let mut measured = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "toml") {
            continue;
        }
        let mut command = Command::new(PathBuf::from(env!("CARGO_BIN_EXE_splitsnow")));
        let args = ["--engine", "spectral", "--rays", "8"];
        let output = command
            .arg("measure")
            .arg(&path)
            .args(args)
            .output()
            .unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{}: {errors}", path.display());
        for [nm, r, _, t, _, a] in rows(&String::from_utf8(output.stdout).unwrap()) {
            let valid = r >= 0.0 && t >= 0.0 && a >= -1e-12;
            assert!(valid, "{} at {nm} nm: {r} {t} {a}", path.display());
        }
        measured += 1;
    }
    assert!(measured >= 12, "{measured} samples");
}

/// A profile has a row per wavelength (or band) and depth, from the incident light at the surface
/// to the transmitted light at the base, and what is absorbed between.
#[test]
fn profiles_have_rows_per_depth() {
    let bench = Bench::new(SAMPLE);
    let args = ["--depths-cm", "0.5,0.2:0.6:0.2", "--rays", "512"];
    let csv = bench.text(&args);
    let mut lines = csv.lines().filter(|line| !line.starts_with('#'));
    assert_eq!(
        lines.next().unwrap(),
        "wavelength_nm,depth_cm,downwelling,downwelling_se,upwelling,upwelling_se,actinic,actinic_se,absorbed_per_m,absorbed_per_m_se"
    );
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), 4 * 6);
    let depths: Vec<&str> = rows[..6].iter().map(|row| row[1]).collect();
    assert_eq!(depths, ["0", "0.2", "0.4", "0.5", "0.6", "1"]);
    let number = |cell: &str| cell.parse::<f64>().unwrap();
    for of_wavelength in rows.chunks(6) {
        let (surface, base) = (&of_wavelength[0], &of_wavelength[5]);
        assert!((number(surface[2]) - 1.0).abs() < 1e-9, "{surface:?}");
        assert_eq!((base[4], base[8], base[9]), ("0.0", "", ""), "{base:?}");
        let absorbed = of_wavelength.windows(2).map(|pair| {
            let thickness_m = (number(pair[1][1]) - number(pair[0][1])) / 100.0;
            number(pair[0][8]) * thickness_m
        });
        let left = 1.0 - number(surface[4]) - number(base[2]);
        assert!((absorbed.sum::<f64>() - left).abs() < 1e-9, "{left}");
    }

    let json = bench.text(&[&args[..], &["--bands", "par", "--json"]].concat());
    let value: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(value["bands"]["band"], serde_json::json!(["par"]));
    let down = value["downwelling"][0].as_array().unwrap();
    assert_eq!(down.len(), 6);
    assert!((down[0].as_f64().unwrap() - 1.0).abs() < 1e-9);
    assert_eq!(value["absorbed_per_m"][0].as_array().unwrap().len(), 5);

    for (depths, message) in [
        (
            "2",
            "the depth 2 cm is not in the snowpack; give depths from 0 to 1 cm",
        ),
        ("-1", "is not a depth; give 0 or more, in cm"),
        ("0:1", "give a depth, or START:END:STEP"),
    ] {
        let output = bench.output(&[&format!("--depths-cm={depths}")]);
        assert!(!output.status.success() && output.stdout.is_empty());
        let errors = String::from_utf8(output.stderr).unwrap();
        assert!(errors.contains(message), "{errors}");
    }
}
