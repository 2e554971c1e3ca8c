//! The compact file's answers anywhere against fresh simulations.
use super::{Check, Figure, Options, Subject, VerifyError, within};
use crate::colour::Colorimeter;
use crate::config;
use crate::engine::Control;
use crate::error_budget::{self, ErrorBudget, Partial};
use crate::lookup::Database;
use crate::measurement::Quantity;
use crate::parameter::Region;
use crate::scene::Scene;
use crate::tailor;

/// Walks of a fresh simulation: its noise is a third of that of a database of
/// configs/thesis.toml.
pub const POINT_RAYS: u64 = 1 << 19;
/// Away from the seeds of those who made the file.
const APART: u64 = 1 << 32;

fn subject<'a>(
    subject: &'a Subject<'_>,
    regions: &'a [Region],
    file: &'a Database,
    exact: &'a Database,
    colour: Option<&'a Colorimeter>,
) -> error_budget::Subject<'a> {
    error_budget::Subject {
        grid: subject.grid,
        regions,
        file,
        exact,
        colour,
        points: subject.options.points,
        rays: subject.options.point_rays.unwrap_or(POINT_RAYS),
        seed: subject.options.seed.wrapping_add(APART),
    }
}

pub(super) fn walks(of: &Subject<'_>, file: &Database) -> Result<u64, VerifyError> {
    let regions = [file.axes().region()];
    Ok(subject(of, &regions, file, file, None).walks()?)
}

/// The check, its error budget if it is whole, and what was left out.
type Answers = (Option<Check>, Option<ErrorBudget>, Option<String>);

/// What an error budget comes to.
fn answers(partial: Partial) -> Answers {
    let mut check = partial.error_budget.as_ref().map(named);
    let unanswered = partial.unanswered;
    if let Some(check) = check.as_mut().filter(|_| unanswered > 0) {
        check.notes.push(format!(
            "{unanswered} drawn points have no answer in the file: grains do not fit there"
        ));
    }
    let left = match partial.left {
        Some([patches, points]) => Some(format!(
            "{patches} fresh simulations with {points} random points of the error budget, which is not kept in the file"
        )),
        None if partial.error_budget.is_none() => Some(format!(
            "the error budget: none of {unanswered} random points has an answer in the file"
        )),
        None => None,
    };
    let whole = partial.error_budget.filter(|_| left.is_none());
    (check, whole, left)
}

/// Certifies the file of a database, which states no bound off its nodes.
pub(super) fn check(
    of: &Subject<'_>,
    file: &Database,
    colour: Option<&Colorimeter>,
    control: &Control<'_>,
) -> Result<Answers, VerifyError> {
    let [t, _] = of.curves(Quantity::Transmittance, false)?;
    let [r, _] = of.curves(Quantity::Reflectance, false)?;
    let exact = Database::from_curves(
        file.has_black_substrate(),
        of.store.axes(),
        of.store.wavelengths_nm(),
        Some(&t),
        Some(&r),
    )
    .with_absent(of.store.absent());
    let regions = [file.axes().region()];
    let partial = subject(of, &regions, file, &exact, colour).certify_some(control)?;
    let chains = partial.error_budget.clone().map(|found| found.quantities);
    let (mut check, error_budget, left) = answers(partial);
    for quantity in Quantity::ALL {
        let chain = chains
            .as_ref()
            .and_then(|chains| chains.get(quantity.name()));
        let (Some(chain), Some(check)) = (chain, &mut check) else {
            continue;
        };
        check
            .figures
            .extend(chain.total.delta_e.map(|total| Figure {
                quantity,
                measure: "Delta-E",
                value: total.max,
                bound: None,
                at: String::new(),
            }));
    }
    Ok((check, error_budget, left))
}

/// Does `work` on the file of a scene and the scene itself.
fn of_scene<T>(
    file: &Database,
    options: Options,
    work: impl FnOnce(&error_budget::Subject, &Scene) -> Result<T, VerifyError>,
) -> Result<T, VerifyError> {
    let text = file
        .metadata()
        .get(tailor::SCENE)
        .map_or("", String::as_str);
    let scene = config::scene::parse("the scene in the file", text)?.scene;
    let grid = tailor::grid(&scene);
    let colour = Colorimeter::viewing(&scene.wavelengths_nm, &scene.viewing)?;
    let subject = error_budget::Subject {
        grid: &grid,
        regions: &scene.regions,
        file,
        exact: file,
        colour: colour.as_ref(),
        points: options.points,
        rays: options
            .point_rays
            .unwrap_or(POINT_RAYS.max(tailor::FRESH * grid.run.rays)),
        seed: options.seed.wrapping_add(APART),
    };
    work(&subject, &scene)
}

/// How many walks [`tailored`] does at most, for a progress bar.
///
/// # Errors
/// As of that.
pub fn tailored_walks(file: &Database, options: Options) -> Result<u64, VerifyError> {
    of_scene(file, options, |subject, _| Ok(subject.walks()?))
}

/// Proves the file of a scene anew, at other points: its bound must hold.
///
/// # Errors
/// It was not tailored to a scene that this version reads, or a simulation fails; see
/// [`super::Verification::run`] of a budget of time.
pub fn tailored(
    file: &Database,
    options: Options,
    control: &Control<'_>,
) -> Result<(super::Report, Option<ErrorBudget>), VerifyError> {
    of_scene(file, options, |subject, scene| {
        let partial = within(options.seconds, control, |control| {
            Ok(subject.certify_some(control)?)
        })?;
        let chains = partial.error_budget.clone().map(|found| found.quantities);
        let (check, error_budget, left) = answers(partial);
        let not_checked = left.into_iter().collect();
        let (Some(mut check), Some(chains)) = (check, chains) else {
            let checks = Vec::new();
            return Ok((
                super::Report {
                    checks,
                    not_checked,
                },
                None,
            ));
        };
        for &quantity in &scene.quantities {
            let chain = chains.get(quantity.name());
            let Some(total) = chain.and_then(|chain| chain.total.delta_e) else {
                let problem = format!("it holds no {}, which its scene asks for", quantity.name());
                check.problems.push(problem);
                continue;
            };
            check.figures.push(Figure {
                quantity,
                measure: "Delta-E",
                value: total.max,
                bound: Some(scene.max_delta_e),
                at: String::new(),
            });
        }
        let checks = vec![check];
        Ok((
            super::Report {
                checks,
                not_checked,
            },
            error_budget,
        ))
    })
}

fn named(error_budget: &ErrorBudget) -> Check {
    let mut check = Check::new("answers of the compact file against fresh simulations");
    let lines = error_budget.to_string();
    check.notes.extend(lines.lines().map(str::to_owned));
    check
}
