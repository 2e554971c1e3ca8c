//! The snow sample and the walk of one ray through it (docs/methods.md).
mod proposal;
mod report;
mod sample;
mod walk;

pub use proposal::contact;
pub use report::{Absorption, End, Path, Sink};
pub use sample::{Entry, FIRST_FLIGHT, Illumination, Model, Snow, diffuse_cosine};
pub use walk::{EVENT_LIMIT, REJECTION_LIMIT, Walk, WalkError, Walker};
