//! Tables: the spectra of a database or a compact file at its nodes.
use std::collections::BTreeMap;

use ndarray::{ArrayD, Axis, IxDyn};
use serde_json::Value;

use super::ExportError;
use crate::lookup::Database;
use crate::measurement::Quantity;
use crate::parameter::Parameter;
use crate::store::{Store, Variable, WAVELENGTH};

/// Spectra at all nodes of some axes, from a database or a compact file.
#[derive(Debug, Clone, PartialEq)]
pub struct ExportTable {
    /// Names and values of the axes, slowest first. One of them is `wavelength_nm`, the last
    /// one in a database.
    pub(super) axes: Vec<(&'static str, Vec<f64>)>,
    /// The quantities, with one dimension for each axis.
    pub(super) quantities: Vec<(Variable, ArrayD<f32>)>,
    /// The metadata of the file.
    pub(super) attributes: BTreeMap<String, String>,
    /// Names and values of the axes that [`ExportTable::at`] has removed.
    pub(super) fixed: BTreeMap<&'static str, f64>,
}

/// The order of the axes in an export.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExportLayout {
    /// The order of the database, wavelengths last.
    Database,
    /// All other axes, then density, thickness, grain size, wavelength, angle: the order of the
    /// Community Radiative Transfer Model for satellites ([`super::crtm()`]).
    Crtm,
}

impl ExportLayout {
    /// All layouts.
    pub const ALL: [Self; 2] = [Self::Database, Self::Crtm];

    /// The name used on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Database => "database",
            Self::Crtm => "crtm",
        }
    }

    /// The last axes of [`Self::Crtm`], slowest first.
    pub(super) const CRTM: [&'static str; 5] = [
        Parameter::Density.name(),
        Parameter::Thickness.name(),
        Parameter::GrainSize.name(),
        WAVELENGTH,
        ANGLE,
    ];
}

/// Name of the axis of incidence angles.
const ANGLE: &str = Parameter::Incidence.name();

impl ExportTable {
    /// All spectra of a finished database with their standard errors, under collimated or
    /// `diffuse` light. A table for diffuse light has no axis of incidence angles.
    ///
    /// # Errors
    /// [`ExportError::Unfinished`] if jobs are missing; [`ExportError::Store`] if the database
    /// cannot be read.
    pub fn of_store(store: &Store, diffuse: bool) -> Result<Self, ExportError> {
        let missing = store.missing(None)?.len();
        if missing > 0 {
            return Err(ExportError::Unfinished {
                missing,
                jobs: store.jobs().count(),
                path: store.path().into(),
            });
        }
        let axes = store.axes().iter();
        let axes = axes.map(|(parameter, values)| (parameter.name(), values));
        let axes = axes.chain([(WAVELENGTH, store.wavelengths_nm())]);
        let axes = axes.filter(|(name, _)| !(diffuse && *name == ANGLE));
        let axes = axes.map(|(name, values)| (name, values.to_vec())).collect();
        let attributes = store.attributes().into_iter().map(|(key, value)| {
            let text = match value {
                Value::String(text) => text,
                other => other.to_string(),
            };
            (key, text)
        });
        let mut table = Self {
            axes,
            quantities: Vec::new(),
            attributes: attributes.collect(),
            fixed: BTreeMap::new(),
        };
        if diffuse {
            table.mark_diffuse();
        }
        for variable in Variable::ALL {
            let variable = if diffuse {
                variable.diffuse()
            } else {
                variable
            };
            let values = store.read(variable)?.into_raw_vec_and_offset().0;
            table.add(variable, values)?;
        }
        Ok(table)
    }

    /// All curves of a compact file, evaluated at its nodes.
    ///
    /// # Errors
    /// [`ExportError::Encoding`] if the file is larger than memory can address.
    pub fn of_compact(database: &Database) -> Result<Self, ExportError> {
        let axes = database.axes().iter();
        let axes = axes.map(|(parameter, values)| (parameter.name(), values.to_vec()));
        let wavelengths = (WAVELENGTH, database.wavelengths_nm().to_vec());
        let axes = axes.chain([wavelengths]).collect();
        let mut table = Self {
            axes,
            quantities: Vec::new(),
            attributes: database.metadata().clone(),
            fixed: BTreeMap::new(),
        };
        let quantities = [
            (Quantity::Transmittance, Variable::Transmittance),
            (Quantity::Reflectance, Variable::Reflectance),
        ];
        for (quantity, variable) in quantities {
            if database.has(quantity) {
                let curves = (0..database.curves()).filter_map(|row| database.curve(row, quantity));
                table.add(variable, curves.flatten().collect())?;
            }
        }
        Ok(table)
    }

    /// Adds a quantity with one value for each combination of nodes.
    fn add(&mut self, variable: Variable, values: Vec<f32>) -> Result<(), ExportError> {
        let shape: Vec<usize> = self.axes.iter().map(|(_, values)| values.len()).collect();
        let array = ArrayD::from_shape_vec(IxDyn(&shape), values);
        let array = array.map_err(ExportError::encoding("array"))?;
        self.quantities.push((variable, array));
        Ok(())
    }

