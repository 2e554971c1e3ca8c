//! Drawings as SVG and as PNG. Both are drawn larger than shown, because the drawing library
//! rounds to whole pixels. In a PNG each pixel is the mean of those drawn for it.
use std::error::Error;
use std::io;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::register_font;
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingErrorKind,
};

use super::style::SCALE;

/// The area of a drawing.
pub(super) type Area<'a> = DrawingArea<Canvas<'a>, Shift>;
/// The result of drawing with the library.
pub(super) type DrawResult<T = ()> = Result<T, DrawingAreaErrorKind<io::Error>>;

/// A drawing in both formats.
#[derive(Debug)]
pub(super) struct Drawing {
    /// The text of an SVG file.
    pub(super) svg: String,
    /// A PNG file.
    pub(super) png: Vec<u8>,
}

impl Drawing {
    /// Calls `draw` for each format.
    pub(super) fn new(
        size: (i32, i32),
        draw: impl Fn(&Area) -> DrawResult,
    ) -> Result<Self, String> {
        Ok(Self {
            svg: svg(size, &draw)?,
            png: png(size, &draw)?,
        })
    }
}

/// Fills `canvas` with white and draws on it.
fn drawn(canvas: Canvas<'_>, draw: impl Fn(&Area) -> DrawResult) -> Result<(), String> {
    let font = dejavu::sans::regular();
    register_font("sans-serif", FontStyle::Normal, font)
        .map_err(|_| "the font DejaVu Sans cannot be read")?;
    let area = canvas.into_drawing_area();
    area.fill(&WHITE)
        .and_then(|()| draw(&area))
        .and_then(|()| area.present())
        .map_err(|error| error.to_string())
}

/// The text of an SVG file: what `draw` draws on a white background of this size (width and
/// height as shown, pixels). It draws larger by [`SCALE`].
pub(super) fn svg(
    (width, height): (i32, i32),
    draw: impl Fn(&Area) -> DrawResult,
) -> Result<String, String> {
    // The header states the size as shown.
    let header = |scale| {
        let (width, height) = (width * scale, height * scale);
        format!("<svg width=\"{width}\" height=\"{height}\"")
    };
    let size = ((width * SCALE) as u32, (height * SCALE) as u32);
    let mut svg = String::new();
    drawn(Canvas::Svg(SVGBackend::with_string(&mut svg, size)), draw)?;
    Ok(svg.replacen(&header(SCALE), &header(1), 1))
}

/// A PNG file of the same drawing as [`svg`].
pub(super) fn png(
    (width, height): (i32, i32),
    draw: impl Fn(&Area) -> DrawResult,
) -> Result<Vec<u8>, String> {
    let (width, height, scale) = (width as usize, height as usize, SCALE as usize);
    let size = ((width * scale) as u32, (height * scale) as u32);
    let mut large = vec![0; 3 * width * height * scale * scale];
    let canvas = BitMapBackend::with_buffer(&mut large, size);
    drawn(Canvas::Pixels(canvas), draw)?;

    // Each pixel is the mean of the pixels that were drawn for it, which smooths the edges.
    let mut pixels = Vec::with_capacity(3 * width * height);
    for band in large.chunks_exact(3 * width * scale * scale) {
        for (x, channel) in (0..width).flat_map(|x| (0..3).map(move |channel| (x, channel))) {
            let rows = band.chunks_exact(3 * width * scale);
            let sum: usize = rows
                .flat_map(|row| row[3 * x * scale..3 * (x + 1) * scale].chunks_exact(3))
                .map(|pixel| usize::from(pixel[channel]))
                .sum();
            pixels.push((sum / (scale * scale)) as u8);
        }
    }
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::High);
    encoder
        .write_header()
        .and_then(|mut writer| writer.write_image_data(&pixels))
        .map_err(|error| error.to_string())?;
    Ok(file)
}

/// What a drawing is drawn on.
pub(super) enum Canvas<'a> {
    /// The text of an SVG file.
    Svg(SVGBackend<'a>),
    /// Pixels in memory, three bytes each.
    Pixels(BitMapBackend<'a>),
}

type Outcome = Result<(), DrawingErrorKind<io::Error>>;

/// The error of drawing pixels as one of writing an SVG file.
fn as_io<E: Error + Send + Sync>(error: DrawingErrorKind<E>) -> DrawingErrorKind<io::Error> {
    match error {
        DrawingErrorKind::DrawingError(error) => {
            DrawingErrorKind::DrawingError(io::Error::other(error.to_string()))
        }
        DrawingErrorKind::FontError(error) => DrawingErrorKind::FontError(error),
    }
}

/// Calls a method of the canvas at hand.
macro_rules! draw {
    ($canvas:expr, $method:ident($($argument:expr),*)) => {
        match $canvas {
            Canvas::Svg(svg) => svg.$method($($argument),*),
            Canvas::Pixels(pixels) => pixels.$method($($argument),*).map_err(as_io),
        }
    };
}

impl DrawingBackend for Canvas<'_> {
    type ErrorType = io::Error;

    fn get_size(&self) -> (u32, u32) {
        match self {
            Self::Svg(svg) => svg.get_size(),
            Self::Pixels(pixels) => pixels.get_size(),
        }
    }

    fn ensure_prepared(&mut self) -> Outcome {
        draw!(self, ensure_prepared())
    }

    fn present(&mut self) -> Outcome {
        draw!(self, present())
    }

    fn draw_pixel(&mut self, point: BackendCoord, color: BackendColor) -> Outcome {
        draw!(self, draw_pixel(point, color))
    }

    fn draw_line<S: BackendStyle>(
        &mut self,
        from: BackendCoord,
        to: BackendCoord,
        style: &S,
    ) -> Outcome {
        draw!(self, draw_line(from, to, style))
    }

    fn draw_rect<S: BackendStyle>(
        &mut self,
        upper_left: BackendCoord,
        bottom_right: BackendCoord,
        style: &S,
        fill: bool,
    ) -> Outcome {
        draw!(self, draw_rect(upper_left, bottom_right, style, fill))
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        path: I,
        style: &S,
    ) -> Outcome {
        draw!(self, draw_path(path, style))
    }

    fn draw_circle<S: BackendStyle>(
        &mut self,
        center: BackendCoord,
        radius: u32,
        style: &S,
        fill: bool,
    ) -> Outcome {
        draw!(self, draw_circle(center, radius, style, fill))
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        corners: I,
        style: &S,
    ) -> Outcome {
        draw!(self, fill_polygon(corners, style))
    }

    fn draw_text<S: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &S,
        position: BackendCoord,
    ) -> Outcome {
        draw!(self, draw_text(text, style, position))
    }
}
