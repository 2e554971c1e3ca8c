//! Grain events from tables. Outcomes are drawn once by following rays through grains
//! ([`draw`]). A [`PackedTable`] is a stratified selection of outcomes. [`TableWalker`] and
//! [`EscapeWalker`] take their grain events from it.
mod boundary;
mod escape;
mod follow;
mod histogram;
mod kernel;
mod lattice;
mod outcome;
mod packed;
mod population;
mod rays;
mod slab;
mod snowpack;
mod step;

pub use boundary::{BoundaryRegion, Edge, Scores, Source};
pub use escape::{EscapeBand, EscapeSink, EscapeTable, EscapeWalker};
pub use histogram::Histogram;
pub use kernel::{Event, Kernel};
pub use outcome::{Outcome, draw, draw_reflected};
pub use packed::PackedTable;
pub use slab::TableWalker;
pub use snowpack::{TableLayer, TableSnowpack};
