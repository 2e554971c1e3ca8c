//! Experiments with the model, and their pictures; with the feature `charts`.
//!
//! | module | what lives there |
//! |---|---|
//! | [`tradeoff`] | speed against accuracy of the engines |
//! | [`study`] | the variants of a sample that a study file asks for |
//! | [`report`] | charts and tables of both, of a comparison with a measured spectrum; patches of colour |
pub mod report;
pub mod study;
pub mod tradeoff;
