//! `splitsnow submit`: builds on a cluster.
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, anyhow, bail};

use super::common::{self, Spinner};
use crate::atomic;
use crate::config::grid;
use crate::host;
use crate::plan::{self, PlanOptions};
use crate::threads::MAX_THREADS;

/// Names of the scripts in the output directory: of the job array, and of the job that compresses.
const SCRIPTS: [&str; 2] = ["slurm-array.sh", "slurm-compress.sh"];
/// Folder of the logs, in the output directory.
const LOGS: &str = "slurm-logs";
/// Time before the limit at which Slurm asks a task to end, s.
const WARNING_SECONDS: u32 = 60;
/// Factor of the estimated time, for slower and busier nodes, and shortest limit, minutes.
const TIME_MARGIN: (f64, f64) = (3.0, 10.0);
/// Factor of the memory of the pilot jobs, for longer ones, and smallest memory, MB.
const MEMORY_MARGIN: (f64, f64) = (2.0, 1024.0);
/// Memory of the compression per value toward a view of one quantity, bytes.
const COMPRESS_BYTES: f64 = 32.0;

/// Build a grid on a cluster: submit a job array and a job that compresses
///
/// Writes two scripts to the output directory and submits them. The array builds one shard per
/// task. A task that reaches its time limit ends cleanly and is queued again; so is one whose
/// node fails. When all tasks have ended, however they did, the second job compresses. It never
/// simulates: if jobs are missing, it names their tasks and the command that submits just these
/// again, and fails.
///
/// The number of tasks is written in the script, so that any of them may be submitted again.
/// Time and memory per task follow from a plan of the grid.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "\
Examples:
  splitsnow submit configs/thesis.toml --tasks 12 --time 2h -- --partition=long --account=snow
  splitsnow submit configs/quick.toml --tasks 4 --print")]
pub(super) struct Args {
    /// Grid file, such as configs/thesis.toml
    #[arg(value_name = "GRID.toml")]
    grid: PathBuf,
    /// Number of tasks of the array
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    tasks: u64,
    /// Output directory, which all nodes see [default: out/NAME]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Batch system
    #[arg(long, value_parser = ["slurm"], default_value = "slurm")]
    engine: String,
    /// Processors of each task
    #[arg(long, value_name = "C", default_value = "1",
          value_parser = clap::value_parser!(u16).range(1..=i64::from(MAX_THREADS)))]
    cpus: u16,
    /// Time limit of a task, such as 50m or 2h [default: three times the estimate, at least 10m]
    #[arg(long, value_name = "TIME", value_parser = common::time_limit)]
    time: Option<std::time::Duration>,
    /// Memory of a task, MB [default: twice that of the pilot jobs of the plan, at least 1024]
    #[arg(long, value_name = "MB", value_parser = clap::value_parser!(u64).range(1..))]
    memory: Option<u64>,
    /// CPU seconds to spend on the plan
    #[arg(long, value_name = "X", default_value = "5", value_parser = common::positive)]
    seconds: f64,
    /// Print the scripts and submit nothing
    #[arg(long)]
    print: bool,
    /// Options of sbatch for both jobs, such as --partition=long
    #[arg(last = true, value_name = "SBATCH OPTIONS")]
    options: Vec<String>,
}

