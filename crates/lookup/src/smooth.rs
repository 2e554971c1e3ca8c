//! The method `smooth`: look-up anywhere within the axes, by interpolation in variables in
//! which the spectra of snow are smooth.
//!
//! The interpolated variable is y = -ln T, or -ln(1 - R) for reflectance. Both are 0 at
//! thickness 0 and increase with thickness. In the coordinates of [`crate::parameter`],
//!
//! - along the thickness y is a monotone cubic Hermite curve. Slopes come from parabolas
//!   through three nodes and are limited to three times the smaller neighbouring secant
//!   (Fritsch and Carlson 1980). The curve starts from 0 at 0 cm, or, over a substrate
//!   that reflects or other layers, from the first node;
//! - along the other axes y is linear between nodes: a mean of columns with non-negative
//!   weights.
//!
//! The result therefore lies between the values at the surrounding nodes, is in [0, 1],
//! increases (R) or decreases (T) with thickness as the nodes do, and is continuous.
//! Outside the thickness nodes it is extrapolated by [`super::diffusion`].
//!
//! If the basis of the file is one of y (`log`), the table holds values and slopes as
//! coefficients of that basis: all wavelengths share one limiter, and the cost of a
//! spectrum is that of a few components. For a file with plain spectra (`linear`), the
//! table holds values and slopes per wavelength.
mod prepare;

use ndarray::ArrayView1;
use splitsnow_spectra::Quantity;
use splitsnow_spectra::elementary::exp_neg_single as exp_neg;
use splitsnow_spectra::simd::{F32x8, F64x8, Portable, Simd, SimdKernel, dispatch};

use crate::diffusion::Diffusion;
use crate::parameter::{core_places, thickness_slope};
use crate::{
    Axes, Basis, Database, LookupError, MissingCurve, Parameter, Point, absent_error,
    missing_curve, nodes,
};

/// Position of the thickness among [`Parameter::CORE`].
const THICKNESS: usize = 3;
/// Position of the incidence angle among [`Parameter::CORE`].
const INCIDENCE: usize = 4;
/// Extra nodes below the first thickness, as fractions of it, for a black substrate.
const THIN: [f32; 7] = [0.0, 0.015625, 0.03125, 0.0625, 0.125, 0.25, 0.5];
/// Largest y taken from spectra of a `linear` file: darker values are noise from the
/// truncation of the basis.
const DARKEST: f32 = 16.0;
/// Components per vector: the values of four components, then their slopes.
const LANES: usize = 4;
/// Largest number of components that are summed on the stack.
const FEW: usize = 64;
/// Largest size of the table, bytes.
const MOST_BYTES: u128 = 1 << 30;
/// Number of vectors summed at a time.
const BLOCK: usize = 8;

/// One quantity of a database, prepared for look-ups anywhere within its axes.
#[derive(Debug, Clone)]
pub struct Lookup {
    quantity: Quantity,
    /// Axes of [`Parameter::CORE`], as in the file.
    axes: Axes,
    /// Node values of these axes, in single precision.
    values: [Vec<f32>; 5],
    /// Node coordinates of these axes. The thickness begins with the [`THIN`] nodes if
    /// the substrate is black.
    places: [Vec<f32>; 5],
    /// Counts of curves that do not exist, as [`Database::absent`].
    absent: Vec<usize>,
    /// Number of vectors per node.
    width: usize,
    /// `[node][width]`: y and its slope along the thickness.
    table: Vec<F32x8>,
    /// Number of components of the basis; 0 if the wavelengths are the components.
    components: usize,
    /// Basis vectors, `[l / 8][component]`.
    basis: Vec<F32x8>,
    wavelengths: usize,
}

/// The columns around a point: the table index of the node below the thickness in each
/// column, and the weight of the column.
struct Corners {
    index: [usize; 16],
    weight: [f32; 16],
    count: usize,
}

