//! Journals: what each process of a build is doing, in files beside the database, and the
//! status that follows from them. They change nothing in the database.
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use super::{BuildError, BuildReport};
use crate::batch::{Progress, RunInfo};
use crate::host::{self, Process, State};
use crate::store::{Access, JOURNALS, Store, StoreError};

/// Time between two entries in a journal.
const BEAT: Duration = Duration::from_secs(5);
/// A process on another host whose journal is older than this has probably ended.
const SILENCE: Duration = Duration::from_secs(60);

/// State of a process that works, or has worked, on a build.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RunState {
    /// It runs.
    Running,
    /// All its jobs are done.
    Finished,
    /// It was stopped, with jobs left.
    Stopped,
    /// A job failed, or a file could not be written.
    Failed,
    /// It has ended without a word, such as after `kill -9`.
    Killed,
    /// It is on another host and has written nothing for a minute.
    Silent,
}

impl RunState {
    /// Its name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Running => "running",
            Self::Finished => "finished",
            Self::Stopped => "stopped",
            Self::Failed => "failed",
            Self::Killed => "killed",
            Self::Silent => "silent",
        }
    }
}

/// A process that works, or has worked, on a build.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RunStatus {
    /// Its shard, such as `0/3`; `None` if it runs all jobs.
    pub shard: Option<String>,
    /// Its state.
    pub state: RunState,
    /// Why it failed.
    pub message: Option<String>,
    /// Its host.
    pub host: String,
    /// Its number on this host.
    pub process: u32,
    /// Number of its threads.
    pub threads: usize,
    /// Number of the jobs that it has to do.
    pub jobs: u64,
    /// Number of these that are done.
    pub done: u64,
    /// Number of jobs that it has run itself.
    pub run: u64,
    /// Number of rays that it has walked.
    pub rays: u64,
    /// Its largest memory so far, bytes, where the system tells.
    pub peak_bytes: Option<u64>,
    /// When it began, seconds since 1970.
    pub since: u64,
    /// When it last wrote its journal, seconds since 1970.
    pub seen: u64,
}

/// A journal.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Entry {
    process: Process,
    run: RunStatus,
    /// Rays walked so far.
    #[serde(skip)]
    rays: Arc<AtomicU64>,
}

/// Seconds since 1970.
fn now() -> u64 {
    let passed = SystemTime::now().duration_since(UNIX_EPOCH);
    passed.unwrap_or_default().as_secs()
}

/// The journal that this process writes. It also passes on the progress.
#[derive(Debug)]
pub(super) struct Journal<'a> {
    inner: Option<&'a dyn Progress>,
    file: Arc<PathBuf>,
    entry: Arc<Mutex<Entry>>,
    writer: Mutex<Option<(Sender<()>, JoinHandle<()>)>>,
}

impl<'a> Journal<'a> {
    /// The journal of a process with this `access` to the output directory `dir`.
    pub(super) fn new(
        dir: &Path,
        access: Access,
        threads: usize,
        inner: Option<&'a dyn Progress>,
    ) -> Self {
        let shard = match access {
            Access::Exclusive => None,
            Access::Shard(shard) => Some(shard.to_string()),
        };
        let file = dir
            .join(JOURNALS)
            .join(format!("{}.json", access.file_name()));
        let process = Process::this();
        Self {
            inner,
            file: Arc::new(file),
            entry: Arc::new(Mutex::new(Entry {
                run: RunStatus {
                    shard,
                    state: RunState::Running,
                    message: None,
                    host: process.host.clone(),
                    process: process.process,
                    threads,
                    jobs: 0,
                    done: 0,
                    run: 0,
                    rays: 0,
                    peak_bytes: None,
                    since: now(),
                    seen: now(),
                },
                process,
                rays: Arc::default(),
            })),
            writer: Mutex::default(),
        }
    }

    /// Writes the last entry.
    pub(super) fn close(&self, outcome: Result<&BuildReport, &BuildError>) {
        let writer = self.writer.lock();
        if let Some((stop, thread)) = writer.unwrap_or_else(PoisonError::into_inner).take() {
            drop(stop);
            // It cannot panic.
            let _ = thread.join();
        }
        let mut entry = self.entry.lock().unwrap_or_else(PoisonError::into_inner);
        let run = &mut entry.run;
        match outcome {
            Ok(report) => {
                // nothing else counts them if no job was missing
                (run.jobs, run.done) = (report.jobs, report.jobs);
                run.state = RunState::Finished;
            }
            Err(BuildError::Interrupted { .. }) => run.state = RunState::Stopped,
            Err(error) => {
                (run.state, run.message) = (RunState::Failed, Some(error.to_string()));
            }
        }
        write(&self.file, &mut entry);
    }
}

