//! Interpolation between the nodes of the optional axes that describe the snow.
//!
//! As along the other axes, the interpolated variable is y = -ln T, or -ln(1 - R) for
//! reflectance, and it is linear in the coordinate of each axis. If the basis of the file
//! is one of y (`log`), the interpolation is a weighted mean of the coefficients. So it is for
//! anisotropy factors, which are interpolated themselves; the axes of their views stay.
use ndarray::{Array2, Axis, Slice};
use splitsnow_spectra::Quantity;

use crate::{Basis, Database, Factors, LookupError, Parameter, Point, missing_value, nodes};

/// Largest y, as in [`super::smooth`].
const DARKEST: f64 = 16.0;
/// Largest size of the spectra interpolated from a `linear` file, bytes.
const MOST_BYTES: u128 = 1 << 30;

impl Database {
    /// Number of curves of one block: one combination of nodes of the optional axes.
    fn curves_per_block(&self) -> usize {
        self.axes.core_shape().iter().product()
    }

    /// [`LookupError::MissingCondition`] if there is more than one block.
    pub(super) fn require_single_block(&self) -> Result<(), LookupError> {
        let axes = self.axes.iter();
        let mut optional = axes.filter(|(p, _)| p.is_optional() && !p.is_view());
        match optional.find(|(_, nodes)| nodes.len() > 1) {
            None => Ok(()),
            Some((parameter, nodes)) => Err(missing_value(parameter, nodes)),
        }
    }

    /// [`LookupError::NoAxis`] if `point` has a value on an axis that is not in the file.
    pub(super) fn require_axes_of(&self, point: &Point) -> Result<(), LookupError> {
        let mut given = point.iter();
        match given.find(|(parameter, _)| !self.axes.has(*parameter)) {
            Some((parameter, _)) => Err(LookupError::NoAxis {
                axis: parameter.key(),
            }),
            None => Ok(()),
        }
    }

    /// The database at the values of `point` on the optional axes, without those axes. An
    /// optional axis with a single node needs no value. Views are kept whole, and `point` need
    /// not have one.
    ///
    /// On a node the result is that part of the file unchanged; between nodes it is a
    /// weighted mean of the neighbouring parts.
    ///
    /// # Errors
    /// [`LookupError::MissingCondition`] if a value is missing, [`LookupError::NoAxis`] if a value
    /// belongs to an axis that is not in the file, [`LookupError::Outside`] if a value is
    /// outside its axis, [`LookupError::TooLarge`] if the spectra of a `linear` file would
    /// exceed 1 GB.
    pub fn at(&self, point: Point) -> Result<Self, LookupError> {
        self.require_axes_of(&point)?;
        let (views, optional) = (self.axes.views(), self.axes.optional());
        if optional.is_empty() {
            return Ok(self.clone());
        }
        let mut corners = vec![(0, 1.0)];
        for (parameter, nodes) in optional.iter() {
            let (below, share) = match point.get(parameter) {
                Some(value) => bracket(parameter, nodes, value)?,
                None if nodes.len() == 1 => (0, 0.0),
                None => return Err(missing_value(parameter, nodes)),
            };
            let both = [(below, 1.0 - share), (below + 1, share)];
            let neighbours = both.into_iter().filter(|(_, weight)| *weight > 0.0);
            let neighbours: Vec<_> = neighbours.collect();
            let split = |(block, weight): (usize, f64)| {
                let neighbours = neighbours.iter();
                neighbours.map(move |(i, share)| (block * nodes.len() + i, weight * share))
            };
            corners = corners.into_iter().flat_map(split).collect();
        }
        if corners.len() > 1 && self.kind == Basis::Linear && !self.holds_anisotropy() {
            let values = self.curves_per_block() as u128 * self.wavelengths_nm.len() as u128;
            let bytes = values * size_of::<f32>() as u128;
            if bytes > MOST_BYTES {
                return Err(LookupError::TooLarge { bytes });
            }
        }
        let conditions = optional.count() as usize;
        let mixed = |quantity| {
            let factors = (0..views.count() as usize).map(|view| {
                let corners = corners.iter();
                let corners = corners.map(|(block, weight)| (view * conditions + block, *weight));
                self.mixed(quantity, &corners.collect::<Vec<_>>())
            });
            joined(factors.collect())
        };
        let core = Parameter::CORE.into_iter();
        let kept = core.chain(Parameter::VIEWS.into_iter().filter(|p| self.axes.has(*p)));
        Ok(Self {
            axes: kept.map(|p| (p, self.axes.values(p).to_vec())).collect(),
            absent: self.absent.clone(),
            wavelengths_nm: self.wavelengths_nm.clone(),
            curves: views.count() as usize * self.curves_per_block(),
            kind: self.kind,
            precision: self.precision,
            transmittance: mixed(Quantity::Transmittance).into(),
            reflectance: mixed(Quantity::Reflectance).into(),
            has_black_substrate: self.has_black_substrate,
            metadata: self.metadata.clone(),
        })
    }

    /// Weighted mean of blocks of the file; `corners` holds the number and weight of each.
    fn mixed(&self, quantity: Quantity, corners: &[(usize, f64)]) -> Factors {
        let factors = self.factors(quantity);
        let (n, l) = (self.curves_per_block(), self.wavelengths_nm.len());
        if !self.has(quantity) {
            return Factors::default();
        }
        let part = |block: usize| {
            let rows = Slice::from(block * n..(block + 1) * n);
            factors.coefficients.slice_axis(Axis(0), rows)
        };
        if let [(block, _)] = corners {
            return Factors {
                coefficients: part(*block).to_owned(),
                basis: factors.basis.clone(),
            };
        }
        if self.kind == Basis::Log || self.holds_anisotropy() {
            let mut coefficients = Array2::zeros((n, factors.coefficients.ncols()));
            for (block, weight) in corners {
                coefficients.scaled_add(*weight as f32, &part(*block));
            }
            return Factors {
                coefficients,
                basis: factors.basis.clone(),
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

/// The curves of several parts with the same basis, one part after the other.
fn joined(mut parts: Vec<Factors>) -> Factors {
    if parts.len() == 1 {
        return parts.pop().unwrap_or_default();
    }
    let rows = parts.iter().map(|part| part.coefficients.nrows()).sum();
    let Some(first) = parts.first() else {
        return Factors::default();
    };
    let values = parts.iter().flat_map(|part| &part.coefficients).copied();
    let shape = (rows, first.basis.ncols());
    Factors {
        coefficients: Array2::from_shape_vec(shape, values.collect()).unwrap_or_default(),
        basis: first.basis.clone(),
    }
}

/// The node below `value`, and the position of `value` between it and the next node (0 to
/// 1) in the coordinate of the parameter.
pub(super) fn bracket(
    parameter: Parameter,
    nodes: &[f64],
    value: f64,
) -> Result<(usize, f64), LookupError> {
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
