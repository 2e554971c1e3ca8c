//! `splitsnow fit`: the smallest database that serves a scene.
use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;
use serde_json::json;

use super::common::{self, Interrupted, Spinner, ThreadArgs};
use super::simulate;
use crate::atomic;
use crate::certificate::CertificateError;
use crate::compress::Basis;
use crate::config::scene;
use crate::fit::{self, FitError, Fitted};
use crate::scene::Scene;
use crate::store::COMPACT;

/// Make the smallest database that serves a scene within its colour bound
///
/// A scene file names the snow, thicknesses and angles that a renderer will ask
/// for, the light, and the largest colour difference allowed between what it gets
/// and a converged simulation. `fit` simulates candidates, chooses the wavelengths,
/// nodes, components and bits that hold the bound in the fewest bytes, and certifies
/// the file at random points with fresh simulations. Between the wavelengths kept,
/// spectra are linear. The file is `snow.safetensors`; `splitsnow verify` proves it anew.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "\
Examples:
  splitsnow fit configs/scenes/igloo.toml
  splitsnow fit mine.toml --out out/mine --points 2000")]
pub(super) struct Args {
    /// Scene file, such as configs/scenes/block.toml
    #[arg(value_name = "SCENE.toml")]
    scene: PathBuf,
    /// Output directory [default: out/<name of the scene file>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Random points that certify the file
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = clap::value_parser!(u64).range(16..=100_000))]
    points: u64,
    #[command(flatten)]
    threads: ThreadArgs,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let cancel = common::interrupt_flag()?;
    let file = scene::read(&args.scene)?;
    common::warn(&file.warnings);
    common::notes(&file.notes);
    let out = args.out.clone();
    let out = out.unwrap_or_else(|| Path::new("out").join(&file.name));
    let spinner = Spinner::new("reading");
    let text = file.self_contained();
    let fitted = simulate::run(args.threads, None, cancel, |control| {
        fit::fit(&file.scene, &text, args.points as usize, control, &|what| {
            spinner.say(what)
        })
    })?;
    drop(spinner);
    let fitted = match fitted {
        Err(FitError::Certificate(CertificateError::Cancelled)) => {
            return Err(Interrupted("nothing was written".into()).into());
        }
        fitted => fitted?,
    };
    std::fs::create_dir_all(&out)?;
    let path = out.join(COMPACT);
    let written = atomic::write(&path, &fitted.bytes);
    written.with_context(|| format!("cannot write {}", path.display()))?;
    common::print(&if args.json {
        format!("{:#}\n", report(&file.scene, &fitted, &path))
    } else {
        text_report(&file.scene, &fitted, &path)
    })
}

fn report(scene: &Scene, fitted: &Fitted, path: &Path) -> serde_json::Value {
    let quantities = fitted.compressed.iter().map(|(quantity, one)| {
        let about = json!({ "components": one.components(), "bits": one.coefficients.bits() });
        (quantity.name().to_owned(), about)
    });
    let axes = fitted.axes.iter();
    json!({
        "file": path,
        "bytes": fitted.bytes.len(),
        "max_delta_e": scene.max_delta_e,
        "reached_delta_e": fit::largest(&fitted.certificate),
        "wavelength_nm": fitted.database.wavelengths_nm(),
        "nodes": axes.map(|(axis, values)| (axis.name().to_owned(), json!(values))).collect::<serde_json::Map<_, _>>(),
        "quantities": quantities.collect::<serde_json::Map<_, _>>(),
        "certificate": fitted.certificate,
    })
}

fn text_report(scene: &Scene, fitted: &Fitted, path: &Path) -> String {
    let mut text = String::new();
    let mut nodes = 1;
    for ((axis, values), candidates) in fitted.axes.iter().zip(&fitted.candidates) {
        let name = axis.name();
        nodes *= values.len();
        let list: Vec<String> = values.iter().map(f64::to_string).collect();
        let among = match (values.len(), candidates) {
            (1, _) => "one value: no axis of its own".to_owned(),
            (n, all) => format!("{n} of {all} candidates"),
        };
        let _ = writeln!(text, "{name:<15} {} ({among})", list.join(", "));
    }
    let wavelengths = fitted.database.wavelengths_nm();
    let list: Vec<String> = wavelengths.iter().map(f64::to_string).collect();
    let (n, all) = (wavelengths.len(), scene.wavelengths_nm.len());
    let between = if n < all { ", linear between" } else { "" };
    let list = list.join(", ");
    let _ = writeln!(
        text,
        "{:<16}{list} ({n} of {all}{between})",
        "wavelength_nm"
    );
    for (quantity, one) in &fitted.compressed {
        let bits: Vec<String> = one.coefficients.bits().iter().map(u32::to_string).collect();
        let _ = writeln!(
            text,
            "{:<16}{} components of {}, {} bits",
            quantity.name(),
            one.components(),
            if one.kind == Basis::Log {
                "-ln"
            } else {
                "the spectra"
            },
            bits.join(", ")
        );
    }
    let _ = writeln!(text, "{}", left_out(scene, fitted, nodes));
    let _ = writeln!(text, "\n{}\n", fitted.certificate);
    let (bytes, bound) = (common::bytes(fitted.bytes.len() as u64), scene.max_delta_e);
    let reached = fit::largest(&fitted.certificate);
    let _ = writeln!(
        text,
        "{}: {bytes}, Delta-E at most {reached:.3} of {bound} allowed",
        path.display()
    );
    let _ = writeln!(
        text,
        "next: splitsnow verify {}",
        path.parent().unwrap_or(path).display()
    );
    text
}

/// What the scene did not ask for, and the bytes that it would have taken.
fn left_out(scene: &Scene, fitted: &Fitted, nodes: usize) -> String {
    let all: usize = fitted.candidates.iter().product();
    let wavelengths = scene.wavelengths_nm.len();
    let plain = 2 * all * wavelengths * size_of::<f32>();
    let mut parts = vec![format!("{} of {all} nodes", all - nodes)];
    let kept = fitted.database.wavelengths_nm().len();
    if kept < wavelengths {
        parts.push(format!(
            "{} of {wavelengths} wavelengths",
            wavelengths - kept
        ));
    }
    if scene.quantities.len() == 1 {
        let other = crate::measurement::Quantity::ALL
            .into_iter()
            .find(|quantity| !scene.quantities.contains(quantity));
        parts.extend(other.map(|quantity| quantity.name().to_owned()));
    }
    let fixed = fitted.axes.iter().filter(|(_, values)| values.len() == 1);
    let fixed: Vec<&str> = fixed.map(|(axis, _)| axis.name()).collect();
    if !fixed.is_empty() {
        parts.push(format!("the axes {}", fixed.join(", ")));
    }
    let saved = (plain as u64).saturating_sub(fitted.bytes.len() as u64);
    format!(
        "left out        {}; {} less than plain spectra at all candidates",
        parts.join("; "),
        common::bytes(saved)
    )
}
