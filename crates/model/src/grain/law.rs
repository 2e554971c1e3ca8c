//! Distributions of grain properties (Varsa 2025, table 4.1): uniform size, truncated
//! normal facetness and sphericity.
use splitsnow_spectra::simd::{F64x8, Simd};
use thiserror::Error;

use crate::rng::Stream;

/// Parameters that do not describe a distribution.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GrainError {
    /// A bound is not finite, or the pair is out of order.
    #[error("{quantity}: min {min} and max {max} must be finite with {lowest} <= min <= max")]
    Range {
        /// The distribution.
        quantity: &'static str,
        /// The given minimum.
        min: f64,
        /// The given maximum.
        max: f64,
        /// Smallest admissible minimum.
        lowest: f64,
    },
    /// The mean lies outside the bounds.
    #[error("mean {mean} must lie in [min, max] = [{min}, {max}]")]
    Mean {
        /// The given mean.
        mean: f64,
        /// Lower bound.
        min: f64,
        /// Upper bound.
        max: f64,
    },
    /// The standard deviation is negative or not finite.
    #[error("standard deviation {sd} must be finite and >= 0")]
    Sd {
        /// The given standard deviation.
        sd: f64,
    },
}

/// How often a ray meets grains of different sizes, for a given volume of ice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SizeLaw {
    /// As published (Varsa 2025, eqs. B.3-B.7): the number of grains falls as s^-4 while the
    /// sizes met are uniform, so wide ranges meet more ice than the density gives.
    #[default]
    Varsa2025,
    /// Not in the thesis: the ice met per metre agrees with the density.
    Consistent,
}

impl SizeLaw {
    /// The name used in configs and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Varsa2025 => "varsa2025",
            Self::Consistent => "consistent",
        }
    }
}

/// Full grain length in metres, uniform in [min, max].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SizeRange {
    min_m: f64,
    max_m: f64,
    law: SizeLaw,
}

impl SizeRange {
    /// Grains of unit length.
    pub const UNIT: Self = Self {
        min_m: 1.0,
        max_m: 1.0,
        law: SizeLaw::Varsa2025,
    };

    /// Sizes with the published law.
    ///
    /// # Errors
    /// [`GrainError::Range`] unless both are finite and `0 < min_m <= max_m`.
    pub fn new(min_m: f64, max_m: f64) -> Result<Self, GrainError> {
        if min_m.is_finite() && max_m.is_finite() && 0.0 < min_m && min_m <= max_m {
            Ok(Self {
                min_m,
                max_m,
                law: SizeLaw::default(),
            })
        } else {
            Err(GrainError::Range {
                quantity: "grain size (m)",
                min: min_m,
                max: max_m,
                lowest: 0.0,
            })
        }
    }

    /// The same sizes with another law.
    #[must_use]
    pub fn with_law(self, law: SizeLaw) -> Self {
        Self { law, ..self }
    }

    /// The law for how often grains are met.
    #[must_use]
    pub fn law(&self) -> SizeLaw {
        self.law
    }

    /// Smallest grain, m.
    #[must_use]
    pub fn min_m(&self) -> f64 {
        self.min_m
    }

    /// Largest grain, m.
    #[must_use]
    pub fn max_m(&self) -> f64 {
        self.max_m
    }

    /// Draws eight sizes, m.
    #[inline(always)]
    pub fn sample<S: Simd>(&self, rng: &mut Stream<S>) -> F64x8<S> {
        rng.uniform() * F64x8::splat(self.max_m - self.min_m) + F64x8::splat(self.min_m)
    }
}

/// A normal distribution with the given mean and standard deviation, truncated to
/// [min, max]. It is a constant if `sd = 0` or `min = max`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TruncatedNormal {
    min: f64,
    max: f64,
    mean: f64,
    sd: f64,
}

impl TruncatedNormal {
    /// # Errors
    /// Unless all values are finite, `min <= mean <= max` and `sd >= 0`.
    pub fn new(min: f64, max: f64, mean: f64, sd: f64) -> Result<Self, GrainError> {
        if !(min.is_finite() && max.is_finite() && min <= max) {
            return Err(GrainError::Range {
                quantity: "truncated normal",
                min,
                max,
                lowest: f64::NEG_INFINITY,
            });
        }
        if !(min <= mean && mean <= max) {
            return Err(GrainError::Mean { mean, min, max });
        }
        if !(sd.is_finite() && sd >= 0.0) {
            return Err(GrainError::Sd { sd });
        }
        Ok(Self { min, max, mean, sd })
    }

    /// Lower bound.
    #[must_use]
    pub fn min(&self) -> f64 {
        self.min
    }

    /// Upper bound.
    #[must_use]
    pub fn max(&self) -> f64 {
        self.max
    }

    /// Mean of the normal before truncation.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Standard deviation of the normal before truncation.
    #[must_use]
    pub fn sd(&self) -> f64 {
        self.sd
    }

    /// Draws eight candidates and a mask of those to keep, by rejection from the normal
    /// distribution or from the uniform distribution over [min, max], whichever accepts
    /// more.
    #[inline(always)]
    pub fn propose<S: Simd>(&self, rng: &mut Stream<S>) -> (F64x8<S>, F64x8<S>) {
        let (min, max) = (F64x8::splat(self.min), F64x8::splat(self.max));
        let (mean, width) = (F64x8::splat(self.mean), self.max - self.min);
        if self.sd == 0.0 || width == 0.0 {
            return (mean, mean.equals(mean));
        }
        let sd = F64x8::splat(self.sd);
        // acceptance: P(min < X < max), or this times sqrt(2 pi) sd / width
        if width > 2.506_628_274_631 * self.sd {
            let value = mean + sd * rng.normal();
            (value, value.ge(min) & value.le(max))
        } else {
            let value = min + F64x8::splat(width) * rng.uniform();
            let z = (value - mean) / sd;
            (value, (z * z).lt(F64x8::splat(2.0) * rng.exponential()))
        }
    }
}
