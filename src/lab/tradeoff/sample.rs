//! The snow samples on the chart.
use std::path::Path;

use crate::config::ConfigError;
use crate::config::sample::{self, SampleFile};

use super::TradeoffError;

/// The samples of `configs/tradeoff`: names and contents of the files.
const DEFAULTS: [(&str, &str); 5] = [
    (
        "dry_12cm",
        include_str!("../../../configs/tradeoff/dry_12cm.toml"),
    ),
    (
        "dry_1cm",
        include_str!("../../../configs/tradeoff/dry_1cm.toml"),
    ),
    (
        "fine_dense",
        include_str!("../../../configs/tradeoff/fine_dense.toml"),
    ),
    (
        "coarse_60deg",
        include_str!("../../../configs/tradeoff/coarse_60deg.toml"),
    ),
    (
        "wet_5cm",
        include_str!("../../../configs/tradeoff/wet_5cm.toml"),
    ),
];

/// A named sample: a slab of snow and its illumination.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedSample {
    /// The file name without directory and extension.
    pub name: String,
    /// Snow, thickness, illumination and model; the wavelengths are not used.
    pub file: SampleFile,
}

impl NamedSample {
    /// The samples of `configs/tradeoff`: thick, thin, fine, coarse and oblique, wet.
    ///
    /// # Errors
    /// [`ConfigError`] only if these built-in files are invalid.
    pub fn defaults() -> Result<Vec<Self>, ConfigError> {
        let parse = |(name, text): (&str, &str)| {
            let file = sample::parse(&format!("configs/tradeoff/{name}.toml"), text)?;
            Ok(Self {
                name: name.into(),
                file,
            })
        };
        DEFAULTS.into_iter().map(parse).collect()
    }

    /// The samples in the files at `paths`.
    ///
    /// # Errors
    /// If a file cannot be read or is invalid, or two files have the same name.
    pub fn read(paths: &[impl AsRef<Path>]) -> Result<Vec<Self>, TradeoffError> {
        let mut samples: Vec<Self> = Vec::new();
        for path in paths {
            let path = path.as_ref();
            let file = sample::read(path)?;
            let stem = path.file_stem().unwrap_or_default();
            let name = stem.to_string_lossy().into_owned();
            if samples.iter().any(|sample| sample.name == name) {
                return Err(TradeoffError::SameName { name });
            }
            samples.push(Self { name, file });
        }
        Ok(samples)
    }
}
