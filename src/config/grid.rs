//! Grid files: the axes of a spectral database and how it is simulated.
use std::path::Path;

use crate::colour::Viewing;
use crate::engine::{Engine, MaxError};
use crate::grain::{Facets, SizeConversion, SizeMeasure};
use crate::grid::{Compression, Fixed, Grid, GridViews, Run, SizeAxis, Spread, why_absent};
use crate::parameter::{Axes, Parameter};

use super::axis_keys::AxesKeys;
use super::document::{Document, read_text};
use super::error::{ConfigError, Problem};
use super::keys::{FixedKeys, GridKeys, RunKeys, SIZE_UM};
use super::shared::{
    choose, covered, increasing, model, one_size, shape, size_law, viewing, wavelengths,
};
use super::snow::{
    fixed, fixed_or_axis, longest_grain, remark_axis, remark_sizes, remark_smooth, remark_spread,
    spread, thick_enough,
};
use super::{directory_of, schema};

/// Largest number of values (curves times wavelengths) in a database: 80 GB per quantity.
const MAX_VALUES: u64 = 10_000_000_000;
/// Largest number of walks in a database (curves times rays).
const MAX_RAYS: u64 = 1_000_000_000_000_000_000;

/// A resolved grid file: defaults are filled in, and alternative keys are converted.
#[derive(Debug, Clone, PartialEq)]
pub struct GridFile {
    /// Name of the database: the file's name without directory and extension.
    pub name: String,
    /// The database that the file describes.
    pub grid: Grid,
    /// How the compression compares colours; it does not affect the spectra.
    pub viewing: Viewing,
    /// Warnings for the user, such as values outside the ordinary ranges of
    /// docs/methods.md.
    pub warnings: Vec<String>,
    /// Notes for the user on how the data files that it names were read.
    pub notes: Vec<String>,
    /// The text of the file.
    pub text: String,
}

/// Lowers the default half width of the grain sizes if the smallest size of the axis
/// would otherwise lead to grains below the allowed range. A half width that the file
/// gives is kept.
fn narrow_spread(
    document: &Document,
    axes: &AxesKeys,
    spread: &mut Spread,
    warnings: &mut Vec<String>,
) {
    const KEY: &str = "spread.grain_size_half_width_um";
    let sizes = axes.values(Parameter::GrainSize.key());
    let smallest = sizes.into_iter().fold(f64::INFINITY, f64::min);
    let half_width = smallest - SIZE_UM.0;
    let default = spread.grain_size_half_width_um;
    if !document.has(KEY) && half_width >= 0.0 && half_width < default {
        spread.grain_size_half_width_um = half_width;
        let remark = format!(
            "starts at {smallest} um, but grains must not be smaller than {} um: {KEY} is lowered from its default {default} to {half_width} for all sizes; set it to choose another value",
            SIZE_UM.0
        );
        warnings.push(document.warning("axes.grain_size_um", remark));
    }
}

/// Reads a grid file.
///
/// # Errors
/// [`ConfigError`] if the file cannot be read or a value is not allowed.
pub fn read(path: &Path) -> Result<GridFile, ConfigError> {
    parse(&path.display().to_string(), &read_text(path)?)
}

