//! SPLITSnow's model of light in snow: a ray walks from one stochastic ice grain to the
//! next (Varsa, PhD thesis, University of Waterloo, 2025).
//!
//! Modules, lower ones first. A lower module never uses a higher one.
//!
//! | module | contents |
//! |---|---|
//! | [`math`], [`rng`] | vectors, deterministic elementary functions, random streams |
//! | [`optics`] | refractive indices, carbon, Fresnel and Snell |
//! | [`grain`] | laws of grain size and shape, the event on one grain, mean free distance |
//! | [`transport`] | the snow sample and the walk of one ray through it |
//! | [`table`] | precomputed outcomes of grain events, and walks that use them |
//! | [`slab`] | radiative transfer in homogeneous slabs of point scatterers by discrete ordinates |
//! | [`measurement`] | reflectance and transmittance with standard errors; sensors and radii |
//! | [`engine`] | engines: different ways of computing the same physics |
pub mod engine;
pub mod grain;
pub mod math;
pub mod measurement;
pub mod optics;
pub mod rng;
pub mod slab;
pub mod table;
pub mod transport;
