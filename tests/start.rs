//! The quick starts of `docs/start` and `docs/retrieval.md` run as they stand, and print what they show.
//!
//! Blocks are taken in the order of the page, in an empty folder that sees the clone:
//!
//! - `sh`: run by bash. Installations are not run; commands that begin with `python` are run
//!   by `python/tests/test_start.py`.
//! - `cpp`, `rust`, `toml`: saved under the name in their first line. A file of the clone has
//!   the same text.
//! - `text`: the standard output of the block before. A line `...` stands for any lines.
//! - `python`: run by `python/tests/test_start.py`.
//!
//! `UPDATE_GOLDEN=1 cargo test --release --test pipeline start` rewrites the output after `sh`.
#![allow(clippy::unwrap_used)]
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use assert_cmd::cargo::cargo_bin;

use crate::docs::keep;

/// What installation lines begin with; `.ci/check` installs in its own way.
const INSTALLS: [&str; 3] = ["cargo install --path .", "pip install ", "apt install "];
/// Programs for which another test runs the block.
const PYTHON: &str = "python ";
/// Folders of the clone that a reader sees.
const CLONE: [&str; 4] = ["configs", "examples", "include", "tests"];

/// A fenced block of a page.
struct Block {
    language: String,
    /// Of the text, in the page.
    range: Range<usize>,
}

fn blocks(page: &str) -> Vec<Block> {
    let (mut all, mut open, mut at) = (Vec::new(), None, 0);
    for line in page.split_inclusive('\n') {
        let after = at + line.len();
        if let Some(language) = line.strip_prefix("```") {
            open = match open.take() {
                None => Some((language.trim().to_owned(), after)),
                Some((language, begin)) => {
                    let range = begin..at;
                    all.push(Block { language, range });
                    None
                }
            };
        }
        at = after;
    }
    assert!(open.is_none(), "a block has no end");
    all
}

/// Whether `text` is as `shown`, in which `...` stands for any lines.
fn fits(shown: &[&str], text: &[&str]) -> bool {
    match shown.split_first() {
        None => text.is_empty(),
        Some((&"...", rest)) => (0..=text.len()).any(|skip| fits(rest, &text[skip..])),
        Some((line, rest)) => text.first() == Some(line) && fits(rest, &text[1..]),
    }
}

/// `text` with as many lines before and after `...` as `shown` has.
fn renewed(shown: &[&str], text: &[&str]) -> String {
    let dots: Vec<_> = (0..shown.len()).filter(|i| shown[*i] == "...").collect();
    let lines = match dots[..] {
        [] => text.to_vec(),
        [at] => {
            let (head, tail) = (at, shown.len() - at - 1);
            assert!(head + tail <= text.len(), "{text:?}");
            [&text[..head], &["..."], &text[text.len() - tail..]].concat()
        }
        _ => panic!("write lines between two `...` by hand: {text:#?}"),
    };
    lines.iter().map(|line| format!("{line}\n")).collect()
}

/// Standard output of a script in `folder`.
fn output(folder: &Path, script: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = cargo_bin!("splitsnow").parent().unwrap().to_path_buf();
    let paths = std::env::var_os("PATH").unwrap_or_default();
    let paths = std::iter::once(program).chain(std::env::split_paths(&paths));
    // a clone in which `cargo` has compiled already
    let script = format!(
        "cargo() {{ command cargo \"$1\" --quiet --locked --manifest-path \"$CLONE/Cargo.toml\" \"${{@:2}}\"; }}\n{script}"
    );
    let output = Command::new("bash")
        .args(["-euo", "pipefail", "-c", &script])
        .env("PATH", std::env::join_paths(paths).unwrap())
        .env("CLONE", root)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{script}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// Saves a block whose first line is a comment with its name.
fn save(folder: &Path, text: &str) {
    let (name, rest) = text.split_once('\n').unwrap();
    let name = name.strip_prefix("// ").or(name.strip_prefix("# "));
    let path = folder.join(name.unwrap_or_else(|| panic!("no name in {text}")));
    if path.exists() {
        let there = std::fs::read_to_string(&path).unwrap();
        assert!(there == rest, "{} differs from the page", path.display());
    } else {
        std::fs::write(path, text).unwrap();
    }
}

fn follow(name: &str) {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let mut page = std::fs::read_to_string(root.join("docs").join(name)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for shared in CLONE {
        std::os::unix::fs::symlink(root.join(shared), folder.path().join(shared)).unwrap();
    }
    std::fs::create_dir(folder.path().join("out")).unwrap();
    // what the block before printed, if it ran here; and all text to replace
    let (mut printed, mut compared, mut changes) = (None, 0, Vec::new());
    for block in blocks(&page) {
        let text = &page[block.range.clone()];
        match block.language.as_str() {
            "sh" => {
                let installs = |line: &str| INSTALLS.iter().any(|known| line.starts_with(known));
                let elsewhere = text.lines().all(installs) || text.starts_with(PYTHON);
                printed = (!elsewhere).then(|| output(folder.path(), text));
            }
            "cpp" | "rust" | "toml" => save(folder.path(), text),
            "python" => printed = None,
            "text" => {
                let Some(printed) = printed.take() else {
                    continue;
                };
                let [shown, found] = [text, &printed].map(|s| s.lines().collect::<Vec<_>>());
                compared += 1;
                if std::env::var_os("UPDATE_GOLDEN").is_some() {
                    changes.push((block.range.clone(), renewed(&shown, &found)));
                } else {
                    assert!(
                        fits(&shown, &found),
                        "docs/{name} shows\n{text}not\n{printed}"
                    );
                }
            }
            other => panic!("docs/{name}: a block of {other:?}"),
        }
    }
    assert!(compared > 0, "docs/{name} shows no output");
    for (range, text) in changes.into_iter().rev() {
        page.replace_range(range, &text);
    }
    keep(name, &page);
}

#[test]
fn artist() {
    follow("start/artist.md");
}

#[test]
fn plants() {
    follow("start/plants.md");
}

#[test]
fn renderer() {
    follow("start/renderer.md");
}

#[test]
fn satellite() {
    follow("start/satellite.md");
}

#[test]
fn snow() {
    follow("start/snow.md");
}

/// Its Python is run by `python/tests/test_start.py`.
#[test]
fn retrieval() {
    follow("retrieval.md");
}

/// A new page needs a test. `soot.md` has no commands: `python/tests/test_start.py` runs it.
#[test]
fn every_page_is_followed() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/start");
    let files = std::fs::read_dir(folder).unwrap();
    let names = files.map(|file| file.unwrap().file_name().into_string().unwrap());
    let mut pages: Vec<_> = names.filter(|name| name.ends_with(".md")).collect();
    pages.sort();
    assert_eq!(
        pages,
        [
            "artist.md",
            "plants.md",
            "renderer.md",
            "satellite.md",
            "snow.md",
            "soot.md"
        ]
    );
}

#[test]
fn dots_stand_for_lines() {
    let text = ["a", "b", "c"];
    for shown in [&["a", "...", "c"][..], &["..."], &["a", "b", "c", "..."]] {
        assert!(fits(shown, &text), "{shown:?}");
    }
    for shown in [&["a", "..."][..1], &["...", "b"], &[]] {
        assert!(!fits(shown, &text), "{shown:?}");
    }
    assert_eq!(renewed(&["", "...", ""], &text), "a\n...\nc\n");
}
