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
