//! The inside of snowpacks: mean grain events, where grains act like points, and
//! stretches and planes added up.
use std::sync::Arc;

use super::Run;
use super::planes::Piece;
use super::walks::Walks;
use crate::engine::EngineError;
use crate::engine::nodes::Mix;
use crate::slab::{Matrix, Medium, Streams};
use crate::table::{Event, Kernel};
use crate::transport::{Coefficients, Snow, impurities_per_m};

/// What a part of the inside does to the streams that enter it.
#[derive(Clone)]
pub(super) struct Inside {
    /// Of those from above: up again, and down through.
    pub(super) from_above: [Matrix; 2],
    /// Of those from below: down again, and up through.
    pub(super) from_below: [Matrix; 2],
}

/// One layer at one wavelength.
pub(super) struct Points<'a> {
    medium: Medium<'a>,
    mean_free_path_m: f64,
}

/// How light survives the flights through the pores of one layer.
pub(super) struct Flights {
    mean_free_distance_m: f64,
    /// Shares of the flights through air and through water.
    shares: [f64; 2],
    /// Shares of those that survive.
    survivals: [f64; 2],
    /// Absorption coefficient of the ice, 1/m.
    ice_per_m: f64,
}

impl Flights {
    pub(super) fn new(run: &Run, snow: &Snow, coefficients: &Coefficients) -> Self {
        let exponents = run.request.snowpack.exponents();
        let absorbed = impurities_per_m(snow, run.request.model, &exponents).map(|per_m| {
            let all = per_m.iter().zip(&coefficients.impurities);
            all.map(|(per_m, factor)| per_m * factor).sum::<f64>()
        });
        let [in_ice, in_pores] = absorbed;
        let mean_free_distance_m = snow.mean_free_distance_m();
        let survival = |per_m: f64| 1.0 / (1.0 + per_m * mean_free_distance_m);
        let wet = snow.water_saturation;
        Self {
            mean_free_distance_m,
            shares: [1.0 - wet, wet],
            survivals: [
                survival(in_pores),
                survival(coefficients.water_per_m + in_pores),
            ],
            ice_per_m: coefficients.ice_per_m + in_ice,
        }
    }

    /// Mean of the `n`-th power of survival.
    pub(super) fn moment(&self, n: i32) -> f64 {
        let all = self.shares.iter().zip(self.survivals);
        all.map(|(share, survival)| share * survival.powi(n)).sum()
    }

    /// Mean length, and root of half the mean square, m, of flights that light
    /// survives: those through what absorbs are the shorter ones.
    fn lengths_m(&self) -> [f64; 2] {
        let d = self.mean_free_distance_m;
        let moment = |n| self.moment(n);
        [
            d * moment(2) / moment(1),
            d * (moment(3) / moment(1)).sqrt(),
        ]
    }
}

/// The mean event on a grain of `snow`, the `number`-th layer, in `part` of the
/// grain events, at one wavelength.
pub(super) fn event(
    walks: &[Arc<Walks>],
    mix: &Mix,
    snow: &Snow,
    flights: &Flights,
    part: usize,
    number: usize,
) -> Event {
    let of = |walks: &Walks| mean(snow, flights, walks.kernels(part, number));
    let [first, second] = mix.nodes.map(|node| &walks[node]);
    match mix.share {
        0.0 => of(first),
        1.0 => of(second),
        share => of(first).mix(&of(second), share),
    }
}

/// The mean event on a grain of `snow`, whose types have these kernels in air
/// and in water.
fn mean<'a>(
    snow: &Snow,
    flights: &Flights,
    kernels: impl Iterator<Item = [&'a Kernel; 2]>,
) -> Event {
    let [_, wet] = flights.shares;
    let weakened = |event: Event, survival: f64| match survival {
        1.0 => event,
        _ => event.attenuated(survival),
    };
    let kinds = snow.grains.iter().zip(kernels).zip(snow.meeting_shares());
    let mut sum: Option<(Event, f64)> = None;
    for ((component, [air, water]), share) in kinds {
        let size = &component.grain.size;
        let of = |kernel: &Kernel, survival: f64| {
            let event = kernel.event([size.min_m(), size.max_m()], flights.ice_per_m);
            weakened(event, survival)
        };
        let [in_air, in_water] = flights.survivals;
        let mut event = of(air, in_air);
        if wet > 0.0 {
            event = event.mix(&of(water, in_water), wet);
        }
        sum = Some(match sum {
            None => (event, share),
            Some((before, shares)) => {
                let all = shares + share;
                (before.mix(&event, share / all), all)
            }
        });
    }
    // snow has a type of grain at least
    sum.map_or_else(Event::default, |(event, _)| event)
}

impl<'a> Points<'a> {
    /// Those of a layer with this mean grain `event`.
    pub(super) fn new(
        streams: &'a Streams,
        event: &Event,
        flights: &Flights,
    ) -> Result<Self, EngineError> {
        Ok(Self {
            medium: Medium::delta_m(streams, &event.moments)?,
            mean_free_path_m: event.effective_mean_free_path_m(flights.lengths_m()),
        })
    }

    fn stretch(&self, thickness_m: f64) -> Result<Inside, EngineError> {
        let operators = self.medium.operators(thickness_m / self.mean_free_path_m)?;
        let (r, t) = (operators.reflection, operators.transmission);
        Ok(Inside {
            from_above: [r.clone(), t.clone()],
            from_below: [r, t],
        })
    }
}

/// `pieces`, downward, of layers that act like `points` and of planes between them,
/// `joints`.
pub(super) fn inside(
    pieces: &[Piece<usize>],
    points: &[Option<Points>],
    joints: &[Inside],
    streams: usize,
) -> Result<Inside, EngineError> {
    let mut sum: Option<Inside> = None;
    for piece in pieces {
        let next = match piece {
            Piece::Walked(joint) => joints[*joint].clone(),
            Piece::Points(stretch) => match &points[stretch.snow] {
                Some(points) => points.stretch(stretch.thickness_m)?,
                None => continue,
            },
        };
        sum = Some(match sum {
            None => next,
            Some(above) => above.over(&next, streams)?,
        });
    }
    Ok(sum.unwrap_or_else(|| Inside {
        from_above: [Matrix::zeros(streams, streams), Matrix::identity(streams)],
        from_below: [Matrix::zeros(streams, streams), Matrix::identity(streams)],
    }))
}

impl Inside {
    /// This one with another under it.
    fn over(&self, below: &Self, streams: usize) -> Result<Self, EngineError> {
        let one = Matrix::identity(streams);
        let [up, down] = &self.from_above;
        let [back, through] = &self.from_below;
        let [reflected, transmitted] = &below.from_above;
        let [returned, risen] = &below.from_below;
        // down at the plane between, per down at the top, and up per up at the bottom
        let passed = (&one - &(back * reflected)).solve(down.clone())?;
        let rising = (&one - &(reflected * back)).solve(risen.clone())?;
        Ok(Self {
            from_above: [
                up + &(&(through * reflected) * &passed),
                transmitted * &passed,
            ],
            from_below: [
                returned + &(&(transmitted * back) * &rising),
                through * &rising,
            ],
        })
    }
}
