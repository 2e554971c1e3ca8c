//! Look-up anywhere in the box of the axes, in variables in which snow is smooth.
//!
//! What is interpolated is y = -ln T, and -ln(1 - R) for reflectance: both 0 at
//! thickness 0 and growing with it. In the coordinates of
//! [`crate::parameter`],
//!
//! - along the thickness y is a monotone cubic (Hermite, slopes by parabolas
//!   through three nodes, limited to three times the smaller secant beside a
//!   node after Fritsch and Carlson 1980), from 0 at 0 cm on, or over a substrate or
//!   other layers from the first node on;
//! - between the nodes of the other axes it is linear: a mean of columns with
//!   weights that are not negative.
//!
//! So an answer lies within those of the nodes around it, is in [0, 1], grows
//! (R) or falls (T) with thickness as those do, and is continuous. Outside the
//! nodes of the thickness it goes on as [`super::diffusion`] says.
//!
//! Values and slopes are kept as coefficients of the file's basis where that is
//! one of y (`log`): then all wavelengths share the limiter, and a spectrum costs
//! as many multiplications as a few components need. Of a file with plain
//! spectra (`linear`) they are kept per wavelength.
use ndarray::ArrayView1;
use splitsnow_spectra::Quantity;
use splitsnow_spectra::elementary::exp_neg_single as exp_neg;
use wide::f32x8;

use crate::diffusion::Diffusion;
use crate::monotone::{share, slope};
use crate::parameter::{core_places, thickness_slope};
use crate::{Axes, Basis, Database, LookupError, Parameter, Point, absent, gap, nodes};

/// Position of the thickness among [`Parameter::CORE`].
const THICKNESS: usize = 3;
/// Position of the incidence.
const INCIDENCE: usize = 4;
/// Nodes before the first thickness, in parts of it, of a file that stands free.
const THIN: [f32; 7] = [0.0, 0.015625, 0.03125, 0.0625, 0.125, 0.25, 0.5];
/// Largest y that spectra of a `linear` file are taken for: what is darker is
/// noise of its truncation.
const DARKEST: f32 = 16.0;
/// Components per vector: their values, then their slopes.
const LANES: usize = 4;
/// Components that need no memory of their own.
const FEW: usize = 64;
/// Largest table, bytes.
const MOST_BYTES: u128 = 1 << 30;
/// Vectors summed at a time.
const BLOCK: usize = 8;

/// One quantity of a database, ready for look-ups anywhere in its box.
#[derive(Debug, Clone)]
pub struct Lookup {
    quantity: Quantity,
    /// Those of [`Parameter::CORE`], as in the file.
    axes: Axes,
    /// Their values in single precision.
    values: [Vec<f32>; 5],
    /// Their coordinates; those of the thickness begin with [`THIN`], if it stands free.
    places: [Vec<f32>; 5],
    /// Curves that do not exist, as [`Database::absent`].
    absent: Vec<usize>,
    /// Vectors per node.
    width: usize,
    /// `[node][width]`: y and its slope along the thickness.
    table: Vec<f32x8>,
    /// Components of a basis; 0 if the wavelengths are the components.
    components: usize,
    /// `[l / 8][component]`.
    basis: Vec<f32x8>,
    wavelengths: usize,
}

/// Columns around a point: where in the table their node below it is, and
/// their weights.
struct Corners {
    at: [usize; 16],
    weight: [f32; 16],
    count: usize,
}

impl Corners {
    #[inline]
    fn iter(&self) -> impl Iterator<Item = (usize, f32)> {
        let all = self.at.iter().zip(&self.weight);
        all.take(self.count).map(|(at, weight)| (*at, *weight))
    }
}