/// Reads the `text` of a grid file. `name` is its path: it appears in messages, names the
/// database, and the paths in the file are relative to its directory.
///
/// # Errors
/// As [`read`].
pub fn parse(name: &str, text: &str) -> Result<GridFile, ConfigError> {
    let (document, keys) = Document::read::<GridKeys>(name, text, &schema::GRID)?;
    let (mut warnings, mut notes) = (Vec::new(), Vec::new());
    let size_law = size_law(&document, &keys.model)?;
    let model = model(&document, &keys.model, directory_of(name))?;
    let mut spread = spread(&keys.spread, size_law);
    if !document.has("axes.grain_size_um") && !document.has("spread.grain_size_half_width_um") {
        spread.grain_size_half_width_um = 0.0;
    }
    narrow_spread(&document, &keys.axes, &mut spread, &mut warnings);
    let diffuse = keys.axes.diffuse;
    let (axes, size_axis, longest_um) = axes(
        &document,
        keys.axes,
        (&spread, model.facets),
        &keys.fixed,
        &mut warnings,
    )?;
    let (views, axes) = (views(&document, &axes, &keys.run)?, axes.without_views());
    let wavelengths_nm = wavelengths(&document, &keys.wavelengths, &mut warnings)?;
    fixed_or_axis(&document, &["axes".to_owned()], &keys.fixed)?;
    let mut fixed = fixed(
        &document,
        &keys.fixed,
        model,
        size_law,
        axes.values(Parameter::Density),
        (directory_of(name), &wavelengths_nm),
        (&mut warnings, &mut notes),
    )?;
    check_fit(&document, &axes, &longest_um, &fixed)?;
    let water = axes.values(Parameter::WaterSaturation).last();
    let wet = fixed.is_wet() || water.is_some_and(|largest| *largest > 0.0);
    covered(&document, &fixed.model, &wavelengths_nm, wet)?;
    let run = run(&document, &keys.run, &wavelengths_nm)?;
    if diffuse && !run.engine.shares_angles() {
        let problem = Problem::Contradiction(format!(
            "requires the engine hybrid or auto, but run.engine is {}",
            run.engine.name()
        ));
        let help = "set run.engine = \"hybrid\", or build a separate grid for diffuse light";
        return Err(document.error("axes.diffuse", problem, help));
    }
    fixed.diffuse = diffuse;
    check_size(&document, &axes, wavelengths_nm.len(), run.rays)?;
    check_views(&document, &axes, views.as_ref(), wavelengths_nm.len())?;
    let compression = &keys.compression;
    let viewing = viewing(
        &document,
        "compression",
        (&compression.illuminants, &compression.delta_e),
        (directory_of(name), &wavelengths_nm),
        &mut notes,
    )?;
    let stem = Path::new(name).file_stem();
    let grid = Grid {
        axes,
        views,
        size_axis,
        spread,
        wavelengths_nm,
        fixed,
        run,
        compression: Compression {
            max_delta_e: compression.max_delta_e,
            max_rmse: compression.max_rmse,
        },
    };
    // `Grid::jobs` reports impossible distributions
    let absent = grid.absent().unwrap_or_default();
    if !absent.is_empty() {
        warnings.push(document.warning("axes.thickness_cm", why_absent(&grid.axes, &absent)));
    }
    Ok(GridFile {
        name: stem.map_or("database".into(), |s| s.to_string_lossy().into_owned()),
        grid,
        viewing,
        warnings,
        notes,
        text: text.to_owned(),
    })
}

/// Refuses a thickness that is too thin for all grain sizes, and a grain size that is
/// too large for all thicknesses. Any other combination that does not fit has no curve.
fn check_fit(
    document: &Document,
    axes: &Axes,
    longest_um: &[f64],
    fixed: &Fixed,
) -> Result<(), ConfigError> {
    let smallest = longest_um.first().copied().unwrap_or_default();
    let thicknesses = axes.values(Parameter::Thickness);
    for (i, &thickness) in thicknesses.iter().enumerate() {
        let key = format!("axes.thickness_cm[{i}]");
        thick_enough(document, &key, thickness, smallest, fixed)?;
    }
    let last = thicknesses.len().saturating_sub(1);
    let thickest = thicknesses.get(last).copied().unwrap_or_default();
    let key = format!("axes.thickness_cm[{last}]");
    longest_um
        .iter()
        .copied()
        .try_for_each(|longest| thick_enough(document, &key, thickest, longest, fixed))
}

