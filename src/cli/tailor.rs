//! `splitsnow tailor`: makes the smallest database for a scene.
use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde_json::json;

use super::common::{self, Interrupted, Spinner, ThreadArgs};
use super::walking;
use crate::atomic;
use crate::compress::Basis;
use crate::config::scene;
use crate::error_budget::ErrorBudgetError;
use crate::scene::Scene;
use crate::store::COMPACT;
use crate::tailor::{self, TailorError, TailoredFile};

/// Make the smallest compact file that keeps a scene's colour bound
///
/// A scene file gives the snow, thicknesses and incidence angles that a renderer will look
/// up, the illuminants, and the largest colour difference allowed between a look-up and a
/// converged simulation. `tailor` simulates candidate nodes, chooses the wavelengths, nodes,
/// components and bits that keep the bound in the fewest bytes, and certifies the file at
/// random points with fresh simulations. Spectra are linear between the stored wavelengths.
/// The file is `snow.safetensors` in the output directory; `splitsnow verify` proves the
/// bound again.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "\
Examples:
  splitsnow tailor mine.toml --out out/mine --points 2000
  splitsnow tailor configs/scenes/block.toml")]
pub(super) struct Args {
    /// Scene file, such as configs/scenes/block.toml
    #[arg(value_name = "SCENE.toml")]
    scene: PathBuf,
    /// Output directory [default: out/NAME, where NAME is the name of the scene file]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Random points at which the file is certified, 16 to 100000
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
    common::check_output_dir(&out)?;
    let spinner = Spinner::new("reading");
    let text = file.self_contained();
    let tailored = walking::run(args.threads, None, cancel, |control| {
        tailor::tailor(
            &file.scene,
            &text,
            args.points as usize,
            control,
            &|activity| spinner.say(activity),
        )
    })?;
    drop(spinner);
    let tailored = match tailored {
        Err(TailorError::ErrorBudget(ErrorBudgetError::Cancelled)) => {
            return Err(Interrupted("nothing was written".into()).into());
        }
        tailored => tailored?,
    };
    std::fs::create_dir_all(&out).map_err(|error| common::cannot_write(&out, error))?;
    let path = out.join(COMPACT);
    let written = atomic::write(&path, &tailored.bytes);
    written.map_err(|error| common::cannot_write(&path, error))?;
    common::print(&if args.json {
        format!("{:#}\n", report(&file.scene, &tailored, &path))
    } else {
        text_report(&file.scene, &tailored, &path)
    })
}

/// The report as JSON.
fn report(scene: &Scene, tailored: &TailoredFile, path: &Path) -> serde_json::Value {
    let quantities = tailored.compressed.iter().map(|(quantity, model)| {
        let about = json!({ "components": model.components(), "bits": model.coefficients.bits() });
        (quantity.name().to_owned(), about)
    });
    let axes = tailored.axes.iter();
    json!({
        "file": path,
        "bytes": tailored.bytes.len(),
        "max_delta_e": scene.max_delta_e,
        "reached_delta_e": tailor::max_delta_e(&tailored.error_budget),
        "wavelength_nm": tailored.database.wavelengths_nm(),
        "nodes": axes.map(|(axis, values)| (axis.key().to_owned(), json!(values))).collect::<serde_json::Map<_, _>>(),
        "quantities": quantities.collect::<serde_json::Map<_, _>>(),
        "error_budget": tailored.error_budget,
    })
}

/// The report as text: axes, wavelengths, components, savings and error budget.
fn text_report(scene: &Scene, tailored: &TailoredFile, path: &Path) -> String {
    let mut text = String::new();
    let mut nodes = 1;
    for ((axis, values), candidates) in tailored.axes.iter().zip(&tailored.candidates) {
        let name = axis.key();
        nodes *= values.len();
        let list: Vec<String> = values.iter().map(f64::to_string).collect();
        let among = match (values.len(), candidates) {
            (1, _) => "one value: no axis of its own".to_owned(),
            (count, all) => format!("{count} of {all} candidates"),
        };
        let _ = writeln!(text, "{name:<20} {} ({among})", list.join(", "));
    }
    let wavelengths = tailored.database.wavelengths_nm();
    let list: Vec<String> = wavelengths.iter().map(f64::to_string).collect();
    let (count, candidates) = (wavelengths.len(), scene.wavelengths_nm.len());
    let between = if count < candidates {
        ", linear between"
    } else {
        ""
    };
    let list = list.join(", ");
    let _ = writeln!(
        text,
        "{:<21}{list} ({count} of {candidates}{between})",
        "wavelength_nm"
    );
    for (quantity, model) in &tailored.compressed {
        let bits: Vec<String> = model
            .coefficients
            .bits()
            .iter()
            .map(u32::to_string)
            .collect();
        let _ = writeln!(
            text,
            "{:<21}{} components of {}, {} bits",
            quantity.name(),
            model.components(),
            if model.kind == Basis::Log {
                "-ln"
            } else {
                "the spectra"
            },
            bits.join(", ")
        );
    }
    let _ = writeln!(text, "{}", savings(scene, tailored, nodes));
    let _ = writeln!(text, "\n{}\n", tailored.error_budget);
    let (bytes, bound) = (
        common::bytes(tailored.bytes.len() as u64),
        scene.max_delta_e,
    );
    let reached = tailor::max_delta_e(&tailored.error_budget);
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

/// The candidates that the file leaves out, and the bytes that this saves.
fn savings(scene: &Scene, tailored: &TailoredFile, nodes: usize) -> String {
    let candidates: usize = tailored.candidates.iter().product();
    let wavelengths = scene.wavelengths_nm.len();
    let plain_bytes = 2 * candidates * wavelengths * size_of::<f32>();
    let mut parts = vec![format!("{} of {candidates} nodes", candidates - nodes)];
    let stored = tailored.database.wavelengths_nm().len();
    if stored < wavelengths {
        parts.push(format!(
            "{} of {wavelengths} wavelengths",
            wavelengths - stored
        ));
    }
    if scene.quantities.len() == 1 {
        let other = crate::measurement::Quantity::ALL
            .into_iter()
            .find(|quantity| !scene.quantities.contains(quantity));
        parts.extend(other.map(|quantity| quantity.name().to_owned()));
    }
    let fixed = tailored.axes.iter().filter(|(_, values)| values.len() == 1);
    let fixed: Vec<&str> = fixed.map(|(axis, _)| axis.key()).collect();
    if !fixed.is_empty() {
        parts.push(format!("the axes {}", fixed.join(", ")));
    }
    let saved = (plain_bytes as u64).saturating_sub(tailored.bytes.len() as u64);
    format!(
        "left out        {}; {} less than plain spectra at all candidates",
        parts.join("; "),
        common::bytes(saved)
    )
}
