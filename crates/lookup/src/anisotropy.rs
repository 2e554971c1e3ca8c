//! Look-ups of anisotropy factors: how the light that leaves the snow is distributed over
//! directions.
//!
//! The anisotropy factor of reflected light is the bidirectional reflectance factor toward a view
//! over the reflectance (Dumont et al. 2010); that of transmitted light is defined in the same
//! way. Its mean over the hemisphere, weighted by the cosine, is 1. It varies much less with the
//! snow than the reflectance does, and is near 1 where the snow is thick and bright.
//!
//! The factor itself is interpolated:
//!
//! - along the axes of the snow and the thickness it is linear between nodes, in the coordinates
//!   of [`crate::parameter`]. Beyond the first and the last thickness it stays constant;
//! - along the incidence angle, the view angle and the azimuth it is a cubic Hermite curve in
//!   degrees, whose slopes come from parabolas through three nodes. The factor is symmetric about
//!   the plane of incidence, and a view (or light) at the angle -x is one at x from the other
//!   side. So the curves go on beyond 0 and 180 degrees of azimuth, and beyond the normal.
mod angle;

use ndarray::ArrayView1;
use splitsnow_spectra::Quantity;
use splitsnow_spectra::simd::{F64x8, Simd, SimdKernel, dispatch};

use self::angle::{AngleAxis, Stencil};
use crate::parameter::slab_places;
use crate::{Axes, Database, Lookup, LookupError, Parameter, Point};
use crate::{absent_error, missing_curve, nodes};

/// Axes along which the factor is linear, slowest first: the first of [`Parameter::CORE`].
const LINEAR: [Parameter; 4] = [
    Parameter::Facetness,
    Parameter::GrainSize,
    Parameter::Density,
    Parameter::Thickness,
];
/// Position of the grain size among [`LINEAR`].
const GRAIN_SIZE: usize = 1;
/// Position of the thickness among [`LINEAR`].
const THICKNESS: usize = 3;
/// Largest number of nodes of [`LINEAR`] and of the incidence angle around a point.
const MOST: usize = 64;
/// Largest number of components that are summed on the stack.
const FEW: usize = 64;
/// Components per vector.
const LANES: usize = 8;
/// Largest factor. Curves through nodes that are very close together may exceed it. The smallest is
/// 0: below are only noise and the overshoot of curves.
const LARGEST: f64 = f32::MAX as f64;

/// Anisotropy factors of reflected or transmitted light, prepared for look-ups anywhere within
/// the axes.
#[derive(Debug, Clone)]
pub struct Anisotropy {
    /// Axes of the view and of [`Parameter::CORE`], as in the file.
    axes: Axes,
    /// Nodes of [`LINEAR`].
    values: [Vec<f64>; 4],
    /// Their coordinates.
    places: [Vec<f64>; 4],
    /// Counts of curves that do not exist, as [`Database::absent`].
    absent: Vec<usize>,
    incidence: AngleAxis,
    view: AngleAxis,
    azimuth: AngleAxis,
    /// Whether the light is symmetric about the normal, so that the azimuth has no effect.
    is_axial: bool,
    components: usize,
    /// `[view][azimuth][node of LINEAR][incidence][component]`, then zeros: a whole vector can
    /// be read from any place.
    table: Vec<f32>,
    /// Basis vectors, `[l / 8][component]`.
    basis: Vec<F64x8>,
    wavelengths: usize,
}

/// The nodes of [`LINEAR`] around a slab: number of each combination, and its weight.
struct Corners {
    index: [usize; 16],
    weight: [f64; 16],
    count: usize,
}

impl Corners {
    #[inline(always)]
    fn iter(&self) -> impl Iterator<Item = (usize, f64)> {
        let corners = self.index.iter().zip(&self.weight);
        corners
            .take(self.count)
            .map(|(index, weight)| (*index, *weight))
    }
}

/// The nodes around a slab, its light and its view.
struct Toward {
    view: Stencil,
    /// On the side of the view, and on the other side of the normal.
    azimuths: [Stencil; 2],
    /// Place in the table of each node of the slab and of the light, without the view, and its
    /// weight. Nodes of light from the other side of the normal come last.
    nodes: [(usize, f64); MOST],
    /// Number of nodes in all, and of light from its own side.
    counts: [usize; 2],
}

impl Toward {
    /// The nodes of light from its own side of the normal, or from the other one.
    #[inline(always)]
    fn nodes(&self, other_side: bool) -> &[(usize, f64)] {
        let [all, own] = self.counts;
        if other_side {
            &self.nodes[own..all]
        } else {
            &self.nodes[..own]
        }
    }
}

