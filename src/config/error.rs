//! Errors in config files: what is wrong, where, and what to do.
use std::fmt;

use thiserror::Error;

/// An error in a config file. `Display` writes a line with file, line number, key, value
/// and allowed range, and, if there is help, a second line with it.
#[derive(Debug, Clone, PartialEq, Error)]
pub struct ConfigError {
    // Boxed, so that a `Result` stays small.
    details: Box<Details>,
}

/// The parts of the message of a [`ConfigError`].
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Details {
    pub(super) file: String,
    pub(super) line: Option<usize>,
    pub(super) key: String,
    pub(super) value: Option<String>,
    pub(super) problem: Problem,
    pub(super) help: String,
}

/// The kinds of error. Each message continues the text "`key` = value".
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Problem {
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Read(String),
    /// The text is not TOML.
    #[error("not valid TOML: {0}")]
    Syntax(String),
    /// A table has the same key twice.
    #[error("is given twice")]
    Duplicate,
    /// The key does not exist; holds a known key of similar spelling, if there is one.
    #[error("is not a known key{}", did_you_mean(.0.as_deref()))]
    UnknownKey(Option<String>),
    /// The value has the wrong TOML type.
    #[error("is {found}, expected {expected}")]
    WrongType {
        /// Type in the file.
        found: &'static str,
        /// Allowed type or types.
        expected: String,
    },
    /// A number or the length of a list is out of range; holds the allowed range.
    #[error("is out of range: allowed {0}")]
    OutOfRange(String),
    /// The value is not one of the allowed names.
    #[error("is not one of the choices{}: allowed {choices}", did_you_mean(.suggestion.as_deref()))]
    Choice {
        /// An allowed name of similar spelling, if there is one.
        suggestion: Option<String>,
        /// All allowed names, separated by commas.
        choices: String,
    },
    /// A required key is missing.
    #[error("is missing")]
    Missing,
    /// Two keys that exclude each other are both given.
    #[error("cannot be combined with `{other}`{}", .line.map_or(String::new(), |l| format!(" (line {l})")))]
    Conflict {
        /// The other key.
        other: String,
        /// Line of the other key.
        line: Option<usize>,
    },
    /// The value contradicts other values of the file, or a data file that it names.
    /// Holds the whole message.
    #[error("{0}")]
    Contradiction(String),
    /// The file format allows the value, but this version cannot simulate it; holds what
    /// it can simulate.
    #[error("is not supported: this version can simulate only {0}")]
    Unsupported(&'static str),
}

fn did_you_mean(suggestion: Option<&str>) -> String {
    suggestion.map_or(String::new(), |s| format!(" (did you mean `{s}`?)"))
}

impl ConfigError {
    pub(super) fn new(details: Details) -> Self {
        Self {
            details: Box::new(details),
        }
    }

    /// Attributes an error in a derived document to its source: to `line` of `file`,
    /// below its key `within`.
    pub(super) fn attributed_to(mut self, file: &str, line: Option<usize>, within: &str) -> Self {
        let key = std::mem::take(&mut self.details.key);
        self.details.file = file.to_owned();
        self.details.line = line;
        self.details.key = format!("{within}: {key}");
        self
    }

    /// The name of the file, as given by the caller.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.details.file
    }

    /// Line of the key, counted from 1; `None` if the error has no line.
    #[must_use]
    pub fn line(&self) -> Option<usize> {
        self.details.line
    }

    /// Dotted key such as `layer[0].grain[0].size_um.min`; empty for the whole file.
    #[must_use]
    pub fn key(&self) -> &str {
        &self.details.key
    }

    /// The kind of error.
    #[must_use]
    pub fn problem(&self) -> &Problem {
        &self.details.problem
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let details = &self.details;
        f.write_str(&details.file)?;
        if let Some(line) = details.line {
            write!(f, ":{line}")?;
        }
        f.write_str(": ")?;
        if !details.key.is_empty() {
            write!(f, "`{}` ", details.key)?;
        }
        if let Some(value) = &details.value {
            write!(f, "= {value} ")?;
        }
        write!(f, "{}", details.problem)?;
        if !details.help.is_empty() {
            write!(f, "\n  help: {}", details.help)?;
        }
        Ok(())
    }
}
