//! `tailor`: the smallest database that answers what a scene asks within its bound
//! on the colour difference of the whole chain (docs/methods.md).
//!
//! 1. All nodes that it might have are simulated (`training`), with walks enough
//!    that noise is a small part of the bound.
//! 2. Of the scene's wavelengths those are chosen (`wavelengths`) between which
//!    straight lines do for a small share of the bound.
//! 3. Nodes are chosen (`nodes`) until the look-up gives every other candidate
//!    within a share of the bound, the rest of which is for the compression.
//! 4. The curves are compressed: components of y = -ln T, as few, and quantised as
//!    coarsely, as the rest of the bound allows.
//! 5. The file is certified: random points, fresh simulations with other random
//!    numbers and more walks. If it fails, all begins again at 3 with a smaller share.
//!
//! What a scene does not ask for is left out: axes of one value, the other
//! quantity, angles and thicknesses that do not occur.
mod nodes;
mod training;
mod wavelengths;

use std::collections::BTreeMap;
use std::time::Instant;

use serde_json::json;
use thiserror::Error;

use crate::colour::{Colorimeter, ColourError};
use crate::compress::{
    Bands, Basis, Choice, CompactError, CompactFile, CompressError, Compressed, Precision, Variant,
    compress,
};
use crate::engine::{Control, Engine, MaxError};
use crate::error_budget::{ERROR_BUDGET, ErrorBudget, ErrorBudgetError, Subject};
use crate::grid::{Compression, Grid, Run};
use crate::lookup::{Database, FormatError, LookupError};
use crate::measurement::Quantity;
use crate::parameter::Axes;
use crate::scene::Scene;
use training::{Nodes, Training};
use wavelengths::Wavelengths;

/// Metadata key of the scene that a file was tailored to, as TOML.
pub const SCENE: &str = "scene";
/// Metadata key that says what a spectrum is between the file's wavelengths.
pub const BETWEEN_WAVELENGTHS: &str = "between_wavelengths";
/// Shares of the bound for the interpolation, tried one after another.
const SHARES: [f64; 6] = [0.9, 0.75, 0.6, 0.45, 0.35, 0.25];
/// Share of the bound for the compression: differences add up like
/// perpendiculars more than like lengths.
const COMPRESSION: f64 = 0.45;
/// Share of the bound that the error budget must keep, so that other random
/// points keep the bound.
const CERTIFIED: f64 = 0.9;
/// Walks of a simulation at a bound of 0.5, and the least and most.
const RAYS: [f64; 3] = [65_536.0, 16_384.0, 1_048_576.0];
/// Walks of a fresh one, in those.
pub(crate) const FRESH: u64 = 4;

/// Why no database could be made for the scene.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TailorError {
    /// A simulation or an error budget failed.
    #[error(transparent)]
    ErrorBudget(#[from] ErrorBudgetError),
    /// Its wavelengths have no colour.
    #[error(transparent)]
    Colour(#[from] ColourError),
    /// They have none at all.
    #[error(
        "the scene's wavelengths have no colour, so that no bound on it holds; give some between 400 and 700 nm"
    )]
    NoColour,
    /// The curves cannot be compressed.
    #[error(transparent)]
    Compress(#[from] CompressError),
    /// The file cannot be made.
    #[error(transparent)]
    Compact(#[from] CompactError),
    /// The file made cannot be read.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The file made does not answer.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// No database holds the bound.
    #[error(
        "no database was found that keeps Delta-E {bound} with a tenth to spare: the best reaches {reached:.3} at {at}; {}raise max_delta_e or narrow the scene", if *hurried { "max_seconds ran out; raise it, " } else { "" }
    )]
    Bound {
        /// The bound.
        bound: f64,
        /// The largest difference of the best.
        reached: f64,
        /// Where that is.
        at: String,
        /// Whether the time allowed ran out.
        hurried: bool,
    },
    /// It is too large.
    #[error(
        "the smallest database found within Delta-E {bound} takes {bytes} bytes, more than max_bytes = {most}; raise one of the two or narrow the scene"
    )]
    Bytes {
        /// The bound.
        bound: f64,
        /// Bytes of the smallest.
        bytes: usize,
        /// What is allowed.
        most: u64,
    },
}

/// A tailored database.
#[derive(Debug)]
pub struct TailoredFile {
    /// The compact file.
    pub bytes: Vec<u8>,
    /// The same, read.
    pub database: Database,
    /// Its nodes.
    pub axes: Axes,
    /// Candidates per axis, in storage order.
    pub candidates: Vec<usize>,
    /// Compressed quantities.
    pub compressed: Vec<(Quantity, Compressed)>,
    /// What it is good for.
    pub error_budget: ErrorBudget,
}

