//! The event of a ray on a grain: entry facet, internal hits, exit (docs/methods.md;
//! Varsa 2025, section 4.2), for eight rays at once. It uses geometric optics on a smooth
//! body whose local normal is tilted at random at every hit. There is no diffraction and
//! no polarisation.
//!
//! Every [`Events::step`] tries one facet on each lane. Lanes are independent: one may enter
//! a new grain while another has its fifth internal hit.
use std::marker::PhantomData;

use splitsnow_spectra::simd::{F64x8, Portable, Simd, Task};

use crate::grain::facets::{Facet, Grooves};
use crate::grain::shape::{Form, GrainShape, Numbers, with_law};
use crate::grain::{Bodies, Body, Facets, GrainType, Spheroid};
use crate::math::{Vec3, Vec3x8};
use crate::optics::{Index, Interface, Interfaces, reflect};
use crate::rng::Stream;

/// Number of tilted normals tried before the untilted one is used.
const FACET_TRIES: f64 = 64.0;
/// Number of internal hits after which a ray counts as lost.
const INTERNAL_HITS: f64 = 10_000.0;

/// The interfaces between a grain and the surrounding medium.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// From the surrounding medium into ice.
    pub enter: Interface,
    /// From ice into the surrounding medium.
    pub leave: Interface,
}

impl Surface {
    /// Surfaces of ice in air and in water. `wet` says whether there is any water; if not,
    /// the absorption of water does not matter.
    #[must_use]
    pub fn in_air_and_water(ice: Index, water: Index, wet: bool) -> [Self; 2] {
        let absorbs = ice.k.max(if wet { water.k } else { 0.0 }) > Interface::DIELECTRIC_K;
        let interface = if absorbs {
            Interface::absorbing
        } else {
            Interface::dielectric
        };
        let surface = |outside| Self {
            enter: interface(outside, ice),
            leave: interface(ice, outside),
        };
        [surface(Index { n: 1.0, k: 0.0 }), surface(water)]
    }
}

/// A random grain and a random point on it, before a ray determines which side of it is
/// met.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grain {
    /// Full length, m.
    pub size_m: f64,
    /// Facetness F.
    pub facetness: f64,
    /// Body of the grain.
    pub body: Body<f64>,
    /// Point on its surface, in units of half its size.
    pub point: Vec3,
    /// Unit outward normal at this point.
    pub normal: Vec3,
}

/// Eight random grains.
#[derive(Debug, Clone, Default)]
pub struct Grains<S: Simd = Portable> {
    size_m: F64x8<S>,
    facetness: F64x8<S>,
    bodies: Bodies<S>,
    point: Vec3x8<S>,
    normal: Vec3x8<S>,
}

/// [`Grains::draw`] as a SIMD task.
struct DrawTask<'a, S: Simd>(&'a mut Grains<S>, &'a GrainType, &'a mut Stream<S>);

impl<S: Simd> Task for DrawTask<'_, S> {
    type Output = u32;

    #[inline(always)]
    fn perform(self) -> u32 {
        self.0.draw_inlined(self.1, self.2)
    }
}

impl<S: Simd> Grains<S> {
    /// Draws eight grains. The mask has a bit for each grain to be kept.
    #[inline(always)]
    pub fn draw(&mut self, law: &GrainType, rng: &mut Stream<S>) -> u32 {
        S::outlined(DrawTask(self, law, rng))
    }

    #[inline(always)]
    fn draw_inlined(&mut self, law: &GrainType, rng: &mut Stream<S>) -> u32 {
        let (proportion, keep_proportion) = law.proportion.propose(rng);
        let (facetness, keep_facetness) = law.facetness.propose(rng);
        let kept = keep_proportion & keep_facetness;
        with_law!(&law.shape, shape => self.place(shape, proportion, kept, rng));
        self.facetness = facetness;
        self.size_m = law.size.sample(rng);
        kept.to_bitmask()
    }

    /// Draws bodies of a shape and points on them, valid for the grains `kept`.
    #[inline(always)]
    fn place<G: GrainShape>(
        &mut self,
        shape: &G,
        proportion: F64x8<S>,
        kept: F64x8<S>,
        rng: &mut Stream<S>,
    ) {
        let body = shape.draw(proportion, rng);
        // A rejected point is drawn again for the same grain: rejecting the grain too
        // would favour shapes that keep more points.
        let (mut point, mut placed) = G::sample(&body, rng);
        while (kept & !placed).any() {
            let (another, keep) = G::sample(&body, rng);
            point = point.or_where_not(placed, another);
            placed |= keep;
        }
        self.bodies = Bodies::new([G::FORM; 8], body);
        self.point = point;
        self.normal = G::normal(&body, point).unit();
    }

