//! What is wrong with a config file, where, and what to do about it.
use std::fmt;

use thiserror::Error;

/// One refused key of a config file. `Display` gives one line with file, line,
/// key, value and what is allowed, and a second with help.
#[derive(Debug, Clone, PartialEq, Error)]
pub struct ConfigError {
    // Boxed, so that a `Result` stays small.
    at: Box<At>,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct At {
    pub(super) file: String,
    pub(super) line: Option<usize>,
    pub(super) key: String,
    pub(super) value: Option<String>,
    pub(super) problem: Problem,
    pub(super) help: String,
}

/// The kinds of refusal. Each reads on from the key and its value.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Problem {
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Read(String),
    /// The text is not TOML.
    #[error("not valid TOML: {0}")]
    Syntax(String),
    /// The same key twice in one table.
    #[error("is given twice")]
    Duplicate,
    /// No such key; the nearest known one, if any is near.
    #[error("is not a known key{}", did_you_mean(.0.as_deref()))]
    UnknownKey(Option<String>),
    /// Another TOML type is needed.
    #[error("is {found}, expected {expected}")]
    WrongType {
        /// Type in the file.
        found: &'static str,
        /// Type or types wanted.
        expected: String,
    },
    /// A number, or the length of a list, outside its limits.
    #[error("is out of range: allowed {0}")]
    OutOfRange(String),
    /// Not one of the named choices.
    #[error("is not one of the choices{}: allowed {choices}", did_you_mean(.suggestion.as_deref()))]
    Choice {
        /// The nearest choice, if any is near.
        suggestion: Option<String>,
        /// All choices, separated by commas.
        choices: String,
    },
    /// A required key is absent.
    #[error("is missing")]
    Missing,
    /// Two keys of which only one may be given.
    #[error("cannot stand beside `{other}`{}", .line.map_or(String::new(), |l| format!(" (line {l})")))]
    Conflict {
        /// The other key.
        other: String,
        /// Its line.
        line: Option<usize>,
    },
    /// The value contradicts others of the file, or a table it names.
    #[error("{0}")]
    Contradiction(String),
    /// Part of the file format, but not of what this version can compute.
    #[error("is not supported by this version, which computes {0}")]
    Unsupported(&'static str),
}

fn did_you_mean(suggestion: Option<&str>) -> String {
    suggestion.map_or(String::new(), |s| format!(" (did you mean `{s}`?)"))
}

impl ConfigError {
    pub(super) fn new(at: At) -> Self {
        Self { at: Box::new(at) }
    }

    /// The same finding in a document made from another, `file`, which is to blame at
    /// `line` below its key `within`.
    pub(super) fn blamed(mut self, file: &str, line: Option<usize>, within: &str) -> Self {
        let key = std::mem::take(&mut self.at.key);
        self.at.file = file.to_owned();
        self.at.line = line;
        self.at.key = format!("{within}: {key}");
        self
    }

    /// The file as it was named by the caller.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.at.file
    }

    /// Line of the key, from 1; `None` where no line is to blame.
    #[must_use]
    pub fn line(&self) -> Option<usize> {
        self.at.line
    }

    /// Dotted key such as `layer[0].grain[0].size_um.min`; empty for the whole file.
    #[must_use]
    pub fn key(&self) -> &str {
        &self.at.key
    }

    /// What is wrong.
    #[must_use]
    pub fn problem(&self) -> &Problem {
        &self.at.problem
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at = &self.at;
        f.write_str(&at.file)?;
        if let Some(line) = at.line {
            write!(f, ":{line}")?;
        }
        f.write_str(": ")?;
        if !at.key.is_empty() {
            write!(f, "`{}` ", at.key)?;
        }
        if let Some(value) = &at.value {
            write!(f, "= {value} ")?;
        }
        write!(f, "{}", at.problem)?;
        if !at.help.is_empty() {
            write!(f, "\n  help: {}", at.help)?;
        }
        Ok(())
    }
}