impl Anisotropy {
    /// Prepares the factors of the light that `quantity` names: reflected or transmitted.
    ///
    /// # Errors
    /// [`LookupError::Content`] if `database` does not hold anisotropy factors;
    /// [`LookupError::NoQuantity`] if it does not hold `quantity`;
    /// [`LookupError::MissingCondition`] if an optional axis of the snow has several nodes and
    /// [`Database::at`] must be called first.
    pub fn new(database: &Database, quantity: Quantity) -> Result<Self, LookupError> {
        database.require_content(true)?;
        database.require(quantity)?;
        database.require_single_block()?;
        let axes = database.axes().clone();
        let [incidence, view, azimuth] = [
            Parameter::Incidence,
            Parameter::View,
            Parameter::RelativeAzimuth,
        ]
        .map(|parameter| axes.values(parameter));
        let is_axial = incidence == [0.0] && azimuth.len() == 1;
        let ends = [
            azimuth.first() == Some(&0.0),
            azimuth.last() == Some(&180.0),
        ];
        // what is on the other side of the normal must be within the azimuths
        let goes_on = |values: &[f64]| {
            let sides = is_axial || ends == [true, true];
            [sides && values.first() == Some(&0.0), false]
        };
        let columns = database.basis(quantity);
        let (wavelengths, components) = columns.dim();
        let chunk = |l: usize, column: ArrayView1<f32>| {
            let value = |i: usize| column.get(l + i).copied().unwrap_or_default();
            F64x8::new(std::array::from_fn(|i| f64::from(value(i))))
        };
        let chunks = (0..wavelengths).step_by(LANES).flat_map(|l| {
            let columns = columns.columns().into_iter();
            columns.map(move |column| chunk(l, column))
        });
        let coefficients = database.coefficients(quantity);
        Ok(Self {
            values: LINEAR.map(|parameter| axes.values(parameter).to_vec()),
            places: LINEAR.map(|parameter| {
                let place = |value: &f64| parameter.record().scale.place(*value);
                axes.values(parameter).iter().map(place).collect()
            }),
            incidence: AngleAxis::new(incidence, goes_on(incidence), true),
            view: AngleAxis::new(view, goes_on(view), true),
            azimuth: AngleAxis::new(azimuth, ends, false),
            is_axial,
            absent: database.absent().to_vec(),
            components,
            table: ended(coefficients.iter().copied(), coefficients.len()),
            basis: chunks.collect(),
            wavelengths,
            axes,
        })
    }

    /// Number of wavelengths of a spectrum, l.
    #[must_use]
    pub fn wavelengths(&self) -> usize {
        self.wavelengths
    }

    /// Writes the anisotropy factor at `point` at each wavelength to `spectrum` (`[l]`).
    ///
    /// The azimuth may be any finite angle; it has no effect if the light is diffuse. The
    /// thickness may be any value from 0. The other coordinates must be within their axes, with
    /// a relative tolerance of 1e-6 at the ends.
    ///
    /// # Errors
    /// [`LookupError::Outside`] if a coordinate is outside its axis or missing,
    /// [`LookupError::Absent`] if a surrounding curve does not exist, and
    /// [`LookupError::Shape`] if `spectrum` has the wrong length.
    pub fn spectrum(&self, point: Point, spectrum: &mut [f32]) -> Result<(), LookupError> {
        self.times(None, point, spectrum)
    }

    /// Writes the factor times the spectrum of `lookup`, or the factor alone.
    pub(super) fn times(
        &self,
        lookup: Option<&Lookup>,
        point: Point,
        spectrum: &mut [f32],
    ) -> Result<(), LookupError> {
        if spectrum.len() != self.wavelengths {
            return Err(LookupError::Shape {
                dimension: "wavelengths",
                expected: self.wavelengths,
                found: spectrum.len(),
            });
        }
        dispatch(FactorKernel {
            anisotropy: self,
            lookup,
            point,
            spectrum,
        })
    }

