//! What a database and its compact file hold, in words.
use std::fmt::{self, Write};

use super::common;
use crate::build::{Compact, LargestError, QuantityReport};
use crate::measurement::Quantity;

/// The tables and a closing summary.
pub(super) struct Words<'a>(pub(super) &'a Compact);

impl fmt::Display for Words<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self(of) = self;
        let both = [
            (Quantity::Transmittance, &of.transmittance),
            (Quantity::Reflectance, &of.reflectance),
        ];
        let there = both
            .into_iter()
            .filter_map(|(quantity, report)| Some((quantity, report.as_ref()?)));
        for (quantity, report) in there.clone() {
            writeln!(f, "{}\n{}\n", quantity.name(), report.error_table)?;
        }
        writeln!(
            f,
            "database        {}: {} curves of {} wavelengths, {} on disk",
            of.database.display(),
            of.curves,
            of.wavelengths,
            common::bytes(of.database_bytes),
        )?;
        if of.absent_curves > 0 {
            writeln!(f, "absent          {}", of.why_absent)?;
        }
        writeln!(
            f,
            "compact file    {}: {}, {} basis, {}",
            of.compact.display(),
            common::bytes(of.compact_bytes),
            of.basis.name(),
            of.precision.name()
        )?;
        for (quantity, report) in there {
            writeln!(
                f,
                "{:<14}  {}, standard errors at most {:.5}",
                quantity.name(),
                errors(report),
                report.max_standard_error
            )?;
            lines(report, f)?;
        }
        if of.lost_share.max > 0.0 {
            writeln!(
                f,
                "lost rays       {:.4} % hit the event limit and count in no quantity (worst curve {:.4} %)",
                100.0 * of.lost_share.mean,
                100.0 * of.lost_share.max
            )?;
        }
        writeln!(f, "next            {}", of.next)?;
        match &of.diffuse {
            Some(diffuse) => write!(f, "\nunder isotropic light: {}", Words(diffuse)),
            None => Ok(()),
        }
    }
}

/// Largest errors with the components chosen.
fn errors(report: &QuantityReport) -> String {
    let plural = if report.components == 1 { "" } else { "s" };
    let mut text = format!("{} component{plural}", report.components);
    if report.bits.iter().any(|bits| *bits != 32) {
        let bits: Vec<_> = report.bits.iter().map(u32::to_string).collect();
        let _ = write!(text, " of {} bits", bits.join(", "));
    }
    if let Some(delta_e) = report.delta_e {
        let _ = write!(text, ", Delta-E at most {:.3}", delta_e.max);
    }
    if let Some(rmse) = report.rmse {
        let _ = write!(text, ", RMSE at most {:.5}", rmse.max);
    }
    text
}

/// Lines of the bands and the largest error, each after 16 columns.
fn lines(report: &QuantityReport, f: &mut fmt::Formatter) -> fmt::Result {
    let bands = report.bands.iter().map(|band| {
        let bound = band.max_rmse.map(|bound| format!(" < {bound}"));
        let (name, rmse) = (band.band.name(), band.rmse.max);
        format!("{name} {rmse:.5}{}", bound.unwrap_or_default())
    });
    let bands: Vec<_> = bands.collect();
    writeln!(f, "  RMSE in       {}", bands.join(", "))?;
    if let Some(LargestError { largest, at }) = &report.largest {
        writeln!(
            f,
            "  largest error {:.5} at {} nm: {at}",
            largest.error, largest.wavelength_nm
        )?;
    }
    Ok(())
}
