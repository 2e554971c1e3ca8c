//! Random numbers one at a time, drawn eight at a time.
use splitsnow_spectra::simd::{F64x8, Simd};

use crate::math::ln;
use crate::rng::Stream;

/// Hands out random numbers one at a time.
pub(super) struct Supply<S: Simd> {
    rng: Stream<S>,
    uniforms: [f64; 8],
    exponentials: [f64; 8],
    azimuths: [[f64; 8]; 2],
    left: [usize; 3],
}

impl<S: Simd> Supply<S> {
    pub(super) fn new(rng: Stream<S>) -> Self {
        Self {
            rng,
            uniforms: [0.0; 8],
            exponentials: [0.0; 8],
            azimuths: [[0.0; 8]; 2],
            left: [0; 3],
        }
    }

    #[inline(always)]
    pub(super) fn uniform(&mut self) -> f64 {
        if self.left[0] == 0 {
            (self.uniforms, self.left[0]) = (self.rng.uniform().to_array(), 8);
        }
        self.left[0] -= 1;
        self.uniforms[self.left[0]]
    }

    #[inline(always)]
    pub(super) fn exponential(&mut self) -> f64 {
        if self.left[1] == 0 {
            let u = self.rng.uniform();
            (self.exponentials, self.left[1]) = ((-ln(F64x8::ONE - u)).to_array(), 8);
        }
        self.left[1] -= 1;
        self.exponentials[self.left[1]]
    }

    /// An exponential number within part `part` of `parts` of equal probability.
    #[inline(always)]
    pub(super) fn exponential_in(&mut self, part: u64, parts: u64) -> f64 {
        let u = (part as f64 + self.uniform()) / parts as f64;
        -ln(F64x8::<S>::splat((1.0 - u).max(f64::MIN_POSITIVE))).as_array()[0]
    }

    /// (sin, cos) of an angle uniform on the circle.
    #[inline(always)]
    pub(super) fn azimuth(&mut self) -> (f64, f64) {
        if self.left[2] == 0 {
            let (sin, cos) = self.rng.azimuth();
            (self.azimuths, self.left[2]) = ([sin.to_array(), cos.to_array()], 8);
        }
        self.left[2] -= 1;
        let [sin, cos] = &self.azimuths;
        (sin[self.left[2]], cos[self.left[2]])
    }
}