impl Corners {
    #[inline(always)]
    fn iter(&self) -> impl Iterator<Item = (usize, f32)> {
        let corners = self.index.iter().zip(&self.weight);
        corners
            .take(self.count)
            .map(|(index, weight)| (*index, *weight))
    }
}

impl Lookup {
    /// Prepares `quantity` of `database`. Takes about 10 ms for 25,000 curves.
    ///
    /// # Errors
    /// [`LookupError::Content`] if the file holds anisotropy factors;
    /// [`LookupError::NoQuantity`] if it does not hold `quantity`;
    /// [`LookupError::MissingCondition`] if an optional axis has several nodes and
    /// [`Database::at`] must be called first; [`LookupError::TooLarge`] if the table would
    /// exceed 1 GB, which happens with many curves and wavelengths of a `linear` file.
    pub fn new(database: &Database, quantity: Quantity) -> Result<Self, LookupError> {
        database.require_content(false)?;
        database.require(quantity)?;
        database.require_single_block()?;
        let axes = database.axes().clone();
        let values = Parameter::CORE
            .map(|parameter| axes.values(parameter).iter().map(|v| *v as f32).collect());
        let values: [Vec<f32>; 5] = values;
        let mut places: [Vec<f32>; 5] = Default::default();
        for (axis, (places, values)) in places.iter_mut().zip(&values).enumerate() {
            let thin = THIN.map(|part| part * values[0]);
            // a single thickness needs a second node
            let has_thin_nodes = database.has_black_substrate() || values.len() == 1;
            let thin = thin
                .into_iter()
                .filter(|_| axis == THICKNESS && has_thin_nodes);
            let place = |value| {
                let mut point = [0.0, 1.0, 1.0, 0.0, 0.0];
                point[axis] = value;
                core_places::<Portable>(point)[axis]
            };
            let values = thin.chain(values.iter().copied());
            *places = values.map(place).collect();
        }
        let columns = database.basis(quantity);
        let (wavelengths, components) = columns.dim();
        let logarithmic = database.basis_kind() == Basis::Log;
        let depth = if logarithmic { components } else { wavelengths };
        let width = depth.div_ceil(LANES);
        let nodes = database.curves() / values[THICKNESS].len() * places[THICKNESS].len();
        let bytes = (nodes as u128) * (width * size_of::<F32x8>()) as u128;
        if bytes > MOST_BYTES {
            return Err(LookupError::TooLarge { bytes });
        }
        let mut lookup = Self {
            quantity,
            axes,
            values,
            places,
            absent: database.absent().to_vec(),
            width,
            table: Vec::new(),
            components: 0,
            basis: Vec::new(),
            wavelengths,
        };
        if logarithmic {
            lookup.components = components;
            for l in (0..wavelengths).step_by(8) {
                let chunk = |column: ArrayView1<f32>| {
                    let value = |i: usize| column.get(l + i).copied().unwrap_or_default();
                    F32x8::new(std::array::from_fn(value))
                };
                lookup
                    .basis
                    .extend(columns.columns().into_iter().map(chunk));
            }
        }
        lookup.table = lookup.filled(database, depth);
        Ok(lookup)
    }

    /// Number of wavelengths of a spectrum, l.
    #[must_use]
    pub fn wavelengths(&self) -> usize {
        self.wavelengths
    }

    /// Writes the spectrum at `point` to `spectrum` (`[l]`).
    ///
    /// The thickness may be any value from 0 if the substrate is black
    /// ([`Database::has_black_substrate`]), otherwise any value from its first node; if the
    /// file has a single thickness, it must be that one. The other coordinates must be
    /// within their axes, with a relative tolerance of 1e-6 at the ends.
    ///
    /// # Errors
    /// [`LookupError::Outside`] if a coordinate is outside its axis,
    /// [`LookupError::Absent`] if a surrounding curve does not exist, and
    /// [`LookupError::Shape`] if `spectrum` has the wrong length.
    pub fn spectrum(&self, point: Point, spectrum: &mut [f32]) -> Result<(), LookupError> {
        if spectrum.len() != self.wavelengths {
            return Err(LookupError::Shape {
                dimension: "wavelengths",
                expected: self.wavelengths,
                found: spectrum.len(),
            });
        }
        dispatch(SpectrumKernel {
            lookup: self,
            point,
            spectrum,
        })
    }

