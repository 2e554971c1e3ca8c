//! What was built, and how good it is.
use std::path::PathBuf;

use serde::{Serialize, Serializer};

use super::BuildError;
use crate::batch::Summary;
use crate::compress::{BandError, Compressed, ErrorTable, Largest, Statistics};
use crate::grid::Shard;
use crate::lookup::{Basis, Database, Precision};
use crate::store::Store;

/// What a build did.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct Report {
    /// Jobs of the database, or of the shard.
    pub jobs: u64,
    /// Jobs that had to be run now; the others were done before.
    pub jobs_run: u64,
    /// Spectra (of curves that exist) of the jobs run now.
    pub nodes: u64,
    /// Those that were taken over from other databases.
    pub nodes_reused: u64,
    /// Database and compact file; `None` of a shard.
    #[serde(flatten)]
    pub compact: Option<Compact>,
    /// What is to be known of a shard.
    #[serde(flatten)]
    pub share: Option<Share>,
}

/// A share of the jobs is done.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct Share {
    /// Which one.
    #[serde(serialize_with = "as_text")]
    pub shard: Shard,
    /// The database.
    pub database: PathBuf,
    /// Jobs of the whole database.
    pub database_jobs: u64,
    /// Those of them that are not done.
    pub jobs_left: usize,
    /// Rays of the share that count in no quantity.
    pub lost_share: Lost,
}

/// What a database and its compact file hold, and how good they are.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct Compact {
    /// The database.
    pub database: PathBuf,
    /// Its size.
    pub database_bytes: u64,
    /// Curves of either quantity.
    pub curves: u64,
    /// Those of them that do not exist.
    pub absent_curves: u64,
    /// Wavelengths of each.
    pub wavelengths: u64,
    /// The compact file.
    pub compact: PathBuf,
    /// Its size.
    pub compact_bytes: u64,
    /// What its components are of.
    #[serde(serialize_with = "basis_name")]
    pub basis: Basis,
    /// Numbers of its coefficients.
    #[serde(serialize_with = "precision_name")]
    pub precision: Precision,
    /// Transmittance, if the file has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transmittance: Option<QuantityReport>,
    /// Reflectance, if the file has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reflectance: Option<QuantityReport>,
    /// Rays of the database that count in no quantity.
    pub lost_share: Lost,
    /// A command that looks up the first curve.
    pub next: String,
    /// The same of the curves under isotropic light.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diffuse: Option<Box<Compact>>,
    /// Why some curves do not exist, in words.
    #[serde(skip)]
    pub why_absent: String,
}

/// One quantity; errors are the largest over all curves.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct QuantityReport {
    /// Components kept.
    pub components: usize,
    /// Bits of the coefficients of each.
    pub bits: Vec<u32>,
    /// Root mean square errors over the wavelengths.
    pub rmse: Option<Statistics>,
    /// Colour differences.
    pub delta_e: Option<Statistics>,
    /// Of the simulation.
    pub max_standard_error: f32,
    /// Errors by band.
    pub bands: Vec<BandError>,
    /// The largest of any curve at any wavelength.
    pub largest: Option<LargestError>,
    /// Errors with other numbers of components.
    pub error_table: ErrorTable,
}

/// The largest error of any curve at any wavelength, and the node of the curve.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct LargestError {
    /// The error.
    #[serde(flatten)]
    pub largest: Largest,
    /// The node.
    pub at: String,
}

/// Share of the rays that hit an event limit and count in no quantity, of the worst
/// curve and wavelength of each job.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Lost {
    /// Mean over the jobs.
    pub mean: f64,
    /// The largest.
    pub max: f64,
}

fn as_text<S: Serializer>(value: &Shard, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(value)
}

fn basis_name<S: Serializer>(basis: &Basis, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(basis.name())
}

fn precision_name<S: Serializer>(precision: &Precision, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(precision.name())
}

impl Report {
    pub(super) fn new(done: &Summary, compact: Option<Compact>, share: Option<Share>) -> Self {
        Self {
            jobs: done.jobs,
            jobs_run: done.run,
            nodes: done.nodes,
            nodes_reused: done.reused,
            compact,
            share,
        }
    }
}

impl Share {
    pub(super) fn of(shard: Shard, store: &Store, done: &Summary) -> Result<Self, BuildError> {
        Ok(Self {
            shard,
            database: store.path().into(),
            database_jobs: store.jobs().count(),
            jobs_left: store.missing(None)?.len(),
            lost_share: Lost {
                mean: done.mean_lost_share,
                max: done.max_lost_share,
            },
        })
    }
}

impl QuantityReport {
    /// `database` is the file that it was written to.
    pub(super) fn new(
        database: &Database,
        max_standard_error: f32,
        compressed: Compressed,
    ) -> Self {
        let row = compressed.errors().copied();
        let bands = compressed.band_errors();
        let larger = |a: Largest, b: Largest| if b.error > a.error { b } else { a };
        let largest = bands.iter().map(|band| band.largest).reduce(larger);
        let at = |row| {
            let point = database.point(row);
            point.map_or(String::new(), |point| point.to_string())
        };
        Self {
            components: compressed.components(),
            bits: compressed.coefficients.bits(),
            rmse: row.map(|row| row.rmse),
            delta_e: row.and_then(|row| row.delta_e),
            max_standard_error,
            bands,
            largest: largest.map(|largest| LargestError {
                at: at(largest.curve),
                largest,
            }),
            error_table: compressed.table,
        }
    }
}

impl Lost {
    /// Of all jobs of `store`.
    pub(super) fn of(store: &Store) -> Result<Self, BuildError> {
        let count = store.jobs().count();
        let (mut sum, mut max) = (0.0, 0.0_f64);
        for job in 0..count {
            let share = store.lost_share(job)?;
            sum += share;
            max = max.max(share);
        }
        Ok(Self {
            mean: sum / count as f64,
            max,
        })
    }
}
