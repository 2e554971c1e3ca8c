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
use ndarray::Array2;
use splitsnow_spectra::Quantity;

use crate::conditions::bracket;
use crate::{Axes, Database, LookupError, Parameter, Point, absent_error, missing_curve, nodes};

/// Axes along which the factor is linear, slowest first.
const LINEAR: [Parameter; 4] = [
    Parameter::Facetness,
    Parameter::GrainSize,
    Parameter::Density,
    Parameter::Thickness,
];

/// Largest factor. Curves through nodes that are very close together may exceed it.
const LARGEST: f64 = f32::MAX as f64;

/// Anisotropy factors of reflected or transmitted light, prepared for look-ups anywhere within
/// the axes.
#[derive(Debug, Clone)]
pub struct Anisotropy {
    /// Axes of the view and of [`Parameter::CORE`], as in the file.
    axes: Axes,
    absent: Vec<usize>,
    /// `[s][l']`.
    coefficients: Vec<f32>,
    /// `[l, l']`.
    basis: Array2<f32>,
    incidence: AngleAxis,
    view: AngleAxis,
    azimuth: AngleAxis,
    /// Whether the light is symmetric about the normal, so that the azimuth has no effect.
    is_axial: bool,
}

/// The nodes of an angle, degrees, and their mirror images beyond the ends.
#[derive(Debug, Clone)]
struct AngleAxis {
    places: Vec<f64>,
    /// Node of each place, and whether it is on the other side of the normal.
    nodes: Vec<(usize, bool)>,
}

/// Up to four nodes with their weights.
#[derive(Debug, Clone, Copy, Default)]
struct Stencil {
    nodes: [(usize, bool); 4],
    weights: [f64; 4],
    count: usize,
}

impl Stencil {
    fn iter(&self) -> impl Iterator<Item = ((usize, bool), f64)> + Clone {
        let pairs = self.nodes.into_iter().zip(self.weights);
        pairs.take(self.count)
    }
}

impl AngleAxis {
    /// The axis of these values. It goes on beyond its first value with its mirror image
    /// if `mirrored[0]`, and likewise beyond its last.
    fn new(values: &[f64], mirrored: [bool; 2], other_side: bool) -> Self {
        let own = values.iter().enumerate();
        let mut places: Vec<(f64, (usize, bool))> =
            own.map(|(node, value)| (*value, (node, false))).collect();
        if let (Some([first, second]), true) = (values.first_chunk(), mirrored[0]) {
            places.insert(0, (2.0 * first - second, (1, other_side)));
        }
        if let (Some([before, last]), true) = (values.last_chunk(), mirrored[1]) {
            places.push((2.0 * last - before, (values.len() - 2, other_side)));
        }
        let (places, nodes) = places.into_iter().unzip();
        Self { places, nodes }
    }

    /// The nodes around `x`, which is within the axis, and their weights in a cubic Hermite
    /// curve.
    fn stencil(&self, x: f64) -> Stencil {
        let (places, n) = (&self.places, self.places.len());
        let mut stencil = Stencil::default();
        let above = places.partition_point(|place| *place <= x);
        let cell = above.saturating_sub(1).min(n.saturating_sub(2));
        if n < 2 || places[cell] == x {
            stencil.nodes[0] = self.nodes[cell];
            stencil.weights[0] = 1.0;
            stencil.count = 1;
            return stencil;
        }
        let first = cell.saturating_sub(1);
        stencil.count = (cell + 3).min(n) - first;
        let step = places[cell + 1] - places[cell];
        let t = (x - places[cell]) / step;
        let mut add = |place: usize, weight: f64| stencil.weights[place - first] += weight;
        // values, then slopes
        let far = t * t * (3.0 - 2.0 * t);
        add(cell, 1.0 - far);
        add(cell + 1, far);
        let slopes = [t * (1.0 - t) * (1.0 - t), -t * t * (1.0 - t)];
        for (place, share) in [cell, cell + 1].into_iter().zip(slopes) {
            let share = share * step;
            let secant = |from: usize| places[from + 1] - places[from];
            // the slope at an end is that of the parabola through the last three places
            let (before, weights) = match place {
                _ if n == 2 => (0, [1.0, 0.0]),
                0 => {
                    let part = secant(0) / (secant(0) + secant(1));
                    (0, [1.0 + part, -part])
                }
                _ if place == n - 1 => {
                    let part = secant(n - 2) / (secant(n - 3) + secant(n - 2));
                    (n - 3, [-part, 1.0 + part])
                }
                _ => {
                    let part = secant(place) / (secant(place - 1) + secant(place));
                    (place - 1, [part, 1.0 - part])
                }
            };
            for (from, weight) in (before..n - 1).zip(weights) {
                if weight != 0.0 {
                    let weight = weight * share / secant(from);
                    add(from + 1, weight);
                    add(from, -weight);
                }
            }
        }
        for (node, place) in stencil.nodes.iter_mut().zip(&self.nodes[first..]) {
            *node = *place;
        }
        stencil
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
        Ok(Self {
            incidence: AngleAxis::new(incidence, goes_on(incidence), true),
            view: AngleAxis::new(view, goes_on(view), true),
            azimuth: AngleAxis::new(azimuth, ends, false),
            is_axial,
            absent: database.absent().to_vec(),
            coefficients: database.coefficients(quantity).iter().copied().collect(),
            basis: database.basis(quantity).to_owned(),
            axes,
        })
    }

