//! Adds boundary layers and the inside between them, at every wavelength.
use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::HybridRun;
use super::inside::{Bulk, Flights, StreamOperators, add_segments};
use super::means::Means;
use super::plan::{BoundaryLayer, LayerInterface, Slab};
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

/// Everything that [`HybridRun::curves`] adds, at one wavelength.
pub(super) struct SceneOperators<'a> {
    /// Per boundary layer.
    pub(super) couplings: Vec<Couplings>,
    /// Per interface.
    pub(super) interfaces: Vec<StreamOperators>,
    /// Per layer; `None` if no bulk segment is in it.
    pub(super) bulk: Vec<Option<Bulk<'a>>>,
}

/// Reflection and transmission of a boundary layer. "Down" is away from its plane.
pub(super) struct Couplings {
    /// Reflection of upward streams into downward streams: [down, up].
    pub(super) inner: Matrix,
    /// Share of each upward stream that leaves through the surface.
    pub(super) escape: Vec<f64>,
    /// Transmission of illuminations into downward streams: [stream, light].
    pub(super) entry: Matrix,
    /// Share of each illumination that leaves through the surface.
    pub(super) reflected: Vec<f64>,
}

impl HybridRun<'_> {
    /// Spectra per thickness and illumination.
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
        let curves_at = |l: usize| {
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
        for curves in batches::map(control, (0..indices.len()).collect(), curves_at)? {
            for (spectrum, [reflectance, transmittance]) in spectra.iter_mut().zip(curves) {
                spectrum.reflectance.push(reflectance);
                spectrum.transmittance.push(transmittance);
                spectrum.lost.push(0.0);
            }
        }
        Ok(spectra)
    }

    /// Results per thickness and illumination at one wavelength. Values are those of
    /// all parts of the walks; errors follow from leaving out one part at a time.
    fn measured(
        &self,
        walks: &[Arc<Walks>],
        mix: &Mix,
        coefficients: &Coefficients,
    ) -> Result<Vec<[Measured; 2]>, EngineError> {
        let curves = |means: &Means, flights: &[Flights]| self.curves(means, flights);
        let (values, others) = self.estimates(walks, mix, coefficients, curves)?;
        let curves = values.into_iter().enumerate();
        let measured = curves.map(|(c, pair)| {
            [0, 1].map(|q| Measured {
                value: pair[q],
                se: pair[q].abs() * relative_error(others.iter().map(|other| other[c][q])),
            })
        });
        Ok(measured.collect())
    }

    /// What `solve` computes at one wavelength from the means of all parts of the walks, and from
    /// those with one part left out at a time.
    pub(super) fn estimates<T>(
        &self,
        walks: &[Arc<Walks>],
        mix: &Mix,
        coefficients: &Coefficients,
        solve: impl Fn(&Means, &[Flights]) -> Result<T, EngineError>,
    ) -> Result<(T, Vec<T>), EngineError> {
        let snows = self.request.snowpack.snows();
        let flights: Vec<Flights> = snows
            .map(|snow| Flights::new(self, snow, coefficients))
            .collect();
        let parts = (0..PARTS).map(|part| self.means(walks, mix, coefficients, &flights, part));
        let parts: Vec<Means> = parts.collect();
        let mean = Means::mean(&parts);
        let others = parts
            .iter()
            .map(|part| solve(&mean.without(part), &flights));
        Ok((solve(&mean, &flights)?, others.collect::<Result<_, _>>()?))
    }

    /// Reflectance and transmittance per thickness and illumination at one
    /// wavelength.
    fn curves(&self, means: &Means, flights: &[Flights]) -> Result<Vec<Pair>, EngineError> {
        let lights = self.request.illuminations.len();
        let SceneOperators {
            couplings,
            interfaces,
            bulk,
        } = self.operators(means, flights)?;
        let n = self.streams.count();
        let identity = Matrix::identity(n);
        let mut curves = Vec::new();
        for slab in &self.plan.slabs {
            let slab = match slab {
                Slab::Thin(first) => {
                    let tasks = *first..first + lights;
                    curves.extend(tasks.map(|task| {
                        let [out, through] = means.scores(&self.layout, task);
                        [out[0], through[0]]
                    }));
                    continue;
                }
                Slab::Thick(slab) => slab,
            };
            let (upper, lower) = (&couplings[slab.upper], &couplings[slab.lower]);
            let StreamOperators {
                from_above: [r, t],
                from_below: [back, through],
            } = add_segments(&slab.inside, &bulk, &interfaces, n)?;
            // downward light at the lower boundary layer, and upward light at the
            // upper one, per downward light at the upper one
            let passed = (&identity - &(&back * &lower.inner)).solve(t)?;
            let returned = &r + &(&(&through * &lower.inner) * &passed);
            // downward light at the upper boundary layer per illumination
            let down = (&identity - &(&upper.inner * &returned)).solve(upper.entry.clone())?;
            let escaped = |escape: &[f64], streams: &Matrix, light: usize| -> f64 {
                let terms = escape.iter().enumerate();
                terms.map(|(i, escape)| escape * streams[(i, light)]).sum()
            };
            let (up, passed) = (&returned * &down, &passed * &down);
            curves.extend((0..lights).map(|light| {
                let reflected = upper.reflected[light] + escaped(&upper.escape, &up, light);
                [reflected, escaped(&lower.escape, &passed, light)]
            }));
        }
        Ok(curves)
    }

    /// The operators of all boundary layers, interfaces and layers at one wavelength.
    pub(super) fn operators(
        &self,
        means: &Means,
        flights: &[Flights],
    ) -> Result<SceneOperators<'_>, EngineError> {
        let coupling = |layer: &BoundaryLayer| self.couplings(means, layer, &flights[layer.layer]);
        let couplings: Vec<Couplings> = self.plan.boundary_layers.iter().map(coupling).collect();
        let operators =
            |interface: &LayerInterface| self.interface_operators(means, interface, flights);
        let interfaces: Vec<StreamOperators> = self.plan.interfaces.iter().map(operators).collect();
        let bulk = flights.iter().enumerate().map(|(layer, flights)| {
            let event = means.event(&self.layout, layer);
            event
                .map(|event| Bulk::new(&self.streams, &event, flights))
                .transpose()
        });
        Ok(SceneOperators {
            couplings,
            interfaces,
            bulk: bulk.collect::<Result<_, _>>()?,
        })
    }

    fn couplings(&self, means: &Means, layer: &BoundaryLayer, flights: &Flights) -> Couplings {
        let n = self.streams.count();
        let lights = if layer.is_lit {
            self.request.illuminations.len()
        } else {
            0
        };
        let scores = |source: usize| means.scores(&self.layout, layer.first + source);
        // light from inside has survived its flight up to the boundary layer
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

    /// SceneOperators from the walks next to a plane between layers.
    fn interface_operators(
        &self,
        means: &Means,
        interface: &LayerInterface,
        flights: &[Flights],
    ) -> StreamOperators {
        let n = self.streams.count();
        let ends = [interface.sections.first(), interface.sections.last()];
        let per_arriving =
            ends.map(|end| 1.0 / flights[end.map_or(0, |section| section.layer)].moment(1));
        let matrix = |side: usize, end: usize| {
            let first = interface.first + end * n;
            let mut matrix =
                self.streams_from(n, |source| means.scores(&self.layout, first + source)[side]);
            for i in 0..n {
                let row = matrix.row_mut(i).iter_mut();
                row.for_each(|x| *x *= per_arriving[end]);
            }
            matrix
        };
        StreamOperators {
            from_above: [matrix(0, 0), matrix(1, 0)],
            from_below: [matrix(1, 1), matrix(0, 1)],
        }
    }

    /// Light into every stream from each source, of `sources` in all: the polynomial
    /// with the source's `moments` over P_l(2 mu - 1), at the stream's cosine, times
    /// the stream's weight.
    fn streams_from<'a>(&self, sources: usize, moments: impl Fn(usize) -> &'a [f64]) -> Matrix {
        Matrix::from_fn(self.streams.count(), sources, |stream, source| {
            let terms = self.into_streams[stream].iter().zip(moments(source));
            terms.map(|(factor, moment)| factor * moment).sum()
        })
    }
}

/// Relative standard error of an estimate from independent parts; `values` are the
/// estimates with one part left out at a time.
fn relative_error(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    if mean == 0.0 {
        return 0.0;
    }
    // ratios are squared, because the squares of fluxes out of deep snow may underflow
    let squares: f64 = values.map(|v| (v / mean - 1.0) * (v / mean - 1.0)).sum();
    (squares * (n - 1.0) / n).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For a mean, the jackknife gives the usual standard error, however small the
    /// values.
    #[test]
    fn relative_errors_do_not_underflow() {
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
