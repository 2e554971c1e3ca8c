//! The CIE 1931 observer under an illuminant, as weights per wavelength.
use crate::spectrum::{Table, TableError};

/// First and last wavelength of the table of the observer, nm.
pub(super) const RANGE_NM: (f64, f64) = (360.0, 830.0);

/// Wavelengths of the table of the observer, nm, up to the end of the illuminants (780 nm).
pub(super) fn every_5_nm() -> Vec<f64> {
    (72..=156).map(|i| f64::from(i) * 5.0).collect()
}

fn observer() -> Result<Table, TableError> {
    Table::parse(
        "cie_1931_2deg",
        include_str!("../../data/cie_1931_2deg.csv"),
        &["wavelength_nm", "xbar", "ybar", "zbar"],
    )
}

/// Trapezoid weights `[3][l]` (X, Y, Z; arbitrary scale) at `wavelengths_nm`
/// (strictly increasing); zero where either table has no value.
pub(super) fn weights(
    wavelengths_nm: &[f64],
    illuminant: &Table,
) -> Result<[Vec<f64>; 3], TableError> {
    let observer = observer()?;
    let low = observer.range().0.max(illuminant.range().0);
    let high = observer.range().1.min(illuminant.range().1);
    let begin = wavelengths_nm.partition_point(|&w| w < low);
    let end = wavelengths_nm.partition_point(|&w| w <= high);
    let inside = wavelengths_nm.get(begin..end).unwrap_or(&[]);

    let mut weights = [0, 1, 2].map(|_| vec![0.0; wavelengths_nm.len()]);
    for (i, &wavelength) in inside.iter().enumerate() {
        let left = if i == 0 { wavelength } else { inside[i - 1] };
        let right = inside.get(i + 1).copied().unwrap_or(wavelength);
        let power = illuminant.linear(0, wavelength).unwrap_or(0.0);
        for (column, values) in weights.iter_mut().enumerate() {
            let seen = observer.linear(column, wavelength).unwrap_or(0.0);
            values[begin + i] = (right - left) / 2.0 * power * seen;
        }
    }
    Ok(weights)
}

/// Whether X, Y and Z of white under an illuminant are finite and above 0.
pub(super) fn sees_white(illuminant: &Table) -> bool {
    let mut nm = every_5_nm();
    // include the emission lines of lamps between these wavelengths
    nm.extend(illuminant.abscissae());
    nm.sort_by(f64::total_cmp);
    nm.dedup();
    weights(&nm, illuminant).is_ok_and(|weights| {
        let mut sums = weights.iter().map(|weights| weights.iter().sum::<f64>());
        sums.all(|sum| sum > 0.0 && sum.is_finite())
    })
}