    /// Number of wavelengths of a spectrum, l.
    #[must_use]
    pub fn wavelengths(&self) -> usize {
        self.basis.nrows()
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
        if spectrum.len() != self.wavelengths() {
            return Err(LookupError::Shape {
                dimension: "wavelengths",
                expected: self.wavelengths(),
                found: spectrum.len(),
            });
        }
        let corners = self.corners(point)?;
        let view = self.view.stencil(self.inside(Parameter::View, point)?);
        let incidence = self
            .incidence
            .stencil(self.inside(Parameter::Incidence, point)?);
        let azimuths = self.azimuths(point)?;
        let [.., incidences] = self.axes.core_shape();
        let azimuth_count = self.axes.values(Parameter::RelativeAzimuth).len();
        let block: usize = self.axes.core_shape().iter().product();
        let components = self.basis.ncols();
        let mut sum = vec![0.0_f64; components];
        for ((view, view_side), view_weight) in view.iter() {
            for ((angle, angle_side), angle_weight) in incidence.iter() {
                let azimuths = &azimuths[usize::from(view_side != angle_side)];
                for ((azimuth, _), azimuth_weight) in azimuths.iter() {
                    let weight = view_weight * angle_weight * azimuth_weight;
                    let first = (view * azimuth_count + azimuth) * block + angle;
                    for (corner, share) in &corners {
                        let row = (first + corner * incidences) * components;
                        let row = &self.coefficients[row..row + components];
                        let weight = weight * share;
                        for (sum, value) in sum.iter_mut().zip(row) {
                            *sum += weight * f64::from(*value);
                        }
                    }
                }
            }
        }
        for (value, vectors) in spectrum.iter_mut().zip(self.basis.rows()) {
            let products = vectors.iter().zip(&sum).map(|(v, c)| f64::from(*v) * c);
            *value = products.sum::<f64>().clamp(-LARGEST, LARGEST) as f32;
        }
        Ok(())
    }

    /// The combinations of nodes of [`LINEAR`] around `point`: number and weight.
    fn corners(&self, point: Point) -> Result<Vec<(usize, f64)>, LookupError> {
        let mut corners = vec![(0, 1.0)];
        let mut slab = point;
        for parameter in LINEAR {
            let nodes = self.axes.values(parameter);
            let value = self.inside(parameter, point)?;
            slab.set(parameter, value);
            let (below, share) = bracket(parameter, nodes, value)?;
            let split = |(corner, weight): (usize, f64)| {
                let both = [(below, 1.0 - share), (below + 1, share)].into_iter();
                let both = both.filter(|(_, share)| *share > 0.0);
                both.map(move |(node, share)| (corner * nodes.len() + node, weight * share))
            };
            corners = corners.into_iter().flat_map(split).collect();
        }
        let [size, thickness] = [Parameter::GrainSize, Parameter::Thickness].map(|p| slab[p]);
        match missing_curve(&self.absent, &self.axes, size, thickness) {
            Some(missing) => Err(absent_error(missing, point)),
            None => Ok(corners),
        }
    }

    /// The azimuths around that of `point`, and around that of the other side of the normal.
    fn azimuths(&self, point: Point) -> Result<[Stencil; 2], LookupError> {
        let parameter = Parameter::RelativeAzimuth;
        if self.is_axial {
            let only = self.azimuth.stencil(self.azimuth.places[0]);
            return Ok([only; 2]);
        }
        let turned = point[parameter].rem_euclid(360.0);
        let folded = point.with(parameter, turned.min(360.0 - turned));
        let azimuth = self.inside(parameter, folded)?;
        // the second is not used if the other side has no nodes
        Ok([azimuth, 180.0 - azimuth].map(|azimuth| self.azimuth.stencil(azimuth)))
    }

    /// The value of `point` on an axis, limited to the ends where it exceeds them within
    /// the tolerance. Beyond its ends the thickness is limited too.
    fn inside(&self, parameter: Parameter, point: Point) -> Result<f64, LookupError> {
        let (nodes, value) = (self.axes.values(parameter), point[parameter]);
        let [first, last] = [nodes[0], nodes[nodes.len() - 1]];
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
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
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
        let near = file(&[0.0], &[0.0, f64::from(f32::from_bits(1)), 60.0], |[x, ..]| {
            if x == 0.0 { -1e9 } else { 1e9 }
        });
        let found = look_up(&near, at(1.0, [30.0, 0.0, 0.0])).unwrap();
        assert_eq!(found.abs(), LARGEST);
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
        assert!(crate::Directions::new(&views, &views).is_err());
    }
}
