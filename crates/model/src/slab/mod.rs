//! Transport between points in homogeneous plane-parallel slabs: azimuth-averaged
//! discrete ordinates in closed form.
//!
//! # Equations
//!
//! Radiance I+ goes down and I- up along cosines mu_i with weights w_i (Gauss on
//! each hemisphere, Sykes 1951). With sums s = sqrt(w mu) (I+ + I-), differences
//! d = sqrt(w mu) (I+ - I-) and the moments chi_l of albedo times phase function
//! the transport equation over optical depth t is
//!
//! ```text
//! d' = -A s,  A = m (1 - sum over even l of chi_l p_l p_l^T) m,  m = diag(mu)^-1/2
//! s' = -B d,  B = m (1 - sum over odd  l of chi_l p_l p_l^T) m,  p_l = sqrt((2 l + 1) w) P_l(mu)
//! ```
//!
//! A and B are symmetric and positive (Nakajima and Tanaka 1986; Stamnes et al.
//! 1988), so B A has eigenvalues k^2 >= 0. In a slab of thickness 2 h lit alike
//! from both sides, d = P s at the upper plane; lit with opposite signs s = Q d:
//!
//! ```text
//! P = A f(B A),  Q = B f(A B),  f(k^2) = tanh(k h) / k
//! R + T = (1 - P)(1 + P)^-1,  T - R = (1 - Q)(1 + Q)^-1
//! T = (1 + P)^-1 (1 - P Q)(1 + Q)^-1,  1 - P Q = g(A B),  g(k^2) = 1 / cosh(k h)^2
//! ```
//!
//! f and g are entire functions of k^2, so albedo 1 (k = 0) is no exception; no
//! exponential grows; and the last line has no difference of large numbers:
//! T keeps its relative accuracy down to 1e-300, below which it is 0. Nothing is
//! doubled.
//!
//! # Modes
//!
//! B = L L^T and A = N N^T by Cholesky. The singular values of N^T L = U k V^T
//! are the rates k, and with Z = L V, Y = L^-T V
//!
//! ```text
//! A = Y k^2 Y^T,  B = Z Z^T,  Y^T Z = 1,  (1 + P)^-1 Y = Z (Z^T Z + k tanh(k h))^-1,
//! (1 + Q)^-1 = Y (Y^T Y + tanh(k h) / k)^-1 Y^T
//! ```
//!
//! The slowest rate decides how deep light goes and is about
//! sqrt(3 (1 - chi_0)(1 - chi_1)). To keep its digits, N is taken in a basis
//! that begins with sqrt(w): there A's middle factor is 1 - chi_0 and a block
//! that does not know it, the first row of N^T L has the factor
//! sqrt(1 - chi_0), and one-sided Jacobi rotations find singular values of such
//! graded matrices to full relative accuracy (Demmel and Veselic 1992).
//!
//! # Beams
//!
//! Parallel light along any mu_0 is one more stream of weight 0, fed by no other.
//! A and B become block-triangular and their functions have, beside those of the
//! modes, the divided differences of f and g over k^2 and 1/mu_0^2, which are
//! evaluated without a singularity at k mu_0 = 1.
//!
//! # Accuracy
//!
//! R has an absolute error of some 1e-14; T one of some 1e-12 relative to its
//! largest entries, so entries that are smaller than those by many orders (deep
//! in a medium that hardly scatters) may be rounding of either sign. Energy is
//! conserved to 1e-12 up to 32 streams, 1e-10 with 64. Fluxes converge about as
//! n^-6. A phase function whose first 2n moments do not make it positive may
//! give negative entries too: that is the truncation, which delta-M lessens.
//! All operations are rounded one by one: results are the same to the bit on
//! every machine.
//!
//! Sources: Chandrasekhar, Radiative Transfer, 1960; Sykes, MNRAS 111, 377, 1951;
//! Wiscombe, J. Atmos. Sci. 34, 1408, 1977; Nakajima and Tanaka, JQSRT 35, 13,
//! 1986; Stamnes, Tsay, Wiscombe and Jayaweera, Appl. Opt. 27, 2502, 1988; Demmel
//! and Veselic, SIAM J. Matrix Anal. Appl. 13, 1204, 1992.
mod fluxes;
mod matrix;
mod medium;
mod modes;
mod solve;
mod streams;

pub use fluxes::{Fluxes, Light};
pub use matrix::Matrix;
pub use medium::{Medium, Operators};
pub use streams::Streams;

use thiserror::Error;

/// Why a slab cannot be solved.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum SlabError {
    /// Too few or too many streams.
    #[error("{n} streams per hemisphere; 2 to {max} are possible", max = Streams::MAX)]
    Streams {
        /// How many were asked for.
        n: usize,
    },
    /// No phase function has this moment.
    #[error("Legendre moment {l} is {value}; the 0th is an albedo, 0 to 1, and no other is larger")]
    Moment {
        /// Its degree.
        l: usize,
        /// What was given.
        value: f64,
    },
    /// With so few streams forward and backward peaks would emit more than they get.
    #[error("the phase function has too narrow a peak for the streams; take more or use delta-M")]
    Peaked,
    /// Not a thickness.
    #[error("optical thickness {value}; 0 or more is possible")]
    Thickness {
        /// What was given.
        value: f64,
    },
    /// Not the cosine of light from above.
    #[error("cosine {value} of the angle of incidence; above 0 to 1 is possible")]
    Cosine {
        /// What was given.
        value: f64,
    },
    /// No unique solution of linear equations.
    #[error("a matrix has no inverse")]
    Singular,
}
