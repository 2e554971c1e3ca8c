//! The shard of a build, as given or from the environment of a job array.
use std::env;
use std::str::FromStr;

use thiserror::Error;

use crate::grid::{Shard, ShardError};

/// A variable with the shard itself, as I/N. It counts before those of job arrays.
const OWN_VARIABLE: &str = "SPLITSNOW_SHARD";

/// Value of `--shard`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ShardArg {
    /// This shard.
    Given(Shard),
    /// The task of a job array, of so many if the array does not say it.
    Environment(Option<u64>),
}

impl FromStr for ShardArg {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        if text == "env" {
            return Ok(Self::Environment(None));
        }
        match text.strip_prefix("env/") {
            // shard 0 checks the number
            Some(count) => format!("0/{count}")
                .parse()
                .map(|shard: Shard| Self::Environment(Some(shard.count()))),
            None => text.parse().map(Self::Given),
        }
    }
}

impl ShardArg {
    /// The shard.
    ///
    /// # Errors
    /// [`ArrayError`] if it should come from the environment and is not there.
    pub(super) fn shard(self) -> Result<Shard, ArrayError> {
        match self {
            Self::Given(shard) => Ok(shard),
            Self::Environment(count) => from_environment(count, |name| env::var(name).ok()),
        }
    }
}

/// Why the environment does not give a shard.
#[derive(Debug, PartialEq, Eq, Error)]
pub(super) enum ArrayError {
    /// None of the variables is set.
    #[error(
        "--shard env: this is no task of a job array; run it in one, set {OWN_VARIABLE}=I/N, or give --shard I/N"
    )]
    NoArray,
    /// The system does not say how many tasks there are.
    #[error("--shard env: {system} does not say how many tasks its array has; give --shard env/N")]
    NoCount { system: &'static str },
    /// A variable is not a number.
    #[error(
        "--shard env: {name} is `{value}`, not a whole number of at least 0; set it, or give --shard I/N"
    )]
    NotANumber { name: &'static str, value: String },
    /// Only a part of the array was submitted, so that its size is unknown.
    #[error(
        "--shard env: the tasks of this array are not evenly numbered; give --shard env/N with the number of tasks of the whole array, numbered from {first}"
    )]
    Uneven { first: u64 },
    /// The task does not exist.
    #[error(
        "--shard env: task {task} of {system} is not from {first} to {last}; submit the array with these numbers"
    )]
    OutOfRange {
        system: &'static str,
        task: u64,
        first: u64,
        last: u64,
    },
    /// The own variable is wrong.
    #[error("{OWN_VARIABLE}: {0}")]
    Shard(#[from] ShardError),
}

/// The variables of a job array.
struct ArrayVariables {
    system: &'static str,
    /// Number of the task.
    task: &'static str,
    /// Number of the first task of an array of known size.
    first: u64,
    /// Smallest and largest number and step, if they are known.
    range: Option<[&'static str; 3]>,
    /// Number of tasks, if it is known.
    count: Option<&'static str>,
}

/// The job arrays that are understood.
const ARRAYS: [ArrayVariables; 6] = [
    ArrayVariables {
        system: "Slurm",
        task: "SLURM_ARRAY_TASK_ID",
        first: 0,
        range: Some([
            "SLURM_ARRAY_TASK_MIN",
            "SLURM_ARRAY_TASK_MAX",
            "SLURM_ARRAY_TASK_STEP",
        ]),
        count: Some("SLURM_ARRAY_TASK_COUNT"),
    },
    ArrayVariables {
        system: "PBS",
        task: "PBS_ARRAY_INDEX",
        first: 0,
        range: None,
        count: None,
    },
    ArrayVariables {
        system: "Torque",
        task: "PBS_ARRAYID",
        first: 0,
        range: None,
        count: None,
    },
    ArrayVariables {
        system: "SGE",
        task: "SGE_TASK_ID",
        first: 1,
        range: Some(["SGE_TASK_FIRST", "SGE_TASK_LAST", "SGE_TASK_STEPSIZE"]),
        count: None,
    },
    ArrayVariables {
        system: "Kubernetes",
        task: "JOB_COMPLETION_INDEX",
        first: 0,
        range: None,
        count: None,
    },
    ArrayVariables {
        system: "AWS Batch",
        task: "AWS_BATCH_JOB_ARRAY_INDEX",
        first: 0,
        range: None,
        count: Some("AWS_BATCH_JOB_ARRAY_SIZE"),
    },
];

/// The shard that `variable` describes. `count` is the number of shards, if it was given: the
/// tasks are then numbered from the first of the system, and any part of them may run.
fn from_environment(
    count: Option<u64>,
    variable: impl Fn(&str) -> Option<String>,
) -> Result<Shard, ArrayError> {
    // SGE sets `undefined` outside arrays
    let set = |name| variable(name).filter(|value| !value.is_empty() && value != "undefined");
    let number = |name: &'static str| -> Result<Option<u64>, ArrayError> {
        let parse = |value: String| {
            value
                .trim()
                .parse()
                .map_err(|_| ArrayError::NotANumber { name, value })
        };
        set(name).map(parse).transpose()
    };
    if let Some(text) = set(OWN_VARIABLE) {
        return Ok(text.parse()?);
    }
    for array in &ARRAYS {
        let Some(task) = number(array.task)? else {
            continue;
        };
        let (first, step, tasks) = match (count, array.range, array.count) {
            (Some(tasks), _, _) => (array.first, 1, tasks),
            (None, Some(names), _) => {
                let [Some(min), Some(max), Some(step)] =
                    [number(names[0])?, number(names[1])?, number(names[2])?]
                else {
                    return Err(ArrayError::NoCount {
                        system: array.system,
                    });
                };
                let tasks = max.saturating_sub(min) / step.max(1) + 1;
                let counted = array.count.map(number).transpose()?.flatten();
                if counted.is_some_and(|counted| counted != tasks) {
                    return Err(ArrayError::Uneven { first: array.first });
                }
                (min, step.max(1), tasks)
            }
            (None, None, Some(name)) => match number(name)? {
                Some(tasks) => (array.first, 1, tasks),
                None => {
                    return Err(ArrayError::NoCount {
                        system: array.system,
                    });
                }
            },
            (None, None, None) => {
                return Err(ArrayError::NoCount {
                    system: array.system,
                });
            }
        };
        let index = task.checked_sub(first).map(|passed| passed / step);
        let shard = index.and_then(|index| Shard::new(index, tasks).ok());
        return shard.ok_or(ArrayError::OutOfRange {
            system: array.system,
            task,
            first,
            last: first + step * tasks.saturating_sub(1),
        });
    }
    Err(ArrayError::NoArray)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn of(count: Option<u64>, variables: &[(&str, &str)]) -> Result<String, String> {
        let value = |name: &str| {
            let found = variables.iter().find(|(other, _)| *other == name);
            found.map(|(_, value)| (*value).to_owned())
        };
        let shard = from_environment(count, value);
        shard
            .map(|shard| shard.to_string())
            .map_err(|error| error.to_string())
    }