/// What both scripts need.
struct Scripts {
    name: String,
    program: PathBuf,
    grid: PathBuf,
    dir: PathBuf,
    tasks: u64,
    cpus: u16,
    minutes: u64,
    megabytes: u64,
    compress_megabytes: u64,
    options: Vec<String>,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let file = grid::read(&args.grid)?;
    common::warn(&file.warnings);
    common::notes(&file.notes);
    let default = || Path::new("out").join(&file.name);
    let dir = args.out.clone().unwrap_or_else(default);
    let absolute = |path: &Path| {
        std::path::absolute(path).with_context(|| format!("cannot find {}", path.display()))
    };
    let spinner = Spinner::new("timing a few jobs");
    let mut options = PlanOptions::default();
    (options.threads, options.seconds) = (args.cpus.into(), args.seconds);
    options.dir = Some(dir.clone());
    let plan = plan::plan(&file.grid, &options)?;
    drop(spinner);
    if let Some(refused) = plan.refused {
        return Err(anyhow!("a build would be refused: {refused}"));
    }
    if args.tasks > plan.jobs {
        bail!(
            "--tasks {}: the grid has only {} jobs; give at most as many tasks",
            args.tasks,
            plan.jobs
        );
    }
    if let Some(most) = max_array_size().filter(|most| args.tasks > *most) {
        bail!(
            "--tasks {}: this Slurm allows {most} tasks in an array (MaxArraySize); give at most as many",
            args.tasks
        );
    }
    // a task has at least its longest job to do
    let share = (plan.core_seconds / args.tasks as f64).max(plan.longest_job.core_seconds);
    let (factor, least) = TIME_MARGIN;
    let estimate = (factor * share / f64::from(args.cpus) / 60.0).max(least);
    let given = args.time.map(|time| time.as_secs_f64() / 60.0);
    let (factor, least) = MEMORY_MARGIN;
    let peak = host::peak_bytes().map_or(0.0, |peak| peak as f64 * 1e-6);
    let megabytes = (factor * peak).max(least).ceil() as u64;
    let wavelengths = plan.axes.last().map_or(0, |axis| axis.values.len()) as f64;
    // The factors toward views are compressed in one piece, and the file is assembled in memory.
    let toward_views = plan.curves as f64 * wavelengths * plan.views as f64;
    let compressing = COMPRESS_BYTES * toward_views + 3.0 * plan.compact_bytes as f64;
    let scripts = Scripts {
        name: file.name,
        program: std::env::current_exe().context("cannot find this program")?,
        grid: absolute(&args.grid)?,
        dir: absolute(&dir)?,
        tasks: args.tasks,
        cpus: args.cpus,
        minutes: given.unwrap_or(estimate).ceil().max(1.0) as u64,
        megabytes: args.memory.unwrap_or(megabytes),
        compress_megabytes: (least + 1e-6 * compressing).ceil() as u64,
        options: args.options.clone(),
    };
    let texts = [scripts.array(), scripts.compress()];
    if args.print {
        let [array, compress] = &texts;
        return common::print(&format!("{array}\n{compress}"));
    }
    let logs = scripts.dir.join(LOGS);
    fs::create_dir_all(&logs).map_err(|error| common::cannot_write(&logs, error))?;
    let paths = SCRIPTS.map(|name| scripts.dir.join(name));
    for (path, text) in paths.iter().zip(&texts) {
        atomic::write(path, text.as_bytes()).map_err(|error| common::cannot_write(path, error))?;
    }
    let [array, compress] = &paths;
    let first = sbatch(&[], array)?;
    let second = sbatch(&[format!("--dependency=afterany:{first}")], compress).map_err(|error| {
        error.context(format!(
            "the array is submitted as job {first}, but not the job that compresses; run `splitsnow build {} --out {} --finish {}` when it has ended",
            args.grid.display(),
            dir.display(),
            args.tasks
        ))
    })?;
    common::print(&format!(
        "array {first}: {} tasks of {} minutes at most, {} MB each\njob {second}: compresses when they have ended\nlogs: {}\nnext: splitsnow status {} --watch\n",
        scripts.tasks,
        scripts.minutes,
        scripts.megabytes,
        logs.display(),
        dir.display()
    ))
}

/// `text` as one word of a shell.
fn quoted(text: &Path) -> String {
    format!("'{}'", text.display().to_string().replace('\'', r"'\''"))
}

impl Scripts {
    /// The lines that both scripts begin with.
    fn head(&self, name: &str, log: &str, megabytes: u64) -> String {
        let log = self.dir.join(LOGS).join(log);
        let mut lines = vec![
            format!("--job-name=splitsnow-{name}{}", self.name),
            format!("--output={}", quoted(&log)),
            format!("--cpus-per-task={}", self.cpus),
            format!("--mem={megabytes}M"),
            format!("--time={}", self.minutes),
        ];
        lines.extend(self.options.iter().cloned());
        let lines = lines.iter().map(|line| format!("#SBATCH {line}\n"));
        format!("#!/bin/bash\n{}", lines.collect::<String>())
    }

