//! `include/splitsnow.h`, compiled with warnings as errors and sanitizers: it answers
//! as the Rust library does, and refuses the files that it refuses.
//!
//! With SPLITSNOW_FILE a compact file of one's own is compared, too.
#![allow(clippy::unwrap_used)]
mod answers;
mod files;
mod hostile;
mod parameters;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use splitsnow::lookup::{Database, Lookup};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::Point;

use self::files::{Made, variants};

const STRICT: [&str; 6] = [
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wshadow",
    "-Werror",
];
const CHECKED: &str = "-fsanitize=address,undefined";

/// A folder of this test's own.
pub(crate) fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("c").join(name);
    fs::create_dir_all(&folder).unwrap();
    folder
}

pub(crate) fn run(command: &mut Command) -> String {
    let output = command.output();
    let output =
        output.unwrap_or_else(|e| panic!("{command:?}: {e}; a C and C++ compiler is needed"));
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{command:?}: {text}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// A program from one source file, strictly.
pub(crate) fn compiled(source: &Path, sanitizer: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = folder("bin").join(source.file_stem().unwrap());
    let (compiler, standard) = match source.extension().unwrap().to_str() {
        Some("c") => ("cc", "-std=c99"),
        _ => ("c++", "-std=c++17"),
    };
    let mut command = Command::new(compiler);
    command
        .args(STRICT)
        .args([standard, "-O1", "-g", sanitizer]);
    command.arg("-fno-sanitize-recover=all");
    command.arg("-I").arg(root.join("include"));
    command.arg(root.join(source)).arg("-o").arg(&program);
    run(command.args(["-lm", "-pthread"]));
    program
}

pub(crate) static ANSWERS: LazyLock<PathBuf> =
    LazyLock::new(|| compiled(Path::new("tests/c/answers.c"), CHECKED));

/// Numbers without a pattern, in [0, 1).
pub(crate) struct Numbers(pub(crate) u64);

impl Numbers {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = self.0.wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.next() * n as f64) as usize
    }
}

/// What the functions refuse of their arguments, getters, and the table for textures.
#[test]
fn arguments_are_checked() {
    let program = compiled(Path::new("tests/c/arguments.c"), CHECKED);
    let folder = folder("arguments");
    let all: BTreeMap<_, _> = variants().into_iter().collect();
    let mut command = Command::new(program);
    for name in ["linear_f32", "beyond_log", "thick"] {
        let file = folder.join(name);
        fs::write(&file, &all[name]).unwrap();
        command.arg(file);
    }
    run(command.arg(&folder));
}

/// The compiler's checks of threads find no race, and all threads the same answers.
#[test]
fn threads_share_a_database() {
    let program = compiled(Path::new("tests/c/threads.cpp"), "-fsanitize=thread");
    let file = folder("threads").join("snow.safetensors");
    fs::write(&file, Made::default().bytes()).unwrap();
    run(Command::new(program).arg(&file));
}

/// The examples of docs/c.md are compiled as they stand, and answer.
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
    let [program, table] = blocks("c").try_into().unwrap();
    let [renderer] = blocks("cpp").try_into().unwrap();
    let c = folder.join("example.c");
    // the second example goes on where the first asks
    let asks = "    /* per sample";
    assert!(program.contains(asks));
    let table: String = table.lines().map(|line| format!("    {line}\n")).collect();
    fs::write(
        &c,
        program.replace(asks, &format!("{table}    free(table);\n{asks}")),
    )
    .unwrap();
    let cpp = folder.join("renderer.cpp");
    fs::write(
        &cpp,
        format!("#define SPLITSNOW_IMPLEMENTATION\n{renderer}int main() {{}}\n"),
    )
    .unwrap();
    compiled(&cpp, CHECKED);

    let made = Made::default().bytes();
    let file = folder.join("snow.safetensors");
    fs::write(&file, &made).unwrap();
    let found = run(Command::new(compiled(&c, CHECKED)).arg(&file));
    let database = Database::from_bytes(&made).unwrap();
    let lookup = Lookup::new(&database, Quantity::Transmittance).unwrap();
    let mut spectrum = [0.0; 31];
    let point = Point::from_core([0.4, 260.0, 270.0, 7.5, 33.0]);
    lookup.spectrum(point, &mut spectrum).unwrap();
    let values: Vec<f64> = found
        .lines()
        .take(4)
        .map(|line| line.split_once(',').unwrap().1.parse().unwrap())
        .collect();
    for (value, at) in values.iter().zip([5, 12, 20, 28]) {
        assert!((value - f64::from(spectrum[at])).abs() < 2e-6, "{found}");
    }
    assert_eq!(found.lines().count(), 5);
}
