//! Look-ups anywhere in the compact file against fresh simulations.
use super::{Check, CheckContext, CheckedValue, VerifyError, VerifyOptions, within};
use crate::colour::Colorimeter;
use crate::config;
use crate::engine::Control;
use crate::error_budget::{Certification, ErrorBudget, PartialErrorBudget};
use crate::lookup::Database;
use crate::measurement::Quantity;
use crate::parameter::Region;
use crate::scene::Scene;
use crate::tailor;

/// Rays of a fresh simulation. Its noise is a third of that of a database of
/// configs/thesis.toml.
pub const POINT_RAYS: u64 = 1 << 17;
/// Added to the seed, to keep it apart from the seeds with which files are made.
const SEED_OFFSET: u64 = 1 << 32;

/// The certification of a database's compact file.
fn certification<'a>(
    context: &'a CheckContext<'_>,
    regions: &'a [Region],
    file: &'a Database,
    exact: &'a Database,
    colour: Option<&'a Colorimeter>,
) -> Certification<'a> {
    Certification {
        grid: context.grid,
        regions,
        file,
        exact,
        colour,
        points: context.options.points,
        rays: context.options.point_rays.unwrap_or(POINT_RAYS),
        seed: context.options.seed.wrapping_add(SEED_OFFSET),
    }
}

/// The number of walks of [`check`].
pub(super) fn walks(context: &CheckContext<'_>, file: &Database) -> Result<u64, VerifyError> {
    let regions = [file.axes().region()];
    Ok(certification(context, &regions, file, file, None).walks()?)
}

/// The check, the error budget if it is complete, and a note on what was skipped.
type Answers = (Option<Check>, Option<ErrorBudget>, Option<String>);

/// The outcome of a certification.
fn answers(partial: PartialErrorBudget) -> Answers {
    let mut check = partial.error_budget.as_ref().map(error_budget_check);
    let uncovered = partial.uncovered;
    if let Some(check) = check.as_mut().filter(|_| uncovered > 0) {
        check.notes.push(format!(
            "{uncovered} of the points drawn have no curve in the file, because grains do not fit there"
        ));
    }
    let skipped = match partial.skipped {
        Some([patches, points]) => Some(format!(
            "{patches} fresh simulations with {points} random points of the error budget, which is not stored in the file"
        )),
        None if partial.error_budget.is_none() => Some(format!(
            "the error budget: none of {uncovered} random points has a curve in the file"
        )),
        None => None,
    };
    let complete = partial.error_budget.filter(|_| skipped.is_none());
    (check, complete, skipped)
}

/// Certifies the compact file of a database. The file states no bound off its nodes, so no
/// value is compared with a bound.
pub(super) fn check(
    context: &CheckContext<'_>,
    file: &Database,
    colour: Option<&Colorimeter>,
    control: &Control<'_>,
) -> Result<Answers, VerifyError> {
    let [t, _] = context.curves(Quantity::Transmittance, false)?;
    let [r, _] = context.curves(Quantity::Reflectance, false)?;
    let exact = Database::from_curves(
        file.has_black_substrate(),
        context.store.axes(),
        context.store.wavelengths_nm(),
        Some(&t),
        Some(&r),
    )
    .with_absent(context.store.absent());
    let regions = [file.axes().region()];
    let partial =
        certification(context, &regions, file, &exact, colour).certify_until_cancelled(control)?;
    let quantities = partial.error_budget.clone();
    let quantities = quantities.map(|error_budget| error_budget.quantities);
    let (mut check, error_budget, skipped) = answers(partial);
    for quantity in Quantity::ALL {
        let errors = quantities
            .as_ref()
            .and_then(|quantities| quantities.get(quantity.name()));
        let (Some(errors), Some(check)) = (errors, &mut check) else {
            continue;
        };
        check
            .figures
            .extend(errors.total.delta_e.map(|total| CheckedValue {
                quantity,
                measure: "Delta-E",
                value: total.max,
                bound: None,
                at: String::new(),
            }));
    }
    Ok((check, error_budget, skipped))
}

/// Runs `work` on the certification of a tailored file and its scene.
fn with_scene<T>(
    file: &Database,
    options: VerifyOptions,
    work: impl FnOnce(&Certification, &Scene) -> Result<T, VerifyError>,
) -> Result<T, VerifyError> {
    let text = file
        .metadata()
        .get(tailor::SCENE)
        .map_or("", String::as_str);
    let scene = config::scene::parse("the scene in the file", text)?.scene;
    let grid = tailor::grid(&scene);
    let colour = Colorimeter::viewing(&scene.wavelengths_nm, &scene.viewing)?;
    let certification = Certification {
        grid: &grid,
        regions: &scene.regions,
        file,
        exact: file,
        colour: colour.as_ref(),
        points: options.points,
        rays: options
            .point_rays
            .unwrap_or(POINT_RAYS.max(tailor::FRESH * grid.run.rays)),
        seed: options.seed.wrapping_add(SEED_OFFSET),
    };
    work(&certification, &scene)
}

/// The largest number of walks of [`tailored`], for a progress bar.
///
/// # Errors
/// If the scene of the file cannot be read, or a point cannot be simulated.
pub fn tailored_walks(file: &Database, options: VerifyOptions) -> Result<u64, VerifyError> {
    with_scene(file, options, |certification, _| Ok(certification.walks()?))
}

/// Certifies a tailored file again, at other points. The check passes if the bound of its
/// scene holds. See [`super::Verification::run`] for the time limit.
///
/// # Errors
/// If the file was not tailored to a scene that this version reads, a simulation fails, or the
/// run is cancelled.
pub fn tailored(
    file: &Database,
    options: VerifyOptions,
    control: &Control<'_>,
) -> Result<(super::VerifyReport, Option<ErrorBudget>), VerifyError> {
    with_scene(file, options, |certification, scene| {
        let partial = within(options.seconds, control, |control| {
            Ok(certification.certify_until_cancelled(control)?)
        })?;
        let quantities = partial.error_budget.clone();
        let quantities = quantities.map(|error_budget| error_budget.quantities);
        let (check, error_budget, skipped) = answers(partial);
        let not_checked = skipped.into_iter().collect();
        let (Some(mut check), Some(quantities)) = (check, quantities) else {
            let checks = Vec::new();
            return Ok((
                super::VerifyReport {
                    checks,
                    not_checked,
                },
                None,
            ));
        };
        for &quantity in &scene.quantities {
            let errors = quantities.get(quantity.name());
            let Some(total) = errors.and_then(|errors| errors.total.delta_e) else {
                let problem = format!("it holds no {}, which its scene requires", quantity.name());
                check.problems.push(problem);
                continue;
            };
            check.figures.push(CheckedValue {
                quantity,
                measure: "Delta-E",
                value: total.max,
                bound: Some(scene.max_delta_e),
                at: String::new(),
            });
        }
        let checks = vec![check];
        Ok((
            super::VerifyReport {
                checks,
                not_checked,
            },
            error_budget,
        ))
    })
}

/// A check with the lines of an error budget as notes.
fn error_budget_check(error_budget: &ErrorBudget) -> Check {
    let mut check = Check::new("answers of the compact file against fresh simulations");
    let lines = error_budget.to_string();
    check.notes.extend(lines.lines().map(str::to_owned));
    check
}