/// The grid whose laws, wavelengths and model the scene's snow has; its axes have no values.
#[must_use]
pub fn grid(scene: &Scene) -> Grid {
    let parameters = scene.regions.iter().flat_map(|region| region.iter());
    Grid {
        axes: parameters.map(|(p, _)| (p, Vec::new())).collect(),
        given_sizes: None,
        spread: scene.spread,
        wavelengths_nm: scene.wavelengths_nm.clone(),
        fixed: scene.fixed.clone(),
        run: Run {
            engine: Engine::Hybrid,
            seed: scene.seed,
            rays: rays(scene),
            max_error: MaxError::usual(&scene.wavelengths_nm),
        },
        compression: compression(scene),
    }
}

/// Walks of the scene's simulations: their noise is to be a small part of the bound.
fn rays(scene: &Scene) -> u64 {
    let [usual, least, most] = RAYS;
    let rays = usual * (0.5 / scene.max_delta_e).powi(2);
    (rays.clamp(least, most) as u64).next_power_of_two()
}

fn compression(scene: &Scene) -> Compression {
    Compression {
        max_delta_e: COMPRESSION * scene.max_delta_e,
        max_rmse: None,
    }
}

/// Fits a database to `scene`; `text` is the scene as TOML, which the file
/// keeps. `points` random points certify it; `say` is told what is being done.
///
/// Depends on the scene and `points` alone, unless the scene has a time budget that
/// runs out: then refinement stops early.
///
/// # Errors
/// See [`TailorError`].
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
        let (nodes, _) = nodes::choose(&training, bound, &|nodes, judgement| {
            if control.cancel.load(std::sync::atomic::Ordering::Relaxed) {
                return Err(ErrorBudgetError::Cancelled.into());
            }
            let curves: usize = nodes.iter().map(Vec::len).product();
            say(&format!("{curves} nodes, Delta-E {:.3}", judgement.max));
            Ok(in_time())
        })?;
        say("compressing");
        let made = Made::new(scene, text, &training, &nodes)?;
        // not worth an error budget if not even the candidates are answered
        let judgement = training.judge(&made.database)?;
        if judgement.max >= CERTIFIED * scene.max_delta_e && share > SHARES[SHARES.len() - 1] {
            continue;
        }
        say("certifying");
        let exact = training.exact(&nodes);
        let error_budget = Subject {
            grid: &grid,
            regions: &scene.regions,
            file: &made.database,
            exact: &exact,
            colour: Some(&colour),
            points,
            rays: FRESH * rays,
            seed: scene.seed,
        }
        .certify(control)?;
        let reached = largest(&error_budget);
        let tailored = made.certified(scene, text, &training, error_budget)?;
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
        let chains = tailored.error_budget.quantities.into_values();
        let worst = chains.filter_map(|chain| chain.worst.into_iter().next());
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

/// The largest colour difference that an error budget found.
#[must_use]
pub fn largest(error_budget: &ErrorBudget) -> f64 {
    let chains = error_budget.quantities.values();
    let largest = chains.filter_map(|chain| Some(chain.total.delta_e?.max));
    largest.fold(0.0, f64::max)
}

/// A database not yet certified.
struct Made {
    axes: Axes,
    compressed: Vec<(Quantity, Compressed)>,
    database: Database,
}

impl Made {
    fn new(
        scene: &Scene,
        text: &str,
        training: &Training,
        nodes: &Nodes,
    ) -> Result<Self, TailorError> {
        let Wavelengths { nm, colour, .. } = &training.wavelengths;
        let variant = Variant {
            basis: Basis::Log,
            precision: Precision::Quantised,
        };
        let mut compressed = Vec::new();
        for &quantity in &scene.quantities {
            let curves = training.curves_of(nodes, quantity);
            let choice = Choice::Bounds(compression(scene));
            // What a scene bounds is the colour; the error budget says the rest.
            let none = Bands::default();
            let mut one = compress(
                curves.view(),
                quantity,
                Some(colour),
                &none,
                choice,
                variant,
            )?;
            // the errors of other numbers of components are of no use to a scene
            one.table
                .rows
                .retain(|row| Some(row.components) == one.table.chosen);
            compressed.push((quantity, one));
        }
        let axes = training.axes_of(nodes);
        let bytes = bytes(scene, text, &axes, nm, &compressed, None)?;
        Ok(Self {
            database: Database::from_bytes(&bytes)?,
            axes,
            compressed,
        })
    }

    fn certified(
        self,
        scene: &Scene,
        text: &str,
        training: &Training,
        error_budget: ErrorBudget,
    ) -> Result<TailoredFile, TailorError> {
        let bytes = bytes(
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

/// The compact file.
fn bytes(
    scene: &Scene,
    text: &str,
    axes: &Axes,
    wavelengths_nm: &[f64],
    compressed: &[(Quantity, Compressed)],
    error_budget: Option<&ErrorBudget>,
) -> Result<Vec<u8>, TailorError> {
    let of = |quantity| {
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
        transmittance: of(Quantity::Transmittance),
        reflectance: of(Quantity::Reflectance),
        provenance: &provenance.to_string(),
        extra: &extra,
    };
    Ok(file.to_bytes()?)
}
