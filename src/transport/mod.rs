//! The snow sample and the walk of one ray through it (MODEL section 2).
mod sample;
mod walk;

pub use sample::{Entry, Illumination, Model, Snow};
pub use walk::{Absorption, End, Path, REJECTION_LIMIT, Sink, WalkError, Walker};
