//! Figures: panels side by side with one legend, as SVG and PNG.
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb};

use super::panel::Panel;
use super::style::{Area, DrawResult, GREY, INK, SCALE, SHADE, Style, font, write};

/// Width of a figure as shown, pixels.
const WIDTH: i32 = 1200;
/// Height of a row of panels as shown, pixels.
const ROW: i32 = 440;
/// Height of a line of the legend as shown, pixels.
const LINE: i32 = 24;

/// The symbol at the beginning of a line of the legend.
#[derive(Debug, Clone, Copy)]
pub(super) enum Symbol {
    /// The marker of a series.
    Series(Style),
    /// The dashed line.
    Front,
    /// The shaded range.
    Floor,
    /// No symbol; the line is a remark.
    None,
}

/// Panels in two columns. The legend follows the last panel, or has its own row if the columns
/// are full.
#[derive(Debug)]
pub(super) struct Figure {
    pub(super) panels: Vec<Panel>,
    pub(super) legend: Vec<(Symbol, String)>,
}

impl Figure {
    /// The figure as the text of an SVG file.
    pub(super) fn svg(&self) -> Result<String, String> {
        let rows = self.panels.len().div_ceil(2) as i32;
        let has_free_cell = self.panels.len() % 2 == 1;
        let legend_height = if has_free_cell {
            0
        } else {
            LINE * (self.legend.len() as i32 + 1)
        };
        svg((WIDTH, rows * ROW + legend_height), |area| {
            self.draw(area, rows)
        })
    }

    /// Draws the panels in `rows` rows, and the legend.
    fn draw(&self, area: &Area, rows: i32) -> DrawResult {
        let (above, below) = area.split_vertically(rows * ROW * SCALE);
        let cells = above.split_evenly((rows as usize, 2));
        for (panel, cell) in self.panels.iter().zip(&cells) {
            panel.draw(cell)?;
        }
        self.draw_legend(cells.get(self.panels.len()).unwrap_or(&below))
    }

    /// Draws the legend.
    fn draw_legend(&self, area: &Area) -> DrawResult {
        let left = 70 * SCALE;
        for ((symbol, text), line) in self.legend.iter().zip(1..) {
            let y = line * LINE * SCALE;
            let (from, to) = ((left, y), (left + 36 * SCALE, y));
            let middle = (left + 18 * SCALE, y);
            match symbol {
                Symbol::Series(style) => style.mark(area, middle)?,
                Symbol::Front => {
                    let style = INK.stroke_width(SCALE as u32);
                    let (dash, gap) = (6 * SCALE, 4 * SCALE);
                    area.draw(&DashedPathElement::new([from, to], dash, gap, style))?;
                }
                Symbol::Floor => {
                    let box_ = [(from.0, y), (to.0, y + 9 * SCALE)];
                    area.draw(&Rectangle::new(box_, SHADE.filled()))?;
                    let style = GREY.stroke_width(SCALE as u32);
                    area.draw(&PathElement::new([from, to], style))?;
                }
                Symbol::None => {}
            }
            let start = (to.0 + 14 * SCALE, y);
            write(area, text, start, font(13, &INK), HPos::Left)?;
        }
        Ok(())
    }
}

/// The drawing of `draw` on a white background, as the text of an SVG file of this size (width
/// and height as shown, pixels).
pub(super) fn svg(
    (width, height): (i32, i32),
    draw: impl FnOnce(&Area) -> DrawResult,
) -> Result<String, String> {
    // Drawn larger by SCALE; the header states the size as shown.
    let header = |scale| {
        let (width, height) = (width * scale, height * scale);
        format!("<svg width=\"{width}\" height=\"{height}\"")
    };
    let size = ((width * SCALE) as u32, (height * SCALE) as u32);
    let mut svg = String::new();
    let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
    let drawn = area.fill(&WHITE).and_then(|()| draw(&area));
    let drawn = drawn.and_then(|()| area.present());
    drop(area);
    drawn.map_err(|error| error.to_string())?;
    Ok(svg.replacen(&header(SCALE), &header(1), 1))
}

/// The picture of an SVG file as a PNG file of the same size.
pub(super) fn png(svg: &str) -> Result<Vec<u8>, String> {
    let mut fonts = fontdb::Database::new();
    fonts.load_font_data(dejavu::sans::regular().to_vec());
    fonts.set_sans_serif_family("DejaVu Sans");
    let options = Options {
        fontdb: fonts.into(),
        ..Options::default()
    };
    let tree = Tree::from_str(svg, &options).map_err(|error| error.to_string())?;
    let size = tree.size().to_int_size();
    let mut pixels = Pixmap::new(size.width(), size.height()).ok_or("the picture has no size")?;
    resvg::render(&tree, Transform::identity(), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| error.to_string())
}