impl Lookup {
    /// Prepares `quantity` of `database`: some ten milliseconds for 25,000 curves.
    ///
    /// # Errors
    /// [`LookupError::NoQuantity`]; [`LookupError::Condition`] for a file that
    /// [`Database::at`] must cut first; [`LookupError::TooLarge`] for a `linear` file
    /// of so many curves and wavelengths that its table would not fit 1 GB.
    pub fn new(database: &Database, quantity: Quantity) -> Result<Self, LookupError> {
        database.require(quantity)?;
        database.single()?;
        let axes = database.axes().clone();
        let values = Parameter::CORE
            .map(|parameter| axes.values(parameter).iter().map(|v| *v as f32).collect());
        let values: [Vec<f32>; 5] = values;
        let mut places: [Vec<f32>; 5] = Default::default();
        for (axis, (places, values)) in places.iter_mut().zip(&values).enumerate() {
            let thin = THIN.map(|part| part * values[0]);
            // a thickness alone needs a second node
            let downward = database.has_black_substrate() || values.len() == 1;
            let thin = thin.into_iter().filter(|_| axis == THICKNESS && downward);
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
        let nodes = database.curves() / values[THICKNESS].len() * places[THICKNESS].len();
        let bytes = (nodes as u128) * (width * size_of::<f32x8>()) as u128;
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
                    f32x8::new(std::array::from_fn(value))
                };
                lookup
                    .basis
                    .extend(columns.columns().into_iter().map(chunk));
            }
        }
        lookup.fill(database, depth);
        Ok(lookup)
    }

    /// Number of wavelengths of a spectrum, l.
    #[must_use]
    pub fn wavelengths(&self) -> usize {
        self.wavelengths
    }

    /// The spectrum at `point`, into `spectrum` (`[l]`).
    ///
    /// Thickness may be anything from 0 on, or from its first node on if the file does
    /// not stand free ([`Database::has_black_substrate`]), unless the file has one alone; the
    /// other coordinates are in the box of the axes, within 1e-6 of its ends.
    ///
    /// # Errors
    /// [`LookupError::Outside`], [`LookupError::Absent`] where a curve around does not
    /// exist, and [`LookupError::Shape`] for a `spectrum` of another length.
    pub fn spectrum(&self, point: Point, spectrum: &mut [f32]) -> Result<(), LookupError> {
        if spectrum.len() != self.wavelengths {
            return Err(LookupError::Shape {
                what: "wavelengths",
                expected: self.wavelengths,
                found: spectrum.len(),
            });
        }
        let values = self.inside(point).ok_or_else(|| self.outside(point))?;
        if !self.absent.is_empty()
            && let Some(gap) = self.gap(values[1], values[THICKNESS])
        {
            return Err(absent(gap, point));
        }
        let places = core_places(values);
        let x = &self.places[THICKNESS];
        if places[THICKNESS] <= x[x.len() - 1] {
            let (corners, cell) = self.corners(places);
            let t = fraction(x, cell, places[THICKNESS]);
            let step = x[cell + 1] - x[cell];
            self.depths(&corners, hermite(t, step), spectrum);
        } else {
            self.depths_beyond(places, point[Parameter::Thickness] as f32, spectrum);
        }
        self.leave(spectrum);
        Ok(())
    }

    /// The same for one `snow` (its thickness and angle, if any, are not looked at): its
    /// curves at all thicknesses and angles, of which a renderer asks many. Answers are the same to rounding, and quicker.
    ///
    /// # Errors
    /// [`LookupError::Outside`].
    pub fn material(&self, snow: Point) -> Result<Self, LookupError> {
        let point = snow
            .with(Parameter::Thickness, f64::from(self.values[THICKNESS][0]))
            .with(Parameter::Incidence, f64::from(self.values[INCIDENCE][0]));
        let values = self.inside(point).ok_or_else(|| self.outside(point))?;
        let places = core_places(values);
        let (corners, _) = self.corners(places);
        let column = self.places[THICKNESS].len() * self.values[INCIDENCE].len() * self.width;
        let mut table = vec![f32x8::ZERO; column];
        let mut material = Self {
            axes: self.axes.clone(),
            values: self.values.clone(),
            places: self.places.clone(),
            table: Vec::new(),
            basis: self.basis.clone(),
            absent: self.absent_between(values[1]),
            ..*self
        };
        for (at, weight) in corners.iter() {
            let begin = at / column * column;
            let nodes = table.iter_mut().zip(&self.table[begin..begin + column]);
            nodes.for_each(|(sum, node)| *sum += *node * f32x8::splat(weight));
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

    fn gap(&self, grain_size_um: f32, thickness_cm: f32) -> Option<crate::Gap> {
        gap(
            &self.absent,
            &self.axes,
            f64::from(grain_size_um),
            f64::from(thickness_cm),
        )
    }

    /// [`Lookup::absent`] of a grain size alone: that of the nodes around it.
    fn absent_between(&self, grain_size_um: f32) -> Vec<usize> {
        let missing = |cm: &&f32| self.gap(grain_size_um, **cm).is_some();
        let thinnest = self.values[THICKNESS].iter().take_while(missing).count();
        if thinnest > 0 {
            vec![thinnest]
        } else {
            Vec::new()
        }
    }

    /// Fills the table, column by column, with `depth` components.
    fn fill(&mut self, database: &Database, depth: usize) {
        let [n_f, n_g, n_d, n_h, n_a] = self.values.each_ref().map(Vec::len);
        let thin = self.thin();
        let rows = thin + n_h;
        let mut table = vec![f32x8::ZERO; n_f * n_g * n_d * rows * n_a * self.width];
        let mut y = vec![vec![0.0; depth]; rows];
        for (snow, angle) in (0..n_f * n_g * n_d).flat_map(|s| (0..n_a).map(move |a| (s, a))) {
            let absent = self
                .absent
                .get(snow / n_d % n_g)
                .copied()
                .unwrap_or_default();
            for h in 0..n_h {
                let row = (snow * n_h + h) * n_a + angle;
                let (before, here) = y.split_at_mut(thin + h);
                if h < absent {
                    here[0].fill(0.0);
                    continue;
                }
                if self.components == 0 {
                    let curve = database.curve(row, self.quantity).unwrap_or_default();
                    // Noise must not make a slab transmit more than a thinner one, nor
                    // reflect less, though over a substrate snow may darken it.
                    let least = before.last().filter(|_| h > 0 && thin > 0);
                    for (l, (y, value)) in here[0].iter_mut().zip(curve).enumerate() {
                        *y = self.depth(value).max(least.map_or(0.0, |least| least[l]));
                    }
                } else {
                    let coefficients = database.coefficients(self.quantity);
                    let pairs = here[0].iter_mut().zip(coefficients.row(row));
                    pairs.for_each(|(y, c)| *y = *c);
                }
            }
            // what does not exist is nobody's neighbour
            let begin = if absent > 0 { thin + absent } else { 0 };
            y[..begin].iter_mut().for_each(|y| y.fill(0.0));
            if thin > 0 && begin == 0 {
                self.fill_thin(&mut y);
            }
            let mut slopes = vec![vec![0.0; depth]; begin];
            slopes.extend(self.slopes(&y[begin..]));
            for h in 0..rows {
                let node = ((snow * rows + h) * n_a + angle) * self.width;
                for (i, (y, slope)) in y[h].iter().zip(&slopes[h]).enumerate() {
                    let lanes = table[node + i / LANES].as_mut_array();
                    lanes[i % LANES] = *y;
                    // numbers of a hostile file may overflow
                    lanes[LANES + i % LANES] = if slope.is_finite() { *slope } else { 0.0 };
                }
            }
        }
        self.table = table;
    }

    /// Number of nodes before the first thickness.
    fn thin(&self) -> usize {
        self.places[THICKNESS].len() - self.values[THICKNESS].len()
    }

    /// The nodes before the first thickness of a column.
    fn fill_thin(&self, y: &mut [Vec<f32>]) {
        let first_cm = self.values[THICKNESS][0];
        let (thin, nodes) = y.split_at_mut(THIN.len());
        let x = &self.places[THICKNESS][THIN.len()..];
        thin.iter_mut().for_each(|y| y.fill(0.0));
        let spectra: Vec<Vec<f32>> = nodes.iter().take(3).map(|y| self.spectral(y)).collect();
        for (l, y) in spectra[0].iter().enumerate() {
            let slope = match spectra.len() {
                1 => y / x[0].max(f32::MIN_POSITIVE),
                n => slope(&x[..n], &spectra, 0, l).max(0.0),
            };
            let node = Diffusion {
                y: f64::from(*y),
                slope_per_cm: f64::from(slope * thickness_slope(first_cm)),
                before: 0.0,
                step_cm: f64::from(first_cm),
            };
            for (thin, y) in thin.iter_mut().zip(node.thinner(THIN.map(f64::from))) {
                if self.components == 0 {
                    thin[l] = y as f32;
                    continue;
                }
                let chunk = &self.basis[l / 8 * self.components..];
                for (c, vector) in thin.iter_mut().zip(chunk) {
                    *c += y as f32 * vector.as_array()[l % 8];
                }
            }
        }
    }

    /// y of a transmittance or reflectance.
    fn depth(&self, value: f32) -> f32 {
        let left = match self.quantity {
            Quantity::Transmittance => value,
            Quantity::Reflectance => 1.0 - value,
        };
        -libm::logf(left.clamp(libm::expf(-DARKEST), 1.0))
    }

    /// Limited slopes of a column, or of its last nodes, `[h][component]`.
    fn slopes(&self, y: &[Vec<f32>]) -> Vec<Vec<f32>> {
        let all = &self.places[THICKNESS];
        let x = &all[all.len() - y.len()..];
        if x.len() < 2 {
            return y.iter().map(|y| vec![0.0; y.len()]).collect();
        }
        let last = x.len() - 1;
        if self.components == 0 {
            let limited = |h: usize, i: usize| {
                let slope = slope(x, y, h, i);
                share(x, y, h, i) * slope
            };
            let components = y[0].len();
            return (0..=last)
                .map(|h| (0..components).map(|i| limited(h, i)).collect())
                .collect();
        }
        let spectra: Vec<Vec<f32>> = y.iter().map(|y| self.spectral(y)).collect();
        (0..=last)
            .map(|h| {
                let shares = (0..self.wavelengths).map(|l| share(x, &spectra, h, l));
                let share = shares.fold(1.0, f32::min);
                (0..y[h].len()).map(|i| share * slope(x, y, h, i)).collect()
            })
            .collect()
    }

    /// y per wavelength of these components.
    fn spectral(&self, components: &[f32]) -> Vec<f32> {
        if self.components == 0 {
            return components.to_vec();
        }
        let mut spectrum = vec![0.0; self.wavelengths];
        self.rebuild(components, &mut spectrum);
        spectrum
    }

    /// y per wavelength of coefficients of the basis, into `spectrum`.
    #[inline(always)]
    fn rebuild(&self, components: &[f32], spectrum: &mut [f32]) {
        let chunks = self.basis.chunks_exact(self.components);
        for (to, vectors) in spectrum.chunks_mut(8).zip(chunks) {
            let mut y = f32x8::ZERO;
            for (c, vector) in components.iter().zip(vectors) {
                y += f32x8::splat(*c) * *vector;
            }
            let lanes = y.as_array();
            match to.first_chunk_mut::<8>() {
                Some(all) => *all = *lanes,
                None => to.copy_from_slice(&lanes[..to.len()]),
            }
        }
    }

    /// The values that axis `axis` answers.
    fn range(&self, axis: usize) -> [f32; 2] {
        let nodes = &self.values[axis];
        match (axis, nodes.len()) {
            (THICKNESS, 2..) if self.thin() == 0 => [nodes[0], f32::MAX],
            (THICKNESS, 2..) => [0.0, f32::MAX],
            (_, n) => [nodes[0], nodes[n - 1]],
        }
    }

    /// An end of an axis as the file has it.
    fn end(&self, axis: usize, value: f32) -> f64 {
        let nodes = self.axes.values(Parameter::CORE[axis]).iter();
        let mut same = nodes.filter(|node| **node as f32 == value);
        same.next().copied().unwrap_or(f64::from(value))
    }

    /// The coordinates of `point`, moved onto the box where they are on its edge.
    #[inline(always)]
    fn inside(&self, point: Point) -> Option<[f32; 5]> {
        let asked = point.core();
        let mut values = asked.map(|v| v as f32);
        for (axis, value) in values.iter_mut().enumerate() {
            let [first, last] = self.range(axis);
            if !(first..=last).contains(value) {
                if ![first, last]
                    .iter()
                    .any(|end| nodes::on(f64::from(*end), asked[axis]))
                {
                    return None;
                }
                *value = value.clamp(first, last);
            }
        }
        Some(values)
    }

    /// What is wrong with a point that is not inside.
    #[cold]
    fn outside(&self, point: Point) -> LookupError {
        let asked = point.core();
        let wrong = |axis: &usize| {
            let [first, last] = self.range(*axis);
            let value = asked[*axis];
            !((first..=last).contains(&(value as f32))
                || nodes::on(f64::from(first), value)
                || nodes::on(f64::from(last), value))
        };
        let axis = (0..5).find(wrong).unwrap_or_default();
        let [first, last] = self.range(axis);
        let any = last == f32::MAX;
        LookupError::Outside {
            axis: Parameter::CORE[axis].key(),
            value: asked[axis],
            first: self.end(axis, first),
            last: if any {
                f64::INFINITY
            } else {
                self.end(axis, last)
            },
        }
    }

    /// The columns around a point at `places`, at the node below its thickness,
    /// and the number of that node.
    #[inline(always)]
    fn corners(&self, places: [f32; 5]) -> (Corners, usize) {
        let mut corners = Corners {
            at: [0; 16],
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
                    corners.at[count + i] = corners.at[i] + stride;
                    corners.weight[count + i] = corners.weight[i] * above;
                    corners.weight[i] *= 1.0 - above;
                }
                corners.count = 2 * count;
            }
            stride *= nodes.len();
        }
        corners.at.iter_mut().for_each(|at| *at += begin);
        (corners, cell)
    }

    /// y per wavelength: sums over `corners` of the values and slopes at the
    /// nodes below and above the thickness, with `weights`.
    #[inline(always)]
    fn depths(&self, corners: &Corners, weights: [f32x8; 2], spectrum: &mut [f32]) {
        if self.components == 0 {
            // the components are the spectrum
            self.sums(corners, weights, spectrum);
        } else if self.components <= FEW {
            let mut few = [0.0; FEW];
            self.sums(corners, weights, &mut few[..self.components]);
            self.rebuild(&few[..self.components], spectrum);
        } else {
            let mut many = vec![0.0; self.components];
            self.sums(corners, weights, &mut many);
            self.rebuild(&many, spectrum);
        }
    }

    /// The same per component.
    #[inline(always)]
    fn sums(&self, corners: &Corners, [lower, upper]: [f32x8; 2], sums: &mut [f32]) {
        let above = self.values[INCIDENCE].len() * self.width;
        if self.width == 1 {
            // one vector, the usual case of a tailored file, needs no room in memory
            let mut sum = [f32x8::ZERO; 2];
            for (at, weight) in corners.iter() {
                let weight = f32x8::splat(weight);
                sum[0] += self.table[at] * weight;
                sum[1] += self.table[at + above] * weight;
            }
            let lanes = (sum[0] * lower + sum[1] * upper).to_array();
            for (i, to) in sums.iter_mut().enumerate().take(LANES) {
                *to = lanes[i] + lanes[LANES + i];
            }
            return;
        }
        for (block, sums) in sums.chunks_mut(BLOCK * LANES).enumerate() {
            let vectors = sums.len().div_ceil(LANES);
            let mut sum = [[f32x8::ZERO; 2]; BLOCK];
            for (at, weight) in corners.iter() {
                let at = at + block * BLOCK;
                let weight = f32x8::splat(weight);
                let below = &self.table[at..at + vectors];
                let above = &self.table[at + above..at + above + vectors];
                for ((sum, below), above) in sum.iter_mut().zip(below).zip(above) {
                    sum[0] += *below * weight;
                    sum[1] += *above * weight;
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

    /// y per wavelength at `thickness_cm`, beyond the last node.
    fn depths_beyond(&self, mut places: [f32; 5], thickness_cm: f32, spectrum: &mut [f32]) {
        let x = &self.places[THICKNESS];
        places[THICKNESS] = x[x.len() - 1];
        let (corners, _) = self.corners(places);
        let (zero, value, slope) = (f32x8::ZERO, halves(1.0, 0.0), halves(0.0, 1.0));
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
        for ((y, before), slope) in spectrum.iter_mut().zip(before).zip(slopes) {
            let end = Diffusion {
                y: f64::from(*y),
                slope_per_cm: f64::from(slope * thickness_slope(last_cm)),
                before: f64::from(before),
                step_cm: f64::from(step_cm),
            };
            *y = end.deeper(f64::from(thickness_cm - last_cm)) as f32;
        }
    }

    /// From y to the quantity.
    #[inline(always)]
    fn leave(&self, spectrum: &mut [f32]) {
        if self.quantity == Quantity::Reflectance {
            spectrum.iter_mut().for_each(|y| *y = 1.0 - exp_neg(*y));
        } else {
            spectrum.iter_mut().for_each(|y| *y = exp_neg(*y));
        }
    }
}

/// The weights `value` for values and `slope` for slopes.
fn halves(value: f32, slope: f32) -> f32x8 {
    f32x8::new(std::array::from_fn(
        |i| if i < LANES { value } else { slope },
    ))
}

/// Weights of the node below and of that above, `t` of the way from one to the
/// other, which are `step` apart.
fn hermite(t: f32, step: f32) -> [f32x8; 2] {
    let left = 1.0 - t;
    [
        halves((1.0 + 2.0 * t) * left * left, t * left * left * step),
        halves(t * t * (3.0 - 2.0 * t), -t * t * left * step),
    ]
}

/// The last node, but for the very last, that is not above `place`.
#[inline]
fn below(nodes: &[f32], place: f32) -> usize {
    let inner = nodes.len().max(2) - 1;
    nodes[1..]
        .iter()
        .take(inner - 1)
        .filter(|node| **node <= place)
        .count()
}

/// How far `place` is from node `cell` to the next; 0 if there is none, and if
/// single precision does not tell them apart.
#[inline]
fn fraction(nodes: &[f32], cell: usize, place: f32) -> f32 {
    match nodes.get(cell + 1) {
        Some(next) if *next > nodes[cell] => {
            ((place - nodes[cell]) / (next - nodes[cell])).clamp(0.0, 1.0)
        }
        _ => 0.0,
    }
}