    /// The factors of one `snow`: all thicknesses and directions at its other coordinates. Its own
    /// thickness and directions, if any, are ignored. Look-ups of one snow give the same
    /// spectra, to rounding, in less time.
    ///
    /// # Errors
    /// [`LookupError::Outside`] if a coordinate is outside its axis.
    pub fn material(&self, snow: Point) -> Result<Self, LookupError> {
        let slab = self.slab(snow.with(Parameter::Thickness, self.values[THICKNESS][0]))?;
        let places = slab_places(slab);
        let corners = self.corners(slab, places);
        let thicknesses = self.values[THICKNESS].len();
        let column = thicknesses * self.incidence.count * self.components;
        let snows: usize = self.values[..THICKNESS].iter().map(Vec::len).product();
        let views = self.view.count * self.azimuth.count;
        let mut sums = vec![0.0; column];
        let mut table = Vec::new();
        for view in 0..views {
            sums.fill(0.0);
            for (corner, weight) in corners.iter() {
                let begin = (view * snows + corner / thicknesses) * column;
                let nodes = &self.table[begin..begin + column];
                for (sum, node) in sums.iter_mut().zip(nodes) {
                    *sum += weight * f64::from(*node);
                }
            }
            table.extend(sums.iter().map(|sum| *sum as f32));
        }
        let (mut axes, mut values, mut coordinates) =
            (self.axes.clone(), self.values.clone(), self.places.clone());
        for axis in 0..THICKNESS {
            axes.set(LINEAR[axis], vec![slab[axis]]);
            values[axis] = vec![slab[axis]];
            coordinates[axis] = vec![places[axis]];
        }
        Ok(Self {
            table: ended(table.into_iter(), views * column),
            absent: self.absent_at(slab[GRAIN_SIZE]),
            axes,
            values,
            places: coordinates,
            incidence: self.incidence.clone(),
            view: self.view.clone(),
            azimuth: self.azimuth.clone(),
            basis: self.basis.clone(),
            ..*self
        })
    }

    /// `absent` for a single grain size, from the nodes around it.
    fn absent_at(&self, grain_size_um: f64) -> Vec<usize> {
        let missing =
            |cm: &&f64| missing_curve(&self.absent, &self.axes, grain_size_um, **cm).is_some();
        let thinnest = self.values[THICKNESS].iter().take_while(missing).count();
        Vec::from_iter((thinnest > 0).then_some(thinnest))
    }

    /// The values of `point` on [`LINEAR`], limited to the axes.
    #[inline(always)]
    fn slab(&self, point: Point) -> Result<[f64; 4], LookupError> {
        let mut slab = [0.0; 4];
        for (axis, value) in slab.iter_mut().enumerate() {
            let nodes = &self.values[axis];
            let ends = [nodes[0], nodes[nodes.len() - 1]];
            *value = inside(LINEAR[axis], ends, point[LINEAR[axis]])?;
        }
        Ok(slab)
    }

    /// The nodes around a slab, which is within the axes and has the coordinates `places`.
    #[inline(always)]
    fn corners(&self, slab: [f64; 4], places: [f64; 4]) -> Corners {
        let mut corners = Corners {
            index: [0; 16],
            weight: [1.0; 16],
            count: 1,
        };
        for axis in 0..4 {
            let nodes = &self.values[axis];
            let (on, above) = nodes::locate(nodes, slab[axis]);
            let below = on.unwrap_or(above.saturating_sub(1));
            let share = match (on, &self.places[axis][below..]) {
                (None, [from, to, ..]) if to > from => (places[axis] - from) / (to - from),
                _ => 0.0,
            };
            let count = corners.count;
            for i in 0..count {
                corners.index[i] = corners.index[i] * nodes.len() + below;
                if share > 0.0 {
                    corners.index[count + i] = corners.index[i] + 1;
                    corners.weight[count + i] = corners.weight[i] * share;
                    corners.weight[i] *= 1.0 - share;
                    corners.count = 2 * count;
                }
            }
        }
        corners
    }

    /// The nodes around `point`.
    #[inline(always)]
    fn toward(&self, point: Point) -> Result<Toward, LookupError> {
        let slab = self.slab(point)?;
        if !self.absent.is_empty() {
            let [size, thickness] = [GRAIN_SIZE, THICKNESS].map(|axis| slab[axis]);
            if let Some(missing) = missing_curve(&self.absent, &self.axes, size, thickness) {
                return Err(absent_error(missing, point));
            }
        }
        let [view, incidence] = [
            (Parameter::View, &self.view),
            (Parameter::Incidence, &self.incidence),
        ]
        .map(|(parameter, axis)| inside(parameter, axis.ends, point[parameter]));
        let view = self.view.stencil(view?);
        let incidence = self.incidence.stencil(incidence?);
        let azimuths = self.azimuths(point)?;
        let corners = self.corners(slab, slab_places(slab));
        let mut toward = Toward {
            view,
            azimuths,
            nodes: [(0, 0.0); MOST],
            counts: [0; 2],
        };
        for side in [false, true] {
            for (corner, share) in corners.iter() {
                let lights = incidence.iter().filter(|((_, other), _)| *other == side);
                for ((light, _), weight) in lights {
                    let node = corner * self.incidence.count + light;
                    toward.nodes[toward.counts[0]] = (node * self.components, share * weight);
                    toward.counts[0] += 1;
                }
            }
            if !side {
                toward.counts[1] = toward.counts[0];
            }
        }
        Ok(toward)
    }

