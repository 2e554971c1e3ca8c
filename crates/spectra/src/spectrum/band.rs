//! The wavelength bands for which errors are reported and bounded.
use serde::{Deserialize, Serialize};

/// A wavelength band.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Band {
    /// 350-400 nm.
    UvA,
    /// 400-780 nm.
    Visible,
    /// 780-1400 nm.
    IrA,
    /// 1400-2500 nm, the part of IR-B in use.
    IrB,
}

impl Band {
    /// All bands, by increasing wavelength.
    pub const ALL: [Self; 4] = [Self::UvA, Self::Visible, Self::IrA, Self::IrB];

    /// The name used in output and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::UvA => "uv_a",
            Self::Visible => "visible",
            Self::IrA => "ir_a",
            Self::IrB => "ir_b",
        }
    }

    /// First and last wavelength, nm.
    #[must_use]
    pub fn range_nm(self) -> (f64, f64) {
        match self {
            Self::UvA => (350.0, 400.0),
            Self::Visible => (400.0, 780.0),
            Self::IrA => (780.0, 1400.0),
            Self::IrB => (1400.0, 2500.0),
        }
    }

    /// Whether the band contains a wavelength, nm. The start is included; the end belongs
    /// to the next band, except 2500 nm, which belongs to the last.
    #[must_use]
    pub fn holds(self, nm: f64) -> bool {
        let (from, to) = self.range_nm();
        from <= nm && (nm < to || (self == Self::IrB && nm == to))
    }

    /// The band that contains a wavelength, nm; outside all bands, the nearest.
    #[must_use]
    pub fn containing(nm: f64) -> Self {
        let shorter = |band: &Self| nm < band.range_nm().1;
        Self::ALL.into_iter().find(shorter).unwrap_or(Self::IrB)
    }
}

#[cfg(test)]
mod tests {
    use super::Band;

    #[test]
    fn every_wavelength_has_one_band() {
        for nm in [350.0, 399.9, 400.0, 779.0, 780.0, 1400.0, 2499.0, 2500.0] {
            let held = Band::ALL.into_iter().filter(|band| band.holds(nm));
            assert_eq!(held.collect::<Vec<_>>(), [Band::containing(nm)], "{nm}");
        }
        assert!(Band::ALL.iter().all(|band| !band.holds(349.9)));
        assert!(Band::Visible.holds(400.0) && Band::IrA.holds(780.0) && Band::IrB.holds(1400.0));
        assert_eq!(
            [100.0, 3000.0].map(Band::containing),
            [Band::UvA, Band::IrB]
        );
    }

    #[test]
    fn the_serialised_name_is_the_name() {
        for band in Band::ALL {
            let json = serde_json::to_value(band).unwrap_or_default();
            assert_eq!(json, band.name());
        }
    }
}
