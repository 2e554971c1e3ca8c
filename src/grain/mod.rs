//! Ice grains: the laws of their size and shape, the event of one ray on one
//! grain, and the mean free distance between grains (Varsa 2025, chapter 4 and
//! appendix B).
mod law;

pub use law::{GrainError, SizeRange, TruncatedNormal};

/// One type of grain: how its size, facetness and sphericity are distributed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GrainType {
    /// Full length of the major axis, drawn uniformly.
    pub size: SizeRange,
    /// Facetness F in [0, 1] (Varsa 2025, eq. 4.3): 0 is a smooth spheroid.
    pub facetness: TruncatedNormal,
    /// Inscribed-circle sphericity in (0, 1] (eq. 4.2): sqrt(minor / major).
    pub sphericity: TruncatedNormal,
}
