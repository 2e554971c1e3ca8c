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
//! coefficients of that basis, so that the cost of a spectrum is that of a few components.
//! Slopes are limited per wavelength, and the nearest slopes of the basis are taken: a
//! wavelength may leave the range of the nodes by about the error of the file. For a file with
//! plain spectra (`linear`), the table holds values and slopes per wavelength.
//!
//! The table of a snow (all thicknesses and angles at nodes of the other axes) is filled when a
//! look-up first needs it, so that a large file opens at once.
mod corners;
mod depths;
mod prepare;

use std::marker::PhantomData;
use std::sync::{Arc, OnceLock};

use ndarray::ArrayView1;
use splitsnow_spectra::Quantity;
use splitsnow_spectra::simd::{F32x8, F64x8, Portable, Simd, SimdKernel, dispatch};

use self::corners::Cells;
use self::depths::{Beyond, hermite};
use crate::parameter::core_places;
use crate::{
    Axes, Basis, Database, Factors, LookupError, MissingCurve, Parameter, Point, absent_error,
    missing_curve, nodes,
};

/// Position of the thickness among [`Parameter::CORE`].
const THICKNESS: usize = 3;
/// Position of the incidence angle among [`Parameter::CORE`].
const INCIDENCE: usize = 4;
/// Extra nodes below the first thickness, as fractions of it, for a black substrate.
const THIN: [f32; 7] = [0.0, 0.015625, 0.03125, 0.0625, 0.125, 0.25, 0.5];
/// Largest y taken from spectra of a `linear` file, and up to which slopes of a `log` file are
/// limited: darker values are noise from the truncation of the basis.
const DARKEST: f32 = 16.0;
/// Components per vector: the values of four components, then their slopes.
const LANES: usize = 4;
/// Largest number of components that are summed on the stack.
const FEW: usize = 64;
/// Largest size of the table, bytes.
const MOST_BYTES: u128 = 1 << 30;
/// Number of vectors summed at a time.
const BLOCK: usize = 4;

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
    /// For each snow of the nodes, `[thickness][angle][width]`: y and its slope along the
    /// thickness. A single angle is there twice. Filled when it is first needed.
    table: Vec<OnceLock<Box<[F32x8]>>>,
    /// What the table is filled from.
    factors: Arc<Factors>,
    /// Cells of the axes.
    cells: [Cells; 5],
    /// Steps between the numbers of snows along the axes of a snow.
    strides: [usize; THICKNESS],
    /// Numbers of the snows around a point, from the first of them.
    around: [usize; 8],
    /// Coordinate of the last thickness.
    last: f32,
    /// Smallest and largest value allowed on each axis.
    ranges: [[f32; 2]; 5],
    /// Number of components of the basis; 0 if the wavelengths are the components.
    components: usize,
    /// Basis vectors, `[l / 8][component]`; with zeros up to four components per vector of a node.
    basis: Vec<F32x8>,
    wavelengths: usize,
}