    /// The grain of one lane.
    #[inline(always)]
    #[must_use]
    pub fn get(&self, lane: usize) -> Grain {
        Grain {
            size_m: self.size_m.as_array()[lane],
            facetness: self.facetness.as_array()[lane],
            body: self.bodies.get(lane),
            point: self.point.get(lane),
            normal: self.normal.get(lane),
        }
    }
}

/// Eight grain events in progress.
#[derive(Debug, Clone)]
pub struct Events<S: Simd = Portable> {
    /// Unit directions of the rays: before a step, of the incoming ray; after the end of
    /// the event, of the outgoing ray.
    pub direction: Vec3x8<S>,
    /// Paths in ice since the ray entered the snow, m.
    pub ice_m: F64x8<S>,
    /// Path in ice at which the ray is absorbed, m.
    pub ice_limit_m: F64x8<S>,
    bodies: Bodies<S>,
    facetness: F64x8<S>,
    /// Half the sizes of the grains, m.
    scale_m: F64x8<S>,
    /// Position of the ray relative to the centre, in units of half the size.
    position: Vec3x8<S>,
    /// Unit normal at this position, facing the ray.
    normal: Vec3x8<S>,
    /// All ones if the ray is in ice.
    inside: F64x8<S>,
    /// All ones if the grain is in water.
    wet: F64x8<S>,
    facet_tries: F64x8<S>,
    internal_hits: F64x8<S>,
    facets: Facets,
    grooves: Grooves<S>,
    surfaces: [[Interfaces<S>; 2]; 2],
    any_water: bool,
    /// Whether every ray is reflected wherever it meets a surface.
    reflects: bool,
    /// If so: the probability of these reflections.
    chance: F64x8<S>,
}

/// The lanes that a step changed, one bit each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Stepped {
    /// The ray has left its grain.
    pub left: u32,
    /// The path in ice has reached [`Events::ice_limit_m`].
    pub absorbed: u32,
    /// The ray is still in its grain after 10,000 hits.
    pub lost: u32,
}

/// Normals and chords of eight bodies.
trait Solids<S: Simd> {
    /// See [`GrainShape::normal`].
    fn normal(&self, body: &Numbers<F64x8<S>>, point: Vec3x8<S>) -> Vec3x8<S>;

    /// See [`GrainShape::chord`].
    fn chord(&self, body: &Numbers<F64x8<S>>, point: Vec3x8<S>, d: Vec3x8<S>) -> F64x8<S>;
}

/// Bodies of one form.
struct SingleForm<G>(PhantomData<G>);

impl<S: Simd, G: GrainShape> Solids<S> for SingleForm<G> {
    #[inline(always)]
    fn normal(&self, body: &Numbers<F64x8<S>>, point: Vec3x8<S>) -> Vec3x8<S> {
        G::normal(body, point)
    }

    #[inline(always)]
    fn chord(&self, body: &Numbers<F64x8<S>>, point: Vec3x8<S>, d: Vec3x8<S>) -> F64x8<S> {
        G::chord(body, point, d)
    }
}

impl<S: Simd> Solids<S> for Bodies<S> {
    #[inline(always)]
    fn normal(&self, _: &Numbers<F64x8<S>>, point: Vec3x8<S>) -> Vec3x8<S> {
        self.normal(point)
    }

    #[inline(always)]
    fn chord(&self, _: &Numbers<F64x8<S>>, point: Vec3x8<S>, d: Vec3x8<S>) -> F64x8<S> {
        self.chord(point, d)
    }
}

/// [`Events::step`] as a SIMD task, on bodies of one form or mixed forms.
struct StepTask<'a, S: Simd, B>(&'a mut Events<S>, B, &'a mut Stream<S>);

impl<S: Simd, B: Solids<S>> Task for StepTask<'_, S, B> {
    type Output = Stepped;

    #[inline(always)]
    fn perform(self) -> Stepped {
        self.0.step_inlined(&self.1, self.2)
    }
}

impl<S: Simd> Events<S> {
    /// Idle lanes with the given grain surfaces in air and in water.
    #[must_use]
    #[inline(always)]
    pub fn new(surfaces: &[Surface; 2], any_water: bool, facets: Facets) -> Self {
        let zero = F64x8::ZERO;
        let unit = Vec3x8::new(zero, zero, F64x8::ONE);
        Self {
            direction: unit * -F64x8::ONE,
            ice_m: zero,
            ice_limit_m: zero,
            bodies: Bodies::default(),
            facetness: zero,
            scale_m: zero,
            position: unit,
            normal: unit,
            inside: zero,
            wet: zero,
            facet_tries: zero,
            internal_hits: zero,
            facets,
            grooves: Grooves::default(),
            surfaces: surfaces.map(|s| [s.enter.splat(), s.leave.splat()]),
            any_water,
            reflects: false,
            chance: F64x8::ONE,
        }
    }

