//! Patches of colour in rows and columns.
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::ReportError;
use super::canvas::{self, Area, DrawResult};
use super::style::{GREY, INK, SCALE, font, write};

/// Width left of the patches, as shown, pixels.
const LEFT: i32 = 84;
/// Width of a patch.
const PATCH: i32 = 96;
/// Width of the gap after a patch.
const GAP: i32 = 10;
/// Height of a patch.
const HEIGHT: i32 = 46;
/// Height of the text below a patch.
const WORDS: i32 = 22;
/// Height of the title.
const TITLE: i32 = 42;
/// Height of a remark.
const REMARK: i32 = 18;
/// Height of the headings of the columns.
const COLUMNS: i32 = 44;
/// Height of the heading of a group.
const GROUP: i32 = 30;
/// Width of a letter of a remark.
const LETTER: f64 = 6.6;
/// Width of a letter of the title.
const CAPITAL: f64 = 8.8;

/// A table of colour patches with remarks below.
#[derive(Debug, Clone, PartialEq)]
pub struct Swatches {
    /// The title above the table.
    pub title: String,
    /// Remarks below the table, one line each.
    pub remarks: Vec<String>,
    /// The two lines of text above each column.
    pub columns: Vec<[String; 2]>,
    /// The rows in groups.
    pub groups: Vec<SwatchRows>,
}

/// A group of rows with a heading, which may be empty.
#[derive(Debug, Clone, PartialEq)]
pub struct SwatchRows {
    /// The heading.
    pub heading: String,
    /// Name and patches of each row, one patch per column.
    pub rows: Vec<(String, Vec<Swatch>)>,
}

/// A patch: colours side by side without gaps, with a text below.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Swatch {
    /// Gamma-encoded sRGB, from left to right.
    pub colours: Vec<[u8; 3]>,
    /// Text below the patch.
    pub words: String,
}

impl Swatches {
    /// The table as the text of an SVG file.
    ///
    /// # Errors
    /// [`ReportError::Drawing`] if the table cannot be drawn.
    pub fn svg(&self) -> Result<String, ReportError> {
        canvas::svg((self.width(), self.height()), |area| self.draw(area)).map_err(failed)
    }

    /// The table as a PNG file.
    ///
    /// # Errors
    /// [`ReportError::Drawing`] if the table cannot be drawn.
    pub fn png(&self) -> Result<Vec<u8>, ReportError> {
        canvas::png((self.width(), self.height()), |area| self.draw(area)).map_err(failed)
    }

    /// Width of the picture as shown, pixels.
    fn width(&self) -> i32 {
        let letters = |text: &String, width: f64| (text.chars().count() as f64 * width) as i32;
        let remarks = self.remarks.iter().map(|text| letters(text, LETTER));
        let text = remarks.fold(letters(&self.title, CAPITAL), i32::max);
        let table = LEFT + self.columns.len() as i32 * (PATCH + GAP);
        table.max(text + GAP) + GAP
    }

    /// Height of the picture as shown, pixels.
    fn height(&self) -> i32 {
        let rows = |group: &SwatchRows| head(group) + group.rows.len() as i32 * (HEIGHT + WORDS);
        let groups: i32 = self.groups.iter().map(rows).sum();
        TITLE + COLUMNS + groups + self.remarks.len() as i32 * REMARK + GAP
    }

