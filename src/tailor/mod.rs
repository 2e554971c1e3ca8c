//! `tailor`: makes the smallest compact file that keeps a scene's bound on the colour
//! difference of the whole chain (docs/methods.md).
//!
//! 1. All candidate nodes are simulated (`training`), with enough rays that noise is a small
//!    part of the bound.
//! 2. Wavelengths are chosen from the scene's (`wavelengths`), so that linear interpolation
//!    between them takes a small share of the bound.
//! 3. Nodes are chosen (`nodes`) until look-ups at all other candidates are within a share of
//!    the bound. The remaining share is for the compression.
//! 4. The curves are compressed: components of y = -ln T, as few and as coarsely quantised as
//!    the remaining share allows.
//! 5. The file is certified at random points by fresh simulations with other random numbers
//!    and more rays. If it fails, the search starts again at step 3 with a smaller share.
//!
//! The file omits everything that the scene does not use: axes with a single value, the other
//! quantity, and incidence angles and thicknesses outside the scene.
mod nodes;
mod training;
mod wavelengths;

use std::collections::BTreeMap;
use std::time::Instant;

use serde_json::json;
use thiserror::Error;

use crate::colour::{Colorimeter, ColourError};
use crate::compress::{
    Bands, Basis, Choice, CompactError, CompactFile, CompactVariant, CompressError, Compressed,
    Precision, compress,
};
use crate::engine::{Control, Engine, MaxError};
use crate::error_budget::{Certification, ERROR_BUDGET, ErrorBudget, ErrorBudgetError};
use crate::grid::{Compression, Grid, Run};
use crate::lookup::{Database, FormatError, LookupError};
use crate::measurement::Quantity;
use crate::parameter::Axes;
use crate::scene::Scene;
use training::{Nodes, Training};
use wavelengths::Wavelengths;

/// Metadata key of the scene for which a file was tailored; the value is TOML.
pub const SCENE: &str = "scene";
/// Metadata key of the interpolation between the file's wavelengths (`linear`).
pub const BETWEEN_WAVELENGTHS: &str = "between_wavelengths";
/// Shares of the bound for the interpolation, tried in this order.
const SHARES: [f64; 6] = [0.9, 0.75, 0.6, 0.45, 0.35, 0.25];
/// Share of the bound for the compression. Colour differences add in quadrature rather than
/// linearly.
const COMPRESSION: f64 = 0.45;
/// Share of the bound that the error budget must keep, so that other random points keep the
/// bound as well.
const CERTIFIED: f64 = 0.9;
/// Rays of a simulation: at a bound of 0.5, smallest and largest.
const RAYS: [f64; 3] = [16_384.0, 4096.0, 262_144.0];
/// Rays of a fresh simulation relative to those of the candidates.
pub(crate) const FRESH: u64 = 4;

/// The reason why no file could be made for the scene.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TailorError {
    /// A simulation or an error budget failed.
    #[error(transparent)]
    ErrorBudget(#[from] ErrorBudgetError),
    /// The wavelengths or illuminants of the scene are invalid for colours.
    #[error(transparent)]
    Colour(#[from] ColourError),
    /// The wavelengths of the scene do not determine a colour.
    #[error(
        "the scene's wavelengths do not determine a colour, so that max_delta_e cannot be checked; give some wavelengths between 400 and 700 nm"
    )]
    NoColour,
    /// The curves cannot be compressed.
    #[error(transparent)]
    Compress(#[from] CompressError),
    /// The compact file cannot be written.
    #[error(transparent)]
    Compact(#[from] CompactError),
    /// The compact file cannot be read back.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// A look-up in the file failed.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// No file found keeps the bound.
    #[error(
        "no database found keeps Delta-E {bound} with a margin of a tenth: the best reaches {reached:.3} at {at}; {}raise max_delta_e or narrow the scene", if *hurried { "max_seconds ran out; raise it, " } else { "" }
    )]
    Bound {
        /// The bound on Delta-E.
        bound: f64,
        /// The largest Delta-E of the best file found.
        reached: f64,
        /// The point of that difference.
        at: String,
        /// Whether the time limit `max_seconds` ran out.
        hurried: bool,
    },
    /// The smallest file found exceeds `max_bytes`.
    #[error(
        "the smallest database found within Delta-E {bound} takes {bytes} bytes, more than max_bytes = {most}; raise one of the two or narrow the scene"
    )]
    Bytes {
        /// The bound on Delta-E.
        bound: f64,
        /// Size of the smallest file found, bytes.
        bytes: usize,
        /// The limit `max_bytes`.
        most: u64,
    },
}

