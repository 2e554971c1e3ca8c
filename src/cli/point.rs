//! The options that say where in a compact file.
use anyhow::bail;

use crate::compress::AXES;
use crate::export::{ExportError, Table};
use crate::grid::{Conditions, ExtraAxis, described};
use crate::lookup::{Database, Point, exact};
use crate::units::HALF_SPACE_CM;

/// One coordinate for each axis.
#[derive(Debug, clap::Args)]
pub(super) struct PointArgs {
    /// Mean facetness of the grains
    #[arg(long, value_name = "F")]
    facetness: Option<f64>,
    /// Mean length of the grains' major axis, um
    #[arg(long, value_name = "G")]
    grain_size_um: Option<f64>,
    /// Density of the dry snow, kg/m3
    #[arg(long, value_name = "D")]
    density_kg_m3: Option<f64>,
    /// Thickness of the slab, cm; inf is a half space
    #[arg(long, value_name = "H")]
    thickness_cm: Option<f64>,
    /// Polar angle of incidence from the surface normal, degrees
    #[arg(long, value_name = "A")]
    angle_deg: Option<f64>,
    /// Black carbon, ng per g of snow; this and the four below where the file has
    /// such an axis, and only there
    #[arg(long, value_name = "C")]
    black_carbon_ng_g: Option<f64>,
    /// Water saturation of the pore space
    #[arg(long, value_name = "S")]
    water_saturation: Option<f64>,
    /// Temperature, Celsius
    #[arg(long, value_name = "T")]
    temperature_c: Option<f64>,
    /// Mean sphericity of the grains
    #[arg(long, value_name = "S")]
    sphericity: Option<f64>,
    /// Lambertian reflectance of the substrate
    #[arg(long, value_name = "R")]
    substrate_reflectance: Option<f64>,
}

/// Makes the options of the five axes required ones.
pub(super) fn required(arg: clap::Arg) -> clap::Arg {
    match AXES
        .iter()
        .position(|axis| axis.name == arg.get_id().as_str())
    {
        // the angle
        Some(4) => arg.required_unless_present("diffuse"),
        Some(_) => arg.required(true),
        None => arg,
    }
}

impl PointArgs {
    fn five(&self) -> [Option<f64>; 5] {
        [
            self.facetness,
            self.grain_size_um,
            self.density_kg_m3,
            // a half space is as thick as files hold it
            self.thickness_cm.map(|cm| match cm {
                f64::INFINITY => HALF_SPACE_CM,
                cm => cm,
            }),
            self.angle_deg,
        ]
    }

    /// Whether none is given.
    pub(super) fn is_empty(&self) -> bool {
        self.five().iter().all(Option::is_none) && self.conditions().is_empty()
    }

    /// Whether the thickness is given.
    pub(super) fn has_thickness(&self) -> bool {
        self.thickness_cm.is_some()
    }

    /// Whether no node is chosen of density, size, thickness and angle.
    pub(super) fn leaves_tables(&self) -> bool {
        let [_facetness, rest @ ..] = self.five();
        rest.iter().all(Option::is_none)
    }

    /// The part of `table` at the nodes of facetness and of axes beyond the five.
    pub(super) fn cut(&self, mut table: Table) -> Result<Table, ExportError> {
        if let Some(facetness) = self.facetness {
            table = table.at(AXES[0].name, facetness)?;
        }
        for (axis, value) in self.conditions() {
            table = table.at(axis.name(), value)?;
        }
        Ok(table)
    }

    /// The point, all five coordinates of which must be given; under `diffuse` light the
    /// angle is the one of its file.
    pub(super) fn point(&self, diffuse: bool) -> anyhow::Result<Point> {
        let mut coordinates = [0.0; 5];
        let mut five = self.five();
        five[4] = five[4].or(diffuse.then_some(0.0));
        let given = five.into_iter().zip(&AXES);
        for (coordinate, (value, axis)) in coordinates.iter_mut().zip(given) {
            match value {
                Some(value) => *coordinate = value,
                None => bail!(
                    "say where: --{} is missing; one spectrum is at one point of all five axes",
                    axis.name.replace('_', "-")
                ),
            }
        }
        Ok(Point::from_coordinates(coordinates))
    }

    /// The values given of axes beyond the five.
    pub(super) fn conditions(&self) -> Conditions {
        let given = [
            self.black_carbon_ng_g,
            self.water_saturation,
            self.temperature_c,
            self.sphericity,
            self.substrate_reflectance,
        ];
        let all = ExtraAxis::ALL.into_iter().zip(given);
        all.filter_map(|(axis, value)| Some((axis, value?)))
            .collect()
    }

    /// The point and conditions, at the middle nodes of the axes where nothing is
    /// given.
    pub(super) fn or_middle(&self, database: &Database) -> (Point, Conditions) {
        let middle = |nodes: &[f32]| nodes.get(nodes.len() / 2).map_or(0.0, |node| exact(*node));
        let mut coordinates = [0.0; 5];
        let given = self.five().into_iter().zip(database.axes());
        for (coordinate, (value, nodes)) in coordinates.iter_mut().zip(given) {
            *coordinate = value.unwrap_or_else(|| middle(nodes));
        }
        let mut conditions = self.conditions();
        for (axis, nodes) in database.extra() {
            conditions.entry(*axis).or_insert_with(|| middle(nodes));
        }
        (Point::from_coordinates(coordinates), conditions)
    }

    /// The point and conditions for people, without the thickness unless it is given.
    pub(super) fn described(&self, point: Point, conditions: &Conditions) -> String {
        let text = described(&point, conditions);
        let thickness = format!("thickness {} cm, ", point.thickness_cm as f32);
        match self.thickness_cm {
            Some(_) => text,
            None => text.replace(&thickness, ""),
        }
    }
}
