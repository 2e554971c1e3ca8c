//! Walks through a slab from one tabulated grain to the next.
//!
//! The same walk as that of [`crate::transport::Walker`], including planes and rejected
//! grains. It differs in that outcomes of grain events come from tables and that the
//! azimuth of a ray is not followed. One walk serves several thicknesses in the same way.
use splitsnow_spectra::simd::{F64x8, Simd, SimdKernel, Task, dispatch};

use crate::math::{Vec3, set_lanes};
use crate::rng::Stream;
use crate::table::TableSnowpack;
use crate::table::rays::{Ray, Variates};
use crate::table::step::{StepMasks, Steps, Stuck};
use crate::transport::{Absorption, End, Illumination, Sink, Walk, WalkError};

/// Steps between calls of [`Sink::stop`].
const STEPS_BETWEEN_CHECKS: u64 = 1024;

/// Walks through snow whose grain events are drawn from tables.
#[derive(Debug, Clone)]
pub struct TableWalker<'a> {
    /// The snow.
    pub snowpack: TableSnowpack<'a>,
    /// How walks end by absorption.
    pub absorption: Absorption,
}

/// State of a lane besides its ray.
#[derive(Debug, Clone, Copy, Default)]
struct Lane {
    /// Index of the slab in the list of thicknesses.
    slab: usize,
    /// The ray as it must be resumed for the next slab, and the variates of its flight if
    /// they are already drawn.
    branch_point: Option<(Ray, Option<[f64; 4]>)>,
    /// Variates of the next flight, if they are prescribed.
    forced: Option<[f64; 4]>,
}

/// Walks in progress on eight lanes.
struct Walks<'a, S: Simd, W> {
    walker: &'a TableWalker<'a>,
    thicknesses_m: &'a [f64],
    illumination: Illumination,
    rng: Stream<S>,
    /// Optical depths at which the rays are absorbed.
    budget: F64x8<S>,
    lanes: [Lane; 8],
    /// Lanes with prescribed variates.
    forced: u32,
    /// Number of rays not started yet.
    waiting: u64,
    sink: &'a mut W,
}

impl Walk for TableWalker<'_> {
    fn walk(
        &self,
        thicknesses_m: &[f64],
        illumination: Illumination,
        rays: u64,
        rng: Stream,
        sink: &mut impl Sink,
    ) -> Result<u64, WalkError> {
        dispatch(Walking {
            walker: self,
            thicknesses_m,
            illumination,
            rays,
            rng,
            sink,
        })
    }
}

/// A call of [`TableWalker::walk`] as a SIMD kernel.
struct Walking<'a, W> {
    walker: &'a TableWalker<'a>,
    thicknesses_m: &'a [f64],
    illumination: Illumination,
    rays: u64,
    rng: Stream,
    sink: &'a mut W,
}

impl<W: Sink> SimdKernel for Walking<'_, W> {
    type Output = Result<u64, WalkError>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        Walks::<S, W> {
            walker: self.walker,
            thicknesses_m: self.thicknesses_m,
            illumination: self.illumination,
            rng: self.rng.on(),
            budget: F64x8::ZERO,
            lanes: [Lane::default(); 8],
            forced: 0,
            waiting: self.rays,
            sink: self.sink,
        }
        .run()
    }
}

/// [`Walks::start`] as a SIMD task.
struct StartTask<'w, 'a, 'p, S: Simd, W>(&'w mut Walks<'a, S, W>, &'w mut Steps<'p, S>, usize);

impl<S: Simd, W: Sink> Task for StartTask<'_, '_, '_, S, W> {
    type Output = ();

    #[inline(always)]
    fn perform(self) {
        self.0.start_next(self.1, self.2);
    }
}

