//! Adds boundary layers and what is between them, at every wavelength.
use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::Run;
use super::cut::{BoundaryLayer, Joint, Slab};
use super::inside::{Flights, Inside, Points, inside};
use super::tally::Tally;
use super::walks::{Walks, unit};
use crate::engine::nodes::Mix;
use crate::engine::tables::PARTS;
use crate::engine::{Control, EngineError, batches, coefficients};
use crate::measurement::{Measured, Spectrum};
use crate::optics::Index;
use crate::rng::Fingerprint;
use crate::slab::Matrix;
use crate::transport::Coefficients;

/// Reflectance and transmittance.
type Pair = [f64; 2];

/// What a boundary layer does to light: "down" is away from its plane.
struct Couplings {
    /// From streams going up to streams going down: [down, up].
    inner: Matrix,
    /// From streams going up out through the surface.
    escape: Vec<f64>,
    /// From lights to streams going down: [stream, light].
    entry: Matrix,
    /// From lights out through the surface again.
    reflected: Vec<f64>,
}

impl Run<'_> {
    /// Spectra per thickness and light.
    pub(super) fn spectra(
        &self,
        control: &Control,
        walks: &[Arc<Walks>],
        indices: &[(Index, Index)],
        mixes: &[Mix],
    ) -> Result<Vec<Spectrum>, EngineError> {
        let request = self.request;
        let coefficients = coefficients(request, indices);
        let units = &control.cache.units;
        let thicknesses = Fingerprint::of("thicknesses").and(request.thicknesses_m);
        let name = format!("{} {:x}", unit(self, "curves"), thicknesses.finish());
        let one = |l: usize| {
            let name = format!("{name} {l}");
            if let Some(curves) = units.take(&name) {
                return Ok(curves);
            }
            if control.cancel.load(Ordering::Relaxed) {
                return Err(EngineError::Cancelled);
            }
            let curves = self.measured(walks, &mixes[l], &coefficients[l])?;
            units.add(&name, &curves)?;
            Ok(curves)
        };
        let count = request.thicknesses_m.len() * request.illuminations.len();
        let mut spectra = vec![Spectrum::default(); count];
        for curves in batches::map(control, (0..indices.len()).collect(), one)? {
            for (spectrum, [reflectance, transmittance]) in spectra.iter_mut().zip(curves) {
                spectrum.reflectance.push(reflectance);
                spectrum.transmittance.push(transmittance);
                spectrum.lost.push(0.0);
            }
        }
        Ok(spectra)
    }

    /// Every thickness and light at one wavelength: from all parts of the walks,
    /// with errors from leaving out one after another.
    fn measured(
        &self,
        walks: &[Arc<Walks>],
        mix: &Mix,
        coefficients: &Coefficients,
    ) -> Result<Vec<[Measured; 2]>, EngineError> {
        let snows = self.request.snowpack.snows();
        let flights: Vec<Flights> = snows
            .map(|snow| Flights::new(self, snow, coefficients))
            .collect();
        let parts = (0..PARTS).map(|part| self.tally(walks, mix, coefficients, &flights, part));
        let parts: Vec<Tally> = parts.collect();
        let all = Tally::mean(&parts);
        let values = self.curves(&all, &flights)?;
        let others = parts
            .iter()
            .map(|part| self.curves(&all.without(part), &flights));
        let others: Vec<Vec<Pair>> = others.collect::<Result<_, _>>()?;
        let curves = values.into_iter().enumerate();
        let measured = curves.map(|(c, pair)| {
            [0, 1].map(|q| Measured {
                value: pair[q],
                se: pair[q].abs() * relative_error(others.iter().map(|other| other[c][q])),
            })
        });
        Ok(measured.collect())
    }

    /// Every thickness and light at one wavelength.
    fn curves(&self, tally: &Tally, flights: &[Flights]) -> Result<Vec<Pair>, EngineError> {
        let lights = self.request.illuminations.len();
        let couple = |layer: &BoundaryLayer| self.couplings(tally, layer, &flights[layer.snow]);
        let couplings: Vec<Couplings> = self.plan.layers.iter().map(couple).collect();
        let join = |joint: &Joint| self.joined(tally, joint, flights);
        let joints: Vec<Inside> = self.plan.joints.iter().map(join).collect();
        let points = flights.iter().enumerate().map(|(snow, flights)| {
            let event = tally.event(&self.layout, snow);
            event
                .map(|event| Points::new(&self.streams, &event, flights))
                .transpose()
        });
        let points: Vec<Option<Points>> = points.collect::<Result<_, _>>()?;
        let n = self.streams.count();
        let one = Matrix::identity(n);
        let mut curves = Vec::new();
        for slab in &self.plan.slabs {
            let cut = match slab {
                Slab::Thin(first) => {
                    let tasks = *first..first + lights;
                    curves.extend(tasks.map(|task| {
                        let [out, through] = tally.scores(&self.layout, task);
                        [out[0], through[0]]
                    }));
                    continue;
                }
                Slab::Thick(cut) => cut,
            };
            let (upper, lower) = (&couplings[cut.upper], &couplings[cut.lower]);
            let Inside {
                from_above: [r, t],
                from_below: [back, through],
            } = inside(&cut.inside, &points, &joints, n)?;
            // downward at the lower layer, and upward at the upper one, per
            // downward at the upper one
            let passed = (&one - &(&back * &lower.inner)).solve(t)?;
            let returned = &r + &(&(&through * &lower.inner) * &passed);
            // what the lights send down at the upper layer in the end
            let down = (&one - &(&upper.inner * &returned)).solve(upper.entry.clone())?;
            let escaped = |escape: &[f64], streams: &Matrix, light: usize| -> f64 {
                let all = escape.iter().enumerate();
                all.map(|(i, escape)| escape * streams[(i, light)]).sum()
            };
            let (up, passed) = (&returned * &down, &passed * &down);
            curves.extend((0..lights).map(|light| {
                let reflected = upper.reflected[light] + escaped(&upper.escape, &up, light);
                [reflected, escaped(&lower.escape, &passed, light)]
            }));
        }
        Ok(curves)
    }

    fn couplings(&self, tally: &Tally, layer: &BoundaryLayer, flights: &Flights) -> Couplings {
        let n = self.streams.count();
        let lights = if layer.is_lit {
            self.request.illuminations.len()
        } else {
            0
        };
        let scores = |source: usize| tally.scores(&self.layout, layer.first + source);
        // light from inside is what survived its flight up to the layer
        let per_arriving = 1.0 / flights.moment(1);
        let mut inner = self.streams_from(n, |source| scores(source)[1]);
        (0..n).for_each(|i| inner.row_mut(i).iter_mut().for_each(|x| *x *= per_arriving));
        Couplings {
            inner,
            escape: (0..n)
                .map(|source| per_arriving * scores(source)[0][0])
                .collect(),
            entry: self.streams_from(lights, |light| scores(n + light)[1]),
            reflected: (n..n + lights).map(|source| scores(source)[0][0]).collect(),
        }
    }

    /// What the walks next to a plane between layers come to.
    fn joined(&self, tally: &Tally, joint: &Joint, flights: &[Flights]) -> Inside {
        let n = self.streams.count();
        let ends = [joint.stretches.first(), joint.stretches.last()];
        let per_arriving = ends.map(|end| 1.0 / flights[end.map_or(0, |s| s.snow)].moment(1));
        let matrix = |side: usize, end: usize| {
            let first = joint.first + end * n;
            let mut matrix =
                self.streams_from(n, |source| tally.scores(&self.layout, first + source)[side]);
            for i in 0..n {
                let row = matrix.row_mut(i).iter_mut();
                row.for_each(|x| *x *= per_arriving[end]);
            }
            matrix
        };
        Inside {
            from_above: [matrix(0, 0), matrix(1, 0)],
            from_below: [matrix(1, 1), matrix(0, 1)],
        }
    }

    /// Light into every stream from each of `sources`: the polynomial with their
    /// `moments` over P_l(2 mu - 1), at the stream's cosine and with its weight.
    fn streams_from<'a>(&self, sources: usize, moments: impl Fn(usize) -> &'a [f64]) -> Matrix {
        Matrix::from_fn(self.streams.count(), sources, |stream, source| {
            let terms = self.into_streams[stream].iter().zip(moments(source));
            terms.map(|(factor, moment)| factor * moment).sum()
        })
    }
}

/// Standard error of an estimate from independent parts, relative to it: by
/// `values` of the same estimate with one part left out at a time.
fn relative_error(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    if mean == 0.0 {
        return 0.0;
    }
    // of ratios: the squares of what leaves deep snow may be too small for a number
    let squares: f64 = values.map(|v| (v / mean - 1.0) * (v / mean - 1.0)).sum();
    (squares * (n - 1.0) / n).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a mean the jackknife is the usual standard error, however small the values.
    #[test]
    fn errors_of_what_hardly_leaves_are_as_large() {
        let values = [1.0, 2.0, 6.0];
        // means of the other two
        let others = [4.0, 3.5, 1.5];
        let spread: f64 = values.iter().map(|v: &f64| (v - 3.0).powi(2)).sum();
        for scale in [1.0, 1e-199] {
            let error = relative_error(others.iter().map(|v| v * scale));
            assert!(
                (error - (spread / 6.0).sqrt() / 3.0).abs() < 1e-12,
                "{error}"
            );
        }
        assert_eq!(relative_error([0.0; 8].into_iter()), 0.0);
    }
}