/// The axes; the values of the size axis if it is given by another measure than the
/// size; and the longest grain of each grain size, um.
fn axes(
    document: &Document,
    mut keys: AxesKeys,
    (spread, facets): (&Spread, Facets),
    fixed: &FixedKeys,
    warnings: &mut Vec<String>,
) -> Result<(Axes, Option<SizeAxis>, Vec<f64>), ConfigError> {
    one_size(document, "axes", "grain_size_um")?;
    let (size_key, given, measure) = size_axis(document, &mut keys)?;
    let mut axes = Axes::default();
    // the order of the axes determines the order of their errors
    let optional = Parameter::ALL.into_iter().filter(|p| p.is_optional());
    for parameter in optional.chain(Parameter::CORE) {
        let (key, values) = match parameter {
            Parameter::GrainSize => (size_key, Some(given.clone())),
            _ => (parameter.key(), keys.take(parameter.key())),
        };
        if let Some(values) = values {
            increasing(document, &format!("axes.{key}"), &values)?;
            axes.set(parameter, values);
        }
    }
    let mut size_axis = None;
    if let Some(measure) = measure {
        let keys = (
            fixed.shape.as_str(),
            &fixed.sphericity,
            fixed.aspect_ratio.as_ref(),
        );
        let (shape, proportion) = shape(document, "fixed", keys)?;
        let conversion = SizeConversion {
            half_width_um: spread.grain_size_half_width_um,
            size_law: spread.size_law,
            shape,
            proportion,
            temperature_c: fixed.temperature_c,
        };
        axes.set(Parameter::GrainSize, measure.sizes_um(&given, &conversion));
        size_axis = Some(SizeAxis {
            measure,
            values: given,
        });
    }
    if let Some(&smallest) = axes.values(Parameter::Facetness).first() {
        let given = ("axes.facetness[0]", smallest);
        remark_smooth(document, warnings, facets, given);
    }
    let half_width = spread.grain_size_half_width_um;
    let mut longest_um = Vec::new();
    let sizes = axes.values(Parameter::GrainSize);
    let last = sizes.len() - 1;
    let size_key = |i: usize| match measure {
        // the specific surface area decreases with the grain size
        Some(SizeMeasure::SpecificSurface) => format!("axes.{size_key}[{}]", last - i),
        _ => format!("axes.{size_key}[{i}]"),
    };
    for (i, &mean) in sizes.iter().enumerate() {
        longest_um.push(longest_grain(document, &size_key(i), mean, half_width)?);
    }
    if let (Some(smallest), Some(largest)) = (sizes.first(), sizes.last()) {
        let keys = [size_key(0), size_key(last)];
        let ends = [smallest - half_width, largest + half_width];
        remark_sizes(
            document,
            warnings,
            keys.each_ref().map(String::as_str),
            ends,
        );
        remark_spread(document, warnings, &keys[0], *smallest, spread);
    }
    for parameter in [Parameter::Thickness, Parameter::Density] {
        let values = axes.values(parameter);
        // Only the ends are checked, so that a long axis does not give many warnings.
        let last = values.len().saturating_sub(1);
        for (i, &value) in values
            .iter()
            .enumerate()
            .filter(|&(i, _)| i == 0 || i == last)
        {
            let key = format!("axes.{}[{i}]", parameter.key());
            remark_axis(document, warnings, parameter, &key, value);
        }
    }
    Ok((axes, size_axis, longest_um))
}

/// The views, if `axes` has them.
fn views(
    document: &Document,
    axes: &Axes,
    run: &RunKeys,
) -> Result<Option<GridViews>, ConfigError> {
    const RAYS: &str = "run.view_rays";
    let axes = axes.views();
    let [view, azimuth] = Parameter::VIEWS;
    for (axis, other) in [(view, azimuth), (azimuth, view)] {
        if axes.has(axis) && !axes.has(other) {
            let key = format!("axes.{}", other.key());
            let help = "add it: a direction of view is an angle from the normal, axes.view_deg, and an azimuth, axes.relative_azimuth_deg (0 is forward, 180 back toward the light)";
            return Err(document.error(&key, Problem::Missing, help));
        }
    }
    if axes.is_empty() {
        if run.view_rays.is_some() {
            let problem = "requires axes.view_deg, which is not in the file";
            let problem = Problem::Contradiction(problem.to_owned());
            let help = "remove it, or add axes.view_deg and axes.relative_azimuth_deg";
            return Err(document.error(RAYS, problem, help));
        }
        return Ok(None);
    }
    Ok(Some(GridViews {
        axes,
        rays: run.view_rays.unwrap_or(GridViews::RAYS),
    }))
}

/// Refuses views that are too many to store.
fn check_views(
    document: &Document,
    axes: &Axes,
    views: Option<&GridViews>,
    wavelengths: usize,
) -> Result<(), ConfigError> {
    let Some(views) = views else {
        return Ok(());
    };
    let numbers = [axes.count(), views.axes.count(), wavelengths as u64];
    let values = numbers.into_iter().try_fold(1_u64, u64::checked_mul);
    if values.is_none_or(|n| n > MAX_VALUES) {
        let [curves, views, wavelengths] = numbers;
        let problem = Problem::Contradiction(format!(
            "gives {curves} curves toward {views} views at {wavelengths} wavelengths, more than {:.0e} values",
            MAX_VALUES as f64
        ));
        let help = "use fewer views, shorter axes or fewer wavelengths";
        return Err(document.error("axes.view_deg", problem, help));
    }
    Ok(())
}