    /// The same, but rays never enter ice. [`Self::chance`] says how probable that is.
    #[must_use]
    #[inline(always)]
    pub fn reflected(self) -> Self {
        Self {
            reflects: true,
            ..self
        }
    }

    /// Probability that the ray of `lane` is reflected outside wherever it met its grain. Only
    /// known for [`Self::reflected`] rays.
    #[inline(always)]
    #[must_use]
    pub fn chance(&self, lane: usize) -> f64 {
        self.chance.as_array()[lane]
    }

    /// Lets the ray of `lane` meet `grain` at `point`, where the unit outward `normal` faces
    /// the ray.
    #[inline(always)]
    pub fn start(&mut self, lane: usize, grain: &Grain, point: Vec3, normal: Vec3, in_water: bool) {
        self.bodies.set(lane, &grain.body);
        self.facetness.as_mut_array()[lane] = grain.facetness;
        self.scale_m.as_mut_array()[lane] = 0.5 * grain.size_m;
        self.position.set(lane, point);
        self.normal.set(lane, normal);
        self.inside.as_mut_array()[lane] = F64x8::<S>::mask(false);
        self.wet.as_mut_array()[lane] = F64x8::<S>::mask(in_water);
        self.facet_tries.as_mut_array()[lane] = 0.0;
        self.internal_hits.as_mut_array()[lane] = 0.0;
        self.chance.as_mut_array()[lane] = 1.0;
        self.grooves.leave(lane);
    }

    /// Position of the ray of `lane` relative to the centre of its grain, m.
    #[inline(always)]
    #[must_use]
    pub fn place_in_grain_m(&self, lane: usize) -> Vec3 {
        self.position.get(lane) * self.scale_m.as_array()[lane]
    }

    /// Tries one facet on every lane.
    #[inline(always)]
    pub fn step(&mut self, rng: &mut Stream<S>) -> Stepped {
        // Spheroids alone have their own function, so that the other forms do not slow them.
        if self.bodies.form() == Some(Form::Spheroid) {
            let solids = SingleForm::<Spheroid>(PhantomData);
            return S::outlined(StepTask(self, solids, rng));
        }
        let bodies = self.bodies;
        S::outlined(StepTask(self, bodies, rng))
    }

    /// Facets of [`Facets::Varsa2025`]: their normals, the cosines of incidence, and which
    /// of them face the rays. After too many tries it is the untilted surface.
    #[inline(always)]
    fn facing_facet(
        &mut self,
        facet: &Facet<S>,
        untilted: F64x8<S>,
    ) -> (Vec3x8<S>, F64x8<S>, F64x8<S>) {
        let (n, one) = (self.normal, F64x8::ONE);
        let (tilt, (t1, t2)) = (facet.xi, facet.frame);
        let slope = (tilt * (F64x8::splat(2.0) - tilt)).max(F64x8::ZERO).sqrt();
        let m = (n * (one - tilt))
            .plus(slope * facet.cos, t1)
            .plus(slope * facet.sin, t2);
        let c = -m.dot(self.direction);
        let ok = c.gt(F64x8::ZERO) & tilt.lt(one);
        self.or_untilted((m, c, ok), untilted)
    }

    /// Facets of [`Facets::Visible`], as [`Self::facing_facet`].
    #[inline(always)]
    fn visible_facet(
        &mut self,
        facet: &Facet<S>,
        untilted: F64x8<S>,
        rng: &mut Stream<S>,
    ) -> (Vec3x8<S>, F64x8<S>, F64x8<S>) {
        let (n, zero, one) = (self.normal, F64x8::ZERO, F64x8::ONE);
        let tilts = facet.tilted();
        let [first, second] = tilts.incidences(n, self.direction);
        // Rejection from pairs of facets that are mirror images. Half of the sum of the
        // areas seen is at most the larger of 1/2 and the cosine on the untilted surface.
        let bound = (untilted + untilted).max(one);
        let u = bound * rng.uniform();
        let [seen_first, seen_second] = [first.max(zero), second.max(zero)];
        let is_first = u.lt(seen_first);
        let seen = u.lt(seen_first + seen_second);
        let side = is_first.select(one, -one);
        let m = (n * tilts.cos).plus(side * tilts.sin, tilts.across);
        let c = is_first.select(first, second);
        let ok = tilts.valid & seen & c.gt(zero);
        self.or_untilted((m, c, ok), untilted)
    }

