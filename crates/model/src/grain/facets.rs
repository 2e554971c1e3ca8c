//! The facets of a rough surface (docs/methods.md, The grain event).
//!
//! At a hit, the surface is an interface with the macroscopic normal n, facing the ray, and
//! facets tilted by an angle t at a random azimuth. With xi normal of standard deviation F/2,
//! cos t = 1 - |xi| (Varsa 2025, eqs. 4.3-4.4) or, for grooves, tan t = |xi|. The laws
//! differ in which of these facets a ray meets, and in what happens afterwards.
use splitsnow_spectra::simd::{F64x8, Simd};

use crate::math::Vec3x8;
use crate::rng::Stream;

/// Which facets a ray meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Facets {
    /// Any facet that faces the ray, as often as it occurs (Varsa 2025). Etendue is not
    /// conserved.
    #[default]
    Varsa2025,
    /// Facets in proportion to the area that the ray sees, as visible normals are sampled in
    /// rendering (Heitz and d'Eon 2014). A ray that a facet sends to the wrong side is
    /// treated as in [`Facets::Varsa2025`], so etendue is conserved approximately.
    Visible,
    /// The sides of a symmetric V-groove (Torrance and Sparrow 1967) of normally distributed
    /// slope, with all hits inside the groove. It is a surface that could exist, so etendue is
    /// conserved.
    VGroove,
}

impl Facets {
    /// All laws.
    pub const ALL: [Self; 3] = [Self::Varsa2025, Self::Visible, Self::VGroove];

    /// The name used in configs and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Varsa2025 => "varsa2025",
            Self::Visible => "visible",
            Self::VGroove => "v_groove",
        }
    }
}

/// Facets drawn about eight normals.
pub(super) struct Tilts<S: Simd> {
    /// Cosines and sines of the tilt.
    pub(super) cos: F64x8<S>,
    pub(super) sin: F64x8<S>,
    /// Unit vectors in the surface, toward which the normals are tilted.
    pub(super) across: Vec3x8<S>,
    /// Whether the tilt is below 90 degrees.
    pub(super) valid: F64x8<S>,
}

/// Random numbers for a facet about each of eight normals. All laws use the same.
pub(super) struct Facet<S: Simd> {
    /// |xi|.
    pub(super) xi: F64x8<S>,
    /// Cosines and sines of the azimuth.
    pub(super) cos: F64x8<S>,
    pub(super) sin: F64x8<S>,
    /// Unit vectors in the surface, at the azimuths 0 and 90 degrees.
    pub(super) frame: (Vec3x8<S>, Vec3x8<S>),
}

impl<S: Simd> Facet<S> {
    #[inline(always)]
    pub(super) fn draw(facetness: F64x8<S>, n: Vec3x8<S>, rng: &mut Stream<S>) -> Self {
        let xi = (F64x8::splat(0.5) * facetness * rng.normal()).abs();
        let (sin, cos) = rng.azimuth();
        Self {
            xi,
            cos,
            sin,
            frame: n.frame(),
        }
    }

    /// Unit vectors in the surface at this azimuth.
    #[inline(always)]
    fn across(&self) -> Vec3x8<S> {
        let (t1, t2) = self.frame;
        (t1 * self.cos).plus(self.sin, t2)
    }

    /// The facet of cos t = 1 - |xi|.
    #[inline(always)]
    pub(super) fn tilted(&self) -> Tilts<S> {
        let (tilt, one) = (self.xi, F64x8::ONE);
        Tilts {
            cos: one - tilt,
            sin: (tilt * (F64x8::splat(2.0) - tilt)).max(F64x8::ZERO).sqrt(),
            across: self.across(),
            valid: tilt.lt(one),
        }
    }

    /// The facet of tan t = |xi|.
    #[inline(always)]
    fn sloping(&self) -> Tilts<S> {
        let (slope, one) = (self.xi, F64x8::ONE);
        let tilt_cos = one / (one + slope * slope).sqrt();
        Tilts {
            cos: tilt_cos,
            sin: slope * tilt_cos,
            across: self.across(),
            valid: F64x8::ZERO.lt(one),
        }
    }
}