    /// [`Lookup::spectrum`] for a `spectrum` of the right length.
    #[inline(always)]
    fn spectrum_on<S: Simd>(&self, point: Point, spectrum: &mut [f32]) -> Result<(), LookupError> {
        let values = self.inside(point).ok_or_else(|| self.outside(point))?;
        if !self.absent.is_empty()
            && let Some(missing) = self.missing_curve(values[1], values[THICKNESS])
        {
            return Err(absent_error(missing, point));
        }
        let places = core_places::<S>(values);
        let x = &self.places[THICKNESS];
        if places[THICKNESS] <= x[x.len() - 1] {
            let (corners, cell) = self.corners(places);
            let t = fraction(x, cell, places[THICKNESS]);
            let step = x[cell + 1] - x[cell];
            self.depths::<S>(&corners, hermite(t, step), spectrum);
        } else {
            self.depths_beyond::<S>(places, point[Parameter::Thickness] as f32, spectrum);
        }
        self.to_quantity(spectrum);
        Ok(())
    }

    /// A look-up restricted to one `snow`: all thicknesses and angles at its other
    /// coordinates. Its own thickness and angle, if any, are ignored. Renderers that look up
    /// many points of one snow get the same spectra, to rounding, in less time.
    ///
    /// # Errors
    /// [`LookupError::Outside`] if a coordinate is outside its axis.
    pub fn material(&self, snow: Point) -> Result<Self, LookupError> {
        let point = snow
            .with(Parameter::Thickness, f64::from(self.values[THICKNESS][0]))
            .with(Parameter::Incidence, f64::from(self.values[INCIDENCE][0]));
        let values = self.inside(point).ok_or_else(|| self.outside(point))?;
        let places = core_places::<Portable>(values);
        let (corners, _) = self.corners(places);
        let column = self.places[THICKNESS].len() * self.values[INCIDENCE].len() * self.width;
        let mut table = vec![F32x8::ZERO; column];
        let mut material = Self {
            axes: self.axes.clone(),
            values: self.values.clone(),
            places: self.places.clone(),
            table: Vec::new(),
            basis: self.basis.clone(),
            absent: self.absent_between(values[1]),
            ..*self
        };
        for (index, weight) in corners.iter() {
            let begin = index / column * column;
            let nodes = table.iter_mut().zip(&self.table[begin..begin + column]);
            nodes.for_each(|(sum, node)| *sum += *node * F32x8::splat(weight));
        }
        material.table = table;
        for axis in 0..THICKNESS {
            let value = f64::from(values[axis]);
            material.axes.set(Parameter::CORE[axis], vec![value]);
            material.values[axis] = vec![values[axis]];
            material.places[axis] = vec![places[axis]];
        }
        Ok(material)
    }

    fn missing_curve(&self, grain_size_um: f32, thickness_cm: f32) -> Option<MissingCurve> {
        missing_curve(
            &self.absent,
            &self.axes,
            f64::from(grain_size_um),
            f64::from(thickness_cm),
        )
    }

    /// `absent` for a single grain size, from the nodes around it.
    fn absent_between(&self, grain_size_um: f32) -> Vec<usize> {
        let missing = |cm: &&f32| self.missing_curve(grain_size_um, **cm).is_some();
        let thinnest = self.values[THICKNESS].iter().take_while(missing).count();
        if thinnest > 0 {
            vec![thinnest]
        } else {
            Vec::new()
        }
    }

    /// Number of extra nodes below the first thickness.
    fn thin_count(&self) -> usize {
        self.places[THICKNESS].len() - self.values[THICKNESS].len()
    }