impl Progress for Journal<'_> {
    fn begin(&self, run: RunInfo) {
        {
            let mut entry = self.entry.lock().unwrap_or_else(PoisonError::into_inner);
            entry.rays = Arc::clone(&run.rays);
            (entry.run.jobs, entry.run.done) = (run.jobs, run.done);
            write(&self.file, &mut entry);
        }
        let (stop, stopped) = mpsc::channel();
        let (file, entry) = (Arc::clone(&self.file), Arc::clone(&self.entry));
        let thread = std::thread::spawn(move || {
            while let Err(RecvTimeoutError::Timeout) = stopped.recv_timeout(BEAT) {
                write(
                    &file,
                    &mut entry.lock().unwrap_or_else(PoisonError::into_inner),
                );
            }
        });
        let writer = self.writer.lock();
        *writer.unwrap_or_else(PoisonError::into_inner) = Some((stop, thread));
        if let Some(inner) = self.inner {
            inner.begin(run);
        }
    }

    fn job_done(&self) {
        {
            let mut entry = self.entry.lock().unwrap_or_else(PoisonError::into_inner);
            entry.run.done += 1;
            entry.run.run += 1;
        }
        if let Some(inner) = self.inner {
            inner.job_done();
        }
    }

    fn end(&self) {
        if let Some(inner) = self.inner {
            inner.end();
        }
    }

    fn compressing(&self) {
        if let Some(inner) = self.inner {
            inner.compressing();
        }
    }
}

/// Replaces a journal, which need not survive a power loss. A failure is ignored: the build itself
/// reports a full disk.
fn write(file: &Path, entry: &mut Entry) {
    entry.run.rays = entry.rays.load(Ordering::Relaxed);
    (entry.run.seen, entry.run.peak_bytes) = (now(), host::peak_bytes());
    let partial = file.with_extension("partial");
    let replace = || -> io::Result<()> {
        file.parent().map_or(Ok(()), fs::create_dir_all)?;
        fs::write(&partial, serde_json::to_vec_pretty(entry)?)?;
        fs::rename(&partial, file)
    };
    let _ = replace();
}

/// How far a build is.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct BuildStatus {
    /// Path of the database.
    pub database: PathBuf,
    /// Number of all jobs.
    pub jobs: u64,
    /// Number of jobs that are marked as done.
    pub done: u64,
    /// Number of jobs that are left.
    pub left: u64,
    /// Jobs per second of the processes that run; `None` if none of them has ended a job.
    pub jobs_per_second: Option<f64>,
    /// Time until all jobs are done at this rate, s.
    pub seconds_left: Option<f64>,
    /// The processes, in the order of their shards.
    pub processes: Vec<RunStatus>,
}

/// The status of the build in the output directory `dir`. Reads the names of the commit marks and
/// the journals; disturbs no process.
///
/// # Errors
/// [`StoreError`] if there is no database, or its description or a directory cannot be read.
pub fn status(dir: impl AsRef<Path>) -> Result<BuildStatus, StoreError> {
    let dir = dir.as_ref();
    let store = Store::open(dir)?;
    let (jobs, left) = (store.jobs().count(), store.unmarked()?.len() as u64);
    let mut processes = Vec::new();
    let folder = dir.join(JOURNALS);
    let entries = match fs::read_dir(&folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => None,
        entries => Some(entries.map_err(StoreError::io("read", &folder))?),
    };
    for file in entries.into_iter().flatten() {
        let path = file.map_err(StoreError::io("read", &folder))?.path();
        // A journal may vanish while it is read, and partial files are there too.
        let text = fs::read(&path)
            .ok()
            .filter(|_| path.extension().is_some_and(|e| e == "json"));
        if let Some(entry) = text.and_then(|text| serde_json::from_slice(&text).ok()) {
            processes.push(of(entry));
        }
    }
    let place = |run: &RunStatus| {
        let index = run
            .shard
            .as_ref()
            .and_then(|shard| shard.split('/').next()?.parse::<u64>().ok());
        (index, run.shard.clone())
    };
    processes.sort_by_key(place);
    let running = processes
        .iter()
        .filter(|run| run.state == RunState::Running && run.run > 0);
    let rates = running.map(|run| run.run as f64 / (run.seen - run.since).max(1) as f64);
    let rate = rates.reduce(|a, b| a + b);
    Ok(BuildStatus {
        database: store.path().into(),
        jobs,
        done: jobs - left,
        left,
        jobs_per_second: rate,
        seconds_left: rate.map(|rate| left as f64 / rate),
        processes,
    })
}

/// What the journal `entry` says now.
fn of(
    Entry {
        process, mut run, ..
    }: Entry,
) -> RunStatus {
    if run.state == RunState::Running {
        let is_silent = now().saturating_sub(run.seen) > SILENCE.as_secs();
        match process.state() {
            State::Gone => run.state = RunState::Killed,
            State::Elsewhere if is_silent => run.state = RunState::Silent,
            State::Elsewhere | State::Running => {}
        }
    }
    // a clock may go backwards
    run.seen = run.seen.max(run.since);
    run
}
