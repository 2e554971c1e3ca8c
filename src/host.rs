//! What the operating system says of its file systems, and of processes on
//! this host and others.
use std::io;

use serde::{Deserialize, Serialize};

/// Whether a file system does not do what it was asked for, as network and
/// user-space ones may, rather than failing at it.
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

/// The same where all file systems are the system's own.
#[cfg(not(unix))]
pub(crate) fn is_unsupported(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::Unsupported
}

/// A process among those of all hosts.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Process {
    pub(crate) host: String,
    pub(crate) process: u32,
    /// Where its number counts: containers of one host number their own.
    namespace: Option<String>,
    /// When it began, in ticks since the host did: numbers are used again.
    started: Option<u64>,
}

/// What can be told of a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum State {
    Running,
    Gone,
    /// On another host or in another container: unknown.
    Elsewhere,
}

impl Process {
    /// This one.
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

    pub(crate) fn state(&self) -> State {
        let this = Self::this();
        if (&self.host, &self.namespace) != (&this.host, &this.namespace) {
            return State::Elsewhere;
        }
        match is_running(self.process) {
            Some(false) => State::Gone,
            // where /proc hides the processes of others, nothing is known of their start
            Some(true) => match (started(self.process), self.started) {
                (Some(now), Some(then)) if now != then => State::Gone,
                _ => State::Running,
            },
            None => State::Elsewhere,
        }
    }
}

/// Field 22 of `/proc/PID/stat`, where there is one.
fn started(process: u32) -> Option<u64> {
    let text = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // the name of the program, field 2, may hold anything
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

/// `None`: there is no way to tell.
#[cfg(unix)]
fn is_running(process: u32) -> Option<bool> {
    use rustix::process::{Pid, test_kill_process};
    let process = Pid::from_raw(process.try_into().ok()?)?;
    match test_kill_process(process) {
        Err(rustix::io::Errno::SRCH) => Some(false),
        // another user's refuses, and so is there
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
