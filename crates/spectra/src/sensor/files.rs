//! Tables of responses (docs/formats.md, "Sensors from files").
use serde::Deserialize;

use super::{SensorError, SpectralResponse};
use crate::spectrum::measured::{self, Content, ReadOptions};

/// Responses below 0 that count as 0: noise of a measurement, relative to the largest.
const NOISE: f64 = 0.05;

/// A row of a table with a row for each band or each point of a band.
#[derive(Deserialize)]
struct BandRow {
    band: String,
    wavelength_nm: Option<f64>,
    response: Option<f64>,
    #[serde(alias = "center_nm")]
    centre_nm: Option<f64>,
    fwhm_nm: Option<f64>,
    from_nm: Option<f64>,
    to_nm: Option<f64>,
}

/// The bands in the content of a file.
pub(super) fn bands(file: &str, bytes: &[u8]) -> Result<Vec<SpectralResponse>, SensorError> {
    let text = String::from_utf8_lossy(bytes);
    let text = text.trim_start_matches('\u{feff}');
    let is_header = |line: &&str| !(line.trim().is_empty() || line.starts_with('#'));
    let header = text.lines().find(is_header).unwrap_or_default();
    let separator = [b',', b';', b'\t']
        .into_iter()
        .find(|c| header.as_bytes().contains(c));
    let separator = separator.unwrap_or(b',');
    let first = header
        .split(char::from(separator))
        .next()
        .unwrap_or_default();
    let first = first.trim().trim_matches('"');
    // the other reader also refuses what is too long
    match first.eq_ignore_ascii_case("band") && bytes.len() as u64 <= measured::MAX_BYTES {
        true => by_rows(file, text, separator),
        false => by_columns(file, bytes),
    }
}

/// A table with a column of names, `band`.
fn by_rows(file: &str, text: &str, separator: u8) -> Result<Vec<SpectralResponse>, SensorError> {
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .delimiter(separator)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    if let Ok(names) = reader.headers() {
        let names = names.iter().map(str::to_lowercase).collect();
        reader.set_headers(names);
    }
    let mut bands = Vec::new();
    // name and points of the band that is being read
    let mut open: Option<(String, Vec<f64>, Vec<f64>)> = None;
    let close = |open: &mut Option<(String, Vec<f64>, Vec<f64>)>| {
        let (name, nm, response) = open.take()?;
        Some(SpectralResponse::new(&name, &nm, &response))
    };
    let malformed = |line, reason| SensorError::malformed(file, line, reason);
    for row in reader.deserialize::<BandRow>() {
        let row = row.map_err(|error| {
            let line = error.position().map(csv::Position::line);
            let reason = match error.kind() {
                csv::ErrorKind::Deserialize { err, .. } => err.to_string(),
                _ => error.to_string(),
            };
            malformed(line, reason)
        })?;
        if open.as_ref().is_some_and(|(name, ..)| *name != row.band) {
            let band = close(&mut open).transpose();
            bands.extend(band.map_err(|reason| malformed(None, reason))?);
        }
        let BandRow { band, .. } = &row;
        let made = match row {
            BandRow {
                wavelength_nm: Some(nm),
                response: Some(response),
                ..
            } => {
                let (_, nms, responses) =
                    open.get_or_insert_with(|| (band.clone(), Vec::new(), Vec::new()));
                nms.push(nm);
                responses.push(response);
                continue;
            }
            BandRow {
                centre_nm: Some(centre),
                fwhm_nm: Some(fwhm),
                ..
            } => SpectralResponse::gaussian(band, centre, fwhm),
            BandRow {
                from_nm: Some(from),
                to_nm: Some(to),
                ..
            } => SpectralResponse::rectangle(band, from, to),
            _ => Err(format!("the band `{band}` has a row without its numbers")),
        };
        bands.push(made.map_err(|reason| malformed(None, reason))?);
    }
    let band = close(&mut open).transpose();
    bands.extend(band.map_err(|reason| malformed(None, reason))?);
    Ok(bands)
}

