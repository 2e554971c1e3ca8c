//! Three-vectors and the elementary functions of the walk. The functions are implemented
//! here because those of the platforms differ in the last bit, which would change the
//! bytes of a database, and because these can be vectorised.
mod lanes;
mod legendre;
mod real;
mod vec3;

pub(crate) use lanes::set_lanes;
pub use lanes::{Vec3x8, sincos_eighth};
pub(crate) use legendre::legendre_lanes;
pub use legendre::{DEGREES, legendre};
pub use real::Real;
pub use splitsnow_spectra::elementary::{exp_neg, ln};
pub use vec3::Vec3;
