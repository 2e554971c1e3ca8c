//! The instruction set in use: the best of the processor, or the one asked for.
use std::fmt;
use std::sync::OnceLock;

/// The environment variable that asks for a level.
const VARIABLE: &str = "SPLITSNOW_SIMD";

/// A set of instructions for which the kernels are compiled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// What every processor of the target has, without instructions of our choice.
    Portable,
    /// x86-64-v1: SSE2.
    V1,
    /// x86-64-v3: AVX2. Fused operations are not used.
    V3,
    /// x86-64-v4: AVX-512.
    V4,
    /// NEON, which every aarch64 processor has.
    Neon,
}

impl Level {
    /// All levels, the simplest first.
    pub const ALL: [Self; 5] = [Self::Portable, Self::Neon, Self::V1, Self::V3, Self::V4];

    /// The name in `SPLITSNOW_SIMD`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            Self::V1 => "v1",
            Self::V3 => "v3",
            Self::V4 => "v4",
            Self::Neon => "neon",
        }
    }

    /// Whether this program has the level and the processor its instructions.
    #[must_use]
    pub fn is_supported(self) -> bool {
        match self {
            Self::Portable => !cfg!(any(target_arch = "x86_64", target_arch = "aarch64")),
            Self::Neon => cfg!(target_arch = "aarch64"),
            #[cfg(target_arch = "x86_64")]
            Self::V1 | Self::V3 | Self::V4 => super::x86::has(self),
            #[cfg(not(target_arch = "x86_64"))]
            Self::V1 | Self::V3 | Self::V4 => false,
        }
    }

    /// The levels that this processor supports, the simplest first.
    pub fn supported() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|level| level.is_supported())
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// `SPLITSNOW_SIMD` asks for a level that is unknown, or that the processor does not support.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LevelError {
    asked: String,
}

impl fmt::Display for LevelError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let names: Vec<_> = Level::supported().map(Level::name).collect();
        write!(
            f,
            "{VARIABLE} = {:?} is not an instruction set of this processor, which supports: {}; set it to one of these, or unset it",
            self.asked,
            names.join(", ")
        )
    }
}

impl std::error::Error for LevelError {}

/// The best level of the processor.
fn best() -> Level {
    Level::supported().last().unwrap_or(Level::Portable)
}

/// The level of this name, if the processor supports it; the best one for an empty name.
fn named(name: &str) -> Result<Level, LevelError> {
    if name.is_empty() {
        return Ok(best());
    }
    let mut levels = Level::supported();
    levels
        .find(|level| level.name() == name)
        .ok_or_else(|| LevelError { asked: name.into() })
}

/// The level that `SPLITSNOW_SIMD` asks for; the best one where the variable is not set.
///
/// # Errors
/// The variable names no level that the processor supports. Programs should say so and end;
/// [`dispatch`](super::dispatch) uses the best level then.
pub fn requested() -> Result<Level, LevelError> {
    let value = std::env::var_os(VARIABLE).unwrap_or_default();
    named(&value.to_string_lossy())
}

/// The level in use, which does not change while the program runs: what [`requested`]
/// says at the first call, or the best level if that is an error.
#[inline]
#[must_use]
pub fn level() -> Level {
    static LEVEL: OnceLock<Level> = OnceLock::new();
    *LEVEL.get_or_init(|| requested().unwrap_or_else(|_| best()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_supported_levels() {
        assert_eq!(named(""), Ok(best()));
        for level in Level::ALL {
            assert_eq!(named(level.name()).is_ok(), level.is_supported());
        }
        let message = named("avx9000").map_err(|error| error.to_string());
        let message = message.err().unwrap_or_default();
        assert!(message.contains("avx9000") && message.contains(best().name()));
        assert!(level().is_supported());
    }
}
