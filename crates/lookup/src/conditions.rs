//! Between the nodes of axes that a database may leave out.
//!
//! What is interpolated is y = -ln T, and -ln(1 - R) for reflectance, as along the other
//! axes: linear in the coordinate of each axis. Where the file's basis is one of y, that is
//! a mean of its coefficients.
use ndarray::{Array2, Axis, Slice};
use splitsnow_spectra::Quantity;

use crate::{Basis, Database, Factors, LookupError, Parameter, Point, nodes, untold};

/// Largest y, as in [`super::smooth`].
const DARKEST: f64 = 16.0;
/// Most bytes of spectra made of a `linear` file.
const MOST_BYTES: u128 = 1 << 30;

impl Database {
    /// Number of curves of one combination of the axes that a database may leave out.
    fn curves_each(&self) -> usize {
        self.axes.core_shape().iter().product()
    }

    /// [`LookupError::Condition`] if there is more than one such combination.
    pub(super) fn single(&self) -> Result<(), LookupError> {
        let mut optional = self.axes.iter().filter(|(p, _)| p.is_optional());
        match optional.find(|(_, nodes)| nodes.len() > 1) {
            None => Ok(()),
            Some((parameter, nodes)) => Err(untold(parameter, nodes)),
        }
    }

    /// [`LookupError::NoAxis`] if `point` has a value on an axis that the file has not.
    pub(super) fn has_axes_of(&self, point: &Point) -> Result<(), LookupError> {
        match point
            .iter()
            .find(|(parameter, _)| !self.axes.has(*parameter))
        {
            Some((parameter, _)) => Err(LookupError::NoAxis {
                axis: parameter.key(),
            }),
            None => Ok(()),
        }
    }

    /// The database at the values that `point` has on axes that a database may leave out,
    /// without those axes; values on axes of a single node need not be told.
    ///
    /// On a node it is that part of the file as it stands, between nodes a mean of
    /// the parts around.
    ///
    /// # Errors
    /// [`LookupError::Condition`] for a value that is missing,
    /// [`LookupError::NoAxis`] for one of an axis that the file has not,
    /// [`LookupError::Outside`]; [`LookupError::TooLarge`] for a `linear` file whose
    /// spectra would not fit 1 GB.
    pub fn at(&self, point: Point) -> Result<Self, LookupError> {
        self.has_axes_of(&point)?;
        let optional = self.axes.optional();
        if optional.is_empty() {
            return Ok(self.clone());
        }
        let mut corners = vec![(0, 1.0)];
        for (parameter, nodes) in optional.iter() {
            let (below, share) = match point.get(parameter) {
                Some(value) => cell(parameter, nodes, value)?,
                None if nodes.len() == 1 => (0, 0.0),
                None => return Err(untold(parameter, nodes)),
            };
            let both = [(below, 1.0 - share), (below + 1, share)];
            let there = both.into_iter().filter(|(_, weight)| *weight > 0.0);
            let there: Vec<_> = there.collect();
            let split = |(block, weight): (usize, f64)| {
                let all = there.iter();
                all.map(move |(i, share)| (block * nodes.len() + i, weight * share))
            };
            corners = corners.into_iter().flat_map(split).collect();
        }
        if corners.len() > 1 && self.kind == Basis::Linear {
            let values = self.curves_each() as u128 * self.wavelengths_nm.len() as u128;
            let bytes = values * size_of::<f32>() as u128;
            if bytes > MOST_BYTES {
                return Err(LookupError::TooLarge { bytes });
            }
        }
        Ok(Self {
            axes: Parameter::CORE
                .map(|parameter| (parameter, self.axes.values(parameter).to_vec()))
                .into(),
            absent: self.absent.clone(),
            wavelengths_nm: self.wavelengths_nm.clone(),
            curves: self.curves_each(),
            kind: self.kind,
            precision: self.precision,
            transmittance: self.mixed(Quantity::Transmittance, &corners),
            reflectance: self.mixed(Quantity::Reflectance, &corners),
            has_black_substrate: self.has_black_substrate,
            metadata: self.metadata.clone(),
        })
    }

    /// Means of the parts numbered and weighted in `corners`.
    fn mixed(&self, quantity: Quantity, corners: &[(usize, f64)]) -> Factors {
        let all = self.factors(quantity);
        let (n, l) = (self.curves_each(), self.wavelengths_nm.len());
        if !self.has(quantity) {
            return Factors::default();
        }
        let part = |block: usize| {
            let rows = Slice::from(block * n..(block + 1) * n);
            all.coefficients.slice_axis(Axis(0), rows)
        };
        if let [(block, _)] = corners {
            return Factors {
                coefficients: part(*block).to_owned(),
                basis: all.basis.clone(),
            };
        }
        if self.kind == Basis::Log {
            let mut coefficients = Array2::zeros((n, all.coefficients.ncols()));
            for (block, weight) in corners {
                coefficients.scaled_add(*weight as f32, &part(*block));
            }
            return Factors {
                coefficients,
                basis: all.basis.clone(),
            };
        }
        let mut curves = Array2::zeros((n, l));
        for (row, mut mean) in curves.rows_mut().into_iter().enumerate() {
            if !self.exists(row) {
                continue;
            }
            let mut sum = vec![0.0; l];
            for (block, weight) in corners {
                let curve = self.curve(block * n + row, quantity).unwrap_or_default();
                for (sum, value) in sum.iter_mut().zip(curve) {
                    let y = Basis::Log.projected(quantity, f64::from(value));
                    *sum += weight * y.min(DARKEST);
                }
            }
            for (value, y) in mean.iter_mut().zip(sum) {
                *value = Basis::Log.value(quantity, y) as f32;
            }
        }
        Factors {
            coefficients: curves,
            basis: Array2::eye(l),
        }
    }
}

/// The node below `value` and how far it is from there to the next, in the
/// coordinate of the parameter.
fn cell(parameter: Parameter, nodes: &[f64], value: f64) -> Result<(usize, f64), LookupError> {
    match nodes::find(parameter.key(), nodes, value) {
        Ok(node) => Ok((node, 0.0)),
        Err(LookupError::BetweenNodes { below, above, .. }) => {
            let scale = parameter.record().scale;
            let [from, to] = [below, above].map(|node| scale.place(node));
            let node = nodes.iter().position(|node| *node == below);
            Ok((
                node.unwrap_or_default(),
                (scale.place(value) - from) / (to - from),
            ))
        }
        Err(outside) => Err(outside),
    }
}
