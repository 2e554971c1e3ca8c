//! Pages find each other: relative links, their anchors, and the table of contents of the
//! site (`book.toml`, `docs/SUMMARY.md`). `tests/python/test_book.py` checks the site as built.
#![allow(clippy::unwrap_used)]
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// All pages below `folder`, by their paths from the root.
fn pages(folder: &Path, all: &mut BTreeMap<PathBuf, String>) {
    for entry in std::fs::read_dir(root().join(folder)).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        let path = folder.join(&name);
        let hidden = name.starts_with('.') && name != ".github";
        if entry.file_type().unwrap().is_dir() {
            if !hidden
                && !["target", "out", "corpus", "artifacts", "node_modules"]
                    .contains(&name.as_str())
            {
                pages(&path, all);
            }
        } else if name.ends_with(".md") {
            all.insert(path, std::fs::read_to_string(entry.path()).unwrap());
        }
    }
}

fn all_pages() -> BTreeMap<PathBuf, String> {
    let mut all = BTreeMap::new();
    pages(Path::new(""), &mut all);
    all
}

/// The lines of a page outside fenced blocks.
fn prose(page: &str) -> impl Iterator<Item = &str> {
    let mut fenced = false;
    page.lines().filter(move |line| {
        let fence = line.trim_start().starts_with("```");
        fenced ^= fence;
        !fenced && !fence
    })
}

/// A text without its `code`.
fn without_code(text: &str) -> String {
    text.split('`').step_by(2).collect::<Vec<_>>().join("`")
}

/// Targets of links, pictures and references in Markdown and in HTML.
fn links(page: &str) -> Vec<String> {
    let text = without_code(&prose(page).collect::<Vec<_>>().join("\n"));
    let mut all = Vec::new();
    for (before, end) in [
        ("](", ')'),
        ("href=\"", '"'),
        ("src=\"", '"'),
        ("]: ", '\n'),
    ] {
        for part in text.split(before).skip(1) {
            let target = part.split([end, ' ', '\n']).next().unwrap();
            // `]: ` also ends an entry of the changelog
            if before != "]: " || target.contains(['/', '.', '#']) {
                all.push(target.to_owned());
            }
        }
    }
    all
}

/// Anchors of the headings of a page, as made by GitHub.
fn anchors(page: &str) -> BTreeSet<String> {
    let mut all = BTreeSet::new();
    for line in prose(page) {
        let text = line.trim_start_matches('#');
        if text.len() == line.len() || !text.starts_with(' ') {
            continue;
        }
        // the text of a link, not its target
        let mut shown = String::new();
        for (i, part) in text.trim().split("](").enumerate() {
            let part = if i == 0 {
                part
            } else {
                part.split_once(')').unwrap().1
            };
            shown += part;
        }
        let kept = |c: &char| c.is_alphanumeric() || "-_ ".contains(*c);
        let slug: String = shown.to_lowercase().chars().filter(kept).collect();
        let slug = slug.replace(' ', "-");
        let numbered = (1..).map(|n| format!("{slug}-{n}"));
        let free = std::iter::once(slug.clone()).chain(numbered);
        let free = { free }.find(|slug| !all.contains(slug));
        all.insert(free.unwrap());
    }
    all
}

/// A path without `.` and `..`; `None` if it leaves the root.
fn plain(path: &Path) -> Option<PathBuf> {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir if !plain.pop() => return None,
            Component::ParentDir | Component::CurDir => {}
            part => plain.push(part),
        }
    }
    Some(plain)
}

