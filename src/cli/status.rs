//! `splitsnow status`: how far a build is.
use std::fmt;
use std::io::{IsTerminal, stdout};
use std::path::PathBuf;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use super::common;
use crate::build::{self, BuildStatus, RunState, RunStatus};

/// Time between two looks on a terminal, and in a log.
const PAUSES: [Duration; 2] = [Duration::from_secs(2), Duration::from_secs(60)];

/// Say how far a build is: jobs done and left, processes, time left
///
/// Counts the jobs that are marked as done, and reads what the processes of the build write
/// about themselves every five seconds. It may be called at any time, from any host that sees
/// the directory, and disturbs no process.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "\
Examples:
  splitsnow status out/thesis --watch
  splitsnow status out/quick --json")]
pub(super) struct Args {
    /// Output directory of `build`
    #[arg(value_name = "DIR")]
    dir: PathBuf,
    /// Repeat until all jobs are done: every two seconds on a terminal, else a line a minute
    #[arg(long)]
    watch: bool,
    /// Print the status as JSON
    #[arg(long)]
    json: bool,
}

/// A status as text.
struct StatusText<'a>(&'a BuildStatus);

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let on_terminal = stdout().is_terminal();
    loop {
        let status = build::status(&args.dir)?;
        let text = StatusText(&status);
        match (args.json, args.watch) {
            (true, _) => common::print_json(&status)?,
            (false, true) if on_terminal => common::print(&format!("\x1b[H\x1b[2J{text}"))?,
            (false, true) => common::print(&format!("{}\n", text.first_line()))?,
            (false, false) => common::print(&text.to_string())?,
        }
        if !args.watch || status.left == 0 {
            return Ok(());
        }
        std::thread::sleep(PAUSES[usize::from(!on_terminal)]);
    }
}

impl StatusText<'_> {
    fn first_line(&self) -> String {
        let status = self.0;
        let time = status.seconds_left.filter(|_| status.left > 0);
        format!(
            "{} of {} jobs are done, {} left{}",
            status.done,
            status.jobs,
            status.left,
            time.map_or(String::new(), |time| format!(
                ", about {} at the present rate",
                common::duration(time)
            ))
        )
    }
}

impl fmt::Display for StatusText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        writeln!(f, "{}", self.first_line())?;
        let passed = SystemTime::now().duration_since(UNIX_EPOCH);
        let now = passed.unwrap_or_default().as_secs();
        for process in &self.0.processes {
            let RunStatus {
                shard,
                state,
                message,
                host,
                process,
                threads,
                jobs,
                done,
                peak_bytes,
                since,
                seen,
                ..
            } = process;
            let ago = |time: u64| common::duration(now.saturating_sub(time) as f64);
            let shard = shard
                .as_ref()
                .map_or("all jobs".into(), |shard| format!("shard {shard}"));
            write!(
                f,
                "{shard:<14} {:<9} {done} of {jobs} jobs, process {process} on {host}, {threads} thread{}",
                state.name(),
                if *threads == 1 { "" } else { "s" }
            )?;
            match state {
                RunState::Running => write!(f, ", for {}", ago(*since))?,
                RunState::Silent => write!(f, ", last seen {} ago", ago(*seen))?,
                _ => write!(f, ", {} ago", ago(*seen))?,
            }
            if let Some(peak) = peak_bytes {
                write!(f, ", {}", common::bytes(*peak))?;
            }
            if let Some(message) = message {
                write!(f, ": {message}")?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}
