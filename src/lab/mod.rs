//! Experiments with the model and their pictures; requires the feature `charts`.
//!
//! | module | contents |
//! |---|---|
//! | [`tradeoff`] | speed against accuracy of the engines |
//! | [`study`] | the variants of a sample that a study file lists |
//! | [`report`] | charts and tables of both, and of a comparison with a measured spectrum; patches of colour |
pub mod report;
pub mod study;
pub mod tradeoff;
