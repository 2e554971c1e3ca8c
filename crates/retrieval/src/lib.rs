//! From measured spectra to the snow: the numerical part.
//!
//! An [`Emulator`] gives spectra at any point of a compact file. [`Unknown`]s are parameters of
//! the snow with a prior, [`Observation`]s are measured spectra whose noise is whitened by the
//! Cholesky factor of its covariance ([`Whitening`]). Together they are an [`Inverse`] problem:
//! its most probable point ([`Inverse::best`]), what the data determine ([`Information`]) and
//! the distribution of the unknowns ([`Posterior`]).
//!
//! Unknowns are computed with as places `u` in 0 to 1 of their range, see [`Unknown`].
mod emulator;
mod information;
mod inverse;
mod noise;
mod optimum;
mod posterior;
mod sampler;
mod unknown;

pub use emulator::Emulator;
pub use information::Information;
pub use inverse::{Inverse, Observation, Scratch};
pub use noise::{NoiseModel, Whitening};
pub use optimum::{Optimum, StartTable};
pub use posterior::{CredibleInterval, Posterior, PosteriorMethod};
pub use unknown::{Prior, Unknown};
