//! NetCDF in the format of the snow tables of the Community Radiative Transfer Model (CRTM).
//!
//! Names, types, order of dimensions, units and `long_name` are those of its loader
//! `VISsnowCoeff_netCDF_IO` (JCSDA/CRTMv3, June 2026; docs/formats.md). The table holds the
//! reflectance by density, depth, grain size, frequency and angle, and no emissivity, which
//! the loader takes as 1 - reflectance. The infrared loader, `IRsnowCoeff`, reads tables of
//! emissivity at wavelengths longer than those simulated here.
use ndarray::{ArrayD, Axis};
use netcdf3::DataSet;

use super::netcdf::{FILL, STAND_IN, failed, version, written};
use super::{ExportError, ExportLayout, ExportTable, ExportVariable};
use crate::grain::{SizeRange, shape_factor, size_factor_per_m};
use crate::grid::{GridSettings, Spread};
use crate::parameter::Parameter;
use crate::store::Variable;
use crate::units::{HALF_SPACE_CM, m_to_um, um_to_m};

/// A coordinate of the loader, in the order of [`ExportLayout::CRTM`].
struct Dimension {
    /// Name of the dimension.
    dimension: &'static str,
    /// Name of the variable.
    variable: &'static str,
    long_name: &'static str,
    description: &'static str,
    units: &'static str,
}

const DIMENSIONS: [Dimension; 5] = [
    Dimension {
        dimension: "n_Densities",
        variable: "Density",
        long_name: "Density",
        description: "density of the dry snow",
        units: "kg/m^3",
    },
    Dimension {
        dimension: "n_Depths",
        variable: "Depth",
        long_name: "Depth",
        description: "thickness of the snow",
        units: "meters",
    },
    Dimension {
        dimension: "n_Grain_Sizes",
        variable: "Grain_Size",
        long_name: "Grain Size",
        description: "optical radius, 3 / (specific surface area times density of ice)",
        units: "effective radius in microns (um)",
    },
    Dimension {
        dimension: "n_Frequencies",
        variable: "Frequency",
        long_name: "Frequency",
        description: "wavenumber in vacuum",
        units: "inverse centimeters (cm^-1)",
    },
    Dimension {
        dimension: "n_Angles",
        variable: "Angle",
        long_name: "Angle",
        description: "polar angle of incidence of collimated light (solar zenith angle)",
        units: "degrees from vertical",
    },
];

/// Release, which the loader reads first; the loader refuses any other.
const RELEASE: i32 = 1;
/// Version of the data; the loader accepts any.
const VERSION: i32 = 1;
/// CRTM chooses the loader by the first part of the file name: `NPOESS` for one reflectance per
/// type of snow, `SNICAR` for this table.
const CLASSIFICATION: &str = "SNICAR";
/// Number of nodes between which CRTM interpolates, with two parabolas (`CRTM_Interpolation`).
const NODES: usize = 4;

