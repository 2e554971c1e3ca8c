//! Outcomes of grain events, drawn once and used many times.
//!
//! The effect of a grain on a ray does not depend on the position and direction of the
//! ray (grain axes are isotropic), and lengths scale with the grain. So one list of
//! outcomes of grains of unit length, in the frame of the incoming ray, serves every
//! depth, direction, grain size and density.
use splitsnow_spectra::simd::{Simd, SimdKernel, dispatch};

use crate::grain::{Body, Events, Facets, GrainType, Grains, SizeRange, Stepped, Surface};
use crate::math::Vec3;
use crate::rng::Stream;
use crate::transport::{Entry, contact, meets};

/// Vectors of eight lanes on which grain events are followed side by side.
const GROUPS: usize = 2;

/// One event on a grain of unit length. The ray arrives along +z and leaves in the plane
/// of x and z, at x >= 0. Positions are relative to the point of entry into the grain,
/// in units of the length of the grain.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outcome {
    /// Cosine of the deflection.
    pub cos: f32,
    /// Sine of the deflection, >= 0.
    pub sin: f32,
    /// The point where the ray leaves the grain.
    pub displacement: [f32; 3],
    /// Path in ice; infinite if the ray is lost in the grain.
    pub ice: f32,
    /// Centre of the grain.
    pub centre: [f32; 3],
    /// Body of the grain, in this frame.
    pub body: Body<f32>,
}

/// Draws `count` outcomes of grains with the shapes of `law` (its size does not matter)
/// and the given surface.
#[must_use]
pub fn draw(
    law: &GrainType,
    (entry, facets): (Entry, Facets),
    surface: Surface,
    count: usize,
    rng: Stream,
) -> Vec<Outcome> {
    let law = GrainType {
        size: SizeRange::UNIT,
        ..*law
    };
    dispatch(DrawOutcomes {
        law,
        entry,
        facets,
        surface,
        count,
        rng,
    })
}

/// [`draw`] as a SIMD kernel.
struct DrawOutcomes {
    law: GrainType,
    entry: Entry,
    facets: Facets,
    surface: Surface,
    count: usize,
    rng: Stream,
}

impl SimdKernel for DrawOutcomes {
    type Output = Vec<Outcome>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Vec<Outcome> {
        draw_outcomes(
            self.law,
            (self.entry, self.facets),
            self.surface,
            self.count,
            self.rng.on::<S>(),
        )
    }
}

#[inline(always)]
fn draw_outcomes<S: Simd>(
    law: GrainType,
    (entry, facets): (Entry, Facets),
    surface: Surface,
    count: usize,
    mut rng: Stream<S>,
) -> Vec<Outcome> {
    let mut events: [Events<S>; GROUPS] =
        std::array::from_fn(|_| Events::new(&[surface; 2], false, facets));
    let down = Vec3::new(0.0, 0.0, 1.0);
    let mut contacts = [Outcome::default(); 8 * GROUPS];
    let mut grains = Grains::<S>::default();
    let mut queue = Vec::with_capacity(8);
    let mut outcomes = Vec::with_capacity(count);
    let mut started = 0;
    // Lanes are refilled until `count` events have begun, and then all are finished:
    // stopping after the first `count` to end would favour short events.
    let mut busy = [0_u32; GROUPS];
    let mut refill = [0xff_u32; GROUPS];
    loop {
        for group in 0..GROUPS {
            while refill[group] != 0 && started < count {
                let lane = refill[group].trailing_zeros() as usize;
                refill[group] &= refill[group] - 1;
                if queue.is_empty() {
                    // the azimuth, which nothing uses, keeps the random numbers of tables
                    let (chances, _) = (rng.uniform(), rng.azimuth());
                    let kept = grains.draw(&law, &mut rng);
                    let kept = (0..8).filter(|lane| kept >> lane & 1 == 1);
                    let kept = kept.map(|lane| (grains.get(lane), chances.as_array()[lane]));
                    let met = kept.filter(|(grain, u)| meets(grain, entry, *u, down));
                    queue.extend(met.map(|(grain, _)| grain));
                }
                let Some(grain) = queue.pop() else {
                    refill[group] |= 1 << lane;
                    continue;
                };
                let (point, normal) = contact(&grain, down);
                let events = &mut events[group];
                events.ice_m.as_mut_array()[lane] = 0.0;
                events.ice_limit_m.as_mut_array()[lane] = f64::INFINITY;
                events.direction.set(lane, down);
                events.start(lane, &grain, point, normal, false);
                contacts[8 * group + lane] = Outcome {
                    centre: [-0.5 * point.x, -0.5 * point.y, -0.5 * point.z].map(|v| v as f32),
                    body: grain.body.rounded(),
                    ..Outcome::default()
                };
                busy[group] |= 1 << lane;
                started += 1;
            }
        }
        if busy == [0; GROUPS] {
            return outcomes;
        }
        let mut steps = [Stepped::default(); GROUPS];
        for (step, events) in steps.iter_mut().zip(&mut events) {
            *step = events.step(&mut rng);
        }
        for (group, step) in steps.iter().enumerate() {
            let mut ended = (step.left | step.lost) & busy[group];
            busy[group] &= !ended;
            refill[group] |= ended;
            while ended != 0 {
                let lane = ended.trailing_zeros() as usize;
                ended &= ended - 1;
                let events = &events[group];
                let exit = events.place_in_grain_m(lane);
                let lost = step.left >> lane & 1 == 0;
                let ice = if lost {
                    f64::INFINITY
                } else {
                    events.ice_m.as_array()[lane]
                };
                outcomes.push(outcome_in_frame(
                    &contacts[8 * group + lane],
                    exit,
                    events.direction.get(lane),
                    ice,
                ));
            }
        }
    }
}

/// The outcome rotated about z so that `direction` lies at x >= 0 in the plane y = 0.
fn outcome_in_frame(contact: &Outcome, exit: Vec3, direction: Vec3, ice: f64) -> Outcome {
    let sin = (direction.x * direction.x + direction.y * direction.y).sqrt();
    let (c, s) = if sin > 1e-12 {
        (direction.x / sin, direction.y / sin)
    } else {
        (1.0, 0.0)
    };
    let rotate = |[x, y, z]: [f64; 3]| [c * x + s * y, c * y - s * x, z].map(|v| v as f32);
    let wide = |v: [f32; 3]| v.map(f64::from);
    let centre = wide(contact.centre);
    let displacement = [exit.x + centre[0], exit.y + centre[1], exit.z + centre[2]];
    Outcome {
        cos: direction.z as f32,
        sin: sin as f32,
        displacement: rotate(displacement),
        ice: ice as f32,
        centre: rotate(centre),
        body: Body::from(contact.body).turned(c, s).rounded(),
    }
}
