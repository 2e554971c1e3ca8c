//! Information from the operating system: unsupported file system operations, and whether a
//! process on this host still runs.
use std::io;

use serde::{Deserialize, Serialize};

/// Whether an error means that the file system does not support an operation, as with some
/// network and user-space file systems, rather than that the operation failed.
#[cfg(unix)]
pub(crate) fn is_unsupported(error: &io::Error) -> bool {
    use rustix::io::Errno;
    let code = error.raw_os_error().map(Errno::from_raw_os_error);
    code.is_some_and(|code| {
        [
            Errno::INVAL,
            Errno::NOLCK,
            Errno::NOSYS,
            Errno::NOTSUP,
            Errno::OPNOTSUPP,
        ]
        .contains(&code)
    })
}

/// Whether an error means that the file system does not support an operation.
#[cfg(not(unix))]
pub(crate) fn is_unsupported(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::Unsupported
}

/// Largest memory of this process so far, bytes; `None` where the system does not tell.
pub(crate) fn peak_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024 * kilobytes)
}

/// Identification of a process across hosts.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Process {
    pub(crate) host: String,
    pub(crate) process: u32,
    /// Namespace of the process id: containers on the same host have separate ids.
    namespace: Option<String>,
    /// Start time in clock ticks since the host started: process ids are reused.
    started: Option<u64>,
}

/// State of a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum State {
    /// The process runs.
    Running,
    /// The process has ended.
    Gone,
    /// Unknown: the process is on another host or in another container.
    Elsewhere,
}

impl Process {
    /// This process.
    pub(crate) fn this() -> Self {
        let process = std::process::id();
        let link = std::fs::read_link("/proc/self/ns/pid");
        Self {
            host: name(),
            process,
            namespace: link.ok().map(|link| link.to_string_lossy().into_owned()),
            started: started(process),
        }
    }

    /// Whether the process still runs.
    pub(crate) fn state(&self) -> State {
        let this = Self::this();
        if (&self.host, &self.namespace) != (&this.host, &this.namespace) {
            return State::Elsewhere;
        }
        match is_running(self.process) {
            Some(false) => State::Gone,
            // if /proc hides the processes of other users, their start time is unknown
            Some(true) => match (started(self.process), self.started) {
                (Some(now), Some(then)) if now != then => State::Gone,
                _ => State::Running,
            },
            None => State::Elsewhere,
        }
    }
}

/// Start time of a process, field 22 of `/proc/PID/stat`; `None` if there is no such file.
fn started(process: u32) -> Option<u64> {
    let text = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // the name of the program, field 2, may contain spaces and parentheses
    let (_, rest) = text.rsplit_once(')')?;
    rest.split_whitespace().nth(19)?.parse().ok()
}

#[cfg(unix)]
fn name() -> String {
    let name = rustix::system::uname();
    name.nodename().to_string_lossy().into_owned()
}

#[cfg(not(unix))]
fn name() -> String {
    std::env::var("COMPUTERNAME").unwrap_or_default()
}

/// Whether a process runs on this host; `None` if this cannot be determined.
#[cfg(unix)]
fn is_running(process: u32) -> Option<bool> {
    use rustix::process::{Pid, test_kill_process};
    let process = Pid::from_raw(process.try_into().ok()?)?;
    match test_kill_process(process) {
        Err(rustix::io::Errno::SRCH) => Some(false),
        // a process of another user refuses the signal, and thus exists
        _ => Some(true),
    }
}

#[cfg(not(unix))]
fn is_running(_: u32) -> Option<bool> {
    None
}

#[cfg(all(test, target_os = "linux"))]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn processes_are_told_apart() {
        let this = Process::this();
        assert_eq!(this.state(), State::Running);
        assert!(this.started.is_some() && this.namespace.is_some());
        let mut child = std::process::Command::new("sleep").arg("9").spawn();
        let child = child.as_mut().unwrap();
        let other = Process {
            process: child.id(),
            started: started(child.id()),
            ..this.clone()
        };
        assert_eq!(other.state(), State::Running);
        child.kill().unwrap();
        child.wait().unwrap();
        assert_eq!(other.state(), State::Gone);
        let earlier = Process {
            started: Some(1),
            ..this.clone()
        };
        assert_eq!(earlier.state(), State::Gone, "its number was used again");
        let hidden = Process {
            started: None,
            ..this.clone()
        };
        assert_eq!(hidden.state(), State::Running, "its start is not known");
        let host = Process {
            host: "another".into(),
            ..this.clone()
        };
        let container = Process {
            namespace: Some("pid:[1]".into()),
            ..this
        };
        assert_eq!([host, container].map(|p| p.state()), [State::Elsewhere; 2]);
    }

    #[test]
    fn what_file_systems_lack_is_told_from_what_fails() {
        let of = |code| is_unsupported(&io::Error::from_raw_os_error(code));
        // ENOLCK, ENOSYS, EOPNOTSUPP, EINVAL; EIO, ENOSPC, EROFS
        assert!([37, 38, 95, 22].into_iter().all(of));
        assert!(![5, 28, 30].into_iter().any(of));
    }
}