impl<S: Simd, W: Sink> Walks<'_, S, W> {
    #[inline(always)]
    fn run(&mut self) -> Result<u64, WalkError> {
        let TableWalker {
            snowpack,
            absorption,
        } = self.walker;
        let coefficients = absorption.coefficients;
        let [ice_per_m, water_per_m] =
            [coefficients.ice_per_m, coefficients.water_per_m].map(F64x8::splat);
        let mut steps = Steps::new(snowpack, [false; 2]);
        let mut walking = set_lanes(0xff).fold(0, |walking, lane| {
            walking | u32::from(self.start(&mut steps, lane)) << lane
        });
        let mut total = 0;
        for count in 0_u64.. {
            if walking == 0 {
                break;
            }
            if count % STEPS_BETWEEN_CHECKS == 0 && self.sink.stop() {
                return Err(WalkError::Stopped);
            }
            let mut variates = Variates::draw(snowpack.wet, &mut self.rng);
            for lane in set_lanes(self.forced) {
                if let Some(forced) = self.lanes[lane].forced.take() {
                    variates.set(lane, forced);
                }
            }
            self.forced = 0;
            let slabs = self.thicknesses_m.len();
            let store_branch_point = |steps: &Steps<S>, lane: usize, variates: &Variates<S>| {
                let Lane {
                    slab, branch_point, ..
                } = &mut self.lanes[lane];
                if branch_point.is_none() && *slab + 1 < slabs {
                    *branch_point = Some((steps.origin(lane), Some(variates.get(lane))));
                }
            };
            let stepped = steps.step(&mut variates, walking, store_branch_point);
            let StepMasks {
                met,
                above,
                below,
                lost,
                rejected: _,
            } = stepped.map_err(|Stuck(lane)| WalkError::TooThin {
                thickness_m: steps.depth_m.as_array()[lane],
            })?;
            total += u64::from((met & walking).count_ones());
            if snowpack.layers.len() > 1 {
                // grains may carry rays across the lower plane of the surface layer
                for lane in set_lanes(met & walking) {
                    let Lane {
                        slab, branch_point, ..
                    } = &mut self.lanes[lane];
                    let ray = steps.rays.get(lane);
                    if ray.layer > 0 && branch_point.is_none() && *slab + 1 < slabs {
                        *branch_point = Some((ray, None));
                    }
                }
            }
            let rays = &steps.rays;
            let mut depth = ice_per_m * rays.ice_m + water_per_m * rays.water_m;
            if snowpack.sooty {
                let impurities = rays.impurities.iter().zip(coefficients.impurities);
                for (d, factor) in impurities {
                    depth += *d * F64x8::splat(factor);
                }
            }
            let out = above | below;
            let absorbed = depth.ge(self.budget).to_bitmask() & (met | out);
            for lane in set_lanes((lost | absorbed | out) & walking) {
                let end = match [lost, absorbed, below].map(|mask| mask >> lane & 1 == 1) {
                    [true, ..] => End::Lost,
                    [_, true, _] => End::Absorbed,
                    [.., true] => End::Transmitted,
                    _ => End::Reflected,
                };
                if !(self.end(&mut steps, lane, end) || self.start(&mut steps, lane)) {
                    walking &= !(1 << lane);
                }
            }
        }
        Ok(total)
    }

    /// Starts the next ray on `lane`; false if none is left.
    #[inline(always)]
    fn start(&mut self, steps: &mut Steps<S>, lane: usize) -> bool {
        if self.waiting == 0 {
            return false;
        }
        S::outlined(StartTask(self, steps, lane));
        true
    }

    #[inline(always)]
    fn start_next(&mut self, steps: &mut Steps<S>, lane: usize) {
        self.waiting -= 1;
        let mu = match self.illumination {
            Illumination::Collimated { polar_angle_rad } => libm::cos(polar_angle_rad),
            Illumination::Diffuse => self
                .walker
                .snowpack
                .diffuse_cosine(self.rng.uniform().as_array()[0]),
        };
        let ray = Ray {
            mu,
            ..Ray::default()
        };
        steps.start(lane, &ray, self.thicknesses_m[0]);
        let budget = self.walker.absorption.deferred + self.rng.exponential().as_array()[0];
        self.budget.as_mut_array()[lane] = budget;
        self.lanes[lane] = Lane::default();
    }

    /// Reports the end of the walk of `lane` and resumes it in the next slab; false if
    /// the walk has ended in all slabs.
    #[inline(always)]
    fn end(&mut self, steps: &mut Steps<S>, lane: usize, end: End) -> bool {
        let Ray { mu, path, .. } = steps.rays.get(lane);
        let across = (1.0 - mu * mu).max(0.0).sqrt();
        let direction = Vec3::new(across, 0.0, mu);
        let Lane {
            slab,
            branch_point,
            forced,
        } = &mut self.lanes[lane];
        let Some((ray, variates)) = branch_point.take() else {
            // the lower plane had no effect: the walk is the same in all thicker slabs
            self.sink
                .end(*slab..self.thicknesses_m.len(), end, &path, direction);
            return false;
        };
        self.sink.end(*slab..*slab + 1, end, &path, direction);
        *slab += 1;
        *forced = variates;
        self.forced |= u32::from(variates.is_some()) << lane;
        steps.resume(lane, &ray, self.thicknesses_m[*slab]);
        true
    }
}