    /// The untilted surface instead of facets that were refused too often.
    #[inline(always)]
    fn or_untilted(
        &mut self,
        (mut m, mut c, mut ok): (Vec3x8<S>, F64x8<S>, F64x8<S>),
        untilted: F64x8<S>,
    ) -> (Vec3x8<S>, F64x8<S>, F64x8<S>) {
        self.facet_tries += F64x8::ONE;
        let given_up = !ok & self.facet_tries.ge(F64x8::splat(FACET_TRIES));
        if given_up.any() {
            m = self.normal.or_where_not(given_up, m);
            c = given_up.select(untilted, c);
            ok |= given_up;
        }
        self.facet_tries = ok.select(F64x8::ZERO, self.facet_tries);
        (m, c, ok)
    }

    /// The same step on `solids`, whose forms are known.
    #[inline(always)]
    fn step_inlined(&mut self, solids: &impl Solids<S>, rng: &mut Stream<S>) -> Stepped {
        let (d, n, one) = (self.direction, self.normal, F64x8::ONE);

        let untilted = (-n.dot(d)).max(F64x8::splat(1e-12));
        // The default law has its own copy of the draw: with a common one, its step takes 4 % more
        // instructions. The other laws share one copy.
        let (m, c, ok) = if self.facets == Facets::Varsa2025 {
            let facet = Facet::draw(self.facetness, n, rng);
            self.facing_facet(&facet, untilted)
        } else {
            let facet = Facet::draw(self.facetness, n, rng);
            if self.facets == Facets::Visible {
                self.visible_facet(&facet, untilted, rng)
            } else {
                let (m, c) = self.grooves.hit(n, d, &facet, rng);
                (m, c, c.gt(F64x8::ZERO))
            }
        };
        let c = c.min(one);

        // reflect or refract
        let inside = self.inside;
        let [air, water] = &self.surfaces;
        let mut interfaces = Interfaces::select(inside, &air[1], &air[0]);
        if self.any_water {
            let in_water = Interfaces::select(inside, &water[1], &water[0]);
            interfaces = Interfaces::select(self.wet, &in_water, &interfaces);
        }
        let incidences = interfaces.incidences(c);
        let mut reflected = rng.uniform().lt(incidences.reflectance);
        if self.reflects {
            self.chance *= ok.select(incidences.reflectance, one);
            reflected = one.gt(F64x8::ZERO);
        }
        let refracted = !reflected;
        let mut next =
            reflect(d, m, c).or_where_not(reflected, interfaces.refract(d, m, c, &incidences));
        let goes_inside = inside ^ refracted;

        if self.facets != Facets::VGroove {
            // a tilted facet may send an internal ray out of the grain: use the untilted normal
            let outward = next.dot(n) * refracted.select(-one, one);
            let wrong_side = ok & goes_inside & outward.le(F64x8::ZERO);
            next = reflect(d, n, untilted).or_where_not(wrong_side & reflected, next);
            if (wrong_side & refracted).any() {
                let c = untilted.min(one);
                let refraction = interfaces.refract_or_graze(d, n, c, &interfaces.incidences(c));
                next = refraction.or_where_not(wrong_side & refracted, next);
            }
        }
        // one Newton step towards unit length prevents accumulation of rounding errors
        next = next * (F64x8::splat(1.5) - F64x8::splat(0.5) * next.dot(next));
        self.direction = next.or_where_not(ok, d);
        self.inside = ok.select(goes_inside, inside);

        // in a groove the ray may hit the opposite facet
        let mut n = n;
        let mut leaves_surface = ok;
        if self.facets == Facets::VGroove {
            let (facing, again) = self.grooves.leave_facet(n, next, refracted);
            n = facing.or_where_not(again, n);
            leaves_surface = !again;
            self.internal_hits += one & again;
        }

        // move on through the ice to the far surface
        let moves = leaves_surface & goes_inside;
        let body = &self.bodies.numbers;
        let chord = solids.chord(body, self.position, next);
        let chord = chord.max(F64x8::ZERO) & moves;
        self.position = self.position.plus(chord, next);
        self.ice_m += chord * self.scale_m;
        let inward = solids.normal(body, self.position).unit() * -one;
        self.normal = inward.or_where_not(moves, n);
        self.internal_hits += one & moves;
        Stepped {
            left: (leaves_surface & !goes_inside).to_bitmask(),
            absorbed: (moves & self.ice_m.ge(self.ice_limit_m)).to_bitmask(),
            lost: self
                .internal_hits
                .gt(F64x8::splat(INTERNAL_HITS))
                .to_bitmask(),
        }
    }
}
