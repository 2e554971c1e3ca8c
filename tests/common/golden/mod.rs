//! The golden data: converged reflectance and transmittance of the cases of
//! [`plan`]. `examples/golden.rs` writes them to [`FILE`].
pub(crate) mod compare;
pub(crate) mod plan;

use splitsnow::measurement::Measured;
use splitsnow::transport::{Illumination, Snow};
use splitsnow::units::cm_to_m;

use plan::{Run, illumination};

pub(crate) const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/golden.csv");

/// The header row of [`FILE`].
pub(crate) const COLUMNS: &str = "size_min_um,size_max_um,facetness,facetness_half_width,\
density_kg_m3,saturation,angle_deg,thickness_cm,wavelength_nm,rays,\
reflectance,reflectance_se,transmittance,transmittance_se,lost";

/// One slab under one illumination at all wavelengths of the plan.
#[derive(Debug, Clone)]
pub(crate) struct Case {
    /// The first eight columns of the file.
    pub(crate) name: String,
    pub(crate) snow: Snow,
    pub(crate) illumination: Illumination,
    pub(crate) thickness_m: f64,
    /// Ascending: 31 visible, then 5 in the near infrared.
    pub(crate) wavelengths_nm: Vec<f64>,
    /// One value per wavelength.
    pub(crate) reflectance: Vec<Measured>,
    pub(crate) transmittance: Vec<Measured>,
    /// Fraction of the rays that were abandoned. They count neither as reflected nor as
    /// transmitted (see the header of the file).
    pub(crate) lost: Vec<f64>,
}

/// The name of the case of `run` with thickness `thickness_cm`.
pub(crate) fn name(run: &Run, thickness_cm: f64) -> String {
    let [min, max] = run.snow.size_um;
    let [mean, half_width] = run.snow.facetness;
    let (density, saturation) = (run.snow.density_kg_m3, run.snow.saturation);
    let angle = run.angle_deg.map_or("diffuse".into(), |a| a.to_string());
    format!("{min},{max},{mean},{half_width},{density},{saturation},{angle},{thickness_cm}")
}

/// The start of the row of `run` at one thickness and wavelength: all columns
/// that follow from the plan.
pub(crate) fn key(run: &Run, thickness_cm: f64, wavelength_nm: f64) -> String {
    let (name, rays) = (name(run, thickness_cm), run.rays);
    format!("{name},{wavelength_nm},{rays},")
}

/// All cases of the plan, read from [`FILE`].
///
/// # Panics
/// If the rows of the file are not those of the plan, in the order of the plan.
pub(crate) fn read() -> Vec<Case> {
    let text = std::fs::read_to_string(FILE).unwrap_or_else(|e| panic!("{FILE}: {e}"));
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    assert_eq!(lines.next(), Some(COLUMNS), "columns of {FILE}");
    let mut cases: Vec<Case> = Vec::new();
    for run in plan::runs() {
        for &thickness_cm in &run.thicknesses_cm {
            let name = name(&run, thickness_cm);
            let position = cases.iter().position(|case| case.name == name);
            let case = match position {
                Some(position) => &mut cases[position],
                None => {
                    cases.push(empty(name, &run, thickness_cm));
                    cases.last_mut().unwrap()
                }
            };
            for &wavelength_nm in run.wavelengths_nm {
                let key = key(&run, thickness_cm, wavelength_nm);
                let line = lines.next().unwrap_or_default();
                let values = line
                    .strip_prefix(&key)
                    .unwrap_or_else(|| panic!("{FILE}: expected a row `{key}...`, found `{line}`"));
                let [r, r_se, t, t_se, lost] = numbers(values);
                case.wavelengths_nm.push(wavelength_nm);
                case.reflectance.push(Measured { value: r, se: r_se });
                case.transmittance.push(cautious(t, t_se, run.rays));
                case.lost.push(lost);
            }
        }
    }
    assert_eq!(lines.next(), None, "{FILE} has more rows than the plan");
    cases
}

/// A transmittance with a cautious standard error. If the standard error
/// exceeds a quarter of the value, the value comes from a few rays and the
/// standard error is itself unreliable. It is then raised to at least 1/rays,
/// as where no ray was transmitted.
fn cautious(value: f64, se: f64, rays: u64) -> Measured {
    let se = if se > 0.25 * value {
        se.max(1.0 / rays as f64)
    } else {
        se
    };
    Measured { value, se }
}

fn empty(name: String, run: &Run, thickness_cm: f64) -> Case {
    Case {
        name,
        snow: run.snow.snow(),
        illumination: illumination(run.angle_deg),
        thickness_m: cm_to_m(thickness_cm),
        wavelengths_nm: Vec::new(),
        reflectance: Vec::new(),
        transmittance: Vec::new(),
        lost: Vec::new(),
    }
}

fn numbers(values: &str) -> [f64; 5] {
    let numbers: Result<Vec<f64>, _> = values.split(',').map(str::parse).collect();
    let numbers = numbers.unwrap_or_else(|e| panic!("`{values}` in {FILE}: {e}"));
    numbers.try_into().unwrap()
}
