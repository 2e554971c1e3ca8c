//! Shards: shares of the jobs, so that several processes can work on one database.
use std::fmt;
use std::str::FromStr;

use thiserror::Error;

/// Shard `index` of `count`: the jobs whose number modulo `count` is `index`. Neighbouring
/// jobs have similar costs, and so have the shards.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    index: u64,
    count: u64,
}

/// An invalid shard.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("shard {given:?} must be I/N with whole numbers 0 <= I < N, such as 0/3")]
pub struct ShardError {
    given: String,
}

impl Shard {
    /// Shard `index` of `count`.
    ///
    /// # Errors
    /// [`ShardError`] if `index` is not below `count`.
    pub fn new(index: u64, count: u64) -> Result<Self, ShardError> {
        if index < count {
            Ok(Self { index, count })
        } else {
            Err(ShardError {
                given: format!("{index}/{count}"),
            })
        }
    }

    /// Whether `job` belongs to this shard.
    #[must_use]
    pub fn owns(&self, job: u64) -> bool {
        job % self.count == self.index
    }

    /// The name of this shard in file names, such as `0-of-3`.
    #[must_use]
    pub fn file_name(&self) -> String {
        format!("{}-of-{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        let error = || ShardError { given: text.into() };
        let (index, count) = text.split_once('/').ok_or_else(error)?;
        let parse = |s: &str| s.parse().map_err(|_| error());
        Self::new(parse(index)?, parse(count)?)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn text_is_strict() {
        assert_eq!("0/3".parse::<Shard>().unwrap().to_string(), "0/3");
        for wrong in ["3/3", "0/0", "1", "-1/2", "1/2/3", "a/b", ""] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
