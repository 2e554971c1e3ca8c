//! A parsed TOML file that records the position of every key, so that later errors and
//! warnings can name the line.
use std::collections::BTreeMap;
use std::io::Read;
use std::ops::Range;
use std::path::Path;

use serde::de::DeserializeOwned;
use serde_json::Value;
use toml::de::DeTable;

use super::check;
use super::error::{ConfigError, Details, Problem};
use super::former;

/// Largest size of a config file, bytes.
const MAX_BYTES: u64 = 1 << 20;
/// Longest quotation of a value or a line in a message, characters.
const MAX_QUOTED: usize = 60;

/// Byte ranges of a key and its value in the text.
pub(super) struct KeySpan {
    pub(super) key: Range<usize>,
    pub(super) value: Range<usize>,
    /// Whether messages quote the value: true unless it is a table or a list.
    pub(super) quotable: bool,
}

/// A file's text and the byte ranges of its keys, by dotted path.
pub(super) struct Document<'t> {
    file: &'t str,
    text: &'t str,
    pub(super) spans: BTreeMap<String, KeySpan>,
}

/// Reads the text of a config file.
///
/// # Errors
/// [`Problem::Read`] if the file cannot be read, is not UTF-8, or is longer than 1 MiB.
pub(super) fn read_text(path: &Path) -> Result<String, ConfigError> {
    let refuse = |reason: String, help: &str| {
        ConfigError::new(Details {
            file: path.display().to_string(),
            line: None,
            key: String::new(),
            value: None,
            problem: Problem::Read(reason),
            help: help.to_owned(),
        })
    };
    let mut text = String::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(MAX_BYTES + 1).read_to_string(&mut text))
        .map_err(|e| refuse(e.to_string(), "give the path of a TOML file"))?;
    if text.len() as u64 > MAX_BYTES {
        let reason = format!("longer than {MAX_BYTES} bytes");
        return Err(refuse(reason, "a config file may have 1 MiB at most"));
    }
    Ok(text)
}

impl<'t> Document<'t> {
    /// Parses `text`, checks it against `schema`, and deserialises its `Keys`.
    ///
    /// # Errors
    /// `text` is not valid TOML, or it does not match the schema.
    pub(super) fn read<Keys: DeserializeOwned>(
        file: &'t str,
        text: &'t str,
        schema: &Value,
    ) -> Result<(Self, Keys), ConfigError> {
        let mut document = Self {
            file,
            text,
            spans: BTreeMap::new(),
        };
        let (mut root, errors) = DeTable::parse_recoverable(text);
        former::rename("", root.get_mut());
        if let Some(error) = errors.first() {
            // The part that was parsed gives the path of a duplicate key.
            let _ = check::table(&mut document, schema, "", root.get_ref());
            return Err(document.not_toml(error));
        }
        check::table(&mut document, schema, "", root.get_ref())?;
        let keys = Keys::deserialize(toml::Deserializer::from(root))
            .map_err(|error| document.not_toml(&error))?;
        Ok((document, keys))
    }

    fn not_toml(&self, error: &toml::de::Error) -> ConfigError {
        let span = error.span().unwrap_or(0..0);
        let line_number = self.line_at(span.start);
        let mut details = Details {
            file: self.file.to_owned(),
            line: Some(line_number),
            key: String::new(),
            value: None,
            problem: Problem::Syntax(shorten(error.message())),
            help: String::new(),
        };
        if error.message() == "duplicate key" {
            details.key = self.path_of_duplicate(&span);
            details.problem = Problem::Duplicate;
            details.help = "delete one of the two".to_owned();
        } else if let Some(line) = self.text.lines().nth(line_number - 1) {
            details.help = format!("correct the line, which reads: {}", shorten(line.trim()));
        }
        ConfigError::new(details)
    }

    /// The dotted path of the duplicate key at `span`: the path of the nearest
    /// preceding key with the same name.
    fn path_of_duplicate(&self, span: &Range<usize>) -> String {
        let name = self.text.get(span.clone()).unwrap_or_default();
        let has_name =
            |path: &str| path.rsplit('.').next().and_then(|p| p.split('[').next()) == Some(name);
        self.spans
            .iter()
            .filter(|(path, other)| other.key.start <= span.start && has_name(path))
            .max_by_key(|(_, other)| other.key.start)
            .map_or(shorten(name), |(path, _)| path.clone())
    }

    fn line_at(&self, offset: usize) -> usize {
        let preceding = self.text.as_bytes().iter().take(offset);
        1 + preceding.filter(|&&b| b == b'\n').count()
    }

    pub(super) fn file(&self) -> &str {
        self.file
    }

    /// Line of a key, or of the innermost table around it that is in the file.
    pub(super) fn line(&self, key: &str) -> Option<usize> {
        let mut key = key;
        loop {
            if let Some(span) = self.spans.get(key) {
                return Some(self.line_at(span.key.start));
            }
            key = &key[..key.rfind(['.', '['])?];
        }
    }

    /// Whether the file has a key.
    pub(super) fn has(&self, key: &str) -> bool {
        self.spans.contains_key(key)
    }

    /// An error about `key`, with its line and its value as written.
    pub(super) fn error(
        &self,
        key: &str,
        problem: Problem,
        help: impl Into<String>,
    ) -> ConfigError {
        let span = self.spans.get(key).filter(|span| span.quotable);
        let value = span.and_then(|span| self.text.get(span.value.clone()));
        ConfigError::new(Details {
            file: self.file.to_owned(),
            line: self.line(key),
            key: key.to_owned(),
            value: value.map(shorten),
            problem,
            // descriptions of keys may span several lines
            help: help.into().replace('\n', " "),
        })
    }

    /// A warning about `key`, in the format of the errors.
    pub(super) fn warning(&self, key: &str, remark: String) -> String {
        let problem = Problem::Contradiction(remark);
        self.error(key, problem, "").to_string()
    }
}

/// The first line of `text`, shortened to [`MAX_QUOTED`] characters.
pub(super) fn shorten(text: &str) -> String {
    let line = text.lines().next().unwrap_or_default();
    let mut short: String = line.chars().take(MAX_QUOTED).collect();
    if short.len() < text.len() {
        short.push_str("...");
    }
    short
}