/// What is wrong with a relative link from the page at `from`.
fn fault(pages: &BTreeMap<PathBuf, String>, from: &Path, link: &str) -> Option<&'static str> {
    let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
    let target = match path {
        "" => Some(from.to_owned()),
        path => plain(&from.parent().unwrap().join(path)),
    };
    let Some(target) = target else {
        return Some("leaves the repository");
    };
    if !root().join(&target).exists() {
        return Some("is broken");
    }
    if from.starts_with("docs") && !target.starts_with("docs") {
        return Some("leaves docs/, so it is broken in the book: name the file as `code`");
    }
    let page = pages.get(&target);
    let found = anchor.is_empty() || page.is_some_and(|page| anchors(page).contains(anchor));
    (!found).then_some("has an anchor that no heading makes")
}

#[test]
fn links_and_anchors_are_valid() {
    let (pages, mut checked) = (all_pages(), 0);
    assert!(pages.contains_key(Path::new("README.md")));
    for (from, page) in &pages {
        for link in links(page) {
            if link.contains("://") || link.starts_with("mailto:") {
                continue;
            }
            checked += 1;
            if let Some(fault) = fault(&pages, from, &link) {
                panic!("{}: the link {link} {fault}", from.display());
            }
        }
    }
    assert!(checked > 100, "{checked}");
}

/// Pages named in passing, without a link, exist too.
#[test]
fn pages_that_are_named_exist() {
    let mut checked = 0;
    for (from, page) in all_pages() {
        let words = page.split(|c: char| !(c.is_alphanumeric() || "/._-".contains(c)));
        for word in words.filter(|word| word.starts_with("docs/") && word.ends_with(".md")) {
            checked += 1;
            assert!(root().join(word).exists(), "{}: {word}", from.display());
        }
    }
    assert!(checked > 30, "{checked}");
}

#[test]
fn the_summary_lists_every_page_once() {
    let summary = std::fs::read_to_string(root().join("docs/SUMMARY.md")).unwrap();
    let mut listed = links(&summary);
    listed.sort();
    let mut there = BTreeMap::new();
    pages(Path::new("docs"), &mut there);
    let names = there.keys().map(|path| path.strip_prefix("docs").unwrap());
    let names = names.map(|path| path.to_str().unwrap().replace('\\', "/"));
    let names: Vec<_> = names.filter(|name| name != "SUMMARY.md").collect();
    assert_eq!(listed, {
        let mut names = names;
        names.sort();
        names
    });
}

#[test]
fn broken_links_are_found() {
    let page =
        "# One\n## `Two` of [three](x.md)!\n## One\n[a](#one-1) `[b](c)`\n```\n[d](e)\n```\n";
    assert_eq!(links(page), ["x.md", "#one-1"]);
    let found: Vec<_> = anchors(page).into_iter().collect();
    assert_eq!(found, ["one", "one-1", "two-of-three"]);
    let mut pages = all_pages();
    pages.insert("docs/design.md".into(), page.to_owned());
    let docs = Path::new("docs/design.md");
    assert_eq!(fault(&pages, docs, "#one-1"), None);
    assert_eq!(fault(&pages, docs, "start/snow.md#layers"), None);
    for (link, expected) in [
        ("#four", "anchor"),
        ("missing.md", "broken"),
        ("../README.md", "leaves docs/"),
        ("../../README.md", "leaves the repository"),
        ("start/snow.md#none", "anchor"),
    ] {
        let fault = fault(&pages, docs, link).unwrap();
        assert!(fault.contains(expected), "{link}: {fault}");
    }
}

/// The version in `CITATION.cff` is the one in `Cargo.toml`, and its titles are the README's.
#[test]
fn the_citation_is_current() {
    let citation = std::fs::read_to_string(root().join("CITATION.cff")).unwrap();
    let version = format!("\nversion: {}\n", env!("CARGO_PKG_VERSION"));
    assert!(citation.contains(&version));
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let titles = citation
        .lines()
        .filter_map(|line| line.strip_prefix("    title: "));
    let titles: Vec<_> = titles.map(|title| title.trim_matches('"')).collect();
    assert_eq!(titles.len(), 2);
    for title in titles {
        assert!(words(&readme).contains(title), "{title}");
    }
}