    fn build(&self) -> String {
        format!(
            "{} build {} --out {}",
            quoted(&self.program),
            quoted(&self.grid),
            quoted(&self.dir)
        )
    }

    /// The script of the array.
    fn array(&self) -> String {
        let head = self.head("", "%A_%a.log", self.megabytes);
        let (last, tasks, build) = (self.tasks - 1, self.tasks, self.build());
        format!(
            r#"{head}#SBATCH --array=0-{last}
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --signal=B:USR1@{WARNING_SECONDS}
# One shard per task. Submit tasks 3 and 7 again: sbatch --array=3,7 slurm-array.sh
{build} --shard "$SLURM_ARRAY_TASK_ID/{tasks}" &
build=$!
asked=
trap 'asked=1; kill -USR1 $build' USR1 TERM
wait $build
code=$?
# the trap ends `wait`, and the build goes on until its work is safe
while [ -n "$asked" ]; do
    asked=
    wait $build
    code=$?
done
# 75: stopped before the time limit
[ $code -ne 75 ] || scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID"
exit $code
"#
        )
    }

    /// The script that compresses.
    fn compress(&self) -> String {
        let head = self.head("compress-", "%j.log", self.compress_megabytes);
        let (tasks, build) = (self.tasks, self.build());
        format!("{head}# Never simulates.\nexec {build} --finish {tasks}\n")
    }
}

/// Submits a script; returns the number of the job.
fn sbatch(options: &[String], script: &Path) -> anyhow::Result<String> {
    let output = Command::new("sbatch")
        .arg("--parsable")
        .args(options)
        .arg(script)
        .output();
    let output = output.map_err(|error| {
        anyhow!("cannot run sbatch: {error}; run this where Slurm is installed, or print the scripts with --print")
    })?;
    if !output.status.success() {
        let _ = std::io::stderr().write_all(&output.stderr);
        bail!("sbatch refused {}; see above", script.display());
    }
    // JOB or JOB;CLUSTER
    let text = String::from_utf8_lossy(&output.stdout);
    let job = text.trim().split(';').next().unwrap_or_default();
    Ok(job.to_owned())
}

/// Largest number of tasks of an array; `None` if there is no Slurm here.
fn max_array_size() -> Option<u64> {
    let mut command = Command::new("scontrol");
    let output = command
        .args(["show", "config"])
        .stderr(Stdio::null())
        .output()
        .ok()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let line = text
        .lines()
        .find_map(|line| line.trim().strip_prefix("MaxArraySize"))?;
    line.trim_start_matches([' ', '=']).trim().parse().ok()
}

/// The tasks with numbers `tasks`, as `sbatch --array` takes them: `0-2,5`.
pub(super) fn ranges(tasks: &[u64]) -> String {
    let mut ranges: Vec<[u64; 2]> = Vec::new();
    for task in tasks {
        match ranges.last_mut() {
            Some([_, last]) if *last + 1 == *task => *last = *task,
            _ => ranges.push([*task; 2]),
        }
    }
    let text = |[first, last]: [u64; 2]| match first == last {
        true => first.to_string(),
        false => format!("{first}-{last}"),
    };
    ranges.into_iter().map(text).collect::<Vec<_>>().join(",")
}

/// The command that submits `tasks` again, if `dir` has the script of the array.
pub(super) fn again(dir: &Path, tasks: &[u64]) -> Option<String> {
    let script = dir.join(SCRIPTS[0]);
    script
        .exists()
        .then(|| format!("sbatch --array={} {}", ranges(tasks), script.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tasks_are_listed_as_slurm_does() {
        assert_eq!(ranges(&[0, 1, 2, 5, 7, 8]), "0-2,5,7-8");
        assert_eq!(ranges(&[4]), "4");
    }

    #[test]
    fn words_are_quoted_for_the_shell() {
        assert_eq!(quoted(Path::new("it's a grid")), r"'it'\''s a grid'");
    }
}