/// A compact file made for a scene.
#[derive(Debug)]
pub struct TailoredFile {
    /// The bytes of the compact file.
    pub bytes: Vec<u8>,
    /// The file read back.
    pub database: Database,
    /// The nodes of the file.
    pub axes: Axes,
    /// Number of candidates of each axis, in storage order.
    pub candidates: Vec<usize>,
    /// The compressed quantities.
    pub compressed: Vec<(Quantity, Compressed)>,
    /// The measured errors of the file.
    pub error_budget: ErrorBudget,
}

/// The grid with the grain laws, wavelengths and model of the scene; its axes have no values.
#[must_use]
pub fn grid(scene: &Scene) -> Grid {
    let parameters = scene.regions.iter().flat_map(|region| region.iter());
    Grid {
        axes: parameters.map(|(p, _)| (p, Vec::new())).collect(),
        views: None,
        size_axis: None,
        spread: scene.spread,
        wavelengths_nm: scene.wavelengths_nm.clone(),
        fixed: scene.fixed.clone(),
        run: Run {
            engine: Engine::Hybrid,
            seed: scene.seed,
            rays: rays(scene),
            max_error: MaxError::default_for(&scene.wavelengths_nm),
        },
        compression: compression(scene),
    }
}

/// Rays of the scene's simulations, chosen so that noise is a small part of the bound.
fn rays(scene: &Scene) -> u64 {
    let [usual, least, most] = RAYS;
    let rays = usual * (0.5 / scene.max_delta_e).powi(2);
    (rays.clamp(least, most) as u64).next_power_of_two()
}

/// The bounds of the compression.
fn compression(scene: &Scene) -> Compression {
    Compression {
        max_delta_e: COMPRESSION * scene.max_delta_e,
        max_rmse: None,
    }
}

/// Makes the smallest file for `scene`. `text` is the scene as TOML, which the file stores.
/// `points` random points certify the file. `say` is called with the current activity.
///
/// The result depends on the scene and `points` only, unless the time limit of the scene runs
/// out; then the refinement stops early.
///
/// # Errors
/// [`TailorError`] of any kind.
pub fn tailor(
    scene: &Scene,
    text: &str,
    points: usize,
    control: &Control,
    say: &dyn Fn(&str),
) -> Result<TailoredFile, TailorError> {
    let begin = Instant::now();
    let colour = Colorimeter::viewing(&scene.wavelengths_nm, &scene.viewing)?;
    let colour = colour.ok_or(TailorError::NoColour)?;
    let grid = grid(scene);
    say("simulating candidates");
    let rays = rays(scene);
    let training = Training::new(scene, &grid, &colour, rays, control)?;
    let in_time = || {
        let most = scene.max_seconds.unwrap_or(f64::INFINITY);
        begin.elapsed().as_secs_f64() < 0.5 * most
    };
    let mut best: Option<(f64, TailoredFile)> = None;
    for share in SHARES {
        let bound = share * scene.max_delta_e;
        let (nodes, _) = nodes::choose(&training, bound, &|nodes, score| {
            if control.cancel.load(std::sync::atomic::Ordering::Relaxed) {
                return Err(ErrorBudgetError::Cancelled.into());
            }
            let curves: usize = nodes.iter().map(Vec::len).product();
            say(&format!("{curves} nodes, Delta-E {:.3}", score.max));
            Ok(in_time())
        })?;
        say("compressing");
        let candidate = UncertifiedFile::new(scene, text, &training, &nodes)?;
        // If even the candidates exceed the bound, certification would fail.
        let score = training.score(&candidate.database)?;
        if score.max >= CERTIFIED * scene.max_delta_e && share > SHARES[SHARES.len() - 1] {
            continue;
        }
        say("certifying");
        let exact = training.exact(&nodes);
        let error_budget = Certification {
            grid: &grid,
            regions: &scene.regions,
            file: &candidate.database,
            exact: &exact,
            colour: Some(&colour),
            points,
            rays: FRESH * rays,
            seed: scene.seed,
        }
        .certify(control)?;
        let reached = max_delta_e(&error_budget);
        let tailored = candidate.certified(scene, text, &training, error_budget)?;
        if reached < CERTIFIED * scene.max_delta_e {
            let bytes = tailored.bytes.len();
            return match scene.max_bytes {
                Some(most) if bytes as u64 > most => Err(TailorError::Bytes {
                    bound: scene.max_delta_e,
                    bytes,
                    most,
                }),
                _ => Ok(tailored),
            };
        }
        if best.as_ref().is_none_or(|(least, _)| reached < *least) {
            best = Some((reached, tailored));
        }
        if !in_time() {
            break;
        }
    }
    let worst = best.and_then(|(reached, tailored)| {
        let quantities = tailored.error_budget.quantities.into_values();
        let worst = quantities.filter_map(|errors| errors.worst.into_iter().next());
        let worst = worst.max_by(|a, b| {
            a.delta_e
                .unwrap_or(0.0)
                .total_cmp(&b.delta_e.unwrap_or(0.0))
        });
        worst.map(|worst| (reached, worst.at))
    });
    let (reached, at) = worst.unwrap_or((f64::NAN, String::new()));
    Err(TailorError::Bound {
        bound: scene.max_delta_e,
        reached,
        at,
        hurried: !in_time(),
    })
}

