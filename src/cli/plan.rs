//! `splitsnow plan`: estimates the cost of a build.
use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

use super::common::{self, GridArgs, Spinner};
use crate::parameter::Parameter;
use crate::plan::{self, Axis, COMPONENTS, LongestJob, PilotReport, Plan, PlanOptions};
use crate::units::cm_text;

/// Estimate the jobs, time, bytes and errors of a build, without running it
///
/// Prints the axes, the number of jobs and curves, the longest job, and estimates of time,
/// bytes and standard errors. For the estimates, `plan` runs a few of the jobs with as many
/// of their rays as the budget of --seconds allows, and extrapolates. It writes nothing. If
/// the output directory holds a part of the database, the time is that of the remaining
/// jobs.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "\
Examples:
  splitsnow plan configs/thesis.toml --threads 16 --json
  splitsnow plan configs/quick.toml")]
pub(super) struct Args {
    #[command(flatten)]
    grid: GridArgs,
    /// CPU seconds, in all threads together, to spend on the estimates
    #[arg(long, value_name = "X", default_value = "5", value_parser = common::positive)]
    seconds: f64,
    /// Print the plan as JSON
    #[arg(long)]
    json: bool,
}

/// A plan with the name of its grid file, its output directory and the next command.
#[derive(Debug, Serialize)]
struct NamedPlan {
    name: String,
    out: PathBuf,
    #[serde(flatten)]
    plan: Plan,
    next: String,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let file = args.grid.open()?;
    let out = args.grid.dir(&file);
    let options = PlanOptions {
        threads: args.grid.threads()?,
        seconds: args.seconds,
        dir: Some(out.clone()),
    };
    let spinner = Spinner::new("timing a few jobs");
    let plan = plan::plan(&file.grid, &options)?;
    drop(spinner);
    if let Some(refused) = &plan.refused {
        common::warn(&[format!("a build would be refused: {refused}")]);
    }
    let named = NamedPlan {
        name: file.name,
        out,
        plan,
        next: args.grid.command("build"),
    };
    if args.json {
        return common::print_json(&named);
    }
    common::print(&named.to_string())
}

impl fmt::Display for NamedPlan {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let plan = &self.plan;
        writeln!(
            f,
            "{}: engine {}, seed {}, {} rays per curve",
            self.name,
            plan.engine.name(),
            plan.seed,
            plan.rays
        )?;
        for Axis { name, values, .. } in &plan.axes {
            let text = |value: &f64| match *name == Parameter::Thickness.key() {
                true => cm_text(*value),
                false => value.to_string(),
            };
            let [first, .., last] = values.as_slice() else {
                let only = values.first().map(text).unwrap_or_default();
                writeln!(f, "  {name:<20} {only}")?;
                continue;
            };
            let (first, last) = (text(first), text(last));
            writeln!(f, "  {name:<20} {} values, {first} to {last}", values.len())?;
        }
        let per_job = plan.curves / plan.jobs.max(1);
        writeln!(
            f,
            "\njobs            {} of {per_job} curve{} each: {} curve{}",
            plan.jobs,
            if per_job == 1 { "" } else { "s" },
            plan.curves,
            if plan.curves == 1 { "" } else { "s" }
        )?;
        if plan.absent_curves > 0 {
            writeln!(f, "absent          {}", plan.why_absent)?;
        }
        if plan.jobs_left < plan.jobs {
            let out = self.out.display();
            writeln!(
                f,
                "left            {} jobs; the others are in {out}",
                plan.jobs_left
            )?;
        }
        writeln!(
            f,
            "time            about {} core-seconds, {} on {} thread{}",
            two_digits(plan.core_seconds),
            common::duration(plan.wall_seconds),
            plan.threads,
            if plan.threads == 1 { "" } else { "s" }
        )?;
        if plan.views > 0 {
            writeln!(
                f,
                "views           {} for each curve, {} of these core-seconds: a typical time, not measured",
                plan.views,
                two_digits(plan.view_seconds)
            )?;
        }
        writeln!(
            f,
            "disk            {} in {} files for the database, {} for the compact file with {COMPONENTS} components",
            common::bytes(plan.database_bytes),
            plan.database_files,
            common::bytes(plan.compact_bytes)
        )?;
        match (plan.median_standard_error, plan.max_standard_error) {
            (Some(median), Some(max)) => writeln!(
                f,
                "standard error  median {median:.5}, largest about {max:.5}, of values between 0 and 1"
            )?,
            _ => writeln!(
                f,
                "standard error  unknown: no simulation ended; give more --seconds"
            )?,
        }
        let LongestJob {
            parameters,
            engine,
            rays,
            rays_run,
            core_seconds,
        } = &plan.longest_job;
        let engine = engine.name();
        writeln!(
            f,
            "longest job     about {} core-seconds by {engine}, {}: {parameters}",
            two_digits(*core_seconds),
            match rays_run {
                0 => "from its size".to_owned(),
                run if run == rays => "measured".to_owned(),
                run => format!("extrapolated from {run} of its {rays} rays"),
            }
        )?;
        let PilotReport {
            spent_seconds,
            jobs,
            jobs_whole,
            rays: [fewest, most],
            wavelengths,
            not_measured,
            ..
        } = &plan.pilot;
        writeln!(
            f,
            "measured        {jobs} jobs with {fewest} to {most} rays, in {spent_seconds:.1} CPU-seconds, on this machine as busy as it is"
        )?;
        let mut extrapolated = Vec::new();
        if jobs_whole < jobs {
            let fewer = jobs - jobs_whole;
            extrapolated.push(format!(
                "{fewer} of these to all {} rays",
                plan.longest_job.rays
            ));
        }
        let all_wavelengths = plan.axes.last().map_or(0, |axis| axis.values.len());
        if *wavelengths < all_wavelengths {
            extrapolated.push(format!(
                "from {wavelengths} wavelengths to {all_wavelengths}"
            ));
        }
        let others = plan.jobs.saturating_sub(*jobs as u64);
        if others > 0 {
            extrapolated.push(format!("{others} jobs from their sizes"));
        }
        if !extrapolated.is_empty() {
            writeln!(f, "extrapolated    {}", extrapolated.join(", "))?;
        }
        if !not_measured.is_empty() {
            writeln!(
                f,
                "not measured    {}: from typical times; give more --seconds",
                not_measured.join(", ")
            )?;
        }
        writeln!(f, "next            {}", self.next)
    }
}

/// Seconds rounded to two digits, the precision of the estimate.
fn two_digits(seconds: f64) -> String {
    if seconds < 10.0 {
        return format!("{seconds:.1}");
    }
    let unit = 10_f64.powf(seconds.log10().floor() - 1.0);
    format!("{:.0}", (seconds / unit).round() * unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_have_two_digits() {
        let texts = [0.04, 9.94, 14.4, 105.0, 146_762.0].map(two_digits);
        assert_eq!(texts, ["0.0", "9.9", "14", "110", "150000"]);
    }
}
