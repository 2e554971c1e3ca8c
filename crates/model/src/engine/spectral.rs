//! `spectral`: each walk is scored at all wavelengths and all thicknesses.
//!
//! **Absorption** is an expected weight: the walk records its paths in ice and
//! water, and every wavelength scores exp(-alpha L). Beyond an optical depth of
//! [`DEFERRED`] at the least absorbed wavelength, a walk is absorbed like an analog
//! walk of that wavelength, and the weights of the surviving walks compensate for
//! this. Walks of negligible weight thus end, and every estimate is unbiased.
//!
//! **Dispersion.** Walks are done at the index nodes of [`super::nodes`].
//!
//! **Thicknesses.** One walk gives the exact result for all of them (see
//! [`crate::transport::Walker`]): for the next thickness it is resumed at the point
//! where the lower plane first affected it. All thicknesses together cost about as
//! much as the largest alone. Curves against thickness are smooth because their
//! errors are correlated.
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::engine::nodes::{Spacing, mixes, nodes};
use crate::engine::{Control, EngineError, Request, batches, coefficients, indices, tables};
use crate::math::Vec3;
use crate::measurement::{Estimate, Measured, Spectrum};
use crate::optics::Index;
use crate::table::TableWalker;
use crate::transport::{Absorption, Coefficients, End, Path, Sink, Walker};

/// Absorption optical depth, at the least absorbed wavelength, up to which every walk
/// survives.
pub(super) const DEFERRED: f64 = 3.0;
/// Number of rays that carry as much information as one entry of a table, at least.
/// The scatter of results from tables of 2^14 entries each was that of 100,000 rays
/// (at 89 degrees) to 500,000 rays (at normal incidence).
const RAYS_PER_ENTRY: f64 = 6.0;

/// Estimates at one index node: [thickness][wavelength of the node's span].
#[derive(Clone)]
struct NodeScores<'a> {
    reflected: Vec<Estimate>,
    transmitted: Vec<Estimate>,
    lost: Vec<u64>,
    absorption: Absorption,
    coefficients: &'a [Coefficients],
    weights: Vec<f64>,
    cancel: &'a AtomicBool,
}

impl Sink for NodeScores<'_> {
    fn end(&mut self, thicknesses: Range<usize>, end: End, path: &Path, _: Vec3) {
        let estimates = match end {
            End::Reflected => &mut self.reflected,
            End::Transmitted => &mut self.transmitted,
            End::Lost => {
                self.lost[thicknesses]
                    .iter_mut()
                    .for_each(|lost| *lost += 1);
                return;
            }
            End::Absorbed => return,
        };
        for (weight, a) in self.weights.iter_mut().zip(self.coefficients) {
            *weight = self.absorption.weight(path, a);
        }
        let width = self.weights.len();
        let rows = &mut estimates[thicknesses.start * width..thicknesses.end * width];
        for row in rows.chunks_exact_mut(width) {
            row.iter_mut()
                .zip(&self.weights)
                .for_each(|(estimate, weight)| estimate.add(*weight));
        }
    }

    fn stop(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }
}

impl batches::MergeableSink for NodeScores<'_> {
    type Sums = (Vec<Estimate>, Vec<Estimate>, Vec<u64>);

    fn sums(&self) -> Self::Sums {
        let [reflected, transmitted] = [&self.reflected, &self.transmitted].map(Vec::clone);
        (reflected, transmitted, self.lost.clone())
    }

    fn with(&self, (reflected, transmitted, lost): Self::Sums) -> Option<Self> {
        let lengths = |scores: &Self| {
            let Self {
                reflected,
                transmitted,
                lost,
                ..
            } = scores;
            [reflected.len(), transmitted.len(), lost.len()]
        };
        let restored = Self {
            reflected,
            transmitted,
            lost,
            ..self.clone()
        };
        (lengths(&restored) == lengths(self)).then_some(restored)
    }

    fn merge(&mut self, other: &Self) {
        let pairs = self.reflected.iter_mut().zip(&other.reflected);
        pairs.for_each(|(a, b)| a.merge(b));
        let pairs = self.transmitted.iter_mut().zip(&other.transmitted);
        pairs.for_each(|(a, b)| a.merge(b));
        self.lost
            .iter_mut()
            .zip(&other.lost)
            .for_each(|(a, b)| *a += b);
    }
}

/// Results of the walks at one index node, for `width` wavelengths from position
/// `first` on.
struct NodeResult {
    first: usize,
    /// [thickness][wavelength]
    reflectance: Vec<Measured>,
    transmittance: Vec<Measured>,
    /// [thickness]
    lost: Vec<f64>,
    width: usize,
}

/// How grain events are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum GrainEvents {
    /// Rays are traced through every grain.
    Traced,
    /// Outcomes are drawn from tables.
    Tabulated,
}

