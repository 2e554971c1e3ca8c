//! `splitsnow init`: the example configs, for programs installed without the repository.
use std::fmt::Write;
use std::io;
use std::path::{Path, PathBuf};

use anyhow::bail;
use include_dir::{Dir, DirEntry, include_dir};

use super::common;
use crate::atomic;

/// The folders that are written, by their names.
const FOLDERS: [(&str, Dir); 2] = [
    ("configs", include_dir!("$CARGO_MANIFEST_DIR/configs")),
    ("schema", include_dir!("$CARGO_MANIFEST_DIR/schema")),
];

/// Write the example configs: grids, samples, scenes, studies
///
/// Writes the folders configs/ and schema/. Editors that know TOML complete the keys of a
/// config from schema/. Files that exist already are kept as they are.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "\
Examples:
  splitsnow init ~/snow
  splitsnow init")]
pub(super) struct Args {
    /// Directory in which configs/ and schema/ are created
    #[arg(value_name = "DIR", default_value = ".")]
    dir: PathBuf,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let mut summary = Written::default();
    for (name, folder) in &FOLDERS {
        write_folder(folder, &args.dir.join(name), &mut summary)?;
    }
    let mut text = format!(
        "{} files written to configs and schema in {}\n",
        summary.written,
        args.dir.display()
    );
    for path in &summary.kept {
        let _ = writeln!(text, "kept, differs from the example: {}", path.display());
    }
    let quick = args.dir.join("configs/quick.toml");
    let quick = quick.strip_prefix(".").unwrap_or(&quick);
    let _ = writeln!(text, "next            splitsnow build {}", quick.display());
    common::print(&text)
}

#[derive(Default)]
struct Written {
    written: usize,
    /// Files that existed with other contents.
    kept: Vec<PathBuf>,
}

fn write_folder(folder: &Dir, target: &Path, summary: &mut Written) -> anyhow::Result<()> {
    std::fs::create_dir_all(target).map_err(|error| common::cannot_write(target, error))?;
    for entry in folder.entries() {
        let path = target.join(entry.path().file_name().unwrap_or_default());
        match entry {
            DirEntry::Dir(inner) => write_folder(inner, &path, summary)?,
            DirEntry::File(file) => match std::fs::read(&path) {
                Ok(present) if present == file.contents() => {}
                Ok(_) => summary.kept.push(path),
                Err(error) if error.kind() == io::ErrorKind::NotFound => {
                    atomic::write(&path, file.contents())
                        .map_err(|error| common::cannot_write(&path, error))?;
                    summary.written += 1;
                }
                Err(error) => bail!(
                    "cannot read {}: {error}; move it away, or give another directory",
                    path.display()
                ),
            },
        }
    }
    Ok(())
}