/// The key of the grain size axis, its values, and their measure if they are not sizes.
fn size_axis(
    document: &Document,
    keys: &mut AxesKeys,
) -> Result<(&'static str, Vec<f64>, Option<SizeMeasure>), ConfigError> {
    let size = Parameter::GrainSize.key();
    if let Some(sizes) = keys.take(size) {
        return Ok((size, sizes, None));
    }
    let (measure, values) = match keys.take(SizeMeasure::OpticalRadius.name()) {
        Some(values) => (SizeMeasure::OpticalRadius, values),
        None => {
            let measure = SizeMeasure::SpecificSurface;
            (measure, keys.take(measure.name()).unwrap_or_default())
        }
    };
    let key = format!("axes.{}", measure.name());
    let dependencies: &[Parameter] = match measure {
        SizeMeasure::OpticalRadius => &[Parameter::Sphericity],
        SizeMeasure::SpecificSurface => &[Parameter::Sphericity, Parameter::Temperature],
    };
    for axis in dependencies {
        if document.has(&format!("axes.{}", axis.key())) {
            let name = axis.key();
            let problem = format!("would need other grain sizes at each value of the axis {name}");
            let help = format!("give grain_size_um instead, or remove the axis {name}");
            return Err(document.error(&key, Problem::Contradiction(problem), help));
        }
    }
    Ok((measure.name(), values, Some(measure)))
}

/// Refuses databases that are too large to simulate or store.
fn check_size(
    document: &Document,
    axes: &Axes,
    wavelengths: usize,
    rays: u64,
) -> Result<(), ConfigError> {
    let lengths = axes.shape();
    let curves = lengths.iter().try_fold(1_u64, |n, &len| n.checked_mul(len));
    let values = curves.and_then(|n| n.checked_mul(wavelengths as u64));
    let shape = lengths.iter().map(u64::to_string);
    let shape = shape.collect::<Vec<_>>().join(" x ");
    if values.is_none_or(|n| n > MAX_VALUES) {
        let problem = Problem::Contradiction(format!(
            "describes {shape} curves of {wavelengths} wavelengths, more than {MAX_VALUES:.0e} values",
            MAX_VALUES = MAX_VALUES as f64
        ));
        return Err(document.error("axes", problem, "shorten the axes or the wavelengths"));
    }
    let walks = curves.and_then(|n| n.checked_mul(rays));
    if walks.is_none_or(|n| n > MAX_RAYS) {
        let problem = Problem::Contradiction(format!(
            "for each of {shape} curves is more than {:.0e} rays in total",
            MAX_RAYS as f64
        ));
        return Err(document.error("run.rays", problem, "use fewer rays or shorter axes"));
    }
    Ok(())
}

/// The run settings: engine, seed, rays and largest error.
fn run(document: &Document, keys: &RunKeys, wavelengths_nm: &[f64]) -> Result<Run, ConfigError> {
    let engines = Engine::ALL.map(|e| (e.name(), e)).into_iter();
    let engines: Vec<_> = engines.chain(Engine::ALIASES).collect();
    let engine = choose(document, "run.engine", &engines, &keys.engine)?;
    let max_error = keys.max_error.as_ref();
    if max_error.is_some() && engine != Engine::Auto {
        let problem = Problem::Contradiction(format!(
            "requires the engine auto, but run.engine is {}",
            engine.name()
        ));
        let help = "remove it, or set run.engine = \"auto\"";
        return Err(document.error("run.max_error", problem, help));
    }
    let usual = MaxError::default_for(wavelengths_nm);
    let max_error = max_error.map_or(usual, |keys| MaxError {
        delta_e: keys.delta_e.unwrap_or(usual.delta_e),
        rmse: keys.rmse.unwrap_or(usual.rmse),
    });
    let rays = match keys.rays {
        Some(rays) => rays,
        None if engine == Engine::Auto => max_error.rays(wavelengths_nm),
        None => {
            let help = "all engines except auto need it; add, for example, rays = 100000";
            return Err(document.error("run.rays", Problem::Missing, help));
        }
    };
    Ok(Run {
        engine,
        seed: keys.seed,
        rays,
        max_error,
    })
}
