//! The printed summary of a database and its compact file.
use std::fmt::{self, Write};

use super::common;
use crate::build::{CompactReport, LargestError, QuantityReport};
use crate::measurement::Quantity;

/// Prints the error tables and a closing summary.
pub(super) struct CompactSummary<'a>(pub(super) &'a CompactReport);

impl fmt::Display for CompactSummary<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self(summary) = self;
        let quantities = [
            (Quantity::Transmittance, &summary.transmittance),
            (Quantity::Reflectance, &summary.reflectance),
        ];
        let reports = quantities
            .into_iter()
            .filter_map(|(quantity, report)| Some((quantity, report.as_ref()?)));
        for (quantity, report) in reports.clone() {
            writeln!(f, "{}\n{}\n", quantity.name(), report.error_table)?;
        }
        writeln!(
            f,
            "database        {}: {} curves of {} wavelengths, {} on disk",
            summary.database.display(),
            summary.curves,
            summary.wavelengths,
            common::bytes(summary.database_bytes),
        )?;
        if summary.absent_curves > 0 {
            writeln!(f, "absent          {}", summary.why_absent)?;
        }
        writeln!(
            f,
            "compact file    {}: {}, {} basis, {}",
            summary.compact.display(),
            common::bytes(summary.compact_bytes),
            summary.basis.name(),
            summary.precision.name()
        )?;
        for (quantity, report) in reports {
            writeln!(
                f,
                "{:<14}  {}, standard errors at most {:.5}",
                quantity.name(),
                errors(report),
                report.max_standard_error
            )?;
            write_errors(report, f)?;
        }
        if summary.lost_share.max > 0.0 {
            writeln!(
                f,
                "lost rays       {:.4} % hit the event limit and count in no quantity (worst curve {:.4} %)",
                100.0 * summary.lost_share.mean,
                100.0 * summary.lost_share.max
            )?;
        }
        writeln!(f, "next            {}", summary.next)?;
        let parts = [
            (&summary.views, "anisotropy factors toward views"),
            (&summary.diffuse, "under isotropic light"),
        ];
        for (part, title) in parts {
            if let Some(part) = part {
                write!(f, "\n{title}: {}", CompactSummary(part))?;
            }
        }
        Ok(())
    }
}

/// The number of components, their bits and the largest errors.
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

/// Writes the errors by band and the largest error, each indented by 16 columns.
fn write_errors(report: &QuantityReport, f: &mut fmt::Formatter) -> fmt::Result {
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