    /// y per wavelength from components.
    fn spectral(&self, components: &[f32]) -> Vec<f32> {
        if self.components == 0 {
            return components.to_vec();
        }
        let mut spectrum = vec![0.0; self.wavelengths];
        self.rebuild::<Portable>(components, &mut spectrum);
        spectrum
    }

    /// Writes y per wavelength, from coefficients of the basis, to `spectrum`.
    #[inline(always)]
    fn rebuild<S: Simd>(&self, components: &[f32], spectrum: &mut [f32]) {
        let chunks = self.basis.chunks_exact(self.components);
        for (to, vectors) in spectrum.chunks_mut(8).zip(chunks) {
            let mut y = F32x8::<S>::ZERO;
            for (c, vector) in components.iter().zip(vectors) {
                y += F32x8::splat(*c) * vector.on();
            }
            let lanes = y.as_array();
            match to.first_chunk_mut::<8>() {
                Some(whole) => *whole = *lanes,
                None => to.copy_from_slice(&lanes[..to.len()]),
            }
        }
    }

    /// Smallest and largest value allowed on axis `axis`.
    fn range(&self, axis: usize) -> [f32; 2] {
        let nodes = &self.values[axis];
        match (axis, nodes.len()) {
            (THICKNESS, 2..) if self.thin_count() == 0 => [nodes[0], f32::MAX],
            (THICKNESS, 2..) => [0.0, f32::MAX],
            (_, n) => [nodes[0], nodes[n - 1]],
        }
    }

    /// An end of an axis in double precision, as in the file.
    fn end(&self, axis: usize, value: f32) -> f64 {
        let nodes = self.axes.values(Parameter::CORE[axis]).iter();
        let mut same = nodes.filter(|node| **node as f32 == value);
        same.next().copied().unwrap_or(f64::from(value))
    }

    /// The core values of `point`, clamped to the axes where they exceed an end within the
    /// tolerance; `None` if one is outside.
    #[inline(always)]
    fn inside(&self, point: Point) -> Option<[f32; 5]> {
        let requested = point.core();
        let mut values = requested.map(|v| v as f32);
        for (axis, value) in values.iter_mut().enumerate() {
            let [first, last] = self.range(axis);
            if !(first..=last).contains(value) {
                if ![first, last]
                    .iter()
                    .any(|end| nodes::is_on(f64::from(*end), requested[axis]))
                {
                    return None;
                }
                *value = value.clamp(first, last);
            }
        }
        Some(values)
    }

    /// The error of a point that is not inside.
    #[cold]
    fn outside(&self, point: Point) -> LookupError {
        let requested = point.core();
        let wrong = |axis: &usize| {
            let [first, last] = self.range(*axis);
            let value = requested[*axis];
            !((first..=last).contains(&(value as f32))
                || nodes::is_on(f64::from(first), value)
                || nodes::is_on(f64::from(last), value))
        };
        let axis = (0..5).find(wrong).unwrap_or_default();
        let [first, last] = self.range(axis);
        let unlimited = last == f32::MAX;
        LookupError::Outside {
            axis: Parameter::CORE[axis].key(),
            value: requested[axis],
            first: self.end(axis, first),
            last: if unlimited {
                f64::INFINITY
            } else {
                self.end(axis, last)
            },
        }
    }

    /// The columns around the point with coordinates `places`, at the node below its
    /// thickness, and the index of that node.
    #[inline(always)]
    fn corners(&self, places: [f32; 5]) -> (Corners, usize) {
        let mut corners = Corners {
            index: [0; 16],
            weight: [1.0; 16],
            count: 1,
        };
        let (mut stride, mut begin, mut cell) = (self.width, 0, 0);
        for axis in (0..5).rev() {
            let nodes = &self.places[axis];
            let below = below(nodes, places[axis]);
            begin += below * stride;
            if axis == THICKNESS {
                cell = below;
            } else if nodes.len() > 1 {
                let above = fraction(nodes, below, places[axis]);
                let count = corners.count;
                for i in 0..count {
                    corners.index[count + i] = corners.index[i] + stride;
                    corners.weight[count + i] = corners.weight[i] * above;
                    corners.weight[i] *= 1.0 - above;
                }
                corners.count = 2 * count;
            }
            stride *= nodes.len();
        }
        corners.index.iter_mut().for_each(|index| *index += begin);
        (corners, cell)
    }

