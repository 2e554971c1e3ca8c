//! Three-vectors and the elementary functions of the walk. The functions are
//! our own because the platform's differ between machines in the last bit,
//! which would change a database's bytes, and because these vectorise.
mod lanes;
mod legendre;
mod real;
mod vec3;

pub use lanes::{Vec3x8, sincos_eighth};
pub use legendre::{DEGREES, legendre};
pub use real::Real;
pub use splitsnow_spectra::elementary::{exp_neg, ln};
pub use vec3::Vec3;