/// A table with a column of wavelengths and a column for each band.
fn by_columns(file: &str, bytes: &[u8]) -> Result<Vec<SpectralResponse>, SensorError> {
    let request = ReadOptions::new(Some(Content::Power), (-NOISE, f64::INFINITY));
    let curves = measured::parse_all(file, bytes, &request)?;
    let band = |curve: measured::Curve| {
        let name = match curve.report.name {
            name if name.is_empty() => format!("column{}", curve.report.column),
            name => name,
        };
        let rows = curve.samples.iter().map(|row| (row.nm, row.value.max(0.0)));
        let (nm, response): (Vec<f64>, Vec<f64>) = rows.unzip();
        let band = SpectralResponse::new(&name, &nm, &response);
        band.map_err(|reason| SensorError::malformed(file, None, reason))
    };
    curves.into_iter().map(band).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Name, range and mean wavelength of a band.
    type Summary = (String, (f64, f64), f64);

    fn read(text: &str) -> Result<Vec<Summary>, String> {
        let bands = bands("s.csv", text.as_bytes()).map_err(|error| error.to_string())?;
        let of =
            |band: &SpectralResponse| (band.name().to_owned(), band.range_nm(), band.centre_nm());
        Ok(bands.iter().map(of).collect())
    }

    #[test]
    fn all_layouts_give_the_same_bands() {
        let expected = vec![
            ("1".to_owned(), (400.0, 420.0), 410.0),
            ("2".to_owned(), (430.0, 440.0), 435.0),
        ];
        for text in [
            "band,wavelength_nm,response\n1,400,0\n1,410,2\n1,420,0\n2,430,1\n2,440,1\n",
            "\u{feff}# mine\nband;wavelength_nm;response\n1;400;0\n1;410;2\n1;420;0\n2;430;1\n2;440;1\n",
            "nm,1,2\n390,0,\n400,0,\n410,2,\n420,0,\n430,0,1\n440,0,1\n",
            "Wavelength (um)\t1\tnote\t2\n0,39\t0\tx\t\n0,40\t0\tx\t\n0,41\t2\tx\t\n0,42\t-0,001\tx\t\n0,43\t0\tx\t1\n0,44\t0\tx\t1\n",
        ] {
            assert_eq!(read(text), Ok(expected.clone()), "{text}");
        }
        let forms =
            read("band,centre_nm,fwhm_nm,from_nm,to_nm\ng,500,10,,\nr,,,600,620\n").unwrap();
        assert_eq!(forms[1], ("r".to_owned(), (600.0, 620.0), 610.0));
        assert!((forms[0].2 - 500.0).abs() < 1e-9);
    }

    #[test]
    fn wrong_tables_are_refused_with_place_and_reason() {
        for (text, part) in [
            ("", "no row with a wavelength and a value"),
            ("hello\n", "no row with a wavelength and a value"),
            ("band,wavelength_nm,response\n", "it has no band"),
            ("band,centre_nm,fwhm_nm\nB1,500,wide\n", "s.csv:2: "),
            ("band,centre_nm,fwhm_nm\nB1,500\n", "s.csv:2: "),
            ("band,centre_nm,fwhm_nm\nB1,500,-3\n", "the band `B1` needs"),
            (
                "band,centre_nm\nB1,500\n",
                "`B1` has a row without its numbers",
            ),
            (
                "band,wavelength_nm,response\nB1,500,1\nB1,490,1\n",
                "increasing",
            ),
            (
                "band,wavelength_nm,response\nB1,500,1\nB1,510,NaN\n",
                "a response of NaN",
            ),
            (
                "band,from_nm,to_nm\nB1,500,510\nB1,520,530\n",
                "two bands have the name `B1`",
            ),
            ("band,from_nm,to_nm\n,500,510\n", "needs a name"),
            ("nm,B1\n500,0\n510,0\n", "`B1` has no response above 0"),
            ("nm,B1\n500,-3\n510,-2\n", "not a valid relative power"),
        ] {
            let error = super::super::Sensor::parse("s.csv", text.as_bytes()).unwrap_err();
            let message = error.to_string();
            assert!(message.contains(part), "{text}: {message}");
            assert!(message.starts_with("s.csv"), "{message}");
        }
    }
}