    /// Writes y per wavelength to `spectrum`: sums over `corners` of the values and slopes
    /// at the nodes below and above the thickness, with `weights`.
    #[inline(always)]
    fn depths<S: Simd>(&self, corners: &Corners, weights: [F32x8<S>; 2], spectrum: &mut [f32]) {
        if self.components == 0 {
            // the components are the spectrum
            self.sums(corners, weights, spectrum);
        } else if self.components <= FEW {
            let mut few = [0.0; FEW];
            self.sums(corners, weights, &mut few[..self.components]);
            self.rebuild::<S>(&few[..self.components], spectrum);
        } else {
            let mut many = vec![0.0; self.components];
            self.sums(corners, weights, &mut many);
            self.rebuild::<S>(&many, spectrum);
        }
    }

    /// Writes the same sums per component to `sums`.
    #[inline(always)]
    fn sums<S: Simd>(&self, corners: &Corners, [lower, upper]: [F32x8<S>; 2], sums: &mut [f32]) {
        let above = self.values[INCIDENCE].len() * self.width;
        if self.width == 1 {
            // the usual case of a tailored file: one vector, kept in registers
            let mut sum = [F32x8::<S>::ZERO; 2];
            for (at, weight) in corners.iter() {
                let weight = F32x8::splat(weight);
                sum[0] += self.table[at].on() * weight;
                sum[1] += self.table[at + above].on() * weight;
            }
            let lanes = (sum[0] * lower + sum[1] * upper).to_array();
            for (i, to) in sums.iter_mut().enumerate().take(LANES) {
                *to = lanes[i] + lanes[LANES + i];
            }
            return;
        }
        for (block, sums) in sums.chunks_mut(BLOCK * LANES).enumerate() {
            let vectors = sums.len().div_ceil(LANES);
            let mut sum = [[F32x8::<S>::ZERO; 2]; BLOCK];
            for (at, weight) in corners.iter() {
                let at = at + block * BLOCK;
                let weight = F32x8::splat(weight);
                let below = &self.table[at..at + vectors];
                let above = &self.table[at + above..at + above + vectors];
                match (below.first_chunk::<BLOCK>(), above.first_chunk::<BLOCK>()) {
                    // The compiler knows this length.
                    (Some(below), Some(above)) => add(&mut sum, below, above, weight),
                    _ => add(&mut sum[..vectors], below, above, weight),
                }
            }
            for (sums, [below, above]) in sums.chunks_mut(LANES).zip(sum) {
                let lanes = (below * lower + above * upper).to_array();
                for (i, to) in sums.iter_mut().enumerate() {
                    *to = lanes[i] + lanes[LANES + i];
                }
            }
        }
    }

    /// Writes y per wavelength at `thickness_cm`, thicker than the last node, to `spectrum`.
    #[inline(always)]
    fn depths_beyond<S: Simd>(
        &self,
        mut places: [f32; 5],
        thickness_cm: f32,
        spectrum: &mut [f32],
    ) {
        let x = &self.places[THICKNESS];
        places[THICKNESS] = x[x.len() - 1];
        let (corners, _) = self.corners(places);
        let (zero, value, slope) = (F32x8::<S>::ZERO, halves(1.0, 0.0), halves(0.0, 1.0));
        self.depths(&corners, [zero, value], spectrum);
        if self.quantity == Quantity::Reflectance {
            return;
        }
        let mut before = vec![0.0; spectrum.len()];
        let mut slopes = before.clone();
        self.depths(&corners, [value, zero], &mut before);
        self.depths(&corners, [zero, slope], &mut slopes);
        let nodes = &self.values[THICKNESS];
        let last_cm = nodes[nodes.len() - 1];
        let step_cm = last_cm - nodes[nodes.len() - 2];
        let scale = thickness_slope(last_cm);
        slopes.iter_mut().for_each(|slope| *slope *= scale);
        let sides = before.chunks(8).zip(slopes.chunks(8));
        for (y, (before, slopes)) in spectrum.chunks_mut(8).zip(sides) {
            let end = Diffusion::<S> {
                y: wide(y),
                slope_per_cm: wide(slopes),
                before: wide(before),
                step_cm: f64::from(step_cm),
            };
            let deeper = end.deeper(f64::from(thickness_cm - last_cm)).to_array();
            for (y, deeper) in y.iter_mut().zip(deeper) {
                *y = deeper as f32;
            }
        }
    }

