//! Tables of BRDFs, as CSV and as text.
use std::fmt::Write;

use super::super::ReportError;
use crate::lab::study::Brdfs;
use crate::measurement::Measured;

/// The drawn values as CSV (docs/formats.md).
pub(super) fn csv(studied: &Brdfs<'_>) -> Result<Vec<u8>, ReportError> {
    let sensors = &studied.sensors;
    let drawn = if studied.draw.hemisphere {
        let centre = |sensor| (sensor, sensors.centre_rad(sensor));
        (0..sensors.len()).map(centre).collect()
    } else {
        sensors.principal_plane()
    };
    let mut out = ::csv::Writer::from_writer(Vec::new());
    out.write_record([
        "group",
        "variant",
        "polar_deg",
        "azimuth_deg",
        "brdf",
        "brdf_se",
    ])?;
    for (variant, exits) in studied.variants() {
        for (sensor, angles) in &drawn {
            let Measured { value, se } = exits.reflected.get(*sensor).copied().unwrap_or_default();
            let [polar, azimuth] = angles.map(|rad| format!("{:.2}", rad.to_degrees()));
            let (value, se) = (format!("{value:.6}"), format!("{se:.1e}"));
            out.write_record([
                &variant.group,
                &variant.label,
                &polar,
                &azimuth,
                &value,
                &se,
            ])?;
        }
    }
    let bytes = out.into_inner().map_err(|error| error.into_error());
    Ok(bytes.map_err(::csv::Error::from)?)
}

/// Maxima in the plane of incidence and the nadir value of every variant, as text.
pub(super) fn table(studied: &Brdfs<'_>) -> String {
    let title = &studied.study.title;
    let mut out = format!("{title}: BRDF in the plane of incidence, 1/sr\n");
    for (variant, exits) in studied.variants() {
        let features = studied.features(exits);
        let name = format!("{} {}", variant.group, variant.label);
        let value = |m: Measured| format!("{:.4} ({:.4})", m.value, m.se);
        let peak = |(degrees, m): (f64, Measured)| format!("{} at {degrees:.0}", value(m));
        let _ = writeln!(
            out,
            "  {:<34} nadir {}  forward {}  backward {}  forward/nadir {}  R {}",
            name.trim(),
            value(features.nadir),
            peak(features.forward),
            peak(features.backward),
            value(features.contrast()),
            value(exits.reflectance),
        );
    }
    out
}