impl Lookup {
    /// Prepares `quantity` of `database`, in a fraction of a millisecond. The table is filled where
    /// look-ups need it: the first one takes about a millisecond, and 25,000 curves some 50 ms.
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
                core_places(point)[axis]
            };
            let values = thin.chain(values.iter().copied());
            *places = values.map(place).collect();
        }
        let columns = database.basis(quantity);
        let (wavelengths, components) = columns.dim();
        let logarithmic = database.basis_kind() == Basis::Log;
        let depth = if logarithmic { components } else { wavelengths };
        let width = depth.div_ceil(LANES);
        let [n_f, n_g, n_d, n_h, _] = values.each_ref().map(Vec::len);
        let nodes = database.curves() / n_h * places[THICKNESS].len();
        let bytes = (nodes as u128) * (width * size_of::<F32x8>()) as u128;
        if bytes > MOST_BYTES {
            return Err(LookupError::TooLarge { bytes });
        }
        let mut lookup = Self {
            quantity,
            axes,
            values,
            absent: database.absent().to_vec(),
            width,
            table: (0..n_f * n_g * n_d).map(|_| OnceLock::new()).collect(),
            factors: database.factors(quantity).clone(),
            cells: std::array::from_fn(|_| Cells::new(&[])),
            places,
            strides: [0; THICKNESS],
            around: [0; 8],
            last: 0.0,
            ranges: Default::default(),
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
                let vectors = columns.columns().into_iter().map(chunk);
                lookup.basis.extend(vectors);
                let whole = lookup.basis.len().next_multiple_of(width * LANES);
                lookup.basis.resize(whole, F32x8::ZERO);
            }
        }
        Ok(lookup.arranged())
    }

    /// This look-up with what follows from the nodes of its axes.
    fn arranged(mut self) -> Self {
        self.last = self.places[THICKNESS][self.places[THICKNESS].len() - 1];
        self.ranges = std::array::from_fn(|axis| self.range(axis));
        self.cells = self.places.each_ref().map(|places| Cells::new(places));
        let mut stride = 1;
        for (count, axis) in [(1, 2), (2, 1), (4, 0)] {
            self.strides[axis] = stride;
            let nodes = self.values[axis].len();
            for i in 0..count {
                self.around[count + i] = self.around[i] + if nodes > 1 { stride } else { 0 };
            }
            stride *= nodes;
        }
        self
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
        let requested = point.core();
        dispatch(SpectrumKernel {
            lookup: self,
            requested: &requested,
            spectrum,
        })
    }

    /// [`Lookup::spectrum`] at core values, for a `spectrum` of the right length.
    #[inline(always)]
    fn spectrum_on<S: Simd>(
        &self,
        requested: &[f64; 5],
        spectrum: &mut [f32],
    ) -> Result<(), LookupError> {
        let Some(values) = self.inside(requested) else {
            return Err(self.outside(requested));
        };
        if !self.absent.is_empty()
            && let Some(missing) = self.missing_curve(values[1], values[THICKNESS])
        {
            return Err(absent_error(missing, Point::from_core(*requested)));
        }
        let thickness_cm = requested[THICKNESS] as f32;
        match self.table.len() {
            1 => self.spectrum_around::<S, 1>(values, thickness_cm, spectrum),
            _ => self.spectrum_around::<S, 8>(values, thickness_cm, spectrum),
        }
        Ok(())
    }

    /// Writes the spectrum at `values` to `spectrum`, from the `N` snows around.
    #[inline(always)]
    fn spectrum_around<S: Simd, const N: usize>(
        &self,
        values: [f32; 5],
        thickness_cm: f32,
        spectrum: &mut [f32],
    ) {
        let places = core_places(values);
        let (cell, t, step) = self.cells[THICKNESS].find::<S>(places[THICKNESS]);
        let corners = self.corners::<S, N>(places, cell);
        if places[THICKNESS] <= self.last {
            self.depths::<S, N, true>(&corners, hermite(t, step), spectrum);
        } else {
            S::outlined(Beyond::<S, N> {
                lookup: self,
                corners,
                thickness_cm,
                spectrum,
                level: PhantomData,
            });
        }
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
        let point = point.core();
        let values = self.inside(&point).ok_or_else(|| self.outside(&point))?;
        let places = core_places(values);
        let mut table =
            vec![F32x8::ZERO; self.places[THICKNESS].len() * self.angles() * self.width];
        let corners = self.corners::<Portable, 8>(places, 0);
        // the angle is that of the first node
        for (snow, weight) in corners.snows.iter().zip(corners.weights[0]) {
            if weight > 0.0 {
                let nodes = table.iter_mut().zip(*snow);
                nodes.for_each(|(sum, node)| *sum += *node * F32x8::splat(weight));
            }
        }
        let mut material = Self {
            axes: self.axes.clone(),
            values: self.values.clone(),
            places: self.places.clone(),
            cells: self.cells.clone(),
            table: vec![OnceLock::from(table.into_boxed_slice())],
            factors: Arc::default(),
            basis: self.basis.clone(),
            absent: self.absent_between(values[1]),
            ..*self
        };
        for axis in 0..THICKNESS {
            let value = f64::from(values[axis]);
            material.axes.set(Parameter::CORE[axis], vec![value]);
            material.values[axis] = vec![values[axis]];
            material.places[axis] = vec![places[axis]];
        }
        Ok(material.arranged())
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
        self.rebuild::<Portable, false>(components, &mut spectrum);
        spectrum
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

    /// The core values `requested`, clamped to the axes where they exceed an end within the
    /// tolerance; `None` if one is outside.
    #[inline(always)]
    fn inside(&self, requested: &[f64; 5]) -> Option<[f32; 5]> {
        let mut values = requested.map(|v| v as f32);
        for (axis, value) in values.iter_mut().enumerate() {
            let [first, last] = self.ranges[axis];
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
    fn outside(&self, requested: &[f64; 5]) -> LookupError {
        let wrong = |axis: &usize| {
            let [first, last] = self.ranges[*axis];
            let value = requested[*axis];
            !((first..=last).contains(&(value as f32))
                || nodes::is_on(f64::from(first), value)
                || nodes::is_on(f64::from(last), value))
        };
        let axis = (0..5).find(wrong).unwrap_or_default();
        let [first, last] = self.ranges[axis];
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
}

/// Arguments of [`Lookup::spectrum`].
struct SpectrumKernel<'a> {
    lookup: &'a Lookup,
    requested: &'a [f64; 5],
    spectrum: &'a mut [f32],
}

impl SimdKernel for SpectrumKernel<'_> {
    type Output = Result<(), LookupError>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        self.lookup.spectrum_on::<S>(self.requested, self.spectrum)
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
