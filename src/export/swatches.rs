//! Patches of colour: the appearance of the spectra of a compact file.
use crate::lab::report::{Swatch, SwatchRows, Swatches};
use crate::lookup::{Database, Lookup};
use crate::measurement::Quantity;
use crate::parameter::{Parameter, Point};

use super::ExportError;
use super::observers::{LIGHTS, LUMINANCE, Observers, Sampling};

/// Largest number of columns in a picture.
const COLUMNS: usize = 12;

/// All nodes, or at most [`COLUMNS`] of them, evenly spread, with the first and the last.
fn select_nodes(nodes: &[f64]) -> Vec<f64> {
    let columns = nodes.len().min(COLUMNS);
    let (last, steps) = (
        nodes.len().saturating_sub(1),
        columns.saturating_sub(1).max(1),
    );
    let selected = (0..columns).filter_map(|i| nodes.get((i * last + steps / 2) / steps));
    selected.copied().collect()
}

/// The colours of `database` at `point`, for each thickness node (at most twelve), or for the
/// thickness of `point` if `one_thickness`. `database` must have no optional axes left
/// ([`Database::at`]). `snow` describes the snow in the title.
///
/// Each row is one of [`LIGHTS`]. The left half of a patch is computed from 31 wavelengths, the
/// right half from three.
///
/// # Errors
/// [`ExportError::Lookup`] if a look-up fails; [`ExportError::NoColour`] if the wavelengths do
/// not cover 400 to 700 nm.
pub fn thicknesses(
    database: &Database,
    quantity: Quantity,
    point: Point,
    one_thickness: bool,
    snow: String,
) -> Result<Swatches, ExportError> {
    let observers = Observers::new(database.wavelengths_nm())?;
    let lookup = Lookup::new(database, quantity)?;
    let nodes = database.axes().values(Parameter::Thickness);
    let thicknesses_cm = if one_thickness {
        vec![point[Parameter::Thickness]]
    } else {
        let is_covered = |cm: &f64| database.covers(point[Parameter::GrainSize], *cm);
        select_nodes(&nodes.iter().copied().filter(is_covered).collect::<Vec<_>>())
    };
    let mut columns = Vec::new();
    let mut rows: Vec<_> = LIGHTS
        .map(|light| (light.name().to_owned(), Vec::new()))
        .into();
    for thickness_cm in thicknesses_cm {
        let mut spectrum = vec![0.0; lookup.wavelengths()];
        lookup.spectrum(
            point.with(Parameter::Thickness, thickness_cm),
            &mut spectrum,
        )?;
        let spectrum: Vec<f64> = spectrum.into_iter().map(f64::from).collect();
        let exposure = observers.exposure(&[&spectrum]);
        columns.push([format!("{thickness_cm} cm"), format!("× {exposure}")]);
        for (light, (_, swatches)) in rows.iter_mut().enumerate() {
            let colour = |sampling| observers.srgb(sampling, light, &spectrum, exposure);
            let pair = Sampling::ALL.map(|sampling| (sampling, spectrum.as_slice()));
            swatches.push(Swatch {
                colours: Sampling::ALL.map(colour).into(),
                words: format!("{:.2}", observers.difference(light, pair, 1.0)),
            });
        }
    }
    let subject = match quantity {
        Quantity::Transmittance => "Light through snow",
        Quantity::Reflectance => "Light from snow",
    };
    Ok(Swatches {
        title: format!("{subject}: {snow}"),
        remarks: vec![
            "patches: left 31 wavelengths, 400-700 nm by 10; right 3 wavelengths, 455, 551, 608 nm".into(),
            format!("×: exposure, the factor by which a column is brightened, to a luminance of {LUMINANCE}; the light itself is white, 1"),
            "numbers: ΔE*ab (CIE 1976) between left and right without exposure; CIE 1931 2-degree observer, clipped to sRGB".into(),
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
        assert_eq!(select_nodes(&[0.1]), [0.1]);
        assert_eq!(select_nodes(&[1.0, 2.0, 5.5]), [1.0, 2.0, 5.5]);
        let nodes: Vec<f64> = (0..30).map(f64::from).collect();
        let found = select_nodes(&nodes);
        assert_eq!((found.len(), found[0], found[11]), (12, 0.0, 29.0));
        assert!(
            found
                .windows(2)
                .all(|pair| (2.0..=3.0).contains(&(pair[1] - pair[0])))
        );
    }

    #[test]
    fn patches_agree_with_a_colorimeter() {
        let database = crate::export::table::tests::database();
        let conditions = Point::from([(Parameter::Temperature, -1.0)]);
        let database_at = database.at(conditions).unwrap();
        let point = Point::from_core([0.9, 300.0, 400.0, 5.0, 40.0]);
        let quantity = Quantity::Reflectance;
        let picture = |one| thicknesses(&database_at, quantity, point, one, "snow".into()).unwrap();
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

        let spectrum = database_at.spectrum(point, quantity).unwrap();
        let exposure: f64 = all.columns[1][1].replace("× ", "").parse().unwrap();
        for (name, swatches) in &all.groups[0].rows {
            let viewing = Viewing {
                illuminants: vec![name.parse().unwrap()],
                ..Viewing::default()
            };
            for (sampling, found) in Sampling::ALL.into_iter().zip(&swatches[1].colours) {
                let nm = sampling.wavelengths_nm();
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
