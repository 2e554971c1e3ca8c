//! The largest requests that are answered.
use super::refused::Refused;

/// The largest requests that are answered, so that nobody waits for hours by accident, or makes
/// others wait.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Walks per index node.
    pub rays: u64,
    /// Wavelengths of a sample.
    pub wavelengths: usize,
    /// Layers of a sample.
    pub layers: usize,
    /// Grain types of a layer.
    pub grains: usize,
    /// Other absorbers of a layer.
    pub absorbers: usize,
    /// Views toward which light is measured.
    pub views: usize,
    /// Thicknesses of a wedge.
    pub thicknesses: usize,
    /// Spectra of a request for colours.
    pub spectra: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            rays: 1 << 20,
            wavelengths: 2200,
            layers: 20,
            grains: 10,
            absorbers: 20,
            views: 1000,
            thicknesses: 200,
            spectra: 1000,
        }
    }
}

/// Refuses a `value` above `most`; `what` names it.
pub(super) fn check(
    what: &str,
    value: impl Into<u64>,
    most: impl Into<u64>,
) -> Result<(), Refused> {
    let (value, most) = (value.into(), most.into());
    if value <= most {
        return Ok(());
    }
    Err(Refused::new(format!(
        "{value} {what} are more than the {most} that the page computes; ask for fewer, or use the program `splitsnow`"
    )))
}
