//! The inside of snowpacks: mean grain events, layers in which grains act like
//! points, and the adding of segments.
use std::sync::Arc;

use super::HybridRun;
use super::planes::Segment;
use super::walks::Walks;
use crate::engine::EngineError;
use crate::engine::nodes::Mix;
use crate::slab::{Matrix, Medium, Streams};
use crate::table::{Event, Kernel};
use crate::transport::{Coefficients, Snow};

/// Reflection and transmission operators of a part of the inside, as matrices over
/// the streams.
#[derive(Clone)]
pub(super) struct StreamOperators {
    /// For light from above: reflection (upward) and transmission (downward).
    pub(super) from_above: [Matrix; 2],
    /// For light from below: reflection (downward) and transmission (upward).
    pub(super) from_below: [Matrix; 2],
}

/// One layer at one wavelength, with grains that act like points.
pub(super) struct Bulk<'a> {
    medium: Medium<'a>,
    mean_free_path_m: f64,
}

/// Survival of light on its flights through the pores of one layer, at one
/// wavelength.
pub(super) struct Flights {
    mean_free_distance_m: f64,
    /// Shares of the flights through air and through water.
    shares: [f64; 2],
    /// Mean survival of flights through air and through water, [0, 1].
    survivals: [f64; 2],
    /// Absorption coefficient of the ice, 1/m.
    ice_per_m: f64,
}

impl Flights {
    pub(super) fn new(run: &HybridRun, snow: &Snow, coefficients: &Coefficients) -> Self {
        let tracers = run.request.tracers();
        let absorbed = tracers.per_m(snow, run.request.model).map(|per_m| {
            let terms = per_m.iter().zip(&coefficients.impurities);
            terms.map(|(per_m, factor)| per_m * factor).sum::<f64>()
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
        let terms = self.shares.iter().zip(self.survivals);
        terms
            .map(|(share, survival)| share * survival.powi(n))
            .sum()
    }

    /// Mean length, and root of half the mean square length, m, of the flights that
    /// light survives. In absorbing pores, the surviving flights are the shorter ones.
    fn lengths_m(&self) -> [f64; 2] {
        let d = self.mean_free_distance_m;
        let moment = |n| self.moment(n);
        [
            d * moment(2) / moment(1),
            d * (moment(3) / moment(1)).sqrt(),
        ]
    }
}

/// The mean event on a grain of `snow`, layer number `layer`, over `part` of the
/// grain events, at one wavelength.
pub(super) fn event(
    walks: &[Arc<Walks>],
    mix: &Mix,
    snow: &Snow,
    flights: &Flights,
    part: usize,
    layer: usize,
) -> Event {
    let event_at = |walks: &Walks| mean_event(snow, flights, walks.kernels(part, layer));
    let [first, second] = mix.nodes.map(|node| &walks[node]);
    match mix.share {
        0.0 => event_at(first),
        1.0 => event_at(second),
        share => event_at(first).mix(&event_at(second), share),
    }
}

/// The mean event on a grain of `snow`; `kernels` are those of each grain type in
/// air and in water.
fn mean_event<'a>(
    snow: &Snow,
    flights: &Flights,
    kernels: impl Iterator<Item = [&'a Kernel; 2]>,
) -> Event {
    let [_, wet] = flights.shares;
    let weakened = |event: Event, survival: f64| match survival {
        1.0 => event,
        _ => event.attenuated(survival),
    };
    let sizes_m = snow.sizes_by_type_m();
    let kinds = sizes_m.zip(kernels).zip(snow.meeting_shares());
    let mut sum: Option<(Event, f64)> = None;
    for ((size_m, [air, water]), share) in kinds {
        let kernel_event = |kernel: &Kernel, survival: f64| {
            let event = kernel.event(size_m, flights.ice_per_m);
            weakened(event, survival)
        };
        let [in_air, in_water] = flights.survivals;
        let mut event = kernel_event(air, in_air);
        if wet > 0.0 {
            event = event.mix(&kernel_event(water, in_water), wet);
        }
        sum = Some(match sum {
            None => (event, share),
            Some((mean, shares)) => {
                let total = shares + share;
                (mean.mix(&event, share / total), total)
            }
        });
    }
    // snow has at least one grain type
    sum.map_or_else(Event::default, |(event, _)| event)
}

impl<'a> Bulk<'a> {
    /// A layer with this mean grain `event`.
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

    /// The operators of a section of this layer.
    pub(super) fn operators(&self, thickness_m: f64) -> Result<StreamOperators, EngineError> {
        let operators = self.medium.operators(thickness_m / self.mean_free_path_m)?;
        let (r, t) = (operators.reflection, operators.transmission);
        Ok(StreamOperators {
            from_above: [r.clone(), t.clone()],
            from_below: [r, t],
        })
    }
}

/// Adds `segments`, given downward: bulk segments with the media of `bulk` (per
/// layer) and walked segments with the operators of `interfaces`.
pub(super) fn add_segments(
    segments: &[Segment<usize>],
    bulk: &[Option<Bulk>],
    interfaces: &[StreamOperators],
    streams: usize,
) -> Result<StreamOperators, EngineError> {
    let mut sum: Option<StreamOperators> = None;
    for segment in segments {
        let next = match segment {
            Segment::Walked(interface) => interfaces[*interface].clone(),
            Segment::Bulk(section) => match &bulk[section.layer] {
                Some(bulk) => bulk.operators(section.thickness_m)?,
                None => continue,
            },
        };
        sum = Some(match sum {
            None => next,
            Some(above) => above.over(&next, streams)?,
        });
    }
    Ok(sum.unwrap_or_else(|| StreamOperators {
        from_above: [Matrix::zeros(streams, streams), Matrix::identity(streams)],
        from_below: [Matrix::zeros(streams, streams), Matrix::identity(streams)],
    }))
}

impl StreamOperators {
    /// The operators of this part with `below` under it.
    fn over(&self, below: &Self, streams: usize) -> Result<Self, EngineError> {
        let identity = Matrix::identity(streams);
        let [up, down] = &self.from_above;
        let [back, through] = &self.from_below;
        let [reflected, transmitted] = &below.from_above;
        let [returned, risen] = &below.from_below;
        // downward light at the plane between the two per downward light at the top,
        // and upward light there per upward light at the bottom
        let passed = (&identity - &(back * reflected)).solve(down.clone())?;
        let rising = (&identity - &(reflected * back)).solve(risen.clone())?;
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
