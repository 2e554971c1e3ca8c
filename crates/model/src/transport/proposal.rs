//! Proposals for the next step of a walk: a flight and the grain or particle at its end.
//! They are drawn eight at a time and handed out one by one.
use splitsnow_spectra::simd::{F64x8, Simd, Task};

use crate::grain::{Grain, GrainType, Grains};
use crate::math::Vec3;
use crate::optics::Particles;
use crate::rng::Stream;
use crate::transport::{Component, Entry, Snow};

/// A flight and the grain or particle at its end, not yet accepted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Proposal {
    pub(super) flight_m: f64,
    /// Uniform variate; the flight is in water if it is below the saturation.
    pub(super) medium: f64,
    pub(super) met: Met,
}

/// What a ray meets at the end of a flight.
#[derive(Debug, Clone, Copy)]
pub(super) enum Met {
    Grain(Grain),
    /// A particle in the pores that scatters.
    Particle(Turn),
}

/// A change of direction.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Turn {
    /// Cosine of the deflection.
    cos: f64,
    /// Sine and cosine of its azimuth.
    azimuth: [f64; 2],
}

impl Turn {
    /// The unit direction of a ray that had the unit `direction`.
    pub(super) fn applied(&self, direction: Vec3) -> Vec3 {
        let (a, b) = direction.frame();
        let sin = (1.0 - self.cos * self.cos).sqrt();
        let [sin_azimuth, cos_azimuth] = self.azimuth;
        let turned = Vec3::default()
            .plus(self.cos, direction)
            .plus(sin * cos_azimuth, a)
            .plus(sin * sin_azimuth, b);
        Vec3::default().plus(1.0 / turned.dot(turned).sqrt(), turned)
    }
}

/// The point where a ray of unit `direction` meets `grain`, relative to the centre of the
/// grain and in units of half its size, and the unit outward normal there.
#[inline(always)]
#[must_use]
pub fn contact(grain: &Grain, direction: Vec3) -> (Vec3, Vec3) {
    // the antipode of a point on the far side is on the near side
    let far = grain.normal.dot(direction) > 0.0;
    if far {
        (-grain.point, -grain.normal)
    } else {
        (grain.point, grain.normal)
    }
}

/// Whether a ray of unit `direction` meets `grain`, whose point is uniform over its surface,
/// for `u` uniform in [0, 1).
///
/// Under [`Entry::Projected`] it does with the probability |n.d|. The points and the
/// attitudes that remain have the weight of the projected area. On average it is a half for
/// any shape, so that the sizes and shapes met keep their distributions.
#[inline(always)]
#[must_use]
pub fn meets(grain: &Grain, entry: Entry, u: f64, direction: Vec3) -> bool {
    entry == Entry::Uniform || u < grain.normal.dot(direction).abs()
}

/// Proposals of one type of grain, drawn eight at a time.
struct Supply<S: Simd> {
    grain: GrainType,
    flights: F64x8<S>,
    media: F64x8<S>,
    grains: Grains<S>,
    /// Uniform variates for [`meets`].
    chances: F64x8<S>,
    kept: u32,
}

impl<S: Simd> Supply<S> {
    /// Draws until at least one grain is kept.
    #[inline(always)]
    fn refill(&mut self, entry: Entry, wet: bool, rng: &mut Stream<S>) {
        while self.kept == 0 {
            self.flights = rng.exponential();
            if wet {
                self.media = rng.uniform();
            }
            if entry == Entry::Projected {
                self.chances = rng.uniform();
            }
            self.kept = self.grains.draw(&self.grain, rng);
        }
    }
}

/// [`Supply::refill`] as a SIMD task.
struct Refill<'a, S: Simd>(&'a mut Supply<S>, Entry, bool, &'a mut Stream<S>);

impl<S: Simd> Task for Refill<'_, S> {
    type Output = ();

    #[inline(always)]
    fn perform(self) {
        self.0.refill(self.1, self.2, self.3);
    }
}

/// Proposals of particles that scatter, drawn eight at a time.
struct ParticleSupply<S: Simd> {
    particles: Particles,
    flights: F64x8<S>,
    media: F64x8<S>,
    turns: [Turn; 8],
    used: usize,
}

/// Draws the next proposals of particles, as a SIMD task.
struct RefillParticles<'a, S: Simd>(&'a mut ParticleSupply<S>, &'a mut Stream<S>);