pub(super) fn run(
    request: &Request,
    control: &Control,
    grains: GrainEvents,
) -> Result<Vec<Spectrum>, EngineError> {
    let indices = indices(request)?;
    let lights = request.illuminations.len();
    let mut spectra = vec![Spectrum::default(); request.thicknesses_m.len() * lights];
    for light in 0..lights {
        let lit = run_lit(request, control, grains, &indices, light)?;
        for (h, spectrum) in lit.into_iter().enumerate() {
            spectra[h * lights + light] = spectrum;
        }
    }
    Ok(spectra)
}

/// Spectra per thickness under one illumination.
fn run_lit(
    request: &Request,
    control: &Control,
    grains: GrainEvents,
    indices: &[(Index, Index)],
    light: usize,
) -> Result<Vec<Spectrum>, EngineError> {
    let nodes = nodes(indices, request.snowpack.is_wet(), Spacing::FINE);
    let (node_indices, mixes) = mixes(indices, request.snowpack.is_wet(), Spacing::FINE);
    // the span of a node reaches from the node before it to the node after it
    let results = batches::map(control, (0..nodes.len()).collect(), |i| {
        let last = nodes[(i + 1).min(nodes.len() - 1)];
        let span = nodes[i.saturating_sub(1)]..last + 1;
        walk_node(
            request,
            control,
            (grains, light),
            indices,
            (i, node_indices[i]),
            span,
        )
    })?;
    let mut spectra = vec![Spectrum::default(); request.thicknesses_m.len()];
    for (l, mix) in mixes.iter().enumerate() {
        let ([j, i], t) = (mix.nodes, mix.share);
        let (a, b) = (&results[j], &results[i]);
        for (h, spectrum) in spectra.iter_mut().enumerate() {
            let (p, q) = (h * a.width + l - a.first, h * b.width + l - b.first);
            let mix = |a: Measured, b: Measured| if i == j { a } else { a.mix(b, t) };
            spectrum
                .reflectance
                .push(mix(a.reflectance[p], b.reflectance[q]));
            spectrum
                .transmittance
                .push(mix(a.transmittance[p], b.transmittance[q]));
            spectrum.lost.push((1.0 - t) * a.lost[h] + t * b.lost[h]);
        }
    }
    Ok(spectra)
}

/// The walks at one index node, scored for the wavelengths of its span.
fn walk_node(
    request: &Request,
    control: &Control,
    (grains, light): (GrainEvents, usize),
    indices: &[(Index, Index)],
    (number, node): (usize, (Index, Index)),
    span: Range<usize>,
) -> Result<NodeResult, EngineError> {
    let coefficients = &coefficients(request, indices)[span.clone()];
    let absorption = Absorption {
        coefficients: Coefficients::least(coefficients),
        deferred: DEFERRED,
    };
    let thicknesses_m = request.thicknesses_m;
    let (thicknesses, width) = (thicknesses_m.len(), span.len());
    let empty = NodeScores {
        reflected: vec![Estimate::default(); thicknesses * width],
        transmitted: vec![Estimate::default(); thicknesses * width],
        lost: vec![0; thicknesses],
        absorption,
        coefficients,
        weights: vec![0.0; width],
        cancel: control.cancel,
    };
    let scores = match grains {
        GrainEvents::Traced => {
            let scene = (request.snowpack, request.model);
            let walker = Walker::with_tracers(scene, &request.tracers(), node, absorption);
            let purpose = [1, number as u32, 0];
            batches::run(
                request,
                control,
                |_| &walker,
                thicknesses_m,
                light,
                purpose,
                &empty,
            )?
        }
        GrainEvents::Tabulated => {
            let purpose = [3, number as u32, 0];
            match batches::finished(request, control, light, purpose, &empty) {
                Some(scores) => scores,
                None => {
                    let outcomes = tables::outcomes(request, control, node)?;
                    let sections = tables::sections(request, thicknesses_m[thicknesses - 1]);
                    let walker = |batch: u64| {
                        let part = batch as usize % tables::PARTS;
                        let snowpack = tables::snowpack(request, &outcomes, part, &sections);
                        TableWalker {
                            snowpack,
                            absorption,
                        }
                    };
                    batches::run(
                        request,
                        control,
                        walker,
                        thicknesses_m,
                        light,
                        purpose,
                        &empty,
                    )?
                }
            }
        }
    };
    // the part of the error that is due to the table does not fall with the number of
    // rays
    let table = f64::from(request.resolution.table);
    let table_factor = match grains {
        GrainEvents::Traced => 1.0,
        GrainEvents::Tabulated => (1.0 + request.rays as f64 / (RAYS_PER_ENTRY * table)).sqrt(),
    };
    let measured = |estimates: &[Estimate]| {
        let measured = estimates
            .iter()
            .map(|estimate| estimate.measured(request.rays));
        let with_table_error = measured.map(|Measured { value, se }| Measured {
            value,
            se: se * table_factor,
        });
        with_table_error.collect()
    };
    Ok(NodeResult {
        first: span.start,
        reflectance: measured(&scores.reflected),
        transmittance: measured(&scores.transmitted),
        lost: scores
            .lost
            .iter()
            .map(|&lost| lost as f64 / request.rays as f64)
            .collect(),
        width,
    })
}