impl<S: Simd> Tilts<S> {
    /// Cosines of incidence on this facet and on its mirror image, tilted the other way.
    #[inline(always)]
    pub(super) fn incidences(&self, n: Vec3x8<S>, d: Vec3x8<S>) -> [F64x8<S>; 2] {
        let (along, aside) = (-n.dot(d) * self.cos, -self.across.dot(d) * self.sin);
        [along + aside, along - aside]
    }
}

/// A place in a V-groove on each of eight surfaces. The groove is scaled to depth 1.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Grooves<S: Simd> {
    cos: F64x8<S>,
    sin: F64x8<S>,
    across: Vec3x8<S>,
    /// 1 on the facet that is tilted toward `across`, -1 on the other.
    side: F64x8<S>,
    /// Height above the bottom of the groove, seen from the side of the ray.
    height: F64x8<S>,
    /// All ones while the ray is in the groove after a hit.
    pub(super) within: F64x8<S>,
}

impl<S: Simd> Grooves<S> {
    /// Leaves the groove of `lane`.
    #[inline(always)]
    pub(super) fn leave(&mut self, lane: usize) {
        self.within.as_mut_array()[lane] = F64x8::<S>::mask(false);
    }

    /// Lets rays of directions `d` that are not within a groove meet new ones. Returns the
    /// normals of the facets hit and the cosines of incidence.
    #[inline(always)]
    pub(super) fn hit(
        &mut self,
        n: Vec3x8<S>,
        d: Vec3x8<S>,
        facet: &Facet<S>,
        rng: &mut Stream<S>,
    ) -> (Vec3x8<S>, F64x8<S>) {
        let (zero, one) = (F64x8::ZERO, F64x8::ONE);
        let tilts = facet.sloping();
        let [first, second] = tilts.incidences(n, d);
        // A facet is hit in proportion to the area that the ray sees. If one of them is hidden,
        // the other is partly in its shadow, below the height 1 - seen.
        let [seen_first, seen_second] = [first.max(zero), second.max(zero)];
        let is_first = (rng.uniform() * (seen_first + seen_second)).lt(seen_first);
        let facing = is_first.select(first, second);
        let seen = ((first + second) / facing).max(zero).min(one);
        let height = one - seen * rng.uniform();
        let within = self.within;
        self.cos = within.select(self.cos, tilts.cos);
        self.sin = within.select(self.sin, tilts.sin);
        self.across = self.across.or_where_not(within, tilts.across);
        self.side = within.select(self.side, is_first.select(one, -one));
        self.height = within.select(self.height, height);
        let m = (n * self.cos).plus(self.side * self.sin, self.across);
        // a ray along the surface meets a smooth one at a cosine of 0 within rounding errors
        let c = (-m.dot(d)).max(F64x8::splat(1e-12));
        (m, c)
    }

    /// Moves on from the facets: the rays leave in directions `d`, on the other side of the
    /// surface where `refracted`. Returns the normals on the side of the rays, and the mask
    /// of rays that hit the opposite facet of the groove.
    #[inline(always)]
    pub(super) fn leave_facet(
        &mut self,
        n: Vec3x8<S>,
        d: Vec3x8<S>,
        refracted: F64x8<S>,
    ) -> (Vec3x8<S>, F64x8<S>) {
        let (zero, one) = (F64x8::ZERO, F64x8::ONE);
        // seen from the other side, the groove is a ridge, and its bottom is the top
        let n = (n * -one).or_where_not(refracted, n);
        let side = refracted.select(-self.side, self.side);
        let height = refracted.select(one - self.height, self.height);
        let (up, ahead) = (d.dot(n) * self.cos, side * d.dot(self.across) * self.sin);
        // The opposite facet ends at height 1. Distances are in units of the groove's half
        // width: the ray is there after 1 + height of them.
        let clears = (one + height) * up - (one - height) * ahead;
        let hits_again = clears.lt(zero);
        let opposite = height * ((up + ahead) / (ahead - up));
        let opposite = opposite.max(zero).min(one);
        self.height = hits_again.select(opposite, self.height);
        self.side = hits_again.select(-side, self.side);
        self.within = hits_again;
        (n, hits_again)
    }
}
