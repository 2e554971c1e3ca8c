//! The snow pack and the walk of one ray through it (docs/methods.md).
mod pack;
mod proposal;
mod report;
mod sample;
mod walk;

pub use pack::{EXPONENTS, Ground, Joining, Layer, Pack, impurities_per_m};
pub use proposal::contact;
pub use report::{Absorption, Coefficients, End, Path, Sink};
pub use sample::{Component, Entry, FIRST_FLIGHT, Illumination, Model, Snow, diffuse_cosine};
pub use walk::{Bounce, EVENT_LIMIT, REJECTION_LIMIT, Walk, WalkError, Walker};