    /// The azimuths around that of `point`, and around that of the other side of the normal.
    #[inline(always)]
    fn azimuths(&self, point: Point) -> Result<[Stencil; 2], LookupError> {
        let parameter = Parameter::RelativeAzimuth;
        if self.is_axial {
            let only = self.azimuth.stencil(self.azimuth.ends[0]);
            return Ok([only; 2]);
        }
        let turned = point[parameter].rem_euclid(360.0);
        let folded = turned.min(360.0 - turned);
        let azimuth = inside(parameter, self.azimuth.ends, folded)?;
        // the second is not used if the other side has no nodes
        Ok([azimuth, 180.0 - azimuth].map(|azimuth| self.azimuth.stencil(azimuth)))
    }

    /// [`Anisotropy::times`] for a `spectrum` of the right length.
    #[inline(always)]
    fn times_on<S: Simd>(
        &self,
        lookup: Option<&Lookup>,
        point: Point,
        spectrum: &mut [f32],
    ) -> Result<(), LookupError> {
        let toward = self.toward(point)?;
        if let Some(lookup) = lookup {
            lookup.spectrum(point, spectrum)?;
        }
        if self.components <= FEW {
            let mut few = [0.0; FEW];
            self.sums::<S>(&toward, &mut few);
            self.rebuild::<S>(&few, lookup.is_some(), spectrum);
        } else {
            let mut many = vec![0.0; self.components.next_multiple_of(LANES)];
            self.sums::<S>(&toward, &mut many);
            self.rebuild::<S>(&many, lookup.is_some(), spectrum);
        }
        Ok(())
    }

    /// Writes the components, summed over the nodes, to `sums`, which holds whole vectors.
    #[inline(always)]
    fn sums<S: Simd>(&self, toward: &Toward, sums: &mut [f64]) {
        let mut first = 0;
        while first < self.components {
            let rest = &mut sums[first..];
            first += match (self.components - first).div_ceil(LANES) {
                1 => self.block::<S, 1>(toward, first, rest),
                2 | 3 => self.block::<S, 2>(toward, first, rest),
                _ => self.block::<S, 4>(toward, first, rest),
            };
        }
    }

    /// Writes the components of `N` vectors from `first` to `sums`, and returns their number.
    #[inline(always)]
    fn block<S: Simd, const N: usize>(
        &self,
        toward: &Toward,
        first: usize,
        sums: &mut [f64],
    ) -> usize {
        let slabs: usize = self.values.iter().map(Vec::len).product();
        let stride = slabs * self.incidence.count * self.components;
        let mut sum = [F64x8::<S>::ZERO; N];
        for ((view, view_side), view_weight) in toward.view.iter() {
            for light_side in [false, true] {
                let nodes = toward.nodes(light_side);
                let azimuths = &toward.azimuths[usize::from(view_side != light_side)];
                for ((azimuth, _), weight) in azimuths.iter().filter(|_| !nodes.is_empty()) {
                    let begin = (view * self.azimuth.count + azimuth) * stride + first;
                    let mut part = [F64x8::<S>::ZERO; N];
                    for (place, weight) in nodes {
                        let at = begin + place;
                        let row = self.table[at..at + N * LANES].as_chunks::<LANES>().0;
                        let weight = F64x8::splat(*weight);
                        for (part, row) in part.iter_mut().zip(row) {
                            *part += wide(row) * weight;
                        }
                    }
                    let weight = F64x8::splat(view_weight * weight);
                    for (sum, part) in sum.iter_mut().zip(part) {
                        *sum += part * weight;
                    }
                }
            }
        }
        let (to, _) = sums.as_chunks_mut::<LANES>();
        for (to, sum) in to.iter_mut().zip(sum) {
            *to = sum.to_array();
        }
        N * LANES
    }