/// `table` as the bytes of a NetCDF file for the CRTM loader. Axes with a single value that
/// the loader does not have are dropped. Curves that do not exist are NaN, which is also the
/// `_FillValue`; CRTM propagates NaN in sums.
///
/// # Errors
/// [`ExportError::Crtm`] if the table has no reflectance, an axis too many, an axis of fewer than
/// four nodes, a half space, or does not state the data for the optical radius;
/// [`ExportError::TooLarge`].
pub fn crtm(table: ExportTable) -> Result<Vec<u8>, ExportError> {
    let table = table.without_fixed_axes()?.with_layout(ExportLayout::Crtm);
    if table.axes.len() != DIMENSIONS.len() {
        return refused(
            "CRTM needs the axes density, depth, grain size, frequency and angle; build a database with them"
                .into(),
        );
    }
    let mut coordinates = Vec::new();
    for ((name, values), about) in table.axes.iter().zip(&DIMENSIONS) {
        if values.len() < NODES {
            return refused(format!(
                "CRTM interpolates over {NODES} nodes of every axis, but {name} has only {}; export a table with more nodes",
                values.len()
            ));
        }
        let converted: Vec<f64> = match about.variable {
            "Depth" => values.iter().map(|cm| cm / 100.0).collect(),
            "Grain_Size" => table.radii_um(values)?,
            // The loader needs increasing frequencies.
            "Frequency" => values.iter().rev().map(|nm| 1e7 / nm).collect(),
            _ => values.clone(),
        };
        if about.variable == "Depth" && values.iter().any(|cm| *cm >= HALF_SPACE_CM) {
            return refused(format!(
                "CRTM tables hold finite depths, but {name} has a half space (inf); export a table without it"
            ));
        }
        if let Some(value) = converted.iter().find(|value| !value.is_finite()) {
            return refused(format!(
                "{name} has the value {value}, which is not finite; export a table without it"
            ));
        }
        coordinates.push((about, converted));
    }
    let quantities = [
        (
            ExportVariable::Stored(Variable::REFLECTANCE),
            "Reflectance",
            "Reflectance",
        ),
        (
            ExportVariable::Stored(Variable::REFLECTANCE.se()),
            "Reflectance_SE",
            "Standard Error of the Reflectance",
        ),
    ];
    let mut arrays: Vec<(&str, &str, ArrayD<f32>)> = Vec::new();
    for (variable, name, long_name) in quantities {
        let mut stored = table.quantities.iter();
        if let Some((_, array)) = stored.find(|(other, _)| *other == variable) {
            let mut array = array.clone();
            array.invert_axis(Axis(3));
            arrays.push((name, long_name, array));
        }
    }
    if arrays
        .first()
        .is_none_or(|(name, ..)| *name != "Reflectance")
    {
        return refused(
            "the file has no reflectance; compress the database again with it".to_owned(),
        );
    }

    let sizes = arrays
        .iter()
        .map(|(name, _, array)| (*name, 8 * array.len() as u64));
    let version = version(sizes)?;
    let mut set = DataSet::new();
    table.about(&mut set).map_err(failed)?;
    for (about, values) in &coordinates {
        set.add_fixed_dim(about.dimension, values.len())
            .map_err(failed)?;
        let name = about.variable;
        set.add_var_f64(name, &[about.dimension]).map_err(failed)?;
        add_description(
            &mut set,
            name,
            [about.long_name, about.description, about.units],
        )
        .map_err(failed)?;
    }
    let dimensions = DIMENSIONS.each_ref().map(|about| about.dimension);
    for (name, long_name, _) in &arrays {
        set.add_var_f64(name, &dimensions).map_err(failed)?;
        let description = "Spectral snow surface reflectance data: directional-hemispherical";
        add_description(&mut set, name, [long_name, description, "N/A"]).map_err(failed)?;
    }
    written(&set, version, |writer| {
        for (about, values) in &coordinates {
            writer.write_var_f64(about.variable, values)?;
        }
        for (name, _, array) in &arrays {
            let values: Vec<f64> = array.iter().copied().map(f64::from).collect();
            writer.write_var_f64(name, &values)?;
        }
        Ok(())
    })
}

/// An error with this reason.
fn refused<T>(reason: String) -> Result<T, ExportError> {
    Err(ExportError::Crtm { reason })
}

/// Adds `long_name`, `description`, `units` and the fill value to a variable.
fn add_description(
    set: &mut DataSet,
    variable: &str,
    [long_name, description, units]: [&str; 3],
) -> Result<(), netcdf3::error::InvalidDataSet> {
    set.add_var_attr_string(variable, "long_name", long_name)?;
    set.add_var_attr_string(variable, "description", description)?;
    set.add_var_attr_string(variable, "units", units)?;
    set.add_var_attr_f64(variable, FILL, vec![f64::from(STAND_IN)])
}

impl ExportTable {
    /// The table without the axes that the loader does not have, which must have a single value.
    fn without_fixed_axes(mut self) -> Result<Self, ExportError> {
        let is_known = |name: &str| ExportLayout::CRTM.contains(&name);
        while let Some(axis) = self.axes.iter().position(|(name, _)| !is_known(name)) {
            let (name, values) = self.axes[axis].clone();
            let [value] = values[..] else {
                return refused(format!(
                    "CRTM tables have the axes density, depth, grain size, frequency and angle only; choose one of the {} values of {name} with --{}",
                    values.len(),
                    name.replace('_', "-")
                ));
            };
            self = self.select(name, value)?;
        }
        Ok(self)
    }

    /// Optical radii, um, for these grain sizes, um.
    fn radii_um(&self, values: &[f64]) -> Result<Vec<f64>, ExportError> {
        let missing = |entry: &str| {
            let reason = format!(
                "the file does not state its {entry}, which the optical radii need; build the database with this version"
            );
            ExportError::Crtm { reason }
        };
        let settings = self.settings().ok_or_else(|| missing("config"))?;
        let half_width_um = settings.spread.grain_size_half_width_um;
        let proportion = match self.fixed.get(Parameter::Sphericity.name()) {
            None => settings.proportion(),
            Some(mean) => {
                let spread = Spread {
                    sphericity_half_width: settings
                        .spread
                        .sphericity_half_width
                        .unwrap_or(f64::NAN),
                    sphericity_sd: settings.spread.sphericity_sd.unwrap_or(f64::NAN),
                    ..Spread::default()
                };
                spread.sphericity_law(*mean).ok()
            }
        };
        let proportion = proportion.ok_or_else(|| missing("shape"))?;
        let law = settings.size_law();
        let shape = shape_factor(settings.shape(), &proportion, law);
        let radius_um = |size_um: &f64| {
            let ends = [size_um - half_width_um, size_um + half_width_um].map(um_to_m);
            let size = SizeRange::new(ends[0], ends[1]);
            let size = size
                .map_err(|_| missing("range of grain sizes"))?
                .with_law(law);
            Ok(m_to_um(3.0 / (4.0 * size_factor_per_m(&size) * shape)))
        };
        values.iter().map(radius_um).collect()
    }

