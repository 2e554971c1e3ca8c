//! Refusals of requests.
use crate::config::ConfigError;
use crate::engine::EngineError;
use serde::Serialize;

/// The reason for which a request is refused, in one sentence or two.
#[derive(Debug, Serialize)]
pub(super) struct Refused {
    error: String,
    /// The key of the sample at fault.
    #[serde(skip_serializing_if = "Option::is_none")]
    key: Option<String>,
}

impl Refused {
    pub(super) fn new(error: impl ToString) -> Self {
        Self {
            error: error.to_string(),
            key: None,
        }
    }

    pub(super) fn at(key: &str, error: impl ToString) -> Self {
        Self {
            key: Some(key.to_owned()),
            ..Self::new(error)
        }
    }
}

impl From<ConfigError> for Refused {
    fn from(error: ConfigError) -> Self {
        match error.key() {
            "" => Self::new(&error),
            key => Self::at(key, &error),
        }
    }
}

impl From<EngineError> for Refused {
    fn from(error: EngineError) -> Self {
        Self::new(error)
    }
}

/// An answer as it is sent.
#[derive(Debug)]
pub(super) struct Reply {
    pub(super) json: String,
    pub(super) data: Vec<u8>,
}