impl<S: Simd> Task for RefillParticles<'_, S> {
    type Output = ();

    #[inline(always)]
    fn perform(self) {
        let Self(supply, rng) = self;
        (supply.flights, supply.media) = (rng.exponential(), rng.uniform());
        let (chances, (sin, cos)) = (rng.uniform(), rng.azimuth());
        for (lane, turn) in supply.turns.iter_mut().enumerate() {
            *turn = Turn {
                cos: supply.particles.deflection(chances.as_array()[lane]),
                azimuth: [sin.as_array()[lane], cos.as_array()[lane]],
            };
        }
        supply.used = 0;
    }
}

/// Proposals in one layer.
pub(super) struct Proposals<S: Simd> {
    entry: Entry,
    mean_free_distance_m: f64,
    /// Whether a variate for the medium of each flight is drawn.
    wet: bool,
    /// Cumulative probabilities of the grain types, and of particles.
    types: Vec<f64>,
    supplies: Vec<Supply<S>>,
    particles: Option<ParticleSupply<S>>,
    /// Uniform variates that choose the types of the next grains.
    choices: F64x8<S>,
    chosen: usize,
}

impl<S: Simd> Proposals<S> {
    /// Starts with nothing drawn. `wet` says whether any layer contains water.
    pub(super) fn new(snow: &Snow, entry: Entry, wet: bool) -> Self {
        let supply = |component: &Component| Supply {
            grain: component.grain,
            flights: F64x8::ZERO,
            media: F64x8::ONE,
            grains: Grains::default(),
            chances: F64x8::ZERO,
            kept: 0,
        };
        let mut sum = 0.0;
        let shares = snow.meeting_shares().into_iter();
        let types = shares.map(|share| {
            sum += share;
            sum
        });
        Self {
            entry,
            mean_free_distance_m: snow.mean_free_distance_m(),
            wet,
            types: types.collect(),
            supplies: snow.grains.iter().map(supply).collect(),
            particles: snow.particles().map(|particles| ParticleSupply {
                particles,
                flights: F64x8::ZERO,
                media: F64x8::ONE,
                turns: [Turn::default(); 8],
                used: 8,
            }),
            choices: F64x8::ZERO,
            chosen: 8,
        }
    }

    /// The next proposal for a ray of unit `direction`.
    ///
    /// Each type proposes a grain or particle at a distance of its own, and the ray meets the
    /// nearest. The type of the nearest has the probabilities
    /// [`Snow::meeting_shares`] and is independent of its distance.
    // It only copies numbers from lanes, so it needs no instruction set of its own.
    #[inline(never)]
    pub(super) fn next(&mut self, direction: Vec3, rng: &mut Stream<S>) -> Proposal {
        let last = self.types.len() - 1;
        let kind = if last == 0 {
            0
        } else {
            if self.chosen == 8 {
                (self.choices, self.chosen) = (rng.uniform(), 0);
            }
            let u = self.choices.as_array()[self.chosen];
            self.chosen += 1;
            self.types[..last].partition_point(|cumulative| *cumulative <= u)
        };
        if let (Some(supply), true) = (&mut self.particles, kind == self.supplies.len()) {
            if supply.used == 8 {
                S::outlined(RefillParticles(&mut *supply, rng));
            }
            let lane = supply.used;
            supply.used += 1;
            return Proposal {
                flight_m: self.mean_free_distance_m * supply.flights.as_array()[lane],
                medium: supply.media.as_array()[lane],
                met: Met::Particle(supply.turns[lane]),
            };
        }
        let supply = &mut self.supplies[kind];
        loop {
            if supply.kept == 0 {
                S::outlined(Refill(&mut *supply, self.entry, self.wet, rng));
            }
            let lane = supply.kept.trailing_zeros() as usize;
            supply.kept &= supply.kept - 1;
            let grain = supply.grains.get(lane);
            // the flight and the medium do not depend on the grain, so they may change with it
            if meets(
                &grain,
                self.entry,
                supply.chances.as_array()[lane],
                direction,
            ) {
                return Proposal {
                    flight_m: self.mean_free_distance_m * supply.flights.as_array()[lane],
                    medium: supply.media.as_array()[lane],
                    met: Met::Grain(grain),
                };
            }
        }
    }
}
