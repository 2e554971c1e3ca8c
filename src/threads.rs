//! How many threads to run on: what was asked for, the batch system's or the
//! environment's limit, or what the system lets this process use.
use std::env;
use std::ffi::OsString;
use std::num::NonZero;
use std::thread::available_parallelism;

use thiserror::Error;

/// Threads at most.
pub const MOST: u16 = 1024;

/// Variables that limit the threads, the most specific first: processors that Slurm
/// gave each task, and what programs made with rayon are told.
pub const VARIABLES: [&str; 2] = ["SLURM_CPUS_PER_TASK", "RAYON_NUM_THREADS"];

/// A variable that limits the threads says no number of them.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "the environment variable {variable} is `{value}`; it must be a number of threads from 1 to {MOST}, or not be set"
)]
pub struct ThreadsError {
    /// The variable.
    pub variable: &'static str,
    /// What it says.
    pub value: String,
}

/// The number of threads: `asked`, or the first of [`VARIABLES`] that is set (an empty
/// one is not, nor `RAYON_NUM_THREADS=0`), or the processors that this process may use: on Linux those of its
/// affinity mask, and no more than the quota of its control group.
///
/// # Errors
/// A variable that counts is no number from 1 to [`MOST`].
pub fn threads(asked: Option<u16>) -> Result<usize, ThreadsError> {
    match asked {
        Some(asked) => Ok(asked.into()),
        None => Ok(limit(|variable| env::var_os(variable))?
            .unwrap_or_else(|| available_parallelism().map_or(1, NonZero::get))),
    }
}

/// What the variables say.
fn limit(variable: impl Fn(&str) -> Option<OsString>) -> Result<Option<usize>, ThreadsError> {
    for name in VARIABLES {
        let Some(value) = variable(name).filter(|value| !value.is_empty()) else {
            continue;
        };
        // rayon's own word for its default
        if name == VARIABLES[1] && value == "0" {
            continue;
        }
        let number = value.to_str().and_then(|text| text.trim().parse().ok());
        return match number.filter(|number| (1..=MOST).contains(number)) {
            Some(number) => Ok(Some(number.into())),
            None => Err(ThreadsError {
                variable: name,
                value: value.to_string_lossy().into_owned(),
            }),
        };
    }
    Ok(None)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn of(slurm: Option<&str>, rayon: Option<&str>) -> Result<Option<usize>, ThreadsError> {
        limit(|name| {
            let value = if name == VARIABLES[0] { slurm } else { rayon };
            value.map(OsString::from)
        })
    }

    #[test]
    fn the_most_specific_counts() {
        assert_eq!(threads(Some(7)), Ok(7));
        assert_eq!(of(Some("3"), Some("5")), Ok(Some(3)));
        assert_eq!(of(None, Some(" 5 ")), Ok(Some(5)));
        // Slurm's is set: the other does not matter, not even a wrong one
        assert_eq!(of(Some("3"), Some("many")), Ok(Some(3)));
        assert_eq!(of(Some(""), Some("5")), Ok(Some(5)));
        assert_eq!(of(None, None), Ok(None));
    }

    #[test]
    fn what_is_no_number_of_threads_is_refused_by_name() {
        assert_eq!(of(None, Some("0")), Ok(None));
        assert!(of(Some("0"), None).is_err());
        for wrong in ["-2", "two", "1.5", "1025", "2(x3)", " "] {
            for (slurm, rayon, named) in [
                (Some(wrong), Some("2"), VARIABLES[0]),
                (None, Some(wrong), VARIABLES[1]),
            ] {
                let error = of(slurm, rayon).unwrap_err();
                assert_eq!((error.variable, error.value.as_str()), (named, wrong));
                assert!(error.to_string().contains(named), "{error}");
            }
        }
    }
}
