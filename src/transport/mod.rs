//! The snow sample and the walk of one ray through it (MODEL section 2).
mod sample;

pub use sample::{Entry, Illumination, Model, Snow};
