//! What the spectra of a compact file look like, as patches of colour.
use crate::lab::report::{Swatch, SwatchRows, Swatches};
use crate::lookup::{Database, Lookup};
use crate::measurement::Quantity;
use crate::parameter::{Parameter, Point};

use super::ExportError;
use super::observers::{LIGHTS, LUMINANCE, Observers, Sampling};

/// Most columns of a picture.
const COLUMNS: usize = 12;

/// The nodes, or [`COLUMNS`] of them, the first and the last among these.
fn some(nodes: &[f64]) -> Vec<f64> {
    let columns = nodes.len().min(COLUMNS);
    let (last, steps) = (
        nodes.len().saturating_sub(1),
        columns.saturating_sub(1).max(1),
    );
    let there = (0..columns).filter_map(|i| nodes.get((i * last + steps / 2) / steps));
    there.copied().collect()
}

/// The colours of `database`, which has no optional axes any more ([`Database::at`]), at `at`
/// for each of its thicknesses (twelve of them if there are more), or at that of
/// `at` if `one`.
///
/// Rows are [`LIGHTS`]; a patch is seen by 31 wavelengths on the left and by three on
/// the right.
///
/// # Errors
/// [`ExportError::Lookup`], [`ExportError::NoColour`].
pub fn thicknesses(
    database: &Database,
    quantity: Quantity,
    at: Point,
    one: bool,
    snow: String,
) -> Result<Swatches, ExportError> {
    let observers = Observers::new(database.wavelengths_nm())?;
    let lookup = Lookup::new(database, quantity)?;
    let nodes = database.axes().values(Parameter::Thickness);
    let all = if one {
        vec![at[Parameter::Thickness]]
    } else {
        let there = |cm: &f64| database.covers(at[Parameter::GrainSize], *cm);
        some(&nodes.iter().copied().filter(there).collect::<Vec<_>>())
    };
    let mut columns = Vec::new();
    let mut rows: Vec<_> = LIGHTS
        .map(|light| (light.name().to_owned(), Vec::new()))
        .into();
    for thickness_cm in all {
        let mut spectrum = vec![0.0; lookup.wavelengths()];
        lookup.spectrum(at.with(Parameter::Thickness, thickness_cm), &mut spectrum)?;
        let spectrum: Vec<f64> = spectrum.into_iter().map(f64::from).collect();
        let exposure = observers.exposure(&[&spectrum]);
        columns.push([format!("{thickness_cm} cm"), format!("× {exposure}")]);
        for (light, (_, swatches)) in rows.iter_mut().enumerate() {
            let colour = |by| observers.srgb(by, light, &spectrum, exposure);
            let pair = Sampling::ALL.map(|by| (by, spectrum.as_slice()));
            swatches.push(Swatch {
                colours: Sampling::ALL.map(colour).into(),
                words: format!("{:.2}", observers.difference(light, pair, 1.0)),
            });
        }
    }
    let what = match quantity {
        Quantity::Transmittance => "Light through snow",
        Quantity::Reflectance => "Light from snow",
    };
    Ok(Swatches {
        title: format!("{what}: {snow}"),
        remarks: vec![
            "patches: left 31 wavelengths, 400-700 nm by 10; right 3 wavelengths, 455, 551, 608 nm".into(),
            format!("×: exposure: a column is shown so many times brighter, to a luminance of {LUMINANCE}; the light itself is white, 1"),
            "numbers: ΔE*ab (CIE 1976) of left and right as they are, not exposed; CIE 1931 2-degree observer, clipped to sRGB".into(),
        ],
        columns,
        groups: vec![SwatchRows { heading: String::new(), rows }],
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::colour::{Colorimeter, Viewing};

    #[test]
    fn columns_are_spread_over_the_nodes() {
        assert_eq!(some(&[0.1]), [0.1]);
        assert_eq!(some(&[1.0, 2.0, 5.5]), [1.0, 2.0, 5.5]);
        let nodes: Vec<f64> = (0..30).map(f64::from).collect();
        let found = some(&nodes);
        assert_eq!((found.len(), found[0], found[11]), (12, 0.0, 29.0));
        assert!(
            found
                .windows(2)
                .all(|pair| (2.0..=3.0).contains(&(pair[1] - pair[0])))
        );
    }

    #[test]
    fn patches_are_what_a_colorimeter_sees() {
        let database = crate::export::table::tests::database();
        let conditions = Point::from([(Parameter::Temperature, -1.0)]);
        let there = database.at(conditions).unwrap();
        let at = Point::of_core([0.9, 300.0, 400.0, 5.0, 40.0]);
        let quantity = Quantity::Reflectance;
        let picture = |one| thicknesses(&there, quantity, at, one, "snow".into()).unwrap();
        let all = picture(false);
        assert_eq!(
            all.columns
                .iter()
                .map(|c| c[0].as_str())
                .collect::<Vec<_>>(),
            ["1 cm", "5 cm"]
        );
        assert_eq!(all.columns[1], picture(true).columns[0]);
        assert_eq!(
            all.groups[0].rows[3].1[1],
            picture(true).groups[0].rows[3].1[0]
        );

        let spectrum = there.spectrum(at, quantity).unwrap();
        let exposure: f64 = all.columns[1][1].replace("× ", "").parse().unwrap();
        for (name, swatches) in &all.groups[0].rows {
            let viewing = Viewing {
                illuminants: vec![name.parse().unwrap()],
                ..Viewing::default()
            };
            for (by, found) in Sampling::ALL.into_iter().zip(&swatches[1].colours) {
                let nm = by.wavelengths_nm();
                // the nodes are 100 nm apart
                let value = |nm: &f64| {
                    let i = (((nm - 400.0) / 100.0) as usize).min(2);
                    let share = (nm - 400.0) / 100.0 - i as f64;
                    let [a, b] = [spectrum[i], spectrum[i + 1]].map(f64::from);
                    exposure * (a + share * (b - a))
                };
                let values: Vec<f64> = nm.iter().map(value).collect();
                let eye = Colorimeter::viewing(&nm, &viewing).unwrap().unwrap();
                let expected = eye.srgb(&values);
                let apart = found.iter().zip(expected).map(|(f, e)| f.abs_diff(e)).max();
                assert!(apart <= Some(1), "{name}: {found:?} {expected:?}");
            }
        }
    }
}
