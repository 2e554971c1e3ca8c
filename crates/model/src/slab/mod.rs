//! Transport between point scatterers in homogeneous plane-parallel slabs:
//! azimuth-averaged discrete ordinates in closed form.
//!
//! # Equations
//!
//! Radiance I+ goes down and I- goes up, along cosines mu_i with weights w_i (Gauss
//! quadrature on each hemisphere, Sykes 1951). Let s = sqrt(w mu) (I+ + I-) be the sums,
//! d = sqrt(w mu) (I+ - I-) the differences and chi_l the moments of albedo times phase
//! function. Then the transport equation over optical depth t is
//!
//! ```text
//! d' = -A s,  A = m (1 - sum over even l of chi_l p_l p_l^T) m,  m = diag(mu)^-1/2
//! s' = -B d,  B = m (1 - sum over odd  l of chi_l p_l p_l^T) m,  p_l = sqrt((2 l + 1) w) P_l(mu)
//! ```
//!
//! A and B are symmetric and positive (Nakajima and Tanaka 1986; Stamnes et al. 1988), so
//! B A has eigenvalues k^2 >= 0. Consider a slab of thickness 2 h. If it is illuminated
//! equally from both sides, d = P s at the upper plane; with opposite signs, s = Q d:
//!
//! ```text
//! P = A f(B A),  Q = B f(A B),  f(k^2) = tanh(k h) / k
//! R + T = (1 - P)(1 + P)^-1,  T - R = (1 - Q)(1 + Q)^-1
//! T = (1 + P)^-1 (1 - P Q)(1 + Q)^-1,  1 - P Q = g(A B),  g(k^2) = 1 / cosh(k h)^2
//! ```
//!
//! f and g are entire functions of k^2, so albedo 1 (k = 0) needs no special case, and no
//! exponential grows. The last line has no difference of large numbers: T keeps its
//! relative accuracy down to 1e-300, below which it is 0. No doubling is used.
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
//! The smallest rate determines how deep light penetrates. It is about
//! sqrt(3 (1 - chi_0)(1 - chi_1)). To preserve its relative accuracy, N is computed in a
//! basis that begins with sqrt(w). In this basis the middle factor of A consists of
//! 1 - chi_0 and a block independent of chi_0, so the first row of N^T L has the factor
//! sqrt(1 - chi_0). One-sided Jacobi rotations find the singular values of such graded
//! matrices to full relative accuracy (Demmel and Veselic 1992).
//!
//! # Beams
//!
//! A collimated beam along any mu_0 is an additional stream of weight 0 that receives no
//! light from the others. A and B become block-triangular. Besides the functions of the
//! modes, the divided differences of f and g over k^2 and 1/mu_0^2 appear. They are
//! evaluated without a singularity at k mu_0 = 1.
//!
//! # Accuracy
//!
//! R has an absolute error of about 1e-14. T has an error of about 1e-12 relative to its
//! largest entries, so entries smaller by many orders (deep in a medium that hardly
//! scatters) may be rounding errors of either sign. Energy is conserved to 1e-12 with up
//! to 32 streams and to 1e-10 with 64. Fluxes converge about as n^-6. A phase function
//! that its first 2n moments do not make positive may also give negative entries; this is
//! truncation error, which delta-M reduces. All operations are rounded individually, so
//! results are bitwise identical on all machines.
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
        /// The number requested.
        n: usize,
    },
    /// No phase function has this moment.
    #[error("Legendre moment {l} is {value}; the 0th is an albedo, 0 to 1, and no other is larger")]
    Moment {
        /// Degree of the moment.
        l: usize,
        /// The value given.
        value: f64,
    },
    /// With so few streams, forward and backward peaks would emit more than they receive.
    #[error("the phase function has too narrow a peak for the streams; take more or use delta-M")]
    Peaked,
    /// The optical thickness is negative or NaN.
    #[error("optical thickness {value}; 0 or more is possible")]
    Thickness {
        /// The value given.
        value: f64,
    },
    /// The cosine of the incidence angle is out of range.
    #[error("cosine {value} of the angle of incidence; above 0 to 1 is possible")]
    Cosine {
        /// The value given.
        value: f64,
    },
    /// Linear equations have no unique solution.
    #[error("a matrix has no inverse")]
    Singular,
}