    /// The settings of the database's grid; `None` if the file does not state them.
    fn settings(&self) -> Option<GridSettings> {
        let provenance = self.attributes.get("provenance");
        let provenance: Option<serde_json::Value> =
            provenance.and_then(|text| serde_json::from_str(text).ok());
        let in_provenance = provenance
            .as_ref()
            .and_then(|entries| entries.get("config")?.as_str());
        let text = self
            .attributes
            .get("config")
            .map(String::as_str)
            .or(in_provenance)?;
        GridSettings::parse(text).ok()
    }

    /// Adds the global attributes.
    fn about(&self, set: &mut DataSet) -> Result<(), netcdf3::error::InvalidDataSet> {
        set.add_global_attr_i32("Release", vec![RELEASE])?;
        set.add_global_attr_i32("Version", vec![VERSION])?;
        set.add_global_attr_string("Classification_Name", CLASSIFICATION)?;
        set.add_global_attr_string("Title", "Reflectance of snow")?;
        let version = env!("CARGO_PKG_VERSION");
        let history = format!(
            "written by splitsnow export {version}, without a time so that equal inputs give equal bytes"
        );
        set.add_global_attr_string("History", history)?;
        let mut comment = "First-principles Monte Carlo model of light in snow (Varsa 2025), not SNICAR; that name chooses the loader.".to_owned();
        for (name, value) in &self.fixed {
            comment += &format!(" {name} {value}.");
        }
        set.add_global_attr_string("Comment", comment)?;
        for (name, text) in self.global() {
            if !["Conventions", "title", "history"].contains(&name.as_str()) {
                set.add_global_attr_string(&name, text)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::io::Cursor;

    use ndarray::Dimension;
    use netcdf3::{DataType, FileReader};

    use super::*;
    use crate::engine::Engine;
    use crate::grain::TruncatedNormal;
    use crate::grid::tests::small;

    /// A table with at least four nodes along the five axes, whose values encode their indices.
    fn table() -> ExportTable {
        let axes: Vec<(&'static str, Vec<f64>)> = vec![
            ("facetness", vec![0.1, 0.3]),
            ("grain_size_um", vec![100.0, 200.0, 400.0, 800.0]),
            ("density_kg_m3", vec![100.0, 200.0, 300.0, 400.0]),
            ("thickness_cm", vec![2.0, 5.0, 10.0, 100.0]),
            ("angle_deg", vec![0.0, 15.0, 30.0, 45.0, 75.0]),
            ("wavelength_nm", vec![400.0, 500.0, 800.0, 1000.0]),
        ];
        let shape: Vec<usize> = axes.iter().map(|(_, values)| values.len()).collect();
        let value = |index: ndarray::IxDyn| {
            let digits = index
                .slice()
                .iter()
                .fold(0.0_f32, |sum, i| 8.0 * sum + *i as f32);
            digits * 2.0_f32.powi(-18)
        };
        let mut grid = small(Engine::Spectral);
        grid.spread.grain_size_half_width_um = 10.0;
        grid.fixed.proportion = TruncatedNormal::new(1.0, 1.0, 1.0, 0.0).unwrap();
        let config = grid.to_config();
        ExportTable {
            axes,
            quantities: vec![(
                ExportVariable::Stored(Variable::REFLECTANCE),
                ArrayD::from_shape_fn(shape, value),
            )],
            attributes: [("config".to_owned(), config)].into(),
            fixed: Default::default(),
        }
    }

    /// Names, types, dimensions and units are those that
    /// `src/Coefficients/EmisCoeff/VIS_Snow/VISsnowCoeff_netCDF_IO.f90` of JCSDA/CRTMv3 reads
    /// (its module parameters); the release is that of `VISsnowCoeff_Define.f90`.
    #[test]
    fn the_file_has_what_the_loader_reads() {
        let table = table().select("facetness", 0.3).unwrap();
        let bytes = crtm(table).unwrap();
        let mut file = FileReader::open_seek_read("memory", Box::new(Cursor::new(bytes))).unwrap();
        let set = file.data_set();
        let expected = [
            ("Angle", "n_Angles", 5, "degrees from vertical"),
            (
                "Frequency",
                "n_Frequencies",
                4,
                "inverse centimeters (cm^-1)",
            ),
            (
                "Grain_Size",
                "n_Grain_Sizes",
                4,
                "effective radius in microns (um)",
            ),
            ("Depth", "n_Depths", 4, "meters"),
            ("Density", "n_Densities", 4, "kg/m^3"),
        ];
        for (name, dimension, n, units) in expected {
            assert_eq!(set.dim_size(dimension), Some(n), "{name}");
            let variable = set.get_var(name).unwrap();
            assert_eq!(variable.dim_names(), [dimension]);
            assert_eq!(variable.data_type(), DataType::F64);
            assert_eq!(set.get_var_attr_as_string(name, "units").unwrap(), units);
            for key in ["long_name", "description"] {
                assert_eq!(set.has_var_attr(name, key), Some(true));
            }
            assert!(set.get_var_attr_f64(name, FILL).unwrap()[0].is_nan());
        }
        let reflectance = set.get_var("Reflectance").unwrap();
        assert_eq!(reflectance.data_type(), DataType::F64);
        // C order; in Fortran it is I x L x G x T x J of VISsnowCoeff_Define.
        assert_eq!(
            reflectance.dim_names(),
            [
                "n_Densities",
                "n_Depths",
                "n_Grain_Sizes",
                "n_Frequencies",
                "n_Angles"
            ]
        );
        assert_eq!(
            set.get_var_attr_as_string("Reflectance", "units").unwrap(),
            "N/A"
        );
        assert_eq!(set.get_global_attr_i32("Release"), Some(&[1][..]));
        assert_eq!(set.get_global_attr_i32("Version"), Some(&[1][..]));
        let text = |key| set.get_global_attr_as_string(key).unwrap();
        assert_eq!(text("Classification_Name"), "SNICAR");
        for key in ["Title", "History", "Comment"] {
            assert!(!text(key).is_empty() && text(key).len() < 5000);
        }

        assert_eq!(file.read_var_f64("Depth").unwrap(), [0.02, 0.05, 0.1, 1.0]);
        assert_eq!(
            file.read_var_f64("Frequency").unwrap(),
            [10_000.0, 12_500.0, 20_000.0, 25_000.0]
        );
        // For spheres the radius is half the size over the mean of 1/s; here, at 100 um,
        // 1 / K1 = 90 110 ln(110 / 90) / 20.
        let radii = file.read_var_f64("Grain_Size").unwrap();
        let expected = 0.5 * 90.0 * 110.0 * (110.0_f64 / 90.0).ln() / 20.0;
        assert!((radii[0] - expected).abs() < 1e-9, "{radii:?}");
        let values = file.read_var_f64("Reflectance").unwrap();
        // density 1, depth 2, size 3, frequency 0 (wavelength 3), angle 4
        let place = (((4 + 2) * 4 + 3) * 4) * 5 + 4;
        let digits = [1.0, 3.0, 1.0, 2.0, 4.0, 3.0];
        let digits = digits.into_iter().fold(0.0, |sum, digit| 8.0 * sum + digit);
        assert_eq!(values[place], digits * 2.0_f64.powi(-18));
    }

    #[test]
    fn tables_that_do_not_fit_are_refused() {
        let refused = |table: ExportTable| crtm(table).unwrap_err().to_string();
        let message = refused(table());
        assert!(
            message.ends_with("choose one of the 2 values of facetness with --facetness"),
            "{message}"
        );
        let error = table().select("facetness", 0.2).unwrap_err().to_string();
        assert_eq!(error, "facetness = 0.2 is not a node; give one of 0.1, 0.3");
        assert!(table().select("sphericity", 0.2).is_err());
        let one = || table().select("facetness", 0.1).unwrap();
        let thin = one().select("thickness_cm", 2.0).unwrap();
        assert!(refused(thin).starts_with("cannot make a table for CRTM: CRTM needs the axes"));
        let mut few = one();
        few.axes[4].1.truncate(3);
        assert!(refused(few).contains("4 nodes"));
        let mut anonymous = one();
        anonymous.attributes.clear();
        assert!(refused(anonymous).contains("does not state its config"));
        let mut dark = one();
        dark.quantities[0].0 = ExportVariable::Stored(Variable::TRANSMITTANCE);
        assert!(refused(dark).contains("no reflectance"));
        let mut half = one();
        half.axes[2].1[3] = HALF_SPACE_CM;
        assert!(refused(half).contains("thickness_cm has a half space"));
    }
}
