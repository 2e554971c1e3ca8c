//! The snowpack and the walk of one ray through it (docs/methods.md).
mod planes;
mod proposal;
mod report;
mod sample;
mod snowpack;
mod tracers;
mod walk;

pub use planes::{CROSSING_SCORES, Crossing, Leg, PlaneFluxes, Planes};
pub use proposal::{contact, meets};
pub use report::{Absorption, Coefficients, End, Path, Sink};
pub use sample::{Component, Entry, FIRST_FLIGHT, Illumination, Model, Snow, diffuse_cosine};
pub use snowpack::{Joining, Layer, Snowpack, Substrate};
pub use tracers::{TRACERS, Tracers};
pub use walk::{Bounce, EVENT_LIMIT, REJECTION_LIMIT, Walk, WalkError, Walker};
