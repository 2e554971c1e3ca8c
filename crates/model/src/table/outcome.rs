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
    event: (Entry, Facets),
    surface: Surface,
    count: usize,
    rng: Stream,
) -> Vec<Outcome> {
    let mut outcomes = Vec::with_capacity(count);
    dispatch(DrawOutcomes {
        law,
        event,
        surface,
        reflected: false,
        count,
        rng,
        sink: &mut |outcome, _| outcomes.push(outcome),
    });
    outcomes
}

/// Draws `count` outcomes of light that is reflected on the outside of grains, each with the
/// probability that light is reflected there.
#[must_use]
pub fn draw_reflected(
    law: &GrainType,
    event: (Entry, Facets),
    surface: Surface,
    count: usize,
    rng: Stream,
) -> Vec<(Outcome, f64)> {
    let mut outcomes = Vec::with_capacity(count);
    dispatch(DrawOutcomes {
        law,
        event,
        surface,
        reflected: true,
        count,
        rng,
        sink: &mut |outcome, chance| outcomes.push((outcome, chance)),
    });
    outcomes
}

/// Draws outcomes for [`draw`] or [`draw_reflected`], as a SIMD kernel.
struct DrawOutcomes<'a> {
    law: &'a GrainType,
    event: (Entry, Facets),
    surface: Surface,
    /// Whether light is only reflected on the outside.
    reflected: bool,
    count: usize,
    rng: Stream,
    sink: &'a mut dyn FnMut(Outcome, f64),
}

impl SimdKernel for DrawOutcomes<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let law = GrainType {
            size: SizeRange::UNIT,
            ..*self.law
        };
        let (entry, facets) = self.event;
        let events = Events::<S>::new(&[self.surface; 2], false, facets);
        let events = if self.reflected {
            events.reflected()
        } else {
            events
        };
        let rng = self.rng.on::<S>();
        draw_outcomes(&law, entry, events, self.count, rng, self.sink);
    }
}

#[inline(always)]
fn draw_outcomes<S: Simd>(
    law: &GrainType,
    entry: Entry,
    idle: Events<S>,
    count: usize,
    mut rng: Stream<S>,
    sink: &mut dyn FnMut(Outcome, f64),
) {
    let mut events: [Events<S>; GROUPS] = std::array::from_fn(|_| idle.clone());
    let down = Vec3::new(0.0, 0.0, 1.0);
    let mut contacts = [Outcome::default(); 8 * GROUPS];
    let mut grains = Grains::<S>::default();
    let mut queue = Vec::with_capacity(8);
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
                    let kept = grains.draw(law, &mut rng);
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
            return;
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
                let contact = &contacts[8 * group + lane];
                let outcome = outcome_in_frame(contact, exit, events.direction.get(lane), ice);
                sink(outcome, events.chance(lane));
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

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::grain::{Shape, TruncatedNormal};
    use crate::optics::Index;
    use crate::rng::Key;

    /// Number, mean deflection cosine and mean square of it of the reflections on the outside,
    /// among outcomes and as expected from outcomes that are all reflected.
    #[test]
    fn reflected_outcomes_are_those_without_a_path_in_ice() {
        const COUNT: usize = 1 << 17;
        let law = GrainType {
            size: SizeRange::UNIT,
            facetness: TruncatedNormal::new(0.0, 0.6, 0.3, 0.1).unwrap(),
            shape: Shape::Spheroid,
            proportion: TruncatedNormal::new(0.4, 0.9, 0.7, 0.1).unwrap(),
        };
        let [ice, water] = [1.31, 1.0].map(|n| Index { n, k: 0.0 });
        let [surface, _] = Surface::in_air_and_water(ice, water, false);
        let stream = |batch| {
            Stream::new(Key {
                seed: 1,
                cell: 0,
                purpose: [0; 3],
                batch,
            })
        };
        for entry in [Entry::Uniform, Entry::Projected] {
            for facets in [Facets::Varsa2025, Facets::Visible, Facets::VGroove] {
                let event = (entry, facets);
                let all = draw(&law, event, surface, COUNT, stream(0));
                let reflected = draw_reflected(&law, event, surface, COUNT, stream(1));
                assert!(reflected.iter().all(|(outcome, _)| outcome.ice == 0.0));
                for power in 0..3 {
                    let term = |outcome: &Outcome| f64::from(outcome.cos).powi(power);
                    let counted = all.iter().filter(|outcome| outcome.ice == 0.0).map(term);
                    let expected = reflected.iter().map(|(o, chance)| chance * term(o));
                    let [counted, expected] =
                        [counted.collect(), expected.collect()].map(|terms: Vec<f64>| {
                            let squares: f64 = terms.iter().map(|x| x * x).sum();
                            (terms.iter().sum::<f64>(), squares)
                        });
                    let difference = counted.0 - expected.0;
                    let sd = (counted.1 + expected.1).sqrt();
                    let what = format!("{event:?}, power {power}: {counted:?} {expected:?}");
                    assert!(difference.abs() < 4.0 * sd, "{what}");
                    assert!(expected.1 < counted.1, "{what}");
                }
            }
        }
    }
}