    /// Draws the table.
    fn draw(&self, area: &Area) -> DrawResult {
        let pixel = |x: i32, y: i32| (x * SCALE, y * SCALE);
        write(
            area,
            &self.title,
            pixel(GAP, TITLE / 2),
            font(16, &INK),
            HPos::Left,
        )?;
        for (lines, i) in self.columns.iter().zip(0..) {
            let x = left(i) + PATCH / 2;
            for (text, line) in lines.iter().zip([10, 28]) {
                let look = font(12, if line == 10 { &INK } else { &GREY });
                write(area, text, pixel(x, TITLE + line), look, HPos::Center)?;
            }
        }
        let mut y = TITLE + COLUMNS;
        for group in &self.groups {
            let start = pixel(GAP, y + GROUP / 2 - 2);
            write(area, &group.heading, start, font(13, &INK), HPos::Left)?;
            y += head(group);
            for (name, swatches) in &group.rows {
                let end = pixel(LEFT - GAP, y + HEIGHT / 2);
                write(area, name, end, font(13, &INK), HPos::Right)?;
                for (swatch, i) in swatches.iter().zip(0..) {
                    swatch.draw(area, (left(i), y))?;
                }
                y += HEIGHT + WORDS;
            }
        }
        for remark in &self.remarks {
            y += REMARK;
            write(
                area,
                remark,
                pixel(GAP, y - REMARK / 2),
                font(12, &GREY),
                HPos::Left,
            )?;
        }
        Ok(())
    }
}

/// A drawing error with this reason.
fn failed(reason: String) -> ReportError {
    ReportError::Drawing {
        chart: "the swatches",
        reason,
    }
}

/// The left edge of a column.
fn left(column: i32) -> i32 {
    LEFT + column * (PATCH + GAP)
}

/// Height of the heading of a group.
fn head(group: &SwatchRows) -> i32 {
    if group.heading.is_empty() { 0 } else { GROUP }
}

impl Swatch {
    /// Draws the patch with its upper left corner at `(x, y)`, pixels as shown.
    fn draw(&self, area: &Area, (x, y): (i32, i32)) -> DrawResult {
        let n = self.colours.len().max(1) as i32;
        for (&[r, g, b], i) in self.colours.iter().zip(0..) {
            let edge = |i: i32| (x + PATCH * i / n) * SCALE;
            let corners = [(edge(i), y * SCALE), (edge(i + 1), (y + HEIGHT) * SCALE)];
            area.draw(&Rectangle::new(corners, RGBColor(r, g, b).filled()))?;
        }
        let below = ((x + PATCH / 2) * SCALE, (y + HEIGHT + 9) * SCALE);
        write(area, &self.words, below, font(11, &INK), HPos::Center)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn pixels_have_the_requested_colours() {
        let colours = |i: u8| vec![[10 * i, 100 + i, 255], [i, 7, 80 - i]];
        let swatch = |i: u8| Swatch {
            colours: colours(i),
            words: format!("{i}"),
        };
        let row = |first: u8| {
            (
                format!("row {first}"),
                (0..3).map(|i| swatch(first + i)).collect(),
            )
        };
        let group = |heading: &str, first: u8| SwatchRows {
            heading: heading.into(),
            rows: vec![row(first), row(first + 3)],
        };
        let swatches = Swatches {
            title: "patches".into(),
            remarks: vec!["a remark".into()],
            columns: ["a", "b", "c"]
                .map(|name| [name.into(), "below".into()])
                .into(),
            groups: vec![group("", 0), group("second", 6)],
        };
        let png = swatches.png().unwrap();
        assert!(png.starts_with(b"\x89PNG\r\n\x1a\n"));
        let mut reader = png::Decoder::new(std::io::Cursor::new(png))
            .read_info()
            .unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        let (width, height) = (swatches.width(), swatches.height());
        assert_eq!((info.width, info.height), (width as u32, height as u32));
        let pixel = |x: i32, y: i32| &pixels[3 * (y * width + x) as usize..][..3];
        for number in 0..12_i32 {
            let row = number / 3;
            let y = TITLE + COLUMNS + row * (HEIGHT + WORDS) + if row > 1 { GROUP } else { 0 };
            for (side, expected) in [PATCH / 4, 3 * PATCH / 4]
                .into_iter()
                .zip(colours(number as u8))
            {
                let x = left(number % 3) + side;
                assert_eq!(pixel(x, y + HEIGHT / 2), expected, "{number}");
            }
        }
        assert_eq!(pixel(2, 2), [255; 3]);
    }
}
