//! `reference`: the model exactly as in docs/methods.md. Every wavelength and
//! thickness has its own walks, and absorption is analog. There is no optimisation
//! here: the other engines are tested against this one.
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::engine::substrate::SubstrateCoefficients;
use crate::engine::{Control, EngineError, Request, batches, coefficients, indices};
use crate::math::Vec3;
use crate::measurement::{Estimate, Measured, Spectrum};
use crate::transport::{Absorption, Bounce, End, Path, Sink, Walker};

/// Numbers of walks by how they ended.
#[derive(Clone, Copy)]
struct Counts<'a> {
    reflected: u64,
    transmitted: u64,
    lost: u64,
    /// Bounces off the substrate of the reflected and of the transmitted walks.
    bounces: [u64; 2],
    cancel: &'a AtomicBool,
}

impl Sink for Counts<'_> {
    fn end(&mut self, _: Range<usize>, end: End, path: &Path, _: Vec3) {
        match end {
            End::Reflected => {
                self.reflected += 1;
                self.bounces[0] += u64::from(path.bounces);
            }
            End::Transmitted => {
                self.transmitted += 1;
                self.bounces[1] += u64::from(path.bounces);
            }
            End::Absorbed => {}
            End::Lost => self.lost += 1,
        }
    }

    fn stop(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }
}

impl batches::MergeableSink for Counts<'_> {
    type Sums = ([u64; 3], [u64; 2]);

    fn sums(&self) -> Self::Sums {
        let ends = [self.reflected, self.transmitted, self.lost];
        (ends, self.bounces)
    }

    fn with(&self, ([reflected, transmitted, lost], bounces): Self::Sums) -> Option<Self> {
        Some(Self {
            reflected,
            transmitted,
            lost,
            bounces,
            ..*self
        })
    }

    fn merge(&mut self, other: &Self) {
        self.reflected += other.reflected;
        self.transmitted += other.transmitted;
        self.lost += other.lost;
        let bounces = self.bounces.iter_mut().zip(other.bounces);
        bounces.for_each(|(ours, theirs)| *ours += theirs);
    }
}

pub(super) fn run(
    request: &Request,
    substrate: &[SubstrateCoefficients],
    control: &Control,
) -> Result<Vec<Spectrum>, EngineError> {
    let indices = indices(request)?;
    let (coefficients, tracers) = (coefficients(request, &indices), request.tracers());
    let empty = Counts {
        reflected: 0,
        transmitted: 0,
        lost: 0,
        bounces: [0; 2],
        cancel: control.cancel,
    };
    let walk_cell = |(h, light, l): (usize, usize, usize)| {
        let absorption = Absorption {
            coefficients: coefficients[l],
            deferred: 0.0,
        };
        let SubstrateCoefficients {
            reflectance,
            transmittance,
        } = substrate[l];
        let scene = (request.snowpack, request.model);
        let walker = Walker::with_tracers(scene, &tracers, indices[l], absorption);
        let walker = walker.over(Bounce {
            reflected: reflectance.value,
            transmitted: transmittance.value,
        });
        let thickness_m = [request.thicknesses_m[h]];
        let purpose = [0, h as u32, l as u32];
        batches::run(
            request,
            control,
            |_| &walker,
            &thickness_m,
            light,
            purpose,
            &empty,
        )
    };
    let curves = (0..request.thicknesses_m.len())
        .flat_map(|h| (0..request.illuminations.len()).map(move |light| (h, light)));
    curves
        .map(|(h, light)| {
            let cells = (0..indices.len()).map(|l| (h, light, l)).collect();
            let mut spectrum = Spectrum::default();
            for (counts, substrate) in batches::map(control, cells, walk_cell)?
                .iter()
                .zip(substrate)
            {
                let (r, t) = counts.measured(request.rays, substrate);
                spectrum.reflectance.push(r);
                spectrum.transmittance.push(t);
                spectrum.lost.push(counts.lost as f64 / request.rays as f64);
            }
            Ok(spectrum)
        })
        .collect()
}

impl Counts<'_> {
    /// Reflectance and transmittance. Their errors include the error of the
    /// substrate's coefficients, which multiply the score at every bounce and at
    /// every end in the substrate.
    fn measured(&self, rays: u64, substrate: &SubstrateCoefficients) -> (Measured, Measured) {
        let relative = |m: Measured| if m.value > 0.0 { m.se / m.value } else { 0.0 };
        let per_bounce = relative(substrate.reflectance);
        let with_errors = |count, bounces: u64, transmission_se: f64| {
            let walked = proportion(count, rays);
            let bounce_se = per_bounce * bounces as f64 / rays as f64;
            let se =
                (walked.se * walked.se + bounce_se * bounce_se + transmission_se * transmission_se)
                    .sqrt();
            let value = walked.value;
            Measured { value, se }
        };
        let transmission_se =
            relative(substrate.transmittance) * self.transmitted as f64 / rays as f64;
        (
            with_errors(self.reflected, self.bounces[0], 0.0),
            with_errors(self.transmitted, self.bounces[1], transmission_se),
        )
    }
}

fn proportion(count: u64, rays: u64) -> Measured {
    let mut estimate = Estimate::default();
    estimate.add_count(count);
    estimate.measured(rays)
}
