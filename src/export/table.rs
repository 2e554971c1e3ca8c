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
    /// The quantities, with one dimension for each axis; of length 1 for an axis that the quantity
    /// does not have.
    pub(super) quantities: Vec<(ExportVariable, ArrayD<f32>)>,
    /// The metadata of the file.
    pub(super) attributes: BTreeMap<String, String>,
    /// Names and values of the axes that [`ExportTable::at`] has removed.
    pub(super) fixed: BTreeMap<&'static str, f64>,
}

/// A quantity in an export.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExportVariable {
    /// An array of the database.
    Stored(Variable),
    /// The reflectance factor over the reflectance.
    AnisotropyFactor {
        /// Whether the light is diffuse.
        is_diffuse: bool,
    },
}

impl ExportVariable {
    /// Name of the array.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Stored(variable) => variable.name(),
            Self::AnisotropyFactor { is_diffuse: false } => "anisotropy_factor",
            Self::AnisotropyFactor { is_diffuse: true } => "anisotropy_factor_diffuse",
        }
    }

    /// Description of the quantity.
    #[must_use]
    pub const fn long_name(self) -> &'static str {
        match self {
            Self::Stored(variable) => variable.long_name(),
            Self::AnisotropyFactor { is_diffuse: false } => "BRF over reflectance",
            Self::AnisotropyFactor { is_diffuse: true } => {
                "HDRF over reflectance, of isotropic light"
            }
        }
    }

    /// Its standard error, if the export may have it.
    #[must_use]
    pub fn se(self) -> Option<Self> {
        match self {
            Self::Stored(variable) if !variable.is_error => Some(Self::Stored(variable.se())),
            _ => None,
        }
    }

    /// The same under diffuse light.
    fn diffuse(self) -> Self {
        match self {
            Self::Stored(variable) => Self::Stored(variable.diffuse()),
            Self::AnisotropyFactor { .. } => Self::AnisotropyFactor { is_diffuse: true },
        }
    }

    /// Whether the quantity has the axis with this name.
    fn has_axis(self, name: &str) -> bool {
        let variable = match self {
            Self::Stored(variable) => variable,
            Self::AnisotropyFactor { is_diffuse } => Variable {
                is_diffuse,
                ..Variable::REFLECTANCE.toward_views()
            },
        };
        Parameter::named(name).is_none_or(|parameter| variable.has_axis(parameter))
    }
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
        let mut table = Self::without_values(store)?;
        if diffuse {
            table.axes.retain(|(name, _)| *name != ANGLE);
            table.mark_diffuse();
        }
        for variable in Variable::ALL {
            let variable = if diffuse {
                variable.diffuse()
            } else {
                variable
            };
            table.add_stored(store, variable)?;
        }
        Ok(table)
    }

    /// All factors toward the views of a finished database, under collimated light and, if it
    /// has them, under diffuse light; the reflectances and transmittances to which they add up;
    /// and the anisotropy factors of reflected light. A quantity has only the axes on which it
    /// depends.
    ///
    /// # Errors
    /// [`ExportError::NoViews`] if the database has no views; those of [`ExportTable::of_store`].
    pub fn of_views(store: &Store) -> Result<Self, ExportError> {
        let mut table = Self::without_values(store)?;
        if store.views().is_empty() {
            let path = store.path().into();
            return Err(ExportError::NoViews { path });
        }
        let views = store.views().iter();
        let views = views.map(|(parameter, values)| (parameter.name(), values.to_vec()));
        table.axes.splice(0..0, views);
        let lights: &[bool] = match store.has_diffuse() {
            true => &[false, true],
            false => &[false],
        };
        for &is_diffuse in lights {
            for of_view in [true, false] {
                for variable in Variable::ALL {
                    let variable = Variable {
                        is_diffuse,
                        is_view: of_view,
                        ..variable
                    };
                    table.add_stored(store, variable)?;
                }
            }
            let reflectance = Variable {
                is_diffuse,
                ..Variable::REFLECTANCE
            };
            let totals = store.read(reflectance)?;
            let mut factors = store.read(reflectance.toward_views())?;
            for (row, mut factors) in factors.rows_mut().into_iter().enumerate() {
                factors /= &totals.row(row % totals.nrows());
            }
            let values = factors.into_raw_vec_and_offset().0;
            table.add(ExportVariable::AnisotropyFactor { is_diffuse }, values)?;
        }
        let light = "collimated, angle_deg is the polar angle of incidence from the surface normal; of hdrf, hdtf and names with diffuse: isotropic radiance over the upper hemisphere";
        table
            .attributes
            .insert("illumination".to_owned(), light.to_owned());
        Ok(table)
    }

    /// The axes of a finished database, without views, and its attributes.
    fn without_values(store: &Store) -> Result<Self, ExportError> {
        let missing = store.missing()?.len();
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
        let axes = axes.map(|(name, values)| (name, values.to_vec())).collect();
        let attributes = store.attributes().into_iter().map(|(key, value)| {
            let text = match value {
                Value::String(text) => text,
                other => other.to_string(),
            };
            (key, text)
        });
        Ok(Self {
            axes,
            quantities: Vec::new(),
            attributes: attributes.collect(),
            fixed: BTreeMap::new(),
        })
    }

    /// Adds an array of the database.
    fn add_stored(&mut self, store: &Store, variable: Variable) -> Result<(), ExportError> {
        let values = store.read(variable)?.into_raw_vec_and_offset().0;
        self.add(ExportVariable::Stored(variable), values)
    }

    /// All curves of a compact file, evaluated at its nodes; values beyond 0 or 1 are 0 or 1.
    ///
    /// # Errors
    /// [`ExportError::Lookup`] if the file holds anisotropy factors; [`ExportError::Encoding`] if the file is larger than memory can address.
    pub fn of_compact(database: &Database) -> Result<Self, ExportError> {
        database.require_hemispherical()?;
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
            (Quantity::Transmittance, Variable::TRANSMITTANCE),
            (Quantity::Reflectance, Variable::REFLECTANCE),
        ];
        for (quantity, variable) in quantities {
            if database.has(quantity) {
                let curves = (0..database.curves()).filter_map(|row| database.curve(row, quantity));
                // compression may go a little beyond both
                let values = curves.flatten().map(|value| value.clamp(0.0, 1.0));
                let values = values.collect();
                table.add(ExportVariable::Stored(variable), values)?;
            }
        }
        Ok(table)
    }

    /// Adds a quantity with one value for each combination of nodes of its axes.
    fn add(&mut self, variable: ExportVariable, values: Vec<f32>) -> Result<(), ExportError> {
        let length = |(name, nodes): &(&str, Vec<f64>)| match variable.has_axis(name) {
            true => nodes.len(),
            false => 1,
        };
        let shape: Vec<usize> = self.axes.iter().map(length).collect();
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

    /// Names and lengths of the axes that a quantity has.
    pub fn dimensions(
        &self,
        variable: ExportVariable,
    ) -> impl Iterator<Item = (&'static str, usize)> {
        let own = self
            .axes
            .iter()
            .filter(move |(name, _)| variable.has_axis(name));
        own.map(|(name, nodes)| (*name, nodes.len()))
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
        let permuted = |(variable, array): (ExportVariable, ArrayD<f32>)| {
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
