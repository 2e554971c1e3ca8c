//! Adds boundary layers and what is between them, at every wavelength.
use std::sync::Arc;

use super::Run;
use super::walks::{Part, Walks};
use crate::engine::EngineError;
use crate::engine::nodes::Mix;
use crate::engine::tables::PARTS;
use crate::math::legendre;
use crate::measurement::{Measured, Spectrum};
use crate::optics::Index;
use crate::slab::{Matrix, Medium};
use crate::table::{Event, Kernel, Scores};

/// Wavelengths at which standard errors are found; between them they are
/// interpolated relative to the values.
const ANCHORS: usize = 5;

/// Reflectance and transmittance.
type Pair = [f64; 2];

/// Absorption coefficients of ice and water, 1/m.
#[derive(Clone, Copy)]
struct Absorption {
    ice_per_m: f64,
    water_per_m: f64,
}

/// What a boundary layer does to light, and the grains below it.
struct Couplings {
    /// From streams going up to streams going down: [down, up].
    inner: Matrix,
    /// From streams going up out through the surface.
    escape: Vec<f64>,
    /// From lights to streams going down: [stream, light].
    entry: Matrix,
    /// From lights out through the surface again.
    reflected: Vec<f64>,
    event: Event,
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
        let absorption = |l: usize| {
            let (ice, water) = indices[l];
            let nm = request.wavelengths_nm[l];
            Absorption {
                ice_per_m: ice.absorption_per_m(nm),
                water_per_m: water.absorption_per_m(nm),
            }
        };
        let curves = |l: usize, part| self.curves(walks, &mixes[l], absorption(l), part);
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
        absorption: Absorption,
        part: Part,
    ) -> Result<Vec<Pair>, EngineError> {
        let request = self.request;
        let lights = request.illuminations.len();
        let mut curves: Vec<Pair> = (0..self.thin * lights)
            .map(|curve| thin(walks, mix, absorption, part, curve))
            .collect();
        if self.is_all_thin() {
            return Ok(curves);
        }
        let couplings = self.couplings(walks, mix, absorption, part);
        let Couplings { inner, entry, .. } = &couplings;
        let medium = Medium::delta_m(&self.streams, &couplings.event.moments)?;
        let mean_free_path_m = couplings
            .event
            .effective_mean_free_path_m(self.flight_m(absorption));
        let one = Matrix::identity(self.streams.count());
        for thickness_m in &request.thicknesses_m[self.thin..] {
            let inside_m = thickness_m - 2.0 * self.layer_m;
            let inside = medium.operators(inside_m / mean_free_path_m)?;
            let (r, t) = (inside.reflection, inside.transmission);
            // downward at the lower layer, and upward at the upper one, per
            // downward at the upper one
            let passed = (&one - &(&r * inner)).solve(t.clone())?;
            let returned = &r + &(&(&t * inner) * &passed);
            // what the lights send down at the upper layer in the end
            let down = (&one - &(inner * &returned)).solve(entry.clone())?;
            let escaped = |up: &Matrix, light: usize| -> f64 {
                let streams = couplings.escape.iter().enumerate();
                streams.map(|(i, escape)| escape * up[(i, light)]).sum()
            };
            let (up, through) = (&returned * &down, &passed * &down);
            curves.extend((0..lights).map(|light| {
                let reflected = couplings.reflected[light] + escaped(&up, light);
                [reflected, escaped(&through, light)]
            }));
        }
        Ok(curves)
    }

    /// Share of flights that survive the water they cross.
    fn survival(&self, absorption: Absorption) -> f64 {
        1.0 / (1.0 + absorption.water_per_m * self.mean_free_distance_m)
    }

    /// Mean length, and root of half the mean square, m, of flights that light
    /// survives: those through water that absorbs are the shorter ones.
    fn flight_m(&self, absorption: Absorption) -> [f64; 2] {
        let (d, wet) = (
            self.mean_free_distance_m,
            self.request.pack.surface.water_saturation,
        );
        let survival = self.survival(absorption);
        let moment = |n| 1.0 - wet + wet * survival.powi(n);
        [
            d * moment(2) / moment(1),
            d * (moment(3) / moment(1)).sqrt(),
        ]
    }

    fn couplings(
        &self,
        walks: &[Arc<Walks>],
        mix: &Mix,
        absorption: Absorption,
        part: Part,
    ) -> Couplings {
        let Absorption {
            ice_per_m,
            water_per_m,
        } = absorption;
        let n = self.streams.count();
        let lights = self.request.illuminations.len();
        let mut out = vec![0.0; n + lights];
        let mut moments = vec![vec![0.0; n]; n + lights];
        let (mut left, mut through) = ([0.0], vec![0.0; n]);
        // light from below is what survived its flight up to the layer
        let wet = self.request.pack.surface.water_saturation;
        let arriving = 1.0 - wet + wet * self.survival(absorption);
        for (walks, share) in mix.of(walks) {
            for source in 0..n + lights {
                let scores = &walks.ends(part).layer[source];
                let arriving = if source < n { arriving } else { 1.0 };
                let share = share / (arriving * scores.rays as f64);
                scores.out.weighted(ice_per_m, water_per_m, &mut left);
                scores
                    .through
                    .weighted(ice_per_m, water_per_m, &mut through);
                out[source] += share * left[0];
                let sums = moments[source].iter_mut().zip(&through);
                sums.for_each(|(sum, score)| *sum += share * score);
            }
        }
        // Light that leaves downward at mu is the polynomial with these moments
        // over P_l(2 mu - 1), at the nodes of the streams and with their weights.
        let basis: Vec<Vec<f64>> = self
            .streams
            .cosines()
            .iter()
            .map(|cosine| {
                let mut p = vec![0.0; n];
                legendre(2.0 * cosine - 1.0, &mut p);
                p
            })
            .collect();
        let weights = self.streams.weights();
        let into = |stream: usize, source: usize| -> f64 {
            let terms = basis[stream].iter().zip(&moments[source]).enumerate();
            let sum: f64 = terms.map(|(l, (p, m))| (2 * l + 1) as f64 * p * m).sum();
            weights[stream] * sum
        };
        Couplings {
            inner: Matrix::from_fn(n, n, into),
            escape: out[..n].to_vec(),
            entry: Matrix::from_fn(n, lights, |stream, light| into(stream, n + light)),
            reflected: out[n..].to_vec(),
            event: self.event(walks, mix, absorption, part),
        }
    }

    /// The mean grain event inside the snow.
    fn event(&self, walks: &[Arc<Walks>], mix: &Mix, absorption: Absorption, part: Part) -> Event {
        let snow = &self.request.pack.surface;
        let size_m = snow.sizes_m();
        let survival = self.survival(absorption);
        let of = |walks: &Walks| {
            let [air, water] = walks.kernels(part);
            let event = |kernel: &Kernel| kernel.event(size_m, absorption.ice_per_m);
            match snow.water_saturation {
                0.0 => event(air),
                share => event(air).mix(&event(water).attenuated(survival), share),
            }
        };
        let [first, second] = mix.nodes.map(|node| &walks[node]);
        match mix.share {
            0.0 => of(first),
            1.0 => of(second),
            share => of(first).mix(&of(second), share),
        }
    }
}

/// One slab without an inside under one light.
fn thin(walks: &[Arc<Walks>], mix: &Mix, absorption: Absorption, part: Part, curve: usize) -> Pair {
    let Absorption {
        ice_per_m,
        water_per_m,
    } = absorption;
    let mut pair = [0.0; 2];
    for (walks, share) in mix.of(walks) {
        let Scores { out, through, rays } = &walks.ends(part).thin[curve];
        for (sum, scores) in pair.iter_mut().zip([out, through]) {
            let mut score = [0.0];
            scores.weighted(ice_per_m, water_per_m, &mut score);
            *sum += share * score[0] / *rays as f64;
        }
    }
    pair
}

/// Standard error of the mean of independent values, relative to that mean.
fn relative_error(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    let squares: f64 = values.map(|v| (v - mean) * (v - mean)).sum();
    if mean == 0.0 {
        return 0.0;
    }
    (squares / (n * (n - 1.0))).sqrt() / mean.abs()
}