    #[test]
    fn every_system_is_understood() {
        let slurm = [
            ("SLURM_ARRAY_TASK_ID", "7"),
            ("SLURM_ARRAY_TASK_MIN", "1"),
            ("SLURM_ARRAY_TASK_MAX", "10"),
            ("SLURM_ARRAY_TASK_STEP", "3"),
            ("SLURM_ARRAY_TASK_COUNT", "4"),
        ];
        let sge = [
            ("SGE_TASK_ID", "2"),
            ("SGE_TASK_FIRST", "1"),
            ("SGE_TASK_LAST", "5"),
            ("SGE_TASK_STEPSIZE", "1"),
        ];
        let aws = [
            ("AWS_BATCH_JOB_ARRAY_INDEX", "0"),
            ("AWS_BATCH_JOB_ARRAY_SIZE", "3"),
        ];
        assert_eq!(of(None, &slurm), Ok("2/4".into()));
        assert_eq!(of(None, &sge), Ok("1/5".into()));
        assert_eq!(of(None, &aws), Ok("0/3".into()));
        assert_eq!(
            of(None, &[("SPLITSNOW_SHARD", "1/2"), slurm[0]]),
            Ok("1/2".into())
        );
        // with the number given, Slurm's array begins at 0 and SGE's at 1, whatever part runs
        assert_eq!(of(Some(12), &slurm), Ok("7/12".into()));
        assert_eq!(of(Some(12), &sge), Ok("1/12".into()));
        for name in ["PBS_ARRAY_INDEX", "PBS_ARRAYID", "JOB_COMPLETION_INDEX"] {
            assert_eq!(of(Some(9), &[(name, "8")]), Ok("8/9".into()));
            let error = of(None, &[(name, "8")]).unwrap_err();
            assert!(error.ends_with("give --shard env/N"), "{error}");
        }
        // outside an array
        assert_eq!(of(Some(9), &[("SGE_TASK_ID", "undefined")]), of(None, &[]));
        assert!(of(None, &[]).unwrap_err().contains("SPLITSNOW_SHARD=I/N"));
    }

    #[test]
    fn wrong_arrays_are_refused() {
        // tasks 3 and 9 of an array were submitted again
        let part = [
            ("SLURM_ARRAY_TASK_ID", "3"),
            ("SLURM_ARRAY_TASK_MIN", "3"),
            ("SLURM_ARRAY_TASK_MAX", "9"),
            ("SLURM_ARRAY_TASK_STEP", "1"),
            ("SLURM_ARRAY_TASK_COUNT", "2"),
        ];
        assert!(of(None, &part).unwrap_err().contains("not evenly numbered"));
        for (count, variables, said) in [
            (
                Some(3),
                ("SLURM_ARRAY_TASK_ID", "3"),
                "task 3 of Slurm is not from 0 to 2",
            ),
            (
                Some(3),
                ("SGE_TASK_ID", "0"),
                "task 0 of SGE is not from 1 to 3",
            ),
            (
                Some(3),
                ("PBS_ARRAY_INDEX", "-1"),
                "PBS_ARRAY_INDEX is `-1`",
            ),
            (
                None,
                ("SPLITSNOW_SHARD", "3/3"),
                "SPLITSNOW_SHARD: shard \"3/3\"",
            ),
            (
                None,
                ("SLURM_ARRAY_TASK_ID", "3"),
                "Slurm does not say how many",
            ),
        ] {
            let error = of(count, &[variables]).unwrap_err();
            assert!(error.contains(said), "{error}");
        }
    }

    #[test]
    fn arguments() {
        let parsed = |text: &str| text.parse::<ShardArg>();
        assert_eq!(parsed("env"), Ok(ShardArg::Environment(None)));
        assert_eq!(parsed("env/12"), Ok(ShardArg::Environment(Some(12))));
        assert_eq!(parsed("1/2"), Shard::new(1, 2).map(ShardArg::Given));
        for wrong in ["env/0", "env/", "env12", "env/-1", "environment", "2/2", ""] {
            assert!(parsed(wrong).is_err(), "{wrong}");
        }
    }
}
