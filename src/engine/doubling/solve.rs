//! Adds boundary layers and what is between them, at every wavelength.
use std::sync::Arc;

use super::Run;
use super::cut::{BoundaryLayer, Joint, Slab};
use super::inside::{Flights, Inside, inside};
use super::planes::Piece;
use super::walks::{Part, Walks};
use crate::engine::nodes::Mix;
use crate::engine::tables::PARTS;
use crate::engine::{EngineError, coefficients};
use crate::math::legendre;
use crate::measurement::{Measured, Spectrum};
use crate::optics::Index;
use crate::slab::Matrix;
use crate::table::Scores;
use crate::transport::{Coefficients, Snow};

/// Wavelengths at which standard errors are found; between them they are
/// interpolated relative to the values.
const ANCHORS: usize = 5;

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
        walks: &[Arc<Walks>],
        indices: &[(Index, Index)],
        mixes: &[Mix],
    ) -> Result<Vec<Spectrum>, EngineError> {
        let request = self.request;
        let coefficients = coefficients(request, indices);
        let curves = |l: usize, part| self.curves(walks, &mixes[l], &coefficients[l], part);
        let wavelengths = indices.len();
        let count = request.thicknesses_m.len() * request.illuminations.len();
        let mut spectra = vec![Spectrum::default(); count];
        let mut scatter = Vec::new();
        let anchors = ANCHORS.min(wavelengths);
        for anchor in 0..anchors {
            let l = anchor * (wavelengths - 1) / (anchors - 1).max(1);
            let parts = (0..PARTS).map(|part| curves(l, Part::One(part)));
            let parts: Vec<Vec<Pair>> = parts.collect::<Result<_, _>>()?;
            let relative = |c: usize| [0, 1].map(|q| relative_error(parts.iter().map(|p| p[c][q])));
            scatter.push((l, (0..count).map(relative).collect::<Vec<_>>()));
        }
        for l in 0..wavelengths {
            let after = scatter.partition_point(|(anchor, _)| *anchor < l);
            let (before, after) = (&scatter[after.saturating_sub(1)], &scatter[after]);
            let share = match after.0 - before.0 {
                0 => 0.0,
                between => (l - before.0) as f64 / between as f64,
            };
            for (c, values) in curves(l, Part::All)?.into_iter().enumerate() {
                let measured = |q: usize| {
                    let relative = (1.0 - share) * before.1[c][q] + share * after.1[c][q];
                    let value = values[q];
                    let se = relative * value.abs();
                    Measured { value, se }
                };
                spectra[c].reflectance.push(measured(0));
                spectra[c].transmittance.push(measured(1));
                spectra[c].lost.push(0.0);
            }
        }
        Ok(spectra)
    }

    /// Every thickness and light at one wavelength, from `part` of the walks.
    fn curves(
        &self,
        walks: &[Arc<Walks>],
        mix: &Mix,
        coefficients: &Coefficients,
        part: Part,
    ) -> Result<Vec<Pair>, EngineError> {
        let lights = self.request.illuminations.len();
        let snows: Vec<&Snow> = self.request.pack.snows().collect();
        let couple = |layer: &BoundaryLayer| {
            self.couplings(walks, mix, coefficients, part, layer, snows[layer.snow])
        };
        let couplings: Vec<Couplings> = self.plan.layers.iter().map(couple).collect();
        let join = |joint: &Joint| self.joined(walks, mix, coefficients, part, joint, &snows);
        let joints: Vec<Inside> = self.plan.joints.iter().map(join).collect();
        let mut points = Vec::new();
        for (number, snow) in snows.iter().enumerate() {
            let inner = self.plan.slabs.iter().any(|slab| match slab {
                Slab::Thin(_) => false,
                Slab::Thick(cut) => cut
                    .inside
                    .iter()
                    .any(|piece| matches!(piece, Piece::Points(stretch) if stretch.snow == number)),
            });
            let of = || self.points(walks, mix, coefficients, part, number, snow);
            points.push(inner.then(of).transpose()?);
        }
        let n = self.streams.count();
        let one = Matrix::identity(n);
        let mut curves = Vec::new();
        for slab in &self.plan.slabs {
            let cut = match slab {
                Slab::Thin(first) => {
                    let tasks = *first..first + lights;
                    curves.extend(tasks.map(|task| thin(walks, mix, coefficients, part, task)));
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

    fn couplings(
        &self,
        walks: &[Arc<Walks>],
        mix: &Mix,
        coefficients: &Coefficients,
        part: Part,
        layer: &BoundaryLayer,
        snow: &Snow,
    ) -> Couplings {
        let n = self.streams.count();
        let lights = if layer.is_lit {
            self.request.illuminations.len()
        } else {
            0
        };
        let mut out = vec![0.0; n + lights];
        let mut moments = vec![vec![0.0; n]; n + lights];
        let (mut left, mut through) = ([0.0], vec![0.0; n]);
        // light from inside is what survived its flight up to the layer
        let arriving = Flights::new(self, snow, coefficients).moment(1);
        for (walks, share) in mix.of(walks) {
            for source in 0..n + lights {
                let scores = walks.scores(part, layer.first + source);
                let arriving = if source < n { arriving } else { 1.0 };
                let share = share / (arriving * scores.rays as f64);
                scores.out.weighted(coefficients, &mut left);
                scores.through.weighted(coefficients, &mut through);
                out[source] += share * left[0];
                let sums = moments[source].iter_mut().zip(&through);
                sums.for_each(|(sum, score)| *sum += share * score);
            }
        }
        let into = |stream: usize, source: usize| self.stream_from(stream, &moments[source]);
        Couplings {
            inner: Matrix::from_fn(n, n, into),
            escape: out[..n].to_vec(),
            entry: Matrix::from_fn(n, lights, |stream, light| into(stream, n + light)),
            reflected: out[n..].to_vec(),
        }
    }

    /// What the walks next to a plane between layers come to.
    fn joined(
        &self,
        walks: &[Arc<Walks>],
        mix: &Mix,
        coefficients: &Coefficients,
        part: Part,
        joint: &Joint,
        snows: &[&Snow],
    ) -> Inside {
        let n = self.streams.count();
        let ends = [joint.stretches.first(), joint.stretches.last()];
        let arriving = ends.map(|end| {
            let snow = snows[end.map_or(0, |stretch| stretch.snow)];
            Flights::new(self, snow, coefficients).moment(1)
        });
        let (mut up, mut down) = (vec![vec![0.0; n]; 2 * n], vec![vec![0.0; n]; 2 * n]);
        let mut score = vec![0.0; n];
        for (walks, share) in mix.of(walks) {
            for source in 0..2 * n {
                let scores = walks.scores(part, joint.first + source);
                let share = share / (arriving[source / n] * scores.rays as f64);
                for (from, to) in [(&scores.out, &mut up), (&scores.through, &mut down)] {
                    from.weighted(coefficients, &mut score);
                    let sums = to[source].iter_mut().zip(&score);
                    sums.for_each(|(sum, score)| *sum += share * score);
                }
            }
        }
        let matrix = |moments: &[Vec<f64>], first: usize| {
            Matrix::from_fn(n, n, |to, from| {
                self.stream_from(to, &moments[first + from])
            })
        };
        Inside {
            from_above: [matrix(&up, 0), matrix(&down, 0)],
            from_below: [matrix(&down, n), matrix(&up, n)],
        }
    }

    /// Light into a stream: the polynomial with these moments over P_l(2 mu - 1), at
    /// the stream's cosine and with its weight.
    fn stream_from(&self, stream: usize, moments: &[f64]) -> f64 {
        let mut basis = vec![0.0; moments.len()];
        legendre(2.0 * self.streams.cosines()[stream] - 1.0, &mut basis);
        let terms = basis.iter().zip(moments).enumerate();
        let sum: f64 = terms.map(|(l, (p, m))| (2 * l + 1) as f64 * p * m).sum();
        self.streams.weights()[stream] * sum
    }
}

/// One slab without an inside under one light: that of `task`.
fn thin(
    walks: &[Arc<Walks>],
    mix: &Mix,
    coefficients: &Coefficients,
    part: Part,
    task: usize,
) -> Pair {
    let mut pair = [0.0; 2];
    for (walks, share) in mix.of(walks) {
        let Scores { out, through, rays } = walks.scores(part, task);
        for (sum, scores) in pair.iter_mut().zip([out, through]) {
            let mut score = [0.0];
            scores.weighted(coefficients, &mut score);
            *sum += share * score[0] / *rays as f64;
        }
    }
    pair
}

/// Standard error of the mean of independent values, relative to that mean.
fn relative_error(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    if mean == 0.0 {
        return 0.0;
    }
    // of ratios: the squares of what leaves deep snow may be too small for a number
    let squares: f64 = values.map(|v| (v / mean - 1.0) * (v / mean - 1.0)).sum();
    (squares / (n * (n - 1.0))).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_what_hardly_leaves_are_as_large() {
        let values = [1.0, 2.0, 6.0];
        for scale in [1.0, 1e-199] {
            let error = relative_error(values.iter().map(|v| v * scale));
            assert!(
                (error - (14.0 / 6.0_f64).sqrt() / 3.0).abs() < 1e-12,
                "{error}"
            );
        }
        assert_eq!(relative_error([0.0; 8].into_iter()), 0.0);
    }
}
