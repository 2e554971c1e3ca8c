//! Ice grains: the laws of their size and shape, the event of one ray on one
//! grain, and the mean free distance between grains (Varsa 2025, chapter 4 and
//! appendix B).
mod distance;
mod event;
mod law;
mod optical;
mod spheroid;

pub use distance::{
    mean_free_distance_m, overpacking, shape_factor, size_factor_per_m, specific_surface_m2_kg,
};
pub use event::{Events, Grain, Grains, Stepped, Surface};
pub use law::{GrainError, SizeLaw, SizeRange, TruncatedNormal};
pub use optical::{SizeMeasure, Told};
pub use spheroid::{Spheroids, half_height, projected_point};

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
