//! Reports on a build and on the errors of its compact file.
use std::path::PathBuf;

use serde::{Serialize, Serializer};

use super::BuildError;
use crate::batch::BatchSummary;
use crate::compress::{BandError, Compressed, ErrorStatistics, ErrorTable, MaxAbsError};
use crate::engine::TableCounts;
use crate::grid::Shard;
use crate::lookup::{Basis, Database, Precision};
use crate::store::Store;

/// Report on a build.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct BuildReport {
    /// Number of jobs of the database or of the shard.
    pub jobs: u64,
    /// Number of jobs run now; the others were done before.
    pub jobs_run: u64,
    /// Number of spectra, of curves that exist, in the jobs run now.
    pub nodes: u64,
    /// Number of these spectra that were reused from other databases.
    pub nodes_reused: u64,
    /// Number of parts of tables of grain events that were drawn or read now.
    pub table_parts: TableCounts,
    /// Why tables could not be shared with other processes; `None` if they could.
    #[serde(skip)]
    pub unshared_tables: Option<String>,
    /// Report on database and compact file; `None` for a shard.
    #[serde(flatten)]
    pub compact: Option<CompactReport>,
    /// Report on the shard; `None` if the build had none.
    #[serde(flatten)]
    pub share: Option<ShardReport>,
}

/// Report on a finished shard.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct ShardReport {
    /// The shard.
    #[serde(serialize_with = "as_text")]
    pub shard: Shard,
    /// Path of the database.
    pub database: PathBuf,
    /// Number of jobs of the whole database.
    pub database_jobs: u64,
    /// Number of jobs of the whole database that are not done.
    pub jobs_left: usize,
    /// Share of lost rays in the jobs of the shard.
    pub lost_share: LostShare,
}

/// Report on a database and its compact file, with the errors of the compression.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct CompactReport {
    /// Path of the database.
    pub database: PathBuf,
    /// Estimated size of the database, bytes.
    pub database_bytes: u64,
    /// Number of curves of each quantity, including those that do not exist.
    pub curves: u64,
    /// Number of curves that do not exist.
    pub absent_curves: u64,
    /// Number of wavelengths.
    pub wavelengths: u64,
    /// Path of the compact file.
    pub compact: PathBuf,
    /// Size of the compact file, bytes.
    pub compact_bytes: u64,
    /// Basis of the components.
    #[serde(serialize_with = "basis_name")]
    pub basis: Basis,
    /// Number format of the coefficients.
    #[serde(serialize_with = "precision_name")]
    pub precision: Precision,
    /// Report on the transmittance, if the file has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transmittance: Option<QuantityReport>,
    /// Report on the reflectance, if the file has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reflectance: Option<QuantityReport>,
    /// Share of lost rays in the database.
    pub lost_share: LostShare,
    /// A command that looks up the first curve.
    pub next: String,
    /// Report on the curves under diffuse light and their compact file, if there are any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diffuse: Option<Box<CompactReport>>,
    /// Report on the anisotropy factors toward views and their compact file, if there are any.
    /// Its `transmittance` and `reflectance` are the factors of transmitted and reflected light.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub views: Option<Box<CompactReport>>,
    /// Message that says why some curves do not exist.
    #[serde(skip)]
    pub why_absent: String,
}

/// Errors of the compression of one quantity.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct QuantityReport {
    /// Number of components kept.
    pub components: usize,
    /// Bits per coefficient of each component.
    pub bits: Vec<u32>,
    /// Statistics over the curves of the root-mean-square error over the wavelengths.
    pub rmse: Option<ErrorStatistics>,
    /// Statistics over the curves of the colour difference.
    pub delta_e: Option<ErrorStatistics>,
    /// Largest standard error of the simulation.
    pub max_standard_error: f32,
    /// Errors in each wavelength band.
    pub bands: Vec<BandError>,
    /// Largest error of any curve at any wavelength.
    pub largest: Option<LargestError>,
    /// Errors with other numbers of components.
    pub error_table: ErrorTable,
}

/// The largest error of any curve at any wavelength, with the node of the curve.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct LargestError {
    /// The error, with its curve and wavelength.
    #[serde(flatten)]
    pub largest: MaxAbsError,
    /// Parameters of the node.
    pub at: String,
}

/// Share of lost rays, 0 to 1: rays that hit an event limit and count neither as reflected
/// nor as transmitted. Of each job, the curve and wavelength with the largest share counts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LostShare {
    /// Mean over the jobs.
    pub mean: f64,
    /// Maximum over the jobs.
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

impl BuildReport {
    pub(super) fn new(
        summary: &BatchSummary,
        compact: Option<CompactReport>,
        share: Option<ShardReport>,
    ) -> Self {
        Self {
            jobs: summary.jobs,
            jobs_run: summary.run,
            nodes: summary.nodes,
            nodes_reused: summary.reused,
            table_parts: summary.tables,
            unshared_tables: summary.unshared.clone(),
            compact,
            share,
        }
    }
}

impl ShardReport {
    pub(super) fn of(
        shard: Shard,
        store: &Store,
        summary: &BatchSummary,
    ) -> Result<Self, BuildError> {
        Ok(Self {
            shard,
            database: store.path().into(),
            database_jobs: store.jobs().count(),
            jobs_left: store.unmarked()?.len(),
            lost_share: LostShare {
                mean: summary.mean_lost_share,
                max: summary.max_lost_share,
            },
        })
    }
}

impl QuantityReport {
    /// The report on `compressed`; `database` is the compact file that it was written to.
    pub(super) fn new(
        database: &Database,
        max_standard_error: f32,
        compressed: Compressed,
    ) -> Self {
        let row = compressed.errors().copied();
        let bands = compressed.band_errors();
        let larger = |a: MaxAbsError, b: MaxAbsError| if b.error > a.error { b } else { a };
        let largest = bands.iter().map(|band| band.largest).reduce(larger);
        let node = |row| {
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
                at: node(largest.curve),
                largest,
            }),
            error_table: compressed.table,
        }
    }
}

impl LostShare {
    /// The share of lost rays over all jobs of `store`.
    pub(super) fn of(store: &Store) -> Result<Self, BuildError> {
        let count = store.jobs().count();
        let (mut sum, mut max) = (0.0, 0.0_f64);
        for share in store.lost_shares(0..count)? {
            sum += share;
            max = max.max(share);
        }
        Ok(Self {
            mean: sum / count as f64,
            max,
        })
    }
}