/// The largest Delta-E of the whole chain in an error budget; 0 if there is none.
#[must_use]
pub fn max_delta_e(error_budget: &ErrorBudget) -> f64 {
    let quantities = error_budget.quantities.values();
    let largest = quantities.filter_map(|errors| Some(errors.total.delta_e?.max));
    largest.fold(0.0, f64::max)
}

/// A compact file before its certification.
struct UncertifiedFile {
    axes: Axes,
    compressed: Vec<(Quantity, Compressed)>,
    database: Database,
}

impl UncertifiedFile {
    /// Compresses the curves at `nodes`.
    fn new(
        scene: &Scene,
        text: &str,
        training: &Training,
        nodes: &Nodes,
    ) -> Result<Self, TailorError> {
        let Wavelengths { nm, colour, .. } = &training.wavelengths;
        let variant = CompactVariant {
            basis: Basis::Log,
            precision: Precision::Quantised,
        };
        let mut compressed = Vec::new();
        for &quantity in &scene.quantities {
            let curves = training.curves_of(nodes, quantity);
            let choice = Choice::Bounds(compression(scene));
            // The scene bounds the colour only; the error budget states the other errors.
            let none = Bands::default();
            let mut model = compress(
                curves.view(),
                quantity,
                Some(colour),
                &none,
                choice,
                variant,
            )?;
            // Only the chosen row of the error table is stored.
            model
                .table
                .rows
                .retain(|row| Some(row.components) == model.table.chosen);
            compressed.push((quantity, model));
        }
        let axes = training.axes_of(nodes);
        let bytes = file_bytes(scene, text, &axes, nm, &compressed, None)?;
        Ok(Self {
            database: Database::from_bytes(&bytes)?,
            axes,
            compressed,
        })
    }

    /// The file with its error budget.
    fn certified(
        self,
        scene: &Scene,
        text: &str,
        training: &Training,
        error_budget: ErrorBudget,
    ) -> Result<TailoredFile, TailorError> {
        let bytes = file_bytes(
            scene,
            text,
            &self.axes,
            &training.wavelengths.nm,
            &self.compressed,
            Some(&error_budget),
        )?;
        Ok(TailoredFile {
            database: Database::from_bytes(&bytes)?,
            bytes,
            axes: self.axes,
            candidates: training.axes.iter().map(Vec::len).collect(),
            compressed: self.compressed,
            error_budget,
        })
    }
}

/// The bytes of the compact file.
fn file_bytes(
    scene: &Scene,
    text: &str,
    axes: &Axes,
    wavelengths_nm: &[f64],
    compressed: &[(Quantity, Compressed)],
    error_budget: Option<&ErrorBudget>,
) -> Result<Vec<u8>, TailorError> {
    let compressed_of = |quantity| {
        compressed
            .iter()
            .find(|(q, _)| *q == quantity)
            .map(|(_, c)| c)
    };
    let mut extra = BTreeMap::from([
        (SCENE.to_owned(), text.to_owned()),
        (BETWEEN_WAVELENGTHS.to_owned(), "linear".to_owned()),
    ]);
    if let Some(error_budget) = error_budget {
        let json = serde_json::to_string(error_budget).map_err(CompactError::Header)?;
        extra.insert(ERROR_BUDGET.to_owned(), json);
    }
    let provenance = json!({
        "software": concat!("splitsnow ", env!("CARGO_PKG_VERSION")),
        "engine": Engine::Hybrid.name(),
        "seed": scene.seed,
        "rays": rays(scene),
    });
    let file = CompactFile {
        axes,
        absent: &[],
        substrate: grid(scene).substrate(),
        wavelengths_nm,
        transmittance: compressed_of(Quantity::Transmittance),
        reflectance: compressed_of(Quantity::Reflectance),
        provenance: &provenance.to_string(),
        extra: &extra,
    };
    Ok(file.to_bytes()?)
}
