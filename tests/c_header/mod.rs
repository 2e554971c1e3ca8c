//! `include/splitsnow.h`, compiled with strict warnings and sanitizers. It gives the same
//! answers as the Rust library and refuses the same files.
//!
//! SPLITSNOW_FILE may name a further compact file for the comparison.
#![allow(clippy::unwrap_used)]
mod answers;
mod files;
mod hostile;
mod parameters;
mod views;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use splitsnow::lookup::{Database, DirectionalQuantity, Directions, Lookup};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Parameter, Point};

use self::files::{Contents, variants};

const WARNINGS: [&str; 6] = [
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wshadow",
    "-Werror",
];
const SANITIZERS: &str = "-fsanitize=address,undefined";

/// A folder for the files of one test.
pub(crate) fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("c").join(name);
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// Runs a command, which must succeed, and returns its standard output.
pub(crate) fn run(command: &mut Command) -> String {
    let output = command.output();
    let output =
        output.unwrap_or_else(|e| panic!("{command:?}: {e}; a C and C++ compiler is needed"));
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{command:?}: {text}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Compiles one source file with warnings as errors, and returns the program.
pub(crate) fn compile(source: &Path, sanitizer: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = folder("bin").join(source.file_stem().unwrap());
    let (compiler, standard) = match source.extension().unwrap().to_str() {
        Some("c") => ("cc", "-std=c99"),
        _ => ("c++", "-std=c++17"),
    };
    let mut command = Command::new(compiler);
    command
        .args(WARNINGS)
        .args([standard, "-O1", "-g", sanitizer]);
    command.arg("-fno-sanitize-recover=all");
    command.arg("-I").arg(root.join("include"));
    command.arg(root.join(source)).arg("-o").arg(&program);
    run(command.args(["-lm", "-pthread"]));
    program
}

pub(crate) static ANSWERS: LazyLock<PathBuf> =
    LazyLock::new(|| compile(Path::new("tests/c/answers.c"), SANITIZERS));

/// A generator of pseudorandom numbers.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// A number in [0, 1).
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = self.0.wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// An integer in [0, n).
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.next() * n as f64) as usize
    }
}

/// Invalid arguments, the getters, and the table for textures.
#[test]
fn arguments_are_checked() {
    let program = compile(Path::new("tests/c/arguments.c"), SANITIZERS);
    let folder = folder("arguments");
    let files: BTreeMap<_, _> = variants().into_iter().collect();
    let mut command = Command::new(program);
    for name in ["linear_f32", "optional_axes_log", "thick"] {
        let file = folder.join(name);
        fs::write(&file, &files[name]).unwrap();
        command.arg(file);
    }
    let file = folder.join("views");
    fs::write(&file, views::documented().bytes()).unwrap();
    run(command.arg(file).arg(&folder));
}

/// The thread sanitizer finds no race, and all threads get the same answers.
#[test]
fn threads_can_share_a_database() {
    let program = compile(Path::new("tests/c/threads.cpp"), "-fsanitize=thread");
    let file = folder("threads").join("snow.safetensors");
    fs::write(&file, Contents::default().bytes()).unwrap();
    run(Command::new(program).arg(&file));
}

/// The examples of docs/c.md compile and give the expected answers.
#[test]
fn the_documented_examples_work() {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/c.md"));
    let text = text.unwrap();
    let blocks = |language: &str| -> Vec<String> {
        let begin = format!("```{language}\n");
        let parts = text.split(&begin).skip(1);
        parts
            .map(|part| part.split("```").next().unwrap().to_owned())
            .collect()
    };
    let folder = folder("documented");
    let [program, toward, table] = blocks("c").try_into().unwrap();
    let [renderer] = blocks("cpp").try_into().unwrap();
    let c = folder.join("example.c");
    // the example of textures is inserted before the queries of the first
    let queries = "    /* per sample";
    assert!(program.contains(queries));
    let table: String = table.lines().map(|line| format!("    {line}\n")).collect();
    fs::write(
        &c,
        program.replace(queries, &format!("{table}    free(table);\n{queries}")),
    )
    .unwrap();
    let cpp = folder.join("renderer.cpp");
    fs::write(
        &cpp,
        format!("#define SPLITSNOW_IMPLEMENTATION\n{renderer}int main() {{}}\n"),
    )
    .unwrap();
    compile(&cpp, SANITIZERS);

    let bytes = Contents::default().bytes();
    let file = folder.join("snow.safetensors");
    fs::write(&file, &bytes).unwrap();
    let found = run(Command::new(compile(&c, SANITIZERS)).arg(&file));
    let database = Database::from_bytes(&bytes).unwrap();
    let lookup = Lookup::new(&database, Quantity::Transmittance).unwrap();
    let mut spectrum = [0.0; 31];
    let point = Point::from_core([0.4, 260.0, 270.0, 7.5, 33.0]);
    lookup.spectrum(point, &mut spectrum).unwrap();
    let values: Vec<f64> = found
        .lines()
        .take(4)
        .map(|line| line.split_once(',').unwrap().1.parse().unwrap())
        .collect();
    for (value, index) in values.iter().zip([5, 12, 20, 28]) {
        assert!((value - f64::from(spectrum[index])).abs() < 2e-6, "{found}");
    }
    assert_eq!(found.lines().count(), 5);

    let source = folder.join("toward.c");
    fs::write(&source, toward).unwrap();
    let views = folder.join("views.safetensors");
    let bytes = views::documented().bytes();
    fs::write(&views, &bytes).unwrap();
    let program = compile(&source, SANITIZERS);
    let found = run(Command::new(program).args([&file, &views]));
    let anisotropy = Database::from_bytes(&bytes).unwrap();
    let directions = Directions::new(&database, &anisotropy).unwrap();
    let point = Point::from_core([0.4, 260.0, 270.0, 30.0, 55.0])
        .with(Parameter::View, 40.0)
        .with(Parameter::RelativeAzimuth, 0.0);
    let factor = DirectionalQuantity::ReflectanceFactor;
    directions.spectrum(factor, point, &mut spectrum).unwrap();
    assert_eq!(found.lines().count(), spectrum.len());
    for (line, value) in found.lines().zip(spectrum) {
        let (_, brf) = line.split_once(',').unwrap();
        let brf: f64 = brf.parse().unwrap();
        assert!((brf - f64::from(value)).abs() < 3e-6, "{found}");
    }
}
