//! Shards: shares of the jobs, so that several processes can work on one database.
use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use thiserror::Error;

use super::Jobs;

/// Shard `index` of `count`: a range of consecutive jobs. Neighbouring jobs share the tables of
/// their grains, so few tables are made in more than one shard.
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

    /// Number of shards.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The numbers of its jobs. The ranges of all shards cover `jobs` without a gap. They begin and
    /// end with whole blocks of the slowest axes, if these can be shared out evenly.
    #[must_use]
    pub fn range(&self, jobs: &Jobs) -> Range<u64> {
        let mut block = jobs.count();
        for length in jobs.blocks() {
            let blocks = jobs.count() / block.max(1);
            if blocks.is_multiple_of(self.count) || blocks / 4 >= self.count {
                break;
            }
            block /= length;
        }
        let blocks = jobs.count() / block.max(1);
        let edge = |index: u64| {
            let passed = u128::from(blocks) * u128::from(index) / u128::from(self.count);
            passed as u64 * block
        };
        edge(self.index)..edge(self.index + 1)
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
