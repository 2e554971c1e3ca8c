//! Allowed dependencies: between the crates, between the modules of `src` (in the order of
//! the table in `src/lib.rs`), and the number of crates that `splitsnow-lookup` pulls in.
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// Maximum number of third-party crates that a user of `splitsnow-lookup` compiles.
const MAX_CRATES: usize = 25;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// The standard output of a cargo command.
fn cargo(arguments: &str) -> String {
    let mut command = Command::new(env!("CARGO"));
    command.current_dir(root()).args(["--locked", "--offline"]);
    let output = command.args(arguments.split(' ')).output().unwrap();
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// Dependencies of each crate on other crates of the workspace, including those of tests.
#[test]
fn crates_depend_on_lower_crates_only() {
    let metadata = cargo("metadata --no-deps --format-version 1");
    let metadata: Value = serde_json::from_str(&metadata).unwrap();
    let name = |value: &Value| value["name"].as_str().unwrap().to_owned();
    let uses: BTreeMap<String, BTreeSet<String>> = metadata["packages"]
        .as_array()
        .unwrap()
        .iter()
        .map(|package| {
            let dependencies = package["dependencies"].as_array().unwrap().iter();
            let ours = dependencies
                .map(name)
                .filter(|name| name.starts_with("splitsnow"));
            (name(package), ours.collect())
        })
        .collect();
    let [spectra, lookup, model, retrieval] =
        ["spectra", "lookup", "model", "retrieval"].map(|c| format!("splitsnow-{c}"));
    for (user, allowed) in [
        (&spectra, vec![]),
        (&lookup, vec![&spectra]),
        (&model, vec![&spectra]),
        (&retrieval, vec![&spectra, &lookup]),
        (
            &"splitsnow".to_owned(),
            vec![&spectra, &lookup, &model, &retrieval],
        ),
    ] {
        let mut used = uses[user].iter();
        let other = used.find(|used| !allowed.contains(used));
        assert_eq!(other, None, "{user} must not depend on it");
    }
}

#[test]
fn the_lookup_crate_has_few_dependencies() {
    let tree = cargo("tree --package splitsnow-lookup --edges normal --prefix none");
    let crates = tree.lines().map(|line| line.trim_end_matches(" (*)"));
    let mut others: BTreeSet<&str> = crates.filter(|line| !line.is_empty()).collect();
    assert!(others.iter().any(|line| line.starts_with("ndarray v")));
    others.retain(|line| !line.starts_with("splitsnow-"));
    assert!(
        others.len() <= MAX_CRATES,
        "{} of {MAX_CRATES}: {others:#?}",
        others.len()
    );
}

/// The Rust files under `path`, without comment lines.
fn sources(path: &Path) -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(path).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|end| end == "rs") {
            let text = std::fs::read_to_string(&path).unwrap();
            let code = text.lines().filter(|line| !line.trim().starts_with("//"));
            found.push((path, code.collect::<Vec<_>>().join("\n")));
        }
    }
    found
}

/// The word at the start of `text`.
fn word(text: &str) -> &str {
    let end = text.find(|c: char| !c.is_alphanumeric() && c != '_');
    &text[..end.unwrap_or(text.len())]
}

/// The words that follow each occurrence of `before` in `code`.
fn words_after<'a>(code: &'a str, before: &str) -> Vec<&'a str> {
    code.split(before).skip(1).map(word).collect()
}

/// The rows of the table in `src/lib.rs`: the row of each module, starting at 0 for the
/// lowest.
fn rows(library: &str) -> BTreeMap<&str, usize> {
    let table = library
        .lines()
        .filter_map(|line| line.strip_prefix("//! | "));
    let names = table.skip(1).filter_map(|row| row.split_once(" | "));
    let names = names.enumerate().flat_map(|(row, (names, _))| {
        let names = names.split('`').skip(1).step_by(2);
        names.map(move |name| (name, row))
    });
    names.collect()
}

#[test]
fn modules_use_lower_modules_only() {
    let src = root().join("src");
    let library = std::fs::read_to_string(src.join("lib.rs")).unwrap();
    let rows = rows(&library);
    let row = |module: &str, path: &Path| {
        let row = rows.get(module);
        *row.unwrap_or_else(|| panic!("{}: `{module}` is not in the table", path.display()))
    };
    let mut checked = 0;
    for (path, code) in sources(&src) {
        let inside = path.strip_prefix(&src).unwrap();
        let module = inside.iter().next().unwrap().to_str().unwrap();
        let module = module.trim_end_matches(".rs");
        if ["lib", "main"].contains(&module) {
            continue;
        }
        for used in words_after(&code, "crate::") {
            let path = path.display();
            assert_ne!(used, "", "{path}: one line `use crate::` for each module");
            let (own, other) = (row(module, inside), row(used, inside));
            assert!(other <= own, "{path}: `{module}` must not use `{used}`");
            checked += 1;
        }
        if module != "cli" {
            let prefixes = ["crate::", "super::", "splitsnow::"];
            let mut used = prefixes
                .iter()
                .flat_map(|before| words_after(&code, before));
            assert!(!used.any(|word| word == "cli"), "{}", path.display());
            let has_progress_bars = code.contains("indicatif");
            assert!(
                !has_progress_bars,
                "{}: progress bars belong in `cli`",
                path.display()
            );
        }
    }
    assert!(checked > 300, "{checked}");
}

/// The types that a line of code declares with `pub`, `pub(crate)` or the like.
fn declared_type(line: &str) -> Option<&str> {
    let rest = line.trim_start().strip_prefix("pub")?;
    let rest = match rest.strip_prefix('(') {
        Some(scope) => scope.split_once(") ")?.1,
        None => rest.strip_prefix(' ')?,
    };
    let kinds = ["struct ", "enum ", "trait ", "type "];
    kinds
        .iter()
        .find_map(|kind| rest.strip_prefix(kind))
        .map(word)
}

/// A type that other modules can see has a name of its own, in all crates together. Types private
/// to a file may share a name, and every command has its `Args`.
#[test]
fn a_type_name_means_one_thing() {
    let mut files = BTreeMap::<String, BTreeSet<PathBuf>>::new();
    for folder in ["src", "crates"] {
        for (path, code) in sources(&root().join(folder)) {
            let code = code.split("\nmod tests {").next().unwrap_or_default();
            for name in code.lines().filter_map(declared_type) {
                files
                    .entry(name.to_owned())
                    .or_default()
                    .insert(path.clone());
            }
        }
    }
    assert!(files.len() > 300, "{}", files.len());
    files.retain(|name, files| files.len() > 1 && name != "Args");
    assert!(
        files.is_empty(),
        "declared in more than one file: {files:#?}"
    );
}
