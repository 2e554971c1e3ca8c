//! Ice grains: the distributions of their size and shape, the event of a ray on a grain,
//! and the mean free distance between grains (Varsa 2025, chapter 4 and appendix B).
mod body;
mod distance;
mod event;
mod facets;
mod hexagonal;
mod law;
mod oblate;
mod optical;
mod shape;
mod spheroid;

pub use body::{Bodies, Body};
pub use distance::{
    mean_free_distance_m, overpacking, shape_factor, size_factor_per_m, specific_surface_m2_kg,
};
pub use event::{Events, Grain, Grains, Stepped, Surface};
pub use facets::Facets;
pub use hexagonal::Hexagonal;
pub use law::{GrainError, SizeLaw, SizeRange, TruncatedNormal};
pub use oblate::Oblate;
pub use optical::{SizeConversion, SizeMeasure};
pub use shape::{Down, Form, GrainShape, Numbers, Shape, Upright};
pub use spheroid::Spheroid;

/// One type of grain: the distributions of its size, facetness and shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GrainType {
    /// Full length of the major axis, uniformly distributed.
    pub size: SizeRange,
    /// Facetness F in [0, 1] (Varsa 2025, eq. 4.3); 0 is smooth.
    pub facetness: TruncatedNormal,
    /// Shape of the grains.
    pub shape: Shape,
    /// Proportion of the grains: of spheroids the inscribed-circle sphericity in (0, 1]
    /// (eq. 4.2), sqrt(minor / major); of prisms the aspect ratio, height / diameter.
    pub proportion: TruncatedNormal,
}
