//! A TOML file read with the place of every key, so that any later finding can
//! name its line.
use std::collections::BTreeMap;
use std::io::Read;
use std::ops::Range;
use std::path::Path;

use serde::de::DeserializeOwned;
use serde_json::Value;
use toml::de::DeTable;

use super::check;
use super::error::{At, ConfigError, Problem};
use super::former;

/// Longest config file read, bytes.
const MAX_BYTES: u64 = 1 << 20;
/// Longest value or line quoted in a message, characters.
const MAX_QUOTED: usize = 60;

/// Where a key and its value stand in the text.
pub(super) struct Place {
    pub(super) key: Range<usize>,
    pub(super) value: Range<usize>,
    /// Tables and long lists are not quoted in messages.
    pub(super) quotable: bool,
}

/// A file's text and the places of its keys, by dotted path.
pub(super) struct Document<'t> {
    file: &'t str,
    text: &'t str,
    pub(super) places: BTreeMap<String, Place>,
}

/// The text of a config file.
///
/// # Errors
/// [`Problem::Read`] also for what is not UTF-8 or longer than 1 MiB.
pub(super) fn read_text(path: &Path) -> Result<String, ConfigError> {
    let refuse = |reason: String, help: &str| {
        ConfigError::new(At {
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
        return Err(refuse(reason, "this is no config file"));
    }
    Ok(text)
}

impl<'t> Document<'t> {
    /// Parses `text`, checks it against the schema of `Keys` and reads those.
    pub(super) fn read<Keys: DeserializeOwned>(
        file: &'t str,
        text: &'t str,
        schema: &Value,
    ) -> Result<(Self, Keys), ConfigError> {
        let mut document = Self {
            file,
            text,
            places: BTreeMap::new(),
        };
        let (mut root, errors) = DeTable::parse_recoverable(text);
        former::rename("", root.get_mut());
        if let Some(error) = errors.first() {
            // Half a document still tells the path of a key given twice.
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
        let line_of = self.line_at(span.start);
        let mut at = At {
            file: self.file.to_owned(),
            line: Some(line_of),
            key: String::new(),
            value: None,
            problem: Problem::Syntax(shorten(error.message())),
            help: String::new(),
        };
        if error.message() == "duplicate key" {
            at.key = self.path_of_repeated(&span);
            at.problem = Problem::Duplicate;
            at.help = "keep one of them".to_owned();
        } else if let Some(line) = self.text.lines().nth(line_of - 1) {
            at.help = format!("the line reads: {}", shorten(line.trim()));
        }
        ConfigError::new(at)
    }

    /// The dotted path of the key at `span`: that of the nearest key of the
    /// same name before it, which is the one it repeats.
    fn path_of_repeated(&self, span: &Range<usize>) -> String {
        let name = self.text.get(span.clone()).unwrap_or_default();
        let same =
            |path: &str| path.rsplit('.').next().and_then(|p| p.split('[').next()) == Some(name);
        self.places
            .iter()
            .filter(|(path, place)| place.key.start <= span.start && same(path))
            .max_by_key(|(_, place)| place.key.start)
            .map_or(shorten(name), |(path, _)| path.clone())
    }

    fn line_at(&self, offset: usize) -> usize {
        let before = self.text.as_bytes().iter().take(offset);
        1 + before.filter(|&&b| b == b'\n').count()
    }

    pub(super) fn file(&self) -> &str {
        self.file
    }

    /// Line of a key, or of the nearest table around it.
    pub(super) fn line(&self, key: &str) -> Option<usize> {
        let mut key = key;
        loop {
            if let Some(place) = self.places.get(key) {
                return Some(self.line_at(place.key.start));
            }
            key = &key[..key.rfind(['.', '['])?];
        }
    }

    /// Whether a key is given.
    pub(super) fn has(&self, key: &str) -> bool {
        self.places.contains_key(key)
    }

    /// A refusal of `key`, with its line and its value as written.
    pub(super) fn error(
        &self,
        key: &str,
        problem: Problem,
        help: impl Into<String>,
    ) -> ConfigError {
        let place = self.places.get(key).filter(|p| p.quotable);
        let value = place.and_then(|p| self.text.get(p.value.clone()));
        ConfigError::new(At {
            file: self.file.to_owned(),
            line: self.line(key),
            key: key.to_owned(),
            value: value.map(shorten),
            problem,
            // descriptions of keys may have several lines
            help: help.into().replace('\n', " "),
        })
    }

    /// A remark on `key` in the form of the errors.
    pub(super) fn warning(&self, key: &str, remark: String) -> String {
        let problem = Problem::Contradiction(remark);
        self.error(key, problem, "").to_string()
    }
}

/// At most [`MAX_QUOTED`] characters of the first line.
pub(super) fn shorten(text: &str) -> String {
    let line = text.lines().next().unwrap_or_default();
    let mut short: String = line.chars().take(MAX_QUOTED).collect();
    if short.len() < text.len() {
        short.push_str("...");
    }
    short
}