    /// Converts y to transmittance or reflectance, in place.
    #[inline(always)]
    fn to_quantity(&self, spectrum: &mut [f32]) {
        if self.quantity == Quantity::Reflectance {
            for y in spectrum {
                *y = 1.0 - exp_neg(*y);
            }
        } else {
            for y in spectrum {
                *y = exp_neg(*y);
            }
        }
    }
}

/// Arguments of [`Lookup::spectrum`].
struct SpectrumKernel<'a> {
    lookup: &'a Lookup,
    point: Point,
    spectrum: &'a mut [f32],
}

impl SimdKernel for SpectrumKernel<'_> {
    type Output = Result<(), LookupError>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        self.lookup.spectrum_on::<S>(self.point, self.spectrum)
    }
}

/// At most eight numbers in double precision; the last one is repeated.
#[inline(always)]
fn wide<S: Simd>(numbers: &[f32]) -> F64x8<S> {
    let mut lanes = [0.0; 8];
    for (i, lane) in lanes.iter_mut().enumerate() {
        *lane = f64::from(numbers[i.min(numbers.len() - 1)]);
    }
    F64x8::new(lanes)
}

/// A vector with the weight `value` for values and `slope` for slopes.
#[inline(always)]
fn halves<S: Simd>(value: f32, slope: f32) -> F32x8<S> {
    F32x8::new(std::array::from_fn(
        |i| if i < LANES { value } else { slope },
    ))
}

/// Weights of the nodes below and above, `t` (0 to 1) of the way from one to the other;
/// the nodes are `step` apart.
#[inline(always)]
fn hermite<S: Simd>(t: f32, step: f32) -> [F32x8<S>; 2] {
    let left = 1.0 - t;
    [
        halves((1.0 + 2.0 * t) * left * left, t * left * left * step),
        halves(t * t * (3.0 - 2.0 * t), -t * t * left * step),
    ]
}

/// Adds `weight` times the vectors of the nodes below and above to their sums.
#[inline(always)]
fn add<S: Simd>(sums: &mut [[F32x8<S>; 2]], below: &[F32x8], above: &[F32x8], weight: F32x8<S>) {
    for ((sum, below), above) in sums.iter_mut().zip(below).zip(above) {
        sum[0] += below.on() * weight;
        sum[1] += above.on() * weight;
    }
}

/// Index of the node below `place`: the largest node not above it, at most the last but
/// one.
#[inline(always)]
fn below(nodes: &[f32], place: f32) -> usize {
    let inner = nodes.len().max(2) - 1;
    nodes[1..]
        .iter()
        .take(inner - 1)
        .filter(|node| **node <= place)
        .count()
}

/// Position of `place` between node `cell` and the next, 0 to 1; 0 if there is no next
/// node or the two are equal in single precision.
#[inline(always)]
fn fraction(nodes: &[f32], cell: usize, place: f32) -> f32 {
    match nodes.get(cell + 1) {
        Some(next) if *next > nodes[cell] => {
            ((place - nodes[cell]) / (next - nodes[cell])).clamp(0.0, 1.0)
        }
        _ => 0.0,
    }
}