    /// Converts a table from a compact file for isotropic light: removes its single angle, which
    /// stands for all directions.
    ///
    /// # Errors
    /// [`ExportError::NoNode`] if the table has no angle 0.
    pub fn diffuse(self) -> Result<Self, ExportError> {
        let mut table = self.select(ANGLE, 0.0)?;
        table.fixed.remove(ANGLE);
        for (variable, _) in &mut table.quantities {
            *variable = variable.diffuse();
        }
        table.mark_diffuse();
        Ok(table)
    }

    /// States diffuse light in the attributes.
    fn mark_diffuse(&mut self) {
        let light = "diffuse: isotropic radiance over the upper hemisphere";
        self.attributes
            .insert("illumination".to_owned(), light.to_owned());
    }

    /// The part of the table at one node of `axis`, without that axis. A value matches a node
    /// within a relative difference of 1e-6.
    ///
    /// # Errors
    /// [`ExportError::NoNode`] if the value matches no node or there is no such axis.
    pub fn select(mut self, axis: &str, value: f64) -> Result<Self, ExportError> {
        let position = self.axes.iter().position(|(name, _)| *name == axis);
        let nodes = position.map_or(&[][..], |position| &self.axes[position].1);
        let matches = |node: &f64| (node - value).abs() <= 1e-6 * node.abs().max(f64::MIN_POSITIVE);
        let (Some(position), Some(node)) = (position, nodes.iter().position(matches)) else {
            return Err(ExportError::NoNode {
                axis: axis.to_owned(),
                value,
                nodes: nodes.to_vec(),
            });
        };
        let (name, nodes) = self.axes.remove(position);
        self.fixed.insert(name, nodes[node]);
        for (_, array) in &mut self.quantities {
            *array = array.index_axis(Axis(position), node).to_owned();
        }
        Ok(self)
    }

    /// The table with its axes in the order of `layout`.
    #[must_use]
    pub fn with_layout(mut self, layout: ExportLayout) -> Self {
        if layout == ExportLayout::Database {
            return self;
        }
        // Axes outside the list sort first; the sort is stable and keeps their order.
        let rank = |axis: &usize| {
            let mut last_axes = ExportLayout::CRTM.iter();
            last_axes
                .position(|name| *name == self.axes[*axis].0)
                .map(|i| i + 1)
        };
        let mut order: Vec<usize> = (0..self.axes.len()).collect();
        order.sort_by_key(rank);
        self.axes = order.iter().map(|&axis| self.axes[axis].clone()).collect();
        let permuted = |(variable, array): (Variable, ArrayD<f32>)| {
            (variable, array.permuted_axes(IxDyn(&order)))
        };
        self.quantities = self.quantities.into_iter().map(permuted).collect();
        self
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
pub(super) mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::parameter::Axes;

    /// Two quantities whose values encode their position: the digits of a value are the
    /// indices along the axes.
    pub(in crate::export) fn database() -> Database {
        let axes = Axes::from([
            (Parameter::Temperature, vec![-10.0, -1.0]),
            (Parameter::Facetness, vec![0.1, 0.9]),
            (Parameter::GrainSize, vec![100.0, 300.0, 500.0]),
            (Parameter::Density, vec![200.0, 400.0]),
            (Parameter::Thickness, vec![1.0, 5.0]),
            (Parameter::Incidence, vec![0.0, 40.0, 80.0]),
        ]);
        let lengths = [2, 2, 3, 2, 2, 3];
        let curve = |row: usize| {
            let (mut rest, mut digits, mut unit) = (row, 0, 10);
            for length in lengths.iter().rev() {
                digits += unit * (rest % length);
                rest /= length;
                unit *= 10;
            }
            digits
        };
        let values = |first: usize| {
            Array2::from_shape_fn((144, 4), |(row, l)| (first + curve(row) + l) as f64 * 1e-8)
        };
        let (t, r) = (values(0), values(10_000_000));
        let nm = [400.0, 500.0, 600.0, 700.0];
        Database::from_curves(true, &axes, &nm, Some(&t), Some(&r))
    }

    #[test]
    fn values_stay_at_their_nodes_in_every_layout() {
        let table = ExportTable::of_compact(&database()).unwrap();
        let names =
            |table: &ExportTable| table.axes.iter().map(|(name, _)| *name).collect::<Vec<_>>();
        assert_eq!(
            names(&table)[..3],
            ["temperature_c", "facetness", "grain_size_um"]
        );
        assert_eq!(table.axes[1].1, [0.1, 0.9]);
        let crtm = table.clone().with_layout(ExportLayout::Crtm);
        assert_eq!(
            names(&crtm),
            [
                "temperature_c",
                "facetness",
                "density_kg_m3",
                "thickness_cm",
                "grain_size_um",
                "wavelength_nm",
                "angle_deg"
            ]
        );
        let found = crtm.quantities[1].1[[1, 0, 1, 0, 2, 3, 1]];
        // temperature 1, facetness 0, size 2, density 1, thickness 0, angle 1, wavelength 3
        assert_eq!(found, (11_021_013.0 * 1e-8) as f32);
        assert_eq!(
            table.quantities[1].1[[1, 0, 2, 1, 0, 1, 3]],
            crtm.quantities[1].1[[1, 0, 1, 0, 2, 3, 1]]
        );
    }
}
