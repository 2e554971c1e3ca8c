//! The number of threads: as requested, as limited by the batch system or the environment,
//! or the number of processors that this process may use.
use std::env;
use std::ffi::OsString;
use std::num::NonZero;
use std::thread::available_parallelism;

use thiserror::Error;

/// Largest number of threads.
pub const MAX_THREADS: u16 = 1024;

/// Environment variables that limit the threads, the most specific first: the processors
/// that Slurm assigned to each task, and the number of threads of programs that use rayon.
pub const VARIABLES: [&str; 2] = ["SLURM_CPUS_PER_TASK", "RAYON_NUM_THREADS"];

/// An environment variable that limits the threads has an invalid value.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "the environment variable {variable} is `{value}`; set it to a number of threads from 1 to {MAX_THREADS}, or unset it"
)]
pub struct ThreadsError {
    /// Name of the variable.
    pub variable: &'static str,
    /// Its value.
    pub value: String,
}

/// The number of threads: `requested` if it is given; else the value of the first of
/// [`VARIABLES`] that is set (an empty value and `RAYON_NUM_THREADS=0` count as not set);
/// else the number of processors that this process may use, on Linux those of its affinity
/// mask, limited by the quota of its control group.
///
/// # Errors
/// [`ThreadsError`] if the variable that applies is not a number from 1 to [`MAX_THREADS`].
pub fn threads(requested: Option<u16>) -> Result<usize, ThreadsError> {
    match requested {
        Some(requested) => Ok(requested.into()),
        None => Ok(limit(|variable| env::var_os(variable))?
            .unwrap_or_else(|| available_parallelism().map_or(1, NonZero::get))),
    }
}

/// The limit that the environment variables set; `None` if none of them is set.
fn limit(variable: impl Fn(&str) -> Option<OsString>) -> Result<Option<usize>, ThreadsError> {
    for name in VARIABLES {
        let Some(value) = variable(name).filter(|value| !value.is_empty()) else {
            continue;
        };
        // 0 stands for rayon's default
        if name == VARIABLES[1] && value == "0" {
            continue;
        }
        let number = value.to_str().and_then(|text| text.trim().parse().ok());
        return match number.filter(|number| (1..=MAX_THREADS).contains(number)) {
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
