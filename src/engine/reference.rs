//! `reference`: the model of docs/methods.md to the letter. Every wavelength and thickness
//! has walks of its own, and absorption is analog. Nothing is tuned here; it
//! is the yardstick of the other engines.
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::engine::{Control, EngineError, Request, batches, indices};
use crate::math::Vec3;
use crate::measurement::{Estimate, Measured, Spectrum};
use crate::transport::{Absorption, End, Path, Sink, Walker};

/// Ends of walks, counted.
#[derive(Clone, Copy)]
struct Counts<'a> {
    reflected: u64,
    transmitted: u64,
    lost: u64,
    cancel: &'a AtomicBool,
}

impl Sink for Counts<'_> {
    fn end(&mut self, _: Range<usize>, end: End, _: &Path, _: Vec3) {
        match end {
            End::Reflected => self.reflected += 1,
            End::Transmitted => self.transmitted += 1,
            End::Absorbed => {}
            End::Lost => self.lost += 1,
        }
    }

    fn stop(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }
}

impl batches::Scores for Counts<'_> {
    fn merge(&mut self, other: &Self) {
        self.reflected += other.reflected;
        self.transmitted += other.transmitted;
        self.lost += other.lost;
    }
}

pub(super) fn run(request: &Request, control: &Control) -> Result<Vec<Spectrum>, EngineError> {
    let indices = indices(request)?;
    let empty = Counts {
        reflected: 0,
        transmitted: 0,
        lost: 0,
        cancel: control.cancel,
    };
    let one = |(h, light, l): (usize, usize, usize)| {
        let ((ice, water), nm) = (indices[l], request.wavelengths_nm[l]);
        let absorption = Absorption {
            ice_per_m: ice.absorption_per_m(nm),
            water_per_m: water.absorption_per_m(nm),
            deferred: 0.0,
        };
        let walker = Walker::new(request.snow, request.model.entry, (ice, water), absorption);
        let thickness_m = [request.thicknesses_m[h]];
        let purpose = [0, h as u32, l as u32];
        batches::run(
            request,
            control,
            |_| walker,
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
            for counts in batches::map(control, cells, one)? {
                spectrum
                    .reflectance
                    .push(proportion(counts.reflected, request.rays));
                spectrum
                    .transmittance
                    .push(proportion(counts.transmitted, request.rays));
                spectrum.lost.push(counts.lost as f64 / request.rays as f64);
            }
            Ok(spectrum)
        })
        .collect()
}

fn proportion(count: u64, rays: u64) -> Measured {
    let mut estimate = Estimate::default();
    estimate.add_count(count);
    estimate.measured(rays)
}