    /// Writes the factors of these components to `spectrum`, or multiplies it by them.
    #[inline(always)]
    fn rebuild<S: Simd>(&self, components: &[f64], multiplies: bool, spectrum: &mut [f32]) {
        let chunks = self.basis.chunks_exact(self.components);
        let [least, largest] = [0.0, LARGEST].map(F64x8::<S>::splat);
        for (to, vectors) in spectrum.chunks_mut(LANES).zip(chunks) {
            let mut factors = F64x8::<S>::ZERO;
            for (component, vector) in components.iter().zip(vectors) {
                factors += F64x8::splat(*component) * vector.on();
            }
            let factors = factors.max(least).min(largest).to_array();
            let factors = factors.map(|factor| factor as f32);
            for (to, factor) in to.iter_mut().zip(factors) {
                *to = if multiplies { *to * factor } else { factor };
            }
        }
    }
}

/// Arguments of [`Anisotropy::times`].
struct FactorKernel<'a> {
    anisotropy: &'a Anisotropy,
    lookup: Option<&'a Lookup>,
    point: Point,
    spectrum: &'a mut [f32],
}

impl SimdKernel for FactorKernel<'_> {
    type Output = Result<(), LookupError>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        self.anisotropy
            .times_on::<S>(self.lookup, self.point, self.spectrum)
    }
}

/// A value of an axis, limited to its `ends` where it exceeds them within the tolerance. The
/// thickness is limited wherever it exceeds them.
#[inline(always)]
fn inside(parameter: Parameter, [first, last]: [f64; 2], value: f64) -> Result<f64, LookupError> {
    let is_limited = parameter == Parameter::Thickness && value >= 0.0;
    let on_end = || [first, last].iter().any(|end| nodes::is_on(*end, value));
    if (first..=last).contains(&value) || is_limited || on_end() {
        return Ok(value.clamp(first, last));
    }
    Err(LookupError::Outside {
        axis: parameter.key(),
        value,
        first,
        last,
    })
}

/// These `count` numbers, then zeros: a whole vector can be read from the place of any number.
fn ended(numbers: impl Iterator<Item = f32>, count: usize) -> Vec<f32> {
    let mut table = Vec::with_capacity(count + LANES - 1);
    table.extend(numbers.chain([0.0; LANES - 1]));
    table
}

/// Eight numbers in double precision.
#[inline(always)]
fn wide<S: Simd>(numbers: &[f32; LANES]) -> F64x8<S> {
    let mut lanes = [0.0; LANES];
    for (lane, number) in lanes.iter_mut().zip(numbers) {
        *lane = f64::from(*number);
    }
    F64x8::new(lanes)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use ndarray::Array2;
    use splitsnow_spectra::simd::{Level, dispatch_at};

    use super::*;

    const VIEWS: [f64; 7] = [0.0, 15.0, 30.0, 45.0, 60.0, 70.0, 80.0];
    const AZIMUTHS: [f64; 7] = [0.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0];
    const INCIDENCES: [f64; 6] = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0];

    /// A file with the `factor` of incidence, view and azimuth (degrees) at a single wavelength,
    /// times the thickness.
    fn file(azimuths: &[f64], incidences: &[f64], factor: impl Fn([f64; 3]) -> f64) -> Database {
        let axes = Axes::from([
            (Parameter::View, VIEWS.to_vec()),
            (Parameter::RelativeAzimuth, azimuths.to_vec()),
            (Parameter::Temperature, vec![-10.0, -5.0]),
            (Parameter::Facetness, vec![0.3]),
            (Parameter::GrainSize, vec![100.0, 200.0]),
            (Parameter::Density, vec![300.0]),
            (Parameter::Thickness, vec![1.0, 2.0]),
            (Parameter::Incidence, incidences.to_vec()),
        ]);
        let value = |row| {
            let point = axes.point(row as u64);
            let angles = [
                Parameter::Incidence,
                Parameter::View,
                Parameter::RelativeAzimuth,
            ];
            let warmth = 1.0 + 0.1 * (point[Parameter::Temperature] + 10.0);
            factor(angles.map(|p| point[p])) * point[Parameter::Thickness] * warmth
        };
        let values = Array2::from_shape_fn((axes.count() as usize, 1), |(row, _)| value(row));
        Database::from_curves(true, &axes, &[500.0], None, Some(&values))
    }

    fn at(thickness_cm: f64, [incidence, view, azimuth]: [f64; 3]) -> Point {
        Point::from_core([0.3, 150.0, 300.0, thickness_cm, incidence])
            .with(Parameter::View, view)
            .with(Parameter::RelativeAzimuth, azimuth)
    }

    /// The factor at -10 degrees Celsius.
    fn look_up(file: &Database, point: Point) -> Result<f64, LookupError> {
        let cold = Point::from([(Parameter::Temperature, -10.0)]);
        let mut spectrum = [0.0];
        let prepared = Anisotropy::new(&file.at(cold)?, Quantity::Reflectance)?;
        prepared.spectrum(point, &mut spectrum)?;
        Ok(f64::from(spectrum[0]))
    }

    /// A lobe of 35 degrees half width about the mirror direction: as steep as that of snow.
    fn lobe([incidence, view, azimuth]: [f64; 3]) -> f64 {
        let unit = |polar: f64, azimuth: f64| {
            let (sin, cos) = polar.to_radians().sin_cos();
            let (y, x) = azimuth.to_radians().sin_cos();
            [sin * x, sin * y, cos]
        };
        let pairs = unit(incidence, 0.0).into_iter().zip(unit(view, azimuth));
        let cosine: f64 = pairs.map(|(a, b)| a * b).sum();
        let sharpness = 1.0 / (1.0 - 35_f64.to_radians().cos());
        0.8 + (sharpness * (cosine - 1.0)).exp()
    }

    #[test]
    fn nodes_are_exact() {
        let file = file(&AZIMUTHS, &INCIDENCES, lobe);
        for angles in [[0.0, 0.0, 0.0], [60.0, 70.0, 180.0], [75.0, 80.0, 30.0]] {
            for thickness in [1.0, 2.0] {
                let found = look_up(&file, at(thickness, angles)).unwrap();
                let expected = thickness * lobe(angles);
                assert!((found - expected).abs() < 1e-6 * expected, "{angles:?}");
            }
        }
    }

    /// Between nodes of 15 to 30 degrees, a lobe of 35 degrees keeps its height within 3 %, with
    /// both signs of the error.
    #[test]
    fn a_lobe_keeps_its_shape() {
        let file = file(&AZIMUTHS, &INCIDENCES, lobe);
        let (mut worst, mut sum, mut count) = (0.0_f64, 0.0, 0);
        for incidence in [0.0, 8.0, 40.0, 67.0] {
            for view in [0.0, 7.0, 22.0, 52.0, 76.0] {
                for azimuth in [0.0, 15.0, 75.0, 165.0, 180.0] {
                    let angles = [incidence, view, azimuth];
                    let found = look_up(&file, at(1.0, angles)).unwrap();
                    let error = found / lobe(angles) - 1.0;
                    worst = worst.max(error.abs());
                    sum += error;
                    count += 1;
                }
            }
        }
        assert!(worst < 0.03, "{worst}");
        assert!((sum / f64::from(count)).abs() < 0.003, "{sum}");
    }

    #[test]
    fn the_factor_is_symmetric_and_continuous() {
        let file = file(&AZIMUTHS, &INCIDENCES, lobe);
        let value = |angles| look_up(&file, at(1.3, angles)).unwrap();
        for azimuth in [10.0, 100.0, 170.0] {
            let expected = value([40.0, 33.0, azimuth]);
            for other in [-azimuth, 360.0 - azimuth, azimuth + 720.0] {
                assert!((value([40.0, 33.0, other]) - expected).abs() < 1e-6);
            }
            // across the normal, and of light from the normal
            let step = value([40.0, 0.01, azimuth]) - value([40.0, 0.01, 180.0 - azimuth]);
            assert!(step.abs() < 1e-3, "{step}");
            let nadir = value([40.0, 0.0, azimuth]) - value([40.0, 0.0, 0.0]);
            assert!(nadir.abs() < 1e-6, "{nadir}");
        }
    }

    #[test]
    fn the_thickness_is_limited_and_other_coordinates_are_not() {
        let file = file(&AZIMUTHS, &INCIDENCES, lobe);
        let angles = [30.0, 45.0, 60.0];
        for (thickness, expected) in [(0.0, 1.0), (0.5, 1.0), (2.0, 2.0), (1e5, 2.0)] {
            let found = look_up(&file, at(thickness, angles)).unwrap();
            assert!((found - expected * lobe(angles)).abs() < 1e-6);
        }
        let outside = [
            at(-1.0, angles),
            at(1.0, [80.0, 45.0, 0.0]),
            at(1.0, [30.0, 81.0, 0.0]),
            at(1.0, [30.0, 45.0, f64::NAN]),
            at(1.0, angles).with(Parameter::Density, 200.0),
            Point::from_core([0.3, 150.0, 300.0, 1.0, 30.0]),
        ];
        for point in outside {
            let error = look_up(&file, point).unwrap_err();
            assert!(matches!(error, LookupError::Outside { .. }), "{error}");
        }
        let error = Anisotropy::new(&file, Quantity::Reflectance).unwrap_err();
        assert!(error.to_string().contains("temperature_c"), "{error}");
    }

    /// With a part of the azimuths, the curves end at the normal.
    #[test]
    fn a_part_of_the_azimuths_is_enough() {
        let file = file(&[0.0, 30.0, 60.0], &INCIDENCES, lobe);
        let angles = [20.0, 22.0, 40.0];
        let error = look_up(&file, at(1.0, angles)).unwrap() / lobe(angles) - 1.0;
        assert!(error.abs() < 0.05, "{error}");
        assert!(look_up(&file, at(1.0, [20.0, 22.0, 61.0])).is_err());
    }

    /// Nodes that are very close together give steep curves, which stay finite.
    #[test]
    fn factors_are_finite() {
        let near = file(
            &[0.0],
            &[0.0, f64::from(f32::from_bits(1)), 60.0],
            |[x, ..]| {
                if x == 0.0 { -1e9 } else { 1e9 }
            },
        );
        let look_up = |angle| look_up(&near, at(1.0, [angle, 0.0, 0.0])).unwrap();
        // the first is that of a node below 0
        let found = [0.0, 1e-45, 30.0, 60.0].map(look_up);
        assert!(
            found.iter().all(|factor| (0.0..=LARGEST).contains(factor)),
            "{found:?}"
        );
        assert_eq!(found[0], 0.0);
        assert!(found.contains(&LARGEST));
    }

    /// Of light that is symmetric about the normal one azimuth is enough.
    #[test]
    fn diffuse_light_has_no_azimuth() {
        let of_view = |[_, view, _]: [f64; 3]| 1.0 + 0.2 * view.to_radians().cos();
        let file = file(&[0.0], &[0.0], of_view);
        for azimuth in [0.0, 77.0, f64::NAN] {
            let angles = [0.0, 10.0, azimuth];
            let found = look_up(&file, at(1.0, angles)).unwrap();
            assert!((found - of_view(angles)).abs() < 1e-3, "{found}");
        }
    }

    #[test]
    fn files_of_another_content_are_refused() {
        let views = file(&AZIMUTHS, &INCIDENCES, lobe);
        let cold = Point::from([(Parameter::Temperature, -10.0)]);
        let views = views.at(cold).unwrap();
        let axes = views.axes().without_views();
        let values = Array2::from_elem((axes.count() as usize, 1), 0.5);
        let plain = Database::from_curves(true, &axes, &[500.0], None, Some(&values));
        let quantity = Quantity::Reflectance;
        let error = crate::Lookup::new(&views, quantity).unwrap_err();
        assert!(error.to_string().contains("holds anisotropy factors"));
        assert!(crate::Varsa2025::new(&views, quantity).is_err());
        let error = Anisotropy::new(&plain, quantity).unwrap_err();
        assert!(error.to_string().contains("views.safetensors"), "{error}");
        let directions = crate::Directions::new(&plain, &views).unwrap();
        let mut brf = [0.0];
        let angles = [60.0, 60.0, 0.0];
        let factor = crate::DirectionalQuantity::ReflectanceFactor;
        directions
            .spectrum(factor, at(1.0, angles), &mut brf)
            .unwrap();
        let expected = 0.5 * lobe(angles);
        assert!((f64::from(brf[0]) - expected).abs() < 1e-5, "{brf:?}");
        let material = directions.material(at(1.0, angles)).unwrap();
        material
            .spectrum(factor, at(1.0, angles), &mut brf)
            .unwrap();
        assert!((f64::from(brf[0]) - expected).abs() < 1e-5, "{brf:?}");
        assert!(directions.material(Point::default()).is_err());
        assert!(crate::Directions::new(&views, &views).is_err());
    }

    /// A file of `l` wavelengths whose factors depend on all axes but the temperature.
    fn rich(l: usize) -> Database {
        let axes = file(&AZIMUTHS, &INCIDENCES, lobe).axes().clone();
        let axes = axes
            .with(Parameter::Temperature, vec![-5.0])
            .with(Parameter::Facetness, vec![0.1, 0.4, 0.9])
            .with(Parameter::Density, vec![200.0, 400.0])
            .with(Parameter::Thickness, vec![1.0, 2.0, 5.0]);
        let angles = [
            Parameter::Incidence,
            Parameter::View,
            Parameter::RelativeAzimuth,
        ];
        let factor = |(row, l): (usize, usize)| {
            let point = axes.point(row as u64);
            let slab: f64 = LINEAR.map(|p| point[p].ln_1p()).iter().sum();
            lobe(angles.map(|p| point[p])) * (1.0 + 0.1 * (slab * (1 + l) as f64).sin())
        };
        let values = Array2::from_shape_fn((axes.count() as usize, l), factor);
        let nm: Vec<f64> = (0..l).map(|l| 400.0 + 10.0 * l as f64).collect();
        let file = Database::from_curves(true, &axes, &nm, None, Some(&values));
        file.at(Point::default()).unwrap()
    }

    /// Scattered points within the axes of [`rich`], and some outside.
    fn scattered() -> impl Iterator<Item = Point> {
        let mut u = [0.5; 7];
        (0..300).map(move |i| {
            let steps = [0.8567, 0.7339, 0.6287, 0.5386, 0.4614, 0.3953, 0.3387];
            u.iter_mut()
                .zip(steps)
                .for_each(|(u, step)| *u = (*u + step) % 1.0);
            let [a, b, c, d, e, f, g] = u;
            let core = [
                0.1 + 0.8 * a,
                100.0 + 100.0 * b,
                200.0 + 200.0 * c,
                6.0 * d,
                78.0 * e,
            ];
            let directions = [82.0 * f, 720.0 * g - 360.0];
            let views = Parameter::VIEWS.into_iter().zip(directions);
            let point = Point::from_core(core).and(views.collect());
            // on nodes
            match i % 7 {
                0 => point.with(Parameter::GrainSize, 200.0),
                1 => point
                    .with(Parameter::View, 0.0)
                    .with(Parameter::Facetness, 0.4),
                _ => point,
            }
        })
    }

    /// One to more vectors of components than fit on the stack.
    #[test]
    fn all_levels_give_the_same_bits() {
        for l in [1, 8, 21, 31, 70] {
            let anisotropy = Anisotropy::new(&rich(l), Quantity::Reflectance).unwrap();
            for point in scattered().take(40) {
                let found = Level::supported().map(|level| {
                    let mut spectrum = vec![0.0; l];
                    let kernel = FactorKernel {
                        anisotropy: &anisotropy,
                        lookup: None,
                        point,
                        spectrum: &mut spectrum,
                    };
                    let is_inside = dispatch_at(level, kernel).unwrap().is_ok();
                    (is_inside, spectrum.iter().map(|v| v.to_bits()).collect())
                });
                let found: Vec<(bool, Vec<u32>)> = found.collect();
                assert!(found.iter().all(|other| *other == found[0]), "{point}");
            }
        }
    }

    #[test]
    fn a_material_has_the_same_factors() {
        let file = rich(21).with_absent(&[0, 1]);
        let anisotropy = Anisotropy::new(&file, Quantity::Reflectance).unwrap();
        let (mut answered, mut outside, mut absent) = (0, 0, 0);
        for point in scattered() {
            let material = anisotropy.material(point).unwrap();
            let [mut direct, mut of_snow] = [[0.0; 21]; 2];
            let expected = anisotropy.spectrum(point, &mut direct);
            let found = material.spectrum(point, &mut of_snow);
            match (expected, found) {
                (Ok(()), Ok(())) => {
                    for (a, b) in direct.iter().zip(of_snow) {
                        assert!((a - b).abs() < 3e-7 * a.abs(), "{point}: {a} {b}");
                    }
                    answered += 1;
                }
                (Err(LookupError::Absent { .. }), Err(LookupError::Absent { .. })) => absent += 1,
                (Err(expected), Err(found)) => {
                    assert_eq!(expected.to_string(), found.to_string());
                    outside += 1;
                }
                (expected, found) => panic!("{point}: {expected:?} {found:?}"),
            }
            let other = point.with(Parameter::Density, 199.0);
            assert!(anisotropy.material(other).is_err());
            let other = point.with(Parameter::Density, point[Parameter::Density] + 1.0);
            assert!(material.spectrum(other, &mut of_snow).is_err());
        }
        assert!(
            answered > 150 && outside > 2 && absent > 50,
            "{answered} {outside} {absent}"
        );
    }
}
